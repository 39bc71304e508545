//! Obstacles pressed into bodies: a patch test, and Hertz's contact along a line and in a point.

use super::{StudyError, built};
use crate::report::{Bound, Report};
use bfree::material::{Law, Material, MaterialState};
use bfree::tensor::Tensor;
use serde_json::json;
use std::f64::consts::PI;

const YOUNG: f64 = 1000.0;
const POISSON: f64 = 0.3;

/// E* = E/(1 − ν²)
const PLANE: f64 = YOUNG / (1.0 - POISSON * POISSON);

/// σ_yy at F = I + H.
fn vertical_stress(law: &Material, h: &Tensor<f64, 2>) -> f64 {
    let at = MaterialState::new(*h);
    (at.f * law.stress(&at) * at.f.transpose() / at.jacobian)[(1, 1)]
}

/// A block that is free to widen is pressed by 1e-4 of its height: all stresses are those of uniaxial stress in plane strain.
pub(super) fn patch() -> Result<Report, StudyError> {
    let mut report =
        Report::new("patch test: error of the stress, worst particle", &["functions", "side of the block"]);
    for functions in ["linear", "cubic"] {
        let approximation = if functions == "linear" { json!("linear") } else { json!({ "bspline": { "degree": 3 } }) };
        // On the grid, and with cut cells.
        for side in [1.0, 1.05] {
            let strain = 1e-4;
            let scene = json!({
                "grid": { "size": [2, 2], "spacing": 0.125 },
                "approximation": approximation,
                "time": { "step": 1, "end": 1, "scheme": "none" },
                "bodies": [{ "name": "block", "density": 1, "shape": { "box": { "min": [0, 0], "max": [side, side] } },
                             "material": { "neo_hookean": { "young": YOUNG, "poisson": POISSON } } }],
                "boundary": { "left": "sliding", "bottom": "sliding" },
                "obstacles": [{ "name": "plate", "shape": { "half_space": { "point": [0, side], "normal": [0, -1] } }, "stiffness": 10,
                                "displacement": [[0, [0, 0]], [1, [0, -strain * side]]] }]
            });
            let mut simulation = built::<2>(&scene)?;
            let step = simulation.advance()?;
            let shortened = strain - step.obstacles[0].depth / side;
            let exact = -PLANE * shortened;
            let particles = &simulation.particles;
            let law = &simulation.bodies[0].law;
            let solid = (0..particles.len()).filter(|&p| particles.is_solid(p));
            let error = |p: usize| (vertical_stress(law, &particles.displacement_gradient[p]) / exact - 1.0).abs();
            let worst = solid.map(error).fold(0.0, f64::max);
            report.push(&[functions, &side.to_string()], worst, Bound::AtMost(0.01));
        }
    }
    report.note("The shortening is that of the plate less the depth of the penalty.");
    Ok(report)
}

/// A rigid cylinder pressed into a wide block, half of it between planes of symmetry: p₀ = √(F E*/(π R)) and a = √(4 F R/(π E*)).
pub(super) fn hertz() -> Result<Report, StudyError> {
    let mut report = Report::new("Hertz, line contact: errors", &["cells over the contact", "quantity"]);
    let (radius, approach) = (10.0, 0.025);
    for h in [0.074_f64, 0.037] {
        let side = (6.0 / h).ceil() * h;
        let scene = json!({
            "grid": { "size": [side + 2.0 * h, side + 2.0 * h], "spacing": h },
            "time": { "step": 0.25, "end": 1, "scheme": "none" },
            "bodies": [{ "name": "block", "density": 1, "shape": { "box": { "min": [0, 0], "max": [side, side] } },
                         "material": { "neo_hookean": { "young": YOUNG, "poisson": POISSON } } }],
            "boundary": { "left": "sliding", "bottom": "sliding" },
            "obstacles": [{ "name": "cylinder", "shape": { "ball": { "center": [0, side + radius], "radius": radius } }, "stiffness": 10,
                            "displacement": [[0, [0, 0]], [1, [0, -approach]]] }]
        });
        let mut simulation = built::<2>(&scene)?;
        let mut contact = None;
        while simulation.clock.time() < 1.0 - 1e-9 {
            contact = simulation.advance()?.obstacles.first().copied();
        }
        let contact = contact.ok_or("no obstacle")?;
        // Both halves.
        let force = 2.0 * contact.force[1].abs();
        let modulus = bfree::material::p_wave_modulus(&simulation.bodies[0].law);
        let pressure = 10.0 * modulus / h * contact.depth;
        let width = (4.0 * force * radius / (PI * PLANE)).sqrt();
        let largest = (force * PLANE / (PI * radius)).sqrt();
        let cells = format!("{:.0}", 2.0 * width / h);
        report.push(&[&cells, "largest pressure"], (pressure / largest - 1.0).abs(), Bound::AtMost(0.03));
        // The area is a sum over points, each half a cell wide.
        let resolution = 0.5 * h / width;
        report.push(&[&cells, "half width"], (contact.area / width - 1.0).abs(), Bound::AtMost(0.03 + resolution));
    }
    report.note("Bound: 3 % at 20 cells by issue 39 of the project. The bound of the half width has one point more.");
    Ok(report)
}

/// The approach of a sphere of radius 1 to each of two plates that press it by the force F, without the part that Hertz leaves out: an
/// elastic sphere is shorter than its two halves as half-spaces (Tatara, J. Eng. Mater. Technol. 113, 1991). With the half width a of
/// the contact, δ_H = δ + F f(a)/(π E) with f = 2 (1 + ν)/(a² + 4)^(3/2) + (1 − ν²)/(a² + 4)^(1/2).
fn as_half_spaces(approach: f64, force: f64) -> f64 {
    let a = (0.75 * force / PLANE).cbrt();
    let far = a * a + 4.0;
    let f = 2.0 * (1.0 + POISSON) / far.powf(1.5) + (1.0 - POISSON * POISSON) / far.sqrt();
    approach + force * f / (PI * YOUNG)
}

/// An eighth of a sphere between planes of symmetry is pressed by a plate: F = 4/3 E* δ_H^(3/2) for the radius 1.
pub(super) fn point() -> Result<Report, StudyError> {
    let mut report = Report::new("Hertz, point contact: errors", &["cells in the radius", "quantity"]);
    let approach = 0.08;
    for cells in [12_u32, 16] {
        let h = 1.0 / f64::from(cells);
        let side = 1.0 + 2.0 * h;
        let scene = json!({
            "grid": { "size": [side, side, side], "spacing": h },
            "time": { "step": 0.25, "end": 1, "scheme": "none" },
            "bodies": [{ "name": "sphere", "density": 1, "material": { "neo_hookean": { "young": YOUNG, "poisson": POISSON } },
                         "shape": { "intersection": [{ "ball": { "center": [0, 0, 0], "radius": 1 } }, { "box": { "min": [0, 0, 0], "max": [1, 1, 1] } }] } }],
            "boundary": { "left": "sliding", "bottom": "sliding", "back": "sliding" },
            "obstacles": [{ "name": "plate", "shape": { "half_space": { "point": [0, 0, 1], "normal": [0, 0, -1] } }, "stiffness": 10,
                            "displacement": [[0, [0, 0, 0]], [1, [0, 0, -approach]]] }]
        });
        let mut simulation = built::<3>(&scene)?;
        let (mut logarithms, mut worst) = (Vec::new(), 0.0_f64);
        while simulation.clock.time() < 1.0 - 1e-9 {
            let plate = simulation.advance()?.obstacles.first().copied().ok_or("no obstacle")?;
            // All four quarters, and the approach without the depth of the penalty.
            let force = 4.0 * plate.force[2];
            let delta = as_half_spaces(approach * simulation.clock.time() - plate.depth, force);
            worst = worst.max((force / (4.0 / 3.0 * PLANE * delta.powf(1.5)) - 1.0).abs());
            logarithms.push((delta.ln(), force.ln()));
        }
        let cells = cells.to_string();
        report.push(&[&cells, "force"], worst, Bound::AtMost(0.03));
        report.push(&[&cells, "exponent"], slope(&logarithms) - 1.5, Bound::Between(-0.03, 0.03));
    }
    report.note("Bounds: 3 % and 0.03 by issue 39 of the project. The approach is that of half-spaces, by Tatara's correction for a whole sphere.");
    Ok(report)
}

/// The slope of a line through points, by least squares.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let product = |of: fn(f64, f64) -> f64| points.iter().map(|point| of(point.0 - x, point.1 - y)).sum::<f64>();
    product(|x, y| x * y) / product(|x, _| x * x)
}
