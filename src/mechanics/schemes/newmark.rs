//! Incremental Newmark-β (the paper's Table 1).

use super::{Alphas, Scheme};

/// Newmark's parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Newmark {
    /// β > 0; ¼ is the trapezoidal rule.
    pub beta: f64,
    /// γ; ½ is undamped and of second order. Unconditionally stable for 2β ≥ γ ≥ ½.
    pub gamma: f64,
}

impl Default for Newmark {
    /// The trapezoidal rule.
    fn default() -> Self {
        Self { beta: 0.25, gamma: 0.5 }
    }
}

impl Newmark {
    /// The α-parameters of a step of length `dt`.
    pub fn alphas(&self, dt: f64) -> Alphas {
        let Self { beta, gamma } = *self;
        mutant!("schemes: 1 for γ": gamma = 1.0);
        Alphas {
            dt,
            a1: 1.0 / (beta * dt * dt),
            a2: 1.0 / (beta * dt),
            a3: (1.0 - 2.0 * beta) / (2.0 * beta),
            a4: gamma / (beta * dt),
            a6: (1.0 - gamma / (2.0 * beta)) * dt,
            discrete_gradient: false,
        }
    }
}

impl Scheme for Newmark {
    fn name(&self) -> String {
        format!("Newmark β = {}, γ = {}", self.beta, self.gamma)
    }

    fn end(&self, dt: f64) -> Alphas {
        self.alphas(dt)
    }

    fn error_constant(&self) -> f64 {
        self.beta - 1.0 / 6.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::Vector;

    const RULES: [(f64, f64); 4] = [(0.25, 0.5), (0.3025, 0.6), (0.5, 0.9), (1.0, 1.5)];

    #[test]
    fn uniformly_accelerated_motion_is_exact_for_every_beta_and_gamma() {
        let (v, a) = (Vector::from([1.7]), Vector::from([-3.0]));
        for (beta, gamma) in RULES {
            for dt in [1e-3, 0.5, 40.0] {
                let alphas = Newmark { beta, gamma }.alphas(dt);
                let dphi = v * dt + a * (0.5 * dt * dt);
                let (delta_v, delta_a) = alphas.increments(&dphi, &v, &a);
                let acceleration = (dphi - alphas.predicted(&v, &a)) * alphas.a1;
                // The effect of one rounding of Δφ.
                let round_off = f64::EPSILON * dphi.norm() * alphas.a1;
                assert!((acceleration - a).norm() < 8.0 * round_off, "β = {beta}: a = {acceleration}");
                assert!(delta_a.norm() < 8.0 * round_off, "β = {beta}: Δa = {delta_a}");
                let round_off = f64::EPSILON * dphi.norm() * alphas.a4;
                assert!((delta_v - a * dt).norm() < 8.0 * round_off, "β = {beta}, γ = {gamma}: Δv = {delta_v}");
            }
        }
    }

    #[test]
    fn the_differences_are_those_of_the_printed_formulas() {
        let (dphi, v, a) = (Vector::from([0.3, -1.1]), Vector::from([1.7, 0.2]), Vector::from([-3.0, 0.9]));
        for (beta, gamma) in RULES {
            for dt in [0.05, 0.5, 4.0] {
                let alphas = Newmark { beta, gamma }.alphas(dt);
                let Alphas { a1, a2, a3, a4, a6, .. } = alphas;
                let a5 = 1.0 - gamma / beta;
                let velocity = dphi * a4 + v * a5 + a * a6;
                let acceleration = dphi * a1 - v * a2 - a * a3;
                let (delta_v, delta_a) = alphas.increments(&dphi, &v, &a);
                let of_residual = (dphi - alphas.predicted(&v, &a)) * a1;
                let close = |x: Vector<f64, 2>, y: Vector<f64, 2>| (x - y).norm() < 1e-14 * (a1 + a2 + a4 + 10.0);
                assert!(close(v + delta_v, velocity) && close(a + delta_a, acceleration), "β = {beta}, Δt = {dt}");
                assert!(close(of_residual, acceleration), "β = {beta}, Δt = {dt}: {of_residual}");
            }
        }
    }

    #[test]
    fn steady_flight_changes_not_a_bit() {
        let (v, rest) = (Vector::from([0.1, -1.0 / 3.0, 7e5]), Vector::zeros());
        for (beta, gamma) in RULES {
            for dt in [1.0 / 3.0, 1e-9, 7e8] {
                let alphas = Newmark { beta, gamma }.alphas(dt);
                assert_eq!(alphas.increments(&(v * dt), &v, &rest), (rest, rest));
                assert_eq!(v * dt - alphas.predicted(&v, &rest), rest);
            }
        }
    }
}
