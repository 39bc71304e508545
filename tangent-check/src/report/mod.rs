//! Reports for people and machines: a [`Report`] in seven formats.
//!
//! All formats agree about failure: the JUnit report has a failed test, the annotations an `::error` and the SARIF log a result of level
//! `error` if and only if [`Report::exit_code`] is not 0. The same report gives the same bytes.

mod github;
mod json;
mod junit;
mod markdown;
mod options;
mod sarif;
mod severity;
mod terminal;
mod words;

pub use options::Options;

use crate::finding::{Finding, Reason, Report, Verdict};
use crate::listed::listed;
use std::fmt;
use terminal::Rows;

listed! {
    /// A format of a report.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    Format, name "The name on a command line.":
    /// Plain text, at most 100 characters wide: the worst findings in a table and in sentences, the consistent ones in one sentence.
    Terminal "terminal",
    /// [`Format::Terminal`] with all findings in the table.
    TerminalFull "terminal-full",
    /// For the summary of a job: append it to the file `$GITHUB_STEP_SUMMARY`.
    Markdown "markdown",
    /// XML after the schema of Jenkins' xUnit plugin (junit-10.xsd).
    Junit "junit",
    /// Annotations of GitHub Actions, workflow commands for the standard output.
    Github "github",
    /// A log after SARIF 2.1.0, for code scanning.
    Sarif "sarif",
    /// All numbers, for programs. [`JSON_SCHEMA`] describes it.
    Json "json",
}

/// The JSON Schema of [`Format::Json`].
pub const JSON_SCHEMA: &str = include_str!("json.schema.json");

impl Format {
    /// The format with this name.
    ///
    /// # Errors
    /// No format has this name. The error lists the names.
    pub fn from_name(name: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        let unknown = || format!("There is no report format \"{}\". Allowed are: {}.", name.escape_debug(), names());
        Self::ALL.into_iter().find(|format| format.name() == name).ok_or_else(unknown)
    }
}

/// The name: "not checked".
impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(words::verdict(*self))
    }
}

/// A sentence: "No perturbation changed the response."
impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&words::cause(Some(self)))
    }
}

impl Report {
    /// A report over findings, without names of components, notes and diagnoses.
    pub fn new(subject: &str, findings: Vec<Finding>) -> Self {
        Self {
            subject: subject.to_owned(),
            convention: String::new(),
            rows: Vec::new(),
            columns: Vec::new(),
            seed: 0,
            findings,
            diagnoses: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// The exit code of a program: 0 consistent, or inexact where that is allowed; 1 wrong or inexact; 2 not checked.
    pub fn exit_code(&self, options: &Options) -> u8 {
        let inexact = self.findings.iter().any(|finding| finding.verdict == Verdict::Inexact);
        match self.verdict() {
            Verdict::Wrong => 1,
            _ if inexact && !options.allow_inexact => 1,
            Verdict::Consistent | Verdict::Inexact => 0,
            Verdict::NotChecked => 2,
        }
    }

    /// Fails a test unless the tangent is consistent.
    ///
    /// # Panics
    /// [`Report::exit_code`] is not 0. The message is the report for the terminal.
    #[track_caller]
    pub fn assert_consistent(&self) {
        let options = Options::default();
        assert!(self.exit_code(&options) == 0, "\n{}", write(self, Format::Terminal, &options));
    }
}

/// A report in a format. The text ends with a line break, unless it is empty: a consistent tangent has no annotations.
pub fn write(report: &Report, format: Format, options: &Options) -> String {
    match format {
        Format::Terminal => terminal::write(report, options, Rows::Worst),
        Format::TerminalFull => terminal::write(report, options, Rows::All),
        Format::Markdown => markdown::write(report, options),
        Format::Junit => junit::write(report, options),
        Format::Github => github::write(report, options),
        Format::Sarif => sarif::write(report, options),
        Format::Json => json::write(report, options),
    }
}
