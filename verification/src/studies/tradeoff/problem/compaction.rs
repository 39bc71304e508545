//! The block compacted by its own weight (section 4.2), against a fine run on a grid that is kept.

use super::{LEVELS, Problem, steps, whole_steps};
use crate::studies::StudyError;
use crate::studies::tradeoff::cost::{Cost, drive};
use bfree::material::Lame;
use bfree::particles::Particles;
use bfree::scene::Scene;
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use serde_json::{Value, json};
use std::cell::RefCell;
use std::path::Path;

const LAME: Lame = Lame { lambda: 5e4, shear: 3e4 };
const DENSITY: f64 = 2700.0;
/// Times at which the displacements are compared.
const SAMPLES: u64 = 10;

/// cΔt over the spacing of the reference.
const FINE_COURANT: f64 = 0.5;

/// The error is the relative error of the displacement of all particles at ten times.
pub(in crate::studies::tradeoff) struct Compaction {
    pub end: f64,
    /// The particles of the reference at the start.
    start: Vec<Vector<f64, 2>>,
    /// The particles of the reference at the ten times.
    samples: Vec<Particles<2>>,
}

impl Compaction {
    /// The problem up to the time `end`. The reference has `cells`² cells, a grid that is kept, and a consistent mass.
    pub fn new(end: f64, cells: u32) -> Result<Self, StudyError> {
        let spacing = f64::from(cells).recip();
        let mut scene = scene();
        let step = whole_steps(end, FINE_COURANT * spacing / speed(), SAMPLES);
        scene["grid"]["spacing"] = spacing.into();
        scene["grid"]["reset"] = "never".into();
        scene["approximation"] = json!({ "bspline": { "degree": 3 } });
        scene["bodies"][0]["layout"] = "regular".into();
        scene["time"] = json!({ "end": end, "step": step, "lumping": 0 });
        let mut simulation: Simulation<2> = bfree::scene::read(&scene.to_string(), &[])?.build(Path::new("."))?;
        let start = simulation.particles.by_id().position;
        let every = (end / step).round() as u64 / SAMPLES;
        let mut samples = Vec::new();
        while samples.len() < SAMPLES as usize {
            simulation.advance()?;
            if simulation.clock.on_nominal() && simulation.clock.nominal_steps().is_multiple_of(every) {
                samples.push(simulation.particles.by_id());
            }
        }
        Ok(Self { end, start, samples })
    }

    /// The particle of the reference that was nearest to `x` at the start.
    fn nearest(&self, x: &Vector<f64, 2>) -> usize {
        let distance = |&p: &usize| (self.start[p] - x).norm_squared();
        (0..self.start.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
    }

    /// The displacement of the point `x` of the reference configuration, to second order in the distance from the particle `near`.
    fn displacement(&self, sample: &Particles<2>, near: usize, x: &Vector<f64, 2>) -> Vector<f64, 2> {
        let start = &self.start[near];
        sample.position[near] - start + sample.displacement_gradient[near] * (x - start)
    }
}

fn speed() -> f64 {
    (LAME.p_wave_modulus() / DENSITY).sqrt()
}

fn scene() -> Value {
    json!({
        "grid": { "origin": [-0.5, 0.0], "size": [2.0, 1.5] },
        "bodies": [{
            "name": "block", "shape": { "box": { "min": [0, 0], "max": [1, 1] } }, "density": DENSITY,
            "material": { "neo_hookean": { "lambda": LAME.lambda, "shear": LAME.shear } },
        }],
        "boundary": { "bottom": "sliding" },
        "gravity": { "acceleration": [0, -9.81], "curve": [[0, 0], [1, 1]] },
    })
}

impl Problem for Compaction {
    fn name(&self) -> &'static str {
        "compaction 2D"
    }

    fn dimension(&self) -> usize {
        2
    }

    fn cells(&self) -> [f64; LEVELS] {
        [6.0, 8.0, 12.0, 16.0, 24.0]
    }

    fn speed(&self) -> f64 {
        speed()
    }

    fn end(&self) -> f64 {
        self.end
    }

    fn samples(&self) -> u64 {
        SAMPLES
    }

    fn scene(&self) -> Value {
        scene()
    }

    fn solve(&self, scene: &Scene) -> Result<(f64, Cost), StudyError> {
        let mut simulation: Simulation<2> = scene.build(Path::new("."))?;
        let start = simulation.particles.position.clone();
        let nearest: Vec<usize> = start.iter().map(|x| self.nearest(x)).collect();
        let steps = steps(scene);
        let every = (steps / SAMPLES).max(1);
        let sums = RefCell::new((0.0, 0.0));
        let cost = drive(&mut simulation, steps, |now| {
            let done = now.clock.nominal_steps();
            if !(now.clock.on_nominal() && done.is_multiple_of(every)) {
                return Ok(());
            }
            let Some(sample) = self.samples.get((done / every - 1) as usize) else { return Ok(()) };
            let (error, size) = &mut *sums.borrow_mut();
            for ((x, found), &near) in start.iter().zip(&now.particles.by_id().position).zip(&nearest) {
                let exact = self.displacement(sample, near, x);
                *error += (found - x - exact).norm_squared();
                *size += exact.norm_squared();
            }
            Ok(())
        })?;
        let (error, size) = sums.into_inner();
        Ok(((error / size).sqrt(), cost))
    }
}
