//! The search for points of surfaces that face another body.
//!
//! A point x with the normal n faces the point x' of another surface with the normal n' if n·n' < 0 and if the projection of x on the plane at
//! x' lies in the piece of surface around x'. Of several such points the nearest counts, and the mean of all points of its body that are
//! equally near. A point that is nearer to a point with n·n' > 0 of the same body faces nothing.

use crate::grid::Grid;
use crate::mechanics::loads::{BodyContact, Contacts, Facing, Partner, SurfacePoint};
use crate::particles::Particles;
use crate::tensor::{Tensor, Vector, cofactor, identity, inverse};
use std::collections::HashMap;

/// The search reaches this many grid spacings.
pub(crate) const REACH: u32 = 2;

/// The largest depth of a point in another body, in grid spacings.
pub(crate) const DEEPEST: f64 = 0.5;

/// The extent of a piece of surface around its point, in half edges of a square of the same area. The point of a Gauss rule need not be the
/// middle of its piece: two points along an axis leave 1.16.
const EXTENT: f64 = 1.3;

/// Distances that differ by less than this many spacings count as equal, so that rounding does not choose a point.
const SAME: f64 = 1e-6;

/// A point of a surface at t_n.
struct Place<const D: usize> {
    number: usize,
    body: u32,
    /// The position at t_n.
    now: Vector<f64, D>,
    /// The position at t_{n+1} with the velocity at t_n. With it, a force at t_{n+1} acts on both bodies along one line, to the order of Δt².
    x: Vector<f64, D>,
    /// The outward unit normal.
    normal: Vector<f64, D>,
    /// The extent of its piece of surface.
    extent: f64,
    /// ∂X/∂x of the configuration X at the last grid reset.
    back: Tensor<f64, D>,
}

/// All points that face a body of another field, by their number. Projections are those at t_{n+1}, with the velocities at t_n.
pub(crate) fn facing<const D: usize>(
    contacts: &Contacts<D>,
    between: &BodyContact<D>,
    particles: &Particles<D>,
    grid: &Grid<D>,
    dt: f64,
) -> Vec<Facing<D>> {
    let predicted = |number: usize| {
        let p = contacts.points[number].particle;
        let now = particles.position[p];
        // Without inertia there are no velocities.
        let next = particles.velocity.get(p).map_or(now, |v| now + v * dt);
        mutant!("contact: the reaction acts where the point was": next = now);
        [now, next]
    };
    let places = places(contacts, particles, predicted);
    search(&places, between, grid, DEEPEST).into_iter().map(Found::facing).collect()
}

/// A point that lies in another body.
pub(crate) struct Overlap {
    /// The number of the point.
    pub number: usize,
    /// The number of the pair.
    pub pair: usize,
    /// The depth (length).
    pub depth: f64,
}

/// All points that lie in another body when the points are at `positions`.
pub(crate) fn overlaps<const D: usize>(
    contacts: &Contacts<D>,
    between: &BodyContact<D>,
    particles: &Particles<D>,
    grid: &Grid<D>,
    positions: &[Vector<f64, D>],
) -> Vec<Overlap> {
    let places = places(contacts, particles, |number| [positions[number]; 2]);
    let found = search(&places, between, grid, f64::from(REACH)).into_iter().map(Found::facing);
    let overlap = |one: Facing<D>| Overlap { number: one.number, pair: one.pair, depth: -one.normal.dot(&one.start) };
    found.map(overlap).filter(|one| one.depth > 0.0).collect()
}

/// A point and the points of another surface that it faces.
struct Found<'a, const D: usize> {
    place: &'a Place<D>,
    others: Vec<&'a Place<D>>,
    /// The number of the pair.
    pair: usize,
}

/// All points that face another body at a depth below `deepest` spacings.
fn search<'a, const D: usize>(
    places: &'a [Place<D>],
    between: &BodyContact<D>,
    grid: &Grid<D>,
    deepest: f64,
) -> Vec<Found<'a, D>> {
    let pairs: HashMap<[u32; 2], usize> =
        between.pairs.iter().zip(0..).map(|(pair, number)| (pair.bodies, number)).collect();
    let boxes = boxes(places, f64::from(REACH) * grid.spacing);
    let near_other = |place: &&Place<D>| {
        let others = boxes.iter().filter(|(body, _)| pairs.contains_key(&pair(**body, place.body)));
        others.into_iter().any(|(_, [low, high])| (0..D).all(|k| low[k] <= place.x[k] && place.x[k] <= high[k]))
    };
    let near: Vec<&Place<D>> = places.iter().filter(near_other).collect();
    let cell = |place: &Place<D>| grid.cell(&place.x).or_else(|| grid.cell(&place.now));
    let mut cells: HashMap<u64, Vec<&Place<D>>> = HashMap::new();
    for place in &near {
        if let Some(cell) = cell(place) {
            cells.entry(grid.id(cell)).or_default().push(place);
        }
    }
    let found = |place: &&'a Place<D>| {
        let around = grid.around(cell(place)?, REACH).filter_map(|cell| cells.get(&grid.id(cell)));
        let others: Vec<&Place<D>> =
            around.flatten().copied().filter(|other| pairs.contains_key(&pair(place.body, other.body))).collect();
        let nearest = nearest(place, &others, deepest * grid.spacing, grid.spacing)?;
        let pair = pairs[&pair(place.body, nearest[0].body)];
        Some(Found { place, others: nearest, pair })
    };
    near.iter().filter_map(found).collect()
}

/// The nearest points of a surface that the point faces; `None` if it faces no surface. A point that is nearer to the far side of a body lies
/// behind the body, or is deeper in the body than half its thickness.
fn nearest<'a, const D: usize>(
    place: &Place<D>,
    others: &[&'a Place<D>],
    deepest: f64,
    h: f64,
) -> Option<Vec<&'a Place<D>>> {
    let distance = |other: &Place<D>| (place.x - other.x).norm();
    let faced: Vec<&'a Place<D>> = others.iter().copied().filter(|other| faces(place, other, deepest, h)).collect();
    let least = faced.iter().map(|other| distance(other)).fold(f64::INFINITY, f64::min);
    let body = faced.iter().filter(|other| distance(other) == least).map(|other| other.body).min()?;
    let far_side = |other: &&&Place<D>| other.body == body && place.normal.dot(&other.normal) > 0.0;
    let behind = others.iter().filter(far_side).any(|other| distance(other) < least);
    mutant!("contact: thin bodies clamp each other": behind = false);
    let same = |other: &&Place<D>| other.body == body && distance(other) <= least + SAME * h;
    (!behind).then(|| faced.into_iter().filter(same).collect())
}

fn pair(one: u32, other: u32) -> [u32; 2] {
    [one.min(other), one.max(other)]
}

/// The points of all surfaces. `positions` are those at t_n and at t_{n+1} by the number of the point.
fn places<const D: usize>(
    contacts: &Contacts<D>,
    particles: &Particles<D>,
    positions: impl Fn(usize) -> [Vector<f64, D>; 2],
) -> Vec<Place<D>> {
    let numbered = contacts.points.iter().enumerate();
    numbered.map(|(number, point)| place(number, point, particles, positions(number))).collect()
}

fn place<const D: usize>(
    number: usize,
    point: &SurfacePoint<D>,
    particles: &Particles<D>,
    [now, x]: [Vector<f64, D>; 2],
) -> Place<D> {
    let p = point.particle;
    let f = identity::<f64, D>() + particles.displacement_gradient[p];
    let area = cofactor(&f) * point.normal;
    let stretch = area.norm();
    let half = match D {
        1 => f64::INFINITY,
        _ => 0.5 * (stretch * point.area).powf(1.0 / (D - 1) as f64),
    };
    let back = (identity::<f64, D>() + particles.reference().displacement_gradient[p]) * inverse(&f);
    // A square reaches farther along its diagonal.
    let extent = EXTENT * half * ((D.max(2) - 1) as f64).sqrt();
    Place { number, body: particles.body[p], now, x, normal: area / stretch, extent, back }
}

/// The bounding box of the surface of each body, enlarged on all sides.
fn boxes<const D: usize>(places: &[Place<D>], by: f64) -> HashMap<u32, [Vector<f64, D>; 2]> {
    let mut boxes: HashMap<u32, [Vector<f64, D>; 2]> = HashMap::new();
    for place in places {
        let around = [place.x.add_scalar(-by), place.x.add_scalar(by)];
        let [low, high] = boxes.entry(place.body).or_insert(around);
        (*low, *high) = (low.inf(&around[0]), high.sup(&around[1]));
    }
    boxes
}

/// Whether a point faces a point of another surface.
fn faces<const D: usize>(place: &Place<D>, other: &Place<D>, deepest: f64, h: f64) -> bool {
    let apart = place.x - other.x;
    let gap = other.normal.dot(&apart);
    let along = (apart - other.normal * gap).norm();
    let gap_now = other.normal.dot(&(place.now - other.now));
    let near = gap_now > -deepest && gap.min(gap_now) < f64::from(REACH) * h;
    near && along <= other.extent && place.normal.dot(&other.normal) < 0.0
}

impl<const D: usize> Found<'_, D> {
    /// The plane through the mean of equally near points, and the projection of the point on it.
    fn facing(self) -> Facing<D> {
        let Self { place, others, pair } = self;
        let share = 1.0 / others.len() as f64;
        let sum: Vector<f64, D> = others.iter().map(|other| other.normal).sum();
        let normal = sum.try_normalize(0.0).unwrap_or(others[0].normal);
        let middle: Vector<f64, D> = others.iter().map(|other| other.x * share).sum();
        let projection = place.x - normal * normal.dot(&(place.x - middle));
        let carried: Vector<f64, D> = others.iter().map(|other| (other.now + projection - other.x) * share).sum();
        let partner =
            |other: &&Place<D>| Partner { number: other.number, share, offset: other.back * (projection - other.x) };
        Facing {
            number: place.number,
            pair,
            is_first: place.body < others[0].body,
            normal,
            start: place.now - carried,
            partners: others.iter().map(partner).collect(),
        }
    }
}
