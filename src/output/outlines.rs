//! The surfaces of obstacles as segments and triangles, for pictures: `obstacles_*.vtu`.

use super::fields::padded;
use super::vtu::{Array, Snapshot};
use super::vtu_writer::Head;
use crate::grid::Grid;
use crate::mechanics::loads::{Contacts, Obstacle};
use crate::tensor::Vector;

/// The largest number of cells along the longest edge of an obstacle, in 1D, 2D and 3D. No cell is smaller than a cell of the grid.
const CELLS: [f64; 3] = [64.0, 64.0, 24.0];

/// The surfaces of all obstacles, in their frames: the corners of simplices, D for each.
#[derive(Debug)]
pub(crate) struct Outlines<const D: usize>(Vec<Vec<Vector<f64, D>>>);

impl<const D: usize> Outlines<D> {
    /// The outlines of all obstacles. Unbounded obstacles end at the grid.
    pub(crate) fn of(contacts: &Contacts<D>, grid: &Grid<D>) -> Self {
        Self(contacts.obstacles.iter().map(|obstacle| outline(obstacle, grid)).collect())
    }

    /// The outlines in the poses of a time, with the number of the obstacle of each corner.
    pub(crate) fn at(&self, contacts: &Contacts<D>, time: f64, head: &Head) -> Snapshot {
        let (mut points, mut numbers) = (Vec::new(), Vec::new());
        for (number, (obstacle, corners)) in contacts.obstacles.iter().zip(&self.0).enumerate() {
            let pose = obstacle.pose(time);
            points.extend(corners.iter().map(|corner| padded(&pose.to_space(corner))));
            numbers.resize(points.len(), number as f64);
        }
        let arrays = vec![Array::scalar("obstacle", numbers, true)];
        Snapshot { time: head.time, background: head.background, points, arrays, corners: D }
    }
}

/// The corners of the simplices on the surface of an obstacle.
fn outline<const D: usize>(obstacle: &Obstacle<D>, grid: &Grid<D>) -> Vec<Vector<f64, D>> {
    let (min, max) = obstacle.shape.bounds_near(grid);
    let edge = grid.spacing.max((max - min).max() / CELLS[D.clamp(1, 3) - 1]);
    obstacle.shape.surface_simplices(grid, edge)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::loads::ContactConstants;
    use crate::shape::{Ball, Block, HalfSpace, Mask, Pixels, Shape};
    use std::f64::consts::PI;

    fn corners<const D: usize>(shape: Shape<D>) -> Vec<Vector<f64, D>> {
        let grid = Grid { origin: Vector::zeros(), spacing: 0.1, cells: [10; D] };
        outline(&Obstacle::new("one", shape, std::array::from_fn(|_| None), ContactConstants::default()), &grid)
    }

    fn length(corners: &[Vector<f64, 2>]) -> f64 {
        corners.chunks(2).map(|ends| (ends[1] - ends[0]).norm()).sum()
    }

    #[test]
    fn outlines_lie_on_the_surface_and_are_as_long() {
        let (center, radius) = (Vector::from([0.5, 0.4]), 2.0);
        let circle = corners(Ball { center, radius }.into());
        assert!(circle.iter().all(|x| ((x - center).norm() / radius - 1.0).abs() < 1e-3));
        assert!((length(&circle) / (2.0 * PI * radius) - 1.0).abs() < 1e-3, "{}", length(&circle));
        let box_ = corners(Block { min: Vector::from([0.1, 0.2]), max: Vector::from([0.4, 0.6]) }.into());
        assert!((length(&box_) - 1.4).abs() < 1e-12, "{}", length(&box_));
        // A floor is at least as long as the grid, and not much longer.
        let floor = corners(HalfSpace { point: Vector::from([0.0, 0.3]), normal: Vector::from([0.0, 1.0]) }.into());
        assert!((1.0..=1.5).contains(&length(&floor)), "{}", length(&floor));
        assert_eq!(
            corners::<1>(HalfSpace { point: Vector::from([0.3]), normal: Vector::from([1.0]) }.into()),
            [Vector::from([0.3])]
        );
    }

    #[test]
    fn triangles_have_the_area_of_the_surface() -> Result<(), &'static str> {
        let area = |corners: &[Vector<f64, 3>]| -> f64 {
            corners.chunks(3).map(|x| 0.5 * (x[1] - x[0]).cross(&(x[2] - x[0])).norm()).sum()
        };
        let ball = corners(Ball { center: Vector::repeat(0.5), radius: 0.5 }.into());
        assert!((area(&ball) / PI - 1.0).abs() < 1e-2, "{}", area(&ball));
        let voxel = Mask::new([1, 1, 1], std::iter::once(true)).ok_or("no mask")?;
        let cube = Pixels::new(Vector::repeat(0.2), Vector::repeat(0.7), voxel).ok_or("no cube")?;
        let cube = corners(cube.into());
        assert!((area(&cube) / 1.5 - 1.0).abs() < 1e-9, "{}", area(&cube));
        Ok(())
    }
}
