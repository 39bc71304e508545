//! A block on a wedge of slope 0.115 with μ = 0.2, pushed up slowly by a plate without friction: the force on the plate is that of statics,
//! W (sin θ + μ cos θ), and friction loses the rest of the work against weight.

use super::{Effort, StudyError, built};
use crate::report::{Bound, Report};
use serde_json::json;

const SLOPE: f64 = 0.115;
const FRICTION: f64 = 0.2;
const WEIGHT: f64 = 5.0;
const HEIGHT: f64 = 0.5;
const SPACING: f64 = 0.25;

/// The way of the plate along the wedge, in the unit of time from 1 to 2.
const WAY: f64 = 0.02;

/// The length of a step.
const STEP: f64 = 0.02;

pub(super) fn report(effort: &Effort) -> Result<Report, StudyError> {
    let mut report = Report::new("a block pushed up a wedge: error of the force", &["stiffness", "E", "quantity"]);
    let cases = [(0.3, 1e4), (1.0, 1e4), (10.0, 1e4), (1.0, 1e5), (10.0, 1e5)];
    let angle = SLOPE.atan();
    let exact = WEIGHT * (angle.sin() + FRICTION * angle.cos());
    for (stiffness, young) in cases.into_iter().take(if *effort == Effort::Full { 5 } else { 2 }) {
        let (along, normal) = ([angle.cos(), angle.sin()], [-angle.sin(), angle.cos()]);
        let corner = [0.7, 0.6];
        let at = |u: f64, v: f64| [0, 1].map(|i| corner[i] + u * along[i] + v * normal[i]);
        let scene = json!({
            "grid": { "size": [3, 2], "spacing": SPACING, "reset": { "strain": 0.1 } },
            "time": { "step": STEP, "end": 2, "scheme": { "generalized_alpha": { "spectral_radius": 0.5 } }, "lumping": 0 },
            "bodies": [{ "name": "block", "density": 1, "shape": { "polygon": [at(0.0, 0.0), at(1.0, 0.0), at(1.0, HEIGHT), at(0.0, HEIGHT)] },
                         "material": { "neo_hookean": { "young": young, "poisson": 0.3 } } }],
            "damping": { "mass": 0, "stiffness": 0.02 },
            "gravity": { "acceleration": [0, -10], "curve": [[0, 0], [1, 1]] },
            "obstacles": [
                { "name": "wedge", "shape": { "half_space": { "point": corner, "normal": normal } }, "friction": FRICTION, "stiffness": stiffness },
                { "name": "plate", "shape": { "half_space": { "point": corner, "normal": along } }, "stiffness": stiffness,
                  "displacement": [[0, [0, 0]], [1, [0, 0]], [2, [WAY * along[0], WAY * along[1]]]] }
            ],
            "solver": { "krylov": { "preconditioner": "multigrid" } }
        });
        let mut simulation = built::<2>(&scene)?;
        let (mut force, mut depths) = (f64::NAN, [f64::NAN; 2]);
        while simulation.clock.time() < 2.0 - 1e-9 {
            let contacts = simulation.advance()?.obstacles;
            (force, depths) = (contacts[1].force.norm(), [contacts[0].depth, contacts[1].depth]);
        }
        let labels = [stiffness.to_string(), young.to_string()];
        report.push(&[&labels[0], &labels[1], "force"], (force / exact - 1.0).abs(), Bound::AtMost(1e-3));
        let [wedge, plate] = &simulation.loads.contacts.obstacles[..] else { return Err("two obstacles".into()) };
        // Before the block slides, it is compressed, enters the plate, and slips elastically by μ times its depth in the wedge.
        let before = FRICTION * depths[0] + exact / (young * HEIGHT) + depths[1];
        let friction = WEIGHT * FRICTION * angle.cos();
        // In the step in which it begins to slide, the books take the mean of friction at both ends: −W sin θ, which holds the block at rest, and
        // μ W cos θ.
        let first_step = 0.5 * exact * WAY * STEP;
        let missing = (friction * WAY - wedge.friction_loss) / plate.work;
        let of_loss = |name| [labels[0].as_str(), labels[1].as_str(), name];
        report.push(
            &of_loss("missing friction loss"),
            missing,
            Bound::AtMost((friction * before + first_step) / plate.work),
        );
        report.push(&of_loss("excess friction loss"), -missing, Bound::AtMost(1e-3));
    }
    report.note("Bound of the force: issue 39 of the project. The friction loss lacks at most the way before the block slides, and the error of the \
                 trapezoidal rule in the step in which it begins, over the work of the plate.");
    Ok(report)
}
