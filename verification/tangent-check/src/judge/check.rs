//! Whole checks: measure, judge, and look for a loose iteration where a deviation is small.

use super::evidence::Evidence;
use super::{Finding, Matrix, Measured, Verdict, column, failed, fault, greatest, judge, loose};
use crate::difference::{Derivative, Ladder, derivative, noise};
use crate::law::CallFailed;
use std::cell::Cell;

/// The columns in which a jump is looked for.
const SEARCHED: usize = 3;

/// The response to a perturbation h of column k.
type Response<'a> = &'a mut dyn FnMut(usize, f64) -> Result<Vec<f64>, CallFailed>;

/// Checks a tangent column by column, on the default [`Ladder`], which suits strains.
///
/// `value` is the response without a perturbation. `f(k, h)` is the response with column k perturbed by h. The noise is measured along
/// the greatest column of the claimed tangent. A law with six columns is called 150 times.
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
    check_columns_on(name, claimed, value, Ladder::default(), f)
}

/// [`check_columns`] with a ladder of the caller's choice, for columns that are not strains.
///
/// All columns share the ladder. If they have several units, let `f` scale h, and scale the columns of `claimed` alike.
pub fn check_columns_on(name: &str, claimed: &Matrix, value: &[f64], ladder: Ladder, f: Response<'_>) -> Finding {
    if let Some(fault) = fault(claimed, value.len(), claimed.columns, value.iter().all(|value| value.is_finite())) {
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
    if finding.verdict != Verdict::Wrong || finding.deviation > loose::LOOSE {
        return finding;
    }
    explain(claimed, &mut measured, ladder, &mut f);
    measured.calls = calls.get();
    judge(name, claimed, &measured)
}

/// Measures the noise along the greatest column, and the derivatives along all.
fn measure(claimed: &Matrix, value: &[f64], ladder: Ladder, f: Response<'_>) -> Result<Measured, CallFailed> {
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

/// Looks for a jump that explains the deviations, first in the columns that deviate most.
fn explain(claimed: &Matrix, measured: &mut Measured, ladder: Ladder, f: Response<'_>) {
    let evidence = Evidence::of(measured);
    let deviations: Vec<f64> = (0..claimed.columns).map(|k| evidence.deviation(k, claimed)).collect();
    let worst = deviations.iter().fold(0.0_f64, |worst, deviation| worst.max(*deviation));
    let mut order: Vec<usize> = (0..claimed.columns).collect();
    order.sort_by(|a, b| deviations[*b].total_cmp(&deviations[*a]));
    for k in order.into_iter().take(SEARCHED) {
        for side in [1.0, -1.0] {
            let mut along = |h: f64| f(k, h);
            let found = loose::nearest_jump(&mut along, &measured.value, &measured.noise, ladder, side);
            let Some(jump) = found else { continue };
            if measured.jump.is_none_or(|before| jump.size / jump.distance > before.size / before.distance) {
                measured.jump = Some(jump);
            }
            if loose::explained(jump, evidence.scale()) >= worst {
                return;
            }
        }
    }
}
