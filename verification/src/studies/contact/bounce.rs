//! A ball that falls on a floor and bounces five times, with all defaults.

use super::{Effort, StudyError, built};
use crate::report::{Bound, Report};
use bfree::simulation::Simulation;
use rayon::prelude::*;
use serde_json::json;

const GRAVITY: f64 = 10.0;
const RADIUS: f64 = 0.3;
const DROP: f64 = 1.5;
const BOUNCES: usize = 5;

/// The highest rise of the middle after the first bounce, over the drop, and the share of the energy that is lost after all bounces.
fn ball<const D: usize>([spacing, step]: [f64; 2], last: usize) -> Result<[f64; 2], StudyError> {
    let of = |other: f64, up: f64| (0..D).map(|k| if k + 1 == D { up } else { other }).collect::<Vec<_>>();
    let mut simulation: Simulation<D> = built(&json!({
        "grid": { "size": of(1.6, 3.2), "spacing": spacing },
        "time": { "step": step, "end": 20 },
        "bodies": [{ "name": "ball", "density": 1000, "shape": { "ball": { "center": of(0.8, 0.4 + DROP + RADIUS), "radius": RADIUS } },
                     "material": { "neo_hookean": { "young": 1e6, "poisson": 0.3 } } }],
        "gravity": { "acceleration": of(0.0, -GRAVITY) },
        "obstacles": [{ "name": "floor", "shape": { "half_space": { "point": of(0.0, 0.4), "normal": of(0.0, 1.0) } } }]
    }))?;
    let height = |simulation: &Simulation<D>| {
        let particles = &simulation.particles;
        let sum: f64 = particles.mass.iter().zip(&particles.position).map(|(mass, x)| mass * x[D - 1]).sum();
        sum / particles.mass.iter().sum::<f64>() - 0.4 - RADIUS
    };
    let mass: f64 = simulation.particles.mass.iter().sum();
    let (mut bounces, mut touched, mut first) = (0, false, 0.0_f64);
    // The rise after the last bounce ends where the ball begins to fall.
    let mut rises = false;
    loop {
        let touches = simulation.advance()?.touches();
        bounces += usize::from(touched && !touches);
        touched = touches;
        if bounces == 1 {
            first = first.max(height(&simulation));
        }
        let rising = simulation.particles.momentum()[D - 1] > 0.0;
        if bounces >= last && !touches && rises && !rising {
            break;
        }
        rises = rising;
    }
    let energy =
        simulation.particles.kinetic_energy() + simulation.strain_energy() + mass * GRAVITY * height(&simulation);
    Ok([first / DROP, 1.0 - energy / (mass * GRAVITY * DROP)])
}

/// Dimension, spacing and step, and number of bounces of a ball.
type Case = (&'static str, [f64; 2], usize, fn([f64; 2], usize) -> Result<[f64; 2], StudyError>);

pub(super) fn report(effort: &Effort) -> Result<Report, StudyError> {
    let mut report = Report::new("a ball that bounces five times, with all defaults", &["D", "h", "quantity"]);
    let mut add = |dimension: &str, spacing: f64, [first, lost]: [f64; 2], converged: Option<f64>| {
        let labels = |quantity| [dimension.to_owned(), spacing.to_string(), String::from(quantity)];
        let mut push =
            |quantity, value, bound| report.push(&labels(quantity).each_ref().map(String::as_str), value, bound);
        push("energy lost", lost, Bound::AtMost(0.15));
        push("energy gained", -lost, Bound::AtMost(0.0));
        if let Some(converged) = converged {
            push("first height, beside the converged one", (first / converged - 1.0).abs(), Bound::AtMost(0.03));
        }
    };
    // The converged one is the last. Its first bounce alone is needed.
    let cases: &[Case] = match effort {
        Effort::Full => &[
            ("2", [0.1, 0.005], BOUNCES, ball::<2>),
            ("2", [0.05, 0.005], BOUNCES, ball::<2>),
            ("3", [0.1, 0.005], BOUNCES, ball::<3>),
            ("2", [0.025, 0.000625], 1, ball::<2>),
        ],
        Effort::Short => &[("2", [0.1, 0.005], BOUNCES, ball::<2>)],
    };
    let found: Vec<[f64; 2]> =
        cases.par_iter().map(|(_, resolution, bounces, ball)| ball(*resolution, *bounces)).collect::<Result<_, _>>()?;
    let converged = (*effort == Effort::Full).then(|| found[found.len() - 1][0]);
    for ((dimension, [spacing, _], ..), found) in cases.iter().zip(found).filter(|(case, _)| case.2 == BOUNCES) {
        add(dimension, *spacing, found, converged.filter(|_| *dimension == "2"));
    }
    report.note("Bounds: issue 52 of the project. The converged height is that of a quarter of the spacing and an eighth of the step.");
    if *effort == Effort::Full {
        report.note("Not run: three dimensions at half the spacing, 60,288 particles, which take about two hours.");
    }
    Ok(report)
}
