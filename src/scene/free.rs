//! Obstacles that move freely.

use super::BuildError;
use super::vector::vector;
use crate::grid::{Grid, indices};
use crate::mechanics::loads::RigidBody;
use crate::problems::Problems;
use crate::shape::{Fill, Filling, GridBox, Layout, Seed, Shape, fill};
use crate::tensor::{Tensor, Vector, identity, outer};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An obstacle with mass that contact and gravity move. Its volume, centre of mass and inertia follow from its shape. Free obstacles push
/// bodies only: a free obstacle that meets another obstacle ends the run with an error. Position, velocity and spin are in `obstacles.csv`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "FreeObstacle")]
pub struct Free {
    /// The mass per volume, > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// The initial velocity of the centre of mass. Default: at rest.
    pub velocity: Option<Vec<f64>>,
    /// The initial angular velocity (radians / time): one number in 2D, counterclockwise, and three in 3D. Default: none.
    pub spin: Option<Vec<f64>>,
}

/// Cells along the longest edge of the obstacle, in 1D, 2D and 3D. Their quadrature points give volume, centre of mass and inertia.
const CELLS: [f64; 3] = [32.0, 32.0, 8.0];

/// The quadrature of volumes and second moments.
const FILLING: Filling = Filling { per_axis: 2, layout: Layout::Gauss, rule: Fill::Cut, degree: 3 };

impl Free {
    pub(super) fn check(&self, problems: &mut Problems, path: &str, dimension: usize) {
        problems.positive(&format!("{path}.density"), self.density);
        if let Some(velocity) = &self.velocity {
            problems.vector(&format!("{path}.velocity"), velocity, dimension);
        }
        if let Some(spin) = &self.spin {
            let (path, numbers) = (format!("{path}.spin"), [0, 1, 3][dimension.clamp(1, 3) - 1]);
            let allowed = "must have one component in 2D, three in 3D and none in 1D";
            problems.require(spin.len() == numbers, &path, format_args!("{spin:?}"), allowed);
            spin.iter().for_each(|&x| _ = problems.number(&path, x));
        }
    }

    /// The rigid body of this shape, with its acceleration under gravity alone.
    ///
    /// # Errors
    /// The shape is empty.
    pub(super) fn build<const D: usize>(
        &self,
        path: &str,
        shape: &Shape<D>,
        gravity: &Vector<f64, D>,
    ) -> Result<RigidBody<D>, BuildError> {
        let grid = grid_around(shape);
        let empty = |_| BuildError::at(format!("{path}.shape"), "the shape is empty: its parts do not meet");
        let points = fill(&grid, shape, FILLING).map_err(empty)?;
        let volume: f64 = points.iter().map(|point| point.volume).sum();
        let center = points.iter().map(|point| point.position * (point.volume / volume)).sum();
        let inertia = points.iter().map(|point| inertia(point, &center)).sum::<Tensor<f64, 3>>() * self.density;
        let velocity = self.velocity.as_ref().map_or_else(Vector::zeros, |v| vector(v));
        let spin = match self.spin.as_deref() {
            Some(&[x, y, z]) => Vector::from([x, y, z]),
            Some(&[spin]) => Vector::from([0.0, 0.0, spin]),
            _ => Vector::zeros(),
        };
        let mut body = RigidBody::new(self.density * volume, inertia, center, velocity, spin);
        body.fall_freely(gravity);
        Ok(body)
    }
}

/// J of a point about the centre: (|r|² I − r ⊗ r) V. In 1D and 2D, the extent of the obstacle along the missing axes does not count.
fn inertia<const D: usize>(point: &Seed<D>, center: &Vector<f64, D>) -> Tensor<f64, 3> {
    let arm = point.position - center;
    let arm = Vector::<f64, 3>::from_fn(|i, _| if i < D { arm[i] } else { 0.0 });
    (identity::<f64, 3>() * arm.norm_squared() - outer(&arm, &arm)) * point.volume
}

/// A grid around a bounded shape.
fn grid_around<const D: usize>(shape: &Shape<D>) -> Grid<D> {
    let (min, max) = shape.bounding_box();
    let spacing = (max - min).max() / CELLS[D.clamp(1, 3) - 1];
    let cells = std::array::from_fn(|k| ((max[k] - min[k]) / spacing).ceil() as u32 + 2);
    Grid { origin: min.add_scalar(-spacing), spacing, cells }
}

/// Points on the surface of a shape; none for an unbounded shape.
pub(super) fn surface<const D: usize>(shape: &Shape<D>) -> Vec<Vector<f64, D>> {
    let (min, max) = shape.bounding_box();
    if !min.iter().chain(&max).all(|x| x.is_finite()) {
        return Vec::new();
    }
    let grid = &grid_around(shape);
    let cells = indices(grid.cells.map(u64::from)).map(|cell| cell.map(|i| i as u32));
    let near = |cell: &[u32; D]| {
        let middle = grid.position(*cell).add_scalar(0.5 * grid.spacing);
        shape.signed_distance(&middle).abs() <= grid.spacing * (D as f64).sqrt()
    };
    let facets = cells.filter(near).flat_map(|cell| shape.facets(None, &GridBox::cell(grid, cell)));
    facets.map(|facet| facet.position).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{Ball, Block};
    use std::f64::consts::PI;

    fn built<const D: usize>(shape: Shape<D>) -> RigidBody<D> {
        let free = Free { density: 2.0, velocity: None, spin: None };
        free.build("here", &shape, &Vector::zeros()).unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn mass_and_inertia_are_those_of_textbooks() {
        let disc = built(Ball { center: Vector::from([1.0, 2.0]), radius: 0.5 }.into());
        let mass = 2.0 * PI * 0.25;
        assert!((disc.mass / mass - 1.0).abs() < 1e-5, "{}", disc.mass);
        assert!((disc.inertia[(2, 2)] / (0.5 * mass * 0.25) - 1.0).abs() < 1e-5, "{}", disc.inertia);
        assert!((disc.center - Vector::from([1.0, 2.0])).norm() < 1e-12);
        let ball = built(Ball { center: Vector::from([1.0, 2.0, 3.0]), radius: 0.5 }.into());
        let mass = 2.0 * PI / 6.0;
        assert!((ball.mass / mass - 1.0).abs() < 1e-5, "{}", ball.mass);
        assert!((ball.inertia - identity::<f64, 3>() * (0.4 * mass * 0.25)).norm() < 1e-5, "{}", ball.inertia);
        let brick = built(Block { min: Vector::zeros(), max: Vector::from([1.0, 2.0, 3.0]) }.into());
        let exact = Tensor::from_diagonal(&Vector::from([13.0, 10.0, 5.0]));
        assert!((brick.inertia - exact).norm() < 1e-10 && (brick.mass - 12.0).abs() < 1e-10, "{}", brick.inertia);
    }
}
