//! Newton–Krylov with a backtracking line search.

mod failure;
mod report;
mod settings;
#[cfg(test)]
mod tests;

pub use failure::{LinearSolverFailure, NewtonError, NewtonFailure};
pub use report::{Convergence, Merit, NewtonCounts, NewtonHistory, NewtonIteration, NewtonReport};
pub use settings::{Krylov, NewtonSettings};

use super::conjugate_gradient::ConjugateGradientSettings;
use super::forcing::LOOSEST;
use super::gmres::GmresSettings;
use super::{LinearOutcome, LinearReport, Linearization, NonlinearProblem, Preconditioner, System};
use crate::parallel;
use crate::pooled::{Pool, Pooled};
use crate::space::vector::{Vectors, dot, norm, xpby};
use settings::DEFAULT_RESTART;

/// The part of the predicted decrease that a step must achieve (Armijo).
const SUFFICIENT: f64 = 1e-4;

/// Round-off of Π in units of eps times the sum of the magnitudes of its contributions.
const POTENTIAL_ROUND_OFF: f64 = 4.0;

/// Round-off of the residual, relative to its magnitude.
const FLOOR: f64 = NewtonSettings::FLOOR * f64::EPSILON;

/// Halvings of the step allowed in a line search.
const MAX_HALVINGS: i32 = 25;

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
/// 1. Stop when ‖R‖ ≤ max(rtol ‖R_first‖, 4 eps · magnitude). The magnitude is evaluated at the initial guess.
/// 2. K = linearize(x). The preconditioner is prepared with K.
/// 3. Solve K d = −R by a Krylov method to ‖R + K d‖ ≤ η ‖R‖, with η from [`Forcing`](super::Forcing). A solve that ends early is
///    still used if it reaches η < 0.9. A solve ended by negative curvature is used if there is a potential, which falls along d
///    (line-search Newton-CG: Nash, SIAM J. Numer. Anal. 21, 1984; Nocedal and Wright, alg. 7.1).
/// 4. s = 1.
/// 5. Accept x + s d if η < 1 and ‖R(x + s d)‖ ≤ (1 − 1e-4 s (1 − η)) ‖R‖, with the η that the solve has reached. Accept it also if
///    Π(x + s d) ≤ Π(x) + 1e-4 s R·d + 4 eps |Π|, where there is a potential that can resolve the predicted decrease s R·d < 0.
/// 6. The iteration has converged if the full step is not accepted and ‖R‖ ≤ 16 · 4 eps · magnitude. Otherwise halve s and go to 5.
///    Also halve s where x + s d is inadmissible or R is not finite.
/// 7. If no step is found or accepted, or 8 steps in a row were accepted by ‖R‖ and none reduced it by a percent, evaluate the sensitivity
///    at x. The iteration has converged if ‖R‖ ≤ 16 · 4 eps · sensitivity, and has failed if not.
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
    let [r, trial, r_trial] = std::array::from_fn(|_| workspace.filled(x.len(), 0.0));
    let history = NewtonHistory::default();
    let (residual, first, magnitude, target) = (0.0, 0.0, 0.0, 0.0);
    let mut newton = Newton { problem, settings, x, r, residual, trial, r_trial, first, magnitude, target, history };
    match newton.iterate(preconditioner) {
        Ok(convergence) => Ok(NewtonReport { convergence, history: newton.history }),
        Err(cause) => Err(NewtonError { cause, history: Box::new(newton.history) }),
    }
}

struct Newton<'a, E> {
    problem: &'a dyn NonlinearProblem<Inadmissible = E>,
    settings: &'a NewtonSettings,
    /// The last accepted iterate, R(x) and ‖R(x)‖.
    x: &'a mut [f64],
    r: Pooled<f64>,
    residual: f64,
    /// The last iterate that the line search tried, and its R.
    trial: Pooled<f64>,
    r_trial: Pooled<f64>,
    /// ‖R‖ and its magnitude at the initial guess.
    first: f64,
    magnitude: f64,
    /// The ‖R‖ at which the iteration has converged.
    target: f64,
    history: NewtonHistory,
}

impl<E: std::error::Error + 'static> Newton<'_, E> {
    fn iterate(&mut self, preconditioner: &mut dyn Preconditioner) -> Result<Convergence, NewtonFailure<E>> {
        self.settings.check()?;
        self.begin()?;
        let (target, allowed) = (self.target, self.settings.max_iterations);
        while self.residual > target {
            if self.problem.is_stopped() {
                return Err(NewtonFailure::Stopped);
            }
            if self.history.iterations.len() >= allowed {
                return Err(NewtonFailure::MaxIterations { allowed, target });
            }
            match self.step(preconditioner) {
                Ok(Some(taken)) => self.history.iterations.push(taken),
                Ok(None) => return Ok(Convergence::RoundOff),
                Err(cause @ NewtonFailure::Inadmissible { .. }) => return Err(cause),
                Err(cause) if cause.is_of_device() => return Err(cause),
                // The remaining R may be round-off, which need not lie in the range of K.
                Err(_) if self.residual <= self.round_off()? => return Ok(Convergence::RoundOff),
                Err(cause) => return Err(cause),
            }
            if self.residual > DIVERGED * self.first.max(self.magnitude) {
                return Err(NewtonFailure::Diverged { first: self.first });
            }
            if self.stalls() && self.residual > target {
                let round_off = self.round_off()?;
                if self.residual <= round_off {
                    return Ok(Convergence::RoundOff);
                }
                return Err(NewtonFailure::Stagnated { target, round_off });
            }
        }
        Ok(Convergence::Tolerance)
    }

    fn stalls(&self) -> bool {
        let last = self.history.iterations.iter().rev();
        let stalled = last.take_while(|one| one.merit == Merit::Residual && one.ratio > STALL_RATIO);
        stalled.count() >= STALL_LENGTH
    }

    /// Step 1 at the initial guess: its residual, and the residual to reach.
    fn begin(&mut self) -> Result<(), NewtonFailure<E>> {
        self.history.counts.residuals += 1;
        let inadmissible = |source| NewtonFailure::Inadmissible { iteration: 0, source };
        self.problem.residual(self.x, &mut self.r).map_err(inadmissible)?;
        self.residual = norm(&self.r);
        self.first = self.residual;
        if !self.first.is_finite() {
            return Err(NewtonFailure::NotFinite("the residual"));
        }
        self.history.first_residual = Some(self.first);
        self.magnitude = self.measured(self.problem.magnitude(self.x))?;
        self.target = (self.settings.relative_tolerance * self.first).max(FLOOR * self.magnitude);
        Ok(())
    }

    /// Steps 2 to 6, and 8. `None` if the residual is round-off, and the full step does not lower it.
    fn step(&mut self, preconditioner: &mut dyn Preconditioner) -> Result<Option<NewtonIteration>, NewtonFailure<E>> {
        let (iteration, before) = (self.history.iterations.len(), self.residual);
        let last = self.history.iterations.last().map(|last| last.ratio);
        let forcing = self.settings.forcing.next(last, self.target / before);
        self.history.counts.linearizations += 1;
        let (d, krylov) = {
            let inadmissible = |source| NewtonFailure::Inadmissible { iteration, source };
            let problem = self.problem;
            let tangent = problem.linearize(self.x).map_err(inadmissible)?;
            self.solve(&*tangent, preconditioner, forcing)?
        };
        let Some((step_length, residual, merit)) = self.search(&d, krylov.relative_residual)? else {
            return Ok(None);
        };
        parallel::copy(&self.trial, self.x);
        std::mem::swap(&mut self.r, &mut self.r_trial);
        self.residual = residual;
        let ratio = residual / before;
        Ok(Some(NewtonIteration { residual, ratio, step_length, merit, forcing, krylov }))
    }

    /// Step 3, as K d' = −R/ρ with ρ = 2ᵏ ≤ ‖R‖ and d = ρ d'. So the squares of small or large forces neither underflow nor overflow.
    ///
    /// Returns d and the report of the solve that gave it.
    fn solve(
        &mut self,
        tangent: &dyn Linearization,
        preconditioner: &mut dyn Preconditioner,
        relative_tolerance: f64,
    ) -> Result<(Pooled<f64>, LinearReport), LinearSolverFailure> {
        let pool = self.r.pool().clone();
        let size = self.residual.log2().floor().exp2();
        let rhs = pool.made(self.r.len(), |i| -self.r[i] / size);
        let mut d = pool.filled(rhs.len(), 0.0);
        let krylov = match tangent.on_device() {
            None => {
                let inverse = &*preconditioner.prepare(tangent);
                self.solve_in(&System { vectors: &pool, operator: tangent, inverse }, &rhs, &mut d, relative_tolerance)?
            }
            Some(system) => {
                let vectors = &**system.gpu();
                let inverse = preconditioner.prepare_on_device(tangent, &*system);
                let inverse = &*inverse.ok_or(LinearSolverFailure::NotOnDevice)?;
                let (rhs, mut on_device) = (vectors.vector(&rhs), vectors.zeros(rhs.len()));
                let system = System { vectors, operator: &*system, inverse };
                let krylov = self.solve_in(&system, &rhs, &mut on_device, relative_tolerance);
                d.copy_from_slice(&vectors.numbers(&on_device));
                // After a failure of the device, numbers are NaN.
                vectors.check()?;
                krylov?
            }
        };
        parallel::each(&mut d, |_, d| *d *= size);
        Ok((d, krylov))
    }

    /// Step 3 where the vectors lie.
    fn solve_in<S: Vectors>(
        &mut self,
        system: &System<'_, S>,
        rhs: &S::Vector,
        d: &mut S::Vector,
        relative_tolerance: f64,
    ) -> Result<LinearReport, LinearSolverFailure> {
        let max_iterations = self.settings.max_krylov_iterations;
        let (restart, descended) = match self.settings.krylov.chosen(self.problem.is_symmetric()) {
            Krylov::Gmres { restart } => (restart, None),
            Krylov::Automatic | Krylov::ConjugateGradient => {
                let settings = ConjugateGradientSettings { relative_tolerance, max_iterations };
                let report = settings.solve(system, rhs, d)?;
                self.history.counts.add(&report);
                (DEFAULT_RESTART, Some(report))
            }
        };
        let negative = descended.is_some_and(|report| report.outcome == LinearOutcome::NegativeCurvature);
        // −R·d > 0: the potential falls along the truncated step.
        let truncated = negative && system.vectors.dot(rhs, d) > 0.0 && self.problem.potential(self.x).is_some();
        let krylov = match descended {
            Some(report) if !negative || truncated => report,
            _ => {
                let settings = GmresSettings { relative_tolerance, max_iterations, restart: restart as usize };
                let report = settings.solve(system, rhs, d)?;
                self.history.counts.add(&report);
                report
            }
        };
        // ‖R‖ also falls along a step that is less accurate than wanted.
        if krylov.relative_residual >= LOOSEST && !truncated {
            return Err(LinearSolverFailure::NoProgress { report: krylov, wanted: relative_tolerance });
        }
        Ok(krylov)
    }

    /// Steps 4 to 6: the step length along d, the ‖R‖ reached and the merit function that accepts it. The accepted iterate and its residual are
    /// in `trial` and `r_trial`. `None` if ‖R‖ is round-off, and the full step does not lower it.
    ///
    /// `linear` is the ‖R + K d‖ / ‖R‖ that the linear solve reached.
    fn search(&mut self, d: &[f64], linear: f64) -> Result<Option<(f64, f64, Merit)>, NewtonFailure<E>> {
        let slope = dot(&self.r, d);
        let (mut inadmissible, mut not_finite, mut last, mut start) = (0, 0, None, None);
        let mut length = 1.0;
        for halvings in 0..=MAX_HALVINGS {
            length = 0.5_f64.powi(halvings);
            parallel::copy(d, &mut self.trial);
            xpby(self.x, length, &mut self.trial);
            self.history.counts.residuals += 1;
            self.history.counts.line_search += usize::from(halvings > 0);
            if let Err(why) = self.problem.residual(&self.trial, &mut self.r_trial) {
                inadmissible += 1;
                last = Some(why);
                continue;
            }
            let (residual, before) = (norm(&self.r_trial), self.residual);
            mutant!("solver: any fall of the residual is accepted": { if residual < before { return Ok(Some((length, residual, Merit::Residual))); } });
            let enough = (1.0 - SUFFICIENT * length * (1.0 - linear)) * before;
            if !residual.is_finite() {
                not_finite += 1;
            } else if linear < 1.0 && residual <= enough && residual < before {
                return Ok(Some((length, residual, Merit::Residual)));
            } else if self.potential_falls(-length * slope, &mut start) {
                return Ok(Some((length, residual, Merit::Potential)));
            } else if halvings == 0 && before <= ROUND_OFF_MULTIPLE * FLOOR * self.magnitude {
                return Ok(None);
            }
        }
        let trials = MAX_HALVINGS as usize + 1;
        if not_finite == trials {
            return Err(NewtonFailure::NotFinite("the residual at every step length"));
        }
        Err(NewtonFailure::LineSearchFailed { trials, shortest: length, inadmissible, not_finite, last })
    }

    /// Π(trial) ≤ Π(x) − c p + round-off, where the predicted decrease p = −s R·d is above that round-off. Evaluated only where the residual
    /// norm does not accept the step.
    ///
    /// `start` keeps Π(x) and its magnitude, once they are evaluated; `Some(None)` if there is no potential.
    fn potential_falls(&self, predicted: f64, start: &mut Option<Option<(f64, f64)>>) -> bool {
        let evaluate = |x: &[f64]| {
            let value = self.problem.potential(x)?.ok();
            value.filter(|(value, magnitude)| value.is_finite() && magnitude.is_finite())
        };
        let round_off = |magnitude: f64| POTENTIAL_ROUND_OFF * f64::EPSILON * magnitude;
        let Some((start, start_magnitude)) = *start.get_or_insert_with(|| evaluate(self.x)) else {
            return false;
        };
        if predicted <= round_off(start_magnitude) {
            return false;
        }
        evaluate(&self.trial).is_some_and(|(value, magnitude)| {
            let round_off = round_off(start_magnitude.max(magnitude));
            predicted > round_off && value <= start - SUFFICIENT * predicted + round_off
        })
    }

    /// The round-off of the residual at x, from its sensitivity (step 7).
    fn round_off(&mut self) -> Result<f64, NewtonFailure<E>> {
        let sensitivity = self.measured(self.problem.sensitivity(self.x))?;
        Ok(ROUND_OFF_MULTIPLE * FLOOR * sensitivity)
    }

    /// Counts and stores the magnitude or sensitivity at an accepted iterate.
    ///
    /// # Errors
    /// The iterate is inadmissible, or the value is not finite.
    fn measured(&mut self, magnitude: Result<f64, E>) -> Result<f64, NewtonFailure<E>> {
        let iteration = self.history.iterations.len();
        self.history.counts.magnitudes += 1;
        let magnitude = magnitude.map_err(|source| NewtonFailure::Inadmissible { iteration, source })?;
        if !magnitude.is_finite() {
            return Err(NewtonFailure::NotFinite("the magnitude of the residual's contributions"));
        }
        self.history.magnitude = Some(magnitude);
        Ok(magnitude)
    }
}
