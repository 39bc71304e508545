//! Steps 4 to 6 of [`newton`](super::newton): backtracking along the Newton step.

use super::failure::NewtonFailure;
use super::report::{Merit, NewtonCounts};
use super::settings::NewtonSettings;
use crate::solver::NonlinearProblem;
use crate::solver::vector::{norm, xpby};

/// The part of the predicted decrease that a step must achieve (Armijo).
const SUFFICIENT: f64 = 1e-4;

/// Round-off of Π in units of eps times the sum of the magnitudes of its contributions.
const POTENTIAL_ROUND_OFF: f64 = 4.0;

/// A Newton step d from x.
pub(super) struct Step<'a> {
    pub x: &'a [f64],
    pub d: &'a [f64],
    /// ‖R(x)‖
    pub residual: f64,
    /// R·d, the slope of the potential.
    pub slope: f64,
    /// The ‖R + K d‖ / ‖R‖ that the linear solve reached.
    pub linear: f64,
}

pub(super) struct Accepted {
    pub length: f64,
    pub residual: f64,
    pub merit: Merit,
}

pub(super) struct Failed<E> {
    trials: usize,
    shortest: f64,
    inadmissible: usize,
    not_finite: usize,
    last: Option<E>,
}

impl<E: std::error::Error + 'static> Failed<E> {
    pub(super) fn into_failure(self, iteration: usize, residual: f64) -> NewtonFailure<E> {
        let Self { trials, shortest, inadmissible, not_finite, last } = self;
        if not_finite == trials {
            return NewtonFailure::NotFinite { what: "the residual at every step length", iteration };
        }
        NewtonFailure::LineSearchFailed { iteration, residual, trials, shortest, inadmissible, not_finite, last }
    }
}

pub(super) enum Search<E> {
    /// The accepted iterate and its residual are in `trial` and `r_trial`.
    Accepted(Accepted),
    /// ‖R‖ is below the given round-off, and the full step does not lower it.
    RoundOff,
    Failed(Failed<E>),
}

/// Searches for an acceptable step length.
pub(super) fn search<E: std::error::Error + 'static>(
    problem: &dyn NonlinearProblem<Inadmissible = E>,
    at: &Step,
    settings: &NewtonSettings,
    round_off: f64,
    trial: &mut [f64],
    r_trial: &mut [f64],
    counts: &mut NewtonCounts,
) -> Search<E> {
    let mut failed = Failed { trials: 0, shortest: 1.0, inadmissible: 0, not_finite: 0, last: None };
    let mut potential = PotentialDecrease { start: None };
    let mut length = 1.0;
    for halvings in 0..=settings.max_halvings {
        failed.trials += 1;
        failed.shortest = length;
        trial.copy_from_slice(at.d);
        xpby(at.x, length, trial);
        counts.residuals += 1;
        counts.line_search += usize::from(halvings > 0);
        match problem.residual(trial, r_trial) {
            Err(why) => {
                failed.inadmissible += 1;
                failed.last = Some(why);
            }
            Ok(()) => {
                let residual = norm(r_trial);
                mutant!("solver: any fall of the residual is accepted": { if residual < at.residual { return Search::Accepted(Accepted { length, residual, merit: Merit::Residual }); } });
                if !residual.is_finite() {
                    failed.not_finite += 1;
                } else if at.linear < 1.0
                    && residual <= (1.0 - SUFFICIENT * length * (1.0 - at.linear)) * at.residual
                    && residual < at.residual
                {
                    return Search::Accepted(Accepted { length, residual, merit: Merit::Residual });
                } else if potential.suffices(problem, at, length, trial, counts) {
                    return Search::Accepted(Accepted { length, residual, merit: Merit::Potential });
                } else if halvings == 0 && at.residual <= round_off {
                    return Search::RoundOff;
                }
            }
        }
        length *= 0.5;
    }
    Search::Failed(failed)
}

/// The second merit function of the line search. It is evaluated only where the residual norm does not accept the step.
struct PotentialDecrease {
    /// Π(x) and its magnitude, once they are evaluated; `Some(None)` if there is no potential.
    start: Option<Option<(f64, f64)>>,
}

impl PotentialDecrease {
    /// Π(x + s d) ≤ Π(x) + c s R·d + round-off, where the predicted decrease −s R·d is above that round-off.
    fn suffices<E: std::error::Error + 'static>(
        &mut self,
        problem: &dyn NonlinearProblem<Inadmissible = E>,
        at: &Step,
        length: f64,
        trial: &[f64],
        counts: &mut NewtonCounts,
    ) -> bool {
        let predicted = -length * at.slope;
        let finite = |(value, magnitude): &(f64, f64)| value.is_finite() && magnitude.is_finite();
        let mut evaluate = |x: &[f64]| {
            let value = problem.potential(x)?;
            counts.potentials += 1;
            value.ok().filter(finite)
        };
        let round_off = |magnitude: f64| POTENTIAL_ROUND_OFF * f64::EPSILON * magnitude;
        let Some((start, start_magnitude)) = *self.start.get_or_insert_with(|| evaluate(at.x)) else {
            return false;
        };
        if predicted <= round_off(start_magnitude) {
            return false;
        }
        evaluate(trial).is_some_and(|(value, magnitude)| {
            let round_off = round_off(start_magnitude.max(magnitude));
            predicted > round_off && value <= start - SUFFICIENT * predicted + round_off
        })
    }
}
