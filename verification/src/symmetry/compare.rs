//! Runs two scenes that must agree, and compares them. Differences are measured in round-off times the condition of the problem.
//!
//! Positions and deformation gradients are known to round-off, and so are all results of a step. Therefore the condition of the problem is
//! measured. The scene runs again with random perturbations of positions and deformation gradients: δ = √ε, relative to the size of
//! coordinates and to 1. Each difference of the answers over δ gives the amplification of round-off. Where round-off decides, the answer
//! jumps; such a jump raises the bound to a value 1/√ε ≈ 7e7 times smaller than the jump.
//!
//! Sums have another order in the image, so Newton's method ends elsewhere within its tolerance. The size of this difference is measured
//! with the scene itself, by solving its linear systems less accurately.

use super::scene::{FACES, Scene};
use super::transform::{Map, Pair};
use crate::random::Random;
use bfree::scene;
use bfree::simulation::Simulation;
use bfree::tensor::{Tensor, Vector};
use std::collections::BTreeMap;
use std::path::Path;

/// The relative size of perturbations, √ε: the answer is linear in it, and it is far above round-off.
const PERTURBATION: f64 = 1.490_116_119_384_765_6e-8;

/// The number of random perturbations; the largest effect counts.
const PERTURBED: u64 = 2;

/// Roundings between the state and the answer of a step, each as large as the last bit. There are about sixteen nodes per particle and four
/// particles per cell, and Newton's method ends at sixteen times the round-off of its residual.
const ROUNDINGS: f64 = 128.0;

/// The factor on the tolerance of the linear systems, which shows the error that Newton's method leaves.
const LESS_FAR: f64 = 30.0;

/// The difference of two solutions is one sample of the error that Newton's method leaves; another sample may be larger by this factor.
const SOLVED: f64 = 16.0;

/// The speed of pressure waves, in plain units. A strain of size 1 corresponds to this speed.
const SOUND: f64 = 36.7;

/// Corresponding particles lie nearer to each other than this, in spacings.
const SAME: f64 = 1e-3;

/// The agreement of two scenes in one quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disagreement {
    /// The compared quantity.
    pub quantity: &'static str,
    /// The largest difference, over the size of the quantity.
    pub difference: f64,
    /// Round-off times the condition, over the same size.
    pub bound: f64,
}

impl Disagreement {
    /// The used share of the bound; infinite for NaN.
    pub fn used(&self) -> f64 {
        let used = if self.difference == 0.0 { 0.0 } else { self.difference / self.bound };
        if used.is_nan() { f64::INFINITY } else { used }
    }
}

/// The reasons why two scenes could not be compared.
#[derive(Debug, thiserror::Error)]
pub enum SymmetryError {
    /// The first scene, or a perturbed copy of it, cannot be run, so there is nothing to compare: draw another one.
    #[error("the scene cannot be run")]
    Scene(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// The first scene and its perturbed copies can be run, but its image cannot.
    #[error("the scene can be run, and its image cannot")]
    Image(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// The first scene can be run, but neither its image nor a perturbed copy: the load is near the largest that the body bears, and a
    /// perturbation decides whether Newton's method finds an equilibrium.
    #[error("the scene can be run, and neither its image nor a perturbed copy can")]
    Unstable(#[source] Box<dyn std::error::Error + Send + Sync>),
}

/// The end state of a scene, in plain units, particle by particle.
struct Answer {
    start: Vec<[f64; 2]>,
    volume: Vec<f64>,
    position: Vec<[f64; 2]>,
    velocity: Vec<[f64; 2]>,
    gradient: Vec<[[f64; 2]; 2]>,
    /// Strain, kinetic, external work, dissipated.
    energies: [f64; 4],
    reactions: BTreeMap<String, [f64; 2]>,
}

/// Runs both scenes and returns the difference in each quantity. The initial positions identify the particles of both scenes.
///
/// # Errors
/// See [`SymmetryError`].
pub fn compare(pair: &Pair) -> Result<Vec<Disagreement>, SymmetryError> {
    let [scene, image] = &pair.scenes;
    let one = answer(scene, None).map_err(SymmetryError::Scene)?;
    let other = answer(image, None).map_err(|error| {
        let is_unstable = (0..PERTURBED).any(|seed| answer(scene, Some(seed)).is_err());
        if is_unstable { SymmetryError::Unstable(error) } else { SymmetryError::Image(error) }
    })?;
    let Some(places) = matched(&one, &other, &pair.map, scene.spacing) else {
        return Ok(vec![Disagreement { quantity: "places of particles", difference: f64::INFINITY, bound: 1.0 }]);
    };
    let apart = differences(&one, &other, &places, pair);
    if pair.bits {
        let exact = |(quantity, difference, _)| Disagreement { quantity, difference, bound: 0.0 };
        return Ok(apart.into_iter().map(exact).collect());
    }
    let itself = Pair { scenes: [scene.clone(), scene.clone()], map: Map::SAME, times: 1.0, bits: false };
    let identity: Vec<Vec<usize>> = (0..one.start.len()).map(|p| vec![p]).collect();
    let mut condition = vec![0.0_f64; apart.len()];
    for seed in 0..PERTURBED {
        let perturbed = answer(scene, Some(seed)).map_err(SymmetryError::Scene)?;
        let moved = differences(&one, &perturbed, &identity, &itself);
        for (condition, (_, difference, _)) in condition.iter_mut().zip(moved) {
            *condition = condition.max(difference / PERTURBATION);
        }
    }
    let otherwise = Scene { forcing: LESS_FAR * scene.forcing, ..scene.clone() };
    let solved = answer(&otherwise, None).map_err(SymmetryError::Scene)?;
    let left = differences(&one, &solved, &identity, &itself).into_iter().map(|(_, difference, _)| difference);
    let judged = |(((quantity, difference, size), condition), left): (((&'static str, f64, f64), f64), f64)| {
        let bound = ROUNDINGS * f64::EPSILON * (size + condition) + SOLVED * left;
        let size = if size > 0.0 { size } else { 1.0 };
        Disagreement { quantity, difference: difference / size, bound: bound / size }
    };
    Ok(apart.into_iter().zip(condition).zip(left).map(judged).collect())
}

fn answer(scene: &Scene, seed: Option<u64>) -> Result<Answer, Box<dyn std::error::Error + Send + Sync>> {
    if scene.slab { run::<3>(scene, seed) } else { run::<2>(scene, seed) }
}

fn in_plane<const D: usize>(x: &Vector<f64, D>, unit: f64) -> [f64; 2] {
    [x[0] / unit, x[1] / unit]
}

fn run<const D: usize>(scene: &Scene, seed: Option<u64>) -> Result<Answer, Box<dyn std::error::Error + Send + Sync>> {
    let mut simulation: Simulation<D> = scene::read(&scene.json().to_string(), &[])?.build(Path::new("."))?;
    let units = scene.units;
    let start = simulation.particles.by_id();
    if let Some(seed) = seed {
        perturb(&mut simulation, &mut Random::new(seed));
    }
    let mut reactions = BTreeMap::new();
    while simulation.clock.nominal_steps() < u64::from(scene.steps) {
        let report = simulation.advance()?;
        for (condition, reaction) in simulation.loads.prescribed.iter().zip(&report.reactions) {
            reactions.insert(condition.name.clone(), in_plane(&reaction.force, units.force(scene.dimension())));
        }
    }
    let end = simulation.particles.by_id();
    let energies = [simulation.strain_energy(), end.kinetic_energy(), simulation.external_work, simulation.dissipated];
    let gradient = |h: &Tensor<f64, D>| [[h[(0, 0)], h[(0, 1)]], [h[(1, 0)], h[(1, 1)]]];
    let inertia = !end.velocity.is_empty();
    Ok(Answer {
        start: start.position.iter().map(|x| in_plane(x, units.length)).collect(),
        volume: start.volume.iter().map(|v| v / units.length.powi(scene.dimension())).collect(),
        position: end.position.iter().map(|x| in_plane(x, units.length)).collect(),
        velocity: if inertia {
            end.velocity.iter().map(|v| in_plane(v, units.velocity())).collect()
        } else {
            vec![[0.0; 2]; end.len()]
        },
        gradient: end.displacement_gradient.iter().map(gradient).collect(),
        energies: energies.map(|energy| energy / units.energy(scene.dimension())),
        reactions,
    })
}

/// Perturbs positions by δ times the size of coordinates, and deformation gradients by δ.
fn perturb<const D: usize>(simulation: &mut Simulation<D>, random: &mut Random) {
    let particles = &mut simulation.particles;
    let size = particles.position.iter().map(Vector::amax).fold(0.0, f64::max);
    for x in &mut particles.position {
        *x += random.vector() * (PERTURBATION * size);
    }
    for h in &mut particles.displacement_gradient {
        *h += random.tensor() * PERTURBATION;
    }
}

/// The particles of the image for each particle: one, or the layers of a slab; `None` if a particle has no image.
fn matched(one: &Answer, other: &Answer, map: &Map, spacing: f64) -> Option<Vec<Vec<usize>>> {
    let near = |x: &[f64; 2]| {
        let image = map.point(*x);
        let same = |q: &usize| {
            let y = other.start[*q];
            (y[0] - image[0]).hypot(y[1] - image[1]) < SAME * spacing
        };
        let found: Vec<usize> = (0..other.start.len()).filter(same).collect();
        (!found.is_empty()).then_some(found)
    };
    one.start.iter().map(near).collect()
}

/// Each quantity with its largest difference and its size.
fn differences(one: &Answer, other: &Answer, places: &[Vec<usize>], pair: &Pair) -> Vec<(&'static str, f64, f64)> {
    let map = &pair.map;
    let mut largest = [0.0_f64; 5];
    let note = |worst: &mut f64, x: f64| *worst = if x.is_nan() { f64::NAN } else { worst.max(x) };
    let apart = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    for (p, images) in places.iter().enumerate() {
        let gradient = one.gradient[p];
        let turned: [[f64; 2]; 2] = std::array::from_fn(|i| {
            std::array::from_fn(|k| map.signs[i] * map.signs[k] * gradient[map.axes[i]][map.axes[k]])
        });
        let share = if pair.scenes[1].slab { pair.times / images.len() as f64 } else { 1.0 };
        for &q in images {
            note(&mut largest[0], apart(map.point(one.start[p]), other.start[q]));
            note(&mut largest[1], (one.volume[p] * share - other.volume[q]).abs());
            note(&mut largest[2], apart(map.point(one.position[p]), other.position[q]));
            note(&mut largest[3], apart(map.vector(one.velocity[p]), other.velocity[q]));
            let rows = [0, 1].map(|i| apart(turned[i], other.gradient[q][i]));
            note(&mut largest[4], rows[0].hypot(rows[1]));
        }
    }
    let sizes = |list: &[[f64; 2]]| list.iter().map(|x| x[0].hypot(x[1])).fold(0.0, f64::max);
    let place = sizes(&one.start).max(sizes(&other.start));
    let volume = one.volume.iter().copied().fold(0.0, f64::max);
    let speed = sizes(&one.velocity);
    let mut all = vec![
        ("places at the start", largest[0], place),
        ("volumes at the start", largest[1], volume),
        ("positions", largest[2], place),
        ("velocities", largest[3], speed.max(SOUND)),
        ("deformation gradients", largest[4], 1.0),
    ];
    let energy: f64 = one.energies.iter().map(|energy| energy.abs() * pair.times).sum();
    let names = ["strain energy", "kinetic energy", "external work", "dissipated energy"];
    for (k, name) in names.into_iter().enumerate() {
        all.push((name, (one.energies[k] * pair.times - other.energies[k]).abs(), energy));
    }
    all.push(reactions(one, other, pair));
    all
}

/// The reactions of the faces that both scenes hold.
fn reactions(one: &Answer, other: &Answer, pair: &Pair) -> (&'static str, f64, f64) {
    let (mut difference, mut size) = (0.0_f64, 0.0_f64);
    for face in 0..4 {
        let (here, there) = (one.reactions.get(FACES[face]), other.reactions.get(FACES[pair.map.face(face)]));
        let (Some(here), Some(there)) = (here, there) else { continue };
        let mut expected = pair.map.vector(*here).map(|force| force * pair.times);
        if pair.scenes[1].cells[0] == 2 * pair.scenes[0].cells[0] {
            // The reactions of the two halves cancel across the plane.
            expected[0] = 0.0;
        }
        let apart = (expected[0] - there[0]).hypot(expected[1] - there[1]);
        difference = if apart.is_nan() { apart } else { difference.max(apart) };
        size = size.max(expected[0].hypot(expected[1]));
    }
    ("reactions", difference, size)
}
