//! The finest smoother of cubic B-splines. Values at nodes are [1 4 1]/6 of their coefficients along each axis, so coefficients that
//! alternate from node to node hardly move the body. D⁻¹K is small for such patterns, and point smoothers damp them poorly. The filter Q Qᵀ
//! with Q ≈ Π_axes ([1 4 1]/6)⁻¹ amplifies them: M = D⁻¹ + D^{−½} Q Qᵀ D^{−½} takes the place of D⁻¹.

use super::form::LocalForm;
use crate::parallel;
use crate::solver::vector::{axpy, update};
use crate::tensor::{Tensor, Vector};
use rustc_hash::FxHashMap;

/// Steps of the Chebyshev iteration for ([1 4 1]/6)⁻¹.
const STEPS: usize = 3;
/// Bounds of the eigenvalues of [1 4 1]/6.
const SPECTRUM: [f64; 2] = [1.0 / 3.0, 1.0];

/// Nodes in one part of the work of a thread.
const PART: usize = 2048;

/// The number of a neighbour that does not exist.
const NONE: u32 = u32::MAX;

/// The filter D^{−½} Q Qᵀ D^{−½}.
#[derive(Clone, Debug, Default)]
pub(super) struct Filter {
    /// The two neighbours of each node along each axis: before and behind the node.
    beside: [Vec<[u32; 2]>; 3],
    /// (D unit)^{−½} of each unknown; 0 for values that are no unknowns.
    scale: Vec<f64>,
    unit: f64,
}

impl Filter {
    /// The filter for the nodes of a form, with the inverse diagonal blocks of the tangent.
    pub fn new<const D: usize>(form: &LocalForm, inverses: &[Tensor<f64, D>]) -> Self {
        let fixed = form.fixed();
        let is_unknown = |node: usize| (0..D).any(|i| !fixed[node * D + i]);
        let unknowns = form.nodes.iter().enumerate().filter(|(node, _)| is_unknown(*node));
        let numbers: FxHashMap<[u32; 3], u32> = unknowns.map(|(number, &at)| (at, number as u32)).collect();
        let beside = |axis: usize, at: [u32; 3], by: u32| {
            let mut next = at;
            next[axis] = (at[axis] + by).checked_sub(1).unwrap_or(NONE);
            numbers.get(&next).copied().unwrap_or(NONE)
        };
        let along = |axis: usize| form.nodes.iter().map(|&at| [beside(axis, at, 0), beside(axis, at, 2)]).collect();
        let diagonal = |k: usize| if fixed[k] { 0.0 } else { inverses[k / D][(k % D, k % D)] };
        let largest = (0..fixed.len()).map(diagonal).fold(0.0, f64::max);
        // A power of two, so that units by powers of two do not change the bits of the roots.
        let unit = if largest > 0.0 { largest.log2().floor().exp2() } else { 1.0 };
        let root = |k: usize| (diagonal(k) / unit).sqrt();
        let usable = |scale: f64| if scale.is_finite() { scale } else { 0.0 };
        Self {
            beside: std::array::from_fn(|axis| if axis < D { along(axis) } else { Vec::new() }),
            scale: (0..fixed.len()).map(|k| usable(root(k))).collect(),
            unit,
        }
    }

    /// z += D^{−½} Q Qᵀ D^{−½} r
    pub fn add<const D: usize>(&self, r: &[f64], z: &mut [f64]) {
        mutant!("multigrid: cubic splines have no filter": { return; });
        let mut x = r.to_vec();
        update(&self.scale, &mut x, |scale, r| r * scale);
        (0..D).rev().for_each(|axis| self.invert::<D>(axis, &mut x));
        (0..D).for_each(|axis| self.invert::<D>(axis, &mut x));
        update(&self.scale, &mut x, |scale, x| x * scale * self.unit);
        axpy(1.0, &x, z);
    }

    /// x ← q(B) x with B = [1 4 1]/6 along an axis and the polynomial q ≈ 1/B.
    fn invert<const D: usize>(&self, axis: usize, x: &mut [f64]) {
        let [lower, upper] = SPECTRUM;
        let (theta, delta) = (0.5 * (upper + lower), 0.5 * (upper - lower));
        let sigma = theta / delta;
        let (mut r, mut rho) = (x.to_vec(), 1.0 / sigma);
        update(&r, x, |r, _| r / theta);
        let mut p = x.to_vec();
        for _ in 1..STEPS {
            self.subtract_product::<D>(axis, &p, &mut r);
            let next = 1.0 / (2.0 * sigma - rho);
            update(&r, &mut p, |r, p| next * rho * p + 2.0 * next / delta * r);
            axpy(1.0, &p, x);
            rho = next;
        }
    }

    /// r −= B p
    fn subtract_product<const D: usize>(&self, axis: usize, p: &[f64], r: &mut [f64]) {
        let p: &[Vector<f64, D>] = bytemuck::cast_slice(p);
        let r: &mut [Vector<f64, D>] = bytemuck::cast_slice_mut(r);
        let parts = r.chunks_mut(PART).zip(p.chunks(PART)).zip(self.beside[axis].chunks(PART));
        parallel::for_each(parts, &|((r, own), beside): ((&mut [_], &[_]), &[[u32; 2]])| {
            for ((r, own), beside) in r.iter_mut().zip(own).zip(beside) {
                let others = beside.iter().filter(|&&other| other != NONE);
                let others = others.fold(Vector::zeros(), |sum: Vector<f64, D>, &other| sum + p[other as usize]);
                *r -= (own * 4.0 + others) / 6.0;
            }
        });
    }
}
