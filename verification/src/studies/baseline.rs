//! One linear system of the static block, solved in three ways: the cost of assembly and factorisation against iteration.

use super::{Effort, Outcome, StudyError};
use crate::prepared::Prepared;
use crate::processor::Thread;
use crate::report::{Bound, Report};
use crate::shipped;
use crate::table::Table;
use bfree::plan::Plan;
use bfree::pooled::Pool;
use bfree::simulation::Simulation;
use bfree::solver::{
    ConjugateGradientSettings, LinearReport, Preconditioner, Preconditioning, conjugate_gradient,
};

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "one linear system by conjugate gradients with each preconditioner, and by a direct solve";

/// The required relative residual.
const SOLVE: f64 = 1e-8;

/// The limits of a factorisation. Its seconds grow as the square of the unknowns in 3D.
const MOST_SECONDS: f64 = 60.0;
const MOST_BYTES: u64 = 8 << 30;

const FAMILIES: [(&str, &str); 3] =
    [("linear", "\"linear\""), ("cubic", "{\"bspline\": {\"degree\": 3}}"), ("LME 3", "{\"lme\": {\"gamma\": 3}}")];

/// K d = −R at the first state of Newton's method, with half of the load, on one thread.
pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let (report, table) = pool.install(|| measured(*effort).map_err(|error| error.to_string()))?;
    let mut remarks = Vec::new();
    if !Preconditioning::HAS_DIRECT {
        remarks.push("The direct solve needs `--features direct` (faer takes a minute to build).".into());
    }
    Ok(Outcome { reports: vec![report], tables: vec![table], remarks, ..Outcome::default() })
}

fn measured(effort: Effort) -> Result<(Report, Table), StudyError> {
    let mut report = Report::new("the static block, one linear system", &["quantity", "shape", "cells", "by"]);
    let mut table = Table::new(
        "one linear system of scenes/block_static.json to 1e-8, from Δφ to d: CPU seconds of one thread, and the megabytes that a solve reads",
        ["shape", "cells a side", "particles", "unknowns", "by", "iterations", "s", "MB"],
    );
    let cells: &[u32] = if effort == Effort::Full { &[7, 16, 30] } else { &[4] };
    for (name, family) in FAMILIES {
        // The unknowns and seconds of the last factorisation.
        let mut factorised: Option<(f64, f64)> = None;
        for &cells in cells {
            let mut simulation = block(family, cells)?;
            for by in [Preconditioning::Direct, Preconditioning::BlockJacobi, Preconditioning::Multigrid] {
                simulation.settings.preconditioner = by;
                let plan = Plan::of(&simulation)?;
                let unknowns = plan.unknowns as f64;
                let forecast = factorised.map_or(0.0, |(fewer, seconds)| seconds * (unknowns / fewer).powi(2));
                let labels = ["relative residual", name, &cells.to_string(), &by.to_string()];
                let tried = by != Preconditioning::Direct
                    || Preconditioning::HAS_DIRECT && forecast < MOST_SECONDS && plan.bytes() < MOST_BYTES;
                let mut row = vec![name.into(), cells.to_string(), plan.particles.to_string(), plan.unknowns.to_string(), by.to_string()];
                if tried {
                    let Solved { report: solved, seconds, factor } = solve(&simulation, by)?;
                    report.push(&labels, solved.relative_residual, Bound::AtMost(SOLVE));
                    if by == Preconditioning::Direct {
                        factorised = Some((unknowns, seconds));
                    }
                    row.push(solved.iterations.to_string());
                    row.extend([format!("{seconds:.3}"), format!("{:.1}", (read(&plan) + factor) as f64 / 1e6)]);
                } else {
                    row.extend(["-".into(), "-".into(), "-".into()]);
                }
                table.push(row);
            }
        }
    }
    Ok((report, table))
}

fn block(family: &str, cells: u32) -> Result<Simulation<3>, StudyError> {
    let (spacing, family) = (format!("grid.spacing={}", 1.0 / f64::from(cells)), format!("approximation={family}"));
    shipped::simulation("block_static", &[&spacing, &family])
}

struct Solved {
    report: LinearReport,
    seconds: f64,
    /// Bytes of the factor of a direct solve.
    factor: u64,
}

fn solve(simulation: &Simulation<3>, by: Preconditioning) -> Result<Solved, StudyError> {
    let prepared = Prepared::new(simulation)?;
    let (equilibrium, dphi, pool) = (prepared.equilibrium(simulation), prepared.initial_guess(simulation), Pool::default());
    let mut right = equilibrium.residual::<f64>(&dphi)?;
    equilibrium.clear_prescribed(&mut right);
    right.iter_mut().for_each(|r| *r = -*r);
    let right: &[f64] = bytemuck::cast_slice(&right);
    let settings = ConjugateGradientSettings { relative_tolerance: SOLVE, max_iterations: 10_000 };
    let mut d = vec![0.0; right.len()];
    let mut timed = |preconditioner: &mut dyn Preconditioner| -> Result<(LinearReport, f64), StudyError> {
        let start = Thread::now();
        let tangent = equilibrium.tangent(&dphi)?;
        let inverse = preconditioner.prepare(&tangent);
        let report = conjugate_gradient(&tangent, &*inverse, right, &mut d, &settings, &pool)?;
        Ok((report, start.elapsed()))
    };
    #[cfg(feature = "direct")]
    if by == Preconditioning::Direct {
        let mut direct = bfree::solver::Direct::<3>::default();
        let (report, seconds) = timed(&mut direct)?;
        return Ok(Solved { report, seconds, factor: direct.bytes().unwrap_or(0) as u64 });
    }
    let (report, seconds) = timed(&mut *by.anew::<3>())?;
    Ok(Solved { report, seconds, factor: 0 })
}

/// The bytes that a solve reads, without the factor, for which a plan knows only a bound.
fn read(plan: &Plan) -> u64 {
    let arrays = plan.arrays.iter().filter(|array| {
        let of_solve = ["shape functions", "frozen tangent", "preconditioner", "Krylov vectors"];
        of_solve.iter().any(|name| array.name.starts_with(name)) && !array.name.contains("factor")
    });
    arrays.map(|array| array.bytes).sum()
}
