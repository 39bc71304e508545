//! Annotations of GitHub Actions: workflow commands, `::error file=…,title=…::message`.

use super::options::Options;
use super::severity::{Severity, failure_of_the_whole, worst_first};
use super::words;
use crate::finding::{Finding, Report, Verdict};

/// GitHub shows ten annotations of a kind a step.
const LIMIT: usize = 10;

pub(super) fn write(report: &Report, options: &Options) -> String {
    let whole = failure_of_the_whole(report, options);
    let mut errors: Vec<(String, String)> = whole.into_iter().map(|text| (report.subject.clone(), text)).collect();
    errors.extend(worst_first(report, options, Severity::Error).into_iter().map(|finding| texts(report, finding)));
    let warnings = worst_first(report, options, Severity::Warning);
    let warnings = warnings.into_iter().map(|finding| texts(report, finding)).collect();
    commands("error", errors, options) + &commands("warning", warnings, options)
}

/// The title and message of a finding.
fn texts(report: &Report, finding: &Finding) -> (String, String) {
    let tangent = match finding.verdict {
        Verdict::Consistent => "Consistent tangent",
        Verdict::Inexact => "Inexact tangent",
        Verdict::NotChecked => "Tangent not checked",
        Verdict::Wrong => "Wrong tangent",
    };
    (format!("{tangent}: {}", finding.name), words::with_diagnoses(report, finding).join("\n"))
}

/// Commands of one kind. The last of too many says how many more there are.
fn commands(kind: &str, mut texts: Vec<(String, String)>, options: &Options) -> String {
    if texts.len() > LIMIT {
        let more = texts.len() - (LIMIT - 1);
        texts.truncate(LIMIT - 1);
        texts.push((
            format!("{more} more"),
            format!("There are {more} more of this kind. The other reports list them."),
        ));
    }
    let file = options.file.as_ref().map_or_else(String::new, |file| format!("file={},", property(file)));
    let command =
        |(title, message): (String, String)| format!("::{kind} {file}title={}::{}\n", property(&title), data(&message));
    texts.into_iter().map(command).collect()
}

/// The message of a command. `%` and line breaks are percent-encoded; other control characters are shown as escapes.
fn data(text: &str) -> String {
    let mut encoded = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '%' => encoded += "%25",
            '\r' => encoded += "%0D",
            '\n' => encoded += "%0A",
            _ if character.is_control() => encoded.extend(character.escape_default()),
            _ => encoded.push(character),
        }
    }
    encoded
}

/// A property of a command, in which `:` and `,` are marks, too.
fn property(text: &str) -> String {
    data(text).replace(':', "%3A").replace(',', "%2C")
}
