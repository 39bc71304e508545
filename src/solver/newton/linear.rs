//! Step 3: the linear system of one iteration.

use super::failure::LinearSolverFailure;
use super::report::NewtonCounts;
use super::settings::{FALLBACK_RESTART, Krylov, NewtonSettings};
use crate::solver::conjugate_gradient::{ConjugateGradientSettings, conjugate_gradient};
use crate::solver::forcing::LOOSEST;
use crate::solver::gmres::{GmresSettings, gmres};
use crate::solver::vector::scaled;
use crate::solver::{LinearOperator, LinearOutcome, LinearReport, Preconditioner};

/// `K d = −r`; the report of the solve that gave d, and that of conjugate gradients given up before.
pub(super) fn solve<T: LinearOperator + Preconditioner>(
    tangent: &T,
    r: &[f64],
    d: &mut [f64],
    relative_tolerance: f64,
    settings: &NewtonSettings,
    counts: &mut NewtonCounts,
) -> Result<(LinearReport, Option<LinearReport>), LinearSolverFailure> {
    let mut rhs = vec![0.0; r.len()];
    scaled(-1.0, r, &mut rhs);
    let max_iterations = settings.max_krylov_iterations;
    let mut count = |report: LinearReport| {
        counts.tangent_products += report.products;
        counts.krylov_iterations += report.iterations;
        report
    };
    // Less accurate than wanted is still a direction in which ‖R‖ falls.
    let useful = |report: LinearReport, given_up| {
        if report.relative_residual < LOOSEST {
            Ok((report, given_up))
        } else {
            Err(LinearSolverFailure::NoProgress { report, wanted: relative_tolerance })
        }
    };
    let (restart, given_up) = match settings.krylov {
        Krylov::Gmres { restart } => (restart, None),
        Krylov::ConjugateGradient => {
            let settings = ConjugateGradientSettings { relative_tolerance, max_iterations };
            let report = count(conjugate_gradient(tangent, tangent, &rhs, d, &settings)?);
            if report.outcome != LinearOutcome::NegativeCurvature {
                return useful(report, None);
            }
            (FALLBACK_RESTART, Some(report))
        }
    };
    let settings = GmresSettings { relative_tolerance, max_iterations, restart };
    useful(count(gmres(tangent, tangent, &rhs, d, &settings)?), given_up)
}
