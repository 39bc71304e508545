//! Large strain along the axes of a square or a cube, under the body force of the manufactured solution.

use super::{LEVELS, Problem, steps};
use crate::manufactured::{AxisAligned, force_field, state};
use crate::studies::StudyError;
use crate::studies::tradeoff::cost::{Cost, drive};
use bfree::material::Lame;
use bfree::scene::Scene;
use bfree::simulation::Simulation;
use serde_json::{Value, json};
use std::path::Path;

const YOUNG: f64 = 1.0;
const POISSON: f64 = 0.3;

/// The problem in `D` dimensions up to the time `end`. The error is the rms error of the final position over the rms displacement.
pub(in crate::studies::tradeoff) struct Manufactured<const D: usize> {
    pub name: &'static str,
    pub cells: [f64; LEVELS],
    pub end: f64,
}

/// Faces of a box, along each axis.
const FACES: [[&str; 2]; 3] = [["left", "right"], ["bottom", "top"], ["back", "front"]];

impl<const D: usize> Manufactured<D> {
    fn start(&self, scene: &Scene) -> Result<Simulation<D>, StudyError> {
        let mut simulation: Simulation<D> = scene.build(Path::new("."))?;
        let particles = &mut simulation.particles;
        for (p, x) in particles.position.iter().enumerate() {
            let start = state(&AxisAligned::default(), x, 0.0);
            particles.velocity[p] = start.velocity;
            particles.acceleration[p] = start.acceleration;
        }
        Ok(simulation)
    }
}

impl<const D: usize> Problem for Manufactured<D> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn dimension(&self) -> usize {
        D
    }

    fn cells(&self) -> [f64; LEVELS] {
        self.cells
    }

    fn speed(&self) -> f64 {
        Lame::from_young_poisson(YOUNG, POISSON).map_or(1.0, |lame| lame.p_wave_modulus().sqrt())
    }

    fn end(&self) -> f64 {
        self.end
    }

    fn scene(&self) -> Value {
        let walls: serde_json::Map<_, _> =
            FACES.iter().take(D).flatten().map(|face| ((*face).to_owned(), json!("sliding"))).collect();
        let corner = |x: f64| vec![x; D];
        json!({
            "grid": { "size": corner(1.0) },
            "bodies": [{
                "name": "body", "shape": { "box": { "min": corner(0.0), "max": corner(1.0) } }, "density": 1,
                "material": { "neo_hookean": { "young": YOUNG, "poisson": POISSON } },
            }],
            "boundary": walls,
        })
    }

    fn solve(&self, scene: &Scene) -> Result<(f64, Cost), StudyError> {
        let motion = AxisAligned::default();
        let mut simulation = self.start(scene)?;
        let reference = simulation.particles.position.clone();
        let law = simulation.bodies.first().ok_or("a scene without a body")?.law.clone();
        simulation.loads.field = Some(force_field(motion, law, 1.0, reference.clone()));
        let cost = drive(&mut simulation, steps(scene), |_| Ok(()))?;
        let (mut error, mut size) = (0.0, 0.0);
        for (x, found) in reference.iter().zip(&simulation.particles.by_id().position) {
            let exact = state(&motion, x, simulation.clock.time()).position;
            error += (found - exact).norm_squared();
            size += (exact - x).norm_squared();
        }
        Ok(((error / size).sqrt(), cost))
    }
}
