//! Contact between bodies: two bars that meet, bodies on a deformable slope, and two discs beside one disc on a wall.

use super::{Effort, StudyError, built};
use crate::report::{Bound, Report};
use bfree::simulation::Simulation;
use serde_json::{Value, json};

const YOUNG: f64 = 3e7;
const DENSITY: f64 = 0.73;
const LENGTH: f64 = 10.0;
const SPEED: f64 = 202.2;

/// Two equal bars that meet with ±v₀. By symmetry each feels a rigid wall: the time of contact is 2 L/c, and the force ρ c v₀. Returns the errors of
/// both, the rebound over v₀, and the lost share of the energy.
fn bars(cells: u32) -> Result<[f64; 4], StudyError> {
    let (h, c) = (LENGTH / f64::from(cells), (YOUNG / DENSITY).sqrt());
    let (gap, duration, room) = (0.01, 2.0 * LENGTH / c, f64::from(cells + cells / 2 + 4) * h);
    let bar = |name: &str, at: [f64; 2], speed: f64| {
        json!({ "name": name, "density": DENSITY, "velocity": [speed], "shape": { "box": { "min": [at[0]], "max": [at[1]] } },
                "material": { "neo_hookean": { "young": YOUNG, "poisson": 0 } } })
    };
    let mut simulation = built::<1>(&json!({
        "grid": { "size": [2.0 * room], "spacing": h, "origin": [-room] },
        "time": { "step": 0.5 * h / c, "end": 1, "scheme": { "generalized_alpha": { "spectral_radius": 0.5 } }, "lumping": 0 },
        "bodies": [bar("left", [-gap - LENGTH, -gap], SPEED), bar("right", [gap, gap + LENGTH], -SPEED)],
        "contact": { "stiffness": 1.5 }
    }))?;
    let energy = simulation.particles.kinetic_energy();
    let (start, mut last, mut plateau) = (gap / SPEED, 0.0, Vec::new());
    while simulation.clock.time() < start + 1.2 * duration {
        let step = simulation.advance()?;
        let (time, force) = (simulation.clock.time(), step.pairs[0].force[0]);
        if force > 0.0 {
            last = time;
        }
        if (0.1..0.9).contains(&((time - start) / duration)) {
            plateau.push(force);
        }
    }
    let mean = plateau.iter().sum::<f64>() / plateau.len() as f64;
    let rest = simulation.particles.kinetic_energy() + simulation.strain_energy() + simulation.contact_energy();
    let particles = &simulation.particles;
    let right = (0..particles.len()).filter(|&p| particles.body[p] == 1);
    let momentum: f64 = right.map(|p| particles.mass[p] * particles.velocity[p][0]).sum();
    let rebound = momentum / (DENSITY * LENGTH * SPEED);
    Ok([(last - start) / duration - 1.0, mean / (DENSITY * c * SPEED) - 1.0, rebound, 1.0 - rest / energy])
}

pub(super) fn impact(effort: &Effort) -> Result<Report, StudyError> {
    let mut report = Report::new("two bars that meet: errors relative to the exact values", &["cells", "quantity"]);
    for cells in if *effort == Effort::Full { vec![40, 80, 160] } else { vec![40] } {
        let [release, force, rebound, lost] = bars(cells)?;
        let name = cells.to_string();
        report.push(&[&name, "time of release"], release.abs(), Bound::AtMost(0.01));
        report.push(&[&name, "mean force"], force.abs(), Bound::AtMost(0.02));
        report.push(&[&name, "rebound above v0"], rebound - 1.0, Bound::AtMost(0.0));
        if cells >= 80 {
            report.push(&[&name, "rebound below v0"], 1.0 - rebound, Bound::AtMost(0.02));
            report.push(&[&name, "energy lost"], lost, Bound::AtMost(0.02));
        }
    }
    report.note("Bounds: those of a bar on a wall, issue 39 of the project.");
    Ok(report)
}

/// A body on a deformable floor that is held from below, under gravity at an angle to the normal of the floor. The contact is where a rigid floor
/// is in `incline`.
fn on_slope(shape: Value, degrees: f64, friction: f64) -> Value {
    let scene = super::incline::scene(shape, degrees, friction);
    let mut scene = scene.as_object().cloned().unwrap_or_default();
    scene.remove("obstacles");
    let floor = json!({ "name": "floor", "density": 1000, "shape": { "box": { "min": [0.125, 0.5], "max": [4.875, 1] } },
                        "material": { "neo_hookean": { "young": 1e8, "poisson": 0.3 } } });
    if let Some(bodies) = scene.get_mut("bodies").and_then(Value::as_array_mut) {
        bodies.push(floor);
    }
    let held = json!([{ "region": { "box": { "min": [0, 0], "max": [5, 0.5] } }, "displacement": [[0, [0, 0]]] }]);
    scene.extend([("contact".into(), json!({ "friction": friction })), ("prescribed".into(), held)]);
    Value::Object(scene)
}

pub(super) fn slope(effort: &Effort) -> Result<Report, StudyError> {
    let title = "a disc and a block on a deformable slope: error of the acceleration over g sin θ";
    let mut report = Report::new(title, &["body", "θ", "μ"]);
    let (disc, block) = (
        json!({ "ball": { "center": [0.7, 1.5], "radius": 0.5 } }),
        json!({ "box": { "min": [0.2, 1], "max": [1.2, 1.5] } }),
    );
    for (degrees, friction) in
        if *effort == Effort::Full { vec![(20.0_f64, 0.5_f64), (20.0, 0.1)] } else { vec![(20.0, 0.1)] }
    {
        let g = super::incline::GRAVITY;
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let slides = g * (sine - friction * cosine);
        let of_disc = if sine <= 3.0 * friction * cosine { g * sine * 2.0 / 3.0 } else { slides };
        let of_block = if sine <= friction * cosine { 0.0 } else { slides };
        // The disc takes longer.
        let both = [("block", &block, of_block), ("disc", &disc, of_disc)];
        for (name, shape, exact) in both.into_iter().take(if *effort == Effort::Full { 2 } else { 1 }) {
            let found = super::incline::acceleration(&on_slope(shape.clone(), degrees, friction))?;
            let error = (found - exact).abs() / (g * sine);
            report.push(&[name, &degrees.to_string(), &friction.to_string()], error, Bound::AtMost(0.01));
        }
    }
    report.note("Bound: issue 39 of the project, for a rigid slope. The floor is ten times as stiff as the body.");
    Ok(report)
}

/// The largest force on the second body or on the obstacle, and the velocity after contact of the first body over the one before.
fn rebound(scene: &Value, force: impl Fn(&bfree::simulation::StepReport<2>) -> f64) -> Result<[f64; 2], StudyError> {
    let mut simulation: Simulation<2> = built(scene)?;
    let velocity = |simulation: &Simulation<2>| {
        let particles = &simulation.particles;
        let own = (0..particles.len()).filter(|&p| particles.body[p] == 0);
        own.map(|p| particles.mass[p] * particles.velocity[p][0]).sum::<f64>()
    };
    let (before, mut largest) = (velocity(&simulation), 0.0_f64);
    while simulation.clock.time() < 0.5 {
        let step = simulation.advance()?;
        largest = largest.max(force(&step));
    }
    Ok([largest, velocity(&simulation) / before])
}

/// Two equal discs that meet head-on, and one of them on a smooth rigid wall of twice the penalty stiffness, which is the same problem.
pub(super) fn mirrored(effort: &Effort) -> Result<Report, StudyError> {
    let mut report =
        Report::new("two discs that meet, beside one disc on a wall: relative differences", &["functions", "quantity"]);
    let disc = |name: &str, x: f64, speed: f64| {
        json!({ "name": name, "density": 1, "velocity": [speed, 0], "shape": { "ball": { "center": [x, 2.5], "radius": 1 } },
                "material": { "neo_hookean": { "young": 1000, "poisson": 0.3 } } })
    };
    let all = [("linear", json!("linear")), ("cubic", json!({ "bspline": { "degree": 3 } }))];
    for (name, functions) in all.into_iter().take(if *effort == Effort::Full { 2 } else { 1 }) {
        let scene = |bodies: Value, key: &str, contact: Value| {
            json!({ "grid": { "size": [10, 5], "spacing": 0.125 }, "time": { "step": 0.005, "end": 1 }, "approximation": functions,
                    "bodies": bodies, key: contact })
        };
        let both = scene(json!([disc("one", 3.9, 1.0), disc("two", 6.1, -1.0)]), "contact", json!({}));
        let wall = json!([{ "name": "wall", "stiffness": 2, "shape": { "half_space": { "point": [5, 0], "normal": [-1, 0] } } }]);
        let one = scene(json!([disc("one", 3.9, 1.0)]), "obstacles", wall);
        let both = rebound(&both, |step| step.pairs[0].force[0])?;
        let one = rebound(&one, |step| step.obstacles[0].force[0])?;
        for (i, quantity) in ["largest force", "rebound"].into_iter().enumerate() {
            report.push(&[name, quantity], (both[i] / one[i] - 1.0).abs(), Bound::AtMost(0.01));
        }
    }
    report.note("Bound: the error that issue 39 of the project allows in Hertz's and other forces is 1 to 3 %.");
    Ok(report)
}
