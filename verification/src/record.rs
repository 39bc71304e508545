//! The record that a full run leaves in the repository: verification/FULL.md, a passage of README.md, and a passage of the manual's limits.
//! Its tables go elsewhere.

use crate::known;
use crate::report::{Counts, Report, chain, worst};
use crate::studies::{Outcome, StudyError};
use crate::table::Table;
use std::fs;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::SystemTime;

/// The result of a study in one line.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The name of the study.
    pub study: &'static str,
    /// Whether the study passed.
    pub passed: bool,
    /// The counts of its cells.
    pub counts: Counts,
    /// The worst judged cell, or the reason why there is none.
    pub worst: String,
    /// Every cell that fails.
    pub failures: Vec<String>,
    /// Every known failure that still fails.
    pub known: Vec<String>,
    /// The duration of the study.
    pub seconds: f64,
}

impl Finding {
    /// The finding of a study's result.
    pub fn of(study: &'static str, result: &Result<Outcome, StudyError>, seconds: f64) -> Self {
        let none = Self {
            study,
            passed: false,
            counts: Counts::default(),
            worst: String::new(),
            failures: Vec::new(),
            known: Vec::new(),
            seconds,
        };
        match result {
            Ok(outcome) => {
                let cells =
                    outcome.reports.iter().flat_map(|report| report.cells().iter().map(move |cell| (report, cell)));
                let line = |report: &Report, cell: &crate::Cell| {
                    format!("{}: {}: {}", report.title(), cell.name(), cell.finding())
                };
                let lines = |verdict| {
                    cells.clone().filter(|(_, cell)| cell.verdict() == verdict).map(|(r, c)| line(r, c)).collect()
                };
                let worst = worst(outcome.reports.iter().filter_map(Report::worst));
                let worst = worst
                    .map_or_else(|| "nothing is judged".into(), |cell| format!("{}: {}", cell.name(), cell.finding()));
                Self {
                    passed: outcome.passed(),
                    counts: outcome.counts(),
                    worst,
                    failures: lines(crate::Verdict::Failed),
                    known: lines(crate::Verdict::Known),
                    ..none
                }
            }
            Err(error) => {
                // The first line names the failure; the output of a compiler may follow.
                let error = chain(error.as_ref());
                let first = error.lines().next().unwrap_or_default();
                Self { worst: format!("could not be finished: {first}"), ..none }
            }
        }
    }
}

fn word(passed: bool) -> &'static str {
    if passed { "PASS" } else { "FAIL" }
}

/// One line for all studies: the verdict, the number of studies, the number of cells.
fn total(findings: &[Finding]) -> String {
    let (passed, all) = (findings.iter().filter(|finding| finding.passed).count(), findings.len());
    let counts: Counts = findings.iter().map(|finding| finding.counts).sum();
    format!("{}: {passed} of {all} studies pass; {counts}", word(passed == all))
}

/// The verdicts of all studies, and the known failures, as printed at the end of a run.
pub fn summary(findings: &[Finding]) -> String {
    let study = |finding: &Finding| {
        let Finding { study, passed, counts, seconds, .. } = finding;
        format!("{}  {study:<14} {seconds:8.1} s  {counts}\n", word(*passed))
    };
    let known = findings.iter().flat_map(|finding| finding.known.iter().map(move |line| (finding.study, line)));
    let known = known.map(|(study, line)| format!("known failure: {study}: {line}\n"));
    let studies = findings.iter().map(study);
    format!("{}{}{}\n", studies.collect::<String>(), known.collect::<String>(), total(findings))
}

/// The tree and the machine of a run.
#[derive(Clone, Debug)]
pub struct Run {
    commit: String,
    machine: String,
}

impl Run {
    /// A run that starts now, of the tree at `root`.
    ///
    /// # Errors
    /// If README.md or the page of limits cannot be read or lacks the passage that the run is to write.
    pub fn starting(root: &Path) -> io::Result<Self> {
        for (file, name) in [LAST_RUN, LIMITS] {
            passage(&fs::read_to_string(root.join(file))?, name)?;
        }
        Ok(Self { commit: commit(root), machine: machine() })
    }

    /// Writes the text of the whole run into `target`/verification, and returns the path. Writes the findings to verification/FULL.md, the
    /// verdict to README.md, and the list of known failures to the page of limits.
    ///
    /// # Errors
    /// Errors of reading and writing these files.
    pub fn keep(&self, root: &Path, target: &Path, findings: &[Finding], text: &[u8]) -> io::Result<PathBuf> {
        let folder = target.join("verification");
        fs::create_dir_all(&folder)?;
        let tables = folder.join("full.txt");
        fs::write(&tables, text)?;
        let date = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
        fs::write(root.join("verification").join("FULL.md"), self.full(findings, &date))?;
        for ((file, name), by) in [(LAST_RUN, self.sentence(findings, &date)), (LIMITS, known::markdown())] {
            let text = fs::read_to_string(root.join(file))?;
            fs::write(root.join(file), replaced(&text, name, &by)?)?;
        }
        tables.canonicalize()
    }

    fn sentence(&self, findings: &[Finding], date: &str) -> String {
        let day = date.split('T').next().unwrap_or(date);
        format!(
            "The last full verification, `cargo verify full`, {day}, {}: {}. Its verdicts are in \
             [`verification/FULL.md`](verification/FULL.md).\n",
            self.commit,
            total(findings)
        )
    }

    fn full(&self, findings: &[Finding], date: &str) -> String {
        let mut studies = Table::new(
            "Studies",
            ["study", "verdict", "judged", "shown", "known failures", "closest to its bound, or worst", "s"],
        );
        for Finding { study, passed, counts, worst, seconds, .. } in findings {
            let numbers = [counts.judged, counts.shown, counts.known].map(|count| count.to_string());
            let [judged, shown, known] = numbers;
            studies.push([
                (*study).into(),
                word(*passed).into(),
                judged,
                shown,
                known,
                worst.clone(),
                format!("{seconds:.0}"),
            ]);
        }
        let list = |title: &str, lines: fn(&Finding) -> &[String]| {
            let items: String = findings
                .iter()
                .flat_map(|one| lines(one).iter().map(move |line| format!("- {}: {line}\n", one.study)))
                .collect();
            if items.is_empty() { items } else { format!("\n**{title}**\n\n{items}") }
        };
        format!(
            "# The last full verification\n\n`cargo verify full`, {date}, {}, {}. The studies of the paper run with short \
             effort here; their long sweeps are in `RESULTS.md`. All tables are in `target/verification/full.txt` where the \
             command was run.\n\n{}.\n\n{}{}{}",
            self.commit,
            self.machine,
            total(findings),
            studies.markdown(),
            list("Cells that fail", |one| &one.failures),
            list("Known failures", |one| &one.known),
        )
    }
}

/// The file and the passage about the last full run.
pub const LAST_RUN: (&str, &str) = ("README.md", "last-full-verification");

/// The file and the passage that lists the known failures.
pub const LIMITS: (&str, &str) = ("docs/src/limits.md", "known-failures");

/// The text between `<!-- name -->` and `<!-- /name -->`, each on a line of its own.
///
/// # Errors
/// If one of the two marks is missing or occurs twice.
pub fn passage<'a>(text: &'a str, name: &str) -> io::Result<&'a str> {
    Ok(&text[place(text, name)?])
}

/// The byte range of the passage.
fn place(text: &str, name: &str) -> io::Result<Range<usize>> {
    let once = |line: &str| {
        let mut places = text.match_indices(line).map(|(at, _)| at);
        places.next().filter(|_| places.next().is_none())
    };
    let (start, end) = (format!("<!-- {name} -->\n"), format!("<!-- /{name} -->\n"));
    match (once(&start), once(&end)) {
        (Some(from), Some(to)) if from + start.len() <= to => Ok(from + start.len()..to),
        _ => Err(io::Error::new(
            io::ErrorKind::InvalidData,
            format!("no passage from `{}` to `{}`", start.trim(), end.trim()),
        )),
    }
}

/// The text with another passage of this name.
///
/// # Errors
/// The errors of [`passage`].
pub fn replaced(text: &str, name: &str, by: &str) -> io::Result<String> {
    let place = place(text, name)?;
    Ok([&text[..place.start], by, &text[place.end..]].concat())
}

/// The commit of the tree, or a note that the tree differs from its commit.
fn commit(root: &Path) -> String {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).current_dir(root).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_string())
    };
    match (git(&["rev-parse", "--short=12", "HEAD"]), git(&["status", "--porcelain"])) {
        (Some(commit), Some(changes)) if changes.is_empty() => format!("commit {commit}"),
        (Some(commit), Some(_)) => format!("no commit: changes to {commit} that are not committed"),
        _ => "no commit: not a git repository".into(),
    }
}

/// The processor and its number of threads.
fn machine() -> String {
    let information = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = information.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let processor = model.map_or(std::env::consts::ARCH, |(_, model)| model.trim());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{processor}, {threads} threads, {}", std::env::consts::OS)
}
