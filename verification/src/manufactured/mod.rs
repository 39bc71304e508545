//! Manufactured solutions: a motion is chosen, and the body force that makes it a solution follows from the law.
//!
//! b = φ_tt − (1/ρ₀) DIV P(GRAD φ), with every derivative by dual numbers through the motion and through the shipped law.

mod axis_aligned;
mod block;
mod vortex;

pub use axis_aligned::AxisAligned;
pub use block::Block;
pub use vortex::Vortex;

use bfree::material::{Law, MaterialState};
use bfree::mechanics::loads::ForceField;
use bfree::scalar::Real;
use bfree::tensor::{Tensor, Vector, identity};
use num_dual::{Dual, Dual2_64, Dual64};
use std::sync::Arc;

/// A motion x = φ(X, t) given by its displacement, generic over the number type.
pub trait Motion<const D: usize>: Sync {
    /// u(X, t) = φ(X, t) − X
    fn displacement<T: Real>(&self, x: &Vector<T, D>, t: T) -> Vector<T, D>;
}

/// The state of a particle of the exact solution.
#[derive(Clone, Copy, Debug)]
pub struct State<const D: usize> {
    /// x
    pub position: Vector<f64, D>,
    /// v
    pub velocity: Vector<f64, D>,
    /// a
    pub acceleration: Vector<f64, D>,
    /// H = F − I
    pub displacement_gradient: Tensor<f64, D>,
}

/// The exact state of the particle with the reference position `x` at time `t`.
pub fn state<M: Motion<D>, const D: usize>(motion: &M, x: &Vector<f64, D>, t: f64) -> State<D> {
    let u = motion.displacement(&x.map(Dual2_64::from_re), Dual2_64::from_re(t).derivative());
    State {
        position: x + u.map(|u| u.re),
        velocity: u.map(|u| u.v1),
        acceleration: u.map(|u| u.v2),
        displacement_gradient: gradient(motion, x, t),
    }
}

/// GRAD u, column by column.
fn gradient<M: Motion<D>, T: Real, const D: usize>(motion: &M, x: &Vector<T, D>, t: f64) -> Tensor<T, D> {
    let mut h = Tensor::<T, D>::zeros();
    for k in 0..D {
        let seeded = Vector::<Dual<T>, D>::from_fn(|i, _| Dual::new(x[i], if i == k { T::one() } else { T::zero() }));
        h.set_column(k, &motion.displacement(&seeded, Dual::lit(t)).map(|u| u.eps));
    }
    h
}

/// The force per unit mass under which a solid of density ρ₀ has this motion: φ_tt − (1/ρ₀) DIV P.
pub fn body_force<M: Motion<D>, L: Law, const D: usize>(
    motion: &M,
    law: &L,
    density: f64,
    x: &Vector<f64, D>,
    t: f64,
) -> Vector<f64, D> {
    let acceleration = motion.displacement(&x.map(Dual2_64::from_re), Dual2_64::from_re(t).derivative()).map(|u| u.v2);
    let mut divergence = Vector::<f64, D>::zeros();
    for k in 0..D {
        // (DIV P)_i = Σ_k ∂P_ik/∂X_k
        let seeded = Vector::<Dual64, D>::from_fn(|i, _| Dual64::new(x[i], f64::from(i == k)));
        let at = MaterialState::new(gradient(motion, &seeded, t));
        let piola = (identity::<Dual64, D>() + at.h) * law.stress(&at);
        divergence += piola.column(k).map(|p| p.eps);
    }
    acceleration - divergence / density
}

/// The body force as a load of a simulation whose particle `id` has the reference position `reference[id]`.
pub fn force_field<M: Motion<D> + Send + 'static, L: Law + 'static, const D: usize>(
    motion: M,
    law: L,
    density: f64,
    reference: Vec<Vector<f64, D>>,
) -> ForceField<D> {
    ForceField(Arc::new(move |id, _, t| body_force(&motion, &law, density, &reference[id], t)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bfree::material::{Lame, LameError, NeoHookean};

    /// For a diagonal F the neo-Hookean P_ii depends on F₁₁ and F₂₂ alone, so its divergence has a closed form.
    #[test]
    fn the_force_of_the_axis_aligned_motion_agrees_with_its_closed_form() -> Result<(), LameError> {
        let lame = Lame::new(0.7, 0.4)?;
        let (law, motion, density) = (NeoHookean::ciarlet(lame), AxisAligned::default(), 1.3);
        let t = 0.37;
        for (x, y) in [(0.11, 0.52), (0.83, 0.27), (0.5, 0.999), (0.0, 1.0)] {
            let force = body_force(&motion, &law, density, &Vector::from([x, y]), t);
            let (tau, omega) = (std::f64::consts::TAU, motion.frequency);
            let s = [(omega * t).sin(), -(omega * t).sin()];
            let place = [x, y];
            let stretch: [f64; 2] =
                std::array::from_fn(|i| 1.0 + motion.amplitude * tau * (tau * place[i]).cos() * s[i]);
            for i in 0..2 {
                let (f, other) = (stretch[i], stretch[1 - i]);
                // P_ii = Λ/2 (f²o² − 1)/f + G (f − 1/f)
                let stiffness =
                    0.5 * lame.lambda * (other * other + 1.0 / (f * f)) + lame.shear * (1.0 + 1.0 / (f * f));
                let slope = -motion.amplitude * tau * tau * (tau * place[i]).sin() * s[i];
                let acceleration = -omega * omega * motion.amplitude * (tau * place[i]).sin() * s[i];
                let expected = acceleration - stiffness * slope / density;
                assert!((force[i] - expected).abs() < 1e-13, "{force} instead of {expected} in component {i}");
            }
        }
        Ok(())
    }

    #[test]
    fn the_force_of_the_vortex_agrees_with_differences() -> Result<(), LameError> {
        let (law, motion, density) = (NeoHookean::ciarlet(Lame::new(0.7, 0.4)?), Vortex::default(), 1.3);
        let (x, t, e) = (Vector::from([0.31, -0.44]), 0.61, 1e-5);
        let piola = |x: Vector<f64, 2>| {
            let at = MaterialState::new(state(&motion, &x, t).displacement_gradient);
            at.f * law.stress(&at)
        };
        let mut divergence = Vector::<f64, 2>::zeros();
        for k in 0..2 {
            let mut step = Vector::zeros();
            step[k] = e;
            divergence += (piola(x + step) - piola(x - step)).column(k) / (2.0 * e);
        }
        let place = |t: f64| state(&motion, &x, t).position;
        let acceleration = (place(t + 1e-4) - place(t) * 2.0 + place(t - 1e-4)) / 1e-8;
        let expected = acceleration - divergence / density;
        let difference = (body_force(&motion, &law, density, &x, t) - expected).norm();
        assert!(difference < 1e-6, "differs by {difference:e}");
        Ok(())
    }

    #[test]
    fn the_vortex_keeps_volume_and_turns_its_centre_as_a_rigid_body() {
        let motion = Vortex::default();
        for x in [[0.0, 0.0], [0.3, 0.5], [-0.6, 0.2]] {
            let at = MaterialState::new(state(&motion, &Vector::from(x), 1.0).displacement_gradient);
            assert!(at.j.abs() < 1e-14);
        }
        let centre = MaterialState::new(state(&motion, &Vector::zeros(), 1.0).displacement_gradient);
        assert!(centre.green_lagrange().amax() < 1e-15 && centre.h.amax() > 0.5);
    }
}
