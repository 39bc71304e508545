//! Shape functions away from walls. There the functions depend only on the position in the cell, so their code has no branch. The code runs
//! on one number or on the lanes of a vector.

use crate::lanes::{LANES, Lane, Lanes, WithLanes, widest};

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

/// The signed distance D of the `i`-th node of a column, in units of the spacing.
#[inline(always)]
pub(super) fn distance<T: Lane, const M: usize>(i: usize, below: T, above: T) -> T {
    if i <= M {
        below + below.constant((M - i) as f64)
    } else {
        above.constant(0.0) - (above + above.constant((i - M - 1) as f64))
    }
}

/// The functions of a family away from walls, at up to eight points of one axis, a lane each.
pub trait InLanes: Sync {
    /// The distance beyond which functions vanish, in spacings. The functions of the cell's own nodes may reach further.
    fn radius(&self) -> f64;

    /// The distance from a node of a cell to the edges of supports in the cell, in spacings; 0 for functions that do not end inside a cell,
    /// or that are cut off where they are small.
    fn edge(&self) -> f64 {
        0.0
    }

    /// Evaluates N and dN/dx of the nodes cell − M … cell + 1 + M, and returns M.
    fn evaluate(&self, points: &InCells, out: Rows<'_>) -> usize;
}

/// The positions of eight points in their cells, in spacings.
pub struct InCells {
    /// Distance from the lower node.
    pub below: [f64; LANES],
    /// Distance from the upper node.
    pub above: [f64; LANES],
    pub spacing: f64,
}

/// The functions at eight points: a row a node, a lane a point.
pub struct Rows<'a> {
    /// N
    pub values: &'a mut [[f64; LANES]],
    /// dN/dx
    pub derivatives: &'a mut [[f64; LANES]],
    /// The smallest |N| of each point.
    pub smallest: &'a mut [f64; LANES],
    /// See [`Column::correction`].
    pub corrections: &'a mut [f64; LANES],
}

/// [`InLanes::evaluate`] of functions that vanish beyond `radius`.
pub(super) fn evaluate<const M: usize>(
    interior: &impl Interior,
    radius: f64,
    points: &InCells,
    out: Rows<'_>,
) -> usize {
    let starts = points.below.map(|below| interior.start(below));
    widest(Evaluate::<_, M> { interior, radius, points, starts, out });
    M
}

struct Evaluate<'a, 'b, I, const M: usize> {
    interior: &'a I,
    radius: f64,
    points: &'a InCells,
    starts: [f64; LANES],
    out: Rows<'b>,
}

impl<I: Interior, const M: usize> WithLanes for Evaluate<'_, '_, I, M> {
    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        let Self { interior, radius, points, starts, out } = self;
        let (below, above) = (s.load(&points.below), s.load(&points.above));
        let column = interior.column::<_, M>(below, above, s.load(&starts), points.spacing);
        let mut smallest = below.constant(f64::INFINITY);
        for i in 0..2 * M + 2 {
            let (n, dn) = (column.values[i], column.derivatives[i]);
            s.store(n, &mut out.values[i]);
            s.store(dn, &mut out.derivatives[i]);
            let (distance, j) = if i <= M { (below, M - i) } else { (above, i - M - 1) };
            let room = below.constant(radius) - distance;
            let size = if j == 0 { n.abs() } else { room.constant(j as f64).where_less(room, n.abs(), smallest) };
            smallest = size.where_less(smallest, size, smallest);
        }
        s.store(smallest, out.smallest);
        s.store(column.correction, out.corrections);
    }
}
