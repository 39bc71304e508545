//! A block that is pressed on a base and dragged over it: friction reaches μ times the pressure, and never exceeds it.

use super::{Effort, StudyError, built};
use crate::report::{Bound, Report};
use serde_json::json;

const FRICTION: f64 = 0.4;

/// The largest tangential force over the normal force of all load steps, and the steepest slope of the surfaces that touch. The base is `ratio`
/// times as stiff as the block.
fn largest(ratio: f64, spacing: f64) -> Result<[f64; 2], StudyError> {
    let young = 1000.0;
    let body = |name: &str, min: [f64; 2], max: [f64; 2], young: f64| {
        json!({ "name": name, "density": 1, "shape": { "box": { "min": min, "max": max } },
                "material": { "neo_hookean": { "young": young, "poisson": 0.3 } } })
    };
    let mut simulation = built::<2>(&json!({
        "grid": { "size": [4, 2], "spacing": spacing },
        "time": { "scheme": "none", "step": 0.05, "end": 1 },
        "bodies": [body("base", [0.5, 0.0], [3.5, 0.5], ratio * young), body("block", [1.0, 0.5], [2.0, 1.0], young)],
        "prescribed": [
            { "region": { "box": { "min": [0, -1], "max": [4, 0.01] } }, "displacement": [[0, [0, 0]]] },
            { "region": { "box": { "min": [0, 0.99], "max": [4, 2] } },
              "displacement": [[0, [0, 0]], [0.25, [0, -0.02]], [1, [0.3, -0.02]]] }
        ],
        "contact": { "friction": FRICTION }
    }))?;
    let faces: Vec<usize> = (0..simulation.particles.len())
        .filter(|&p| (simulation.particles.position[p][1] - 0.5).abs() < 0.5 * spacing)
        .map(|p| simulation.particles.id[p] as usize)
        .collect();
    let [mut largest, mut steepest] = [0.0_f64; 2];
    while !simulation.clock.has_reached(1.0) {
        let force = simulation.advance()?.pairs[0].force;
        largest = largest.max(force[0].abs() / force[1].abs());
        let places = simulation.particles.places();
        for &id in &faces {
            let h = simulation.particles.displacement_gradient[places[id] as usize];
            steepest = steepest.max((h[(1, 0)] / (1.0 + h[(0, 0)])).abs());
        }
    }
    Ok([largest, steepest])
}

pub(super) fn report(effort: &Effort) -> Result<Report, StudyError> {
    let mut report = Report::new(
        "a block dragged over a base: tangential over normal force",
        &["stiffness of the base", "h", "quantity"],
    );
    let ratios = if *effort == Effort::Full { vec![1000.0, 10.0, 1.0] } else { vec![1000.0] };
    for ratio in ratios {
        for spacing in if *effort == Effort::Full { vec![0.125, 0.0625] } else { vec![0.125] } {
            let [found, slope] = largest(ratio, spacing)?;
            let tilted = |by: f64| (FRICTION.atan() + by).tan() / FRICTION;
            let labels = |name| [ratio.to_string(), spacing.to_string(), String::from(name)];
            let mut push = |name, value, bound| report.push(&labels(name).each_ref().map(String::as_str), value, bound);
            push("above μ", found / FRICTION - 1.0, Bound::AtMost(tilted(slope.atan()) - 1.0));
            push("below μ", 1.0 - found / FRICTION, Bound::AtMost(1.0 - tilted(-slope.atan())));
        }
    }
    report.note(
        "Bounds: with normals tilted by at most α, the force lies between tan(atan μ − α) and tan(atan μ + α). α is that of the particles at the surfaces.",
    );
    Ok(report)
}
