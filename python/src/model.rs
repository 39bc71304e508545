//! A simulation of any dimension: here D is a number for the last time.

use crate::law::BodyLaw;
use crate::step::Step;
use crate::system::System;
use bfree::clock::Clock;
use bfree::field::Field;
use bfree::output::{OutputError, Reference};
use bfree::simulation::{AdvanceError, Simulation, StepError};
use bfree::solver::Stop;
use std::sync::Arc;

/// The functions of a simulation that Python calls.
pub trait Model: Send + Sync {
    fn dimension(&self) -> usize;
    fn clock(&self) -> &Clock;
    fn set_clock(&mut self, clock: Clock);
    fn advance(&mut self) -> Result<Step, AdvanceError>;
    /// Who may want a step to end.
    fn stop(&mut self, stop: Option<Stop>);
    /// By the ids of the particles; as many numbers as there are particles and components.
    fn values(&self, field: &Field) -> Result<Vec<f64>, OutputError>;
    fn next_step(&self) -> Result<Arc<dyn System>, StepError>;
    fn kinetic_energy(&self) -> f64;
    fn strain_energy(&self) -> f64;
    fn external_work(&self) -> f64;
    fn dissipated(&self) -> f64;
    fn momentum(&self) -> Vec<f64>;
}

/// A simulation, and where it started.
pub struct Sized<const D: usize> {
    pub simulation: Simulation<D, BodyLaw>,
    pub start: Reference<D>,
}

impl<const D: usize> Model for Sized<D> {
    fn dimension(&self) -> usize {
        D
    }

    fn clock(&self) -> &Clock {
        &self.simulation.clock
    }

    fn set_clock(&mut self, clock: Clock) {
        self.simulation.clock = clock;
    }

    fn advance(&mut self) -> Result<Step, AdvanceError> {
        let report = self.simulation.advance()?;
        Ok(Step::of(&report, self.simulation.clock.time(), &self.simulation.loads.prescribed))
    }

    fn stop(&mut self, stop: Option<Stop>) {
        self.simulation.settings.stop = stop;
    }

    fn values(&self, field: &Field) -> Result<Vec<f64>, OutputError> {
        field.values(&self.simulation, &self.start)
    }

    fn next_step(&self) -> Result<Arc<dyn System>, StepError> {
        Ok(Arc::new(self.simulation.next_step()?))
    }

    fn kinetic_energy(&self) -> f64 {
        self.simulation.particles.kinetic_energy()
    }

    fn strain_energy(&self) -> f64 {
        self.simulation.strain_energy()
    }

    fn external_work(&self) -> f64 {
        self.simulation.external_work
    }

    fn dissipated(&self) -> f64 {
        self.simulation.dissipated
    }

    fn momentum(&self) -> Vec<f64> {
        self.simulation.particles.momentum().iter().copied().collect()
    }
}
