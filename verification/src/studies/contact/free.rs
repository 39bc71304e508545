//! Obstacles that move freely: a rigid mass that hits an elastic bar, and a rigid disc that rolls.
//!
//! While the wave in the bar has not returned, the force of the mass m with the initial speed v₀ on a bar of area A = 1 is that of
//! Saint-Venant, F = ρ c v₀ exp(−t/τ), with c = √(E/ρ) and τ = m/(ρ c).

use super::incline::{GRAVITY, TIMES};
use super::{Effort, StudyError, built};
use crate::report::{Bound, Report};
use serde_json::{Value, json};

const YOUNG: f64 = 1e4;
const DENSITY: f64 = 1.0;
const LENGTH: f64 = 1.0;
const SPEED: f64 = 0.1;

/// The part of the time until the wave returns, 2 L/c, in which the force is compared.
const COMPARED: [f64; 2] = [0.1, 0.95];

pub(super) fn reports(effort: &Effort) -> Result<Vec<Report>, StudyError> {
    Ok(vec![bar(effort)?, rolling()?])
}

/// A mass as heavy as the bar. Its force is compared with Saint-Venant's, relative to the largest.
fn bar(effort: &Effort) -> Result<Report, StudyError> {
    let title = "a rigid mass hits an elastic bar: errors relative to Saint-Venant's force and speed";
    let mut report = Report::new(title, &["cells", "quantity"]);
    for cells in if *effort == Effort::Full { vec![50, 100, 200] } else { vec![50, 100] } {
        let (h, c) = (LENGTH / f64::from(cells), (YOUNG / DENSITY).sqrt());
        let scene = json!({
            "grid": { "origin": [-4.0 * h], "size": [LENGTH + 8.0 * h], "spacing": h },
            "time": { "step": 0.5 * h / c, "end": 1, "scheme": { "generalized_alpha": { "spectral_radius": 0.5 } }, "lumping": 0 },
            "bodies": [{ "name": "bar", "density": DENSITY, "shape": { "box": { "min": [0], "max": [LENGTH] } },
                         "material": { "neo_hookean": { "young": YOUNG, "poisson": 0 } } }],
            "obstacles": [{ "name": "mass", "shape": { "box": { "min": [LENGTH], "max": [LENGTH + 0.1] } }, "stiffness": 3,
                            "free": { "density": DENSITY * LENGTH / 0.1, "velocity": [-SPEED] } }]
        });
        let mut simulation = built::<1>(&scene)?;
        let (tau, back) = (LENGTH / c, 2.0 * LENGTH / c);
        let (mut errors, mut speed) = (Vec::new(), 0.0_f64);
        while simulation.clock.time() < COMPARED[1] * back {
            let step = simulation.advance()?;
            let (time, force) = (simulation.clock.time(), step.obstacles[0].force[0]);
            let body = simulation.loads.contacts.obstacles[0].free.as_ref().ok_or("the mass is not free")?;
            let remaining = (-time / tau).exp();
            if time > COMPARED[0] * back {
                errors.push(force / (DENSITY * c * SPEED) - remaining);
                speed = speed.max((-body.velocity[0] / SPEED - remaining).abs());
            }
        }
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / errors.len() as f64;
        let (force, square) = (mean(&mut errors.iter().copied()), mean(&mut errors.iter().map(|error| error * error)));
        report.push(&[&cells.to_string(), "mean force"], force.abs(), Bound::AtMost(0.02));
        report.push(&[&cells.to_string(), "root mean square of the force"], square.sqrt(), Bound::AtMost(0.05));
        report.push(&[&cells.to_string(), "speed of the mass"], speed, Bound::AtMost(0.01));
    }
    report.note("Bounds: those of issue 39 of the project for the impact of a bar, with 1 % for the speed.");
    Ok(report)
}

/// A rigid disc on an elastic slab under tilted gravity rolls with ⅔ g sin θ.
fn rolling() -> Result<Report, StudyError> {
    let mut report =
        Report::new("a rigid disc rolls on an elastic slab: error of the acceleration over g sin θ", &["θ", "μ"]);
    for (degrees, friction) in [(20.0_f64, 0.5), (45.0, 0.2)] {
        let angle = degrees.to_radians();
        let scene: Value = json!({
            "grid": { "size": [5, 2.5], "spacing": 0.125 },
            "time": { "step": 0.005, "end": 1, "scheme": { "generalized_alpha": { "spectral_radius": 0.5 } }, "lumping": 0 },
            "bodies": [{ "name": "slab", "density": 1000, "shape": { "box": { "min": [0, 0], "max": [5, 1] } },
                         "material": { "neo_hookean": { "young": 1e7, "poisson": 0.3 } } }],
            "boundary": { "bottom": "fixed", "left": "fixed", "right": "fixed" },
            "gravity": { "acceleration": [GRAVITY * angle.sin(), -GRAVITY * angle.cos()], "curve": [[0, 0], [0.1, 1]] },
            "obstacles": [{ "name": "disc", "shape": { "ball": { "center": [0.7, 1.5], "radius": 0.5 } }, "friction": friction,
                            "free": { "density": 1000 } }]
        });
        let mut simulation = built::<2>(&scene)?;
        let [start, end] = TIMES.map(|until| -> Result<[f64; 2], StudyError> {
            while simulation.clock.time() < until - 1e-9 {
                simulation.advance()?;
            }
            let body = simulation.loads.contacts.obstacles[0].free.as_ref().ok_or("the disc is not free")?;
            Ok([simulation.clock.time(), body.velocity[0]])
        });
        let ([start_t, start_v], [t, v]) = (start?, end?);
        let rolls = angle.tan() <= 3.0 * friction;
        let slides = GRAVITY * (angle.sin() - friction * angle.cos());
        let exact = if rolls { GRAVITY * angle.sin() * 2.0 / 3.0 } else { slides };
        let error = ((v - start_v) / (t - start_t) - exact).abs() / (GRAVITY * angle.sin());
        report.push(&[&degrees.to_string(), &friction.to_string()], error, Bound::AtMost(0.01));
    }
    report.note("Bound: issue 39 of the project.");
    Ok(report)
}
