//! The exact solution of the Riemann problem of section 4.1.
//!
//! In material coordinates a bar in uniaxial strain obeys the p-system
//!
//! ```text
//! ∂F/∂t = ∂v/∂X,   ρ ∂v/∂t = ∂P/∂X,   P(F) = (Λ/2 + G)(F − 1/F)
//! ```
//!
//! with the speeds ∓c, c² = P'(F)/ρ. P is strictly concave (P'' < 0), so c falls with F: compression steepens to shocks, expansion
//! spreads to fans. From the outer state (F₀, v₀) the state behind a wave lies on
//!
//! ```text
//! v = v₀ ± φ(F, F₀),   φ = ∫ c dF  (fan, F > F₀),   φ = −√((P − P₀)(F − F₀)/ρ)  (shock, F < F₀)
//! ```
//!
//! The upper sign is for the family that runs to the left, the lower for the one to the right. Both curves are monotone,
//! φ → ∓∞ as F → 0, ∞, so every pair of states has exactly one solution.

/// The law and the density of the bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PSystem {
    /// Λ/2 + G (stress).
    pub modulus: f64,
    /// ρ₀ (mass per volume).
    pub density: f64,
}

/// Deformation gradient and velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// F > 0
    pub stretch: f64,
    /// v
    pub velocity: f64,
}

/// One wave, with the speeds of its edges in material coordinates (equal for a shock), the slower first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wave {
    /// A compressive discontinuity.
    Shock(f64),
    /// An expansive fan between the two speeds.
    Fan(f64, f64),
}

impl Wave {
    /// The smallest and the largest of its speeds.
    pub fn edges(&self) -> (f64, f64) {
        match *self {
            Self::Shock(speed) => (speed, speed),
            Self::Fan(slow, fast) => (slow, fast),
        }
    }
}

/// A solved Riemann problem; it depends on ξ = X/t alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Riemann {
    system: PSystem,
    /// The states at the far left, in the middle, and at the far right.
    pub states: [State; 3],
    /// The wave to the left, with negative speed, and the wave to the right.
    pub waves: [Wave; 2],
}

/// The given states belong to no bar: F or a constant is not finite and positive, or a velocity is not finite.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("F, the modulus and the density must be finite and > 0, and velocities finite")]
pub struct NoState;

impl PSystem {
    /// P(F)
    pub fn stress(&self, f: f64) -> f64 {
        self.modulus * (f - 1.0 / f)
    }

    /// c(F) = √(P'/ρ), P' = (Λ/2 + G)(1 + 1/F²)
    pub fn speed(&self, f: f64) -> f64 {
        (self.modulus / self.density).sqrt() * 1.0_f64.hypot(1.0 / f)
    }

    /// W(F) per reference volume, with W(1) = 0.
    pub fn energy(&self, f: f64) -> f64 {
        self.modulus * (0.5 * (f * f - 1.0) - f.ln())
    }

    /// ∫ c dF = √((Λ/2 + G)/ρ) [√(1 + F²) − arsinh(1/F)], an antiderivative.
    fn integrated_speed(&self, f: f64) -> f64 {
        (self.modulus / self.density).sqrt() * (1.0_f64.hypot(f) - (1.0 / f).asinh())
    }

    /// φ(F, F₀), increasing in F; see the head of this module.
    pub fn wave_curve(&self, f: f64, f_0: f64) -> f64 {
        if f >= f_0 {
            self.integrated_speed(f) - self.integrated_speed(f_0)
        } else {
            -((self.stress(f) - self.stress(f_0)) * (f - f_0) / self.density).sqrt()
        }
    }

    /// The wave between the outer F₀ and F*, as it runs to the right.
    fn wave(&self, outer: f64, star: f64) -> Wave {
        if star < outer {
            Wave::Shock(((self.stress(star) - self.stress(outer)) / (self.density * (star - outer))).sqrt())
        } else {
            Wave::Fan(self.speed(star), self.speed(outer))
        }
    }

    /// Solves the problem with the given states on both sides of X = 0.
    ///
    /// # Errors
    /// States that belong to no bar.
    pub fn solve(self, left: State, right: State) -> Result<Riemann, NoState> {
        let positive = [self.modulus, self.density, left.stretch, right.stretch];
        let sound = positive.iter().all(|x| *x > 0.0 && x.is_finite());
        if !sound || !left.velocity.is_finite() || !right.velocity.is_finite() {
            return Err(NoState);
        }
        // v* seen from the left minus v* seen from the right, increasing in F*.
        let gap = |f: f64| {
            (left.velocity + self.wave_curve(f, left.stretch)) - (right.velocity - self.wave_curve(f, right.stretch))
        };
        let (mut low, mut high) = (left.stretch.min(right.stretch), left.stretch.max(right.stretch));
        while gap(low) > 0.0 {
            low *= 0.5;
        }
        while gap(high) < 0.0 {
            high *= 2.0;
        }
        // Bisection to neighbouring numbers cannot fail, and its cost does not matter.
        loop {
            let middle = low + 0.5 * (high - low);
            if middle <= low || middle >= high {
                break;
            }
            if gap(middle) < 0.0 { low = middle } else { high = middle }
        }
        let stretch = high;
        let velocity = 0.5
            * ((left.velocity + self.wave_curve(stretch, left.stretch))
                + (right.velocity - self.wave_curve(stretch, right.stretch)));
        let to_left = match self.wave(left.stretch, stretch) {
            Wave::Shock(speed) => Wave::Shock(-speed),
            Wave::Fan(slow, fast) => Wave::Fan(-fast, -slow),
        };
        let waves = [to_left, self.wave(right.stretch, stretch)];
        Ok(Riemann { system: self, states: [left, State { stretch, velocity }, right], waves })
    }
}

impl Riemann {
    /// The state at ξ = X/t; on a shock, the state behind it.
    pub fn at(&self, xi: f64) -> State {
        let [left, star, right] = self.states;
        let side = if xi < 0.0 { 0 } else { 1 };
        let (outer, sign, (slow, fast)) = match side {
            0 => (left, 1.0, (-self.waves[0].edges().1, -self.waves[0].edges().0)),
            _ => (right, -1.0, self.waves[1].edges()),
        };
        let speed = xi.abs();
        if speed <= slow {
            return star;
        }
        if speed >= fast {
            return outer;
        }
        // In a fan c(F) = |ξ|: 1 + 1/F² = ρ ξ²/(Λ/2 + G).
        let stretch = (self.system.density * speed * speed / self.system.modulus - 1.0).sqrt().recip();
        State { stretch, velocity: outer.velocity + sign * self.system.wave_curve(stretch, outer.stretch) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn system(young: f64) -> PSystem {
        let (lambda, shear) = (young * 0.3 / (1.3 * 0.4), young / 2.6);
        PSystem { modulus: 0.5 * lambda + shear, density: 2600.0 }
    }

    fn state(stretch: f64, velocity: f64) -> State {
        State { stretch, velocity }
    }

    /// Pairs of states whose solutions include all four combinations of waves, weak and strong.
    fn problems() -> Vec<Riemann> {
        let mut solved = Vec::new();
        for (left, right) in [
            (state(1.0, 10.0), state(1.0, 0.0)),
            (state(1.0, 1000.0), state(1.0, 0.0)),
            (state(1.0, 0.0), state(1.0, 1000.0)),
            (state(0.7, 0.0), state(1.4, 0.0)),
            (state(1.4, 300.0), state(0.7, 100.0)),
            (state(0.5, -2000.0), state(2.0, 1500.0)),
            (state(1.2, 4000.0), state(0.9, -3000.0)),
        ] {
            solved.push(system(5e10).solve(left, right).unwrap());
        }
        let kinds = |solved: &Riemann| solved.waves.map(|wave| matches!(wave, Wave::Shock(_)));
        for both in [[true, true], [true, false], [false, true], [false, false]] {
            assert!(solved.iter().any(|problem| kinds(problem) == both), "no problem with shocks {both:?}");
        }
        solved
    }

    /// (outer state, speed with its sign, wave) for both waves.
    fn sides(problem: &Riemann) -> [(State, f64, Wave); 2] {
        [(problem.states[0], -1.0, problem.waves[0]), (problem.states[2], 1.0, problem.waves[1])]
    }

    #[test]
    fn the_states_of_the_reference() {
        let fan = |slow: f64, fast: f64| [slow, fast];
        for (young, left, right, stretch, edges) in [
            (1e10, 10.0, 0.0, 0.997803807075, fan(2276.6670, 2276.6670)),
            (5e10, 100.0, 0.0, 0.990197155527, fan(5100.5604, 5100.5604)),
            (5e10, 0.0, 100.0, 1.009851139976, fan(5063.2274, 5087.9833)),
            (5e10, 1000.0, 0.0, 0.904232232867, fan(5220.9633, 5220.9633)),
            (5e10, 0.0, 1000.0, 1.100605232968, fan(4861.0050, 5087.9833)),
        ] {
            let solved = system(young).solve(state(1.0, left), state(1.0, right)).unwrap();
            let star = solved.states[1];
            assert!((star.stretch - stretch).abs() < 1e-12, "{star:?}");
            assert!((star.velocity - 0.5 * (left + right)).abs() < 1e-10, "{star:?}");
            let (slow, fast) = solved.waves[1].edges();
            assert!((slow - edges[0]).abs() < 1e-4 && (fast - edges[1]).abs() < 1e-4, "{slow} {fast}");
            assert_eq!(solved.waves[0].edges(), (-fast, -slow));
        }
    }

    #[test]
    fn fans_keep_their_riemann_invariant_and_spread() {
        for problem in problems() {
            for (outer, sign, wave) in sides(&problem) {
                let Wave::Fan(..) = wave else { continue };
                let (slow, fast) = wave.edges();
                assert!(fast >= slow);
                for k in 0..=100 {
                    let xi = slow + (fast - slow) * f64::from(k) / 100.0;
                    let at = problem.at(xi);
                    assert!((problem.system.speed(at.stretch) - xi.abs()).abs() < 1e-9 * xi.abs());
                    // v ± ∫ c dF with Simpson's rule, not with the antiderivative.
                    let (n, mut integral) = (200, 0.0);
                    let width = (at.stretch - outer.stretch) / f64::from(n);
                    for i in 0..n {
                        let f = outer.stretch + f64::from(i) * width;
                        let c = |x| problem.system.speed(f + x * width);
                        integral += width / 6.0 * (c(0.0) + 4.0 * c(0.5) + c(1.0));
                    }
                    let expected = outer.velocity - sign * integral;
                    assert!((at.velocity - expected).abs() < 1e-9 * problem.system.speed(1.0), "{at:?} {expected}");
                }
            }
        }
    }

    /// ∫ g(state) dξ from −reach to reach, by Gauss's rule on pieces that end at the edges of the waves.
    fn integral(problem: &Riemann, reach: f64, g: impl Fn(State) -> f64) -> f64 {
        let (a, b) = (problem.waves[0].edges(), problem.waves[1].edges());
        let ends = [-reach, a.0, a.1, 0.0, b.0, b.1, reach];
        let (node, weight) = ([-0.6_f64.sqrt(), 0.0, 0.6_f64.sqrt()], [5.0, 8.0, 5.0]);
        let mut sum = 0.0;
        for piece in ends.windows(2) {
            let n = 400;
            let half = 0.5 * (piece[1] - piece[0]) / f64::from(n);
            for i in 0..n {
                let middle = piece[0] + (2.0 * f64::from(i) + 1.0) * half;
                for k in 0..3 {
                    sum += weight[k] / 9.0 * half * g(problem.at(middle + node[k] * half));
                }
            }
        }
        sum
    }

    #[test]
    fn deformation_momentum_and_energy_are_conserved() {
        for problem in problems() {
            let ([left, _, right], system) = (problem.states, problem.system);
            let reach = 1.5 * problem.waves[0].edges().0.abs().max(problem.waves[1].edges().1);
            // d/dt ∫ u dX = flux(right) − flux(left); with X = ξ t: ∫ u dξ = reach (u_l + u_r) + flux_r − flux_l.
            let error = |g: &dyn Fn(State) -> f64, flux: &dyn Fn(State) -> f64| {
                let found = integral(&problem, reach, g);
                let scale = integral(&problem, reach, |at| g(at).abs()) + flux(left).abs() + flux(right).abs();
                (found - reach * (g(left) + g(right)) - (flux(right) - flux(left))) / scale
            };
            let deformation = error(&|at| at.stretch, &|at| at.velocity);
            let momentum = error(&|at| system.density * at.velocity, &|at| system.stress(at.stretch));
            assert!(deformation.abs() < 1e-10 && momentum.abs() < 1e-10, "{deformation:e} {momentum:e}");
            // Fans conserve the energy; shocks dissipate some.
            let energy =
                error(&|at| 0.5 * system.density * at.velocity * at.velocity + system.energy(at.stretch), &|at| {
                    system.stress(at.stretch) * at.velocity
                });
            let shock = problem.waves.iter().any(|wave| matches!(wave, Wave::Shock(_)));
            assert!(if shock { energy < 0.0 } else { energy.abs() < 1e-10 }, "{energy:e}");
        }
    }
    #[test]
    fn states_of_no_bar_are_refused() {
        assert_eq!(system(1.0).solve(state(0.0, 0.0), state(1.0, 0.0)), Err(NoState));
        assert_eq!(system(1.0).solve(state(1.0, f64::NAN), state(1.0, 0.0)), Err(NoState));
    }
}
