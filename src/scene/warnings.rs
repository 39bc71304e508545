//! Warnings, with numbers, about scenes that run but may be wrong. `bfree check` and the start of a run print these warnings.

use super::obstacle::too_stiff;
use super::shape::Shape as Drawn;
use super::time::word;
use super::{BodyUse, Scene};
use crate::grid::{Grid, indices};
use crate::material::{Law, Material, poissons_ratio};
use crate::mechanics::loads::{Obstacle, SurfaceLoad};
use crate::shape::{EDGE, Fill, GridBox, Shape, around};
use crate::simulation::Simulation;
use crate::tensor::{Deformation, Tensor, Vector};
use std::collections::BTreeSet;

/// Distance, relative to the spacing, below which two particles coincide.
const COINCIDENT: f64 = 1e-6;

/// Maximum number of coincident positions in the message.
const MAX_NAMED: usize = 3;

/// Volume difference between a body and its shape, relative to the shape, above which a warning is given. Weight, momentum and energies
/// have the same relative error. The limit is twice the error of the accuracy `"standard"`; with `fill: "cut"` the difference is 1e-4.
const MAX_VOLUME_ERROR: f64 = 0.01;

/// Uncertainty of the volume in a cell with curved surfaces, relative to the cell.
const VOLUME_UNCERTAINTY: f64 = 1e-3;

/// Minimum number of cells across a body for correct bending and compression.
const MIN_CELLS_ACROSS: f64 = 2.0;

/// Tolerance of the estimated thickness, which is twice a depth of particles that need not lie in the middle. With this tolerance, a body
/// of two cells gets no warning.
const THICKNESS_TOLERANCE: f64 = 0.95;

/// The largest distance of points of surfaces, in spacings.
const MOST_APART: f64 = 0.5;

/// Poisson's ratio from which on a body with pointwise dilatation is said to lock.
const LOCKING_POISSON: f64 = 0.45;

/// The built bodies of a scene.
struct Bodies<'a, const D: usize> {
    simulation: &'a Simulation<D>,
    shapes: Vec<Option<Shape<D>>>,
    /// Indices of the particles with a volume, for each body.
    particles: Vec<Vec<usize>>,
}

impl Scene {
    /// Warnings about a simulation of this scene: overlapping bodies, coincident particles, locking, prescribed regions without nodes, narrow
    /// obstacles, and tractions on surfaces of pixels. Further warnings are about bodies too thin for the grid, or with another volume than their shape.
    /// The thickness of a union is that of one part.
    ///
    /// ```
    /// // Two discs of radius 1, apart; and moved by 3, so that one lies partly in the other.
    /// for (x, overlap) in [(3, false), (6, true)] {
    ///     let moved = format!("bodies[0].shape.ball.center=[{x}, 2.25]").parse()?;
    ///     let scene = bfree::scene::read_file("scenes/collision.json".as_ref(), &[moved])?;
    ///     let warnings = scene.warnings(&scene.build::<2>("scenes".as_ref())?);
    ///     assert_eq!(warnings.iter().any(|text| text.contains("overlap")), overlap);
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn warnings<const D: usize>(&self, simulation: &Simulation<D>) -> Vec<String> {
        let mut particles = vec![Vec::new(); self.bodies.len()];
        for p in (0..simulation.particles.len()).filter(|&p| simulation.particles.is_solid(p)) {
            if let Some(own) = particles.get_mut(simulation.particles.body[p] as usize) {
                own.push(p);
            }
        }
        let shapes = self.bodies.iter().map(|body| body.shape.as_ref().and_then(Drawn::build)).collect();
        let bodies = Bodies { simulation, shapes, particles };
        let numbers = 0..self.bodies.len();
        let pairs = numbers.clone().flat_map(|b| (0..b).map(move |a| (a, b)));
        let mut all: Vec<String> = pairs.filter_map(|(a, b)| bodies.overlap(a, b)).collect();
        all.extend(self.deprecated_keys());
        all.extend(bodies.coincident());
        all.extend(numbers.clone().filter_map(|body| bodies.thin(body)));
        all.extend(numbers.filter_map(|body| bodies.locks(body)));
        if self.bodies.iter().any(|body| body.fill != Fill::Cut) {
            let filled = self.filled(simulation).into_iter().enumerate();
            let filled = filled.filter(|(number, _)| self.bodies[*number].fill != Fill::Cut);
            all.extend(filled.filter_map(|(number, body)| volume_differs(number, &body)));
        }
        let grid = &simulation.grid;
        let prescribed = self.prescribed.iter().filter_map(|prescribed| prescribed.region.build());
        all.extend(without_nodes(grid, "prescribed", prescribed));
        let initial = self.initial_velocity.iter().flat_map(|initial| &initial.nodes);
        all.extend(without_nodes(grid, "initial_velocity.nodes", initial.filter_map(|node| node.region.build())));
        all.extend(self.contact.as_ref().and_then(|contact| too_stiff("contact", contact.stiffness)));
        let moving = simulation.loads.contacts.obstacles.iter().map(Obstacle::moves);
        all.extend(self.obstacles.iter().zip(moving).enumerate().filter_map(|(i, (obstacle, moves))| {
            let shape = obstacle.shape.build()?;
            let path = format!("obstacles[{i}]");
            obstacle.warning(&path, !moves && apart(grid, &shape)).or_else(|| narrow(&path, &shape, grid.spacing))
        }));
        all.extend(seam(&simulation.loads.contacts.obstacles, grid.spacing));
        let loaded = self.tractions.iter().zip(&simulation.loads.surface).enumerate();
        all.extend(loaded.filter_map(|(i, (traction, load))| {
            let body = self.bodies.iter().find(|body| body.name == traction.body)?;
            let pixels = traction.surface.is_none() && body.shape.as_ref()?.has_pixels();
            staircase(i, load).filter(|_| pixels)
        }));
        all
    }

    /// Notes on given keys that the next release refuses.
    fn deprecated_keys(&self) -> impl Iterator<Item = String> {
        let ghost_stiffness = self.ghost_stiffness.map(|factor| {
            let is = self.aggregates();
            format!(
                "ghost_stiffness = {factor} is no longer used: aggregation has replaced it, and is {is} here. Remove"
            )
        });
        let precision = self.solver.krylov.precision.map(|_| {
            "solver.krylov.precision is no longer used: all linear systems are solved in double precision. Remove"
                .into()
        });
        let inertia = self.time.inertia.map(|_| {
            let scheme = word(self.time.scheme());
            format!("time.inertia is now called time.scheme, which is {scheme} here. Rename")
        });
        let renewed = self.grid.renewed.map(|_| "grid.renewed is now called grid.reset. Rename".into());
        let notes = [ghost_stiffness, precision, inertia, renewed].into_iter().flatten();
        notes.map(|note| format!("{note} the key; the next release refuses it"))
    }
}

/// Whether a shape lies outside the grid's box.
fn apart<const D: usize>(grid: &Grid<D>, shape: &Shape<D>) -> bool {
    let ((min, max), end) = (shape.bounding_box(), grid.position(grid.cells));
    (0..D).any(|k| max[k] < grid.origin[k] || min[k] > end[k])
}

/// Warns of an obstacle that is narrower than the distance of surface points.
fn narrow<const D: usize>(path: &str, shape: &Shape<D>, spacing: f64) -> Option<String> {
    let ((min, max), apart) = (shape.bounding_box(), MOST_APART * spacing);
    let width = (0..D).map(|k| max[k] - min[k]).fold(f64::INFINITY, f64::min);
    (width < apart).then(|| {
        format!(
            "{path} is {width:.3e} wide, and points of surfaces are up to {apart:.3e} apart: an end or a corner of it between two points is not \
             felt, and the run ends where a body presses it by half of its width; make it wider, or lower grid.spacing"
        )
    })
}

/// Warns of two parts of a union, or of two obstacles at rest, that touch along a face.
fn seam<const D: usize>(obstacles: &[Obstacle<D>], spacing: f64) -> Option<String> {
    let mut parts = Vec::new();
    for (number, obstacle) in obstacles.iter().enumerate() {
        parts.extend(obstacle.shape.united().iter().map(|part| (number, part)));
    }
    for (i, (one, of_one)) in parts.iter().enumerate() {
        for (other, of_other) in &parts[i + 1..] {
            let rest = [one, other].iter().all(|&&number| !obstacles[number].moves());
            if (one == other || rest)
                && let Some(x) = common_face(of_one, of_other, spacing)
            {
                let names = [one, other].map(|&number| &obstacles[number].name);
                let whose = if one == other {
                    format!("parts of obstacle {:?}", names[0])
                } else {
                    format!("obstacles {names:?}")
                };
                return Some(format!(
                    "{whose} touch along a face at {:?}: a point of a body near this seam is pushed sideways; make them one union whose parts \
                     overlap by half of grid.spacing or more",
                    x.as_slice()
                ));
            }
        }
    }
    None
}

/// The middle of the face along which two solids touch without overlap. Both surfaces pass through the middle of the face that their boxes have in
/// common, and through a place beside it.
fn common_face<const D: usize>(one: &Shape<D>, other: &Shape<D>, spacing: f64) -> Option<Vector<f64, D>> {
    let [(a, b), (c, d)] = [one, other].map(Shape::bounding_box);
    let (low, high) = (a.sup(&c), b.inf(&d));
    let round_off = EDGE * spacing;
    let flat = (0..D).filter(|&k| (high[k] - low[k]).abs() <= round_off).count();
    let meets = (0..D).all(|k| high[k] >= low[k] - round_off);
    let at = |part: f64| low + (high - low) * part;
    let on_both = |x: Vector<f64, D>| [one, other].iter().all(|shape| shape.signed_distance(&x).abs() <= round_off);
    (flat == 1 && meets && on_both(at(0.5)) && on_both(at(0.3))).then(|| at(0.5))
}

impl<const D: usize> Bodies<'_, D> {
    /// Particles of `body` that lie in the shape of `other`.
    fn inside(&self, body: usize, other: usize) -> Vec<usize> {
        let Some(shape) = &self.shapes[other] else { return Vec::new() };
        let (min, max) = shape.bounding_box();
        let own = self.shapes[body].as_ref().map(Shape::bounding_box);
        if own.is_some_and(|(own_min, own_max)| (0..D).any(|k| own_max[k] <= min[k] || own_min[k] >= max[k])) {
            return Vec::new();
        }
        let round_off = EDGE * self.simulation.grid.spacing;
        let position = &self.simulation.particles.position;
        let near = |x: &Vector<f64, D>| (0..D).all(|k| x[k] > min[k] && x[k] < max[k]);
        let inside = |p: &usize| near(&position[*p]) && shape.signed_distance(&position[*p]) < -round_off;
        self.particles[body].iter().copied().filter(inside).collect()
    }

    /// Warns of two overlapping bodies. The volume of two shapes is that of their intersection in the cells of the overlapping particles.
    /// Particle positions alone do not suffice: the centroid of a part of a box may lie outside that part.
    fn overlap(&self, a: usize, b: usize) -> Option<String> {
        let (grid, particles) = (&self.simulation.grid, &self.simulation.particles);
        let found = [self.inside(a, b), self.inside(b, a)].concat();
        let cells: BTreeSet<_> = found.iter().filter_map(|&p| grid.cell(&particles.position[p])).collect();
        let volume: f64 = match (&self.shapes[a], &self.shapes[b]) {
            (Some(one), Some(other)) => {
                let common = Shape::intersection(vec![one.clone(), other.clone()]);
                cells.iter().map(|&cell| common.part(&GridBox::cell(grid, cell)).0).sum()
            }
            _ => found.iter().map(|&p| particles.volume[p]).sum(),
        };
        let [a, b] = [a, b].map(|body| &self.simulation.bodies[body].name);
        (volume > VOLUME_UNCERTAINTY * cells.len() as f64 * grid.spacing.powi(D as i32)).then(|| {
            format!(
                "bodies {a:?} and {b:?} overlap: {} particles of one lie in the other, in a volume of {volume:.4e}; there they move as \
                 one, with the mass and the stiffness of both",
                found.len()
            )
        })
    }

    /// Warns of coincident particles.
    fn coincident(&self) -> Option<String> {
        let (grid, position) = (&self.simulation.grid, &self.simulation.particles.position);
        let key = |p: usize| (position[p] - grid.origin).map(|x| (x / (COINCIDENT * grid.spacing)).round() as i64);
        let keys = self.particles.iter().flatten().map(|&p| (<[i64; D]>::from(key(p)), p));
        let mut keys: Vec<_> = keys.collect();
        keys.sort_unstable();
        let same: Vec<usize> = keys.windows(2).filter(|pair| pair[0].0 == pair[1].0).map(|pair| pair[1].1).collect();
        let place = |p: &usize| {
            let place: Vec<String> = position[*p].iter().map(ToString::to_string).collect();
            format!("({})", place.join(", "))
        };
        let places = same.iter().take(MAX_NAMED).map(place).collect::<Vec<_>>().join(", ");
        let more = if same.len() > MAX_NAMED { ", …" } else { "" };
        (!same.is_empty()).then(|| {
            format!("{} particles lie at the place of another one: at {places}{more}; they move as one", same.len())
        })
    }

    /// Warns of a body thinner than two cells. The thickness is twice the greatest depth of a particle plus the width of that particle.
    /// Without a shape, the thickness is the smallest extent of the body.
    fn thin(&self, body: usize) -> Option<String> {
        let (own, particles, h) = (&self.particles[body], &self.simulation.particles, self.simulation.grid.spacing);
        let width = |p: usize| particles.volume[p].powf(1.0 / D as f64);
        let enough = MIN_CELLS_ACROSS * h * THICKNESS_TOLERANCE;
        let mut across: f64 = 0.0;
        if let Some(shape) = &self.shapes[body] {
            // The loop starts in the middle of the list, because the first particles lie at the surface.
            let (first, last) = own.split_at(own.len() / 2);
            for &p in last.iter().chain(first) {
                across = across.max(width(p) - 2.0 * shape.signed_distance(&particles.position[p]));
                if across >= enough {
                    return None;
                }
            }
        } else {
            let extent = |k: usize| {
                let along = || own.iter().map(|&p| particles.position[p][k]);
                along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
            };
            across = (0..D).map(extent).fold(f64::INFINITY, f64::min) + own.first().map(|&p| width(p))?;
        }
        let (name, cells) = (&self.simulation.bodies[body].name, across / h);
        (across < enough).then(|| {
            format!(
                "body {name:?} is about {across:.3e} thick where it is thickest, {cells:.2} cells; from {MIN_CELLS_ACROSS} on it bends and \
                 presses as it should: lower grid.spacing"
            )
        })
    }

    /// Warns of a body that may lock: its law is nearly incompressible or has isochoric plastic flow, and its dilatation is pointwise. In
    /// uniaxial strain nothing locks.
    fn locks(&self, number: usize) -> Option<String> {
        let body = self.simulation.bodies.get(number).filter(|body| D > 1 && !body.averages())?;
        // The tolerance covers the round-off of a given ν = 0.45.
        let (poisson, flows) = (poissons_ratio(&body.law), matches!(body.law, Material::VonMises(_)));
        if poisson < LOCKING_POISSON - 1e-9 && !flows {
            return None;
        }
        let why = if flows { "flows without a change of volume" } else { "hardly changes its volume" };
        let cure = if body.law.volumetric(&Deformation::new(Tensor::<f64, 1>::zeros())).is_some() {
            format!("bodies[{number}].volumetric = \"mean_dilatation\" cures it")
        } else {
            "its law knows no \"volumetric\": \"mean_dilatation\"; take \"neo_hookean\" with that, or a finer grid"
                .into()
        };
        let name = &self.simulation.bodies[number].name;
        Some(format!(
            "body {name:?} {why} (Poisson's ratio {poisson:.6}), and its change of volume is not averaged: it may lock, too stiff by some \
             percent or by a half, with wrong pressures; {cure}"
        ))
    }
}

/// Warns of a body whose volume, and thus mass, differs from that of its shape.
fn volume_differs(number: usize, body: &BodyUse) -> Option<String> {
    let BodyUse { name, volume, drawn, .. } = body;
    let drawn = drawn.filter(|drawn| (volume / drawn - 1.0).abs() > MAX_VOLUME_ERROR)?;
    Some(format!(
        "body {name:?} has the volume {volume:.6}, and its shape {drawn:.6}: its mass is {:+.1} % off; bodies[{number}].fill \"cut\" \
         makes them equal",
        100.0 * (volume / drawn - 1.0)
    ))
}

/// Warns of regions without nodes.
fn without_nodes<const D: usize>(grid: &Grid<D>, list: &str, regions: impl Iterator<Item = Shape<D>>) -> Vec<String> {
    let all = regions.enumerate().filter_map(|(i, region)| {
        let (first, count) = around(grid, &region);
        let at = |index: [u64; D]| grid.position(std::array::from_fn(|k| (first[k] + index[k]) as u32));
        let cure = if count.contains(&0) {
            "it lies outside of the grid"
        } else if !indices(count.map(|cells| cells + 1)).any(|index| region.holds(&at(index), grid.spacing)) {
            "make it larger, by up to grid.spacing"
        } else {
            return None;
        };
        Some(format!("{list}[{i}].region holds no node of the grid, and so nothing: {cure}"))
    });
    all.collect()
}

/// Warns of a traction on sides of pixels with more than one normal.
fn staircase<const D: usize>(i: usize, load: &SurfaceLoad<D>) -> Option<String> {
    let area: f64 = load.points.iter().map(|point| point.area).sum();
    let flat = load.points.iter().map(|point| point.normal * point.area).sum::<Vector<f64, D>>().amax();
    (flat < (1.0 - EDGE) * area).then(|| {
        format!(
            "tractions[{i}] acts on a staircase of pixels: its area of {area:.4e} is up to {:.2} times that of the smooth surface, and so \
             is the force; a pressure has the right resultant",
            (D as f64).sqrt()
        )
    })
}
