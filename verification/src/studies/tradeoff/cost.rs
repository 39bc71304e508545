//! A run of a simulation, and its cost.

use crate::processor::Thread;
use crate::studies::StudyError;
use bfree::mechanics::loads::ForceField;
use bfree::mechanics::sweep::Connectivity;
use bfree::plan::Plan;
use bfree::simulation::Simulation;
use bfree::solver::NewtonHistory;
use bfree::tensor::Vector;
use std::sync::Arc;

/// An iteration is quadratic if the linear solver leaves at most this share of the new residual: the rest is the second-order error of
/// Newton's own step.
const LINEAR_SHARE: f64 = 0.5;

/// A run is quadratic if this share of its iterations is, without the last of each step.
const QUADRATIC_SHARE: f64 = 0.9;

/// The round-off of a residual over its magnitude.
const ROUND_OFF: f64 = 64.0 * f64::EPSILON;

/// The time of each evaluation over that of a product with the tangent: rounded medians over all functions and dimensions.
const SHAPES: f64 = 4.0;
const PROJECTION: f64 = 1.6;
const RESIDUAL: f64 = 1.5;
const LINEARIZATION: f64 = 1.2;

/// A product takes as long at a particle, apart from its nodes, as at this number of nodes.
const PARTICLE: f64 = 24.0;

/// The counts of evaluations.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    pub steps: u64,
    pub iterations: usize,
    pub residuals: usize,
    pub linearizations: usize,
    pub products: usize,
    projections: usize,
    /// Iterations without the last of each step.
    decisive: usize,
    /// Decisive iterations limited by the linear solver.
    limited: usize,
}

impl Tally {
    fn add(&mut self, newton: &NewtonHistory, projection_iterations: usize) {
        self.steps += 1;
        self.projections += projection_iterations;
        self.add_newton(newton);
    }

    fn add_newton(&mut self, newton: &NewtonHistory) {
        self.iterations += newton.iterations.len();
        self.residuals += newton.counts.residuals;
        self.linearizations += newton.counts.linearizations;
        self.products += newton.counts.tangent_products;
        let round_off = ROUND_OFF * newton.magnitude.unwrap_or(0.0);
        let limited = |one: &&bfree::solver::NewtonIteration| {
            one.residual > round_off && one.krylov.relative_residual > LINEAR_SHARE * one.ratio
        };
        // The last iteration ends below the tolerance, whatever limits it.
        let before_last = newton.iterations.split_last().map_or(&[][..], |(_, before)| before);
        self.decisive += before_last.len();
        self.limited += before_last.iter().filter(limited).count();
    }

    /// All evaluations, as a number of products.
    fn products_worth(&self) -> f64 {
        SHAPES * self.steps as f64
            + PROJECTION * self.projections as f64
            + RESIDUAL * self.residuals as f64
            + LINEARIZATION * self.linearizations as f64
            + self.products as f64
    }

    /// Whether Newton's method converged quadratically.
    pub fn quadratic(&self) -> bool {
        self.limited as f64 <= (1.0 - QUADRATIC_SHARE) * self.decisive as f64
    }
}

/// The cost of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cost {
    pub tally: Tally,
    /// Counts times the usual time of each evaluation. The unit is the share of one node in the product of one particle.
    pub work: f64,
    /// CPU seconds of its one thread, without the evaluation of forces and errors.
    pub seconds: f64,
    /// The peak number of bytes, by the plan.
    pub bytes: u64,
}

/// Takes `steps` steps of the nominal length, and shows the simulation to `watch` after each.
pub(super) fn drive<const D: usize>(
    simulation: &mut Simulation<D>,
    steps: u64,
    mut watch: impl FnMut(&Simulation<D>) -> Result<(), StudyError>,
) -> Result<Cost, StudyError> {
    let (product, bytes) = (product_work(simulation)?, Plan::of(simulation)?.bytes());
    let mut tally = Tally::default();
    let mut seconds = 0.0;
    let field = simulation.loads.field.take();
    while simulation.clock.nominal_steps() < steps {
        simulation.loads.field = field.as_ref().map(|field| tabulated(field, simulation));
        let start = Thread::now();
        let report = simulation.advance()?;
        seconds += start.elapsed();
        report.failed.iter().for_each(|attempt| tally.add_newton(&attempt.newton));
        tally.add(&report.newton.history, report.projection_iterations);
        watch(simulation)?;
    }
    simulation.loads.field = field;
    Ok(Cost { tally, work: tally.products_worth() * product, seconds, bytes })
}

/// The work of one product at the start of a run.
fn product_work<const D: usize>(simulation: &Simulation<D>) -> Result<f64, StudyError> {
    let (connectivity, _) =
        Connectivity::new(&simulation.approximation, &simulation.grid, &simulation.particles.position)?;
    Ok((0..connectivity.particles()).map(|p| PARTICLE + connectivity.of(p).count() as f64).sum())
}

/// A force field with tabulated values for the next step, so that they cost the step nothing.
fn tabulated<const D: usize>(field: &ForceField<D>, simulation: &Simulation<D>) -> ForceField<D> {
    let (t, dt) = (simulation.clock.time(), simulation.clock.step());
    let particles = simulation.particles.by_id();
    let at = |t: f64| -> (f64, Vec<Vector<f64, D>>) {
        (t, particles.position.iter().enumerate().map(|(id, x)| field.0(id, x, t)).collect())
    };
    let (tables, field) = ([at(t), at(t + dt)], field.clone());
    ForceField(Arc::new(move |id, x, t| match tables.iter().find(|(time, _)| *time == t) {
        Some((_, table)) => table[id],
        None => field.0(id, x, t),
    }))
}
