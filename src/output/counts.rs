//! Counts and seconds over all steps of a run.

use crate::phases::{Phase, Stopwatch};
use crate::simulation::{FailedAttempt, StepReport};
use crate::solver::NewtonHistory;
use serde::{Deserialize, Serialize};

/// Counts over all steps. Iterations, residuals and tangent products of failed attempts at a step are included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Counts {
    /// Particles.
    pub particles: usize,
    /// Largest number of active nodes in a step.
    pub max_active_nodes: usize,
    /// Steps taken.
    pub steps: u64,
    /// Steps that began with a grid reset.
    pub grids: u64,
    /// Attempts at a step that failed, or whose error exceeded the tolerance. The step was then repeated with half of its length, or the
    /// run ended.
    pub failed_attempts: u64,
    /// Newton iterations of failed attempts.
    pub failed_newton_iterations: u64,
    /// Krylov iterations of failed attempts.
    pub failed_krylov_iterations: u64,
    /// Loops over all particles, in successful steps.
    pub particle_passes: u64,
    /// Newton iterations.
    pub newton_iterations: u64,
    /// Largest number of Newton iterations in a successful step.
    pub max_newton_iterations: usize,
    /// Krylov iterations.
    pub krylov_iterations: u64,
    /// Linear systems left unsolved at the limit on Krylov iterations.
    #[serde(default)]
    pub krylov_limited: u64,
    /// Linear systems left unsolved because their residual no longer fell.
    #[serde(default)]
    pub krylov_stagnated: u64,
    /// Residuals evaluated by Newton's method.
    pub residual_evaluations: u64,
    /// Products of the tangent with a vector.
    pub tangent_products: u64,
    /// Iterations of the projection onto the nodes.
    pub projection_iterations: u64,
}

impl Counts {
    /// Adds a step.
    pub(crate) fn add<const D: usize>(&mut self, step: &StepReport<D>) {
        let newton = &step.newton.history;
        self.max_active_nodes = self.max_active_nodes.max(step.active_nodes);
        self.steps += 1;
        self.grids += u64::from(step.reset);
        self.particle_passes += step.seconds.passes().iter().sum::<u64>();
        self.max_newton_iterations = self.max_newton_iterations.max(newton.iterations.len());
        self.projection_iterations += step.projection_iterations as u64;
        self.add_newton(newton);
        self.add_failed(&step.failed);
    }

    /// Adds attempts that failed.
    pub(crate) fn add_failed(&mut self, attempts: &[FailedAttempt]) {
        self.failed_attempts += attempts.len() as u64;
        for attempt in attempts {
            self.projection_iterations += attempt.projection_iterations as u64;
            self.failed_newton_iterations += attempt.newton.iterations.len() as u64;
            self.failed_krylov_iterations += attempt.newton.counts.krylov_iterations as u64;
            self.add_newton(&attempt.newton);
        }
    }

    fn add_newton(&mut self, newton: &NewtonHistory) {
        self.newton_iterations += newton.iterations.len() as u64;
        self.krylov_iterations += newton.counts.krylov_iterations as u64;
        self.krylov_limited += newton.counts.krylov_limited as u64;
        self.krylov_stagnated += newton.counts.krylov_stagnated as u64;
        self.residual_evaluations += newton.counts.residuals as u64;
        self.tangent_products += newton.counts.tangent_products as u64;
    }
}

/// Seconds of a run. Seconds of steps are summed over all steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Seconds {
    /// Seconds of each of [`Phase::ALL`].
    pub phases: [f64; Phase::ALL.len()],
    /// Seconds before the first step: reading the scene, filling bodies with particles.
    #[serde(default)]
    pub set_up: f64,
    /// Seconds in which rows and snapshots are computed and written.
    #[serde(default)]
    pub output: f64,
    /// Seconds of the whole run: set-up, steps, failed attempts, output.
    pub total: f64,
}

impl Seconds {
    /// Adds the phases of a step.
    pub(crate) fn add<const D: usize>(&mut self, step: &StepReport<D>) {
        self.add_phases(&step.seconds);
        self.add_failed(&step.failed);
    }

    /// Adds the phases of attempts that failed.
    pub(crate) fn add_failed(&mut self, attempts: &[FailedAttempt]) {
        attempts.iter().for_each(|attempt| self.add_phases(&attempt.seconds));
    }

    fn add_phases(&mut self, watch: &Stopwatch) {
        self.phases.iter_mut().zip(watch.seconds()).for_each(|(sum, seconds)| *sum += seconds);
    }

    /// The set-up, the phases by name, the output, and `other`: the remaining seconds, such as those of checkpoints.
    pub(crate) fn named(&self) -> impl Iterator<Item = (&'static str, f64)> + '_ {
        let other = self.total - self.set_up - self.phases.iter().sum::<f64>() - self.output;
        let phases = Phase::ALL.iter().map(|phase| phase.1).zip(self.phases);
        std::iter::once(("set_up", self.set_up))
            .chain(phases)
            .chain([("output", self.output), ("other", other.max(0.0))])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Result = std::result::Result<(), Box<dyn std::error::Error>>;

    #[test]
    fn a_failed_attempt_is_counted_beside_the_steps() -> Result {
        let scene = crate::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
        let mut simulation = scene.build::<2>("scenes".as_ref())?;
        let (mut counts, step) = (Counts::default(), simulation.advance()?);
        counts.add(&step);
        counts.add(&simulation.advance()?);
        assert_eq!((counts.steps, counts.max_active_nodes), (2, step.active_nodes));
        let newton = step.newton.history.clone();
        let before = counts.residual_evaluations;
        let (why, seconds) = ("no equilibrium was found".into(), Stopwatch::start());
        let failed = FailedAttempt { dt: 0.05, inaccurate: false, why, projection_iterations: 7, newton, seconds };
        counts.add_failed(&[failed]);
        assert_eq!((counts.steps, counts.failed_attempts), (2, 1));
        assert_eq!(counts.residual_evaluations, before + step.newton.history.counts.residuals as u64);
        // The steps have none, because their mass is lumped.
        assert_eq!(counts.projection_iterations, 7);
        Ok(())
    }

    #[test]
    fn the_named_seconds_add_up_to_the_total() -> Result {
        let scene = crate::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
        let mut simulation = scene.build::<2>("scenes".as_ref())?;
        let (start, mut seconds) = (std::time::Instant::now(), Seconds::default());
        seconds.add(&simulation.step()?);
        seconds.add(&simulation.step()?);
        seconds.total = start.elapsed().as_secs_f64();
        let sum: f64 = seconds.named().map(|(_, seconds)| seconds).sum();
        assert!((sum / seconds.total - 1.0).abs() < 1e-12);
        Ok(())
    }
}
