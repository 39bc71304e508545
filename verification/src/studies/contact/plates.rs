//! Random pairs of plates, half a cell to three cells thick, that meet at up to three cells a step. None passes through the other.

use super::{Effort, StudyError, built};
use crate::random::Random;
use crate::report::{Bound, Report};
use bfree::simulation::Simulation;
use rayon::prelude::*;
use serde_json::json;

const SPACING: f64 = 0.1;
const STEP: f64 = 0.01;

/// The mean position of a body along the motion.
fn middle(simulation: &Simulation<2>, body: u32) -> f64 {
    let particles = &simulation.particles;
    let own = || (0..particles.len()).filter(|&p| particles.body[p] == body && particles.is_solid(p));
    own().map(|p| particles.position[p][0]).sum::<f64>() / own().count() as f64
}

/// Whether the left plate of a random pair ends on the right, and whether the run went on to its end.
fn meets(seed: u64) -> Result<[bool; 2], StudyError> {
    let mut random = Random::new(seed);
    let [thick, other] = [(); 2].map(|()| SPACING * random.between(0.5, 3.0));
    let [length, along] = [SPACING * random.between(4.0, 8.0), random.between(-0.1, 0.1)];
    let approach = SPACING * random.between(0.5, 3.0) / STEP;
    // The speed of sound is 2 to 30 times the speed.
    let young = (approach * random.between(2.0, 30.0)).powi(2);
    let gap = SPACING * random.between(0.1, 2.0);
    let x = 2.0 + SPACING * random.between(0.0, 1.0);
    let plate = |name: &str, min: f64, thick: f64, speed: f64, y: f64| {
        json!({ "name": name, "density": 1, "velocity": [speed, 0], "material": { "neo_hookean": { "young": young, "poisson": 0.3 } },
                "shape": { "box": { "min": [min, 1.0 + y], "max": [min + thick, 1.0 + y + length] } } })
    };
    let mut simulation = built::<2>(&json!({
        "grid": { "size": [4, 2.6], "spacing": SPACING },
        "time": { "step": STEP, "end": 1, "max_halvings": 6 },
        "bodies": [plate("left", x - thick, thick, 0.5 * approach, 0.0), plate("right", x + gap, other, -0.5 * approach, along)],
        "contact": { "friction": if seed.is_multiple_of(2) { 0.0 } else { 0.3 } }
    }))?;
    let end = 3.0 * (gap + thick + other) / approach;
    while simulation.clock.time() < end {
        if simulation.advance().is_err() {
            return Ok([middle(&simulation, 0) >= middle(&simulation, 1), false]);
        }
    }
    Ok([middle(&simulation, 0) >= middle(&simulation, 1), true])
}

pub(super) fn report(effort: &Effort) -> Result<Report, StudyError> {
    let count: u32 = if *effort == Effort::Full { 120 } else { 8 };
    let mut report = Report::new("random pairs of plates that meet", &["quantity"]);
    let found: Vec<[bool; 2]> = (0..u64::from(count)).into_par_iter().map(meets).collect::<Result<_, _>>()?;
    let [passed, ended] = [0, 1].map(|k| found.iter().map(|one| u32::from(one[k])).sum::<u32>());
    report.push(&["share that passes"], f64::from(passed) / f64::from(count), Bound::AtMost(0.0));
    report.push(&["share that ends with an error"], 1.0 - f64::from(ended) / f64::from(count), Bound::AtMost(0.5));
    report.note("Bounds: no plate may pass another one. A run may end and say where, but at least half of the pairs must be followed to the end.");
    Ok(report)
}
