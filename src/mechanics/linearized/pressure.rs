//! The linearised follower pressures of surface points.

use super::FunctionsAt;
use crate::gpu::{self, Gpu};
use crate::mechanics::sweep::Connectivity;
use crate::tensor::{Tensor, Vector, cofactor_derivative};

/// The points of loaded surfaces.
#[derive(Debug, Default)]
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

impl<const D: usize> PressureRows<D> {
    pub(crate) fn add_product(&self, connectivity: &Connectivity<D>, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        for PressureRow { particle, delta_f, force } in &self.0 {
            let delta = cofactor_derivative(delta_f, &connectivity.gradient_at(*particle, u)) * force;
            mutant!("loads: the tangent of a pressure has a wrong sign": delta = -delta);
            for (node, n, _) in connectivity.of(*particle) {
                out[node] += delta * n;
            }
        }
    }

    /// Column k of a block is N_I times the derivative along L = e_k ⊗ ∇_r N_I.
    pub(crate) fn add_blocks(&self, functions: &FunctionsAt<'_, D>, blocks: &mut [Tensor<f64, D>]) {
        for row in &self.0 {
            for (node, function) in functions(row.particle) {
                for k in 0..D {
                    let column = row.column(k, &function.gradient[k]);
                    (0..D).for_each(|i| blocks[node][(i, k)] += function.value[i] * column[i]);
                }
            }
        }
    }

    /// A copy on a device; `None` without a point. There the product is a sum over nodes, and rounds in another order.
    pub(crate) fn on_device(&self, gpu: &Gpu, connectivity: &Connectivity<D>) -> Option<gpu::Points> {
        let mut arrays = gpu::PointArrays { first: vec![0], ..gpu::PointArrays::default() };
        for row in &self.0 {
            for (node, n, gradient) in connectivity.of(row.particle) {
                arrays.nodes.push(node as u32);
                arrays.weights.push(n);
                (0..D).for_each(|k| arrays.blocks.extend(row.column(k, &gradient).iter()));
            }
            arrays.first.push(arrays.nodes.len() as u32);
            arrays.on_free.push(gpu::NO_OBSTACLE);
        }
        gpu::Points::new(gpu, D, connectivity.nodes(), &arrays)
    }
}

impl<const D: usize> PressureRow<D> {
    /// The change of the force along L = e_k ⊗ ∇_r N.
    fn column(&self, k: usize, gradient: &Vector<f64, D>) -> Vector<f64, D> {
        let mut l = Tensor::<f64, D>::zeros();
        l.set_row(k, &gradient.transpose());
        cofactor_derivative(&self.delta_f, &l) * self.force
    }
}
