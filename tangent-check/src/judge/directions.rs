//! The check of a tangent with many unknowns, through products with random directions.

use super::check::{Loading, explained, measure};
use super::{Entry, Finding, Matrix, Measured, Verdict, failed, greatest, judge};
use crate::difference::{ERRORS, Ladder, derivative};
use crate::law::CallFailed;
use crate::random::Random;

/// The directions of a check.
pub struct Directions<'a> {
    /// The number of random directions.
    pub count: usize,
    /// The seed of the random numbers.
    pub seed: u64,
    /// The perturbations h of u + h w, where the entries of w lie in (−1, 1).
    pub ladder: Ladder,
    /// The step that led to the state.
    pub loading: Option<Loading<'a>>,
}

impl Default for Directions<'_> {
    fn default() -> Self {
        Self { count: 3, seed: 1, ladder: Ladder::default(), loading: None }
    }
}

/// The claimed product J w of a direction w.
pub type Product<'a> = dyn FnMut(&[f64]) -> Result<Vec<f64>, CallFailed> + 'a;

/// The response at u + h w, for a direction w and h.
pub type Residual<'a> = dyn FnMut(&[f64], f64) -> Result<Vec<f64>, CallFailed> + 'a;

/// Checks a tangent with many unknowns along random directions w: the claimed `product(w)` = J w, beside the derivative of `f(w, h)`, which
/// is the response at u + h w.
///
/// The columns of the finding are the directions, and the control spoils entries of J w. If the tangent is wrong, halving of a direction
/// finds the unknown whose column deviates in the worst row. Then `worst` is that entry of J: its `column` is the number of the unknown.
/// Rows with different units should be checked apart, because the errors are relative to the greatest entry.
///
/// ```
/// use tangent_check::finding::Verdict;
/// use tangent_check::judge::{Directions, check_directions};
///
/// // r_i = u_i³ at u = 1, with one entry of the tangent 1 % too large
/// let mut product = |w: &[f64]| Ok(w.iter().enumerate().map(|(i, w)| if i == 7 { 3.03 * w } else { 3.0 * w }).collect());
/// let mut f = |w: &[f64], h: f64| Ok(w.iter().map(|w| (1.0 + h * w).powi(3)).collect());
/// let finding = check_directions("cubes", 20, &[1.0; 20], &mut product, &mut f, Directions::default());
/// assert_eq!(finding.verdict, Verdict::Wrong);
/// let worst = finding.worst.unwrap();
/// assert_eq!((worst.row, worst.column), (7, 7));
/// assert!((worst.claimed - 3.03).abs() < 1e-12 && (worst.measured - 3.0).abs() < 1e-9);
/// ```
pub fn check_directions(
    name: &str,
    unknowns: usize,
    value: &[f64],
    product: &mut Product<'_>,
    f: &mut Residual<'_>,
    directions: Directions<'_>,
) -> Finding {
    let Directions { count, seed, ladder, loading } = directions;
    let mut calls = 0;
    let mut f = |w: &[f64], h: f64| {
        calls += 1;
        f(w, h)
    };
    let mut random = Random::new(seed);
    let all: Vec<Vec<f64>> = (0..count).map(|_| (0..unknowns).map(|_| random.signed()).collect()).collect();
    let mut claimed = Matrix::zeros(value.len(), count);
    let measured =
        claim(&mut claimed, &all, product).and_then(|()| measure(&claimed, value, ladder, &mut |k, h| f(&all[k], h)));
    let mut measured = match measured {
        Ok(measured) => measured,
        Err(CallFailed(sentence)) => return failed(name, &claimed, value.len(), count, sentence, calls),
    };
    let measured_calls = measured.calls;
    let mut finding = explained(judge(name, &claimed, &measured), &mut measured, loading);
    let jump_calls = finding.calls - measured_calls;
    if let (Verdict::Wrong, Some(worst)) = (finding.verdict, finding.worst) {
        let found = locate(&all[worst.column], worst.row, &measured, ladder, product, &mut f);
        finding.worst = found.or(finding.worst);
        finding.calls = calls + jump_calls;
    }
    finding
}

/// Fills in the claimed products.
fn claim(claimed: &mut Matrix, directions: &[Vec<f64>], product: &mut Product<'_>) -> Result<(), CallFailed> {
    let rows = claimed.rows;
    for (k, w) in directions.iter().enumerate() {
        let values = product(w)?;
        if values.len() != rows {
            let size = values.len();
            return Err(CallFailed(format!("The product J w has {size} entries, but the response has {rows}.")));
        }
        for (i, value) in values.into_iter().enumerate() {
            claimed[(i, k)] = value;
        }
    }
    Ok(())
}

/// Finds the unknown whose column deviates in a row, by halving the direction.
fn locate(
    w: &[f64],
    row: usize,
    measured: &Measured,
    ladder: Ladder,
    product: &mut Product<'_>,
    f: &mut Residual<'_>,
) -> Option<Entry> {
    let mut entry = |w: &[f64], column: usize| {
        let claimed = *product(w).ok()?.get(row)?;
        let best = derivative(&mut |h| f(w, h), &measured.value, &measured.noise, ladder).ok()?.best();
        Some(Entry { row, column, claimed, measured: best.value[row], error: best.error[row] })
    };
    let (mut first, mut end) = (0, w.len());
    while end - first > 1 {
        let middle = first + (end - first) / 2;
        let half: Vec<f64> = (0..w.len()).map(|j| if (first..middle).contains(&j) { w[j] } else { 0.0 }).collect();
        if deviates(&entry(&half, first)?) { end = middle } else { first = middle }
    }
    let unit: Vec<f64> = (0..w.len()).map(|j| if j == first { 1.0 } else { 0.0 }).collect();
    entry(&unit, first).filter(deviates)
}

fn deviates(entry: &Entry) -> bool {
    entry.deviation() > ERRORS * entry.error + 1e3 * f64::EPSILON * greatest(&[entry.claimed, entry.measured])
}
