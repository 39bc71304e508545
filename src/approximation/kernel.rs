//! Kernels centred on the nodes. Ghost nodes beyond a wall are folded back to nodes of the grid.

use super::error::ApproximationError;
use super::interior::{Column, InCells, InLanes, Interior, NODES, Rows, distance, evaluate};
use super::product::{AxisWeights, Place};
use crate::grid::Axis;
use crate::lanes::Lane;

/// A kernel D ↦ (φ, φ'), with lengths in units of the spacing.
pub(super) trait Kernel: Sync {
    /// The distance beyond which φ = 0; at most 2.
    fn radius(&self) -> f64;

    /// See [`InLanes::edge`].
    fn edge(&self) -> f64 {
        self.radius().fract()
    }

    /// φ and φ'.
    fn at<T: Lane>(&self, distance: T) -> (T, T);
}

/// φ and φ' from those of two pieces: `near` for |D| < `knot`, `far` beyond.
#[inline(always)]
pub(super) fn piecewise<T: Lane>(distance: T, knot: f64, near: (T, T), far: (T, T)) -> (T, T) {
    let knot = distance.constant(knot);
    (distance.where_less(knot, near.0, far.0), distance.where_less(knot, near.1, far.1))
}

/// N_k = φ((x − x_k)/h).
///
/// A ghost node beyond a wall continues the field linearly, u₋ₖ = 2u₀ − uₖ: N₀ += 2N₋ₖ, Nₖ −= N₋ₖ. This continuation keeps partition of
/// unity and linear consistency, and makes N₀ = 1 at the wall. The mirror node of a ghost always exists: a point of the grid reaches at
/// most one ghost, even on an axis of one cell.
#[inline(always)]
pub(super) fn folded(
    kernel: &impl Kernel,
    axis: &Axis,
    x: f64,
    out: &mut AxisWeights,
) -> Result<(), ApproximationError> {
    let radius = kernel.radius();
    let place = Place::new(axis, x)?.at_edge(radius.fract(), axis.round_off(x));
    // Nodes cell − lower … cell + upper have |D| < radius, ghosts included.
    let lower = (radius - place.below).ceil() as i64 - 1;
    let upper = (radius - place.above).ceil() as i64;
    let (cell, last) = (i64::from(place.cell), i64::from(axis.cells));
    let (first, end) = ((cell - lower).max(0), (cell + upper).min(last));
    out.start(first as u32);
    (first..=end).for_each(|_| out.push(0.0, 0.0));
    let mut add = |node: i64, factor: f64, (value, slope): (f64, f64)| {
        let slot = (node - first) as usize;
        out.values[slot] += factor * value;
        out.derivatives[slot] += factor * slope / axis.spacing;
    };
    for node in cell - lower..=cell + upper {
        let at = kernel.at(place.distance(node));
        let wall = node.clamp(0, last);
        if node == wall {
            add(node, 1.0, at);
        } else {
            add(wall, 2.0, at);
            mutant!("shapes: ghosts beyond a wall are folded back once": { if wall == 0 { add(0, -1.0, at); } });
            add(2 * wall - node, -1.0, at);
        }
    }
    Ok(())
}

impl<K: Kernel> InLanes for K {
    fn radius(&self) -> f64 {
        Kernel::radius(self)
    }

    fn edge(&self) -> f64 {
        Kernel::edge(self)
    }

    fn evaluate(&self, points: &InCells, out: Rows<'_>) -> usize {
        evaluate::<1>(self, Kernel::radius(self), points, out)
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
