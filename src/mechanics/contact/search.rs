//! The search for points of surfaces that may touch another body.
//!
//! Points of two surfaces, x with the normal n and x' with the normal n', are candidates if n·n' < 0 and if x crosses the plane at x' within
//! the piece of surface around x', or ends the step above that piece. The closest point on the other surface is a mean of the candidates
//! that are about as near as the nearest. Their planes take part with the same weights w:
//!
//! n̄ = Σ w n'/|Σ w n'|        g = ½ Σ w (n̄ + n')·(x − x')
//!
//! Planes with the normals n' lie outside a convex surface, and planes with the normal n̄ inside it. Their mean is exact to third order.

use crate::grid::Grid;
use crate::mechanics::loads::{BodyContact, Candidate, Contacts, Pair, Share};
use crate::parallel;
use crate::particles::Particles;
use crate::tensor::{Tensor, Vector, cofactor, identity, inverse};
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// The search reaches this many grid spacings.
const REACH: u32 = 2;

/// The largest motion of two bodies relative to each other in a step in which the search misses nothing, in grid spacings.
pub(crate) const FASTEST: f64 = 1.5;

/// The largest depth of a point in another body, in grid spacings, and as a part of the thickness of the body.
const DEEPEST: f64 = 0.5;
const DEEPEST_PART: f64 = 0.45;

/// The cosines between two normals at which points begin to see each other, and see each other fully. Faces at right angles do not see each
/// other, whatever the rounding, and points at a corner that turns do not appear at once.
const OPPOSITE: [f64; 2] = [-0.02, -0.5];

/// The cosine between two normals of a body below which they belong to the two sides of a thin part.
const PARALLEL: f64 = -0.9;

/// The cosines between two normals of a body at which an edge begins, and at which it is sharp.
const EDGE: [f64; 2] = [0.9, 0.6];

/// The extent of a piece of surface around its point, in half edges of a square of the same area. The points of a Gauss rule are not the
/// middles of their pieces. They lie up to 1.16 half edges from each other's middle, and blending takes another half.
const EXTENT: f64 = 1.7;

/// Points, and particles, in one part of the work of a thread.
const POINTS: usize = 64;
const PARTICLES: usize = 512;

/// A point of a surface during a step.
struct Place<const D: usize> {
    number: usize,
    body: u32,
    /// The positions at t_n and at t_{n+1}.
    ends: [Vector<f64, D>; 2],
    /// The outward unit normal.
    normal: Vector<f64, D>,
    /// Half the edge of a square of the area of its piece of surface.
    half: f64,
    /// ∂X/∂x of the configuration X at the last grid reset.
    back: Tensor<f64, D>,
}

/// A point x' of another surface, as a point x sees it.
struct Seen<'a, const D: usize> {
    other: &'a Place<D>,
    /// x − x' at t_n and at t_{n+1}.
    apart: [Vector<f64, D>; 2],
    /// |x − x'| where x crosses the plane at x', or at t_{n+1} if it does not.
    distance: f64,
    /// The largest depth at x' that is not nearer to the far side of the body.
    deepest: f64,
    /// How far the normals are opposite, from 0 to 1.
    opposite: f64,
}

/// A point and the closest point on another surface.
struct Found<'a, const D: usize> {
    place: &'a Place<D>,
    /// The number of the pair.
    pair: usize,
    /// The points around the closest point with their weights, which sum to 1.
    others: Vec<(f64, Seen<'a, D>)>,
    /// n̄
    normal: Vector<f64, D>,
    /// The part of the point that sees the other surface, from 0 to 1.
    part: f64,
    /// How near the point, and the closest point, are to a convex edge of their body, from 0 to 1.
    edges: [f64; 2],
}

/// The path of a point in a step, beside or in another body.
pub(crate) struct Path {
    /// The number of the point.
    pub number: usize,
    /// The number of the pair.
    pub pair: usize,
    /// The depths in the other body at both ends (length), negative outside. A point that starts beside the surface has depth 0 there.
    pub depth: [f64; 2],
    /// The largest depth that is not nearer to the far side of the other body.
    pub deepest: f64,
}

/// All pairs of a point and another body that may touch in the coming step. The points move with their velocities at t_n, so that forces at
/// t_{n+1} act on both bodies along one line, to the order of Δt².
pub(crate) fn candidates<const D: usize>(
    contacts: &Contacts<D>,
    between: &BodyContact<D>,
    particles: &Particles<D>,
    grid: &Grid<D>,
    motion: impl Fn(usize) -> Vector<f64, D> + Sync,
) -> Vec<Candidate<D>> {
    let predicted = |number: usize| {
        let p = contacts.points[number].particle;
        let now = particles.position[p];
        let next = now + motion(p);
        mutant!("contact: the reaction acts where the point was": next = now);
        [now, next]
    };
    let places = places(contacts, particles, predicted);
    search(&places, between, grid).into_iter().map(|found| found.candidate(between)).collect()
}

/// The paths of all points near other bodies, in a step with the positions `ends` of the points at both ends.
pub(crate) fn paths<const D: usize>(
    contacts: &Contacts<D>,
    between: &BodyContact<D>,
    particles: &Particles<D>,
    grid: &Grid<D>,
    ends: impl Fn(usize) -> [Vector<f64, D>; 2] + Sync,
) -> Vec<Path> {
    let places = places(contacts, particles, ends);
    search(&places, between, grid).iter().map(Found::path).collect()
}

/// The particles that lie in other bodies when all particles are at `positions`, with the pair, and the depth below the nearest point
/// of the other surface, at most a cell away, and its normal.
pub(crate) fn swallowed<const D: usize>(
    contacts: &Contacts<D>,
    between: &BodyContact<D>,
    particles: &Particles<D>,
    grid: &Grid<D>,
    positions: &[Vector<f64, D>],
) -> Vec<(usize, usize, f64, Vector<f64, D>)> {
    let places = places(contacts, particles, |number| [positions[contacts.points[number].particle]; 2]);
    let boxes = boxes(&places, 0.0);
    let mut cells: FxHashMap<u64, Vec<&Place<D>>> = FxHashMap::default();
    for place in &places {
        if let Some(cell) = grid.cell(&place.ends[0]) {
            cells.entry(grid.id(cell)).or_default().push(place);
        }
    }
    let lies_in = |p: usize, pair: &Pair| {
        let x = &positions[p];
        let other = pair.bodies.into_iter().find(|&body| body != particles.body[p])?;
        let [low, high] = boxes.get(&other)?;
        let is_near = pair.bodies.contains(&particles.body[p]) && (0..D).all(|k| low[k] < x[k] && x[k] < high[k]);
        let around = is_near.then(|| grid.cell(x)).flatten().into_iter().flat_map(|cell| grid.around(cell, 1));
        let near = around.filter_map(|cell| cells.get(&grid.id(cell))).flatten().filter(|place| place.body == other);
        let nearest = near.min_by(|one, two| (x - one.ends[0]).norm().total_cmp(&(x - two.ends[0]).norm()))?;
        let apart = x - nearest.ends[0];
        let depth = -nearest.normal.dot(&apart);
        (depth > 0.0 && nearest.is_below(&apart)).then_some((depth, nearest.normal))
    };
    let overlap = |(_, pair): &(usize, &Pair)| {
        let [one, other] = pair.bodies.map(|body| boxes.get(&body));
        let both = one.zip(other);
        both.is_some_and(|(one, other)| (0..D).all(|k| one[0][k] < other[1][k] && other[0][k] < one[1][k]))
    };
    let pairs: Vec<_> = between.pairs.iter().enumerate().filter(overlap).collect();
    if pairs.is_empty() {
        return Vec::new();
    }
    parallel::list_by(PARTICLES, particles.len(), |p, found| {
        let inside =
            |&(pair, bodies): &(usize, &Pair)| lies_in(p, bodies).map(|(depth, normal)| (p, pair, depth, normal));
        if particles.is_solid(p) {
            found.extend(pairs.iter().filter_map(inside));
        }
    })
}

/// The points near other bodies, by the cells that hold them at t_n.
struct Near<'a, const D: usize> {
    grid: &'a Grid<D>,
    cells: FxHashMap<u64, Vec<&'a Place<D>>>,
    /// The results of [`Self::deepest`] and [`Self::edge`] by the number of the place. Many points see the same place.
    deepest: Vec<OnceLock<f64>>,
    edges: Vec<OnceLock<f64>>,
}

impl<'a, const D: usize> Near<'a, D> {
    fn around(&self, place: &Place<D>) -> impl Iterator<Item = &'a Place<D>> {
        let cells = self.grid.cell(&place.ends[0]).map(|cell| self.grid.around(cell, REACH));
        cells.into_iter().flatten().filter_map(|cell| self.cells.get(&self.grid.id(cell))).flatten().copied()
    }

    /// The largest depth at a point that is not nearer to the far side of its body.
    fn deepest(&self, place: &Place<D>) -> f64 {
        *self.deepest[place.number].get_or_init(|| self.find_deepest(place))
    }

    fn find_deepest(&self, place: &Place<D>) -> f64 {
        let depth = |far: &Place<D>| place.normal.dot(&(place.ends[0] - far.ends[0]));
        let behind = |far: &&Place<D>| {
            let along = (place.ends[0] - far.ends[0]) - place.normal * depth(far);
            far.body == place.body
                && far.normal.dot(&place.normal) < PARALLEL
                && depth(far) > 0.0
                && along.norm() <= far.extent()
        };
        let thickness = self.around(place).filter(behind).map(depth).fold(f64::INFINITY, f64::min);
        mutant!("contact: thin bodies clamp each other": thickness = f64::INFINITY);
        (DEEPEST * self.grid.spacing).min(DEEPEST_PART * thickness)
    }

    /// A point of another body as a point sees it; `None` if it cannot touch the surface there.
    fn seen(&self, place: &Place<D>, other: &'a Place<D>) -> Option<Seen<'a, D>> {
        let apart = other.apart(place);
        let gap = apart.map(|apart| other.normal.dot(&apart));
        let opposite = opposite(&place.normal, &other.normal);
        if opposite == 0.0 || gap[0].min(gap[1]) > f64::from(REACH) * self.grid.spacing {
            return None;
        }
        let meeting = if gap[0] >= 0.0 && gap[1] < 0.0 { gap[0] / (gap[0] - gap[1]) } else { 1.0 };
        let meeting = apart[0] + (apart[1] - apart[0]) * meeting;
        if !other.is_below(&meeting) {
            return None;
        }
        let deepest = if gap[0].min(gap[1]) < 0.0 { self.deepest(other) } else { f64::INFINITY };
        (gap[0] > -deepest).then_some(Seen { other, apart, distance: meeting.norm(), deepest, opposite })
    }

    /// The closest point on another surface, of the points that a point sees. There is one at least.
    fn closest(&self, place: &'a Place<D>, pair: usize, seen: Vec<Seen<'a, D>>) -> Found<'a, D> {
        let least = seen.iter().map(|seen| seen.distance).fold(f64::INFINITY, f64::min);
        let near = |seen: &Seen<'_, D>| (1.0 - (seen.distance - least) / seen.other.half).max(0.0);
        let all: f64 = seen.iter().map(near).sum();
        let sum: f64 = seen.iter().map(|seen| near(seen) * seen.opposite).sum();
        let weight = |seen: &Seen<'_, D>| near(seen) * seen.opposite / sum;
        let others: Vec<_> = seen.into_iter().map(|seen| (weight(&seen), seen)).filter(|one| one.0 > 0.0).collect();
        let mean: Vector<f64, D> = others.iter().map(|(weight, seen)| seen.other.normal * *weight).sum();
        let normal = mean.try_normalize(0.0).unwrap_or(others[0].1.other.normal);
        let edges = [self.edge(place), others.iter().map(|(weight, seen)| weight * self.edge(seen.other)).sum()];
        Found { place, pair, others, normal, part: sum / all, edges }
    }

    /// How near a point is to a convex edge of its body: 1 at the edge, 0 from half a cell on.
    fn edge(&self, place: &Place<D>) -> f64 {
        *self.edges[place.number].get_or_init(|| self.find_edge(place))
    }

    fn find_edge(&self, place: &Place<D>) -> f64 {
        let [smooth, sharp] = EDGE;
        let of = |other: &Place<D>| {
            let apart = other.ends[0] - place.ends[0];
            if other.body != place.body || apart.dot(&place.normal) >= 0.0 {
                return 0.0;
            }
            let turn = ((smooth - other.normal.dot(&place.normal)) / (smooth - sharp)).clamp(0.0, 1.0);
            turn * (1.5 - 2.0 * apart.norm() / self.grid.spacing).clamp(0.0, 1.0)
        };
        self.around(place).map(of).fold(0.0, f64::max)
    }
}

/// How far two unit normals are opposite, from 0 to 1.
fn opposite<const D: usize>(one: &Vector<f64, D>, other: &Vector<f64, D>) -> f64 {
    let [begins, full] = OPPOSITE;
    ((one.dot(other) - begins) / (full - begins)).clamp(0.0, 1.0)
}

/// The closest points on all other bodies, of all points near them.
fn search<'a, const D: usize>(
    places: &'a [Place<D>],
    between: &BodyContact<D>,
    grid: &'a Grid<D>,
) -> Vec<Found<'a, D>> {
    let pairs: FxHashMap<[u32; 2], usize> =
        between.pairs.iter().zip(0..).map(|(pair, number)| (pair.bodies, number)).collect();
    let pair = |one: &Place<D>, other: u32| pairs.get(&[one.body.min(other), one.body.max(other)]).copied();
    let boxes = boxes(places, f64::from(REACH) * grid.spacing);
    let is_near = |place: &&Place<D>| {
        let mut others = boxes.iter().filter(|(body, _)| pair(place, **body).is_some());
        others.any(|(_, [low, high])| (0..D).all(|k| low[k] <= place.ends[0][k] && place.ends[0][k] <= high[k]))
    };
    let in_reach: Vec<&Place<D>> = places.iter().filter(is_near).collect();
    let unknown = || vec![OnceLock::new(); places.len()];
    let mut near = Near { grid, cells: FxHashMap::default(), deepest: unknown(), edges: unknown() };
    for &place in &in_reach {
        if let Some(cell) = grid.cell(&place.ends[0]) {
            near.cells.entry(grid.id(cell)).or_default().push(place);
        }
    }
    parallel::list_by(POINTS, in_reach.len(), |number, found| {
        let place = in_reach[number];
        let mut of_pairs: BTreeMap<usize, Vec<Seen<'a, D>>> = BTreeMap::new();
        for other in near.around(place) {
            if let Some((pair, seen)) = pair(place, other.body).zip(near.seen(place, other)) {
                of_pairs.entry(pair).or_default().push(seen);
            }
        }
        found.extend(of_pairs.into_iter().map(|(pair, seen)| near.closest(place, pair, seen)));
    })
}

/// The points of all surfaces. `ends` are the positions of a point at both ends of the step.
fn places<const D: usize>(
    contacts: &Contacts<D>,
    particles: &Particles<D>,
    ends: impl Fn(usize) -> [Vector<f64, D>; 2] + Sync,
) -> Vec<Place<D>> {
    let place = |number: usize| {
        let point = &contacts.points[number];
        let p = point.particle;
        let f = identity::<f64, D>() + particles.displacement_gradient[p];
        let area = cofactor(&f) * point.normal;
        let stretch = area.norm();
        let half = match D {
            1 => f64::INFINITY,
            _ => 0.5 * (stretch * point.halved_area()).powf(1.0 / (D - 1) as f64),
        };
        let back = (identity::<f64, D>() + particles.reference().displacement_gradient(p)) * inverse(&f);
        Place { number, body: particles.body[p], ends: ends(number), normal: area / stretch, half, back }
    };
    parallel::values_by(POINTS, contacts.points.len(), place)
}

/// The bounding box of the surface of each body at t_n, enlarged on all sides.
fn boxes<const D: usize>(places: &[Place<D>], by: f64) -> BTreeMap<u32, [Vector<f64, D>; 2]> {
    let mut boxes: BTreeMap<u32, [Vector<f64, D>; 2]> = BTreeMap::new();
    for place in places {
        let around = [place.ends[0].add_scalar(-by), place.ends[0].add_scalar(by)];
        let [low, high] = boxes.entry(place.body).or_insert(around);
        (*low, *high) = (low.inf(&around[0]), high.sup(&around[1]));
    }
    boxes
}

impl<const D: usize> Place<D> {
    /// The extent of the piece of surface. A square reaches farther along its diagonal.
    fn extent(&self) -> f64 {
        EXTENT * self.half * ((D.max(2) - 1) as f64).sqrt()
    }

    /// The position of another point relative to this one, at both ends of the step.
    fn apart(&self, other: &Self) -> [Vector<f64, D>; 2] {
        std::array::from_fn(|end| other.ends[end] - self.ends[end])
    }

    /// Whether the normal through a place, relative to the point, meets the piece of surface.
    fn is_below(&self, apart: &Vector<f64, D>) -> bool {
        (apart - self.normal * self.normal.dot(apart)).norm() <= self.extent()
    }
}

impl<'a, const D: usize> Found<'a, D> {
    /// Σ w x, for a vector x of every point.
    fn mean(&self, x: impl Fn(&Seen<'a, D>) -> Vector<f64, D>) -> Vector<f64, D> {
        self.others.iter().map(|(weight, seen)| x(seen) * *weight).sum()
    }

    /// g at an end of the step.
    fn gap(&self, end: usize) -> f64 {
        let of = |(weight, seen): &(f64, Seen<'a, D>)| weight * (self.normal + seen.other.normal).dot(&seen.apart[end]);
        0.5 * self.others.iter().map(of).sum::<f64>()
    }

    fn path(&self) -> Path {
        let starts_beside = self.others.iter().all(|(_, seen)| !seen.other.is_below(&seen.apart[0]));
        let depth = [if starts_beside { 0.0 } else { -self.gap(0) }, -self.gap(1)];
        let deepest = self.others.iter().map(|(_, seen)| seen.deepest).fold(f64::INFINITY, f64::min);
        // Near an edge, the far side is near everywhere.
        let deepest = deepest / (1.0 - self.edges[1]).max(0.0);
        Path { number: self.place.number, pair: self.pair, depth, deepest }
    }

    /// The candidate for the coming step. The closest point lies on the plane with the normal n̄ at t_{n+1}.
    fn candidate(self, between: &BodyContact<D>) -> Candidate<D> {
        let Self { place, pair, normal, .. } = self;
        let closest = place.ends[1] - normal * self.gap(1);
        let start = place.ends[0] - closest + self.mean(|seen| seen.other.ends[1] - seen.other.ends[0]);
        let share = |(share, Seen { other, .. }): &(f64, Seen<'a, D>)| {
            let offset = other.back * (closest - other.ends[1]);
            Share { number: other.number, share: *share, offset }
        };
        let slip = between.slip(place.number, pair);
        // The surface has turned since. A slip turns with it, and keeps its length.
        let along = slip - normal * normal.dot(&slip);
        let slip = along.try_normalize(0.0).map_or_else(Vector::zeros, |along| along * slip.norm());
        Candidate {
            number: place.number,
            pair,
            part: self.part,
            edges: self.edges,
            is_first: between.pairs[pair].bodies[0] == place.body,
            normal,
            start,
            slip,
            closest: self.others.iter().map(share).collect(),
        }
    }
}
