//! Piles that are pushed two widths into clay: the surface of the clay stretches around the pile, and no particle may end inside it.

use super::{Effort, StudyError, built};
use crate::report::{Bound, Report};
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use rayon::prelude::*;
use serde_json::{Value, json};

/// The undrained shear strength.
const STRENGTH: f64 = 1.0;
const SPEED: f64 = 0.5;
/// The width is 1, and the tip starts at this place.
const TIP: [f64; 2] = [4.0, 5.0];

/// The shape of a pile, by the form of its tip.
fn pile(tip: &str) -> Value {
    let [x, y] = TIP;
    let shaft = json!({ "box": { "min": [x - 0.5, y + 0.5], "max": [x + 0.5, y + 9.0] } });
    match tip {
        "flat" => json!({ "box": { "min": [x - 0.5, y], "max": [x + 0.5, y + 9.0] } }),
        "round" => json!({ "union": [shaft, { "ball": { "center": [x, y + 0.5], "radius": 0.5 } }] }),
        _ => {
            json!({ "polygon": [[x, y], [x + 0.5, y + 0.5], [x + 0.5, y + 9.0], [x - 0.5, y + 9.0], [x - 0.5, y + 0.5]] })
        }
    }
}

/// The force over width and strength, in the mean over the last quarter of a width, and the depth of the deepest particle in spacings.
fn driven(tip: &str, spacing: f64) -> Result<[f64; 2], StudyError> {
    let [_, top] = TIP;
    let mut simulation: Simulation<2> = built(&json!({
        "grid": { "size": [8, 8], "spacing": spacing, "reset": "every_step" },
        "time": { "step": 0.08 * spacing, "end": 2.0 / SPEED },
        "bodies": [{ "name": "clay", "density": 1, "shape": { "box": { "min": [0, 0], "max": [8, top] } }, "volumetric": "mean_dilatation",
                     "material": { "von_mises": { "elastic": { "young": 200, "poisson": 0.49 },
                                                  "yield_stress": { "initial": 3_f64.sqrt() * STRENGTH } } } }],
        "boundary": { "left": "sliding", "right": "sliding", "bottom": "sliding" },
        "obstacles": [{ "name": "pile", "shape": pile(tip), "displacement": [[0, [0, 0]], [2.0 / SPEED, [0, -2]]] }]
    }))?;
    let (mut sum, mut count, mut deepest) = (0.0, 0.0, 0.0_f64);
    while !simulation.clock.has_reached(2.0 / SPEED) {
        let force = simulation.advance()?.obstacles[0].force[1];
        if simulation.clock.time() * SPEED > 1.75 {
            (sum, count) = (sum + force, count + 1.0);
        }
        let (pile, particles) = (&simulation.loads.contacts.obstacles[0], &simulation.particles);
        let pose = pile.pose(simulation.clock.time());
        let depth = |x: &Vector<f64, 2>| -pile.shape.signed_distance(&pose.to_frame(x));
        let solid = (0..particles.len()).filter(|&p| particles.is_solid(p));
        deepest = solid.map(|p| depth(&particles.position[p])).fold(deepest, f64::max);
    }
    Ok([sum / count / STRENGTH, deepest / spacing])
}

pub(super) fn report(effort: &Effort) -> Result<Report, StudyError> {
    let mut report = Report::new("piles two widths into clay", &["tip", "h", "quantity"]);
    let cases: &[(&'static str, f64)] = match effort {
        Effort::Full => &[("flat", 0.25), ("round", 0.25), ("wedge", 0.25), ("flat", 0.125)],
        _ => &[("flat", 0.5)],
    };
    let run = |&(tip, spacing): &(&'static str, f64)| Ok::<_, StudyError>((tip, spacing, driven(tip, spacing)?));
    for (tip, spacing, [factor, deepest]) in cases.par_iter().map(run).collect::<Result<Vec<_>, _>>()? {
        report.push(&[tip, &spacing.to_string(), "deepest particle in h"], deepest, Bound::AtMost(0.1));
        if tip == "flat" {
            let prandtl = 2.0 + std::f64::consts::PI;
            report.push(
                &[tip, &spacing.to_string(), "least bearing factor over this one"],
                prandtl / factor,
                Bound::AtMost(1.0),
            );
        }
    }
    report.note("Bounds: issue 52 of the project for the depth, and Prandtl's 2 + π of a punch at the surface for the bearing factor.");
    Ok(report)
}
