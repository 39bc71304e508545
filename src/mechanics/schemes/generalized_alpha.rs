//! The generalised-α method (Chung and Hulbert, 1993).

use super::{Alphas, Newmark, Scheme};
use crate::problems::Problems;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// M a(t_{n+1−α_m}) + R(φ_{n+1−α_f}, t_{n+1−α_f}) = 0 with Newmark's relations between Δφ, v and a. The motion is interpolated, not the
/// force. α_m = α_f = ½ is the midpoint rule.
///
/// α_m = (2ρ − 1)/(ρ + 1),  α_f = ρ/(ρ + 1),  γ = ½ − α_m + α_f,  β = ¼ (1 − α_m + α_f)²
///
/// ```
/// use bfree::mechanics::schemes::{GeneralizedAlpha, Newmark, Scheme};
///
/// // ρ = 1 damps nothing: forces are in balance halfway, and the end of the step follows the trapezoidal rule.
/// let midpoint = GeneralizedAlpha { spectral_radius: 1.0 };
/// assert_eq!((midpoint.instant(), midpoint.end(0.1)), (0.5, Newmark { beta: 0.25, gamma: 0.5 }.end(0.1)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(description = "The generalised-α method; α_m, α_f, β and γ follow from ρ∞.")]
pub struct GeneralizedAlpha {
    /// The spectral radius ρ∞ (no unit), 0 to 1. A vibration much faster than the time step keeps this share of its amplitude after one
    /// step. 1 damps nothing.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub spectral_radius: f64,
}

impl GeneralizedAlpha {
    pub(super) fn check(&self, problems: &mut Problems, path: &str) {
        problems.between(&format!("{path}.spectral_radius"), self.spectral_radius, 0.0, 1.0);
    }

    /// 1 − α_m and 1 − α_f.
    fn weights(&self) -> (f64, f64) {
        let rho = self.spectral_radius;
        ((2.0 - rho) / (rho + 1.0), 1.0 / (rho + 1.0))
    }

    /// Newmark's relations between Δφ, v and a, with β and γ of this scheme.
    fn newmark(&self) -> Newmark {
        let (inertia, force) = self.weights();
        let shift = inertia - force;
        Newmark { beta: 0.25 * (1.0 + shift) * (1.0 + shift), gamma: 0.5 + shift }
    }
}

impl Scheme for GeneralizedAlpha {
    fn name(&self) -> String {
        format!("generalised-α ρ∞ = {}", self.spectral_radius)
    }

    fn instant(&self) -> f64 {
        self.weights().1
    }

    /// μ a + (1−μ) a_n and θ v + (1−θ) v_n as functions of θ Δφ, with Newmark's α, θ = 1 − α_f and μ = 1 − α_m.
    fn balance(&self, dt: f64) -> Alphas {
        let (inertia, force) = self.weights();
        let Alphas { a1, a2, a3, a4, a6, discrete_gradient, .. } = self.end(dt);
        mutant!("schemes: the balance of generalised α has Newmark's α₃": a3 = (a3 + 1.0) / inertia - 1.0);
        Alphas {
            dt: force * dt,
            a1: a1 * inertia / force,
            a2: a2 * inertia,
            a3: inertia * (a3 + 1.0) - 1.0,
            a4,
            a6: force * a6,
            discrete_gradient,
        }
    }

    fn end(&self, dt: f64) -> Alphas {
        self.newmark().alphas(dt)
    }

    /// A stored acceleration belongs to a time (α_m − α_f) Δt later. Through ½ a Δt² this shift adds ½ (α_m − α_f) to Newmark's β − 1/6.
    fn error_constant(&self) -> f64 {
        let (inertia, force) = self.weights();
        self.newmark().beta - 0.5 * (inertia - force) - 1.0 / 6.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::Vector;

    /// The amplification matrix A of x″ = −ω² x over one step: (x, v, a) ← A (x, v, a).
    fn amplification(scheme: &dyn Scheme, omega: f64, dt: f64) -> nalgebra::Matrix3<f64> {
        let (theta, balance, end) = (scheme.instant(), scheme.balance(dt), scheme.end(dt));
        let columns = [0, 1, 2].map(|k| {
            let state = [0, 1, 2].map(|i| if i == k { 1.0 } else { 0.0 });
            let [x, v, a] = state.map(|value| Vector::from([value]));
            // α₁ (y − ŷ) + ω² (x + y) = 0
            let y = (balance.predicted(&v, &a) * balance.a1 - x * (omega * omega)) / (balance.a1 + omega * omega);
            let (delta_v, delta_a) = end.increments(&(y / theta), &v, &a);
            nalgebra::Vector3::new((x + y / theta)[0], (v + delta_v)[0], (a + delta_a)[0])
        });
        nalgebra::Matrix3::from_columns(&columns)
    }

    #[test]
    fn what_it_leaves_of_the_fastest_vibration_is_its_spectral_radius() {
        for rho in [0.0, 0.25, 0.5, 0.8, 1.0] {
            let scheme = GeneralizedAlpha { spectral_radius: rho };
            let radius = |omega: f64| {
                let eigenvalues = amplification(&scheme, omega, 1.0).complex_eigenvalues();
                eigenvalues.iter().map(|z| z.re.hypot(z.im)).fold(0.0, f64::max)
            };
            // The limit is a triple eigenvalue, so the error is the cube root of the distance 1/ω² from the limit: 2e-5.
            assert!((radius(1e7) - rho).abs() < 1e-4, "ρ = {rho}: {}", radius(1e7));
            assert!([0.1, 1.0, 3.0, 30.0].into_iter().all(|omega| radius(omega) < 1.0 + 1e-9), "ρ = {rho} is unstable");
        }
    }

    #[test]
    fn it_is_of_second_order_and_its_local_error_is_the_estimate() {
        for rho in [0.0, 0.5, 1.0] {
            let scheme = GeneralizedAlpha { spectral_radius: rho };
            let errors = [0.02, 0.01].map(|dt| {
                let map = amplification(&scheme, 1.0, dt);
                // The start is on x = cos t. A stored acceleration belongs to a time (α_m − α_f) Δt later.
                let (inertia, force) = scheme.weights();
                let later = (force - inertia) * dt;
                let start = nalgebra::Vector3::new(1.0, 0.0, -later.cos());
                let end = (0..(1.0 / dt).round() as usize).fold(start, |state, _| map * state);
                (end[0] - 1f64.cos()).abs().max((end[1] + 1f64.sin()).abs())
            });
            let order = (errors[0] / errors[1]).log2();
            // The next term of the error's series is smaller by Δt.
            assert!((order - 2.0).abs() < 0.02, "ρ = {rho}: order {order}");
            // One step from t = 1, where the third derivative is sin 1.
            let dt = 1e-3;
            let (inertia, force) = scheme.weights();
            let state = nalgebra::Vector3::new(1f64.cos(), -1f64.sin(), -(1.0 + (force - inertia) * dt).cos());
            let after = amplification(&scheme, 1.0, dt) * state;
            let (error, estimate) =
                (after[0] - (1.0 + dt).cos(), scheme.error_constant() * dt * dt * (after[2] - state[2]));
            assert!((error / estimate - 1.0).abs() < 0.01, "ρ = {rho}: {error} for {estimate}");
        }
    }
}
