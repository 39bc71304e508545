//! Step 3 of [`newton`](super::newton): the linear system of one iteration.

use super::failure::LinearSolverFailure;
use super::report::NewtonCounts;
use super::settings::{DEFAULT_RESTART, Krylov, NewtonSettings};
use crate::pooled::Pooled;
use crate::solver::conjugate_gradient::{ConjugateGradientSettings, conjugate_gradient};
use crate::solver::forcing::LOOSEST;
use crate::solver::gmres::{GmresSettings, gmres};
use crate::solver::vector::{dot, norm};
use crate::solver::{LinearOperator, LinearOutcome, LinearReport, Linearization};

/// A solve that gave a step.
pub(super) struct Solved {
    /// d
    pub step: Pooled<f64>,
    /// The report of the solve that gave d. Its outcome is negative curvature if that ended the solve early.
    pub krylov: LinearReport,
    /// The report of conjugate gradients that were abandoned for GMRES, if any.
    pub negative_curvature: Option<LinearReport>,
}

/// A linear system, the method and the accuracy wanted.
pub(super) struct System<'a> {
    pub r: &'a Pooled<f64>,
    pub method: Krylov,
    pub relative_tolerance: f64,
    /// Whether the problem has a potential. A step of a truncated linear solve may then lower it.
    pub has_potential: &'a dyn Fn() -> bool,
}

/// Solves K d = −r as K d' = −r/ρ with ρ = 2ᵏ ≤ ‖r‖ and d = ρ d'. So the squares of small or large forces neither underflow nor overflow.
pub(super) fn solve(
    tangent: &dyn Linearization,
    preconditioner: &dyn LinearOperator,
    system: &System<'_>,
    settings: &NewtonSettings,
    counts: &mut NewtonCounts,
) -> Result<Solved, LinearSolverFailure> {
    let System { r, method, relative_tolerance, has_potential } = *system;
    let workspace = r.pool();
    let size = norm(r).log2().floor().exp2();
    let rhs = workspace.collect(r.iter().map(|r| -r / size));
    let mut d = workspace.filled(r.len(), 0.0);
    let max_iterations = settings.max_krylov_iterations;
    let mut count = |report: LinearReport| {
        counts.tangent_products += report.products;
        counts.krylov_iterations += report.iterations;
        counts.krylov_limited += usize::from(report.outcome == LinearOutcome::IterationLimit);
        counts.krylov_stagnated += usize::from(report.outcome == LinearOutcome::Stagnated);
        report
    };
    let (restart, descended) = match method {
        Krylov::Gmres { restart } => (restart, None),
        Krylov::Automatic | Krylov::ConjugateGradient => {
            let settings = ConjugateGradientSettings { relative_tolerance, max_iterations };
            let report = count(conjugate_gradient(tangent, preconditioner, &rhs, &mut d, &settings, workspace)?);
            (DEFAULT_RESTART, Some(report))
        }
    };
    let negative = descended.filter(|report| report.outcome == LinearOutcome::NegativeCurvature);
    // −R·d > 0: the potential falls along the truncated step.
    let truncated = negative.filter(|_| dot(&rhs, &d) > 0.0 && has_potential());
    let given_up = negative.filter(|_| truncated.is_none());
    let krylov = match descended {
        Some(report) if given_up.is_none() => report,
        _ => {
            let settings = GmresSettings { relative_tolerance, max_iterations, restart: restart as usize };
            count(gmres(tangent, preconditioner, &rhs, &mut d, &settings, workspace)?)
        }
    };
    // ‖R‖ also falls along a step that is less accurate than wanted.
    if krylov.relative_residual >= LOOSEST && truncated.is_none() {
        return Err(LinearSolverFailure::NoProgress { report: krylov, wanted: relative_tolerance });
    }
    d.iter_mut().for_each(|d| *d *= size);
    Ok(Solved { step: d, krylov, negative_curvature: given_up })
}
