//! A disc that flies head-on against a smooth wall: beside finite elements, and the paper's disc with an obstacle as its wall.

use super::{Effort, StudyError, built};
use crate::report::{Bound, Report};
use bfree::simulation::Simulation;
use serde_json::{Value, json};

/// Duration of contact, largest force and rebound by finite elements (`verification/reference/disc_on_wall.py 48`).
const ELEMENTS: [f64; 3] = [0.2080, 48.7, 0.9854];

/// The measured values of an impact.
struct Impact {
    /// The end of the first step with a force.
    first: f64,
    duration: f64,
    largest: f64,
    /// The least force on the wall: negative if the wall pulls.
    least: f64,
    /// The speed of the mean mass after contact over the one before.
    rebound: f64,
    /// The lost share of the energy.
    lost: f64,
}

/// Runs a scene with one obstacle, a wall on the right, up to `end`.
fn impact(scene: &Value, end: f64) -> Result<Impact, StudyError> {
    let mut simulation: Simulation<2> = built(scene)?;
    let (before, energy) = (simulation.particles.momentum()[0], simulation.particles.kinetic_energy());
    let (mut first, mut last, mut largest, mut least) = (None, 0.0, 0.0_f64, 0.0_f64);
    while simulation.clock.time() < end {
        let step = simulation.advance()?;
        let (time, force) = (simulation.clock.time(), step.obstacles[0].force[0]);
        if force != 0.0 {
            first.get_or_insert(time);
            last = time;
        }
        (largest, least) = (largest.max(force), least.min(force));
    }
    let first = first.unwrap_or(f64::INFINITY);
    let rest = simulation.particles.kinetic_energy() + simulation.strain_energy() + simulation.contact_energy();
    let rebound = -simulation.particles.momentum()[0] / before;
    Ok(Impact { first, duration: last - first, largest, least, rebound, lost: 1.0 - rest / energy })
}

/// The disc of `disc_on_wall.py`, with the same penalty on every grid.
pub(super) fn beside_elements(effort: &Effort) -> Result<Report, StudyError> {
    let mut report =
        Report::new("a disc on a wall, beside finite elements: relative differences", &["cells in R", "quantity"]);
    for cells in if *effort == Effort::Full { vec![8, 16] } else { vec![8] } {
        let h = 1.0 / f64::from(cells);
        let scene = json!({
            "grid": { "size": [3.5, 3], "spacing": h },
            "time": { "step": 0.04 * h, "end": 1 },
            "bodies": [{ "name": "disc", "density": 1, "velocity": [1, 0], "shape": { "ball": { "center": [1.5, 1.5], "radius": 1 } },
                         "material": { "neo_hookean": { "young": 1000, "poisson": 0.3 } } }],
            "obstacles": [{ "name": "wall", "stiffness": 16.0 * h, "shape": { "half_space": { "point": [2.52, 0], "normal": [-1, 0] } } }]
        });
        let Impact { duration, largest, rebound, .. } = impact(&scene, 0.3)?;
        let names = ["duration", "largest force", "rebound"];
        for ((name, found), elements) in names.into_iter().zip([duration, largest, rebound]).zip(ELEMENTS) {
            report.push(&[&cells.to_string(), name], (found / elements - 1.0).abs(), Bound::AtMost(0.03));
        }
    }
    report.note("Bound: 3 %, as for Hertz's contact. The finest two meshes of elements differ by 0.2 % at most.");
    Ok(report)
}

/// The paper's disc of section 4.3. Its wall is an obstacle 0.5 away, which it touches at t = 1.
pub(super) fn of_the_paper(effort: &Effort) -> Result<Report, StudyError> {
    let mut report = Report::new("the paper's disc with an obstacle as its wall", &["h", "quantity"]);
    let mut coarser: Option<f64> = None;
    for h in if *effort == Effort::Full { vec![0.5, 0.25, 0.125] } else { vec![0.5, 0.25] } {
        let step = 0.1 * h;
        let scene = json!({
            "grid": { "size": [6, 5], "spacing": h },
            "approximation": { "lme": { "gamma": 3 } },
            "time": { "step": step, "end": 4 },
            "bodies": [{ "name": "cylinder", "density": 4, "velocity": [0.5, 0], "shape": { "ball": { "center": [2.5, 2.5], "radius": 1.5 } },
                         "material": { "neo_hookean": { "bulk": 170, "shear": 30 } } }],
            "obstacles": [{ "name": "wall", "shape": { "half_space": { "point": [4.5, 0], "normal": [-1, 0] } } }]
        });
        let found = impact(&scene, 4.0)?;
        let name = h.to_string();
        report.push(&[&name, "first force before touching, in steps"], (1.0 - found.first) / step, Bound::AtMost(0.0));
        report.push(&[&name, "first force after touching, in steps"], (found.first - 1.0) / step, Bound::AtMost(2.0));
        report.push(&[&name, "tension over the largest force"], -found.least / found.largest, Bound::AtMost(0.0));
        report.push(&[&name, "rebound above 1"], found.rebound - 1.0, Bound::AtMost(0.0));
        report.push(&[&name, "energy lost"], found.lost, Bound::Reported);
        if let Some(coarser) = coarser.replace(found.lost) {
            report.push(
                &[&name, "energy lost over that of the coarser grid"],
                found.lost / coarser,
                Bound::AtMost(1.0),
            );
        }
    }
    report.note("Bounds: issue 39 of the project. A step sees the contact at its end, so a force within one step of touching is in the second step at most.");
    Ok(report)
}
