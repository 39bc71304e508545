//! States and paths on which laws are checked: deterministic, from a seed.

use crate::convention::Tensor;
use crate::law::{CallFailed, Law};
pub use crate::random::Random;
use crate::roads::History;
use crate::tensor::{
    exponential, from_entries, logarithm, polar, product, product3, rotation_about, scaled, sum, transposed,
};

/// A path of deformation from rest, in steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// A name that a mechanician reads: "path 3 (simple shear, unloading)".
    pub name: String,
    /// F at the end of each step.
    pub gradients: Vec<Tensor>,
    /// The length Δt of each step.
    pub lengths: Vec<f64>,
}

impl Path {
    /// A path in steps of equal length.
    pub fn new(name: &str, gradients: Vec<Tensor>, length: f64) -> Self {
        let lengths = vec![length; gradients.len()];
        Self { name: name.to_string(), gradients, lengths }
    }

    /// The number of steps that have both F and Δt.
    pub fn steps(&self) -> usize {
        self.gradients.len().min(self.lengths.len())
    }

    /// The path with its logarithmic strains multiplied by a factor; the rotations R of F = V R stay. `None` unless each det F > 0.
    pub fn scaled(&self, factor: f64) -> Option<Self> {
        let scale = |gradient: &Tensor| {
            let (rotation, stretch) = polar(gradient)?;
            Some(product(&exponential(&scaled(factor, &logarithm(&stretch))), &rotation))
        };
        let gradients = self.gradients.iter().map(scale).collect::<Option<Vec<_>>>()?;
        Some(Self { name: self.name.clone(), gradients, lengths: self.lengths.clone() })
    }
}

/// How the amplitude goes along a path, from −1 to 1.
const PROGRAMMES: [(&str, &[f64]); 4] = [
    ("loading", &[0.4, 0.8, 1.0]),
    ("unloading", &[0.5, 1.0, 0.9, 0.6]),
    ("reloading", &[0.6, 1.0, 0.8, 1.1]),
    ("reversal", &[0.5, 1.0, 0.3, -0.5]),
];

/// The strain of a kind of deformation at an amplitude, from −1 to 1; ln J goes from ln ½ to ln 2 at most.
fn strain(kind: &str, amplitude: f64, size: f64, general: &Tensor, axes: &Tensor, plane: bool) -> Tensor {
    let deviatoric = scaled(amplitude * size, general);
    // The volume: ln J = 0.69 size/0.5 at the greatest amplitude, and a third of it in each direction (a half in the plane).
    let volume = amplitude * size * std::f64::consts::LN_2 / 0.5;
    let directions = if plane { 2.0 } else { 3.0 };
    let spherical =
        |share: f64| from_entries(|i, j| if i == j && !(plane && i == 2) { share * volume / directions } else { 0.0 });
    let aligned = match kind {
        "uniaxial" => from_entries(|i, j| if i == 0 && j == 0 { amplitude * size } else { 0.0 }),
        "simple shear" => from_entries(|i, j| if i + j == 1 { 0.5 * amplitude * size } else { 0.0 }),
        "hydrostatic" => spherical(1.0),
        "compression" => return sum(&deviatoric, 1.0, &spherical(-1.0)),
        _ => return sum(&deviatoric, 1.0, &spherical(0.9)),
    };
    product3(axes, &aligned, &transposed(axes))
}

/// The kinds of deformation, their greatest strain, and the programme of their amplitude.
const KINDS: [(&str, f64, usize); 12] = [
    ("general", 1e-6, 0),
    ("general", 1e-3, 1),
    ("general", 0.05, 3),
    ("general", 0.3, 2),
    ("general", 0.5, 0),
    ("compression", 0.02, 2),
    ("compression", 0.5, 1),
    ("uniaxial", 0.2, 1),
    ("simple shear", 0.3, 3),
    ("hydrostatic", 0.3, 3),
    ("uniaxial", 0.01, 2),
    ("simple shear", 0.005, 1),
];

/// Paths for any law: small to large strain (1e-6 to 0.5), J from 0.5 to 2, general and rotated, uniaxial, simple shear, hydrostatic;
/// loading, unloading, reloading and reversal in several steps of different lengths. The same seed gives the same paths.
pub fn paths(seed: u64, plane: bool) -> Vec<Path> {
    let mut random = Random::new(seed);
    let path = |index: usize, random: &mut Random| {
        let (kind, size, programme) = KINDS[index];
        let (words, amplitudes) = PROGRAMMES[programme];
        let general = random.isochoric(plane);
        let axes = random.rotation(plane);
        let spin: f64 = random.between(0.3, 1.0);
        let axis = [random.signed(), random.signed(), 1.0].map(|x| if plane { 0.0 } else { x });
        let mut gradients = Vec::new();
        let mut lengths = Vec::new();
        for (step, amplitude) in amplitudes.iter().enumerate() {
            // The body turns along the path, so that no step has F₀ and F₁ of the same rotation.
            let turn = spin * (step + 1) as f64 * if size < 1e-2 { 0.1 } else { 1.0 };
            let turn = rotation_about([axis[0] * turn, axis[1] * turn, turn]);
            let stretch = exponential(&strain(kind, *amplitude, size, &general, &axes, plane));
            gradients.push(product(&turn, &stretch));
            lengths.push(random.between(0.05, 0.6));
        }
        Path { name: format!("path {} ({kind} to {size}, {words})", index + 1), gradients, lengths }
    };
    (0..KINDS.len()).map(|index| path(index, &mut random)).collect()
}

/// Onsets are searched for up to this principal stretch.
const SEARCHED: f64 = 10.0;

/// From one amplitude of the search to the next.
const OUTWARD: f64 = 1.6;

/// The greatest number of onsets along one direction: a variable may begin to change long after another.
const ONSETS: usize = 3;

/// Paths before, at and after the amplitudes at which internal variables of a law begin to change, in three general directions; for
/// variables that rest in all of these, also in volume and in one axis. Each direction is followed outward until all variables have moved,
/// or to a stretch of ten. Internal variables that change in every step, such as elastic strains, do not count.
///
/// # Errors
/// The law does not answer a step of smallest strain.
pub fn yielding_paths(law: &mut dyn Law, seed: u64) -> Result<Vec<Path>, CallFailed> {
    let plane = law.convention().plane();
    let mut random = Random::new(seed ^ 0x5851_F42D_4C95_7F2D);
    let mut search = Search { resting: (0..law.state_at_rest().len()).collect(), paths: Vec::new() };
    let diagonal = |entries: [f64; 3]| from_entries(|i, j| if i == j && !(plane && i == 2) { entries[i] } else { 0.0 });
    for direction in 1..=3 {
        let general = random.isochoric(plane);
        let turn = random.rotation(plane);
        let dilation = random.between(-0.15, 0.15);
        let shape = sum(&general, 1.0, &diagonal([dilation; 3]));
        let all: Vec<usize> = (0..law.state_at_rest().len()).collect();
        search.along(law, (&shape, &turn), &all, &format!("yielding path {direction}"))?;
    }
    let more = [
        ("growth", [1.0; 3]),
        ("collapse", [-1.0; 3]),
        ("tension", [1.0, 0.0, 0.0]),
        ("compression", [-1.0, 0.0, 0.0]),
    ];
    for (name, strain) in more {
        let (turn, resting) = (random.rotation(plane), search.resting.clone());
        search.along(law, (&diagonal(strain), &turn), &resting, &format!("yielding path in {name}"))?;
    }
    Ok(search.paths)
}

/// The search for onsets.
struct Search {
    /// The internal variables that have not moved in any direction.
    resting: Vec<usize>,
    paths: Vec<Path>,
}

impl Search {
    /// Follows a direction outward from rest for the onsets of some variables, and adds paths about each.
    fn along(
        &mut self,
        law: &mut dyn Law,
        (shape, turn): (&Tensor, &Tensor),
        wanted: &[usize],
        name: &str,
    ) -> Result<(), CallFailed> {
        let unit = Path::new("", vec![product(&exponential(shape), turn)], 0.1);
        let rest = law.state_at_rest();
        let first = state_at(law, &unit, 1e-9)?;
        let still = |state: &[f64], k: usize| state.get(k) == rest.get(k);
        self.resting.retain(|k| still(&first, *k));
        let mut waiting: Vec<usize> = wanted.iter().copied().filter(|k| still(&first, *k)).collect();
        let [mut low, mut high] = [1e-9, 1e-6];
        for _ in 0..ONSETS {
            // A call that fails ends the search: the law is not made for such strains.
            let moved = loop {
                let Ok(state) = state_at(law, &unit, high) else { return Ok(()) };
                let moved: Vec<usize> = waiting.iter().copied().filter(|k| !still(&state, *k)).collect();
                if !moved.is_empty() || waiting.is_empty() || high >= SEARCHED.ln() {
                    break moved;
                }
                (low, high) = (high, (high * OUTWARD).min(SEARCHED.ln()));
            };
            let mut moves = |amplitude: f64| {
                state_at(law, &unit, amplitude).is_ok_and(|state| moved.iter().any(|k| !still(&state, *k)))
            };
            if moved.is_empty() {
                break;
            }
            let onset = bisected(&mut moves, low, high);
            let name = if low > 0.1 { format!("{name}, late at {:.2}", onset.exp()) } else { name.to_string() };
            self.paths.extend(around((shape, turn), onset, &name));
            self.resting.retain(|k| !moved.contains(k));
            waiting.retain(|k| !moved.contains(k));
        }
        Ok(())
    }
}

/// The least amplitude between two at which a law moves.
fn bisected(moves: &mut dyn FnMut(f64) -> bool, mut low: f64, mut high: f64) -> f64 {
    while high - low > 1e-13 * high {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if moves(middle) { high = middle } else { low = middle }
    }
    high
}

/// The internal variables after the first step of a path, scaled.
fn state_at(law: &mut dyn Law, path: &Path, amplitude: f64) -> Result<Vec<f64>, CallFailed> {
    let history = History::at_rest(law);
    let scaled = path.scaled(amplitude);
    let step = scaled.and_then(|path| history.step_to(path.gradients.first()?, *path.lengths.first()?));
    let step = step.ok_or_else(|| CallFailed("A path has no F with det F > 0.".to_string()))?;
    Ok(law.respond(&step)?.state)
}

/// Before, at and after yielding: below it, on both sides of it, and beyond it with unloading and reloading. Beyond a late onset, strains
/// grow by tenths.
fn around((shape, turn): (&Tensor, &Tensor), onset: f64, direction: &str) -> Vec<Path> {
    let beyond = onset.min(0.1);
    let amplitude = |factor: f64| match factor {
        factor if factor > 1.0 => onset + (factor - 1.0) * beyond,
        factor if factor < 0.0 => factor * beyond,
        factor => factor * onset,
    };
    let at = |factor: f64| product(&exponential(&scaled(amplitude(factor), shape)), turn);
    let path = |name: &str, factors: &[f64]| {
        let name = format!("{direction} ({name})");
        Path::new(&name, factors.iter().map(|factor| at(*factor)).collect(), 0.1)
    };
    vec![
        path("just below yielding", &[0.5, 1.0 - 1e-6]),
        path("at yielding", &[1.0]),
        path("just beyond yielding", &[1.0 + 1e-6]),
        path("yielding, unloading, reloading", &[1.1, 1.6, 3.0, 2.7, 3.5]),
        path("yielding, reversal", &[2.0, 0.9, -2.5]),
    ]
}

/// The paths for a law: general ones, and those about its yielding.
///
/// # Errors
/// The law does not answer a step of smallest strain.
pub fn for_law(law: &mut dyn Law, seed: u64) -> Result<Vec<Path>, CallFailed> {
    let mut all = paths(seed, law.convention().plane());
    all.extend(yielding_paths(law, seed)?);
    Ok(all)
}
