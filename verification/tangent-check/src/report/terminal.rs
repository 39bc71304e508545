//! A table and sentences in plain text.

use super::severity::{Severity, worst_first};
use super::{Options, words};
use crate::finding::{Finding, Report, Verdict};

/// The greatest width of a line, in characters.
const WIDTH: usize = 100;
/// The greatest width of a name in the table.
const NAME: usize = 40;
/// The greatest number of findings that are shown with their numbers below the table.
const DETAILS: usize = 20;

pub(super) fn write(report: &Report, options: &Options) -> String {
    let mut lines = Vec::new();
    heading(&mut lines, report);
    if !report.findings.is_empty() {
        table(&mut lines, report);
    }
    details(&mut lines, report, options);
    for diagnosis in &report.diagnoses {
        paragraph(&mut lines, &format!("Diagnosis: {}", words::diagnosis(diagnosis)));
    }
    for note in &report.notes {
        paragraph(&mut lines, &format!("Note: {note}"));
    }
    blank(&mut lines);
    paragraph(&mut lines, &words::conclusion(report, options));
    lines.join("\n") + "\n"
}

/// An empty line, unless there is one already.
fn blank(lines: &mut Vec<String>) {
    if lines.last().is_some_and(|line| !line.is_empty()) {
        lines.push(String::new());
    }
}

fn heading(lines: &mut Vec<String>, report: &Report) {
    paragraph(lines, &format!("Tangent check of {}", report.subject));
    if !report.convention.is_empty() {
        paragraph(lines, &format!("Convention: {}", report.convention));
    }
    paragraph(lines, &format!("Seed of the states: {}", report.seed));
    blank(lines);
}

fn table(lines: &mut Vec<String>, report: &Report) {
    let names: Vec<String> =
        report.findings.iter().map(|finding| shortened(&words::visible(&finding.name), NAME)).collect();
    let width = names.iter().map(|name| name.chars().count()).max().unwrap_or(0).max("name".len());
    let row = |name: &str, label: &str, deviation: &str, error: &str, seen: &str, calls: &str| {
        format!("{name:width$}  {label:17}  {deviation:>9}  {error:>9}  {seen:>9}  {calls:>6}")
    };
    lines.push(row("name", "verdict", "deviation", "error", "seen", "calls"));
    for (finding, name) in report.findings.iter().zip(&names) {
        let deviation = words::number(finding.deviation);
        let error = words::number(finding.error);
        let calls = words::calls(finding.calls);
        lines.push(row(name, &words::label(finding), &deviation, &error, &words::control(finding), &calls));
    }
    blank(lines);
    paragraph(
        lines,
        "Deviation of the tangent and error of the differences: relative to the greatest entry. Seen: the smallest \
         planted error that the check saw, relative to the spoiled entry.",
    );
}

fn details(lines: &mut Vec<String>, report: &Report, options: &Options) {
    let mut findings = worst_first(report, options, Severity::Error);
    findings.extend(worst_first(report, options, Severity::Warning));
    for finding in findings.iter().take(DETAILS) {
        blank(lines);
        paragraph(lines, &format!("{}: {}", capital(words::verdict(finding.verdict)), finding.name));
        for sentence in numbers(report, finding) {
            wrap(lines, "  ", &sentence);
        }
    }
    if findings.len() > DETAILS {
        blank(lines);
        paragraph(lines, &format!("{} more findings of this kind stand in the table.", findings.len() - DETAILS));
    }
    blank(lines);
}

/// What the table does not show of a finding.
fn numbers(report: &Report, finding: &Finding) -> Vec<String> {
    match finding.verdict {
        Verdict::NotChecked => vec![words::cause(finding.reason.as_ref())],
        _ => finding.worst.iter().map(|entry| words::entry(report, entry)).collect(),
    }
}

fn capital(word: &str) -> String {
    let mut characters = word.chars();
    characters.next().map_or_else(String::new, |first| first.to_uppercase().chain(characters).collect())
}

/// A name whose middle is left out if it is too long: the ends of names tell states apart.
fn shortened(name: &str, width: usize) -> String {
    let characters: Vec<char> = name.chars().collect();
    if characters.len() <= width {
        return name.to_owned();
    }
    let head = width / 2;
    let tail = width - head - 1;
    let start = characters[..head].iter();
    let end = characters[characters.len() - tail..].iter();
    start.chain(&['…']).chain(end).collect()
}

/// Text in lines of the greatest width; all but the first are indented.
fn paragraph(lines: &mut Vec<String>, text: &str) {
    let first = lines.len();
    wrap(lines, "  ", text);
    lines[first] = lines[first].trim_start().to_owned();
}

/// Text in indented lines. Words wider than a line are cut.
fn wrap(lines: &mut Vec<String>, indent: &str, text: &str) {
    let room = WIDTH - indent.len();
    let mut line = String::new();
    let mut used = 0;
    for word in words::visible(text).split_whitespace() {
        let letters: Vec<char> = word.chars().collect();
        for (piece, chunk) in letters.chunks(room).enumerate() {
            if used > 0 && (piece > 0 || used + 1 + chunk.len() > room) {
                lines.push(format!("{indent}{line}"));
                line.clear();
                used = 0;
            }
            if used > 0 {
                line.push(' ');
                used += 1;
            }
            line.extend(chunk);
            used += chunk.len();
        }
    }
    lines.push(format!("{indent}{line}"));
}
