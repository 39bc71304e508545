//! Multigrid on the background grid: one V-cycle as preconditioner.
//!
//! - The finest level is the tangent itself, known by its product.
//! - Each coarser level has hat functions on a grid of twice the spacing, and is stored as stencils. Every finer cell is one quadrature
//!   point of it, with the cell's summed volume and tangent at its centroid; in coarse cells that are not full, it has the points of Gauss.
//!   Outer nodes follow inner ones, as on the finest level.
//! - Coarse motions are interpolated linearly to finer nodes. Finer forces are restricted by the transpose.
//! - Chebyshev polynomials over block-Jacobi smooth before and after the coarse correction. Both smoothers are equal, so the cycle is
//!   symmetric where the tangent is.

mod filter;
mod form;
mod interpolation;
mod level;
mod rigid;

pub use form::LocalForm;

use super::chebyshev::{Chebyshev, largest, smooth};
use super::{BlockJacobi, Preconditioner};
use crate::pooled::Pool;
use crate::solver::{LinearOperator, Linearization};
use crate::space::vector::xpby;
use filter::Filter;
use level::Level;
use nalgebra::{DVector, Dyn, LU};

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
        self.largest = largest(fine, &|r, z| self.filtered(r, z), self.blocks.len());
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

    /// The approximate solution of level `from` and all coarser levels, for the right-hand side b.
    fn coarse(&self, from: usize, b: &[f64]) -> Vec<f64> {
        let level = &self.levels[from];
        let mut x = vec![0.0; b.len()];
        if from + 1 == self.levels.len() {
            match self.bottom.as_ref().and_then(|lu| lu.solve(&DVector::from_column_slice(b))) {
                Some(solved) => x.copy_from_slice(solved.as_slice()),
                None => level.precondition(b, &mut x),
            }
            return x;
        }
        let jacobi = |r: &[f64], z: &mut [f64]| level.precondition(r, z);
        smooth(Chebyshev::smoother(level.largest), level, &jacobi, b, &mut x, true, &self.pool);
        self.correct(from + 1, level, b, &mut x);
        smooth(Chebyshev::smoother(level.largest), level, &jacobi, b, &mut x, false, &self.pool);
        x
    }

    /// Adds to x the correction of level `to` for the residual b − K x.
    fn correct(&self, to: usize, operator: &dyn LinearOperator, b: &[f64], x: &mut [f64]) {
        let Some(level) = self.levels.get(to) else { return };
        let mut r = self.pool.unspecified(b.len(), 0.0);
        operator.apply(x, &mut r);
        xpby(b, -1.0, &mut r);
        level.prolong(self.coarse(to, &level.restrict(&r)), x);
    }
}

/// A V-cycle whose finest level is the present tangent.
struct Cycle<'a, const D: usize> {
    levels: &'a Multigrid<D>,
    tangent: &'a dyn Linearization,
}

impl<const D: usize> LinearOperator for Cycle<'_, D> {
    fn apply(&self, r: &[f64], z: &mut [f64]) {
        let Self { levels, tangent } = *self;
        let jacobi = |r: &[f64], z: &mut [f64]| levels.filtered(r, z);
        z.fill(0.0);
        smooth(Chebyshev::smoother(levels.largest), tangent, &jacobi, r, z, true, &levels.pool);
        mutant!("multigrid: no coarse levels": { return smooth(Chebyshev::smoother(levels.largest), tangent, &jacobi, r, z, false, &levels.pool); });
        levels.correct(0, tangent, r, z);
        mutant!("multigrid: no smoothing after the coarse levels": { return; });
        smooth(Chebyshev::smoother(levels.largest), tangent, &jacobi, r, z, false, &levels.pool);
    }
}

impl<const D: usize> Preconditioner for Multigrid<D> {
    fn prepare<'a>(&'a mut self, tangent: &'a dyn Linearization) -> Box<dyn LinearOperator + 'a> {
        if self.levels.is_empty() {
            self.blocks.take(tangent);
            self.build(tangent.local_form(), tangent);
        }
        Box::new(Cycle { levels: self, tangent })
    }
}
