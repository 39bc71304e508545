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
//! # A kink between the perturbations
//!
//! A yield surface at the distance d divides the ladder: steps above d cross it. If both sides cross it, in a direction almost tangential to
//! the surface, all three estimates may agree on a wrong derivative. So there is a last look near √ε: at the central difference, or at a kink
//! at both sides. A side that the look contradicts is dropped, if the other one is sharp. If the look contradicts the central difference or
//! both sides, or if no side of a kink is sharp, the ladder starts anew at smaller steps. Estimates from above the kink are never averaged
//! with those from below.
//!
//! # Measured
//!
//! - Without the difference |T_ij − T_i−1,j|, one plastic state in 200 is a false alarm: two estimates agree by luck. Without the share of
//!   the column's error, single entries next to kinks are trusted by luck.
//! - Without the last look near √ε, two of 4,000 states 1e-10 before a yield surface are false alarms.
//! - Tables of noise that do not set aside smooth functions mistake the curvature near an apex for noise of 1e-9.

mod estimate;
mod noise;
mod tableau;

pub(crate) use estimate::ERRORS;
pub use estimate::Estimate;
pub use noise::noise;

use crate::law::CallFailed;
use estimate::SHARP;
pub(crate) use tableau::Tableau;

/// The greatest number of extrapolations of the central difference.
const CENTRAL_ORDER: usize = 5;

/// The greatest number of extrapolations of a one-sided difference.
const SIDE_ORDER: usize = 6;

/// The ladder does not stop for lack of progress before h is below h₀ over this.
const FIRST_STOP: f64 = 200.0;

/// Lack of progress: while h fell by this factor, the error did not halve.
const PATIENCE: f64 = 32.0;

/// The ladder does not stop for lack of progress before the errors are below this multiple of the noise 2 u / h.
const NEAR: f64 = 100.0;

/// The perturbation, over h₀, of the last look: near √ε for h₀ = 0.04.
const END: f64 = 5e-7;

/// Where a kink lies between the greatest and the smallest perturbation, the ladder starts anew below it, at these parts of h₀.
const RESTARTS: [f64; 3] = [1.0, 1e-3, 2.5e-5];

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
    /// 0.04, 0.02, 0.01, … to 4e-8 in 21 levels: at most 44 calls.
    fn default() -> Self {
        Self { first: 0.04, ratio: 2.0, levels: 21 }
    }
}

impl Ladder {
    /// From 0.04 to 3e-7 in 14 levels: at most 30 calls, and half a digit to one digit less than the default.
    pub fn coarse() -> Self {
        Self { first: 0.04, ratio: 2.5, levels: 14 }
    }

    /// The perturbations from the greatest to the smallest.
    pub(crate) fn perturbations(self) -> impl Iterator<Item = f64> {
        let next = move |h: &f64| Some(h / self.ratio).filter(|h| *h > 0.0);
        std::iter::successors(Some(self.first), next).take(self.levels)
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

/// The derivative of a function at 0, measured from both sides.
#[derive(Clone, Debug, PartialEq)]
pub struct Derivative {
    /// From the central difference.
    pub central: Estimate,
    /// D₊, from values at h > 0.
    pub forward: Estimate,
    /// D₋, from values at h < 0.
    pub backward: Estimate,
    /// Whether the differences at a perturbation near √ε contradict the estimates. Then a kink may be nearer to 0 than they see:
    /// in a direction almost tangential to a yield surface, both sides may lie beyond it.
    pub contradicted: bool,
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

    /// The error with which the function is known: of the best estimate, or of the sharper side of a kink.
    fn spread(&self) -> f64 {
        match self.has_kink() {
            true => self.forward.greatest_error().min(self.backward.greatest_error()),
            false => self.best().greatest_error(),
        }
    }

    /// Whether nothing speaks for a kink between the perturbations: no contradiction, and a side of a kink is sharp.
    fn settled(&self) -> bool {
        !self.contradicted && (!self.has_kink() || self.sharp())
    }

    fn sharp(&self) -> bool {
        let values = self.forward.value.iter().chain(&self.backward.value).filter(|value| value.is_finite());
        self.spread() <= SHARP * values.fold(0.0_f64, |greatest, value| greatest.max(value.abs()))
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
    let end = END * ladder.first;
    let mut measured: Option<Derivative> = None;
    for part in RESTARTS {
        let ladder = Ladder { first: part * ladder.first, ..ladder };
        let next = descend(f, (value_at_zero, noise), ladder, end);
        let Some(before) = measured else {
            let next = next?;
            if next.settled() {
                return Ok(next);
            }
            measured = Some(next);
            continue;
        };
        let Ok(mut next) = next else { return Ok(before) };
        next.calls += before.calls;
        if next.settled() && next.sharp() {
            return Ok(next);
        }
        let sharper = (next.contradicted, next.spread()) <= (before.contradicted, before.spread());
        measured = Some(if sharper { next } else { Derivative { calls: next.calls, ..before } });
    }
    let mut measured = measured.ok_or_else(|| sizes(0, size))?;
    measured.contradicted |= !measured.sharp();
    Ok(measured)
}

/// One way down a ladder, with a last look at `end`.
fn descend(
    f: &mut dyn FnMut(f64) -> Result<Vec<f64>, CallFailed>,
    (value_at_zero, noise): (&[f64], &[f64]),
    ladder: Ladder,
    end: f64,
) -> Result<Derivative, CallFailed> {
    let size = value_at_zero.len();
    let mut run = Run {
        f,
        value_at_zero,
        noise,
        central: Tableau::new(ladder.ratio * ladder.ratio, CENTRAL_ORDER, size),
        sides: [1.0, -1.0].map(|sign| (sign, Tableau::new(ladder.ratio, SIDE_ORDER, size))),
        failure: None,
        calls: 0,
    };
    let mut last = f64::INFINITY;
    for h in ladder.perturbations().take_while(|h| *h > end) {
        last = h;
        run.level(h)?;
        if run.finished(h, ladder) {
            break;
        }
    }
    run.result(last, end)
}

/// A measurement on its way down the ladder.
struct Run<'a> {
    f: &'a mut dyn FnMut(f64) -> Result<Vec<f64>, CallFailed>,
    value_at_zero: &'a [f64],
    noise: &'a [f64],
    central: Tableau,
    /// The sign of h, and the tableau of that side.
    sides: [(f64, Tableau); 2],
    failure: Option<CallFailed>,
    calls: usize,
}

impl Run<'_> {
    /// The value at h, or `None` if the call failed.
    fn call(&mut self, h: f64) -> Result<Option<Vec<f64>>, CallFailed> {
        self.calls += 1;
        match finite((self.f)(h), self.value_at_zero.len()) {
            Ok(value) => Ok(Some(value)),
            Err(Refused::Size(failed)) => Err(failed),
            Err(Refused::Level(failed)) => {
                self.failure = Some(failed);
                Ok(None)
            }
        }
    }

    /// The noise 2 u / h of a difference quotient.
    fn floor(&self, h: f64) -> Vec<f64> {
        self.noise.iter().map(|u| 2.0 * u / h).collect()
    }

    /// Adds the level h to all tableaux.
    fn level(&mut self, h: f64) -> Result<(), CallFailed> {
        let floor = self.floor(h);
        let values = [self.call(h)?, self.call(-h)?];
        match &values {
            [Some(plus), Some(minus)] => self.central.add(h, quotient(plus, minus, 2.0 * h), &floor),
            _ => self.central.row.clear(),
        }
        for ((sign, side), value) in self.sides.iter_mut().zip(values) {
            match value {
                Some(value) => side.add(h, quotient(&value, self.value_at_zero, *sign * h), &floor),
                None => side.row.clear(),
            }
        }
        Ok(())
    }

    fn tableaux(&self) -> [&Tableau; 3] {
        [&self.central, &self.sides[0].1, &self.sides[1].1]
    }

    /// Whether further levels are in vain, because the noise exceeds the errors, or because the errors do not fall any more.
    fn finished(&self, h: f64, ladder: Ladder) -> bool {
        let floor = self.floor(h);
        let stalled = |tableau: &Tableau| tableau.halved >= PATIENCE * h && tableau.within(NEAR, &floor);
        self.tableaux().iter().all(|tableau| tableau.within(ladder.ratio, &floor))
            || (ladder.first >= FIRST_STOP * h && self.tableaux().iter().all(|tableau| stalled(tableau)))
    }

    /// Whether the difference at h contradicts a side of a kink that was measured at greater perturbations.
    fn contradicts(&mut self, (sign, last): (f64, f64), h: f64, side: &Estimate) -> Result<bool, CallFailed> {
        let Some(value) = self.call(sign * h)? else { return Ok(false) };
        let near = quotient(&value, self.value_at_zero, sign * h);
        let tableau = &self.sides[usize::from(sign < 0.0)].1;
        // With the quotient of the last level H, (H Q(h) − h Q(H))/(H − h) is free of the curvature.
        let far = tableau.row.first().unwrap_or(&near);
        let value = near.iter().zip(far).map(|(near, far)| near + (near - far) * h / (last - h)).collect();
        let error = self.noise.iter().map(|u| 2.0 * last / (last - h) * u / h).collect();
        Ok(Estimate { value, error }.disagrees(side))
    }

    /// Whether the differences at h contradict what was measured at greater perturbations: the central one, or both sides of a kink. If they
    /// contradict one side alone, the kink lies there, and that side is dropped if the other one is sharp.
    fn contradicted(&mut self, [last, h]: [f64; 2], measured: &mut Derivative) -> Result<bool, CallFailed> {
        if measured.has_kink() {
            let forward = self.contradicts((1.0, last), h, &measured.forward)?;
            let backward = self.contradicts((-1.0, last), h, &measured.backward)?;
            let (dropped, kept) = match (forward, backward) {
                (true, false) => (&mut measured.forward, &measured.backward),
                (false, true) => (&mut measured.backward, &measured.forward),
                (all, _) => return Ok(all),
            };
            if !kept.is_sharp() {
                return Ok(true);
            }
            *dropped = Estimate::none(self.value_at_zero.len());
            return Ok(false);
        }
        let [Some(plus), Some(minus)] = [self.call(h)?, self.call(-h)?] else { return Ok(false) };
        // The standard deviation of this quotient is u / (√2 h), so u / h is enough.
        let error = self.noise.iter().map(|u| u / h).collect();
        let last = Estimate { value: quotient(&plus, &minus, 2.0 * h), error };
        Ok(last.disagrees(&measured.best()))
    }

    /// The derivative, after a last look at the perturbation h. The ladder has ended at `last`.
    fn result(mut self, last: f64, h: f64) -> Result<Derivative, CallFailed> {
        if let Some(failure) = self.failure.take_if(|_| self.sides.iter().all(|(_, side)| side.is_empty())) {
            return Err(failure);
        }
        let [central, forward, backward] = self.tableaux().map(|tableau| tableau.best.clone());
        let mut measured = Derivative { central, forward, backward, contradicted: false, calls: 0 };
        measured.contradicted = self.contradicted([last, h], &mut measured)?;
        measured.calls = self.calls;
        Ok(measured)
    }
}

/// (a − b) / h.
fn quotient(a: &[f64], b: &[f64], h: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| (a - b) / h).collect()
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
