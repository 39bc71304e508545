//! Linear functions (Q4 in the plane).

use super::interior::{Column, InCells, InLanes, Interior, NODES, Rows, evaluate};
use super::product::Place;
use super::{ApproximationError, AxisWeights, Separable, Validate};
use crate::aggregation::Pieces;
use crate::grid::Axis;
use crate::lanes::Lane;

/// Products of hat functions. On a cell face the gradient is that of the upper cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Linear;

impl Validate for Linear {}

impl Separable for Linear {
    #[inline]
    fn axis(&self, axis: &Axis, x: f64, out: &mut AxisWeights) -> Result<(), ApproximationError> {
        out.hats(&Place::new(axis, x)?, axis.spacing);
        Ok(())
    }

    fn in_lanes(&self) -> Option<&dyn InLanes> {
        Some(self)
    }

    fn pieces(&self) -> Pieces {
        Pieces { share: 0.25, ..Pieces::LINEAR }
    }

    fn width(&self) -> usize {
        2
    }
}

impl InLanes for Linear {
    fn radius(&self) -> f64 {
        1.0
    }

    fn evaluate(&self, points: &InCells, out: Rows<'_>) -> usize {
        evaluate::<0>(self, 1.0, points, out)
    }
}

impl Interior for Linear {
    #[inline(always)]
    fn column<T: Lane, const M: usize>(&self, below: T, above: T, _: T, spacing: f64) -> Column<T> {
        let zero = below.constant(0.0);
        let (mut values, mut derivatives) = ([zero; NODES], [zero; NODES]);
        [values[M], values[M + 1]] = [above, below];
        [derivatives[M], derivatives[M + 1]] = [below.constant(-1.0 / spacing), below.constant(1.0 / spacing)];
        Column { values, derivatives, correction: zero }
    }
}
