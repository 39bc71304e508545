//! A table and sentences in plain text.

use super::options::Options;
use super::severity::{Severity, worst_first};
use super::words;
use crate::finding::{Finding, Report, Verdict};

/// The greatest width of a line, in characters.
const WIDTH: usize = 100;
/// The space between two columns.
const GAP: usize = 2;
/// The greatest number of findings in the short table.
const ROWS: usize = 10;
/// The greatest number of findings that the short form shows with their worst entry or reason.
const DETAILS: usize = 5;

/// The findings in the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rows {
    /// All, in their order.
    All,
    /// Those that are not consistent, the worst first. The consistent ones are a sentence.
    Worst,
}

pub(super) fn write(report: &Report, options: &Options, rows: Rows) -> String {
    let mut lines = Vec::new();
    heading(&mut lines, report);
    match rows {
        Rows::All => table(&mut lines, &report.findings.iter().collect::<Vec<_>>()),
        Rows::Worst => worst(&mut lines, report, options),
    }
    details(&mut lines, report, options, if rows == Rows::All { usize::MAX } else { DETAILS });
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
    if report.seed > 0 {
        paragraph(lines, &format!("Seed of the states: {}", report.seed));
    }
    blank(lines);
}

/// The worst findings in a table, the consistent ones in a sentence.
fn worst(lines: &mut Vec<String>, report: &Report, options: &Options) {
    let severities = [Severity::Error, Severity::Warning, Severity::Skipped];
    let findings: Vec<&Finding> =
        severities.into_iter().flat_map(|severity| worst_first(report, options, severity)).collect();
    table(lines, &findings[..findings.len().min(ROWS)]);
    if findings.len() > ROWS {
        paragraph(lines, &format!("{} more are not shown. The format terminal-full shows all.", findings.len() - ROWS));
    }
    if let Some(summary) = words::summary(report) {
        paragraph(lines, &summary);
    }
    blank(lines);
}

/// A row for each finding. The name takes the room that the other columns leave, at least 40 characters.
fn table(lines: &mut Vec<String>, findings: &[&Finding]) {
    if findings.is_empty() {
        return;
    }
    let mut rows = vec![["name", "verdict", "deviation", "error", "seen", "calls"].map(str::to_owned)];
    rows.extend(findings.iter().map(|finding| cells(finding)));
    let mut widths = [0; 6];
    for row in &rows {
        for (width, cell) in widths.iter_mut().zip(row) {
            *width = cell.chars().count().max(*width);
        }
    }
    let [name_width, verdict_width, others @ ..] = widths;
    let taken = verdict_width + others.iter().sum::<usize>() + 5 * GAP;
    let name_width = name_width.min(WIDTH - taken);
    for [name, verdict, numbers @ ..] in rows {
        let name = shortened(&name, name_width);
        let mut line = format!("{name:name_width$}{:GAP$}{verdict:verdict_width$}", "");
        for (number, width) in numbers.iter().zip(others) {
            line += &format!("{:GAP$}{number:>width$}", "");
        }
        lines.push(line);
    }
    blank(lines);
    paragraph(
        lines,
        "Deviation of the tangent and error of the differences: relative to the greatest entry. Seen: the smallest \
         planted error that the check saw, relative to the spoiled entry; none is planted in a tangent that is wrong.",
    );
    blank(lines);
}

/// The cells of a row. All but the name have at most 17, 9, 9, 9 and 6 characters.
fn cells(finding: &Finding) -> [String; 6] {
    [
        words::visible(&finding.name),
        words::label(finding),
        words::number(finding.deviation),
        words::number(finding.error),
        words::control(finding),
        words::calls(finding.calls),
    ]
}

/// The worst entry, or the reason, of the first findings.
fn details(lines: &mut Vec<String>, report: &Report, options: &Options, most: usize) {
    let mut findings = worst_first(report, options, Severity::Error);
    findings.extend(worst_first(report, options, Severity::Warning));
    for finding in findings.iter().take(most) {
        blank(lines);
        paragraph(lines, &format!("{}: {}", capital(words::verdict(finding.verdict)), finding.name));
        for sentence in numbers(report, finding) {
            wrap(lines, "  ", &sentence);
        }
    }
    blank(lines);
}

/// The numbers of a finding that the table does not show.
fn numbers(report: &Report, finding: &Finding) -> Vec<String> {
    match finding.verdict {
        Verdict::NotChecked => vec![words::cause(finding.reason.as_ref())],
        Verdict::Inexact => {
            let entry = finding.worst.iter().map(|entry| words::entry(report, entry));
            entry.chain([words::cause(finding.reason.as_ref())]).collect()
        }
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
