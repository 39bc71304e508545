//! The box and its background grid.

use crate::grid::Grid;
use crate::mechanics::reference::GridReset;
use crate::problems::{Number, Problems, sensible};
use crate::tensor::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Maximum number of cells along one axis.
const MAX_CELLS: f64 = 1e6;

/// Relative tolerance of the number of cells along an axis, which must be a whole number.
const WHOLE_CELLS_TOLERANCE: f64 = 1e-9;

/// Largest round-off of node positions, relative to the spacing.
const NODE_ROUND_OFF: f64 = 1e-6;

/// The box that holds the whole simulation, and the spacing of its background nodes. Nothing exists outside the box.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridBox {
    /// The lower corner of the box (length), at most 4e9 spacings from zero. Farther away, numbers are too coarse to distinguish nodes.
    /// Default: zeros.
    pub origin: Option<Vec<f64>>,
    /// The edges of the box (length), each > 0. The number of edges is the dimension of the scene: one (uniaxial strain), two (plane
    /// strain) or three.
    #[schemars(length(min = 1, max = 3))]
    pub size: Vec<f64>,
    /// The distance of neighbouring nodes, the same along all axes (length), > 0. It must divide every edge of the box, to
    /// 1e-9 relative, into at most a million cells.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub spacing: f64,
    /// When the background grid is reset. Between resets, the result does not depend on the number of steps, stresses are smooth, and
    /// bodies stay on the walls that they touch. Default: `{"strain": 1}` in load steps. With inertia and the transfer `"flip"`,
    /// `{"strain": 0.3}` with `obstacles` or `contact`, and `{"strain": 0.1}` for a single body that a fixed face of the box holds from the
    /// start. Otherwise `"every_step"`.
    pub reset: Option<GridReset>,
    /// Deprecated, and read for one release: the key is now `reset`. If `reset` is given, this key has no effect.
    pub renewed: Option<GridReset>,
}

impl GridBox {
    /// The number of dimensions, 1 to 3 in a valid scene.
    pub(super) fn dimension(&self) -> usize {
        self.size.len()
    }

    /// The lower corner, zeros if not given.
    pub(super) fn origin(&self) -> Vec<f64> {
        self.origin.clone().unwrap_or_else(|| vec![0.0; self.size.len()])
    }

    /// When the grid is reset, if that is given.
    pub(super) fn given_reset(&self) -> Option<GridReset> {
        self.reset.or(self.renewed)
    }

    /// The grid; `None` unless the section is valid and of dimension `D`.
    pub fn build<const D: usize>(&self) -> Option<Grid<D>> {
        let cells = self.cells()?.try_into().ok()?;
        let origin: [f64; D] = self.origin().try_into().ok()?;
        Some(Grid { origin: Vector::from(origin), spacing: self.spacing, cells })
    }

    /// Whether a point lies in the box or on its faces; false if the section is not valid.
    pub(super) fn holds(&self, x: &[f64]) -> bool {
        let edges = self.origin().into_iter().zip(&self.size);
        self.cells().is_some() && x.iter().zip(edges).all(|(x, (lower, size))| *x >= lower && *x <= lower + size)
    }

    /// The cells along each axis; `None` unless the section is valid.
    pub fn cells(&self) -> Option<Vec<u32>> {
        let origin = self.origin();
        let sound =
            origin.len() == self.size.len() && origin.iter().all(|&x| sensible(x) && x.abs() <= self.farthest());
        sound.then(|| self.size.iter().map(|&size| self.cells_along(size)).collect())?
    }

    /// Largest distance from zero at which nodes can be distinguished: numbers near x are |x| ε apart.
    fn farthest(&self) -> f64 {
        NODE_ROUND_OFF * self.spacing / f64::EPSILON
    }

    /// The number of cells along an edge, if the spacing divides the edge.
    fn cells_along(&self, size: f64) -> Option<u32> {
        let cells = size / self.spacing;
        let whole = cells.round();
        (self.spacing > 0.0
            && (1.0..=MAX_CELLS).contains(&whole)
            && (cells - whole).abs() <= WHOLE_CELLS_TOLERANCE * whole)
            .then_some(whole as u32)
    }

    pub(super) fn check(&self, problems: &mut Problems) {
        for (key, given) in [("reset", self.reset), ("renewed", self.renewed)] {
            if let Some(GridReset::Strain(most)) = given {
                problems.positive(&format!("grid.{key}.strain"), most);
            }
        }
        if !(1..=3).contains(&self.size.len()) {
            let found = format!("a vector of length {}", self.size.len());
            problems.refuse("grid.size", found, "must have 1, 2 or 3 components: the dimension of the scene");
            return;
        }
        if let Some(origin) = &self.origin {
            problems.vector("grid.origin", origin, self.dimension());
        }
        let spacing_ok = problems.positive("grid.spacing", self.spacing);
        for (k, &size) in self.size.iter().enumerate() {
            let path = format!("grid.size[{k}]");
            if !problems.positive(&path, size) || !spacing_ok || self.cells_along(size).is_some() {
                continue;
            }
            let (cells, spacing) = (size / self.spacing, Number(self.spacing));
            let allowed = if cells > MAX_CELLS {
                format!("at a spacing of {spacing} it would take {cells:e} cells; at most {MAX_CELLS:e} are allowed")
            } else {
                let whole = Number(cells.round().max(1.0) * self.spacing);
                format!("must be a multiple of the spacing {spacing}, such as {whole}")
            };
            problems.refuse(&path, Number(size), allowed);
        }
        let (farthest, spacing) = (self.farthest(), Number(self.spacing));
        let allowed =
            format!("numbers of that size are too coarse to tell nodes {spacing} apart; at most {farthest:e} in size");
        for (k, &x) in self.origin.iter().flatten().enumerate().filter(|_| spacing_ok) {
            let far = sensible(x) && x.abs() > farthest;
            problems.require(!far, &format!("grid.origin[{k}]"), Number(x), &allowed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_fills_the_box_with_a_whole_number_of_cells() -> Result<(), Box<dyn std::error::Error>> {
        let section: GridBox = serde_json::from_str(r#"{"size": [2, 1], "spacing": 0.25}"#)?;
        assert_eq!((section.dimension(), section.origin(), section.cells()), (2, vec![0.0, 0.0], Some(vec![8, 4])));
        assert!(section.holds(&[2.0, 0.5]) && !section.holds(&[2.1, 0.5]));
        let grid = section.build::<2>().ok_or("a plane grid")?;
        assert_eq!(grid.position([8, 4]).as_slice(), section.size);
        let section: GridBox = serde_json::from_str(r#"{"size": [2, 1], "spacing": 0.8}"#)?;
        assert_eq!((section.cells(), section.build::<2>()), (None, None));
        Ok(())
    }
}
