//! The V-cycle, wherever its vectors lie.

use crate::solver::LinearOperator;
use crate::solver::preconditioner::chebyshev::{Chebyshev, smooth};
use crate::space::vector::Vectors;

/// A coarse level, whose `apply` is Eᵀ K E.
pub(super) trait Coarse<S: Vectors>: LinearOperator<S::Vector> {
    /// z = D⁻¹ r
    fn precondition(&self, r: &S::Vector, z: &mut S::Vector);

    /// Eᵀ Pᵀ r
    fn restrict(&self, r: &S::Vector) -> S::Owned;

    /// x += P E y
    fn prolong(&self, y: S::Owned, x: &mut S::Vector);

    /// λ, the largest eigenvalue of D⁻¹K.
    fn largest(&self) -> f64;
}

/// A V-cycle whose finest level is the present tangent.
pub(super) struct Cycle<'a, S: Vectors> {
    pub vectors: &'a S,
    pub tangent: &'a dyn LinearOperator<S::Vector>,
    /// M of the finest smoother.
    pub smoother: Box<dyn LinearOperator<S::Vector> + 'a>,
    /// The largest eigenvalue of M K.
    pub largest: f64,
    pub levels: Vec<&'a dyn Coarse<S>>,
    /// The solve of the last level.
    pub bottom: Box<dyn LinearOperator<S::Vector> + 'a>,
}

impl<S: Vectors> Cycle<'_, S> {
    /// The approximate solution of level `from` and all coarser levels, for the right-hand side b.
    fn coarse(&self, from: usize, b: &S::Vector) -> S::Owned {
        let (level, mut x) = (self.levels[from], self.vectors.zeros(self.vectors.len(b)));
        if from + 1 == self.levels.len() {
            self.bottom.apply(b, &mut x);
            return x;
        }
        let jacobi = |r: &S::Vector, z: &mut S::Vector| level.precondition(r, z);
        smooth(Chebyshev::smoother(level.largest()), self.vectors, level, &jacobi, b, &mut x, true);
        self.correct(from + 1, level, b, &mut x);
        smooth(Chebyshev::smoother(level.largest()), self.vectors, level, &jacobi, b, &mut x, false);
        x
    }

    /// Adds to x the correction of level `to` for the residual b − K x.
    fn correct(&self, to: usize, operator: &dyn LinearOperator<S::Vector>, b: &S::Vector, x: &mut S::Vector) {
        let Some(level) = self.levels.get(to) else { return };
        let mut r = self.vectors.unspecified(self.vectors.len(b));
        operator.apply(x, &mut r);
        self.vectors.xpby(b, -1.0, &mut r);
        level.prolong(self.coarse(to, &level.restrict(&r)), x);
    }

    /// One smoothing of the finest level.
    fn smooth_finest(&self, r: &S::Vector, z: &mut S::Vector, zero: bool) {
        smooth(Chebyshev::smoother(self.largest), self.vectors, self.tangent, &*self.smoother, r, z, zero);
    }
}

impl<S: Vectors> LinearOperator<S::Vector> for Cycle<'_, S> {
    fn apply(&self, r: &S::Vector, z: &mut S::Vector) {
        self.vectors.clear(z);
        self.smooth_finest(r, z, true);
        mutant!("multigrid: no coarse levels": { return self.smooth_finest(r, z, false); });
        self.correct(0, self.tangent, r, z);
        mutant!("multigrid: no smoothing after the coarse levels": { return; });
        self.smooth_finest(r, z, false);
    }
}
