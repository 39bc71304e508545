//! With inertia: the vortex of Kamojjala, Brannon, Sadeghirad and Guilkey, in a square that it leaves at rest along its edges.

use super::{GAUSS, Held, Layout, NEAR, REGULAR, Refined, figure, line};
use crate::manufactured::Vortex;
use crate::report::{Bound, Report};
use crate::studies::{Effort, Outcome, StudyError};
use crate::table::Table;
use bfree::approximation::{Approximation, Bspline, Linear};
use bfree::grid::Grid;
use bfree::mechanics::kept::Renewal;
use bfree::mechanics::schemes::{GeneralizedAlpha, Newmark, Scheme};
use bfree::simulation::Settings;
use bfree::tensor::Vector;
use std::sync::Arc;

/// Half of the square's edge.
const HALF: f64 = 1.25;

/// When errors are looked at: at t = 1 the vortex stands still.
const END: f64 = 0.8;

/// Steps for each cell across the square: waves, which travel 1.16 per unit of time, cross 0.37 of a cell in each.
const STEPS_PER_CELL: u32 = 1;

/// ε of the mass.
const LUMPING: f64 = 1.0;

/// A run to the end.
fn spun(
    (shape, layout): (&Approximation, &Layout),
    cells: u32,
    steps: u32,
    scheme: Arc<dyn Scheme>,
    lumping: f64,
) -> Result<Held<Vortex, 2>, StudyError> {
    let grid = Grid { origin: Vector::repeat(-HALF), spacing: 2.0 * HALF / f64::from(cells), cells: [cells; 2] };
    let settings = Settings { scheme, lumping, renewal: Renewal::Never, ..Settings::default() };
    Held::new(Vortex::default(), grid, (shape, layout), END / f64::from(steps), settings)?.after(steps)
}

/// Δt and h refined together: no order is above that of the time scheme, 2.
fn in_space(effort: Effort, outcome: &mut Outcome) {
    let title = "a vortex, the grid kept, dt = 0.32 h";
    let mut report = Report::new(format!("{title}: order in h"), &["of", "shape", "layout"]);
    let header =
        ["shape", "layout", "cells", "displacement", "order", "velocity", "order", "stress", "order", "products x particles"];
    let mut table = Table::new(format!("{title}: errors, relative, in the mean square"), header);
    let sizes: &[u32] = if effort == Effort::Full { &[20, 40, 80] } else { &[20, 40] };
    let mut lines = Vec::new();
    for (name, shape, layout, of_stress) in [
        ("linear", Approximation::from(Linear), &REGULAR, 1.0),
        ("quadratic", Bspline::Quadratic.into(), &REGULAR, 1.8),
        ("quadratic", Bspline::Quadratic.into(), &GAUSS, 2.0),
        ("cubic", Bspline::Cubic.into(), &REGULAR, 1.5),
        ("cubic", Bspline::Cubic.into(), &GAUSS, 2.0),
    ] {
        let least = [("displacement", 2.0), ("velocity", 2.0), ("stress", of_stress)];
        let least = least.map(|(what, order)| (what, Bound::AtLeast(order - NEAR)));
        let refined = Refined { report: &mut report, table: &mut table, least };
        let found = refined.run(&[name, layout.name], sizes, |cells| {
            let run = spun((&shape, layout), cells, cells * STEPS_PER_CELL, Arc::new(Newmark::default()), LUMPING)?;
            Ok(([run.displacement(), run.velocity(), run.stress()], run.work))
        });
        lines.push(line(&format!("{name}, {}", layout.name), found.iter().map(|(cells, errors)| (*cells, errors[2]))));
    }
    outcome.figures.push(figure("vortex", "stress of a vortex, the grid kept, dt = 0.32 h", lines));
    outcome.reports.push(report);
    outcome.tables.push(table);
}

/// Newmark's rule is of order 2 for γ = ½ and of order 1 otherwise (Hughes, The Finite Element Method, 9.1), the generalised-α method of
/// order 2 for every ρ∞ (Chung and Hulbert, 1993). Between Δt and Δt/2 at one h nothing else differs.
fn in_time(effort: Effort, outcome: &mut Outcome) -> Result<(), StudyError> {
    let mut report =
        Report::new("a vortex, the grid kept: order in dt, from differences between dt and dt/2", &["of", "scheme", "shape"]);
    let generalized = |spectral_radius| Arc::new(GeneralizedAlpha { spectral_radius }) as Arc<dyn Scheme>;
    let schemes: [(Arc<dyn Scheme>, f64); 5] = [
        (Arc::new(Newmark::default()), 2.0),
        (Arc::new(Newmark { gamma: 0.6, beta: 0.3 }), 1.0),
        (generalized(0.0), 2.0),
        (generalized(0.5), 2.0),
        (generalized(1.0), 2.0),
    ];
    let (linear, cubic) = (Approximation::from(Linear), Approximation::from(Bspline::Cubic));
    let finest = if effort == Effort::Full { 320 } else { 160 };
    for (scheme, order) in schemes {
        for (name, shape) in [("linear", &linear), ("cubic", &cubic)] {
            let run = |halvings: u32| -> Result<_, StudyError> {
                let run = spun((shape, &GAUSS), 10, finest >> halvings, scheme.clone(), LUMPING)?;
                Ok(run.simulation.particles.by_id())
            };
            let runs = [run(2)?, run(1)?, run(0)?];
            let apart = |a: &[Vector<f64, 2>], b: &[Vector<f64, 2>]| a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>().sqrt();
            let [coarse, fine] = [0, 1].map(|k| {
                let (a, b) = (&runs[k], &runs[k + 1]);
                [apart(&a.position, &b.position), apart(&a.velocity, &b.velocity)]
            });
            for (k, what) in ["displacement", "velocity"].into_iter().enumerate() {
                let found = (coarse[k] / fine[k]).log2();
                report.push(&[what, &scheme.to_string(), name], found, Bound::Between(order - NEAR, order + NEAR));
            }
        }
    }
    outcome.reports.push(report);
    Ok(())
}

pub(super) fn run(effort: Effort, outcome: &mut Outcome) -> Result<(), StudyError> {
    in_space(effort, outcome);
    in_time(effort, outcome)
}
