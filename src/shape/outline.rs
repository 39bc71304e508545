//! Surfaces for pictures: simplices on the surface of a solid, and closed lines around a solid in the plane.

use super::{Block, GridBox, Shape};
use crate::grid::{Grid, indices};
use crate::tensor::Vector;

/// The largest distance between a surface and its simplices, relative to the edge of a box, in 1D, 2D and 3D.
const FLAT: [f64; 3] = [1e-3, 1e-3, 1e-2];

/// The largest gap between two segments of a closed line, relative to the edge of a box. On curved surfaces the segments of neighbouring
/// boxes lie in different planes.
const GAP: f64 = 0.02;

/// The smallest length of a segment, relative to the edge of a box. Shorter segments are round-off.
const SHORT: f64 = 1e-9;

impl<const D: usize> Shape<D> {
    /// The corners of simplices on the surface, D for each. The boxes that cut the surface have this edge. Unbounded solids end at the grid.
    pub(crate) fn surface_simplices(&self, grid: &Grid<D>, edge: f64) -> Vec<Vector<f64, D>> {
        let (min, max) = self.bounds_near(grid);
        let count: [u64; D] = std::array::from_fn(|k| ((max[k] - min[k]) / edge).ceil().max(0.0) as u64 + 2);
        let mut corners = Vec::new();
        for cell in indices(count) {
            // The boxes begin off the faces of the shape: a face between two boxes would be drawn twice, or not at all.
            let lower = Vector::<f64, D>::from_fn(|k, _| min[k] + edge * (cell[k] as f64 - 0.9));
            let of = GridBox { lower, edges: Vector::repeat(edge), spacing: edge };
            if self.signed_distance(&lower.add_scalar(0.5 * edge)).abs() <= edge * (D as f64).sqrt() {
                self.add_surface(&of, FLAT[D.clamp(1, 3) - 1], &mut corners);
            }
        }
        corners
    }

    /// The bounding box. Where the solid has no end, the box ends one cell outside the grid.
    pub(crate) fn bounds_near(&self, grid: &Grid<D>) -> (Vector<f64, D>, Vector<f64, D>) {
        let (h, end) = (grid.spacing, grid.position(grid.cells));
        let (min, max) = self.bounding_box();
        let finite = |x: f64, other: f64| if x.is_finite() { x } else { other };
        let from = Vector::<f64, D>::from_fn(|k, _| finite(min[k], grid.origin[k].min(max[k]) - h));
        (from, Vector::<f64, D>::from_fn(|k, _| finite(max[k], end[k].max(min[k]) + h)))
    }

    /// Closed lines around the part of a solid of the plane in the grid, and around its holes: the corners of each line, with the solid at
    /// the left. No segment is longer than the diagonal of a box of this edge. `None` in other dimensions, and for a surface that is not
    /// approximated by segments with common ends.
    pub(crate) fn closed_lines(&self, grid: &Grid<D>, edge: f64) -> Option<Vec<Vec<Vector<f64, D>>>> {
        if D != 2 {
            return None;
        }
        let of_grid = Block { min: grid.origin, max: grid.position(grid.cells) };
        let (min, max) = self.bounding_box();
        let ends_inside = (0..D).all(|k| min[k] >= of_grid.min[k] && max[k] <= of_grid.max[k]);
        let own = self.clone();
        let solid = if ends_inside { own } else { Shape::intersection(vec![own, of_grid.into()]) };
        let mut segments = Vec::new();
        for ends in solid.surface_simplices(grid, edge).chunks_exact(D) {
            let (from, to) = (ends[0], ends[1]);
            let along = to - from;
            if along.norm() <= SHORT * edge {
                continue;
            }
            let outward = solid.normal(&((from + to) * 0.5));
            let is_right = along[1] * outward[0] - along[0] * outward[1] > 0.0;
            segments.push(if is_right { [from, to] } else { [to, from] });
        }
        joined(segments, GAP * edge)
    }
}

/// Joins segments to closed lines. `None` if a line does not close.
fn joined<const D: usize>(mut segments: Vec<[Vector<f64, D>; 2]>, gap: f64) -> Option<Vec<Vec<Vector<f64, D>>>> {
    let mut lines = Vec::new();
    while let Some([start, mut end]) = segments.pop() {
        let mut line = vec![start];
        loop {
            let distances = segments.iter().enumerate().map(|(k, [from, _])| (k, (from - end).norm()));
            let next = distances.min_by(|(_, a), (_, b)| a.total_cmp(b));
            let to_start = (start - end).norm();
            let next = next.filter(|(_, distance)| *distance < to_start);
            if next.map_or(to_start, |(_, distance)| distance) > gap {
                return None;
            }
            let Some((k, _)) = next else { break };
            line.push(end);
            end = segments.swap_remove(k)[1];
        }
        // A sliver at a corner that round-off has cut off has no inside.
        if line.len() > 2 {
            lines.push(line);
        }
    }
    (!lines.is_empty()).then_some(lines)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{Ball, Difference, HalfSpace, Polygon};
    use std::f64::consts::PI;

    /// The area to the left of the lines.
    fn area(lines: &[Vec<Vector<f64, 2>>]) -> f64 {
        let of_line = |line: &Vec<Vector<f64, 2>>| {
            let next = line.iter().cycle().skip(1);
            line.iter().zip(next).map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum::<f64>()
        };
        lines.iter().map(of_line).sum()
    }

    #[test]
    fn lines_enclose_the_area_of_the_solid() -> Result<(), Box<dyn std::error::Error>> {
        let grid = Grid { origin: Vector::zeros(), spacing: 0.1, cells: [10, 20] };
        let disc = |radius| Shape::from(Ball { center: Vector::from([0.47, 0.9]), radius });
        let ring = Shape::from(Difference { of: Box::new(disc(0.4)), minus: Box::new(disc(0.25)) });
        let slope = Polygon::new([[0.1, 0.1], [0.9, 0.1], [0.3, 1.2]].map(Vector::from).to_vec())?;
        let floor = HalfSpace { point: Vector::from([0.0, 0.33]), normal: Vector::from([0.0, 1.0]) };
        for (shape, lines, exact, bound) in [
            (disc(0.4), 1, PI * 0.16, 1e-3),
            (ring, 2, PI * (0.16 - 0.0625), 1e-3),
            (slope.into(), 1, 0.44, 1e-9),
            (floor.into(), 1, 0.33, 1e-9),
        ] {
            let found = shape.closed_lines(&grid, 0.05).ok_or("no lines")?;
            assert_eq!(found.len(), lines, "{shape:?}");
            assert!((area(&found) / exact - 1.0).abs() < bound, "{shape:?}: {} for {exact}", area(&found));
        }
        Ok(())
    }
}
