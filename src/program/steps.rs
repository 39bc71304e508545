//! The steps of a run.

use super::agreement::check_step;
use crate::checkpoint::Checkpoints;
use crate::clock::Clock;
use crate::output::{Asked, Recorder};
use crate::parallel::in_pool;
use crate::simulation::{AdvanceError, Simulation};
use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The steps that a run takes: whole steps, and a shortened last step if the end lies between whole steps.
pub(crate) struct Schedule {
    end: f64,
    /// Whole steps of the clock to take.
    whole_steps: u64,
    /// Whether a shortened step follows.
    shortens: bool,
}

impl Schedule {
    /// The steps until `end`, at most `most` of them. The shortened step counts as one.
    pub(crate) fn new(clock: &Clock, end: f64, most: Option<u64>) -> Self {
        let until_end = clock.whole_steps(end);
        Self {
            end,
            whole_steps: most.map_or(until_end, |most| most.min(until_end)),
            shortens: most.is_none_or(|most| most > until_end),
        }
    }

    /// The time after the last step.
    pub(crate) fn end_time(&self, clock: &Clock) -> f64 {
        if self.shortens { self.end } else { self.whole_steps as f64 * clock.nominal() }
    }

    /// Whether steps are left to take.
    pub(crate) fn is_left(&self, clock: &Clock) -> bool {
        !self.whole_steps_are_taken(clock) || self.shortens && clock.to(self.end).is_some()
    }

    fn whole_steps_are_taken(&self, clock: &Clock) -> bool {
        clock.nominal_steps() >= self.whole_steps
    }

    /// Makes the shortened last step the only step of the clock. Returns false if there is no such step.
    fn shorten(&mut self, clock: &mut Clock) -> bool {
        let Some(shortened) = clock.to(self.end).filter(|_| self.shortens) else { return false };
        *clock = shortened;
        self.whole_steps = 1;
        self.shortens = false;
        true
    }
}

/// The files of a run.
pub(super) struct Records<const D: usize> {
    pub recorder: Recorder<D>,
    /// `None` without checkpoints, and after the last one.
    pub checkpoints: Option<Checkpoints>,
}

impl<const D: usize> Records<D> {
    fn write_checkpoint_if_due(&mut self, simulation: &Simulation<D>) -> Result<(), Box<dyn Error>> {
        match &mut self.checkpoints {
            Some(checkpoints) => Ok(checkpoints.write_if_due(simulation, &mut self.recorder)?),
            None => Ok(()),
        }
    }

    /// Whether the records of a step need the state of all particles in this process.
    fn need_particles(&self, clock: &Clock) -> bool {
        self.recorder.needs_particles(clock) || self.checkpoints.as_ref().is_some_and(|all| all.are_due(clock))
    }

    /// Whether the last records do.
    fn need_particles_at_end(&self) -> bool {
        self.recorder.needs_particles_at_end() || self.checkpoints.is_some()
    }

    /// Writes the last checkpoint. It precedes the last snapshot and a shortened step. A longer run has neither of them here.
    fn write_last_checkpoint(&mut self, simulation: &Simulation<D>) -> Result<(), Box<dyn Error>> {
        match self.checkpoints.take() {
            Some(mut checkpoints) => Ok(checkpoints.write(simulation, &mut self.recorder)?),
            None => Ok(()),
        }
    }
}

/// A simulation in progress, with its records.
pub(super) struct Steps<const D: usize> {
    pub simulation: Simulation<D>,
    /// `None` in all processes but the first.
    pub records: Option<Records<D>>,
    /// The fields and probes for which process 0 may ask the others.
    pub asked: Asked<D>,
    pub schedule: Schedule,
    /// Set by another thread to end the run after a whole step.
    pub interrupted: Arc<AtomicBool>,
}

impl<const D: usize> Steps<D> {
    /// Takes steps until the end, an interruption, or a failed step, whose error is returned. All processes end after the same step.
    ///
    /// # Errors
    /// The results cannot be written.
    pub(crate) fn take(&mut self) -> Result<Option<AdvanceError>, Box<dyn Error>> {
        let processes = self.simulation.settings.processes.clone();
        loop {
            let written = self.write(Records::write_checkpoint_if_due);
            if processes.any(written.is_err()) {
                return written.map(|()| None);
            }
            let interrupted = processes.any(self.interrupted.load(Ordering::Relaxed));
            if interrupted || self.schedule.whole_steps_are_taken(&self.simulation.clock) {
                self.collect_particles_if(Records::need_particles_at_end);
                let last = self.write(Records::write_last_checkpoint);
                let failed = processes.any(last.is_err());
                if failed || interrupted || !self.schedule.shorten(&mut self.simulation.clock) {
                    return last.map(|()| None);
                }
            }
            let simulation = &mut self.simulation;
            match in_pool(|| simulation.advance()) {
                Ok(step) => {
                    check_step(&processes, &step)?;
                    let (sums, clock) = (simulation.sums(), simulation.clock);
                    self.collect_particles_if(|records| records.need_particles(&clock));
                    let written = self.write(|records, at| Ok(records.recorder.record_with(at, &step, &sums)?));
                    if processes.any(written.is_err()) {
                        return written.map(|()| None);
                    }
                }
                // The next round of the loop handles the interruption.
                Err(error) if error.cause.is_stopped() => {}
                Err(error) => {
                    self.collect_particles_if(Records::need_particles_at_end);
                    return Ok(Some(error));
                }
            }
        }
    }

    /// Collects the particles in process 0, if its records need them.
    fn collect_particles_if(&mut self, need: impl FnOnce(&Records<D>) -> bool) {
        if self.simulation.settings.processes.any(self.records.as_ref().is_some_and(need)) {
            self.simulation.collect_particles();
        }
    }

    /// Calls `write`, if this process writes. All others answer its questions.
    fn write(
        &mut self,
        write: impl FnOnce(&mut Records<D>, &Simulation<D>) -> Result<(), Box<dyn Error>>,
    ) -> Result<(), Box<dyn Error>> {
        let written = self.records.as_mut().map_or(Ok(()), |records| write(records, &self.simulation));
        self.asked.end_or_answer(&self.simulation);
        written
    }
}
