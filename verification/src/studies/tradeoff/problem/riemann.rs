//! The paper's jump of velocity in a bar (section 4.1), against the exact solution.

use super::{LEVELS, Problem, steps};
use crate::riemann::{PSystem, State};
use crate::start::velocity_by_masses;
use crate::studies::StudyError;
use crate::studies::tradeoff::cost::{Cost, drive};
use bfree::material::Lame;
use bfree::scene::Scene;
use bfree::simulation::Simulation;
use serde_json::{Value, json};
use std::path::Path;

const YOUNG: f64 = 1e10;
const POISSON: f64 = 0.3;
const DENSITY: f64 = 2600.0;
/// The initial position of the jump, and the velocity to the left of it.
const MIDDLE: f64 = 50.0;
const JUMP: f64 = 10.0;
/// Half the length of the bar, the room beyond it, and the length at each end that the error omits.
const HALF: f64 = 9.0;
const ROOM: f64 = 1.2;
const ENDS: f64 = 1.0;

/// The error is ‖v − v_exact‖ over ‖v_exact‖, over the particles, when the fronts have reached 43 and 57 m.
pub(in crate::studies::tradeoff) struct Bar {
    pub end: f64,
}

fn lame() -> Result<Lame, StudyError> {
    Ok(Lame::from_young_poisson(YOUNG, POISSON)?)
}

impl Bar {
    fn start(&self, scene: &Scene) -> Result<Simulation<1>, StudyError> {
        let mut simulation: Simulation<1> = scene.build(Path::new("."))?;
        velocity_by_masses(&mut simulation, |x| x.map(|x| if x <= MIDDLE { JUMP } else { 0.0 }))?;
        Ok(simulation)
    }
}

impl Problem for Bar {
    fn name(&self) -> &'static str {
        "Riemann 1D"
    }

    fn dimension(&self) -> usize {
        1
    }

    fn cells(&self) -> [f64; LEVELS] {
        [5.0, 20.0 / 3.0, 10.0, 40.0 / 3.0, 20.0]
    }

    fn speed(&self) -> f64 {
        lame().map_or(1.0, |lame| (lame.p_wave_modulus() / DENSITY).sqrt())
    }

    fn end(&self) -> f64 {
        self.end
    }

    fn smooth(&self) -> bool {
        false
    }

    fn scene(&self) -> Value {
        json!({
            "grid": { "origin": [MIDDLE - HALF - ROOM], "size": [2.0 * (HALF + ROOM)] },
            "bodies": [{
                "name": "bar", "shape": { "box": { "min": [MIDDLE - HALF], "max": [MIDDLE + HALF] } }, "density": DENSITY,
                "material": { "neo_hookean": { "young": YOUNG, "poisson": POISSON } },
            }],
        })
    }

    /// Cells between the fronts, with nodes in the middle, at the ends of the bar, and at those of the box.
    fn spacing_of(&self, cells: f64) -> Option<f64> {
        let between_fronts = 2.0 * self.speed() * self.end;
        let common = 0.5 * ROOM;
        Some(common / (common * cells / between_fronts).ceil())
    }

    fn solve(&self, scene: &Scene) -> Result<(f64, Cost), StudyError> {
        let lame = lame()?;
        let system = PSystem { modulus: 0.5 * lame.lambda + lame.shear, density: DENSITY };
        let side = |velocity| State { stretch: 1.0, velocity };
        let exact = system.solve(side(JUMP), side(0.0))?;
        let mut simulation = self.start(scene)?;
        let reference = simulation.particles.position.clone();
        let cost = drive(&mut simulation, steps(scene), |_| Ok(()))?;
        let (mut error, mut size) = (0.0, 0.0);
        for (x, v) in reference.iter().zip(&simulation.particles.by_id().velocity) {
            let place = x[0] - MIDDLE;
            if place.abs() < HALF - ENDS {
                let expected = exact.at(place / simulation.clock.time()).velocity;
                error += (v[0] - expected).powi(2);
                size += expected.powi(2);
            }
        }
        Ok(((error / size).sqrt(), cost))
    }
}
