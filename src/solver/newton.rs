//! Newton–Krylov with a backtracking line search.

use super::conjugate_gradient::{ConjugateGradientSettings, conjugate_gradient};
use super::forcing::{Forcing, LOOSEST, Progress};
use super::gmres::{GmresSettings, gmres};
use super::vector::{dot, norm, scaled, xpby};
use super::{InvalidSetting, LinearError, LinearOutcome, LinearReport, NonlinearProblem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The part of the predicted decrease a step must achieve (Armijo).
const SUFFICIENT: f64 = 1e-4;

/// Round-off of Π in units of eps times the sum of the magnitudes of its contributions.
const POTENTIAL_ROUND_OFF: f64 = 4.0;

/// A residual that no longer falls is converged if it is below this multiple of the floor.
const ROUND_OFF_MULTIPLE: f64 = 16.0;

/// An iteration that leaves more than this part of the residual is no progress …
const STALL_RATIO: f64 = 0.99;

/// … and so many in a row, none of them justified by the potential, are stagnation.
const STALL_LENGTH: usize = 8;

/// The iteration has diverged when the residual is this many times the first one, or the first magnitude if larger.
const DIVERGED: f64 = 1e8;

/// Restart of the GMRES that takes over from conjugate gradients.
const FALLBACK_RESTART: usize = 30;

/// The method for the linear systems of Newton's method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Krylov {
    /// Restarted GMRES, for any tangent.
    Gmres {
        /// Iterations between restarts, at least 1; as many vectors are kept.
        restart: usize,
    },
    /// Conjugate gradients, for symmetric tangents; where one turns out not to be positive definite, GMRES(30) solves
    /// that system instead.
    ConjugateGradient,
}

/// Settings of [`newton`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct NewtonSettings {
    /// Wanted ‖R‖ over that of the initial guess, in [0, 1).
    pub relative_tolerance: f64,
    /// The least ‖R‖ asked for, in units of eps times the magnitude of the contributions to R: dimensionless, finite and
    /// ≥ 0. A sum of a few dozen contributions is exact to about 4.
    pub floor: f64,
    /// Newton iterations allowed.
    pub max_iterations: usize,
    /// How accurately each linear system is solved.
    pub forcing: Forcing,
    /// How each linear system is solved.
    pub krylov: Krylov,
    /// Krylov iterations allowed for each linear system, at least 1.
    pub max_krylov_iterations: usize,
    /// How often the line search may halve the step, at most 60.
    pub max_halvings: u32,
}

impl Default for NewtonSettings {
    fn default() -> Self {
        Self {
            relative_tolerance: 1e-8,
            floor: 4.0,
            max_iterations: 50,
            forcing: Forcing::Fixed(1e-8),
            krylov: Krylov::Gmres { restart: FALLBACK_RESTART },
            max_krylov_iterations: 1000,
            max_halvings: 25,
        }
    }
}

impl NewtonSettings {
    fn check(&self) -> Result<(), InvalidSetting> {
        InvalidSetting::check_tolerance("relative_tolerance", self.relative_tolerance)?;
        let floor = self.floor;
        InvalidSetting::check(floor >= 0.0 && floor.is_finite(), "floor", floor, "finite and at least 0")?;
        self.forcing.check()?;
        if let Krylov::Gmres { restart } = self.krylov {
            InvalidSetting::check_restart(restart)?;
        }
        let krylov = self.max_krylov_iterations;
        InvalidSetting::check(krylov >= 1, "max_krylov_iterations", krylov as f64, "at least 1")?;
        let halvings = self.max_halvings;
        InvalidSetting::check(halvings <= 60, "max_halvings", f64::from(halvings), "at most 60")
    }
}

/// What made the line search accept a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Merit {
    /// The residual norm fell.
    Residual,
    /// It did not, but the potential fell.
    Potential,
}

/// One Newton iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonIteration {
    /// ‖R‖ after the iteration.
    pub residual: f64,
    /// The same over ‖R‖ before.
    pub ratio: f64,
    /// The accepted step length, 1 for the full step.
    pub step_length: f64,
    /// What accepted it.
    pub merit: Merit,
    /// The wanted relative residual of the linear system.
    pub forcing: f64,
    /// The linear solve that gave the step.
    pub krylov: LinearReport,
    /// The conjugate gradients given up before it because of negative curvature, if any.
    pub negative_curvature: Option<LinearReport>,
}

/// What was evaluated, how often.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NewtonCounts {
    /// Residuals, those of the line search included.
    pub residuals: usize,
    /// Residuals at shortened steps.
    pub line_search: usize,
    /// Potentials.
    pub potentials: usize,
    /// Magnitudes.
    pub magnitudes: usize,
    /// Tangents formed.
    pub linearizations: usize,
    /// Products with a tangent.
    pub tangent_products: usize,
    /// Krylov iterations.
    pub krylov_iterations: usize,
}

/// The course of the iteration, complete or not.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NewtonHistory {
    /// ‖R‖ at the initial guess, once it is known.
    pub first_residual: Option<f64>,
    /// The magnitude ‖R‖ is compared with, as last evaluated.
    pub magnitude: Option<f64>,
    /// The iterations, one entry for each accepted iterate.
    pub iterations: Vec<NewtonIteration>,
    /// What was evaluated.
    pub counts: NewtonCounts,
}

impl NewtonHistory {
    /// ‖R‖ at the last accepted iterate.
    pub fn residual(&self) -> Option<f64> {
        self.iterations.last().map(|last| last.residual).or(self.first_residual)
    }
}

/// Why the last iterate counts as a solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Convergence {
    /// ‖R‖ meets the tolerance or the floor.
    Tolerance,
    /// ‖R‖ no longer falls, and is below 16 times the floor.
    RoundOff,
}

/// A solution found.
#[derive(Clone, Debug, PartialEq)]
pub struct NewtonReport {
    /// Why it counts as one.
    pub convergence: Convergence,
    /// How it was reached.
    pub history: NewtonHistory,
}

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

/// Solves R(x) = 0 from the initial guess `x`.
///
/// 1. Stop when ‖R‖ ≤ max(rtol ‖R_first‖, floor · eps · magnitude), the magnitude being that of the initial guess.
/// 2. K = linearize(x).
/// 3. K d = −R by a Krylov method to ‖R + K d‖ ≤ η ‖R‖, η from [`Forcing`]. A solve that ends early is still used if it is below 0.9.
/// 4. s = 1.
/// 5. Accept x + s d if ‖R(x + s d)‖ ≤ (1 − 1e-4 s (1 − η)) ‖R‖, η now being what the solve has reached; or if
///    Π(x + s d) ≤ Π(x) + 1e-4 s R·d + 4 eps |Π|, where there is a potential that can resolve the predicted decrease s R·d < 0.
/// 6. Otherwise, or where x + s d is inadmissible or R not finite, halve s and go to 5.
/// 7. If no step is accepted, or none of the last 8 reduced ‖R‖ by a percent: converged if ‖R‖ ≤ 16 · floor · eps · magnitude, now
///    evaluated at x; an error if not.
/// 8. x ← x + s d, and back to 1.
///
/// Between calls into the problem: `x` holds accepted iterates only, also on error; every tangent is dropped before the
/// next residual; the residual at an accepted iterate is not evaluated twice.
///
/// # Errors
/// See [`NewtonFailure`]; the history so far comes with it.
pub fn newton<P: NonlinearProblem>(
    problem: &P,
    x: &mut [f64],
    settings: &NewtonSettings,
) -> Result<NewtonReport, NewtonError<P::Inadmissible>> {
    let mut history = NewtonHistory::default();
    match iterate(problem, x, settings, &mut history) {
        Ok(convergence) => Ok(NewtonReport { convergence, history }),
        Err(cause) => Err(NewtonError { cause, history: Box::new(history) }),
    }
}

fn iterate<P: NonlinearProblem>(
    problem: &P,
    x: &mut [f64],
    settings: &NewtonSettings,
    history: &mut NewtonHistory,
) -> Result<Convergence, NewtonFailure<P::Inadmissible>> {
    settings.check()?;
    let n = x.len();
    let (mut r, mut d) = (vec![0.0; n], vec![0.0; n]);
    let (mut trial, mut r_trial) = (vec![0.0; n], vec![0.0; n]);

    history.counts.residuals += 1;
    problem.residual(x, &mut r).map_err(|source| NewtonFailure::Inadmissible { iteration: 0, source })?;
    let first = norm(&r);
    if !first.is_finite() {
        return Err(NewtonFailure::NotFinite { what: "the residual", iteration: 0 });
    }
    history.first_residual = Some(first);
    let floor = settings.floor * f64::EPSILON;
    let first_magnitude = measure(problem, x, 0, history)?;
    let target = (settings.relative_tolerance * first).max(floor * first_magnitude);
    let too_large = DIVERGED * first.max(first_magnitude);

    let mut residual = first;
    let mut progress = None;
    let mut stalled = 0;
    loop {
        if residual <= target {
            return Ok(Convergence::Tolerance);
        }
        let iteration = history.iterations.len() + 1;
        if iteration > settings.max_iterations {
            return Err(NewtonFailure::MaxIterations { allowed: settings.max_iterations, residual, target });
        }
        let forcing = settings.forcing.next(progress, target / residual);
        let (krylov, negative_curvature) = {
            history.counts.linearizations += 1;
            let tangent = problem
                .linearize(x)
                .map_err(|source| NewtonFailure::Inadmissible { iteration: iteration - 1, source })?;
            solve(&tangent, &r, &mut d, forcing, settings, &mut history.counts)
                .map_err(|source| NewtonFailure::LinearSolverFailed { iteration, residual, source })?
        };
        let at = Step { x, d: &d, residual, slope: dot(&r, &d), linear: krylov.relative_residual };
        let round_off = ROUND_OFF_MULTIPLE * floor * first_magnitude;
        let searched = search(problem, &at, settings, round_off, &mut trial, &mut r_trial, &mut history.counts);
        let accepted = match searched {
            Search::Accepted(accepted) => accepted,
            Search::RoundOff => return Ok(Convergence::RoundOff),
            Search::Failed(failed) => {
                if residual <= ROUND_OFF_MULTIPLE * floor * measure(problem, x, iteration - 1, history)? {
                    return Ok(Convergence::RoundOff);
                }
                return Err(failed.into_failure(iteration, residual));
            }
        };
        x.copy_from_slice(&trial);
        std::mem::swap(&mut r, &mut r_trial);
        let ratio = accepted.residual / residual;
        residual = accepted.residual;
        progress = Some(Progress { forcing, ratio });
        history.iterations.push(NewtonIteration {
            residual,
            ratio,
            step_length: accepted.length,
            merit: accepted.merit,
            forcing,
            krylov,
            negative_curvature,
        });
        if residual > too_large {
            return Err(NewtonFailure::Diverged { iteration, residual, first });
        }
        stalled = if accepted.merit == Merit::Residual && ratio > STALL_RATIO { stalled + 1 } else { 0 };
        if stalled >= STALL_LENGTH && residual > target {
            let round_off = ROUND_OFF_MULTIPLE * floor * measure(problem, x, iteration, history)?;
            if residual <= round_off {
                return Ok(Convergence::RoundOff);
            }
            return Err(NewtonFailure::Stagnated { iteration, residual, target, round_off });
        }
    }
}

/// Evaluates the magnitude at the accepted iterate x.
fn measure<P: NonlinearProblem>(
    problem: &P,
    x: &[f64],
    iteration: usize,
    history: &mut NewtonHistory,
) -> Result<f64, NewtonFailure<P::Inadmissible>> {
    history.counts.magnitudes += 1;
    let magnitude = problem.magnitude(x).map_err(|source| NewtonFailure::Inadmissible { iteration, source })?;
    if !magnitude.is_finite() {
        return Err(NewtonFailure::NotFinite { what: "the magnitude of the residual's contributions", iteration });
    }
    history.magnitude = Some(magnitude);
    Ok(magnitude)
}

/// `K d = −r`; the report of the solve that gave d, and that of conjugate gradients given up before.
fn solve<T: super::LinearOperator + super::Preconditioner>(
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

/// A step to be searched along.
struct Step<'a> {
    x: &'a [f64],
    d: &'a [f64],
    /// ‖R(x)‖
    residual: f64,
    /// R·d, the slope of the potential.
    slope: f64,
    /// ‖R + K d‖ / ‖R‖ reached.
    linear: f64,
}

struct Accepted {
    length: f64,
    residual: f64,
    merit: Merit,
}

struct Failed<E> {
    trials: usize,
    shortest: f64,
    inadmissible: usize,
    not_finite: usize,
    last: Option<E>,
}

impl<E: std::error::Error + 'static> Failed<E> {
    fn into_failure(self, iteration: usize, residual: f64) -> NewtonFailure<E> {
        let Self { trials, shortest, inadmissible, not_finite, last } = self;
        if not_finite == trials {
            return NewtonFailure::NotFinite { what: "the residual at every step length", iteration };
        }
        NewtonFailure::LineSearchFailed { iteration, residual, trials, shortest, inadmissible, not_finite, last }
    }
}

enum Search<E> {
    /// The accepted iterate and its residual are in `trial` and `r_trial`.
    Accepted(Accepted),
    /// ‖R‖ is below the given round-off, and the full step does not lower it.
    RoundOff,
    Failed(Failed<E>),
}

/// Steps 4 to 6.
fn search<P: NonlinearProblem>(
    problem: &P,
    at: &Step,
    settings: &NewtonSettings,
    round_off: f64,
    trial: &mut [f64],
    r_trial: &mut [f64],
    counts: &mut NewtonCounts,
) -> Search<P::Inadmissible> {
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
                if !residual.is_finite() {
                    failed.not_finite += 1;
                } else if residual <= (1.0 - SUFFICIENT * length * (1.0 - at.linear)) * at.residual
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

/// The second merit function of the line search, evaluated only where the first one is not enough.
struct PotentialDecrease {
    /// Π(x) and its magnitude, once they are asked for; `Some(None)` if there is none.
    start: Option<Option<(f64, f64)>>,
}

impl PotentialDecrease {
    /// Π(x + s d) ≤ Π(x) + c s R·d + round-off, for a predicted decrease −s R·d above that round-off.
    fn suffices<P: NonlinearProblem>(
        &mut self,
        problem: &P,
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

#[cfg(test)]
mod tests {
    use super::super::testing::Dense;
    use super::*;

    #[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
    #[error("x = {0} is outside")]
    struct Outside(f64);

    /// R, its magnitude, Π and K as plain functions.
    struct Problem<R, M, W, K> {
        residual: R,
        magnitude: M,
        potential: W,
        tangent: K,
    }

    impl<R, M, W, K> NonlinearProblem for Problem<R, M, W, K>
    where
        R: Fn(&[f64]) -> Result<Vec<f64>, Outside>,
        M: Fn(&[f64]) -> f64,
        W: Fn(&[f64]) -> Option<(f64, f64)>,
        K: Fn(&[f64]) -> Dense,
    {
        type Inadmissible = Outside;
        type Tangent<'a>
            = Dense
        where
            Self: 'a;

        fn residual(&self, x: &[f64], r: &mut [f64]) -> Result<(), Outside> {
            r.copy_from_slice(&(self.residual)(x)?);
            Ok(())
        }
        fn magnitude(&self, x: &[f64]) -> Result<f64, Outside> {
            Ok((self.magnitude)(x))
        }
        fn potential(&self, x: &[f64]) -> Option<Result<(f64, f64), Outside>> {
            (self.potential)(x).map(Ok)
        }
        fn linearize(&self, x: &[f64]) -> Result<Dense, Outside> {
            Ok((self.tangent)(x))
        }
    }

    /// One unknown, no potential, contributions of magnitude 1.
    fn scalar(
        residual: impl Fn(f64) -> Result<f64, Outside>,
        derivative: impl Fn(f64) -> f64,
    ) -> impl NonlinearProblem<Inadmissible = Outside> {
        Problem {
            residual: move |x: &[f64]| Ok(vec![residual(x[0])?]),
            magnitude: |_: &[f64]| 1.0,
            potential: |_: &[f64]| None,
            tangent: move |x: &[f64]| Dense(vec![vec![derivative(x[0])]]),
        }
    }

    fn rosenbrock(conservative: bool) -> impl NonlinearProblem<Inadmissible = Outside> {
        Problem {
            residual: |x: &[f64]| {
                let valley = x[1] - x[0] * x[0];
                Ok(vec![2.0 * (x[0] - 1.0) - 400.0 * x[0] * valley, 200.0 * valley])
            },
            magnitude: |x: &[f64]| 400.0 * (x[0].abs() + 1.0).powi(3),
            potential: move |x: &[f64]| {
                let (a, b) = (x[0] - 1.0, x[1] - x[0] * x[0]);
                let value = a * a + 100.0 * b * b;
                conservative.then_some((value, value))
            },
            tangent: |x: &[f64]| {
                let off = -400.0 * x[0];
                Dense(vec![vec![2.0 - 400.0 * x[1] + 1200.0 * x[0] * x[0], off], vec![off, 200.0]])
            },
        }
    }

    /// Springs in a row, the first one held: n unknowns u, elongations g, force k g (1 − g²/2ℓ² + g⁴/2ℓ⁴), a load at the
    /// free end. Softening, then hardening.
    fn springs(k: f64, l: f64, load: f64, n: usize) -> impl NonlinearProblem<Inadmissible = Outside> {
        let elongation = |u: &[f64], i: usize| u[i] - if i == 0 { 0.0 } else { u[i - 1] };
        let terms = move |g: f64| {
            let s = (g / l) * (g / l);
            [k * g, -0.5 * k * g * s, 0.5 * k * g * s * s]
        };
        Problem {
            residual: move |u: &[f64]| {
                let mut r = vec![0.0; n];
                for i in 0..n {
                    let force = terms(elongation(u, i)).iter().sum::<f64>();
                    r[i] += force;
                    if i > 0 {
                        r[i - 1] -= force;
                    }
                }
                r[n - 1] -= load;
                Ok(r)
            },
            magnitude: move |u: &[f64]| {
                let force = |i| terms(elongation(u, i)).iter().map(|f| f.abs()).sum::<f64>();
                let sums: Vec<f64> =
                    (0..n).map(|i| force(i) + if i + 1 < n { force(i + 1) } else { load.abs() }).collect();
                norm(&sums)
            },
            potential: move |u: &[f64]| {
                let (mut value, mut magnitude) = (-load * u[n - 1], (load * u[n - 1]).abs());
                for i in 0..n {
                    let g = elongation(u, i);
                    for (term, power) in terms(g).into_iter().zip([2.0, 4.0, 6.0]) {
                        value += term * g / power;
                        magnitude += (term * g / power).abs();
                    }
                }
                Some((value, magnitude))
            },
            tangent: move |u: &[f64]| {
                let stiffness = |i: usize| {
                    let s = (elongation(u, i) / l) * (elongation(u, i) / l);
                    k * (1.0 - 1.5 * s + 2.5 * s * s)
                };
                Dense::from_fn(n, |i, j| match i.abs_diff(j) {
                    0 => stiffness(i) + if i + 1 < n { stiffness(i + 1) } else { 0.0 },
                    1 => -stiffness(i.max(j)),
                    _ => 0.0,
                })
            },
        }
    }

    fn solved(problem: &impl NonlinearProblem<Inadmissible = Outside>, x: &mut [f64]) -> NewtonReport {
        newton(problem, x, &NewtonSettings::default()).unwrap()
    }

    fn failure(
        problem: &impl NonlinearProblem<Inadmissible = Outside>,
        x: &mut [f64],
        settings: &NewtonSettings,
    ) -> NewtonError<Outside> {
        newton(problem, x, settings).unwrap_err()
    }

    #[test]
    fn rosenbrock_is_solved_and_counted() {
        let mut x = [-1.2, 1.0];
        let NewtonReport { history, .. } = solved(&rosenbrock(true), &mut x);
        assert!((x[0] - 1.0).abs() < 1e-8 && (x[1] - 1.0).abs() < 1e-8, "{x:?}");
        // The full second step multiplies the residual by 300 and lowers nothing: the line search must have worked.
        assert!(history.iterations.iter().all(|i| i.merit == Merit::Potential || i.ratio < 1.0));
        let counts = history.counts;
        assert_eq!(counts.linearizations, history.iterations.len());
        assert_eq!(counts.residuals, 1 + history.iterations.len() + counts.line_search);
        assert_eq!(counts.krylov_iterations, history.iterations.iter().map(|i| i.krylov.iterations).sum::<usize>());
        assert_eq!(counts.magnitudes, 1);
    }

    #[test]
    fn convergence_is_quadratic() {
        let mut u = vec![0.0; 12];
        let settings =
            NewtonSettings { relative_tolerance: 1e-13, forcing: Forcing::Fixed(1e-12), ..NewtonSettings::default() };
        let report = newton(&springs(3.0, 1.0, 1.2, 12), &mut u, &settings).unwrap();
        let residuals: Vec<f64> = report.history.iterations.iter().map(|i| i.residual).collect();
        // Order of the last three above round-off: log(r₃/r₂) / log(r₂/r₁) → 2.
        let above: Vec<f64> = residuals.into_iter().filter(|r| *r > 1e-12).collect();
        let [.., a, b, c] = above[..] else { panic!("{above:?}") };
        let order = (c / b).ln() / (b / a).ln();
        assert!(order > 1.8 && order < 2.5, "{order} {above:?}");
    }

    #[test]
    fn inadmissible_steps_are_shortened() {
        // ln x = −1 from x = 10: the full step goes to x < 0.
        let problem = scalar(|x| if x > 0.0 { Ok(x.ln() + 1.0) } else { Err(Outside(x)) }, |x| 1.0 / x);
        let mut x = [10.0];
        let report = solved(&problem, &mut x);
        assert!((x[0] - (-1.0_f64).exp()).abs() < 1e-9);
        assert!(report.history.iterations[0].step_length < 1.0 && report.history.counts.line_search > 0);
        let mut x = [-1.0];
        let error = failure(&problem, &mut x, &NewtonSettings::default());
        assert!(matches!(error.cause, NewtonFailure::Inadmissible { iteration: 0, source: Outside(-1.0) }));
        assert_eq!((x[0], error.history.first_residual), (-1.0, None));
    }

    #[test]
    fn scaling_by_powers_of_two_gives_the_same_bits() {
        let n = 15;
        for krylov in [Krylov::Gmres { restart: 6 }, Krylov::ConjugateGradient] {
            for forcing in [Forcing::Fixed(1e-8), Forcing::EisenstatWalker] {
                let settings = NewtonSettings { krylov, forcing, ..NewtonSettings::default() };
                let mut reference = vec![0.0; n];
                let report = newton(&springs(3.0, 0.7, 2.9, n), &mut reference, &settings).unwrap();
                for (length, force) in [(30, 30), (-30, 30), (30, -90), (-30, -91), (29, 120)] {
                    let (length, force) = (2.0_f64.powi(length), 2.0_f64.powi(force));
                    let mut u = vec![0.0; n];
                    let problem = springs(3.0 * force / length, 0.7 * length, 2.9 * force, n);
                    let scaled = newton(&problem, &mut u, &settings).unwrap();
                    assert!(u.iter().zip(&reference).all(|(u, v)| u.to_bits() == (v * length).to_bits()));
                    assert_eq!(scaled.history.counts, report.history.counts);
                    for (a, b) in scaled.history.iterations.iter().zip(&report.history.iterations) {
                        assert_eq!(*a, NewtonIteration { residual: b.residual * force, ..*b });
                    }
                }
            }
        }
    }

    #[test]
    fn forcing_terms_reach_the_same_solution() {
        let problem = springs(1.0, 1.0, 1.1, 20);
        let solve = |forcing| {
            let mut u = vec![0.0; 20];
            let settings = NewtonSettings { relative_tolerance: 1e-11, forcing, ..NewtonSettings::default() };
            let report = newton(&problem, &mut u, &settings).unwrap();
            assert!(report.history.iterations.iter().all(|i| i.krylov.relative_residual <= i.forcing));
            (u, report.history.counts.krylov_iterations)
        };
        let (exact, tight) = solve(Forcing::Fixed(1e-10));
        let (u, loose) = solve(Forcing::EisenstatWalker);
        assert!(u.iter().zip(&exact).all(|(u, v)| (u - v).abs() < 1e-8));
        assert!(loose < tight, "{loose} {tight}");
    }

    #[test]
    fn negative_curvature_falls_back_to_gmres_and_says_so() {
        // K = [1 + 3x², 2; 2, 1]: indefinite near 0, with a positive diagonal.
        let problem = Problem {
            residual: |x: &[f64]| Ok(vec![x[0] + 2.0 * x[1] + x[0].powi(3), 2.0 * x[0] + x[1]]),
            magnitude: |_: &[f64]| 1.0,
            potential: |_: &[f64]| None,
            tangent: |x: &[f64]| Dense(vec![vec![1.0 + 3.0 * x[0] * x[0], 2.0], vec![2.0, 1.0]]),
        };
        let mut x = [0.5, -0.5];
        let settings = NewtonSettings { krylov: Krylov::ConjugateGradient, ..NewtonSettings::default() };
        let report = newton(&problem, &mut x, &settings).unwrap();
        let first = report.history.iterations[0];
        assert!(first.krylov.converged());
        assert_eq!(first.negative_curvature.map(|r| r.outcome), Some(LinearOutcome::NegativeCurvature));
        // Where the tangent is definite there is nothing to fall back from.
        let mut u = vec![0.0; 5];
        let report = newton(&springs(1.0, 1.0, 0.3, 5), &mut u, &settings).unwrap();
        assert!(report.history.iterations.iter().all(|i| i.negative_curvature.is_none()));
    }

    #[test]
    fn potential_accepts_what_the_residual_norm_refuses() {
        // Along Rosenbrock's curved valley every useful step raises the residual, while Π falls.
        let solve = |potential| {
            let settings = NewtonSettings { max_iterations: 500, ..NewtonSettings::default() };
            newton(&rosenbrock(potential), &mut [-1.2, 1.0], &settings).map(|report| report.history)
        };
        let with = solve(true).unwrap();
        assert!(with.iterations.iter().any(|i| i.merit == Merit::Potential && i.ratio > 1.0));
        // The norm alone creeps along the valley, or gives up in it.
        assert!(solve(false).map_or(true, |history| history.iterations.len() > 2 * with.iterations.len()));
    }

    #[test]
    fn not_finite_is_never_accepted() {
        let problem = scalar(|_| Ok(f64::NAN), |_| 1.0);
        let error = failure(&problem, &mut [1.0], &NewtonSettings::default());
        assert!(matches!(error.cause, NewtonFailure::NotFinite { iteration: 0, .. }));
        // NaN beyond x = 1, where the full step goes: shortened like an inadmissible one.
        for bad in [f64::NAN, f64::INFINITY] {
            let problem = scalar(|x| Ok(if x > 1.0 { bad } else { x * x * x - 0.5 }), |x| 3.0 * x * x);
            let mut x = [0.2];
            assert!(solved(&problem, &mut x).history.iterations[0].step_length < 1.0);
            assert!((x[0] - 0.5_f64.cbrt()).abs() < 1e-8);
            // NaN everywhere but at the guess.
            let problem = scalar(|x| Ok(if x == 3.0 { 1.0 } else { bad }), |_| 1.0);
            let mut x = [3.0];
            let error = failure(&problem, &mut x, &NewtonSettings::default());
            assert!(matches!(error.cause, NewtonFailure::NotFinite { iteration: 1, .. }), "{error:?}");
            assert_eq!(x, [3.0]);
            // In the tangent.
            let error = failure(&scalar(Ok, |_| bad), &mut x, &NewtonSettings::default());
            assert!(matches!(
                error.cause,
                NewtonFailure::LinearSolverFailed { source: LinearSolverFailure::Error(_), .. }
            ));
            // In the magnitude, which would make anything converged.
            let problem = Problem {
                residual: |x: &[f64]| Ok(x.to_vec()),
                magnitude: |_: &[f64]| bad,
                potential: |_: &[f64]| None,
                tangent: |_: &[f64]| Dense(vec![vec![1.0]]),
            };
            let error = failure(&problem, &mut [1.0], &NewtonSettings::default());
            assert!(matches!(error.cause, NewtonFailure::NotFinite { iteration: 0, .. }));
        }
    }

    #[test]
    fn failures_are_told_apart() {
        let default = NewtonSettings::default();
        let settings = NewtonSettings { max_iterations: 3, ..default };
        let mut x = [-1.2, 1.0];
        let error = failure(&rosenbrock(true), &mut x, &settings);
        assert!(matches!(error.cause, NewtonFailure::MaxIterations { allowed: 3, .. }));
        // x is the last accepted iterate: its residual is the last one reported.
        let mut r = [0.0; 2];
        rosenbrock(true).residual(&x, &mut r).unwrap();
        assert_eq!((Some(norm(&r)), error.history.iterations.len()), (error.history.residual(), 3));

        // A tangent without anything in it.
        let error = failure(&scalar(|x| Ok(x - 1.0), |_| 0.0), &mut [0.0], &default);
        assert!(matches!(error.cause, NewtonFailure::LinearSolverFailed { iteration: 1, .. }), "{error:?}");
        // A tangent of the wrong sign: the residual rises at every step length.
        let mut x = [0.0];
        let error = failure(&scalar(|x| Ok(x - 1.0), |_| -1.0), &mut x, &default);
        assert!(matches!(
            error.cause,
            NewtonFailure::LineSearchFailed { trials: 26, inadmissible: 0, not_finite: 0, .. }
        ));
        assert_eq!(x, [0.0]);
        // A tangent a thousand times too stiff: every step is accepted and none helps.
        let error = failure(&scalar(|x| Ok(x - 1.0), |_| 1000.0), &mut [0.0], &default);
        assert!(matches!(error.cause, NewtonFailure::Stagnated { iteration: 8, .. }), "{error:?}");
        // Downhill without end: Π = −½x², and a tangent that is no derivative of it.
        let downhill = Problem {
            residual: |x: &[f64]| Ok(vec![-x[0]]),
            magnitude: |x: &[f64]| x[0].abs(),
            potential: |x: &[f64]| Some((-0.5 * x[0] * x[0], 0.5 * x[0] * x[0])),
            tangent: |_: &[f64]| Dense(vec![vec![1.0]]),
        };
        let error = failure(&downhill, &mut [1.0], &default);
        assert!(matches!(error.cause, NewtonFailure::Diverged { residual, .. } if residual > 1e8), "{error:?}");
        let settings = NewtonSettings { forcing: Forcing::Fixed(0.0), ..default };
        let error = failure(&downhill, &mut [1.0], &settings);
        assert!(matches!(error.cause, NewtonFailure::Setting(InvalidSetting { name: "forcing", .. })));
    }

    #[test]
    fn round_off_is_convergence_and_other_stagnation_is_not() {
        let settings = NewtonSettings { relative_tolerance: 0.0, ..NewtonSettings::default() };
        // x − 1 with a last step that cannot be taken: |R| never falls below `noise`.
        let noisy = |noise: f64| scalar(move |x| Ok(if (x - 1.0).abs() < noise { noise } else { x - 1.0 }), |_| 1.0);
        let eps = f64::EPSILON;
        let mut x = [0.0];
        // Below the floor 4 eps · 1, below 16 floors, and above.
        let report = newton(&noisy(3.0 * eps), &mut x, &settings).unwrap();
        assert_eq!(report.convergence, Convergence::Tolerance);
        let mut x = [0.0];
        let report = newton(&noisy(40.0 * eps), &mut x, &settings).unwrap();
        assert_eq!(report.convergence, Convergence::RoundOff);
        assert!(report.history.counts.line_search == 0, "no halving where nothing can be gained");
        let error = failure(&noisy(100.0 * eps), &mut [0.0], &settings);
        assert!(matches!(error.cause, NewtonFailure::LineSearchFailed { iteration: 2, .. }), "{error:?}");
        assert_eq!(error.history.counts.magnitudes, 2);
    }

    #[test]
    fn nothing_to_do() {
        let report = solved(&springs(1.0, 1.0, 0.0, 4), &mut [0.0; 4]);
        assert_eq!((report.convergence, report.history.iterations.len()), (Convergence::Tolerance, 0));
        // At rest up to round-off: 0.1 + 0.2 − 0.3 of magnitude 0.6.
        let report = solved(&scalar(|_| Ok(0.1 + 0.2 - 0.3), |_| 1.0), &mut [0.0]);
        assert_eq!(report.history.counts.linearizations, 0);
    }

    #[test]
    fn settings_are_read_from_json_by_name() {
        let read = |text| serde_json::from_str::<NewtonSettings>(text);
        assert_eq!(read("{}").unwrap(), NewtonSettings::default());
        let settings = read(r#"{"krylov": "conjugate_gradient", "forcing": {"fixed": 1e-3}}"#).unwrap();
        assert_eq!((settings.krylov, settings.forcing), (Krylov::ConjugateGradient, Forcing::Fixed(1e-3)));
        assert!(read(r#"{"tolerance": 1e-3}"#).is_err());
    }
}
