//! The block compacted by its own weight (section 4.2), against a fine run of Q8 finite elements with the same residual.

use super::{LEVELS, Problem, steps, whole_steps};
use crate::elements::Elements;
use crate::studies::StudyError;
use crate::studies::tradeoff::cost::{Cost, Units, drive};
use crate::studies::tradeoff::setting::Setting;
use bfree::clock::Clock;
use bfree::material::{Lame, Material};
use bfree::scene::Scene;
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use serde_json::{Value, json};
use std::cell::RefCell;
use std::path::Path;
use std::sync::Mutex;

const LAME: Lame = Lame { lambda: 5e4, shear: 3e4 };
const DENSITY: f64 = 2700.0;
/// Times at which the displacements are compared.
const SAMPLES: u64 = 10;
/// cΔt over the edge of an element.
const FINE_COURANT: f64 = 0.5;

/// The error is the relative error of the displacement of all particles at ten times.
pub(in crate::studies::tradeoff) struct Compaction {
    pub end: f64,
    reference: Mutex<Reference>,
}

/// The elements, and the displacement of their nodes at the ten times.
struct Reference {
    block: Elements<2, Material>,
    samples: Vec<Vec<Vector<f64, 2>>>,
}

impl Compaction {
    /// The problem up to the time `end`, with `elements`² elements as reference.
    pub fn new(end: f64, elements: u32) -> Result<Self, StudyError> {
        let size = f64::from(elements).recip();
        let mut scene = scene();
        let step = whole_steps(end, FINE_COURANT * size / speed(), SAMPLES);
        (scene["grid"]["spacing"], scene["time"]) = (0.25.into(), json!({ "end": end, "step": step }));
        let of_particles: Simulation<2> = bfree::scene::read(&scene.to_string(), &[])?.build(Path::new("."))?;
        let body = of_particles.bodies.into_iter().next().ok_or("a scene without a body")?;
        let mut block = Elements::new(Vector::zeros(), size, [elements; 2], body, Clock::new(step, 0))?;
        block.loads = of_particles.loads;
        let every = (end / step).round() as u64 / SAMPLES;
        let mut samples = Vec::new();
        for _ in 0..SAMPLES {
            for _ in 0..every {
                block.step()?;
            }
            samples.push(block.displacement.clone());
        }
        Ok(Self { end, reference: Mutex::new(Reference { block, samples }) })
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

    fn units_of(&self, scene: &Scene, setting: &Setting) -> Result<Units, StudyError> {
        Ok(Units::of(&scene.build::<2>(Path::new("."))?, setting.assembled)?.0)
    }

    fn solve(&self, scene: &Scene, setting: &Setting) -> Result<(f64, Cost), StudyError> {
        let mut simulation: Simulation<2> = scene.build(Path::new("."))?;
        let start = simulation.particles.position.clone();
        let steps = steps(scene);
        let every = (steps / SAMPLES).max(1);
        let sums = RefCell::new((0.0, 0.0));
        let cost = drive(&mut simulation, setting, steps, |now| {
            let done = now.clock.nominal_steps();
            if !(now.clock.on_nominal() && done.is_multiple_of(every)) {
                return Ok(());
            }
            // The lock is lost only if a run panicked while holding the reference, which would have ended the study.
            let mut reference = self.reference.lock().map_err(|_| "the reference is lost")?;
            let Reference { block, samples } = &mut *reference;
            let Some(sample) = samples.get((done / every - 1) as usize) else { return Ok(()) };
            block.displacement.clone_from(sample);
            let (error, size) = &mut *sums.borrow_mut();
            for (x, found) in start.iter().zip(&now.particles.by_id().position) {
                let exact = block.displacement_at(x)?;
                *error += (found - x - exact).norm_squared();
                *size += exact.norm_squared();
            }
            Ok(())
        })?;
        let (error, size) = sums.into_inner();
        Ok(((error / size).sqrt(), cost))
    }
}
