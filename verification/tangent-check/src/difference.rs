//! Extrapolated differences of a vector function of one variable, with their own error.
//!
//! The derivative f′(0) is measured on a ladder of perturbations h_i = h₀ r⁻ⁱ, by the central difference and by both one-sided
//! differences. Each is extrapolated to h = 0 (Richardson, in Ridders' tableau). The tableau and the noise u of f give the error:
//!
//! ```text
//! T_i0 = (f(h_i) − f(−h_i)) / 2 h_i                    central, p = 2
//! T_i0 = ±(f(±h_i) − f(0)) / h_i                       one-sided, p = 1
//! T_ij = T_i,j−1 + (T_i,j−1 − T_i−1,j−1) / (rᵖʲ − 1)
//! e_ij = max(|T_ij − T_i,j−1|, |T_ij − T_i−1,j−1|, |T_ij − T_i−1,j|, 2 u / h_i, a tenth of the greatest e_ij of the column)
//! ```
//!
//! The T_ij with the smallest error is taken, component by component. Sources: C. J. F. Ridders, *Adv. Eng. Softw.* 4 (1982) 75–76;
//! J. J. Moré and S. M. Wild, *SIAM J. Sci. Comput.* 33 (2011) 1292–1314 for the noise.
//!
//! # Measured
//!
//! Over 2,500 states of ten laws with consistent tangents (`tests/numerics`), the true error is at most 9 e, and at most 3 e on the coarser
//! ladder. Without |T_ij − T_i−1,j| there are two to five false alarms, because two estimates agree by luck. Without the share of the
//! column's error, single entries next to kinks are trusted by luck. A ladder that ends at 2e-6 gives three false alarms: if a state lies
//! 1e-9 before a yield surface and the direction is almost tangential, both sides cross the surface within √1e-9. So the ladder ends near √ε.

use crate::law::CallFailed;

/// The greatest number of extrapolations of the central difference.
const CENTRAL_ORDER: usize = 5;

/// The greatest number of extrapolations of a one-sided difference.
const SIDE_ORDER: usize = 6;

/// An entry has at least this part of the greatest error of its column: a small difference in one entry may be luck.
const SHARE: f64 = 0.1;

/// The ladder does not stop for lack of progress before h is below h₀ over this.
const FIRST_STOP: f64 = 200.0;

/// Lack of progress: while h fell by this factor, the error did not halve.
const PATIENCE: f64 = 32.0;

/// The ladder does not stop for lack of progress before the errors are below this multiple of the noise 2 u / h.
const NEAR: f64 = 100.0;

/// Derivatives that differ by more than this number of errors differ.
pub(crate) const ERRORS: f64 = 10.0;

/// The spacings of the tables that measure the noise, over h₀: 1e-10, 1e-8 and 1e-6 for h₀ = 0.04. Single precision shows at the widest.
const SPACINGS: [f64; 3] = [2.5e-9, 2.5e-7, 2.5e-5];

/// The points of a table that measures the noise.
const POINTS: usize = 6;

/// A table whose fifth differences are below this multiple of the third shows a smooth function, not noise.
const DECAY: f64 = 0.25;

/// The perturbations h_i = h₀ r⁻ⁱ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ladder {
    /// The greatest perturbation h₀, in the unit of the variable. The default 0.04 suits strains. For other unknowns take about 0.04 of
    /// the change over which the function changes its nature.
    pub first: f64,
    /// The ratio r of successive perturbations.
    pub ratio: f64,
    /// The greatest number of levels.
    pub levels: usize,
}

impl Default for Ladder {
    /// 0.04, 0.02, 0.01, … to 2e-8 in 22 levels.
    fn default() -> Self {
        Self { first: 0.04, ratio: 2.0, levels: 22 }
    }
}

impl Ladder {
    /// From 0.04 to 1e-7 in 15 levels: at most 30 calls, and half to one digit less than the default.
    pub fn coarse() -> Self {
        Self { first: 0.04, ratio: 2.5, levels: 15 }
    }

    /// The perturbations from the greatest to the smallest.
    pub(crate) fn perturbations(self) -> impl Iterator<Item = f64> {
        std::iter::successors(Some(self.first), move |h| Some(h / self.ratio)).take(self.levels)
    }

    fn check(self) -> Result<(), CallFailed> {
        let Self { first, ratio, levels } = self;
        if first.is_finite() && first > 0.0 && ratio.is_finite() && ratio > 1.0 && levels > 0 {
            return Ok(());
        }
        Err(CallFailed(format!(
            "The ladder of perturbations starts at {first}, with ratio {ratio} and {levels} levels. The start must be positive, the ratio \
             greater than 1, and there must be levels."
        )))
    }
}

/// A measured derivative with the error of each component.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// The derivative; NaN where it could not be measured.
    pub value: Vec<f64>,
    /// The estimated error; infinite where the derivative could not be measured.
    pub error: Vec<f64>,
}

impl Estimate {
    /// No measurement of `size` components.
    pub(crate) fn none(size: usize) -> Self {
        Self { value: vec![f64::NAN; size], error: vec![f64::INFINITY; size] }
    }

    /// The greatest error.
    pub fn greatest_error(&self) -> f64 {
        self.error.iter().fold(0.0, |greatest, error| greatest.max(*error))
    }

    /// Takes the components of `next` whose error is smaller: the greatest difference from its `neighbours` in the tableau.
    fn improve(&mut self, next: &[f64], neighbours: [&Vec<f64>; 3], floor: &[f64]) {
        let difference = |i: usize| neighbours.iter().fold(0.0_f64, |greatest, t| greatest.max((next[i] - t[i]).abs()));
        let differences: Vec<f64> = (0..next.len()).map(difference).collect();
        let shared = SHARE * differences.iter().fold(0.0_f64, |greatest, difference| greatest.max(*difference));
        for i in 0..next.len() {
            let error = differences[i].max(floor[i]).max(shared);
            if next[i].is_finite() && error < self.error[i] {
                self.value[i] = next[i];
                self.error[i] = error;
            }
        }
    }

    /// Whether a component differs from that of `other` by more than ten of the errors of both.
    fn disagrees(&self, other: &Self) -> bool {
        let components = self.value.iter().zip(&self.error).zip(other.value.iter().zip(&other.error));
        components.into_iter().any(|((a, e), (b, f))| (a - b).abs() > ERRORS * (e + f))
    }
}

/// The derivative of a function at 0, measured from both sides.
#[derive(Clone, Debug, PartialEq)]
pub struct Derivative {
    /// From the central difference.
    pub central: Estimate,
    /// D₊, from values at h > 0.
    pub forward: Estimate,
    /// D₋, from values at h < 0.
    pub backward: Estimate,
    /// Calls of the function.
    pub calls: usize,
}

impl Derivative {
    /// Whether the derivatives to both sides differ, so that the function has a kink at 0 or too near to tell.
    ///
    /// The test is |D₊ − D₋| > 10 (e₊ + e₋), and the same between the central difference and either side.
    pub fn has_kink(&self) -> bool {
        self.forward.disagrees(&self.backward)
            || self.central.disagrees(&self.forward)
            || self.central.disagrees(&self.backward)
    }

    /// The estimate with the smallest error, component by component. Next to a kink, this is the side without the kink.
    pub fn best(&self) -> Estimate {
        let mut best = self.central.clone();
        for side in [&self.forward, &self.backward] {
            for i in 0..best.value.len() {
                if side.error[i] < best.error[i] {
                    best.value[i] = side.value[i];
                    best.error[i] = side.error[i];
                }
            }
        }
        best
    }
}

/// Measures the derivative of `f` at 0.
///
/// `value_at_zero` is f(0), and `noise` holds the noise of each component of f, in the unit of f (see [`noise`]).
/// A level at which `f` fails, or is not finite, is skipped. The other side of that level still serves.
///
/// # Errors
/// All calls failed, `f` changed the number of its components, or the ladder is not valid.
///
/// ```
/// use tangent_check::difference::{Ladder, derivative};
///
/// let mut f = |h: f64| Ok(vec![(1.0 + h).ln(), h.abs()]);
/// let measured = derivative(&mut f, &[0.0, 0.0], &[1e-16, 1e-16], Ladder::default()).unwrap();
/// assert!((measured.central.value[0] - 1.0).abs() <= 10.0 * measured.central.error[0]);
/// assert!(measured.has_kink());
/// assert_eq!((measured.forward.value[1], measured.backward.value[1]), (1.0, -1.0));
/// ```
pub fn derivative(
    f: &mut dyn FnMut(f64) -> Result<Vec<f64>, CallFailed>,
    value_at_zero: &[f64],
    noise: &[f64],
    ladder: Ladder,
) -> Result<Derivative, CallFailed> {
    ladder.check()?;
    let size = value_at_zero.len();
    if noise.len() != size {
        return Err(sizes(noise.len(), size));
    }
    let mut central = Tableau::new(ladder.ratio * ladder.ratio, CENTRAL_ORDER, size);
    let mut forward = Tableau::new(ladder.ratio, SIDE_ORDER, size);
    let mut backward = Tableau::new(ladder.ratio, SIDE_ORDER, size);
    let mut failure = None;
    let mut calls = 0;
    for h in ladder.perturbations() {
        calls += 2;
        let floor: Vec<f64> = noise.iter().map(|u| 2.0 * u / h).collect();
        let [plus, minus] = [finite(f(h), size), finite(f(-h), size)];
        match (&plus, &minus) {
            (Ok(plus), Ok(minus)) => central.add(h, quotient(plus, minus, 2.0 * h), &floor),
            _ => central.row.clear(),
        }
        for (side, value, sign) in [(&mut forward, plus, 1.0), (&mut backward, minus, -1.0)] {
            match value {
                Ok(value) => side.add(h, quotient(&value, value_at_zero, sign * h), &floor),
                Err(Refused::Size(failed)) => return Err(failed),
                Err(Refused::Level(failed)) => {
                    side.row.clear();
                    failure = Some(failed);
                }
            }
        }
        let tableaux = [&central, &forward, &backward];
        let settled = tableaux.iter().all(|tableau| tableau.within(ladder.ratio, &floor));
        let stalled = tableaux.iter().all(|tableau| tableau.halved >= PATIENCE * h && tableau.within(NEAR, &floor));
        if settled || (stalled && ladder.first >= FIRST_STOP * h) {
            break;
        }
    }
    match failure {
        Some(failure) if forward.is_empty() && backward.is_empty() => Err(failure),
        _ => Ok(Derivative { central: central.best, forward: forward.best, backward: backward.best, calls }),
    }
}

/// (a − b) / h.
fn quotient(a: &[f64], b: &[f64], h: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| (a - b) / h).collect()
}

/// Ridders' tableau of one difference quotient.
struct Tableau {
    /// The factor rᵖ by which the first extrapolation reduces the leading error.
    factor: f64,
    order: usize,
    /// The last row T_i0, T_i1, … It is empty if the level before is missing.
    row: Vec<Vec<f64>>,
    best: Estimate,
    /// The greatest error when it last halved, and the perturbation at that level.
    mark: f64,
    halved: f64,
}

impl Tableau {
    fn new(factor: f64, order: usize, size: usize) -> Self {
        Self { factor, order, row: vec![], best: Estimate::none(size), mark: f64::INFINITY, halved: f64::INFINITY }
    }

    /// Whether nothing was measured.
    fn is_empty(&self) -> bool {
        self.best.error.iter().all(|error| error.is_infinite())
    }

    /// Adds the row of the next level h. `floor` is 2 u / h.
    fn add(&mut self, h: f64, quotient: Vec<f64>, floor: &[f64]) {
        let last = std::mem::replace(&mut self.row, vec![quotient]);
        let mut factor = 1.0;
        for j in 1..=last.len().min(self.order) {
            factor *= self.factor;
            let [fine, coarse] = [&self.row[j - 1], &last[j - 1]];
            let next: Vec<f64> = fine.iter().zip(coarse).map(|(t, before)| t + (t - before) / (factor - 1.0)).collect();
            if let Some(before) = last.get(j) {
                self.best.improve(&next, [fine, coarse, before], floor);
            }
            self.row.push(next);
        }
        let error = self.best.greatest_error();
        if error <= 0.5 * self.mark {
            self.mark = error;
            self.halved = h;
        }
    }

    /// Whether all errors are below `factor` times the noise. With factor r, no further level can be better.
    fn within(&self, factor: f64, floor: &[f64]) -> bool {
        self.best.error.iter().zip(floor).all(|(error, floor)| *error <= factor * floor)
    }
}

/// A value that cannot be used.
pub(crate) enum Refused {
    /// At this perturbation.
    Level(CallFailed),
    /// At all: the number of components is another one.
    Size(CallFailed),
}

/// The value, if it has `size` finite components.
pub(crate) fn finite(value: Result<Vec<f64>, CallFailed>, size: usize) -> Result<Vec<f64>, Refused> {
    let value = value.map_err(Refused::Level)?;
    if value.len() != size {
        return Err(Refused::Size(sizes(value.len(), size)));
    }
    match value.iter().position(|component| !component.is_finite()) {
        Some(i) => Err(Refused::Level(CallFailed(format!("Component {i} of the response is {}.", value[i])))),
        None => Ok(value),
    }
}

fn sizes(has: usize, expected: usize) -> CallFailed {
    CallFailed(format!("The response has {has} components, but {expected} are expected."))
}

/// The noise of each component of `f` near 0: the standard deviation of its round-off, in the unit of `f`.
///
/// The k-th differences Δᵏf of six values at equal, tiny spacing contain nothing but noise, with σ² = (k!)²/(2k)! mean((Δᵏf)²).
/// The greatest σ over k = 3, 4, 5 and over the spacings 1e-10, 1e-8 and 1e-6 (for h₀ = 0.04) is taken, then the least over both sides
/// of 0, because a kink spoils one side. The result is at least ε max|f(0)|. It costs 30 calls.
///
/// # Errors
/// No table on either side could be filled, `f` changed the number of its components, or the ladder is not valid.
pub fn noise(
    f: &mut dyn FnMut(f64) -> Result<Vec<f64>, CallFailed>,
    value_at_zero: &[f64],
    ladder: Ladder,
) -> Result<Vec<f64>, CallFailed> {
    ladder.check()?;
    let mut failure = None;
    let mut least: Option<Vec<f64>> = None;
    for side in [1.0, -1.0] {
        let mut greatest: Option<Vec<f64>> = None;
        for spacing in SPACINGS {
            match table_noise(f, value_at_zero, side * spacing * ladder.first) {
                Ok(noise) => greatest = Some(combine(greatest, noise, f64::max)),
                Err(Refused::Size(failed)) => return Err(failed),
                Err(Refused::Level(failed)) => failure = Some(failed),
            }
        }
        if let Some(noise) = greatest {
            least = Some(combine(least, noise, f64::min));
        }
    }
    let floor = f64::EPSILON * value_at_zero.iter().fold(0.0_f64, |greatest, value| greatest.max(value.abs()));
    match (least, failure) {
        (Some(noise), _) => Ok(noise.into_iter().map(|noise| noise.max(floor)).collect()),
        (None, Some(failure)) => Err(failure),
        (None, None) => Ok(vec![floor; value_at_zero.len()]),
    }
}

fn combine(before: Option<Vec<f64>>, noise: Vec<f64>, choose: fn(f64, f64) -> f64) -> Vec<f64> {
    match before {
        Some(before) => before.into_iter().zip(noise).map(|(a, b)| choose(a, b)).collect(),
        None => noise,
    }
}

/// The noise from one table of six values at `spacing`.
fn table_noise(
    f: &mut dyn FnMut(f64) -> Result<Vec<f64>, CallFailed>,
    value_at_zero: &[f64],
    spacing: f64,
) -> Result<Vec<f64>, Refused> {
    let size = value_at_zero.len();
    let mut table = vec![value_at_zero.to_vec()];
    for point in 1..POINTS {
        table.push(finite(f(point as f64 * spacing), size)?);
    }
    let mut orders: Vec<Vec<f64>> = vec![];
    let mut gamma = 1.0;
    for k in 1..POINTS {
        let order = k as f64;
        // γ_k = γ_{k−1} k² / (2k (2k − 1))
        gamma *= order / (2.0 * (2.0 * order - 1.0));
        for row in 0..POINTS - k {
            for i in 0..size {
                table[row][i] = table[row + 1][i] - table[row][i];
            }
        }
        let deviation = |i: usize| {
            let squares: f64 = table[..POINTS - k].iter().map(|values| values[i] * values[i]).sum();
            (gamma * squares / (POINTS - k) as f64).sqrt()
        };
        orders.push((0..size).map(deviation).collect());
    }
    let [.., third, fourth, fifth] = &orders[..] else { return Ok(vec![0.0; size]) };
    let length = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>().sqrt();
    if length(fifth) < DECAY * length(third) {
        return Ok(vec![0.0; size]);
    }
    Ok((0..size).map(|i| third[i].max(fourth[i]).max(fifth[i])).collect())
}
