//! Multigrid on the background grid: one V-cycle as preconditioner.
//!
//! - The finest level is the tangent itself, known by its product.
//! - Each coarser level has hat functions on a grid of twice the spacing, and is stored as stencils. Every finer cell is one quadrature
//!   point of it, with the cell's summed volume and tangent at its centroid; in coarse cells that are not full, it has the points of Gauss.
//!   Outer nodes follow inner ones, as on the finest level.
//! - Coarse motions are interpolated linearly to finer nodes. Finer forces are restricted by the transpose.
//! - Chebyshev polynomials over block-Jacobi smooth before and after the coarse correction. Both smoothers are equal, so the cycle is
//!   symmetric where the tangent is.

mod cycle;
mod filter;
mod form;
mod interpolation;
mod level;
mod on_device;
mod rigid;

pub use form::LocalForm;
pub(crate) use rigid::rigid_motions;

use super::chebyshev::largest;
use super::{BlockJacobi, Preconditioner};
use crate::gpu::GpuVector;
use crate::pooled::Pool;
use crate::solver::{LinearOperator, Linearization, OnDevice};
use crate::space::vector::Vectors;
use cycle::{Coarse, Cycle};
use filter::Filter;
use level::Level;
use nalgebra::{DVector, Dyn, LU};
use on_device::DeviceLevels;
use std::sync::Arc;

/// Coarsening ends at a level with at most this many unknowns, which is factorised.
const BOTTOM: usize = 400;

/// One V-cycle of multigrid. Its levels are made from the first tangent it is prepared with. The finest level uses the present tangent.
#[derive(Clone, Debug, Default)]
pub struct Multigrid<const D: usize> {
    blocks: BlockJacobi<D>,
    /// The filter of the finest smoother, for cubic B-splines.
    filter: Option<Filter>,
    /// Memory pool of the smoothers.
    pool: Pool,
    /// An estimate of the largest eigenvalue of M K, with the M of the finest smoother.
    largest: f64,
    levels: Vec<Level<D>>,
    bottom: Option<LU<f64, Dyn, Dyn>>,
    /// Blocks, filter and levels on a device.
    on_device: Option<Arc<DeviceLevels>>,
}

/// Bytes of the coarse levels for a finest level of `nodes` nodes, and of the [`LocalForm`] that they are made from.
pub(crate) fn bytes(nodes: usize, dimension: usize) -> usize {
    let (block, tangent) = (dimension.pow(2) * size_of::<f64>(), dimension.pow(4) * size_of::<f64>());
    // Interpolation and its transpose: 1.5^D coarse nodes for a node.
    let transfer = 2 * 1.5_f64.powi(dimension as i32).ceil() as usize * size_of::<u32>();
    // Coarse grids have a half more nodes than the share 1/2^D, because of surfaces.
    let coarse = 2 * nodes.div_ceil(1 << dimension);
    nodes * (tangent + transfer + size_of::<u32>()) + coarse * (28 * block + 27 * size_of::<u32>())
}

impl<const D: usize> Multigrid<D> {
    /// Makes the levels of a tangent.
    fn build(&mut self, form: Option<LocalForm>, fine: &dyn LinearOperator) {
        let cubic = form.as_ref().filter(|form| form.degree == 3);
        self.filter = cubic.map(|form| Filter::new::<D>(form, self.blocks.inverses()));
        self.largest = largest(fine, &|r: &[f64], z: &mut [f64]| self.filtered(r, z), self.blocks.len());
        let Some(mut form) = form else { return };
        loop {
            let (level, next) = Level::<D>::of(&form);
            let size = D * next.nodes.len();
            let last = size <= BOTTOM || next.grid.iter().all(|&cells| cells <= 1);
            if last {
                let mut matrix = level.assembled();
                rigid::hold::<D>(&mut matrix, &next.nodes, &next.fixed());
                self.bottom = Some(matrix.lu());
            }
            self.levels.push(level);
            form = next;
            if last {
                return;
            }
        }
    }

    /// z = M r, with the M of the finest smoother.
    fn filtered(&self, r: &[f64], z: &mut [f64]) {
        self.blocks.apply(r, z);
        if let Some(filter) = &self.filter {
            filter.add::<D>(r, z);
        }
    }

    /// The solution of the last level.
    fn solve_bottom(&self, b: &[f64], x: &mut [f64]) {
        match (self.bottom.as_ref().and_then(|lu| solved(lu, b)), self.levels.last()) {
            (Some(solved), _) => x.copy_from_slice(solved.as_slice()),
            (None, Some(level)) => level.precondition(b, x),
            (None, None) => x.copy_from_slice(b),
        }
    }

    /// Makes blocks and levels of the first tangent.
    fn take(&mut self, tangent: &dyn Linearization) {
        if self.levels.is_empty() {
            self.blocks.take(tangent);
            self.build(tangent.local_form(), tangent);
        }
    }
}

/// A⁻¹ b, column by column; `None` if A is singular. The bits are those of `LU::solve`, whose loops over columns are not vectorised.
fn solved(lu: &LU<f64, Dyn, Dyn>, b: &[f64]) -> Option<DVector<f64>> {
    let mut solved = DVector::from_column_slice(b);
    lu.p().permute_rows(&mut solved);
    let (x, columns) = (solved.as_mut_slice(), lu.lu_internal().as_slice());
    let columns = || columns.chunks(b.len().max(1)).enumerate();
    let subtract =
        |x: &mut [f64], factor: f64, column: &[f64]| x.iter_mut().zip(column).for_each(|(x, a)| *x -= factor * a);
    for (k, column) in columns() {
        let factor = x[k];
        subtract(&mut x[k + 1..], factor, &column[k + 1..]);
    }
    for (k, column) in columns().rev() {
        x[k] = if column[k] == 0.0 { return None } else { x[k] / column[k] };
        let factor = x[k];
        subtract(&mut x[..k], factor, &column[..k]);
    }
    Some(solved)
}

impl<const D: usize> Preconditioner for Multigrid<D> {
    fn prepare<'a>(&'a mut self, tangent: &'a dyn Linearization) -> Box<dyn LinearOperator + 'a> {
        self.take(tangent);
        let this = &*self;
        Box::new(Cycle {
            vectors: &this.pool,
            tangent,
            smoother: Box::new(|r: &[f64], z: &mut [f64]| this.filtered(r, z)),
            largest: this.largest,
            levels: this.levels.iter().map(|level| level as &dyn Coarse<Pool>).collect(),
            bottom: Box::new(|b: &[f64], x: &mut [f64]| this.solve_bottom(b, x)),
        })
    }

    fn prepare_on_device<'a>(
        &'a mut self,
        tangent: &'a dyn Linearization,
        system: &'a dyn OnDevice,
    ) -> Option<Box<dyn LinearOperator<GpuVector> + 'a>> {
        self.take(tangent);
        let vectors = &**system.gpu();
        if self.on_device.is_none() {
            self.on_device = Some(Arc::new(DeviceLevels::of(system.gpu(), self)));
        }
        let (this, levels) = (&*self, self.on_device.as_deref()?);
        Some(Box::new(Cycle {
            vectors,
            tangent: system,
            smoother: Box::new(|r: &GpuVector, z: &mut GpuVector| levels.smooth(vectors, r, z)),
            largest: this.largest,
            levels: levels.coarse(),
            bottom: Box::new(|b: &GpuVector, x: &mut GpuVector| {
                let mut solved = vec![0.0; vectors.len(b)];
                this.solve_bottom(&vectors.numbers(b), &mut solved);
                vectors.write_at(&solved, &mut x.0, 0);
            }),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    #[test]
    fn the_last_level_is_solved_with_the_bits_of_the_library() {
        let entry = |i: usize, j: usize| if i == j { 0.1 } else { 1.0 / (1.0 + i as f64 + 2.0 * j as f64) };
        for n in [1, 2, 7, 40] {
            let (lu, b) = (DMatrix::from_fn(n, n, entry).lu(), DVector::from_fn(n, |i, _| (i as f64 - 2.5).sin()));
            assert_eq!(solved(&lu, b.as_slice()), lu.solve(&b));
        }
        assert_eq!(solved(&DMatrix::zeros(3, 3).lu(), &[1.0; 3]), None);
    }
}
