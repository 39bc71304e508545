//! The linearised follower pressures of surface points.

use super::FunctionsAt;
use crate::mechanics::sweep::Supports;
use crate::tensor::{Tensor, Vector, cofactor_derivative};

/// The points of loaded surfaces.
#[derive(Debug)]
pub(crate) struct PressureRows<const D: usize>(pub Vec<PressureRow<D>>);

/// cof F = cof ΔF cof F_r, so δ(p A cof(F) N) is the derivative of cof ΔF along L = ∇_r u, applied to p A cof(F_r) N.
#[derive(Debug)]
pub(crate) struct PressureRow<const D: usize> {
    pub particle: usize,
    /// ΔF
    pub delta_f: Tensor<f64, D>,
    /// p A cof(F_r) N
    pub force: Vector<f64, D>,
}

impl<const D: usize> Default for PressureRows<D> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<const D: usize> PressureRows<D> {
    pub(crate) fn add_product(&self, supports: &Supports<D>, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        for PressureRow { particle, delta_f, force } in &self.0 {
            let delta = cofactor_derivative(delta_f, &supports.gradient_at(*particle, u)) * force;
            mutant!("loads: the tangent of a pressure has a wrong sign": delta = -delta);
            for (node, n, _) in supports.of(*particle) {
                out[node] += delta * n;
            }
        }
    }

    /// Column k of a block is N_I times the derivative along L = e_k ⊗ ∇_r N_I.
    pub(crate) fn add_blocks(&self, functions: &FunctionsAt<'_, D>, blocks: &mut [Tensor<f64, D>]) {
        for PressureRow { particle, delta_f, force } in &self.0 {
            for (node, function) in functions(*particle) {
                for k in 0..D {
                    let mut l = Tensor::<f64, D>::zeros();
                    l.set_row(k, &function.gradient[k].transpose());
                    let column = cofactor_derivative(delta_f, &l) * force;
                    (0..D).for_each(|i| blocks[node][(i, k)] += function.value[i] * column[i]);
                }
            }
        }
    }
}
