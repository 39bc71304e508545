//! Why Newton's method found no solution.

use super::report::NewtonHistory;
use crate::solver::{InvalidSetting, LinearError, LinearReport};

/// No solution found; x is the last accepted iterate.
#[derive(Debug, thiserror::Error)]
#[error("Newton's method stopped after {} iterations", history.iterations.len())]
pub struct NewtonError<E: std::error::Error + 'static> {
    /// Why.
    #[source]
    pub cause: NewtonFailure<E>,
    /// What happened before.
    pub history: Box<NewtonHistory>,
}

/// Why Newton's method found no solution. Iterations are counted from 1; 0 is the initial guess.
#[derive(Debug, thiserror::Error)]
pub enum NewtonFailure<E: std::error::Error + 'static> {
    /// A setting outside its range.
    #[error(transparent)]
    Setting(#[from] InvalidSetting),
    /// The iterate itself is outside the domain; for any other than the initial guess this means that residual, magnitude
    /// and tangent do not agree on the domain.
    #[error("iterate {iteration} is inadmissible (0 is the initial guess)")]
    Inadmissible {
        /// The iterate.
        iteration: usize,
        /// What is wrong there.
        #[source]
        source: E,
    },
    /// Somebody asked for an end.
    #[error("it was stopped before iteration {iteration}")]
    Stopped {
        /// The iteration.
        iteration: usize,
    },
    /// NaN or infinity.
    #[error("{what} is not finite at iteration {iteration} (0 is the initial guess)")]
    NotFinite {
        /// The quantity.
        what: &'static str,
        /// The iteration.
        iteration: usize,
    },
    /// The allowed iterations are used up.
    #[error("the residual is {residual:e} after the {allowed} allowed iterations; wanted is {target:e}")]
    MaxIterations {
        /// Iterations allowed.
        allowed: usize,
        /// ‖R‖ reached.
        residual: f64,
        /// ‖R‖ wanted.
        target: f64,
    },
    /// Steps are found, but ‖R‖ hardly falls and is not round-off.
    #[error(
        "the residual stagnates at {residual:e} (iteration {iteration}); wanted is {target:e}, round-off ends at {round_off:e}"
    )]
    Stagnated {
        /// The iteration.
        iteration: usize,
        /// ‖R‖ reached.
        residual: f64,
        /// ‖R‖ wanted.
        target: f64,
        /// ‖R‖ below which stagnation would count as convergence.
        round_off: f64,
    },
    /// ‖R‖ has grown beyond all measure.
    #[error("the residual grew to {residual:e} (iteration {iteration}), from {first:e} at the initial guess")]
    Diverged {
        /// The iteration.
        iteration: usize,
        /// ‖R‖ reached.
        residual: f64,
        /// ‖R‖ of the initial guess.
        first: f64,
    },
    /// No step length is acceptable.
    #[error(
        "no acceptable step at iteration {iteration}, residual {residual:e}: {trials} lengths down to {shortest:e}, \
         {inadmissible} of them inadmissible, {not_finite} not finite"
    )]
    LineSearchFailed {
        /// The iteration.
        iteration: usize,
        /// ‖R‖ before the step.
        residual: f64,
        /// Step lengths tried.
        trials: usize,
        /// The shortest.
        shortest: f64,
        /// How many led outside the domain.
        inadmissible: usize,
        /// At how many R was not finite.
        not_finite: usize,
        /// The last reason for being outside.
        #[source]
        last: Option<E>,
    },
    /// The linear system gave no useful step.
    #[error("the linear system of iteration {iteration} gave no step, residual {residual:e}")]
    LinearSolverFailed {
        /// The iteration.
        iteration: usize,
        /// ‖R‖ before the step.
        residual: f64,
        /// Why.
        #[source]
        source: LinearSolverFailure,
    },
}

/// Why a linear solve gave no useful step.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LinearSolverFailure {
    /// The solver failed.
    #[error(transparent)]
    Error(#[from] LinearError),
    /// The solver reduced the residual too little for a Newton step: less than to 0.9.
    #[error(
        "relative residual {:e} after {} Krylov iterations ({:?}); a step needs less than 0.9, wanted was {wanted:e}",
        report.relative_residual, report.iterations, report.outcome
    )]
    NoProgress {
        /// What the solver did.
        report: LinearReport,
        /// The relative residual wanted.
        wanted: f64,
    },
}
