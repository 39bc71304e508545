//! Boxes on a grid, by which solids are cut.

use super::EDGE;
use crate::grid::Grid;
use crate::tensor::Vector;

/// An axis-parallel box on a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridBox<const D: usize> {
    /// The lower corner.
    pub lower: Vector<f64, D>,
    /// The edges.
    pub edges: Vector<f64, D>,
    /// The spacing of the grid. Tolerances are relative to it.
    pub spacing: f64,
}

impl<const D: usize> GridBox<D> {
    /// A cell of a grid.
    pub fn cell(grid: &Grid<D>, index: [u32; D]) -> Self {
        Self { lower: grid.position(index), edges: Vector::repeat(grid.spacing), spacing: grid.spacing }
    }

    /// The centre, and the distance of the corners from the centre. A small margin includes faces that the box only touches.
    pub(super) fn around(&self) -> (Vector<f64, D>, f64) {
        (self.lower + self.edges * 0.5, (0.5 + EDGE) * self.edges.norm())
    }

    /// Round-off of a position.
    pub(super) fn round_off(&self) -> f64 {
        EDGE * self.spacing
    }

    /// The two halves of the box across its longest edge.
    pub(super) fn halves(&self) -> [Self; 2] {
        let k = self.edges.iamax();
        let mut lower = *self;
        lower.edges[k] *= 0.5;
        let mut upper = lower;
        upper.lower[k] += lower.edges[k];
        [lower, upper]
    }
}
