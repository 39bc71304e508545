//! A disc and a block on an incline, with gravity turned instead of the incline. With the angle θ and friction μ, the disc rolls with
//! ⅔ g sin θ if tan θ ≤ 3 μ. The block rests if tan θ ≤ μ. Otherwise both slide with g (sin θ − μ cos θ). Gravity rises within 0.1, because a
//! body hops under a weight that acts at once.

use super::{Effort, StudyError, built};
use crate::report::{Bound, Report};
use bfree::simulation::Simulation;
use serde_json::{Value, json};

pub(super) const GRAVITY: f64 = 10.0;

/// The time over which the acceleration is measured, and the time before it.
pub(super) const TIMES: [f64; 2] = [0.2, 0.8];

/// A body on the floor y = 1, under gravity at an angle of `degrees` to the normal of the floor.
pub(super) fn scene(shape: Value, degrees: f64, friction: f64) -> Value {
    let angle = degrees.to_radians();
    json!({
        "grid": { "size": [5, 2.5], "spacing": 0.125 },
        "time": { "step": 0.005, "end": 1, "scheme": { "generalized_alpha": { "spectral_radius": 0.5 } }, "lumping": 0 },
        "bodies": [{ "name": "body", "density": 1000, "shape": shape, "material": { "neo_hookean": { "young": 1e7, "poisson": 0.3 } } }],
        "gravity": { "acceleration": [GRAVITY * angle.sin(), -GRAVITY * angle.cos()], "curve": [[0, 0], [0.1, 1]] },
        "obstacles": [{ "name": "floor", "shape": { "half_space": { "point": [0, 1], "normal": [0, 1] } }, "friction": friction }]
    })
}

/// The mean acceleration along the floor between the two times.
pub(super) fn acceleration(scene: &Value) -> Result<f64, StudyError> {
    let mut simulation = built::<2>(scene)?;
    let own = |simulation: &Simulation<2>| {
        (0..simulation.particles.len()).filter(|&p| simulation.particles.body[p] == 0).collect::<Vec<_>>()
    };
    let [start, end] = TIMES.map(|until| -> Result<[f64; 2], StudyError> {
        while simulation.clock.time() < until - 1e-9 {
            simulation.advance()?;
        }
        // Of the first body alone. Particles may have been rearranged.
        let particles = &simulation.particles;
        let sum = |of: &dyn Fn(usize) -> f64| own(&simulation).into_iter().map(of).sum::<f64>();
        let (mass, momentum) = (sum(&|p| particles.mass[p]), sum(&|p| particles.mass[p] * particles.velocity[p][0]));
        Ok([simulation.clock.time(), momentum / mass])
    });
    let ([t, v], [start_t, start_v]) = (end?, start?);
    Ok((v - start_v) / (t - start_t))
}

pub(super) fn report(effort: &Effort) -> Result<Report, StudyError> {
    let mut report =
        Report::new("a disc and a block on an incline: error of the acceleration over g sin θ", &["body", "θ", "μ"]);
    let disc = json!({ "ball": { "center": [0.7, 1.5], "radius": 0.5 } });
    let block = json!({ "box": { "min": [0.2, 1], "max": [1.2, 1.5] } });
    let cases: [(f64, f64); 4] = [(20.0, 0.5), (20.0, 0.1), (45.0, 0.5), (45.0, 0.2)];
    for (degrees, friction) in cases.into_iter().step_by(if *effort == Effort::Full { 1 } else { 3 }) {
        let angle = degrees.to_radians();
        let slides = GRAVITY * (angle.sin() - friction * angle.cos());
        let rolls = angle.tan() <= 3.0 * friction;
        let of_disc = if rolls { GRAVITY * angle.sin() * 2.0 / 3.0 } else { slides };
        let of_block = if angle.tan() <= friction { 0.0 } else { slides };
        for (name, shape, exact) in [("disc", &disc, of_disc), ("block", &block, of_block)] {
            let found = acceleration(&scene(shape.clone(), degrees, friction))?;
            let error = (found - exact).abs() / (GRAVITY * angle.sin());
            report.push(&[name, &degrees.to_string(), &friction.to_string()], error, Bound::AtMost(0.01));
        }
    }
    report.note("Bound: issue 39 of the project.");
    Ok(report)
}
