//! Step 3: the linear system of one iteration.

use super::failure::LinearSolverFailure;
use super::report::NewtonCounts;
use super::settings::{FALLBACK_RESTART, Krylov, NewtonSettings};
use crate::pooled::Pooled;
use crate::solver::conjugate_gradient::{ConjugateGradientSettings, conjugate_gradient};
use crate::solver::forcing::LOOSEST;
use crate::solver::gmres::{GmresSettings, gmres};
use crate::solver::vector::{Entry, norm};
use crate::solver::{LinearOperator, LinearOutcome, LinearReport, Linearization};

/// The least relative residual asked for in single precision: what a recurrence of vectors rounded to 6e-8 can still reach.
pub(super) const SINGLE_TOLERANCE: f64 = 1e-5;

/// A solve that gave a step.
pub(super) struct Solved {
    /// d
    pub step: Pooled<f64>,
    /// The report of the solve that gave d.
    pub krylov: LinearReport,
    /// That of conjugate gradients given up before.
    pub negative_curvature: Option<LinearReport>,
}

/// `K d = −r` as (K/s) d' = −r/ρ with ρ = 2ᵏ ≤ ‖r‖ and d = (ρ/s) d', so that single precision neither over- nor underflows.
pub(super) fn solve<S: Entry>(
    tangent: &dyn Linearization<S>,
    preconditioner: &dyn LinearOperator<S>,
    r: &Pooled<f64>,
    relative_tolerance: f64,
    settings: &NewtonSettings,
    counts: &mut NewtonCounts,
) -> Result<Solved, LinearSolverFailure> {
    let workspace = r.pool();
    let size = norm(r).log2().floor().exp2();
    let rhs = workspace.collect(r.iter().map(|r| S::lit(-r / size)));
    let mut d = workspace.filled(r.len(), S::zero());
    let max_iterations = settings.max_krylov_iterations;
    let mut count = |report: LinearReport| {
        counts.tangent_products += report.products;
        counts.krylov_iterations += report.iterations;
        report
    };
    let (restart, descended) = match settings.krylov {
        Krylov::Gmres { restart } => (restart, None),
        Krylov::ConjugateGradient => {
            let settings = ConjugateGradientSettings { relative_tolerance, max_iterations };
            let report = count(conjugate_gradient(tangent, preconditioner, &rhs, &mut d, &settings, workspace)?);
            (FALLBACK_RESTART, Some(report))
        }
    };
    let given_up = descended.filter(|report| report.outcome == LinearOutcome::NegativeCurvature);
    let krylov = match descended {
        Some(report) if given_up.is_none() => report,
        _ => {
            let settings = GmresSettings { relative_tolerance, max_iterations, restart: restart as usize };
            count(gmres(tangent, preconditioner, &rhs, &mut d, &settings, workspace)?)
        }
    };
    // Less accurate than wanted is still a direction in which ‖R‖ falls.
    if krylov.relative_residual >= LOOSEST {
        return Err(LinearSolverFailure::NoProgress { report: krylov, wanted: relative_tolerance });
    }
    let unit = size / tangent.scale();
    let step = workspace.collect(d.iter().map(|d| unit * d.value()));
    Ok(Solved { step, krylov, negative_curvature: given_up })
}
