//! Neighbours of a particle: their distance, and the Voronoi cell of the particle.

use crate::output::vtu::{Background, Snapshot};
use crate::tensor::Vector;
use std::collections::{HashMap, HashSet};

/// Corners of the initial polygon of a cell.
const CORNERS: usize = 16;

/// Layers of cubes in which a wide cell looks for neighbours. The cell reaches half as far as the neighbours, which is the mean distance times
/// this number.
const LAYERS: i64 = 2;

/// Particles sorted into cubes.
pub(super) struct Neighbours<'a> {
    snapshot: &'a Snapshot,
    /// Mean distance of neighbours.
    mean: f64,
    /// Particles in each cube. The side of a cube is twice the mean distance.
    cubes: HashMap<[i64; 3], Vec<usize>>,
}

fn cube(snapshot: &Snapshot, x: &[f64; 3], side: f64) -> [i64; 3] {
    let Background { origin, .. } = snapshot.background;
    [0, 1, 2].map(|k| ((x[k] - origin[k]) / side).floor() as i64)
}

impl<'a> Neighbours<'a> {
    /// Sorts the particles `ids` of a snapshot.
    pub(super) fn new(snapshot: &'a Snapshot, ids: &[usize]) -> Self {
        let Background { dimension, spacing, .. } = snapshot.background;
        // The occupied grid cells, divided among the particles, give the mean distance.
        let cells: HashSet<_> = snapshot.points.iter().map(|x| cube(snapshot, x, spacing)).collect();
        let part = cells.len() as f64 / ids.len().max(1) as f64;
        let mean = spacing * part.powf(1.0 / f64::from(dimension));
        let mut cubes: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
        for &p in ids {
            cubes.entry(cube(snapshot, &snapshot.points[p], 2.0 * mean)).or_default().push(p);
        }
        Self { snapshot, mean, cubes }
    }

    /// The position of `p` in the plane.
    fn plane(&self, p: usize) -> Vector<f64, 2> {
        let [x, y, _] = self.snapshot.points[p];
        Vector::from([x, y])
    }

    /// The other particles in the cube of `p` and in `layers` layers of cubes around it.
    fn around(&self, p: usize, layers: i64) -> impl Iterator<Item = usize> + '_ {
        let [i, j, k] = cube(self.snapshot, &self.snapshot.points[p], 2.0 * self.mean);
        let side = move || -layers..=layers;
        let cubes = side().flat_map(move |c| side().flat_map(move |b| side().map(move |a| [i + a, j + b, k + c])));
        cubes.filter_map(|cube| self.cubes.get(&cube)).flatten().copied().filter(move |&q| q != p)
    }

    /// Mean distance of the nearest neighbours of `p`, two along each axis as on a lattice. A lone particle gets the mean over all
    /// particles.
    pub(super) fn distance(&self, p: usize) -> f64 {
        let points = &self.snapshot.points;
        let square = |q: usize| (0..3).map(|k| (points[q][k] - points[p][k]).powi(2)).sum::<f64>();
        let mut squares: Vec<f64> = self.around(p, 1).map(square).collect();
        squares.sort_by(f64::total_cmp);
        squares.truncate(2 * self.snapshot.background.dimension as usize);
        let sum: f64 = squares.iter().map(|square| square.sqrt()).sum();
        if sum > 0.0 { sum / squares.len() as f64 } else { self.mean }
    }

    /// Diameter of `p` in space: the distance of its neighbours, bounded because this distance is larger at a surface.
    pub(super) fn diameter(&self, p: usize) -> f64 {
        self.distance(p).min(1.1 * self.mean)
    }

    /// Distance of neighbours for each of `ids`. If `ids` are a part of all particles, every particle gets the mean.
    pub(super) fn distances(&self, ids: &[usize]) -> Vec<f64> {
        let all = ids.len() == self.snapshot.points.len();
        ids.iter().map(|&p| if all { self.distance(p) } else { self.mean }).collect()
    }

    /// Voronoi cell of `p` in the plane, a polygon. At the surface of a body, a neighbour may lack a counterpart on the other side. The
    /// cell then ends as far out as it does inwards.
    pub(super) fn cell(&self, p: usize) -> Vec<Vector<f64, 2>> {
        let centre = self.plane(p);
        let distance = self.distance(p);
        let reach = self.mean.max(distance);
        let around: Vec<Vector<f64, 2>> = self.around(p, 1).map(|q| self.plane(q) - centre).collect();
        // Bisectors with the neighbours, and with mirrored neighbours where none lies within 60° of the opposite direction.
        let mut towards: Vec<_> = around.iter().copied().filter(|v| v.norm() < 2.0 * reach).collect();
        let missing = |v: &Vector<f64, 2>| around.iter().all(|other| other.dot(v) <= 0.5 * other.norm() * v.norm());
        let surface: Vec<_> = towards.iter().map(|v| -v).filter(missing).collect();
        // The corners of a cell in a square lattice are 0.71 distances away.
        let radius = if surface.is_empty() { reach } else { 0.8 * distance };
        towards.extend(surface);
        bisected(centre, radius, towards)
    }

    /// Voronoi cell of `p` in the plane, a polygon. At the surface of a body the cell reaches beyond the body, so that an outline can cut
    /// it.
    pub(super) fn wide_cell(&self, p: usize) -> Vec<Vector<f64, 2>> {
        let centre = self.plane(p);
        let towards = self.around(p, LAYERS).map(|q| self.plane(q) - centre).filter(|v| v.norm() > 0.0);
        bisected(centre, LAYERS as f64 * self.mean, towards)
    }
}

/// The part of a disc about `centre`, as a polygon, that is nearer to the centre than to the neighbours in the directions `towards`.
fn bisected(
    centre: Vector<f64, 2>,
    radius: f64,
    towards: impl IntoIterator<Item = Vector<f64, 2>>,
) -> Vec<Vector<f64, 2>> {
    let corner = |k: usize| {
        let angle = (k as f64 + 0.5) * std::f64::consts::TAU / CORNERS as f64;
        centre + radius * Vector::from([angle.cos(), angle.sin()])
    };
    let whole: Vec<_> = (0..CORNERS).map(corner).collect();
    // Positive at points that are nearer to the neighbour.
    let beyond = |v: Vector<f64, 2>| move |at: &Vector<f64, 2>| (at - centre - v / 2.0).dot(&v);
    towards.into_iter().fold(whole, |polygon, v| cut(&polygon, beyond(v)))
}

/// The part of a convex polygon where the linear function `beyond` is not positive.
pub(super) fn cut<const D: usize>(
    polygon: &[Vector<f64, D>],
    beyond: impl Fn(&Vector<f64, D>) -> f64,
) -> Vec<Vector<f64, D>> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (k, from) in polygon.iter().enumerate() {
        let to = &polygon[(k + 1) % polygon.len()];
        let (a, b) = (beyond(from), beyond(to));
        if a <= 0.0 {
            kept.push(*from);
        }
        if (a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0) {
            kept.push(from + (to - from) * (a / (a - b)));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn snapshot(points: Vec<[f64; 3]>) -> Snapshot {
        let background = Background { dimension: 2, origin: [0.0; 3], spacing: 1.0, cells: [9, 9, 0] };
        Snapshot { time: 0.0, background, points, arrays: vec![], corners: 1 }
    }

    #[test]
    fn neighbours_are_found_at_their_distance() {
        let snapshot = snapshot(vec![[0.2, 0.2, 0.0], [0.8, 0.2, 0.0], [1.1, 0.2, 0.0], [7.5, 7.5, 0.0]]);
        let distances = |ids: &[usize]| Neighbours::new(&snapshot, ids).distances(ids);
        let found = distances(&[0, 1, 2, 3]);
        // 4 points in 3 cells, the last one alone
        let wanted = [0.75, 0.45, 0.6, 0.75_f64.sqrt()];
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        assert_eq!(distances(&[0, 2]), [1.5_f64.sqrt(); 2]);
    }

    #[test]
    fn cells_fill_a_lattice_without_gaps_or_overlap() {
        let points = (0..36).map(|k| [0.25 + 0.5 * f64::from(k % 6), 0.25 + 0.5 * f64::from(k / 6), 0.0]).collect();
        let snapshot = snapshot(points);
        let ids: Vec<usize> = (0..36).collect();
        let neighbours = Neighbours::new(&snapshot, &ids);
        let area = |p: usize| {
            let cell = neighbours.cell(p);
            let next = cell.iter().cycle().skip(1);
            cell.iter().zip(next).map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum::<f64>()
        };
        // The squares of the lattice, inside, at an edge and in a corner.
        for p in [14, 3, 0] {
            assert!((area(p) - 0.25).abs() < 1e-12, "{p}: {}", area(p));
        }
    }
}
