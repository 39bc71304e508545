//! The severity of findings, which all formats for machines share.

use super::options::Options;
use super::words;
use crate::finding::{Finding, Report, Verdict};
use std::cmp::Reverse;

/// The meaning of a finding for a build, from best to worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Severity {
    /// The tangent is the derivative.
    Passed,
    /// The state lies on a kink and says nothing about the law.
    Skipped,
    /// The tangent is inexact, and that is allowed.
    Warning,
    /// The build must fail.
    Error,
}

/// The severity of a finding.
pub(super) fn severity(finding: &Finding, options: &Options) -> Severity {
    match finding.verdict {
        Verdict::Consistent => Severity::Passed,
        Verdict::Inexact if options.allow_inexact => Severity::Warning,
        Verdict::Inexact => Severity::Error,
        Verdict::NotChecked if finding.unexplained() => Severity::Error,
        Verdict::NotChecked => Severity::Skipped,
        Verdict::Wrong => Severity::Error,
    }
}

/// The findings of a severity: wrong ones first, then by their deviation, the greatest first.
pub(super) fn worst_first<'a>(report: &'a Report, options: &Options, wanted: Severity) -> Vec<&'a Finding> {
    let has_severity = |finding: &&Finding| severity(finding, options) == wanted;
    let mut findings: Vec<&Finding> = report.findings.iter().filter(has_severity).collect();
    findings.sort_by(|a, b| Reverse(a.verdict).cmp(&Reverse(b.verdict)).then(b.deviation.total_cmp(&a.deviation)));
    findings
}

/// The failure of a report without a failed finding: it has no findings, or all of its states lie on kinks.
pub(super) fn failure_of_the_whole(report: &Report, options: &Options) -> Option<String> {
    let failed = report.findings.iter().any(|finding| severity(finding, options) == Severity::Error);
    (!failed && report.exit_code(options) != 0).then(|| words::conclusion(report, options))
}
