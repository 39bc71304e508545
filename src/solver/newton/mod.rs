//! Newton–Krylov with a backtracking line search.

mod failure;
mod linear;
mod report;
mod search;
mod settings;
#[cfg(test)]
mod tests;

pub use failure::{LinearSolverFailure, NewtonError, NewtonFailure};
pub use report::{Convergence, Merit, NewtonCounts, NewtonHistory, NewtonIteration, NewtonReport};
pub use settings::{Krylov, NewtonSettings};

use super::forcing::Progress;
use super::vector::{dot, norm};
use super::{NonlinearProblem, Preconditioner};
use crate::pooled::{Pool, Pooled};
use linear::{Solved, System, solve};
use search::{Search, Step, search};

/// A residual that no longer falls is converged if it is below this multiple of the floor.
const ROUND_OFF_MULTIPLE: f64 = 16.0;

/// An iteration stalls if it leaves more than this part of the residual and was not accepted by the potential.
const STALL_RATIO: f64 = 0.99;

/// So many stalled iterations in a row are stagnation.
const STALL_LENGTH: usize = 8;

/// The iteration has diverged when the residual is this many times the first one, or the first magnitude if larger.
const DIVERGED: f64 = 1e8;

/// Solves R(x) = 0 from the initial guess `x`.
///
/// 1. Stop when ‖R‖ ≤ max(rtol ‖R_first‖, floor · eps · magnitude). The magnitude is evaluated at the initial guess.
/// 2. K = linearize(x). The preconditioner is prepared with K.
/// 3. Solve K d = −R by a Krylov method to ‖R + K d‖ ≤ η ‖R‖, with η from [`Forcing`](super::Forcing). A solve that ends early is
///    still used if it reaches η < 0.9. A solve ended by negative curvature is used if there is a potential, which falls along d
///    (line-search Newton-CG: Nash, SIAM J. Numer. Anal. 21, 1984; Nocedal and Wright, alg. 7.1).
/// 4. s = 1.
/// 5. Accept x + s d if η < 1 and ‖R(x + s d)‖ ≤ (1 − 1e-4 s (1 − η)) ‖R‖, with the η that the solve has reached. Accept it also if
///    Π(x + s d) ≤ Π(x) + 1e-4 s R·d + 4 eps |Π|, where there is a potential that can resolve the predicted decrease s R·d < 0.
/// 6. The iteration has converged if the full step is not accepted and ‖R‖ ≤ 16 · floor · eps · magnitude. Otherwise halve s and go to 5.
///    Also halve s where x + s d is inadmissible or R is not finite.
/// 7. If no step is found or accepted, or 8 steps in a row were accepted by ‖R‖ and none reduced it by a percent, evaluate the sensitivity
///    at x. The iteration has converged if ‖R‖ ≤ 16 · floor · eps · sensitivity, and has failed if not.
/// 8. x ← x + s d, and go back to 1.
///
/// Between calls into the problem:
/// - `x` holds accepted iterates only, also on error.
/// - Every tangent is dropped before the next residual.
/// - The residual at an accepted iterate is not evaluated twice.
///
/// Example: [`NonlinearProblem`].
///
/// # Errors
/// See [`NewtonFailure`]. The error carries the history so far.
pub fn newton<E: std::error::Error + 'static>(
    problem: &dyn NonlinearProblem<Inadmissible = E>,
    preconditioner: &mut dyn Preconditioner,
    x: &mut [f64],
    settings: &NewtonSettings,
    workspace: &Pool,
) -> Result<NewtonReport, NewtonError<E>> {
    let mut history = NewtonHistory::default();
    match iterate(problem, preconditioner, x, settings, workspace, &mut history) {
        Ok(convergence) => Ok(NewtonReport { convergence, history }),
        Err(cause) => Err(NewtonError { cause, history: Box::new(history) }),
    }
}

/// The iterate and its residual, with room for the next ones.
struct Iterate<'a> {
    x: &'a mut [f64],
    r: Pooled<f64>,
    /// ‖r‖
    residual: f64,
    trial: Pooled<f64>,
    r_trial: Pooled<f64>,
}

/// The residuals with which later ones are compared.
struct Scale {
    first: f64,
    target: f64,
    /// Round-off of the residual, relative to its magnitude.
    floor: f64,
    first_magnitude: f64,
}

fn iterate<E: std::error::Error + 'static>(
    problem: &dyn NonlinearProblem<Inadmissible = E>,
    preconditioner: &mut dyn Preconditioner,
    x: &mut [f64],
    settings: &NewtonSettings,
    workspace: &Pool,
    history: &mut NewtonHistory,
) -> Result<Convergence, NewtonFailure<E>> {
    settings.check()?;
    let [r, trial, r_trial] = std::array::from_fn(|_| workspace.filled(x.len(), 0.0));
    let mut at = Iterate { x, r, residual: 0.0, trial, r_trial };
    let scale = begin(problem, &mut at, settings, history)?;
    let mut progress = None;
    let mut stalled = 0;
    while at.residual > scale.target {
        let iteration = history.iterations.len() + 1;
        if problem.is_stopped() {
            return Err(NewtonFailure::Stopped { iteration });
        }
        if iteration > settings.max_iterations {
            let Scale { target, .. } = scale;
            return Err(NewtonFailure::MaxIterations {
                allowed: settings.max_iterations,
                residual: at.residual,
                target,
            });
        }
        let forcing = settings.forcing.next(progress, scale.target / at.residual);
        let taken = match step(problem, preconditioner, &mut at, forcing, &scale, settings, history) {
            Ok(Some(taken)) => taken,
            Ok(None) => return Ok(Convergence::RoundOff),
            Err(cause @ NewtonFailure::Inadmissible { .. }) => return Err(cause),
            // The remaining R may be round-off, which need not lie in the range of K.
            Err(cause) => {
                let round_off = round_off(problem, &at, &scale, history)?;
                return if at.residual <= round_off { Ok(Convergence::RoundOff) } else { Err(cause) };
            }
        };
        progress = Some(Progress { forcing, ratio: taken.ratio });
        stalled = if taken.merit == Merit::Residual && taken.ratio > STALL_RATIO { stalled + 1 } else { 0 };
        history.iterations.push(taken);
        let Iterate { residual, .. } = at;
        if residual > DIVERGED * scale.first.max(scale.first_magnitude) {
            return Err(NewtonFailure::Diverged { iteration, residual, first: scale.first });
        }
        if stalled >= STALL_LENGTH && residual > scale.target {
            let round_off = round_off(problem, &at, &scale, history)?;
            if residual <= round_off {
                return Ok(Convergence::RoundOff);
            }
            return Err(NewtonFailure::Stagnated { iteration, residual, target: scale.target, round_off });
        }
    }
    Ok(Convergence::Tolerance)
}

/// Step 1 at the initial guess: its residual, and the residual to reach.
fn begin<E: std::error::Error + 'static>(
    problem: &dyn NonlinearProblem<Inadmissible = E>,
    at: &mut Iterate<'_>,
    settings: &NewtonSettings,
    history: &mut NewtonHistory,
) -> Result<Scale, NewtonFailure<E>> {
    history.counts.residuals += 1;
    problem.residual(at.x, &mut at.r).map_err(|source| NewtonFailure::Inadmissible { iteration: 0, source })?;
    let first = norm(&at.r);
    if !first.is_finite() {
        return Err(NewtonFailure::NotFinite { what: "the residual", iteration: 0 });
    }
    at.residual = first;
    history.first_residual = Some(first);
    let floor = settings.floor * f64::EPSILON;
    let first_magnitude = measured(problem.magnitude(at.x), 0, history)?;
    let target = (settings.relative_tolerance * first).max(floor * first_magnitude);
    Ok(Scale { first, target, floor, first_magnitude })
}

/// Steps 2 to 6, and 8. `None` if the residual is round-off, and the full step does not lower it.
fn step<E: std::error::Error + 'static>(
    problem: &dyn NonlinearProblem<Inadmissible = E>,
    preconditioner: &mut dyn Preconditioner,
    at: &mut Iterate<'_>,
    forcing: f64,
    scale: &Scale,
    settings: &NewtonSettings,
    history: &mut NewtonHistory,
) -> Result<Option<NewtonIteration>, NewtonFailure<E>> {
    let iteration = history.iterations.len() + 1;
    let counts = &mut history.counts;
    let Iterate { x, r, residual, trial, r_trial } = at;
    let has_potential = &|| problem.potential(x).is_some();
    let method = settings.krylov.chosen(problem.is_symmetric());
    let system = System { r, method, relative_tolerance: forcing, has_potential };
    counts.linearizations += 1;
    let solved = {
        let inadmissible = |source| NewtonFailure::Inadmissible { iteration: iteration - 1, source };
        let tangent = problem.linearize(x).map_err(inadmissible)?;
        let inverse = preconditioner.prepare(&*tangent);
        solve(&*tangent, &*inverse, &system, settings, counts)
    };
    let failed = |source| NewtonFailure::LinearSolverFailed { iteration, residual: *residual, source };
    let Solved { step, krylov, negative_curvature } = solved.map_err(failed)?;
    let from = Step { x, d: &step, residual: *residual, slope: dot(r, &step), linear: krylov.relative_residual };
    let round_off = ROUND_OFF_MULTIPLE * scale.floor * scale.first_magnitude;
    let accepted = match search(problem, &from, settings, round_off, trial, r_trial, counts) {
        Search::Accepted(accepted) => accepted,
        Search::RoundOff => return Ok(None),
        Search::Failed(failed) => return Err(failed.into_failure(iteration, *residual)),
    };
    x.copy_from_slice(trial);
    std::mem::swap(r, r_trial);
    let ratio = accepted.residual / *residual;
    *residual = accepted.residual;
    Ok(Some(NewtonIteration {
        residual: accepted.residual,
        ratio,
        step_length: accepted.length,
        merit: accepted.merit,
        forcing,
        krylov,
        negative_curvature,
    }))
}

/// The round-off of the residual at x, from its sensitivity (step 7).
fn round_off<E: std::error::Error + 'static>(
    problem: &dyn NonlinearProblem<Inadmissible = E>,
    at: &Iterate<'_>,
    scale: &Scale,
    history: &mut NewtonHistory,
) -> Result<f64, NewtonFailure<E>> {
    let sensitivity = measured(problem.sensitivity(at.x), history.iterations.len(), history)?;
    Ok(ROUND_OFF_MULTIPLE * scale.floor * sensitivity)
}

/// Counts and stores the magnitude or sensitivity at an accepted iterate.
///
/// # Errors
/// The iterate is inadmissible, or the value is not finite.
fn measured<E: std::error::Error + 'static>(
    magnitude: Result<f64, E>,
    iteration: usize,
    history: &mut NewtonHistory,
) -> Result<f64, NewtonFailure<E>> {
    history.counts.magnitudes += 1;
    let magnitude = magnitude.map_err(|source| NewtonFailure::Inadmissible { iteration, source })?;
    if !magnitude.is_finite() {
        return Err(NewtonFailure::NotFinite { what: "the magnitude of the residual's contributions", iteration });
    }
    history.magnitude = Some(magnitude);
    Ok(magnitude)
}
