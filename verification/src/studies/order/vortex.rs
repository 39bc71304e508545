//! With inertia: the vortex of Kamojjala, Brannon, Sadeghirad and Guilkey, in a square whose edges stay at rest.

use super::{GAUSS, GAUSS_OF_MIDDLES, Held, Layout, NEAR, REGULAR, Refined};
use crate::manufactured::Vortex;
use crate::report::{Bound, Report};
use crate::studies::{Effort, Outcome, StudyError};
use crate::table::Table;
use bfree::approximation::{Approximation, Bspline, Linear};
use bfree::grid::Grid;
use bfree::mechanics::reference::GridReset;
use bfree::mechanics::schemes::{GeneralizedAlpha, Newmark, Scheme};
use bfree::particles::Particles;
use bfree::simulation::Settings;
use bfree::tensor::Vector;
use std::sync::Arc;

/// Half of the square's edge.
const HALF: f64 = 1.25;

/// The time of the error measurement; at t = 1 the vortex would be at rest.
const END: f64 = 0.8;

/// A run to the end.
fn spun(
    (shape, layout): (&Approximation, &Layout),
    settings: Settings,
    cells: u32,
    steps: u32,
) -> Result<Held<Vortex, 2>, StudyError> {
    let grid = Grid { origin: Vector::repeat(-HALF), spacing: 2.0 * HALF / f64::from(cells), cells: [cells; 2] };
    Held::new(Vortex::default(), grid, (shape, layout), None, END / f64::from(steps), settings)?.after(steps)
}

/// Δt falls with h², so that the error of the time scheme stays invisible. With ε = 1 the lumped mass limits the orders to 2, for any
/// functions. With ε = 0 functions of degree p on Gauss points have the orders p + 1, p + 1 and p. The stress of cubic ones under a lumped
/// mass is only shown: on these grids its own error, of order 3, is not small beside that of the mass.
fn in_space(effort: Effort, outcome: &mut Outcome) {
    use Effort::{Full, Short};
    let title = "a vortex, the grid kept, dt = 2.56 h^2";
    let mut report = Report::new(format!("{title}: order in h"), &["of", "shape", "layout", "eps"]);
    let header = [
        "shape",
        "layout",
        "eps",
        "cells",
        "displacement",
        "order",
        "velocity",
        "order",
        "stress",
        "order",
        "products x particles",
    ];
    let mut table = Table::new(format!("{title}: errors, relative, in the mean square"), header);
    // A lumped mass, and a consistent one with linear functions, show their orders on finer grids only.
    let cases = [
        (Short, "linear", Approximation::from(Linear), &REGULAR, 1.0, [20, 35], [Some(2.0), Some(2.0), Some(1.0)]),
        (Full, "cubic", Bspline::Cubic.into(), &GAUSS, 1.0, [35, 50], [Some(2.0), Some(2.0), None]),
        (Full, "linear", Linear.into(), &REGULAR, 0.0, [35, 50], [Some(2.0), Some(2.0), Some(1.0)]),
        (
            Full,
            "quadratic",
            Bspline::Quadratic.into(),
            &GAUSS_OF_MIDDLES,
            0.0,
            [20, 35],
            [Some(3.0), Some(3.0), Some(2.0)],
        ),
        (Short, "cubic", Bspline::Cubic.into(), &GAUSS, 0.0, [20, 35], [Some(4.0), Some(4.0), Some(3.0)]),
    ];
    for (_, name, shape, layout, lumping, sizes, orders) in cases.into_iter().filter(|case| case.0 <= effort) {
        let [displacement, velocity, stress] =
            orders.map(|order| order.map_or(Bound::Reported, |order| Bound::AtLeast(order - NEAR)));
        let least = [("displacement", displacement), ("velocity", velocity), ("stress", stress)];
        let refined = Refined { report: &mut report, table: &mut table, least };
        refined.run(&[name, layout.name, &lumping.to_string()], &sizes, |cells| {
            let settings = Settings { lumping, grid_reset: GridReset::Never, ..Settings::default() };
            let run = spun((&shape, layout), settings, cells, cells * cells / 20)?;
            Ok(([run.displacement(), run.velocity(), run.stress()], run.work))
        });
    }
    outcome.reports.push(report);
    outcome.tables.push(table);
}

/// √Σ over the particles of the squared differences of positions and velocities.
fn apart(a: &Particles<2>, b: &Particles<2>) -> [f64; 2] {
    let apart = |a: &[Vector<f64, 2>], b: &[Vector<f64, 2>]| {
        a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>().sqrt()
    };
    [apart(&a.position, &b.position), apart(&a.velocity, &b.velocity)]
}

/// Newmark's rule is of order 2 for γ = ½ and of order 1 otherwise (Hughes, The Finite Element Method, 9.1). The generalised-α method is of
/// order 2 for every ρ∞ (Chung and Hulbert, 1993). The runs with Δt and Δt/2 at one h differ in nothing else.
fn in_time(outcome: &mut Outcome) -> Result<(), StudyError> {
    let title = "a vortex, the grid kept: order in dt, from what dt, dt/2 and dt/4 differ by";
    let mut report = Report::new(title, &["of", "scheme"]);
    let generalized = |spectral_radius| Arc::new(GeneralizedAlpha { spectral_radius }) as Arc<dyn Scheme>;
    let schemes: [(Arc<dyn Scheme>, f64); 5] = [
        (Arc::new(Newmark::default()), 2.0),
        (Arc::new(Newmark { gamma: 0.6, beta: 0.3 }), 1.0),
        (generalized(0.0), 2.0),
        (generalized(0.5), 2.0),
        (generalized(1.0), 2.0),
    ];
    for (scheme, order) in schemes {
        let settings = || Settings { scheme: scheme.clone(), grid_reset: GridReset::Never, ..Settings::default() };
        let run = |steps| spun((&Linear.into(), &GAUSS), settings(), 10, steps);
        let [coarse, middle, fine] = [run(80)?, run(160)?, run(320)?].map(|run| run.simulation.particles.by_id());
        let (before, after) = (apart(&coarse, &middle), apart(&middle, &fine));
        for (k, what) in ["displacement", "velocity"].into_iter().enumerate() {
            let bound = Bound::Between(order - NEAR, order + NEAR);
            report.push(&[what, &scheme.name()], (before[k] / after[k]).log2(), bound);
        }
    }
    outcome.reports.push(report);
    Ok(())
}

pub(super) fn run(effort: Effort, outcome: &mut Outcome) -> Result<(), StudyError> {
    in_space(effort, outcome);
    in_time(outcome)
}
