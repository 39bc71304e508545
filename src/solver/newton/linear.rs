//! Step 3: the linear system of one iteration.

use super::failure::LinearSolverFailure;
use super::report::NewtonCounts;
use super::settings::{FALLBACK_RESTART, Krylov, NewtonSettings};
use crate::pooled::Pooled;
use crate::solver::conjugate_gradient::{ConjugateGradientSettings, conjugate_gradient};
use crate::solver::forcing::LOOSEST;
use crate::solver::gmres::{GmresSettings, gmres};
use crate::solver::vector::{Entry, norm, scaled};
use crate::solver::{LinearOperator, LinearOutcome, LinearReport, Preconditioner, SingleTangent};

/// The least relative residual asked for in single precision: what a recurrence of vectors rounded to 6e-8 can still reach.
pub(super) const SINGLE_TOLERANCE: f64 = 1e-5;

/// The report of the solve that gave d, and that of conjugate gradients given up before.
type Solved = Result<(LinearReport, Option<LinearReport>), LinearSolverFailure>;

/// `K d = −r`
pub(super) fn solve<T: LinearOperator + Preconditioner>(
    tangent: &T,
    r: &[f64],
    d: &mut [f64],
    relative_tolerance: f64,
    settings: &NewtonSettings,
    counts: &mut NewtonCounts,
) -> Solved {
    let mut rhs = Pooled::filled(r.len(), 0.0);
    scaled(-1.0, r, &mut rhs);
    solve_in(tangent, &rhs, d, relative_tolerance, settings, counts)
}

/// `K d = −r` in single precision: (K/s) d' = −r/ρ with ρ = 2ᵏ near ‖r‖, d = (ρ/s) d'.
pub(super) fn solve_single(
    tangent: &dyn SingleTangent,
    r: &[f64],
    d: &mut [f64],
    relative_tolerance: f64,
    settings: &NewtonSettings,
    counts: &mut NewtonCounts,
) -> Solved {
    let size = norm(r).log2().round().exp2();
    let rhs: Pooled<f32> = r.iter().map(|r| (-r / size) as f32).collect();
    let mut single = Pooled::filled(r.len(), 0.0);
    let solved = solve_in(tangent, &rhs, &mut single, relative_tolerance, settings, counts)?;
    let unit = size / tangent.scale();
    for (d, single) in d.iter_mut().zip(&single) {
        *d = unit * f64::from(*single);
    }
    Ok(solved)
}

/// `K d = rhs`
fn solve_in<S: Entry, T: LinearOperator<S> + Preconditioner<S> + ?Sized>(
    tangent: &T,
    rhs: &[S],
    d: &mut [S],
    relative_tolerance: f64,
    settings: &NewtonSettings,
    counts: &mut NewtonCounts,
) -> Solved {
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
            let report = count(conjugate_gradient(tangent, tangent, rhs, d, &settings)?);
            if report.outcome != LinearOutcome::NegativeCurvature {
                return useful(report, None);
            }
            (FALLBACK_RESTART, Some(report))
        }
    };
    let settings = GmresSettings { relative_tolerance, max_iterations, restart };
    useful(count(gmres(tangent, tangent, rhs, d, &settings)?), given_up)
}
