//! What a step in time is: incremental Newmark-β (the paper's Table 1), or a load step without inertia.

/// Whether bodies have inertia.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Inertia {
    /// They have, integrated in time by [`Newmark`].
    #[default]
    Newmark,
    /// They have none: every step ends in static equilibrium under the loads at its end. Time says which loads those are, and no
    /// velocity, acceleration or mass matrix exists.
    None,
}

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

/// a = α₁ Δφ − α₂ v_n − α₃ a_n,  v = α₄ Δφ + α₅ v_n + α₆ a_n   (eq. 19)
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)] // named in the formula above
pub struct Alphas {
    pub a1: f64,
    pub a2: f64,
    pub a3: f64,
    pub a4: f64,
    pub a5: f64,
    pub a6: f64,
}

impl Alphas {
    /// a = a_n for Δφ = 0: the equilibrium at the start of a step.
    pub const START: Self = Self { a1: 1.0, a2: 0.0, a3: -1.0, a4: 0.0, a5: 1.0, a6: 0.0 };
    /// a = 0 and v = 0 for every Δφ: nothing has inertia.
    pub const NONE: Self = Self { a1: 0.0, a2: 0.0, a3: 0.0, a4: 0.0, a5: 0.0, a6: 0.0 };
}

impl Newmark {
    /// The α-parameters of a step of length `dt`.
    ///
    /// ```
    /// use bfree::mechanics::time::Newmark;
    ///
    /// // Uniformly accelerated motion, Δφ = v Δt + ½ a Δt², is exact for every β and γ.
    /// let (v, a, dt) = (3.0, -2.0, 0.25);
    /// let alphas = Newmark { beta: 0.3025, gamma: 0.6 }.alphas(dt);
    /// let dphi = v * dt + 0.5 * a * dt * dt;
    /// assert!((alphas.a1 * dphi - alphas.a2 * v - alphas.a3 * a - a).abs() < 1e-12);
    /// assert!((alphas.a4 * dphi + alphas.a5 * v + alphas.a6 * a - (v + a * dt)).abs() < 1e-12);
    /// ```
    pub fn alphas(&self, dt: f64) -> Alphas {
        let Self { beta, gamma } = *self;
        Alphas {
            a1: 1.0 / (beta * dt * dt),
            a2: 1.0 / (beta * dt),
            a3: (1.0 - 2.0 * beta) / (2.0 * beta),
            a4: gamma / (beta * dt),
            a5: 1.0 - gamma / beta,
            a6: (1.0 - gamma / (2.0 * beta)) * dt,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uniformly_accelerated_motion_is_exact_for_every_beta_and_gamma() {
        let (v, a) = (1.7, -3.0);
        for (beta, gamma) in [(0.25, 0.5), (0.3025, 0.6), (0.5, 0.9), (1.0, 1.5)] {
            for dt in [1e-3, 0.5, 40.0] {
                let alphas = Newmark { beta, gamma }.alphas(dt);
                let dphi = v * dt + 0.5 * a * dt * dt;
                let acceleration = alphas.a1 * dphi - alphas.a2 * v - alphas.a3 * a;
                let velocity = alphas.a4 * dphi + alphas.a5 * v + alphas.a6 * a;
                assert!(
                    (acceleration - a).abs() < 1e-15 * alphas.a2 * 64.0 * (1.0 + dt),
                    "β = {beta}: a = {acceleration}"
                );
                assert!(
                    (velocity - (v + a * dt)).abs() < 1e-13 * (1.0 + dt),
                    "β = {beta}, γ = {gamma}: v = {velocity}"
                );
            }
        }
    }
}
