//! Filling a solid with particles.

use super::Shape;
use crate::grid::{Grid, indices};
use crate::tensor::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The largest number of particle positions that [`fill`] looks at for one body.
pub const MAX_CANDIDATES: f64 = 134_217_728.0; // 2²⁷

/// Which of the regular positions become particles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fill {
    /// Those that lie in the shape.
    #[default]
    Particles,
    /// Those of all cells whose centre lies in the shape.
    Cells,
}

/// A shape that cannot be filled.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FillError {
    /// The box around the shape holds more positions than [`MAX_CANDIDATES`].
    #[error(
        "the box around the shape holds {candidates:e} particle positions; at most {MAX_CANDIDATES:e} are allowed: \
         use a coarser grid or fewer particles per cell"
    )]
    TooMany {
        /// Cells of the box times particles per cell.
        candidates: f64,
    },
    /// No position lies in the shape.
    #[error(
        "none of the {candidates} particle positions of the cells around the shape lies in it: \
         it is smaller than a cell, or outside the grid"
    )]
    Empty {
        /// Positions that were looked at.
        candidates: u64,
    },
}

/// Fills `shape` with particles at the regular sub-cell centres, (i + ½) h / `per_axis` from the lower corner of each cell.
///
/// Shapes are clipped to the grid. Only cells that overlap the shape's bounding box are visited; cell by cell and within a
/// cell, the first axis runs fastest. Every particle stands for the volume (h / `per_axis`)^D.
///
/// ```
/// use bfree::grid::Grid;
/// use bfree::shape::{Block, Fill, fill};
/// use bfree::tensor::Vector;
///
/// let grid = Grid { origin: Vector::from([0.0, 0.0]), spacing: 0.5, cells: [4, 4] };
/// let square = Block { min: Vector::from([0.5, 0.5]), max: Vector::from([1.5, 1.5]) }.into();
/// let particles = fill(&grid, &square, 2, Fill::Particles)?;
/// assert_eq!((particles.len(), particles[0]), (16, Vector::from([0.625, 0.625])));
/// # Ok::<(), bfree::shape::FillError>(())
/// ```
///
/// # Errors
/// More than [`MAX_CANDIDATES`] positions to look at (found before anything is allocated), or no particle.
pub fn fill<const D: usize>(
    grid: &Grid<D>,
    shape: &Shape<D>,
    per_axis: u32,
    rule: Fill,
) -> Result<Vec<Vector<f64, D>>, FillError> {
    let h = grid.spacing;
    let (min, max) = shape.bounding_box();
    let (mut first, mut count) = ([0_u64; D], [0_u64; D]);
    for k in 0..D {
        // One cell of margin, so that rounding at a cell face loses nothing; `as` saturates at 0 and at infinity.
        let lower = ((min[k] - grid.origin[k]) / h).floor() - 1.0;
        let upper = ((max[k] - grid.origin[k]) / h).ceil() + 1.0;
        first[k] = lower.max(0.0) as u64;
        count[k] = (upper.min(f64::from(grid.cells[k])) as u64).saturating_sub(first[k]);
    }
    let candidates = count.iter().map(|&n| n as f64 * f64::from(per_axis)).product::<f64>();
    if candidates > MAX_CANDIDATES {
        return Err(FillError::TooMany { candidates });
    }

    let offset = |i: u64| (i as f64 + 0.5) / f64::from(per_axis);
    let mut particles = Vec::new();
    for cell in indices(count) {
        let corner: [f64; D] = std::array::from_fn(|k| (first[k] + cell[k]) as f64);
        let position = |within: Vector<f64, D>| Vector::from_fn(|k, _| grid.origin[k] + (corner[k] + within[k]) * h);
        if rule == Fill::Cells && !shape.holds(&position(Vector::repeat(0.5)), h) {
            continue;
        }
        for i in indices([u64::from(per_axis); D]) {
            let x = position(Vector::from_fn(|k, _| offset(i[k])));
            if rule == Fill::Cells || shape.holds(&x, h) {
                particles.push(x);
            }
        }
    }
    if particles.is_empty() { Err(FillError::Empty { candidates: candidates as u64 }) } else { Ok(particles) }
}
