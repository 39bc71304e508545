//! An equilibrium path with two turning points: Williams' toggle frame (Quart. J. Mech. Appl. Math. 17, 1964), two shallow bars and a rigid
//! joint.

use super::super::{Effort, StudyError};
use crate::report::{Bound, Report};
use bfree::scene;
use bfree::simulation::Simulation;
use serde_json::json;

const LENGTH: f64 = 10.0;
const RISE: f64 = 0.5;
const DEPTH: f64 = 0.25;
const YOUNG: f64 = 1e6;

/// The error of the shallow theory is β². The formula has a point joint; the load acts over a quarter of the depth.
const SHALLOW: f64 = 0.03;

/// Half of the frame, from its clamped foot to the joint, which slides down the plane of symmetry under half of the load, 100 λ.
fn toggle(cells: u32) -> Result<Simulation<2>, StudyError> {
    let joint = json!({"box": {"min": [LENGTH - 0.25 * DEPTH, 2], "max": [LENGTH, 3]}});
    let scene = json!({
        "grid": {"size": [LENGTH, 4], "spacing": DEPTH / f64::from(cells)},
        "time": {"step": 0.02, "end": 1, "scheme": "arc_length"},
        "bodies": [{
            "name": "bar", "shape": {"box": {"min": [0, 1.75], "max": [LENGTH, 2]}}, "density": 1, "particles_per_cell": 2,
            "material": {"neo_hookean": {"young": YOUNG, "poisson": 0}}
        }],
        "boundary": {"left": "fixed", "right": "sliding"},
        "tractions": [{"body": "bar", "region": joint, "traction": [0, -400.0 / DEPTH], "curve": [[-10, -10], [10, 10]]}]
    });
    let mut simulation: Simulation<2> = scene::read(&scene.to_string(), &[])?.build(".".as_ref())?;
    // The bars rise. They are sheared, so that their ends stay on the walls.
    simulation.particles.position.iter_mut().for_each(|x| x[1] += RISE / LENGTH * x[0]);
    Ok(simulation)
}

/// λ at the joint's displacement δ, of bars with EA and EI that carry a compression C = EI κ²/L², k = κ/L:
///
/// w(x) = a (1 − cos kx) + b (kx − sin kx),  w(L) = δ,  w′(L) = 0;  C L/EA = β δ − ½ ∫ w′² dx;  ½ P = C (β − k b)
fn williams(displacement: f64) -> f64 {
    let (ea, ei, slope) = (YOUNG * DEPTH, YOUNG * DEPTH.powi(3) / 12.0, RISE / LENGTH);
    let amplitudes = |kappa: f64| {
        let b = displacement / (kappa - 2.0 * (kappa / 2.0).tan());
        (-b * (kappa / 2.0).tan(), b)
    };
    let excess = |kappa: f64| {
        let (a, b) = amplitudes(kappa);
        let (sine, cosine, twice) = (kappa.sin(), kappa.cos(), (2.0 * kappa).sin());
        let mixed = (1.0 - cosine) - 0.5 * sine * sine;
        let of_b = 1.5 * kappa - 2.0 * sine + 0.25 * twice;
        let squares = a * a * (0.5 * kappa - 0.25 * twice) + 2.0 * a * b * mixed + b * b * of_b;
        ei * kappa * kappa / (LENGTH * ea) - (slope * displacement - 0.5 * squares * kappa / LENGTH)
    };
    let (mut low, mut high) = (1e-3, 2.0 * std::f64::consts::PI - 1e-9);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if excess(middle) < 0.0 { low = middle } else { high = middle }
    }
    ei * (low / LENGTH).powi(2) * (slope - low / LENGTH * amplitudes(low).1) / 100.0
}

/// The path by arc length, from the start over both turning points until the bars are under tension.
pub(super) fn snap_through(effort: Effort) -> Result<Report, StudyError> {
    let mut report =
        Report::new("snap-through of a toggle frame, by the length of its path", &["quantity", "cells in the depth"]);
    let depths: &[u32] = match effort {
        Effort::Short => &[4],
        Effort::Full => &[4, 8],
    };
    for &cells in depths {
        let (mut simulation, labels) = (toggle(cells)?, cells.to_string());
        let start = simulation.particles.by_id().position;
        // The displacement of the joint is the mean over its particles, since the bars have a depth.
        let last = start.iter().fold(0.0_f64, |last, x| last.max(x[0]));
        let joint: Vec<usize> = (0..start.len()).filter(|&p| start[p][0] > last - 1e-6).collect();
        let (mut worst, mut loads, mut iterations, mut displacement) = (0.0_f64, Vec::new(), 0, 0.0);
        while displacement < 1.6 * RISE {
            let step = simulation.advance()?;
            let now = simulation.particles.by_id().position;
            displacement = joint.iter().map(|&p| start[p][1] - now[p][1]).sum::<f64>() / joint.len() as f64;
            worst = worst.max((simulation.path.load - williams(displacement)).abs());
            loads.push(simulation.path.load);
            iterations = iterations.max(step.newton.history.iterations.len());
        }
        let turns: Vec<f64> = loads.windows(3).filter(|l| (l[1] - l[0]) * (l[2] - l[1]) < 0.0).map(|l| l[1]).collect();
        report.push(&["turning points", &labels], turns.len() as f64, Bound::Between(2.0, 2.0));
        // With four cells the bars are too soft for the bound.
        let bound = if cells > 4 { Bound::AtMost(SHALLOW) } else { Bound::Reported };
        let limit = turns.first().copied().unwrap_or(f64::NAN);
        report.push(&["load against Williams', over the first limit load", &labels], worst / limit, bound);
        report.push(&["load steps", &labels], loads.len() as f64, Bound::Reported);
        report.push(&["most Newton iterations of a step", &labels], iterations as f64, Bound::Reported);
    }
    report
        .note("Two shallow bars, rise over length 0.05, rise over depth 2: closed form, with bending and shortening.");
    Ok(report)
}
