//! The surfaces of obstacles in space: triangles, shaded, and the particles that they hide.

use super::axes::{Axes, extremes};
use super::neighbours::cut;
use super::picture::Picture;
use super::view::Directions;
use crate::output::vtu::Snapshot;
use crate::tensor::Vector;

/// Opacity of all obstacles together. Hidden particles show through.
const OPACITY: f64 = 0.8;

/// Largest number of vertical strips of a picture in which triangles are looked for.
const STRIPS: usize = 256;

/// A point of the picture and its distance towards the eye.
type Seen = [f64; 3];

/// The triangles of all obstacles in a part of space.
pub(super) struct Facets<'a> {
    directions: &'a Directions,
    /// Triangles, or polygons that the ends of the part of space have cut from triangles; the nearest to the eye is the last.
    polygons: Vec<Polygon>,
    /// Left and right end of all polygons in the picture.
    ends: (f64, f64),
    /// The numbers of the polygons in each vertical strip between these ends.
    strips: Vec<Vec<usize>>,
}

/// A flat convex polygon.
struct Polygon {
    corners: Vec<Seen>,
    /// Cosine of the angle between the normal and the direction of sight.
    facing: f64,
}

impl<'a> Facets<'a> {
    /// The triangles of `obstacles` in a box.
    pub(super) fn new(obstacles: &Snapshot, directions: &'a Directions, [low, high]: [[f64; 3]; 2]) -> Self {
        let seen = |x: &Vector<f64, 3>| {
            let (right, up) = directions.project((*x).into());
            [right, up, directions.depth((*x).into())]
        };
        let mut polygons = Vec::new();
        for [a, b, c] in obstacles.points.as_chunks().0 {
            let whole = [a, b, c].map(|x| Vector::from(*x)).to_vec();
            let inside = (0..3).fold(whole, |polygon, k| {
                let above = cut(&polygon, |x| low[k] - x[k]);
                cut(&above, |x| x[k] - high[k])
            });
            let (along, across) = (Vector::from(*b) - Vector::from(*a), Vector::from(*c) - Vector::from(*a));
            let normal: Vector<f64, 3> = along.cross(&across);
            if inside.len() > 2 && normal.norm() > 0.0 {
                let facing = directions.depth((normal / normal.norm()).into()).abs();
                polygons.push(Polygon { corners: inside.iter().map(seen).collect(), facing });
            }
        }
        polygons.sort_by(|a, b| a.depth().total_cmp(&b.depth()));
        let ends = extremes(polygons.iter().flat_map(|polygon| &polygon.corners).map(|corner| corner[0]));
        let mut facets = Self { directions, polygons, ends, strips: vec![Vec::new(); STRIPS] };
        for (number, polygon) in facets.polygons.iter().enumerate() {
            let (from, to) = extremes(polygon.corners.iter().map(|corner| corner[0]));
            let (from, to) = (facets.strip(from), facets.strip(to));
            facets.strips[from..=to].iter_mut().for_each(|strip| strip.push(number));
        }
        facets
    }

    /// The strip at the horizontal position `right` of the picture.
    fn strip(&self, right: f64) -> usize {
        let (low, high) = self.ends;
        // Positions outside count as those at the ends.
        (((right - low) / (high - low) * STRIPS as f64) as usize).min(STRIPS - 1)
    }

    /// Whether an obstacle lies between the point `x` and the eye.
    pub(super) fn hide(&self, x: [f64; 3]) -> bool {
        let ((right, up), depth) = (self.directions.project(x), self.directions.depth(x));
        self.strips[self.strip(right)].iter().any(|&number| self.polygons[number].hides([right, up, depth]))
    }

    /// Draws the polygons as one layer.
    pub(super) fn draw(&self, picture: &mut Picture, axes: &Axes) {
        picture.translucent(OPACITY, |picture| {
            for Polygon { corners, facing } in &self.polygons {
                let grey = (150.0 + 80.0 * facing).round() as u8;
                picture.polygon(corners.iter().map(|corner| axes.place((corner[0], corner[1]))), [grey; 3]);
            }
        });
    }
}

impl Polygon {
    fn depth(&self) -> f64 {
        self.corners.iter().map(|corner| corner[2]).sum::<f64>() / self.corners.len() as f64
    }

    /// Whether the polygon lies between a point and the eye.
    fn hides(&self, [right, up, depth]: Seen) -> bool {
        let next = self.corners.iter().cycle().skip(1);
        // Twice the areas of the triangles that the point forms with the sides.
        let areas =
            self.corners.iter().zip(next).map(|(a, b)| (a[0] - right) * (b[1] - up) - (b[0] - right) * (a[1] - up));
        let (least, largest) = extremes(areas);
        if least < 0.0 && largest > 0.0 {
            return false;
        }
        self.depth_at(right, up).is_some_and(|surface| surface > depth)
    }

    /// The depth of the polygon's plane at a point of the picture; `None` if the plane is seen from its edge.
    fn depth_at(&self, right: f64, up: f64) -> Option<f64> {
        let [first, .., last] = &self.corners[..] else { return None };
        let from = |x: &Seen| Vector::<f64, 3>::from(*x) - Vector::from(*first);
        let normals = self.corners[1..].iter().map(|corner| from(corner).cross(&from(last)));
        let normal = normals.max_by(|a, b| a.norm().total_cmp(&b.norm()))?;
        let slope = -(normal[0] * (right - first[0]) + normal[1] * (up - first[1])) / normal[2];
        (normal[2].abs() > 1e-9 * normal.norm()).then_some(first[2] + slope)
    }
}
