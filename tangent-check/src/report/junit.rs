//! JUnit XML after the schema of Jenkins' xUnit plugin: junit-10.xsd of github.com/jenkinsci/xunit-plugin.

use super::options::Options;
use super::severity::{Severity, failure_of_the_whole, severity};
use super::words;
use crate::finding::{Finding, Report};

pub(super) fn write(report: &Report, options: &Options) -> String {
    let count = |wanted| report.findings.iter().filter(|finding| severity(finding, options) == wanted).count();
    let whole = failure_of_the_whole(report, options);
    let extra = usize::from(whole.is_some());
    let failures = count(Severity::Error) + extra;
    let skipped = count(Severity::Skipped);
    let totals = format!("tests=\"{}\" failures=\"{failures}\" errors=\"0\"", report.findings.len() + extra);
    let subject = escaped(&report.subject);
    let mut text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n".to_owned();
    text += &format!("<testsuites name=\"tangent-check\" {totals}>\n");
    text += &format!("  <testsuite name=\"{subject}\" {totals} skipped=\"{skipped}\">\n");
    text += &properties(report);
    for finding in &report.findings {
        text += &test_case(report, finding, options);
    }
    if let Some(message) = whole {
        text += &format!("    <testcase name=\"verdict\" classname=\"{subject}\">\n");
        text += &format!("      <failure type=\"not checked\" message=\"{}\"/>\n", escaped(&message));
        text += "    </testcase>\n";
    }
    text += &format!("    <system-out>{}</system-out>\n", escaped(&closing(report, options)));
    text + "  </testsuite>\n</testsuites>\n"
}

fn properties(report: &Report) -> String {
    let convention = escaped(&report.convention);
    format!(
        "    <properties>\n      <property name=\"convention\" value=\"{convention}\"/>\n      <property name=\"seed\" value=\"{}\"/>\n    </properties>\n",
        report.seed
    )
}

fn test_case(report: &Report, finding: &Finding, options: &Options) -> String {
    let message = escaped(&words::finding(report, finding));
    let verdict = words::verdict(finding.verdict);
    let outcome = match severity(finding, options) {
        Severity::Passed => String::new(),
        Severity::Warning => format!("      <system-out>{message}</system-out>\n"),
        Severity::Skipped => format!("      <skipped type=\"kink\" message=\"{message}\"/>\n"),
        Severity::Error => {
            let body = escaped(&words::with_diagnoses(report, finding)[1..].join("\n"));
            format!("      <failure type=\"{verdict}\" message=\"{message}\">{body}</failure>\n")
        }
    };
    let name = escaped(&finding.name);
    let class = escaped(&report.subject);
    format!("    <testcase name=\"{name}\" classname=\"{class}\">\n{outcome}    </testcase>\n")
}

fn closing(report: &Report, options: &Options) -> String {
    let mut lines = report.notes.clone();
    lines.push(words::conclusion(report, options));
    lines.join("\n")
}

/// Text for an attribute or element. White space that XML would normalise is a character reference.
/// XML 1.0 has no way to write other control characters, U+FFFE and U+FFFF; they are shown as escapes, "\u{1b}".
fn escaped(text: &str) -> String {
    let mut xml = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '<' => xml += "&lt;",
            '>' => xml += "&gt;",
            '&' => xml += "&amp;",
            '"' => xml += "&quot;",
            '\'' => xml += "&apos;",
            '\t' | '\n' | '\r' => xml += &format!("&#{};", character as u32),
            '\u{fffe}' | '\u{ffff}' => xml.extend(character.escape_unicode()),
            _ if character.is_control() => xml.extend(character.escape_unicode()),
            _ => xml.push(character),
        }
    }
    xml
}
