//! Shape functions away from walls. There the functions depend only on the position in the cell, so their code has no branch. The code runs
//! on one number or on the lanes of a vector.

use super::lane::Lane;

/// The largest number of nodes on a side, beyond those of the cell, for which vector lanes have room.
pub(crate) const FURTHEST: usize = 4;

/// The number of nodes in a [`Column`].
pub(crate) const NODES: usize = 2 * FURTHEST + 2;

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

/// The signed distance D of the `i`-th node of a column, in units of the spacing.
#[inline(always)]
pub(super) fn distance<T: Lane, const M: usize>(i: usize, below: T, above: T) -> T {
    if i <= M {
        below + below.constant((M - i) as f64)
    } else {
        above.constant(0.0) - (above + above.constant((i - M - 1) as f64))
    }
}
