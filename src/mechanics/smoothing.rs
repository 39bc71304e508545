//! Smoothing of the particles' velocity and acceleration by what the nodes can represent: from FLIP to PIC and FMPM(k).
//!
//! The increments of eqs. 50 and 51 (FLIP) keep whatever the particles carry and the nodes do not see. The other extreme
//! gives every particle its nodes' velocity (PIC); FMPM(k) does so with a better approximation of the projection
//! (Hammerquist and Nairn 2017, Nairn and Hammerquist 2021). Here the particles move towards it at a rate κ, so that what is
//! smoothed away in a given time does not depend on Δt.

use crate::mechanics::sweep::Supports;
use crate::particles::Particles;
use crate::tensor::Vector;

/// How the fields of the particles follow those of the nodes: u_p ← u_p − θ (u_p − Σ N w), θ = 1 − exp(−κΔt),
/// w = Σ_{j<k} (I − M_L⁻¹M)^j M_L⁻¹ Σ_p N m u_p.
///
/// For k = 1 it acts like a viscosity of the size κ h²; the more, the wider the shape functions. For k → ∞, w is the
/// projection with the consistent mass, and only what the nodes cannot represent is removed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothing {
    /// k ≥ 1: 1 is PIC.
    pub order: u32,
    /// κ ≥ 0, per unit of time; infinite for PIC and FMPM(k) proper.
    pub rate: f64,
}

impl Smoothing {
    /// θ = 1 − exp(−κΔt)
    pub fn share(&self, dt: f64) -> f64 {
        -(-self.rate * dt).exp_m1()
    }

    /// −θ (u_p − Σ N w) for a field u of the particles; `mass` is M_L at the active nodes.
    ///
    /// It conserves Σ m u, because 1ᵀ(M_L − M) = 0.
    pub fn change<const D: usize>(
        &self,
        particles: &Particles<D>,
        supports: &Supports<D>,
        mass: &[f64],
        field: &[Vector<f64, D>],
        dt: f64,
    ) -> Vec<Vector<f64, D>> {
        let theta = self.share(dt);
        let lumped_projection = |field: &[Vector<f64, D>]| {
            let mut out = vec![Vector::zeros(); mass.len()];
            supports.spread(&mut out, |p| field[p] * particles.mass[p]);
            for (w, &m) in out.iter_mut().zip(mass) {
                // A node without mass weighs nothing in what follows either.
                *w = if m > 0.0 { *w / m } else { Vector::zeros() };
            }
            out
        };
        // r_j = (I − N M_L⁻¹ Nᵀm)^j u at the particles, and Σ N w = u − r_k.
        let mut rest = field.to_vec();
        for _ in 0..self.order {
            let smooth = supports.values(&lumped_projection(&rest));
            for (r, s) in rest.iter_mut().zip(smooth) {
                *r -= s;
            }
        }
        rest.iter().map(|r| r * -theta).collect()
    }
}
