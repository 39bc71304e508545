//! Kinematics: from L = ∇_r u, the gradient of the motion since the last grid reset, to the deformation of a particle, and from its stress back to
//! the nodes. A scene with another kinematics would need another file than this one, and no other change of the terms.

use crate::material::{MaterialState, NonPositiveJacobian};
use crate::parallel::Message;
use crate::particles::Particles;
use crate::scalar::Real;
use crate::tensor::{Tensor, identity, scaled};
use std::slice::Iter;

/// A particle with det F ≤ 0.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("particle {particle} cannot be deformed so")]
pub struct Inadmissible {
    /// Id of the particle.
    pub particle: usize,
    /// The determinant found.
    pub source: NonPositiveJacobian,
}

impl Message for Inadmissible {
    fn put(&self, to: &mut Vec<f64>) {
        (self.particle, self.source.det_f).put(to);
    }

    fn take(from: &mut Iter<'_, f64>) -> Self {
        let (particle, det_f) = Message::take(from);
        Self { particle, source: NonPositiveJacobian { det_f } }
    }
}

/// H of F = ΔF F_r with ΔF = I + L: H = L + H_r + L H_r, which loses no digits (eq. 45).
///
/// ```
/// use bfree::mechanics::residual::compose;
/// use bfree::tensor::{Tensor, identity};
///
/// // I + H_{n+1} = (I + L)(I + H_r); and a strain of 1e-20 is kept beside I.
/// let (l, h_r) = (Tensor::<f64, 2>::new(0.5, 0.25, 0.0, -0.5), Tensor::<f64, 2>::new(0.0, 0.5, 0.25, 1.0));
/// assert_eq!(identity() + compose(&l, &h_r), (identity() + l) * (identity() + h_r));
/// assert_eq!(compose(&Tensor::<f64, 1>::zeros(), &Tensor::from_element(1e-20))[(0, 0)], 1e-20);
/// ```
#[inline(always)]
pub fn compose<T: Real, const D: usize>(l: &Tensor<T, D>, h_r: &Tensor<f64, D>) -> Tensor<T, D> {
    let h_r = h_r.map(T::lit);
    mutant!("deformation: F without G H_r": { return l + h_r; });
    l + h_r + l * h_r
}

/// σ = V₀ P F_rᵀ, the adjoint of [`compose`]: the force on a node is σ ∇_r N_I, and σ : L = V₀ P : δF with δF = L F_r.
#[inline(always)]
pub(crate) fn to_nodes<T: Real, const D: usize>(
    piola: &Tensor<T, D>,
    f_r: &Tensor<f64, D>,
    volume: f64,
) -> Tensor<T, D> {
    let f_r_t = f_r.transpose().map(T::lit);
    mutant!("stress: F_r is transposed": f_r_t = f_r_t.transpose());
    scaled(&(piola * f_r_t), T::lit(volume))
}

/// The deformations of particles whose reference configuration is that of the last grid reset.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kinematics<'a, const D: usize>(pub &'a Particles<D>);

impl<'a, const D: usize> Kinematics<'a, D> {
    /// H of particle p at L = `l`.
    pub(crate) fn displacement_gradient<T: Real>(self, p: usize, l: &Tensor<T, D>) -> Tensor<T, D> {
        compose(l, self.0.reference().displacement_gradient(p))
    }

    /// F_r of particle p.
    pub(crate) fn reference(self, p: usize) -> Tensor<f64, D> {
        identity::<f64, D>() + self.0.reference().displacement_gradient(p)
    }

    /// The state of particle p for its law at L = `l`, with the internal variables at t_n.
    ///
    /// # Errors
    /// det F ≤ 0
    pub(crate) fn state<T: Real>(
        self,
        p: usize,
        l: &Tensor<T, D>,
        dt: f64,
    ) -> Result<MaterialState<'a, T, D>, Inadmissible> {
        let at = self.0.state(p, dt).deformed(self.displacement_gradient(p, l)).admissible();
        at.map_err(|source| Inadmissible { particle: self.0.id[p] as usize, source })
    }

    /// V₀ P F_rᵀ of particle p.
    pub(crate) fn to_nodes<T: Real>(self, p: usize, piola: &Tensor<T, D>) -> Tensor<T, D> {
        to_nodes(piola, &self.reference(p), self.0.volume[p])
    }
}
