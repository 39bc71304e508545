//! Markdown for the summary of a job.

use super::options::Options;
use super::severity::{Severity, worst_first};
use super::words;
use crate::finding::{Finding, Report};

/// The length of the text in bytes from which on rows are left out. GitHub refuses summaries above 1 MiB.
const TABLE: usize = 400_000;
/// The greatest number of findings in sentences.
const DETAILS: usize = 50;
/// The greatest length of a text that the law or its user gave, in characters.
const LENGTH: usize = 1000;

pub(super) fn write(report: &Report, options: &Options) -> String {
    let mut text = format!("## Tangent check of {}\n\n", escaped(&report.subject));
    text += &format!("**{}**\n", escaped(&words::conclusion(report, options)));
    if !report.findings.is_empty() {
        table(&mut text, report);
    }
    details(&mut text, report, options);
    for diagnosis in &report.diagnoses {
        text += &format!("\nDiagnosis: {}\n", escaped(&words::diagnosis(diagnosis)));
    }
    for note in &report.notes {
        text += &format!("\nNote: {}\n", escaped(note));
    }
    if !report.convention.is_empty() {
        text += &format!("\nConvention: {}\n", escaped(&report.convention));
    }
    if report.seed > 0 {
        text += &format!("\nSeed of the states: {}\n", report.seed);
    }
    text
}

/// All findings in a table that is folded up.
fn table(text: &mut String, report: &Report) {
    if let Some(summary) = words::summary(report) {
        *text += &format!("\n{}\n", escaped(&summary));
    }
    *text += "\n<details><summary>All findings</summary>\n";
    *text += "\n| name | verdict | deviation | error of the differences | smallest planted error seen | calls |\n";
    *text += "|---|---|--:|--:|--:|--:|\n";
    let mut findings = report.findings.iter();
    while text.len() < TABLE
        && let Some(finding) = findings.next()
    {
        *text += &row(finding);
    }
    if findings.len() > 0 {
        *text += &format!("\n{} more rows are left out.\n", findings.len());
    }
    *text += "\n</details>\n";
}

fn row(finding: &Finding) -> String {
    let name = escaped(&finding.name);
    let label = words::label(finding);
    let deviation = words::number(finding.deviation);
    let error = words::number(finding.error);
    let control = words::control(finding);
    format!("| {name} | {label} | {deviation} | {error} | {control} | {} |\n", finding.calls)
}

fn details(text: &mut String, report: &Report, options: &Options) {
    let mut findings = worst_first(report, options, Severity::Error);
    findings.extend(worst_first(report, options, Severity::Warning));
    for finding in findings.iter().take(DETAILS) {
        let verdict = words::verdict(finding.verdict);
        let sentences = escaped(&words::finding(report, finding));
        *text += &format!("\n**{verdict}: {}.** {sentences}\n", escaped(&finding.name));
    }
    if findings.len() > DETAILS {
        *text += &format!("\n{} more findings of this kind are left out.\n", findings.len() - DETAILS);
    }
}

/// Text in one line, with a backslash before each character that Markdown, HTML or GitHub could read as a mark.
fn escaped(text: &str) -> String {
    let mut line = String::new();
    for character in words::visible(text).chars().take(LENGTH) {
        if "\\`*_{}[]<>|~&#!$@".contains(character) {
            line.push('\\');
        }
        line.push(character);
    }
    if text.chars().nth(LENGTH).is_some() {
        line.push('…');
    }
    line
}
