//! The sentences and numbers of reports.

use super::options::Options;
use crate::finding::{Diagnosis, Entry, Finding, Reason, Report, Verdict};

/// The name of a verdict.
pub(super) fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Consistent => "consistent",
        Verdict::Inexact => "inexact",
        Verdict::NotChecked => "not checked",
        Verdict::Wrong => "wrong",
    }
}

/// The verdict of a finding in a table. Kinks are marked, because they do not count against the law.
pub(super) fn label(finding: &Finding) -> String {
    let kink = finding.verdict == Verdict::NotChecked && !finding.unexplained();
    format!("{}{}", verdict(finding.verdict), if kink { ", kink" } else { "" })
}

/// A number with two digits: "3.2e-7".
pub(super) fn number(value: f64) -> String {
    if value == 0.0 { "0".to_owned() } else { format!("{value:.1e}") }
}

/// The smallest planted error that the check saw; "-" without one. A wrong tangent needs no planted error.
pub(super) fn control(finding: &Finding) -> String {
    finding.control.map_or_else(|| "-".to_owned(), number)
}

/// A count of calls in at most six characters.
pub(super) fn calls(count: usize) -> String {
    if count < 1_000_000 { count.to_string() } else { format!("{:.0e}", count as f64) }
}

/// Text in one line: control characters as escapes, so that no text can break a table or steer a terminal.
pub(super) fn visible(text: &str) -> String {
    let mut line = String::with_capacity(text.len());
    for character in text.chars() {
        if character.is_control() {
            line.extend(character.escape_default());
        } else {
            line.push(character);
        }
    }
    line
}

/// Why a tangent is inexact or was not checked.
pub(super) fn cause(reason: Option<&Reason>) -> String {
    match reason {
        Some(Reason::ForwardDifference(h)) => format!("The tangent is a forward difference with h ≈ {h:.0e}."),
        Some(Reason::SinglePrecision) => "Single precision: look for a literal like 1./3. in the tangent.".to_owned(),
        Some(Reason::LocalIteration(size)) => format!("A local iteration of the law ends at {size:.0e} of its stress."),
        Some(Reason::RoundOff) => "Round-off of 1 − D: nearly nothing is left of the stiffness.".to_owned(),
        Some(Reason::NotFound) => "No cause was found.".to_owned(),
        Some(Reason::Kink) => {
            "The derivatives to both sides differ: the state lies on a kink, such as a yield surface.".to_owned()
        }
        Some(Reason::NothingExercised) => "No perturbation changed the response.".to_owned(),
        Some(Reason::ZeroResponse) => "Response and tangent are zero.".to_owned(),
        Some(Reason::TooNoisy(size)) => {
            format!("The noise of the law hides errors of relative size {} and smaller.", number(*size))
        }
        Some(Reason::ControlMissed(size)) => {
            format!("The check did not see an error of relative size {} that it had planted itself.", number(*size))
        }
        Some(Reason::CallFailed(text)) => text.clone(),
        None => "The check gave no reason.".to_owned(),
    }
}

/// The advice about a reason.
fn advice(reason: Option<&Reason>) -> &'static str {
    match reason {
        Some(Reason::ForwardDifference(_)) => "derive the tangent, or take central differences or dual numbers",
        Some(Reason::SinglePrecision) => "write 1.d0/3.d0 for 1./3., and declare all reals in double precision",
        Some(Reason::LocalIteration(_)) => "tighten the tolerance of the local iteration",
        Some(Reason::RoundOff) => "store 1 − D, or bound D below 1",
        Some(Reason::NotFound) => "look for small terms that the tangent leaves out",
        Some(Reason::Kink) => "choose states away from yield surfaces and other kinks",
        Some(Reason::NothingExercised) => "choose states in which the law responds to its strain",
        Some(Reason::ZeroResponse) => "choose loaded states, and look at the parameters of the law",
        Some(Reason::TooNoisy(_) | Reason::ControlMissed(_)) => {
            "compute in double precision, and tighten the tolerance of local iterations in the law"
        }
        Some(Reason::CallFailed(_)) => "mend what the sentence names, and call the law in this state alone",
        None => "report this to the authors of the check",
    }
}

/// The name of an entry, ∂row/∂column. A rate is no derivative by the rate of deformation D: "σ₁₂ by D₁₃". Names that are indices
/// alone, "12", are spelt out. A component without a name is counted from 1.
fn entry_name(report: &Report, entry: &Entry) -> String {
    let index = |name: &str| name.starts_with(|first: char| first.is_ascii_digit());
    match (report.rows.get(entry.row), report.columns.get(entry.column)) {
        (Some(row), Some(column)) if index(row) => format!("component {row} by component {column}"),
        (Some(row), Some(column)) if column.starts_with('D') => format!("{row} by {column}"),
        (Some(row), Some(column)) => format!("∂{row}/∂{column}"),
        _ => format!("row {}, column {}", entry.row.saturating_add(1), entry.column.saturating_add(1)),
    }
}

/// The decimals that tell two numbers apart: ⌊log₁₀(max(|a|, |b|)/|a − b|)⌋ + 1, between 1 and 16.
fn decimals(a: f64, b: f64) -> usize {
    let ratio = a.abs().max(b.abs()) / (a - b).abs();
    if ratio.is_finite() { (ratio.log10().floor() + 1.0).clamp(1.0, 16.0) as usize } else { 1 }
}

/// An entry with its numbers: "∂σ₁₂/∂ε₁₃: claimed 3.2e3, measured 1.6e3 ± 2e-7".
pub(super) fn entry(report: &Report, entry: &Entry) -> String {
    let Entry { claimed, measured, error, .. } = *entry;
    let digits = decimals(claimed, measured);
    let name = entry_name(report, entry);
    format!("{name}: claimed {claimed:.digits$e}, measured {measured:.digits$e} ± {error:.0e}")
}

/// The consistent findings in a sentence, with their greatest numbers; `None` without any.
pub(super) fn summary(report: &Report) -> Option<String> {
    let all: Vec<&Finding> = report.findings.iter().filter(|finding| finding.verdict == Verdict::Consistent).collect();
    let greatest = |of: &dyn Fn(&Finding) -> f64| number(all.iter().map(|finding| of(finding)).fold(0.0, f64::max));
    let deviation = greatest(&|finding| finding.deviation);
    let error = greatest(&|finding| finding.error);
    // Where response and tangent are zero, no error is planted.
    let seen = all.iter().filter_map(|finding| finding.control).reduce(f64::max);
    let seen = seen.map_or(String::new(), |seen| format!(" planted errors seen from {} on,", number(seen)));
    let fewest = all.iter().map(|finding| finding.calls).min()?;
    let most = all.iter().map(|finding| finding.calls).max()?;
    let count = all.len();
    let all = if count == 1 { "1 is".to_owned() } else { format!("{count} are") };
    let cost = match (fewest, most) {
        (fewest, most) if fewest == most => format!("{} calls", calls(most)),
        _ => format!("{} to {} calls", calls(fewest), calls(most)),
    };
    Some(format!(
        "{all} consistent: deviation ≤ {deviation} of the greatest entry, differences exact to {error},{seen} \
         {cost}{}.",
        if count == 1 { "" } else { " each" }
    ))
}

/// A finding in sentences.
pub(super) fn finding(report: &Report, finding: &Finding) -> String {
    let deviation = number(finding.deviation);
    let error = number(finding.error);
    let worst = finding.worst.map_or_else(String::new, |worst| format!(" {}.", entry(report, &worst)));
    match finding.verdict {
        Verdict::Consistent => format!("The tangent is the derivative within {error} of the greatest entry."),
        Verdict::Inexact => format!(
            "The tangent is inexact: the deviation is {deviation} of the greatest entry, the error of the differences \
             {error}. {}{worst}",
            cause(finding.reason.as_ref())
        ),
        Verdict::NotChecked => format!("The tangent could not be checked. {}", cause(finding.reason.as_ref())),
        Verdict::Wrong => format!(
            "The tangent is not the derivative: the deviation is {deviation} of the greatest entry, the error of the \
             differences {error}.{worst}"
        ),
    }
}

/// A finding in sentences, and below a wrong one the diagnoses.
pub(super) fn with_diagnoses(report: &Report, one: &Finding) -> Vec<String> {
    let diagnoses = report.diagnoses.iter().filter(|_| one.verdict == Verdict::Wrong).map(diagnosis);
    std::iter::once(finding(report, one)).chain(diagnoses).collect()
}

/// A part, never rounded up.
fn part(part: f64) -> String {
    if part > 1.0 - 1e-6 { "all".to_owned() } else { format!("{:.1} %", (1000.0 * part).floor() / 10.0) }
}

/// A diagnosis in sentences, with the mistakes that look the same and the states that tell them apart.
pub(super) fn diagnosis(diagnosis: &Diagnosis) -> String {
    let mut text = diagnosis.sentence.clone();
    text += &format!(" It explains {} of the deviation.", part(diagnosis.share));
    let told = diagnosis
        .candidates
        .iter()
        .all(|one| text.contains(one.trim_start_matches("Your tangent is ").trim_end_matches('.')));
    if diagnosis.candidates.len() > 1 && !told {
        text += &format!(" These mistakes look the same in the states tried: {}.", diagnosis.candidates.join("; "));
    }
    if !diagnosis.states_that_tell.is_empty() {
        text += &format!(" States that may tell them apart: {}.", diagnosis.states_that_tell.join("; "));
    }
    text
}

/// The verdict over the report in a sentence, and what to do next.
pub(super) fn conclusion(report: &Report, options: &Options) -> String {
    let mut text = match report.verdict() {
        Verdict::Wrong => wrong(report),
        Verdict::Inexact => inexact(report),
        Verdict::Consistent => consistent(report),
        Verdict::NotChecked => not_checked(report),
    };
    if !options.allow_inexact && report.verdict() != Verdict::Wrong && count(report, Verdict::Inexact) > 0 {
        text += " An inexact tangent fails here; the option \"allow inexact\" lets it pass.";
    }
    text
}

fn count(report: &Report, verdict: Verdict) -> usize {
    report.findings.iter().filter(|finding| finding.verdict == verdict).count()
}

fn unexplained(report: &Report) -> impl Iterator<Item = &Finding> {
    report.findings.iter().filter(|finding| finding.unexplained())
}

/// "3 of 12 checks".
fn share(part: usize, report: &Report) -> String {
    let all = report.findings.len();
    format!("{part} of {all} {}", if all == 1 { "check" } else { "checks" })
}

fn wrong(report: &Report) -> String {
    let part = share(count(report, Verdict::Wrong), report);
    let next = if report.diagnoses.is_empty() {
        "look for the term behind the worst entry, correct it, and check again"
    } else {
        "correct what the diagnosis names, and check again"
    };
    let others = match unexplained(report).count() {
        0 => String::new(),
        1 => " One check cannot tell.".to_owned(),
        others => format!(" {others} checks cannot tell."),
    };
    format!("Verdict: wrong. The tangent is not the derivative in {part}.{others} Next: {next}.")
}

fn inexact(report: &Report) -> String {
    let part = share(count(report, Verdict::Inexact), report);
    let first = report.findings.iter().find(|finding| finding.verdict == Verdict::Inexact);
    let reason = first.and_then(|finding| finding.reason.as_ref());
    format!("Verdict: inexact. The tangent is slightly off in {part}. {} Next: {}.", cause(reason), advice(reason))
}

fn consistent(report: &Report) -> String {
    let part = share(count(report, Verdict::Consistent), report);
    let kinks = match count(report, Verdict::NotChecked) {
        0 => String::new(),
        1 => " One state lies on a kink and was not checked.".to_owned(),
        kinks => format!(" {kinks} states lie on kinks and were not checked."),
    };
    format!("Verdict: consistent. The tangent is the derivative in {part}.{kinks}")
}

fn not_checked(report: &Report) -> String {
    if report.findings.is_empty() {
        return "Verdict: not checked. The report has no findings. Next: choose at least one state.".to_owned();
    }
    let Some(first) = unexplained(report).next() else {
        let zero = report.findings.iter().any(|finding| finding.reason == Some(Reason::ZeroResponse));
        let (why, reason) = match zero {
            true => ("Response and tangent are zero in all states away from kinks", Reason::ZeroResponse),
            false => ("All states lie on kinks", Reason::Kink),
        };
        return format!("Verdict: not checked. {why}. Next: {}.", advice(Some(&reason)));
    };
    let part = share(unexplained(report).count(), report);
    let next = advice(first.reason.as_ref());
    format!("Verdict: not checked. {part} cannot tell whether the tangent is the derivative. Next: {next}.")
}
