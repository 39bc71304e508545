//! Whole checks: measure, judge, and look for a loose local iteration where a deviation is small.

use super::evidence::Evidence;
use super::loose::{self, Jump, Line};
use super::{Finding, Matrix, Measured, Reason, Verdict, cause, column, failed, fault, greatest, judge};
use crate::difference::{Derivative, Ladder, derivative, noise};
use crate::law::CallFailed;

/// The number of columns above which the ladder is coarse, so that nine columns cost no more than 300 calls away from kinks.
const FEW: usize = 6;

/// The step that led to the state, and the law that took it. On the way to its start, a law passes its yield surface and all its numbers of
/// local iterations, so that a loose one shows as a jump. Perturbations of single columns show it in one state of five only.
pub struct Loading<'a> {
    /// The greatest component of the step in the units of the columns: of the strain increment, for instance.
    pub size: f64,
    /// The response at the part s of the step: 1 is the state, 0 the start of the step.
    pub respond: &'a mut dyn FnMut(f64) -> Result<Vec<f64>, CallFailed>,
    /// The greatest entry of the tangent of the law at rest; 0 if it is not known.
    pub stiffness: f64,
}

/// Checks a tangent column by column, on a [`Ladder`] that suits strains. See [`judge`] for the verdict.
///
/// `value` is the response without a perturbation. `f(k, h)` is the response with column k perturbed by h. The noise is measured along
/// the three greatest columns of the claimed tangent. Six columns cost 140 calls if the response is smooth, and at most 294 away from kinks.
/// Nine columns, on the coarse ladder, cost at most 300. Next to a kink, the ladder starts anew up to two times. A tangent that deviates costs
/// up to 60 calls more, to see whether it is a forward difference.
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
    check_along(name, claimed, value, f, None)
}

/// [`check_columns`] with the loading, which costs up to 200 further calls where a deviation is below 1e-4.
pub fn check_along(
    name: &str,
    claimed: &Matrix,
    value: &[f64],
    f: &mut dyn FnMut(usize, f64) -> Result<Vec<f64>, CallFailed>,
    loading: Option<Loading<'_>>,
) -> Finding {
    let ladder = if claimed.columns > FEW { Ladder::coarse() } else { Ladder::default() };
    check_columns_on(name, claimed, value, ladder, f, loading)
}

/// [`check_columns`] with a ladder of the caller's choice, for columns that are not strains, and with the loading.
///
/// The loading costs up to 200 further calls, and these only where a deviation is below 1e-4.
///
/// All columns share the ladder. If they have several units, let `f` scale h, and scale the columns of `claimed` alike.
pub fn check_columns_on(
    name: &str,
    claimed: &Matrix,
    value: &[f64],
    ladder: Ladder,
    f: &mut dyn FnMut(usize, f64) -> Result<Vec<f64>, CallFailed>,
    loading: Option<Loading<'_>>,
) -> Finding {
    let mut calls = 0;
    let mut f = |k: usize, h: f64| {
        calls += 1;
        f(k, h)
    };
    let mut measured = match measure(claimed, value, ladder, &mut f) {
        Ok(measured) => measured,
        Err(CallFailed(sentence)) => return failed(name, claimed, value.len(), claimed.columns, sentence, calls),
    };
    measured.stiffness = loading.as_ref().map_or(0.0, |loading| loading.stiffness);
    let mut finding = judge(name, claimed, &measured);
    let step = cause::Suspect { finding: &finding, value, respond: &mut f }.step(ladder);
    if let Some(h) = step {
        (finding.verdict, finding.reason, finding.calls) =
            (Verdict::Inexact, Some(Reason::ForwardDifference(h)), calls);
        return finding;
    }
    measured.calls = calls;
    finding.calls = calls;
    explained(finding, &mut measured, loading)
}

/// Measures the noise along the three greatest columns of the claimed tangent, and the derivatives along all. The calls are counted.
///
/// # Errors
/// All calls of a column failed, sizes do not agree, or an entry is not finite.
pub fn measure(
    claimed: &Matrix,
    value: &[f64],
    ladder: Ladder,
    f: &mut dyn FnMut(usize, f64) -> Result<Vec<f64>, CallFailed>,
) -> Result<Measured, CallFailed> {
    if let Some(fault) = fault(claimed, value.len(), claimed.columns, value.iter().all(|value| value.is_finite())) {
        return Err(CallFailed(fault));
    }
    let mut calls = 0;
    let mut f = |k: usize, h: f64| {
        calls += 1;
        f(k, h)
    };
    let mut order: Vec<usize> = (0..claimed.columns).collect();
    let size = |k: usize| greatest(&column(claimed, k));
    order.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
    let along = noise(&mut |table, h| f(order[table % order.len()], h), value, ladder)?;
    let noise = vec![greatest(&along); value.len()];
    let columns: Result<Vec<Derivative>, CallFailed> = (0..claimed.columns)
        .map(|k| {
            derivative(&mut |h| f(k, h), value, &noise, ladder)
                .map_err(|CallFailed(sentence)| CallFailed(format!("Column {k}: {sentence}")))
        })
        .collect();
    let columns = columns?;
    Ok(Measured { value: value.to_vec(), noise, columns, stiffness: 0.0, jump: None, calls })
}

/// Finds the cause of a small deviation, and judges once more if the loading shows that a loose local iteration explains it.
pub(super) fn explained(finding: Finding, measured: &mut Measured, loading: Option<Loading<'_>>) -> Finding {
    let deviates = finding.worst.is_some_and(|worst| worst.deviation() > worst.error);
    let asks = deviates && finding.deviation <= loose::LOOSE && finding.reason != Some(Reason::RoundOff);
    let judged = matches!(finding.verdict, Verdict::Wrong | Verdict::Inexact);
    if !(asks && judged) {
        return finding;
    }
    measured.jump = loading.and_then(|mut loading| jump(&finding.claimed, measured, &mut loading));
    let mut finding = judge(&finding.name, &finding.claimed, measured);
    if finding.verdict == Verdict::Inexact {
        let size = measured.jump.map(|jump| jump.size / greatest(&measured.value));
        finding.reason =
            Some(size.map_or_else(|| cause::by_size(&finding, measured.stiffness), Reason::LocalIteration));
    }
    finding
}

/// Looks for a jump that explains the deviations on the way back to the start of the step.
fn jump(claimed: &Matrix, measured: &mut Measured, loading: &mut Loading<'_>) -> Option<Jump> {
    let size = loading.size;
    if !(size.is_finite() && size > 0.0) {
        return None;
    }
    let evidence = Evidence::of(measured);
    let deviation = (0..claimed.columns).fold(0.0_f64, |worst, k| worst.max(evidence.deviation(k, claimed)));
    let line = Line { value: &measured.value, noise: greatest(&measured.noise), length: size, deviation };
    let mut calls = 0;
    let jump = line.nearest_jump(&mut |h| {
        calls += 1;
        (loading.respond)(1.0 - h / size)
    });
    measured.calls += calls;
    jump
}
