//! One linear system of the static block, with each preconditioner.

use super::{Effort, Outcome, StudyError};
use crate::processor::Thread;
use crate::report::{Bound, Report};
use crate::shipped;
use crate::table::Table;
use bfree::plan::Plan;
use bfree::pooled::Pool;
use bfree::simulation::Simulation;
use bfree::solver::{ConjugateGradientSettings, LinearReport, Preconditioning, System};

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "one linear system by conjugate gradients with each preconditioner";

/// The required relative residual.
const SOLVE: f64 = 1e-8;

const FAMILIES: [(&str, &str); 3] =
    [("linear", "\"linear\""), ("cubic", "{\"bspline\": {\"degree\": 3}}"), ("LME 3", "{\"lme\": {\"gamma\": 3}}")];

/// K d = −R at the first state of Newton's method, with half of the load, on one thread.
pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let (report, table) = pool.install(|| measured(*effort).map_err(|error| error.to_string()))?;
    Ok(Outcome { reports: vec![report], tables: vec![table], ..Outcome::default() })
}

fn measured(effort: Effort) -> Result<(Report, Table), StudyError> {
    let mut report = Report::new("the static block, one linear system", &["quantity", "shape", "cells", "by"]);
    let mut table = Table::new(
        "one linear system of scenes/block_static.json to 1e-8, from Δφ to d: CPU seconds of one thread, and the megabytes that a solve reads",
        ["shape", "cells a side", "particles", "unknowns", "by", "iterations", "s", "MB"],
    );
    let cells: &[u32] = if effort == Effort::Full { &[7, 16, 30] } else { &[4] };
    for (name, family) in FAMILIES {
        for &cells in cells {
            let mut simulation = block(family, cells)?;
            for by in [Preconditioning::BlockJacobi, Preconditioning::Multigrid] {
                simulation.settings.preconditioner = by;
                let plan = Plan::of(&simulation)?;
                let labels = ["relative residual", name, &cells.to_string(), &by.to_string()];
                let (solved, seconds) = solve(&simulation, by)?;
                report.push(&labels, solved.relative_residual, Bound::AtMost(SOLVE));
                table.push([
                    name.into(),
                    cells.to_string(),
                    plan.particles.to_string(),
                    plan.unknowns.to_string(),
                    by.to_string(),
                    solved.iterations.to_string(),
                    format!("{seconds:.3}"),
                    format!("{:.1}", read(&plan) as f64 / 1e6),
                ]);
            }
        }
    }
    Ok((report, table))
}

fn block(family: &str, cells: u32) -> Result<Simulation<3>, StudyError> {
    let (spacing, family) = (format!("grid.spacing={}", 1.0 / f64::from(cells)), format!("approximation={family}"));
    shipped::simulation("block_static", &[&spacing, &family])
}

fn solve(simulation: &Simulation<3>, by: Preconditioning) -> Result<(LinearReport, f64), StudyError> {
    let coming = simulation.next_step()?;
    let (equilibrium, dphi, pool) = (coming.equilibrium(), coming.initial_guess(), Pool::default());
    let mut right = equilibrium.residual::<f64>(&dphi)?;
    equilibrium.clear_prescribed(&mut right);
    right.iter_mut().for_each(|r| *r = -*r);
    let right: &[f64] = bytemuck::cast_slice(&right);
    let settings = ConjugateGradientSettings { relative_tolerance: SOLVE, max_iterations: 10_000 };
    let mut d = vec![0.0; right.len()];
    let (start, mut preconditioner) = (Thread::now(), by.build::<3>());
    let tangent = equilibrium.tangent(None, &dphi)?;
    let inverse = preconditioner.prepare(&tangent);
    let system = System { vectors: &pool, operator: &tangent, inverse: &*inverse };
    let report = settings.solve(&system, right, &mut d)?;
    Ok((report, start.elapsed()))
}

/// The bytes that a solve reads.
fn read(plan: &Plan) -> u64 {
    let arrays = plan.arrays.iter().filter(|array| {
        let of_solve = ["shape functions", "frozen tangent", "preconditioner", "Krylov vectors"];
        of_solve.iter().any(|name| array.name.starts_with(name)) && !array.name.contains("factor")
    });
    arrays.map(|array| array.bytes).sum()
}
