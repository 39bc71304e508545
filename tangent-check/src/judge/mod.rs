//! Verdicts: a claimed tangent beside the measured one, and the negative control.

mod cause;
mod check;
mod control;
mod directions;
mod evidence;
mod loose;
mod measured;

pub(crate) use cause::Suspect;
pub use check::{Loading, check_along, check_columns, check_columns_on, measure};
pub use directions::{Directions, Product, Residual, check_directions};
pub use loose::Jump;
pub(crate) use loose::LOOSE;
pub use measured::Measured;

use crate::difference::Estimate;
use crate::finding::{Entry, Finding, Reason, Verdict};
use crate::matrix::Matrix;
use evidence::{ColumnVerdict, Evidence};
use measured::{NOISY, column, greatest};

/// Compares a claimed tangent with the measured derivatives, whose norm ‖C‖ is the greatest entry.
///
/// With the estimated error e of an entry, plus 4 ε ‖C‖ for the round-off of the claimed tangent:
///
/// - At a kink, a column must match D₊ or D₋ within 10 e, with e below 1e-6 ‖C‖. Otherwise it is not checked. The same holds for a column
///   that deviates where a kink cannot be excluded: a side is far less sharp than the best estimate and matches the column, or the last look
///   near √ε contradicts the estimates.
/// - Elsewhere, a deviation above 10 e is wrong. It is inexact if it is below 1e-6 ‖C‖ or 1e-9 of the stiffness at rest, or below
///   1e-4 ‖C‖ if a [`Jump`] explains it.
/// - A tangent of zero, claimed and measured, is consistent if the response is zero.
/// - An error e above 1e-6 ‖C‖ is too noisy.
/// - Then the checker spoils the entries above 1 % of ‖C‖ one by one. If it does not see 1e-3 in each, the tangent is not checked.
///
/// Numbers that are not finite, and sizes that do not agree, are not checked.
pub fn judge(name: &str, claimed: &Matrix, measured: &Measured) -> Finding {
    let size = measured.value.len();
    let mut finding = start(name, claimed, size, measured.columns.len());
    finding.calls = measured.calls;
    finding.noise = relative(greatest(&measured.noise), greatest(&measured.value));
    let fits = |estimate: &Estimate| estimate.value.len() == size && estimate.error.len() == size;
    let whole = measured
        .columns
        .iter()
        .all(|column| [&column.central, &column.forward, &column.backward].into_iter().all(fits));
    if let Some(fault) = fault(claimed, size, measured.columns.len(), whole) {
        return not_checked(finding, Reason::CallFailed(fault));
    }
    let evidence = Evidence::of(measured);
    conclude(finding, &evidence, greatest(&measured.value) == 0.0)
}

/// A finding without a verdict.
fn start(name: &str, claimed: &Matrix, rows: usize, columns: usize) -> Finding {
    let unknown = Matrix { rows, columns, entries: vec![f64::NAN; rows * columns] };
    Finding {
        name: name.to_owned(),
        verdict: Verdict::NotChecked,
        reason: None,
        worst: None,
        deviation: f64::NAN,
        error: f64::NAN,
        noise: f64::NAN,
        control: None,
        calls: 0,
        claimed: claimed.clone(),
        errors: unknown.clone(),
        measured: unknown,
    }
}

fn not_checked(mut finding: Finding, reason: Reason) -> Finding {
    finding.verdict = Verdict::NotChecked;
    finding.reason = Some(reason);
    finding
}

/// A finding of a state in which a call failed.
pub(crate) fn failed(
    name: &str,
    claimed: &Matrix,
    rows: usize,
    columns: usize,
    sentence: String,
    calls: usize,
) -> Finding {
    let mut finding = start(name, claimed, rows, columns);
    finding.calls = calls;
    not_checked(finding, Reason::CallFailed(sentence))
}

/// The sentence over a tangent that cannot be compared.
fn fault(claimed: &Matrix, rows: usize, columns: usize, measured: bool) -> Option<String> {
    let (has_rows, has_columns, entries) = (claimed.rows, claimed.columns, claimed.entries.len());
    if entries != has_rows * has_columns {
        return Some(format!("The claimed tangent has {entries} entries, which are not {has_rows} × {has_columns}."));
    }
    if has_rows != rows || has_columns != columns {
        return Some(format!(
            "The claimed tangent has {has_rows} × {has_columns} entries, but the response asks for {rows} × {columns}."
        ));
    }
    if rows * columns == 0 {
        return Some("The tangent has no entries.".to_owned());
    }
    if let Some(i) = claimed.entries.iter().position(|entry| !entry.is_finite()) {
        let (row, column, entry) = (i / columns, i % columns, claimed.entries[i]);
        return Some(format!("Entry ({row}, {column}) of the claimed tangent is {entry}."));
    }
    (!measured).then(|| "The measured tangent has another size, or entries that are not finite.".to_owned())
}

/// The verdict over all columns, with its numbers and the negative control.
fn conclude(mut finding: Finding, evidence: &Evidence, no_response: bool) -> Finding {
    let verdicts: Vec<ColumnVerdict> =
        (0..evidence.columns.len()).map(|k| evidence.verdict(k, &column(&finding.claimed, k))).collect();
    describe(&mut finding, evidence);
    let any = |verdict| verdicts.contains(&verdict);
    if any(ColumnVerdict::Wrong) {
        finding.verdict = Verdict::Wrong;
        return finding;
    }
    if any(ColumnVerdict::Kink) {
        return not_checked(finding, Reason::Kink);
    }
    let inexact = any(ColumnVerdict::Inexact);
    if evidence.is_zero(&finding.claimed) {
        if !no_response && evidence.law == evidence.scale {
            return not_checked(finding, Reason::NothingExercised);
        }
        (finding.verdict, finding.reason) = match inexact {
            true => (Verdict::Inexact, Some(Reason::RoundOff)),
            false => (Verdict::Consistent, Some(Reason::ZeroResponse)),
        };
        return finding;
    }
    if finding.error > NOISY {
        let error = finding.error;
        return not_checked(finding, Reason::TooNoisy(error));
    }
    match control::smallest_seen(evidence, &finding.claimed, &verdicts) {
        Ok(seen) => finding.control = Some(seen),
        Err(_) if inexact => {}
        Err(missed) => return not_checked(finding, Reason::ControlMissed(missed)),
    }
    (finding.verdict, finding.reason) =
        if inexact { (Verdict::Inexact, Some(Reason::NotFound)) } else { (Verdict::Consistent, None) };
    finding
}

/// Fills in the measured tangent, its errors, and the entry with the greatest deviation.
fn describe(finding: &mut Finding, evidence: &Evidence) {
    let Matrix { rows, columns, .. } = finding.claimed;
    let mut worst: Option<(Entry, bool)> = None;
    for k in 0..columns {
        let Estimate { value, error } = evidence.nearest(k, &column(&finding.claimed, k));
        for i in 0..rows {
            finding.measured[(i, k)] = value[i];
            finding.errors[(i, k)] = error[i];
            let claimed = finding.claimed[(i, k)];
            let entry = Entry { row: i, column: k, claimed, measured: value[i], error: error[i] };
            let deviates = evidence.deviates(&entry);
            let greater = worst.is_none_or(|(worst, worst_deviates)| {
                deviates & !worst_deviates || (deviates == worst_deviates && entry.deviation() > worst.deviation())
            });
            if greater && value[i].is_finite() {
                worst = Some((entry, deviates));
            }
        }
    }
    finding.worst = worst.map(|(entry, _)| entry);
    let scale = evidence.scale_for(&finding.claimed);
    finding.deviation = worst.map_or(f64::NAN, |(entry, _)| relative(entry.deviation(), scale));
    finding.error = relative(finding.errors.greatest(), scale);
}

/// `part` over `whole`; `part` itself if `whole` is zero.
fn relative(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { part }
}
