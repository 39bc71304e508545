//! The surface of a cloud of particles.
//!
//! c(x) = Σ V_q W(x − x_q), with a kernel W of radius R, is about 1 in the cloud. It falls to ½ at the surface, and −∇c points outwards there. So
//! the vectors a_p = −2 V_p ∇c(x_p) of all particles sum to area times normal of a flat surface. All a_p of a cloud sum to zero.
//!
//! Particles where |∇c| is large carry the surface. They get the vectors of the particles below them.

use crate::tensor::Vector;
use std::collections::HashMap;
use std::f64::consts::PI;

/// R in edges of the particles. It reaches the third layer, so that normals of inclined surfaces on a lattice are right to 10°.
const RADIUS: f64 = 2.5;

/// A particle carries the surface if |2 ∇c| times the edge of the particles exceeds this. On lattices, particles of the second layer reach 0.42, and
/// particles of surfaces at any angle at least 0.46.
const CARRIES: f64 = 0.44;

/// A particle that carries no surface must be surrounded: the share of the others in c is at least this. It is 0.53 in 1D and 0.75 in 2D below a
/// surface, and at most 0.37 in a single layer, or among particles much smaller than itself.
const SURROUNDED: f64 = 0.45;

/// A body lies on a plane of symmetry if its nearest particle is at most this far from the plane, in edges.
const ON_PLANE: f64 = 0.75;

/// A smaller area, relative to that of a particle's face, is none.
const NO_AREA: f64 = 1e-9;

/// Distances that differ relatively by less than this count as equal, so that rounding does not choose a particle.
const SAME: f64 = 1e-6;

/// A point of the surface of a cloud, half an edge of its particle outside.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CloudPoint<const D: usize> {
    /// The number of the particle that carries the point.
    pub particle: usize,
    /// The position (length).
    pub position: Vector<f64, D>,
    /// The outward unit normal.
    pub normal: Vector<f64, D>,
    /// The area of its piece of surface (a length in 2D; all pieces of an end of a bar sum to about 1).
    pub area: f64,
}

/// A particle of the cloud: its position and its volume.
pub(crate) type CloudParticle<const D: usize> = (Vector<f64, D>, f64);

/// A particle by its number that is neither on a surface nor surrounded: it lies in a single layer, alone, or among much smaller ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NoSurface(pub usize);

/// The region of a cloud, where c > ½.
pub(crate) struct Cloud<const D: usize> {
    particles: Vec<CloudParticle<D>>,
    near: Near<D>,
}

impl<const D: usize> Cloud<D> {
    pub(crate) fn new(particles: Vec<CloudParticle<D>>) -> Self {
        let near = Near::new(&particles, RADIUS * edge(&particles));
        Self { particles, near }
    }

    /// Whether `x` lies in the cloud.
    pub(crate) fn holds(&self, x: &Vector<f64, D>) -> bool {
        self.near.sum(&self.particles, x).0 > 0.5
    }
}

/// The surface of the first `own` particles of a cloud. All others belong to bodies that are joined to it, and `planes` of symmetry, each by
/// its axis and coordinate, continue it where it lies on them. So joints and planes of symmetry are not part of the surface.
///
/// # Errors
/// The first particle that is neither on the surface nor surrounded; the first of all if there is no surface.
pub(crate) fn cloud_surface<const D: usize>(
    mut cloud: Vec<CloudParticle<D>>,
    own: usize,
    planes: &[(usize, f64)],
) -> Result<Vec<CloudPoint<D>>, NoSurface> {
    let edge = edge(&cloud[..own]);
    let radius = RADIUS * edge;
    let distance = |x: &Vector<f64, D>, axis: usize, wall: f64| (x[axis] - wall).abs();
    let lies_on =
        |&(axis, wall): &(usize, f64)| cloud[..own].iter().any(|(x, _)| distance(x, axis, wall) < ON_PLANE * edge);
    let planes: Vec<(usize, f64)> = planes.iter().filter(|plane| lies_on(plane)).copied().collect();
    mutant!("clouds: planes of symmetry are surfaces": planes = Vec::new());
    for (axis, wall) in planes {
        for i in 0..cloud.len() {
            let (mut x, volume) = cloud[i];
            if distance(&x, axis, wall) < radius {
                x[axis] = 2.0 * wall - x[axis];
                cloud.push((x, volume));
            }
        }
    }
    let near = Near::new(&cloud, radius);
    let mut points = Vec::new();
    let mut hidden = Vec::new();
    for (p, &(x, volume)) in cloud[..own].iter().enumerate() {
        let (c, gradient) = near.sum(&cloud, &x);
        let vector = gradient * (-2.0 * volume);
        let carries = 2.0 * gradient.norm() * edge > CARRIES;
        if carries && vector.norm() > NO_AREA * edge.powi(D as i32 - 1) {
            points.push((p, vector));
        } else if !carries && c - volume * weight::<D>(radius) < SURROUNDED {
            return Err(NoSurface(p));
        } else {
            hidden.push((p, vector));
        }
    }
    if points.is_empty() {
        return Err(NoSurface(0));
    }
    mutant!("clouds: the area of hidden particles is lost": hidden = Vec::new());
    add_hidden(&cloud, &hidden, &mut points, radius);
    let point = |(particle, vector): (usize, Vector<f64, D>)| {
        let (x, volume) = cloud[particle];
        let normal = vector.normalize();
        let position = x + normal * (0.5 * volume.powf(1.0 / D as f64));
        CloudPoint { particle, position, normal, area: vector.norm() }
    };
    Ok(points.into_iter().map(point).collect())
}

/// The edge V^(1/D) of the particles: half of the cloud's volume belongs to smaller ones. Files may have many tiny particles at the surface.
fn edge<const D: usize>(cloud: &[CloudParticle<D>]) -> f64 {
    let mut volumes: Vec<f64> = cloud.iter().map(|(_, volume)| *volume).collect();
    volumes.sort_by(f64::total_cmp);
    let half = 0.5 * volumes.iter().sum::<f64>();
    let mut sum = 0.0;
    let middle = volumes.into_iter().find(|volume| {
        sum += volume;
        sum >= half
    });
    middle.map_or(1.0, |volume| volume.powf(1.0 / D as f64))
}

/// Adds each hidden vector to the nearest particles of the surface within R. Vectors farther inside are noise of an irregular cloud.
fn add_hidden<const D: usize>(
    cloud: &[CloudParticle<D>],
    hidden: &[(usize, Vector<f64, D>)],
    points: &mut [(usize, Vector<f64, D>)],
    radius: f64,
) {
    let surface: Vec<CloudParticle<D>> = points.iter().map(|(p, _)| cloud[*p]).collect();
    let near = Near::new(&surface, radius);
    for (p, vector) in hidden {
        let x = cloud[*p].0;
        let found: Vec<(usize, f64)> = near.within(&surface, &x).map(|(q, apart)| (q, apart.norm())).collect();
        let least = found.iter().map(|(_, distance)| *distance).fold(f64::INFINITY, f64::min);
        let same: Vec<usize> = found.iter().filter(|one| one.1 <= least * (1.0 + SAME)).map(|one| one.0).collect();
        same.iter().for_each(|&q| points[q].1 += vector / same.len() as f64);
    }
}

/// w of the kernel w (1 − r²/R²)².
fn weight<const D: usize>(radius: f64) -> f64 {
    radius.powi(-(D as i32)) * [15.0 / 16.0, 3.0 / PI, 105.0 / (32.0 * PI)][D.clamp(1, 3) - 1]
}

/// Particles by cells of edge R.
struct Near<const D: usize> {
    radius: f64,
    cells: HashMap<[i64; D], Vec<usize>>,
}

impl<const D: usize> Near<D> {
    fn new(cloud: &[CloudParticle<D>], radius: f64) -> Self {
        let mut near = Self { radius, cells: HashMap::new() };
        for (p, (x, _)) in cloud.iter().enumerate() {
            near.cells.entry(near.cell(x)).or_default().push(p);
        }
        near
    }

    fn cell(&self, x: &Vector<f64, D>) -> [i64; D] {
        std::array::from_fn(|k| (x[k] / self.radius).floor() as i64)
    }

    /// All particles within R of x, and their distances as vectors.
    fn within<'a>(
        &'a self,
        cloud: &'a [CloudParticle<D>],
        x: &'a Vector<f64, D>,
    ) -> impl Iterator<Item = (usize, Vector<f64, D>)> {
        let cell = self.cell(x);
        let around = (0..3_i64.pow(D as u32))
            .map(move |i| std::array::from_fn(|k| cell[k].saturating_add(i / 3_i64.pow(k as u32) % 3 - 1)));
        let listed = around.filter_map(|cell: [i64; D]| self.cells.get(&cell)).flatten();
        listed.map(move |&q| (q, x - cloud[q].0)).filter(|(_, apart)| apart.norm() < self.radius)
    }

    /// c and ∇c at x, with W = w (1 − r²/R²)².
    fn sum(&self, cloud: &[CloudParticle<D>], x: &Vector<f64, D>) -> (f64, Vector<f64, D>) {
        let w = weight::<D>(self.radius);
        self.within(cloud, x).fold((0.0, Vector::zeros()), |(c, gradient), (q, apart)| {
            let (volume, rest) = (cloud[q].1, 1.0 - apart.norm_squared() / self.radius.powi(2));
            let slope = -4.0 * w * volume * rest / self.radius.powi(2);
            (c + w * volume * rest * rest, gradient + apart * slope)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::indices;

    /// A lattice of edge 0.1 in a region, turned about the origin.
    fn lattice<const D: usize>(turn: f64, holds: impl Fn(&Vector<f64, D>) -> bool) -> Vec<CloudParticle<D>> {
        let turned = |x: Vector<f64, D>| {
            let mut turned = x;
            if D > 1 {
                (turned[0], turned[1]) = (x[0] * turn.cos() - x[1] * turn.sin(), x[0] * turn.sin() + x[1] * turn.cos());
            }
            turned
        };
        let point = |i: [u64; D]| turned(Vector::from_fn(|k, _| 0.1 * (i[k] as f64 - 15.5)));
        indices([32; D]).map(point).filter(holds).map(|x| (x, 0.1_f64.powi(D as i32))).collect()
    }

    fn surface<const D: usize>(cloud: &[CloudParticle<D>]) -> Vec<CloudPoint<D>> {
        cloud_surface(cloud.to_vec(), cloud.len(), &[]).unwrap()
    }

    fn total<const D: usize>(points: &[CloudPoint<D>]) -> f64 {
        points.iter().map(|point| point.area).sum()
    }

    #[test]
    fn a_square_has_the_points_of_its_sides() {
        for turn in [0.0, 0.3, 0.8] {
            let (c, s) = (f64::cos(turn), f64::sin(turn));
            let back = |x: &Vector<f64, 2>| Vector::from([x[0] * c + x[1] * s, x[1] * c - x[0] * s]);
            let points = surface(&lattice::<2>(turn, |x| back(x).amax() < 1.0));
            assert_eq!(points.len(), 76);
            for point in &points {
                let (x, normal) = (back(&point.position), back(&point.normal));
                let on_side = normal.amax() > 1.0 - 1e-3 && (x.amax() - 1.0).abs() < 1e-4;
                assert!(on_side || x.amin() > 0.6, "{x} {normal}");
            }
            assert!((total(&points) / 8.0 - 1.0).abs() < 0.05, "{}", total(&points));
            let sum: Vector<f64, 2> = points.iter().map(|point| point.normal * point.area).sum();
            assert!(sum.norm() < 1e-13, "{sum}");
        }
    }

    #[test]
    fn round_bodies_have_their_normals_and_nearly_their_area() {
        let disc = surface(&lattice::<2>(0.0, |x| x.norm() < 1.0));
        for point in &disc {
            assert!(point.normal.dot(&point.position.normalize()) > 0.98, "{point:?}");
            assert!((point.position.norm() - 0.99).abs() < 0.07, "{point:?}");
        }
        assert!((total(&disc) / (2.0 * PI) - 1.0).abs() < 0.1, "{}", total(&disc));
        let ball = surface(&lattice::<3>(0.0, |x| x.norm() < 1.0));
        assert!(ball.iter().all(|point| point.normal.dot(&point.position.normalize()) > 0.95));
        assert!((total(&ball) / (4.0 * PI) - 1.0).abs() < 0.15, "{}", total(&ball));
    }

    #[test]
    fn the_ends_of_a_bar_have_about_area_1() {
        let bar = surface(&lattice::<1>(0.0, |x| x[0].abs() < 1.0));
        let ends: Vec<_> = bar.iter().map(|point| (point.position[0], point.normal[0], point.area)).collect();
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(
            ends.len() == 2
                && ends.iter().all(|&(x, n, a)| close(x.abs(), 1.0) && n == x.signum() && (a - 1.0).abs() < 0.1)
        );
    }

    /// A quarter of a square between two planes of symmetry, and a half that is joined to the other half.
    #[test]
    fn planes_of_symmetry_and_joints_are_not_part_of_the_surface() {
        let whole = lattice::<2>(0.0, |x| x.amax() < 1.0);
        let all = surface(&whole);
        let same = |part: &[CloudPoint<2>], region: &dyn Fn(&Vector<f64, 2>) -> bool| {
            let expected: Vec<_> = all.iter().filter(|point| region(&point.position)).collect();
            assert_eq!(part.len(), expected.len());
            for (one, other) in part.iter().zip(expected) {
                assert!((one.position - other.position).norm() + (one.area - other.area).abs() < 1e-14);
            }
        };
        let quarter = |x: &Vector<f64, 2>| x[0] > 0.0 && x[1] > 0.0;
        let part: Vec<CloudParticle<2>> = whole.iter().filter(|(x, _)| quarter(x)).copied().collect();
        same(&cloud_surface(part.clone(), part.len(), &[(0, 0.0), (1, 0.0)]).unwrap(), &quarter);
        // Beside a plane that it does not lie on, the body has a surface.
        same(&cloud_surface(whole.clone(), whole.len(), &[(0, -1.04)]).unwrap(), &|_| true);
        let half = |x: &Vector<f64, 2>| x[0] > 0.0;
        let (mut joined, other): (Vec<_>, Vec<_>) = whole.iter().copied().partition(|(x, _)| half(x));
        let own = joined.len();
        joined.extend(other);
        same(&cloud_surface(joined, own, &[]).unwrap(), &half);
    }

    #[test]
    fn a_cloud_holds_what_lies_below_its_surface() {
        let cloud = Cloud::new(lattice::<2>(0.3, |x| x.norm() < 1.0));
        let at = |r: f64| cloud.holds(&Vector::from([0.6 * r, -0.8 * r]));
        assert!(at(0.0) && at(0.85) && !at(1.1) && !at(5.0));
    }

    #[test]
    fn a_single_layer_has_no_surface() {
        let sheet = lattice::<3>(0.0, |x| x[2].abs() < 0.06 && x[2] > 0.0);
        assert!(cloud_surface(sheet.clone(), sheet.len(), &[]).is_err());
        assert_eq!(cloud_surface(vec![(Vector::from([0.5, 0.5]), 1.0)], 1, &[]), Err(NoSurface(0)));
        // Particles at one place, a bar of two particles, and a layer of large particles under small ones.
        assert!(cloud_surface(vec![(Vector::from([0.5, 0.5]), 1.0); 4], 4, &[]).is_err());
        assert!(cloud_surface(vec![(Vector::from([0.65]), 0.1), (Vector::from([0.75]), 0.1)], 2, &[]).is_err());
        let mut mixed = lattice::<2>(0.0, |x| x.amax() < 1.0);
        mixed.extend((0..8).map(|i| (Vector::from([-0.875 + 0.25 * f64::from(i), -1.125]), 0.0625)));
        assert!(cloud_surface(mixed.clone(), mixed.len(), &[]).is_err());
        // A particle of hardly any volume carries nothing.
        let mut square = lattice::<2>(0.0, |x| x.amax() < 1.0);
        square.push((Vector::from([0.0, 1.01]), 1e-200));
        assert_eq!(surface(&square).len(), 76);
        let plate = lattice::<3>(0.0, |x| x[2].abs() < 0.11 && x[0].abs().max(x[1].abs()) < 1.0);
        assert_eq!(surface(&plate).len(), 2 * 400);
    }
}
