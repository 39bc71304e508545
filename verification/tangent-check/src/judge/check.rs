//! Whole checks: measure, judge, and look for a loose local iteration where a deviation is small.

use super::evidence::Evidence;
use super::loose::{self, Jump, Line};
use super::{Finding, Matrix, Measured, column, failed, fault, greatest, judge};
use crate::difference::{Derivative, Ladder, derivative, noise};
use crate::law::CallFailed;
use std::cell::Cell;

/// The number of columns above which the ladder is coarse, so that nine columns cost no more than 300 calls.
const FEW: usize = 6;

/// The sides of columns on which a jump is looked for, if the loading is unknown.
const SEARCHED: usize = 4;

/// The response to a perturbation h of column k.
type Columns<'a> = &'a mut dyn FnMut(usize, f64) -> Result<Vec<f64>, CallFailed>;

/// The step that led to the state. On the way to its start, a law passes its yield surface and all its numbers of local iterations.
///
/// The verdict [`Inexact`](crate::finding::Verdict::Inexact) needs it. Over 250 states of a J2 law whose local iteration stops at 1e-6 of the
/// yield stress, 179 tangents are inexact by up to 4e-6. With the loading all of them come out as inexact. Without it, less than half do,
/// and the others come out as wrong, because perturbations of single columns do not lead to another number of iterations.
pub struct Loading<'a> {
    /// The greatest component of the step in the units of the columns: of the strain increment, for instance.
    pub size: f64,
    /// The response at the part s of the step: 1 is the state, 0 the start of the step.
    pub respond: &'a mut dyn FnMut(f64) -> Result<Vec<f64>, CallFailed>,
}

/// Checks a tangent column by column, on a [`Ladder`] that suits strains. See [`judge`] for the verdict.
///
/// `value` is the response without a perturbation. `f(k, h)` is the response with column k perturbed by h. The noise is measured along
/// the greatest column of the claimed tangent. Six columns cost 120 calls if the response is smooth, and at most 294.
/// Nine columns, on the coarse ladder, cost at most 300. More calls are spent only on a deviation below 1e-5, to explain it.
///
/// ```
/// use tangent_check::finding::Verdict;
/// use tangent_check::judge::check_columns;
/// use tangent_check::matrix::Matrix;
///
/// // f(x, y) = (x², x y) at (1, 2)
/// let mut f = |k: usize, h: f64| {
///     let mut at = [1.0, 2.0];
///     at[k] += h;
///     Ok(vec![at[0] * at[0], at[0] * at[1]])
/// };
/// let claimed = Matrix { rows: 2, columns: 2, entries: vec![2.0, 0.0, 2.0, 1.0] };
/// let finding = check_columns("an example", &claimed, &[1.0, 2.0], &mut f);
/// assert_eq!(finding.verdict, Verdict::Consistent);
/// assert!(finding.control.unwrap() <= 1e-9);
/// ```
pub fn check_columns(
    name: &str,
    claimed: &Matrix,
    value: &[f64],
    f: &mut dyn FnMut(usize, f64) -> Result<Vec<f64>, CallFailed>,
) -> Finding {
    let ladder = if claimed.columns > FEW { Ladder::coarse() } else { Ladder::default() };
    check_columns_on(name, claimed, value, ladder, f, None)
}

/// [`check_columns`] with a ladder of the caller's choice, for columns that are not strains, and with the loading.
///
/// All columns share the ladder. If they have several units, let `f` scale h, and scale the columns of `claimed` alike.
pub fn check_columns_on(
    name: &str,
    claimed: &Matrix,
    value: &[f64],
    ladder: Ladder,
    f: &mut dyn FnMut(usize, f64) -> Result<Vec<f64>, CallFailed>,
    mut loading: Option<Loading<'_>>,
) -> Finding {
    let finite = value.iter().all(|value| value.is_finite());
    if let Some(fault) = fault(claimed, value.len(), claimed.columns, finite) {
        return failed(name, claimed, value.len(), claimed.columns, fault, 0);
    }
    let calls = Cell::new(0);
    let mut f = |k: usize, h: f64| {
        calls.set(calls.get() + 1);
        f(k, h)
    };
    let mut measured = match measure(claimed, value, ladder, &mut f) {
        Ok(measured) => Measured { calls: calls.get(), ..measured },
        Err(CallFailed(sentence)) => return failed(name, claimed, value.len(), claimed.columns, sentence, calls.get()),
    };
    let finding = judge(name, claimed, &measured);
    if !asks_for_jump(&finding) {
        return finding;
    }
    measured.jump = match &mut loading {
        Some(loading) => {
            let mut respond = |part: f64| {
                calls.set(calls.get() + 1);
                (loading.respond)(part)
            };
            jump_of_loading(claimed, &measured, &mut Loading { size: loading.size, respond: &mut respond })
        }
        None => jump_of_columns(claimed, &measured, ladder, &mut f),
    };
    measured.calls = calls.get();
    judge(name, claimed, &measured)
}

/// Measures the noise along the greatest column, and the derivatives along all.
pub(super) fn measure(claimed: &Matrix, value: &[f64], ladder: Ladder, f: Columns<'_>) -> Result<Measured, CallFailed> {
    let size = |k: &usize| greatest(&column(claimed, *k));
    let greatest_column = (0..claimed.columns).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(0);
    let along = noise(&mut |h| f(greatest_column, h), value, ladder)?;
    let noise = vec![greatest(&along); value.len()];
    let columns: Result<Vec<Derivative>, CallFailed> = (0..claimed.columns)
        .map(|k| {
            derivative(&mut |h| f(k, h), value, &noise, ladder)
                .map_err(|CallFailed(sentence)| CallFailed(format!("Column {k}: {sentence}")))
        })
        .collect();
    Ok(Measured { value: value.to_vec(), noise, columns: columns?, jump: None, calls: 0 })
}

/// Whether the tangent deviates so little that a loose local iteration may explain it.
pub(super) fn asks_for_jump(finding: &Finding) -> bool {
    let deviates = finding.worst.is_some_and(|worst| worst.deviation() > worst.error);
    deviates && finding.control.is_none() && finding.deviation <= loose::LOOSE
}

/// Looks for a jump that explains the deviations on the way back to the start of the step.
pub(super) fn jump_of_loading(claimed: &Matrix, measured: &Measured, loading: &mut Loading<'_>) -> Option<Jump> {
    let size = loading.size;
    if !(size.is_finite() && size > 0.0) {
        return None;
    }
    line(claimed, measured, size).nearest_jump(&mut |h| (loading.respond)(1.0 - h / size))
}

/// Looks for a jump that explains the deviations along single columns.
///
/// The number of local iterations changes most likely where the load decreases: the sides on which the response shrinks fastest come first.
fn jump_of_columns(claimed: &Matrix, measured: &Measured, ladder: Ladder, f: Columns<'_>) -> Option<Jump> {
    let line = line(claimed, measured, 4.0 * ladder.first);
    let growth =
        |k: usize| -> f64 { measured.value.iter().zip(column(claimed, k)).map(|(value, slope)| value * slope).sum() };
    let both = |k: usize| [1.0, -1.0].map(|sign| (k, sign, sign * growth(k)));
    let mut sides: Vec<(usize, f64, f64)> = (0..claimed.columns).flat_map(both).collect();
    sides.sort_by(|a, b| a.2.total_cmp(&b.2));
    sides.into_iter().take(SEARCHED).find_map(|(k, sign, _)| line.nearest_jump(&mut |h| f(k, sign * h)))
}

fn line<'a>(claimed: &Matrix, measured: &'a Measured, length: f64) -> Line<'a> {
    let evidence = Evidence::of(measured);
    let deviation = (0..claimed.columns).fold(0.0_f64, |worst, k| worst.max(evidence.deviation(k, claimed)));
    Line { value: &measured.value, noise: greatest(&measured.noise), length, deviation }
}
