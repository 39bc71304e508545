//! An elastic bar that hits a rigid wall and leaves it: a wave runs to the free end and back, and the force is constant meanwhile.
//!
//! E = 3e7, ρ = 0.73, L = 10, A = 1, gap 0.01, v₀ = 202.2, ν = 0 in 1D. Impact at gap/v₀, release 2 L/c later, with the force ρ c v₀ A of
//! small strains and c = √(E/ρ).

use super::{Effort, StudyError, built};
use crate::report::{Bound, Report};
use crate::table::Table;
use serde_json::json;

const YOUNG: f64 = 3e7;
const DENSITY: f64 = 0.73;
const LENGTH: f64 = 10.0;
const GAP: f64 = 0.01;
const SPEED: f64 = 202.2;

/// Times this near to impact and release, relative to the time of contact, do not belong to the plateau of the force.
const AT_ENDS: f64 = 0.1;

/// The results of one impact.
struct Impact {
    /// Errors relative to the exact values: the time of release and the mean force.
    release: f64,
    force: f64,
    /// The standard deviation of the force on the plateau, relative to the exact force.
    deviation: f64,
    /// The mean velocity after release over −v₀.
    rebound: f64,
    /// The lost energy over the initial energy.
    lost: f64,
}

fn impact(cells: u32) -> Result<Impact, StudyError> {
    let (h, c) = (LENGTH / f64::from(cells), (YOUNG / DENSITY).sqrt());
    let (dt, duration) = (0.5 * h / c, 2.0 * LENGTH / c);
    let scene = json!({
        "grid": { "size": [f64::from(cells + cells / 2 + 4) * h], "spacing": h, "origin": [-4.0 * h] },
        "time": { "step": dt, "end": 1, "scheme": { "generalized_alpha": { "spectral_radius": 0.5 } }, "lumping": 0 },
        "bodies": [{ "name": "bar", "density": DENSITY, "velocity": [-SPEED], "shape": { "box": { "min": [GAP], "max": [GAP + LENGTH] } },
                     "material": { "neo_hookean": { "young": YOUNG, "poisson": 0 } } }],
        "obstacles": [{ "name": "wall", "shape": { "half_space": { "point": [0], "normal": [1] } }, "stiffness": 3 }]
    });
    let mut simulation = built::<1>(&scene)?;
    let energy = simulation.particles.kinetic_energy();
    let (start, mut last, mut plateau) = (GAP / SPEED, 0.0, Vec::new());
    while simulation.clock.time() < start + 1.2 * duration {
        let step = simulation.advance()?;
        let (time, force) = (simulation.clock.time(), -step.obstacles[0].force[0]);
        if force > 0.0 {
            last = time;
        }
        if (AT_ENDS..1.0 - AT_ENDS).contains(&((time - start) / duration)) {
            plateau.push(force);
        }
    }
    let exact = DENSITY * c * SPEED;
    let mean = plateau.iter().sum::<f64>() / plateau.len() as f64;
    let variance = plateau.iter().map(|force| (force - mean).powi(2)).sum::<f64>() / plateau.len() as f64;
    let rest = simulation.particles.kinetic_energy() + simulation.strain_energy() + simulation.contact_energy();
    Ok(Impact {
        release: (last - start) / duration - 1.0,
        force: mean / exact - 1.0,
        deviation: variance.sqrt() / exact,
        rebound: simulation.particles.momentum()[0] / (DENSITY * LENGTH * SPEED),
        lost: 1.0 - rest / energy,
    })
}

pub(super) fn report(effort: &Effort) -> Result<(Report, Table), StudyError> {
    let mut report =
        Report::new("impact of a bar on a wall: errors relative to the exact values", &["cells", "quantity"]);
    let mut table = Table::new(
        "impact of a bar on a wall",
        ["cells", "time of release", "mean force", "deviation of the force", "rebound", "energy lost"],
    );
    for cells in if *effort == Effort::Full { vec![40, 80, 160, 320] } else { vec![40, 80] } {
        let Impact { release, force, deviation, rebound, lost } = impact(cells)?;
        let name = cells.to_string();
        report.push(&[&name, "time of release"], release.abs(), Bound::AtMost(0.01));
        report.push(&[&name, "mean force"], force.abs(), Bound::AtMost(0.02));
        report.push(&[&name, "deviation of the force"], deviation, Bound::AtMost(0.05));
        report.push(&[&name, "rebound above v0"], rebound - 1.0, Bound::AtMost(0.0));
        if cells >= 80 {
            report.push(&[&name, "rebound below v0"], 1.0 - rebound, Bound::AtMost(0.02));
            report.push(&[&name, "energy lost"], lost, Bound::AtMost(0.02));
        }
        let percent = |x: f64| format!("{:+.2} %", 100.0 * x);
        let row = [percent(release), percent(force), percent(deviation), format!("{rebound:.4}"), percent(lost)];
        table.push(std::iter::once(name).chain(row));
    }
    report.note("Bounds: issue 39 of the project, from a prototype. The exact values are those of small strains; the strain here is 3 %.");
    Ok((report, table))
}
