//! Shape functions away from walls. There the functions depend only on the position in the cell, so their code has no branch. The code runs
//! on one number or on the lanes of a vector.

use super::kernel::Kernel;
use super::{Bspline, Gimp, Lme, bspline};
use std::ops::{Add, Div, Mul, Sub};

/// The largest number of nodes on a side, beyond those of the cell, for which vector lanes have room.
pub(crate) const FURTHEST: usize = 4;

/// The number of nodes in a [`Column`].
pub(crate) const NODES: usize = 2 * FURTHEST + 2;

/// A number, or the lanes of a vector. Every operation rounds, so numbers and lanes agree bitwise.
pub(crate) trait Lane:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// The constant `x` in the type of `self`.
    fn constant(self, x: f64) -> Self;

    /// `then` where `self` < `other`, and `otherwise` elsewhere.
    fn where_less(self, other: Self, then: Self, otherwise: Self) -> Self;

    /// |x|
    fn abs(self) -> Self;
}

impl Lane for f64 {
    #[inline(always)]
    fn constant(self, x: f64) -> Self {
        x
    }

    #[inline(always)]
    fn where_less(self, other: Self, then: Self, otherwise: Self) -> Self {
        if self < other { then } else { otherwise }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }
}

/// N and dN/dx along an axis at one coordinate, for the nodes cell − M … cell + 1 + M; zero where a function does not reach.
pub(crate) struct Column<T> {
    /// N
    pub values: [T; NODES],
    /// dN/dx
    pub derivatives: [T; NODES],
    /// The last relative correction of Newton's method. If the correction exceeds [`SETTLED`], the iteration has not converged, and
    /// [`Separable::axis`](super::Separable::axis) must find the functions.
    pub correction: T,
}

/// Convergence tolerance of Newton's method: after a correction below this, the error is about the square of the correction.
pub(crate) const SETTLED: f64 = 1e-9;

/// A family of functions away from walls.
pub(crate) trait Interior {
    /// The tabulated starting value of Newton's method; 0 for functions without an iteration.
    #[inline(always)]
    fn start(&self, _below: f64) -> f64 {
        0.0
    }

    /// The functions at a point `below`·h from the lower node of the cell and `above`·h from the upper node.
    fn column<T: Lane, const M: usize>(&self, below: T, above: T, start: T, spacing: f64) -> Column<T>;
}

/// An operation on the functions of one family, which reach `M` nodes beyond those of the cell.
pub(crate) trait InteriorVisitor {
    fn visit<const M: usize>(self, interior: &impl Interior);
}

/// A shipped family, which vector lanes can evaluate.
#[derive(Clone, Copy, Debug)]
pub enum Shipped<'a> {
    /// See [`Linear`](super::Linear).
    Linear,
    /// See [`Gimp`].
    Gimp(&'a Gimp),
    /// See [`Bspline`].
    Bspline(Bspline),
    /// See [`Lme`].
    Lme(&'a Lme),
}

impl Shipped<'_> {
    /// The distance beyond which functions vanish, in units of the spacing; at most [`FURTHEST`] + 1. The functions of the cell's own nodes
    /// may reach further.
    pub(crate) fn radius(&self) -> f64 {
        match self {
            Self::Linear => 1.0,
            Self::Gimp(gimp) => gimp.radius(),
            Self::Bspline(Bspline::Quadratic) => bspline::Quadratic.radius(),
            Self::Bspline(Bspline::Cubic) => bspline::Cubic.radius(),
            Self::Lme(lme) => lme.radius(),
        }
    }

    /// The distance from a node of a cell to the edges of supports in the cell, in units of the spacing; 0 for functions that do not end
    /// inside a cell, or that are cut off where they are small.
    pub(crate) fn edge(&self) -> f64 {
        match self {
            Self::Gimp(_) | Self::Bspline(_) => self.radius().fract(),
            Self::Linear | Self::Lme(_) => 0.0,
        }
    }

    /// Calls `visitor` with the concrete type of the functions, so that a loop over particles has no branch on the family.
    pub(crate) fn with(&self, visitor: impl InteriorVisitor) {
        match self {
            Self::Linear => visitor.visit::<0>(&super::Linear),
            Self::Gimp(gimp) => visitor.visit::<1>(*gimp),
            Self::Bspline(Bspline::Quadratic) => visitor.visit::<1>(&bspline::Quadratic),
            Self::Bspline(Bspline::Cubic) => visitor.visit::<1>(&bspline::Cubic),
            Self::Lme(lme) if lme.radius() <= 2.0 => visitor.visit::<1>(*lme),
            Self::Lme(lme) if lme.radius() <= 3.0 => visitor.visit::<2>(*lme),
            Self::Lme(lme) if lme.radius() <= 4.0 => visitor.visit::<3>(*lme),
            Self::Lme(lme) => visitor.visit::<FURTHEST>(*lme),
        }
    }
}

/// The signed distance D of the `i`-th node of a column, in units of the spacing.
#[inline(always)]
pub(super) fn distance<T: Lane, const M: usize>(i: usize, below: T, above: T) -> T {
    if i <= M {
        below + below.constant((M - i) as f64)
    } else {
        above.constant(0.0) - (above + above.constant((i - M - 1) as f64))
    }
}

impl Interior for super::Linear {
    #[inline(always)]
    fn column<T: Lane, const M: usize>(&self, below: T, above: T, _: T, spacing: f64) -> Column<T> {
        let zero = below.constant(0.0);
        let (mut values, mut derivatives) = ([zero; NODES], [zero; NODES]);
        [values[M], values[M + 1]] = [above, below];
        [derivatives[M], derivatives[M + 1]] = [below.constant(-1.0 / spacing), below.constant(1.0 / spacing)];
        Column { values, derivatives, correction: zero }
    }
}

impl<K: Kernel> Interior for K {
    #[inline(always)]
    fn column<T: Lane, const M: usize>(&self, below: T, above: T, _: T, spacing: f64) -> Column<T> {
        let zero = below.constant(0.0);
        let (mut values, mut derivatives) = ([zero; NODES], [zero; NODES]);
        for i in 0..2 * M + 2 {
            let (value, slope) = self.at(distance::<T, M>(i, below, above));
            (values[i], derivatives[i]) = (value, slope / below.constant(spacing));
        }
        Column { values, derivatives, correction: zero }
    }
}
