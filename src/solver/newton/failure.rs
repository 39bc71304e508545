//! The errors of Newton's method.

use super::report::NewtonHistory;
use crate::gpu::GpuError;
use crate::solver::{InvalidSetting, LinearError, LinearReport};

/// Newton's method found no solution. x is then the last accepted iterate.
#[derive(Debug, thiserror::Error)]
#[error("Newton's method stopped after {} iterations{}", history.iterations.len(), at(history))]
pub struct NewtonError<E: std::error::Error + 'static> {
    /// The cause.
    #[source]
    pub cause: NewtonFailure<E>,
    /// The course of the iteration until then.
    pub history: Box<NewtonHistory>,
}

fn at(history: &NewtonHistory) -> String {
    history.residual().map_or_else(String::new, |residual| format!(", at the residual {residual:e}"))
}

/// The cause for which Newton's method found no solution. The history has the number of iterations and the ‖R‖ reached.
#[derive(Debug, thiserror::Error)]
pub enum NewtonFailure<E: std::error::Error + 'static> {
    /// A setting outside its range.
    #[error(transparent)]
    Setting(#[from] InvalidSetting),
    /// The iterate itself is outside the domain. For any iterate but the initial guess, residual, magnitude and tangent then disagree on
    /// the domain.
    #[error("iterate {iteration} is inadmissible (0 is the initial guess)")]
    Inadmissible {
        /// The iterate.
        iteration: usize,
        /// The reason why the iterate is inadmissible.
        #[source]
        source: E,
    },
    /// An end was requested; see [`is_stopped`](crate::solver::NonlinearProblem::is_stopped).
    #[error("it was stopped before the next iteration")]
    Stopped,
    /// NaN or infinity.
    #[error("{0} is not finite")]
    NotFinite(&'static str),
    /// The allowed iterations are used up.
    #[error("no convergence after the {allowed} allowed iterations; the residual wanted is {target:e}")]
    MaxIterations {
        /// Iterations allowed.
        allowed: usize,
        /// ‖R‖ wanted.
        target: f64,
    },
    /// Steps are accepted, but ‖R‖ hardly falls and is above round-off.
    #[error("the residual stagnates; wanted is {target:e}, round-off ends at {round_off:e}")]
    Stagnated {
        /// ‖R‖ wanted.
        target: f64,
        /// ‖R‖ below which stagnation would count as convergence.
        round_off: f64,
    },
    /// ‖R‖ has grown beyond 1e8 times its first value, or the first magnitude if that is larger.
    #[error("the residual grew, from {first:e} at the initial guess")]
    Diverged {
        /// ‖R‖ of the initial guess.
        first: f64,
    },
    /// No step length is acceptable.
    #[error(
        "no acceptable step: {trials} lengths down to {shortest:e}, {inadmissible} of them inadmissible, {not_finite} not finite"
    )]
    LineSearchFailed {
        /// Step lengths tried.
        trials: usize,
        /// The shortest step length.
        shortest: f64,
        /// Number of step lengths that led outside the domain.
        inadmissible: usize,
        /// Number of step lengths at which R was not finite.
        not_finite: usize,
        /// The last reason why a trial was inadmissible.
        #[source]
        last: Option<E>,
    },
    /// The linear system gave no useful step.
    #[error("the linear system of the next iteration gave no step")]
    LinearSolverFailed(#[from] LinearSolverFailure),
}

impl<E: std::error::Error + 'static> NewtonFailure<E> {
    /// Whether the device failed on which Newton's method runs.
    pub(crate) fn is_of_device(&self) -> bool {
        matches!(self, Self::LinearSolverFailed(LinearSolverFailure::Device(_)))
    }
}

/// The failure of a linear solve to give a useful step.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LinearSolverFailure {
    /// The device failed.
    #[error(transparent)]
    Device(#[from] GpuError),
    /// The preconditioner has no form for devices.
    #[error("this preconditioner does not run on a GPU; run without --gpu")]
    NotOnDevice,
    /// The Krylov method returned an error.
    #[error(transparent)]
    Error(#[from] LinearError),
    /// The relative residual stayed at 0.9 or above, too large for a Newton step.
    #[error(
        "relative residual {:e} after {} Krylov iterations ({:?}); a step needs less than 0.9, wanted was {wanted:e}",
        report.relative_residual, report.iterations, report.outcome
    )]
    NoProgress {
        /// The report of the Krylov method.
        report: LinearReport,
        /// The relative residual wanted.
        wanted: f64,
    },
}
