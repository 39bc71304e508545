//! Strength as a function of the accumulated plastic strain.

use crate::problems::{Number, Problems};
use crate::scalar::{Real, implicit};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A strength that changes as plastic strain p accumulates: k(p) = `initial` + `linear` p + `saturation` (1 − e^{−`rate` p}). It covers
/// perfect plasticity, linear hardening, Voce's hardening, and their sum.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hardening {
    /// Strength before any plastic flow (stress), > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub initial: f64,
    /// Growth of the strength per plastic strain (stress), ≥ 0. Default 0.
    #[serde(default)]
    #[schemars(range(min = 0))]
    pub linear: f64,
    /// Growth of the strength (stress) in the limit of large plastic strain, approached with a `rate`; softening if negative, ≥ -`initial`.
    /// Default 0.
    #[serde(default)]
    pub saturation: f64,
    /// Rate at which plastic strain brings about the `saturation` (no unit), > 0 with a `saturation`. Default 0.
    #[serde(default)]
    #[schemars(range(min = 0))]
    pub rate: f64,
}

/// The most steps of Newton's method, which converges from one side.
const ITERATIONS: usize = 60;

impl Hardening {
    /// Perfect plasticity: k = `initial` at every p.
    ///
    /// ```
    /// use bfree::material::Hardening;
    ///
    /// let perfect = Hardening::perfect(2.0);
    /// assert_eq!((perfect.strength(0.0), perfect.strength(7.0), perfect.work(3.0)), (2.0, 2.0, 6.0));
    /// ```
    pub fn perfect(initial: f64) -> Self {
        Self { initial, linear: 0.0, saturation: 0.0, rate: 0.0 }
    }

    /// k(p)
    ///
    /// ```
    /// use bfree::material::Hardening;
    ///
    /// // Where p = 1/rate, the strength is e^{−1} times the saturation short of its final value.
    /// let voce = Hardening { initial: 1.0, linear: 0.0, saturation: 2.0, rate: 4.0 };
    /// assert!((voce.strength(0.25) - (3.0 - 2.0 * (-1.0_f64).exp())).abs() < 1e-15);
    /// ```
    pub fn strength<T: Real>(&self, p: T) -> T {
        let Self { initial, linear, saturation, rate } = *self;
        T::lit(initial) + p * T::lit(linear) - (p * T::lit(-rate)).exp_m1() * T::lit(saturation)
    }

    /// k'(p)
    pub(crate) fn slope<T: Real>(&self, p: T) -> T {
        T::lit(self.linear) + (p * T::lit(-self.rate)).exp() * T::lit(self.saturation * self.rate)
    }

    /// ∫₀ᵖ k, the plastic work up to p.
    pub fn work<T: Real>(&self, p: T) -> T {
        let Self { initial, linear, saturation, rate } = *self;
        let even = p * T::lit(initial) + p * p * T::lit(0.5 * linear);
        if rate == 0.0 {
            return even;
        }
        even + (p + (p * T::lit(-rate)).exp_m1() * T::lit(1.0 / rate)) * T::lit(saturation)
    }

    /// The Δ > 0 with a − b Δ − c k(p + c Δ) = 0, and 1/(b + c² k') there; a must exceed c k(p), and b + c² k' must be positive.
    ///
    /// Newton's method from Δ = 0 stays on one side of the root: from the start where k is concave, after its first step where k is convex.
    pub(super) fn solve<T: Real>(&self, a: T, b: f64, c: f64, p: T) -> (T, T) {
        let (a_0, p_0) = (a.value(), p.value());
        let mut root = 0.0_f64;
        for _ in 0..ITERATIONS {
            let at = p_0 + c * root;
            let step = (a_0 - b * root - c * self.strength(at)) / (b + c * c * self.slope(at));
            root = (root + step).max(0.0);
            if step.abs() <= 2.0 * f64::EPSILON * root {
                break;
            }
        }
        let c_t = T::lit(c);
        let slope = |delta: T| T::lit(b) + self.slope(p + c_t * delta) * T::lit(c * c);
        let left = |delta: T| delta * T::lit(b) + c_t * self.strength(p + c_t * delta) - a;
        let delta = implicit(root, slope(T::lit(root)).value(), left);
        (delta, slope(delta).recip())
    }

    /// Whether the parameters are allowed, and every step has a solution: c² k' > −b.
    pub(super) fn check(&self, stiffness: f64, problems: &mut Problems, path: &str) -> bool {
        let Self { initial, linear, saturation, rate } = *self;
        let at = |key: &str| format!("{path}.{key}");
        let mut good = problems.positive(&at("initial"), initial);
        for (key, value) in [("linear", linear), ("rate", rate)] {
            good &= problems.not_negative(&at(key), value);
        }
        good &= problems.number(&at("saturation"), saturation);
        let allowed = format_args!("must be at least -initial = {}", Number(-initial));
        if !good || !problems.require(saturation >= -initial, &at("saturation"), Number(saturation), allowed) {
            return false;
        }
        // A rate without a saturation does nothing, nor does a saturation without a rate.
        if (rate > 0.0) != (saturation != 0.0) {
            let allowed = if rate > 0.0 { "needs a saturation" } else { "must be > 0 with a saturation" };
            problems.refuse(&at("rate"), Number(rate), allowed);
            return false;
        }
        let softens = linear + saturation * rate;
        let allowed = format_args!(
            "softens faster than the solid unloads: linear + saturation rate = {} must be greater than {}",
            Number(softens),
            Number(-stiffness)
        );
        problems.require(softens > -stiffness, &at("rate"), Number(rate), allowed)
    }
}
