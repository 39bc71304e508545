//! Why a tangent is inexact.

use super::measured::{column, greatest};
use super::{Finding, Reason, Verdict};
use crate::difference::{Ladder, finite};
use crate::law::CallFailed;
use crate::matrix::Matrix;

/// The perturbations of forward differences that users take, over 0.04, the first of the ladder for strains.
const STEPS: std::ops::RangeInclusive<f64> = 2.5e-8..=1e-2;

/// A cause explains a deviation if this part of it remains at most.
const REMAINS: f64 = 0.05;

/// A forward difference needs so many entries that bend, because one entry fits any h.
const ENTRIES: usize = 4;

/// The h of one law differ from state to state by less than this part, which round-off makes where h is small.
const SPREAD: f64 = 0.3;

/// Round-off of a quotient (f(h) − f(0))/h, in units of the noise of f over h.
const ROUND_OFF: f64 = 8.0;

/// Deviations over ‖C‖ that a literal in single precision makes: its round-off of 3e-8 in a part of the stiffness.
const SINGLE: std::ops::RangeInclusive<f64> = 1e-9..=3e-7;

/// A tangent below this part of the stiffness at rest has lost so many digits of 1 − D.
const LOST: f64 = 1e-2;

/// A claimed tangent that may be a forward difference, and the response from which it would be one.
pub(crate) struct Suspect<'a> {
    pub finding: &'a Finding,
    pub value: &'a [f64],
    /// The response with column k perturbed by h.
    pub respond: &'a mut dyn FnMut(usize, f64) -> Result<Vec<f64>, CallFailed>,
}

impl Suspect<'_> {
    /// The h with which the claimed tangent is a forward difference: claimed_k = (f(k, h) − f(0))/h.
    ///
    /// The deviation of such a tangent is h/2 ∂²f/∂h². Least squares over all columns give h. Then the quotient itself, with this h, must
    /// be the claimed tangent.
    pub fn step(&mut self, ladder: Ladder) -> Option<f64> {
        let deviation = deviations(self.finding)?;
        if self.finding.errors.greatest() > REMAINS * greatest(&deviation) {
            return None;
        }
        let probe = 2.5e-4 * ladder.first;
        let [plus, minus] = [self.values(probe)?, self.values(-probe)?];
        let at_zero = |m: usize| self.value[m / plus.columns];
        let entry = |m: usize| (plus.entries[m] + minus.entries[m] - 2.0 * at_zero(m)) / (2.0 * probe * probe);
        let bend: Vec<f64> = (0..deviation.len()).map(entry).collect();
        let steepest = greatest(&bend);
        if bend.iter().filter(|x| x.abs() > 0.01 * steepest).count() < ENTRIES {
            return None;
        }
        let mut h = along(&deviation, &bend);
        for _ in 0..4 {
            if !STEPS.contains(&(h.abs() / ladder.first)) {
                return None;
            }
            let rest = self.rest(h)?;
            if greatest(&rest) <= REMAINS * greatest(&deviation) {
                return Some(h);
            }
            h += along(&rest, &bend);
        }
        None
    }

    /// Whether the claimed tangent is the forward difference with nearly this h, within its round-off.
    pub fn is_step(&mut self, h: f64) -> bool {
        let Some(deviation) = deviations(self.finding) else { return false };
        let noise = self.finding.noise.max(f64::EPSILON) * greatest(self.value);
        let round_off = ROUND_OFF * noise / h.abs();
        let allowed = (REMAINS * greatest(&deviation)).max(round_off);
        if self.leaves(h, allowed) {
            return true;
        }
        let own = self.sharpened(h).filter(|own| (own / h - 1.0).abs() < SPREAD);
        own.is_some_and(|h| self.leaves(h, allowed))
    }

    /// Whether the quotient with this h leaves no more than `allowed` of the claimed tangent.
    fn leaves(&mut self, h: f64, allowed: f64) -> bool {
        self.rest(h).is_some_and(|rest| greatest(&rest) <= allowed)
    }

    /// The h near this one with which the quotient is the claimed tangent, as sharply as this state shows it.
    pub fn sharpened(&mut self, mut h: f64) -> Option<f64> {
        for _ in 0..4 {
            let [rest, next] = [self.rest(h)?, self.rest(1.01 * h)?];
            let change: Vec<f64> = rest.iter().zip(&next).map(|(rest, next)| (next - rest) / (0.01 * h)).collect();
            h -= along(&rest, &change);
        }
        h.is_finite().then_some(h)
    }

    /// claimed_k − (f(k, h) − f(0))/h.
    fn rest(&mut self, h: f64) -> Option<Vec<f64>> {
        let at = self.values(h)?;
        let claimed = &self.finding.claimed;
        let rest = |m: usize| claimed.entries[m] - (at.entries[m] - self.value[m / at.columns]) / h;
        Some((0..at.entries.len()).map(rest).collect())
    }

    /// f(k, h) in column k.
    fn values(&mut self, h: f64) -> Option<Matrix> {
        let mut matrix = self.finding.claimed.clone();
        for k in 0..matrix.columns {
            for (i, entry) in finite((self.respond)(k, h), self.value.len()).ok()?.into_iter().enumerate() {
                matrix[(i, k)] = entry;
            }
        }
        Some(matrix)
    }
}

/// The deviations, if a tangent deviates and the derivative has been measured.
fn deviations(finding: &Finding) -> Option<Vec<f64>> {
    let judged =
        matches!(finding.verdict, Verdict::Wrong | Verdict::Inexact) && finding.reason != Some(Reason::RoundOff);
    let all = finding.claimed.entries.iter().zip(&finding.measured.entries);
    let all: Vec<f64> = all.map(|(claimed, measured)| claimed - measured).collect();
    (judged && all.iter().all(|x| x.is_finite())).then_some(all)
}

/// The multiple of `direction` nearest to `vector`.
fn along(vector: &[f64], direction: &[f64]) -> f64 {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    product(vector, direction) / product(direction, direction)
}

/// The cause that the size of a deviation suggests, where nothing else shows one.
pub(super) fn by_size(finding: &Finding, stiffness: f64) -> Reason {
    let scale = (0..finding.measured.columns).map(|k| greatest(&column(&finding.measured, k))).fold(0.0, f64::max);
    match finding.deviation {
        _ if scale < LOST * stiffness => Reason::RoundOff,
        deviation if SINGLE.contains(&deviation) => Reason::SinglePrecision,
        deviation if deviation < *SINGLE.start() => Reason::LocalIteration(deviation),
        _ => Reason::NotFound,
    }
}
