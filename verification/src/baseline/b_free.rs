//! Blocks without Voigt's notation (eqs. 34, 38).

use super::Stiffness;
use bfree::material::{Law, MaterialState};
use bfree::tensor::{Tensor, Vector, identity, scaled};

/// K_IJ = V₀ { F ℂmat{∇N_I, ∇N_J} Fᵀ + (∇N_I · S ∇N_J) I }, with ℂmat from [`Law::tangent_density`].
#[derive(Clone, Copy, Debug, Default)]
pub struct BFree;

impl<const D: usize> Stiffness<D> for BFree {
    fn blocks<L: Law>(
        &self,
        law: &L,
        at: &MaterialState<f64, D>,
        volume: f64,
        gradients: &[Vector<f64, D>],
        mut add: impl FnMut(usize, usize, Tensor<f64, D>),
    ) {
        let (f_t, stress) = (at.f.transpose(), law.stress(at));
        let s_grad: Vec<_> = gradients.iter().map(|grad| stress * grad).collect();
        for (i, grad_i) in gradients.iter().enumerate() {
            for (j, grad_j) in gradients.iter().enumerate() {
                let material = at.f * law.tangent_density(at, grad_i, grad_j) * f_t;
                add(i, j, scaled(&(material + scaled(&identity(), grad_i.dot(&s_grad[j]))), volume));
            }
        }
    }
}
