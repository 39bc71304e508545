//! Boxes on a grid, by which solids are cut.

use super::EDGE;
use crate::grid::{Grid, indices};
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
    pub(crate) fn cell(grid: &Grid<D>, index: [u32; D]) -> Self {
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

    /// The box halved across all of its longest edges, so that an image of a solid is divided into images.
    pub(super) fn halves(&self) -> impl Iterator<Item = Self> {
        let longest = self.edges.amax() * (1.0 - EDGE);
        let halved = self.edges.map(|edge| edge.abs() >= longest);
        let edges = Vector::from_fn(|k, _| if halved[k] { 0.5 * self.edges[k] } else { self.edges[k] });
        let of = *self;
        let count: [u64; D] = std::array::from_fn(|k| 1 + u64::from(halved[k]));
        indices(count).map(move |i| {
            let lower = of.lower + Vector::from_fn(|k, _| i[k] as f64 * edges[k]);
            Self { lower, edges, ..of }
        })
    }
}
