//! A run of a simulation, and its cost.

use crate::prepared::{Prepared, arranged};
use crate::processor::Thread;
use crate::studies::StudyError;
use bfree::mechanics::loads::ForceField;
use bfree::mechanics::sweep::Supports;
use bfree::mechanics::transfer::Nodal;
use bfree::plan::Plan;
use bfree::simulation::Simulation;
use bfree::solver::NewtonHistory;
use bfree::tensor::Vector;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

/// An iteration is quadratic if the linear solver leaves at most this share of the new residual: the rest is the second-order error of
/// Newton's own step.
const LINEAR_SHARE: f64 = 0.5;

/// A run is quadratic if this share of its iterations is, without the last of each step.
const QUADRATIC_SHARE: f64 = 0.9;

/// The round-off of a residual over its magnitude.
const ROUND_OFF: f64 = 64.0 * f64::EPSILON;

/// The longest interval at which systems update the processor time of a thread.
const TICK: Duration = Duration::from_millis(10);

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

    /// Whether Newton's method converged quadratically.
    pub fn quadratic(&self) -> bool {
        self.limited as f64 <= (1.0 - QUADRATIC_SHARE) * self.decisive as f64
    }
}

/// The cost of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cost {
    pub tally: Tally,
    /// CPU seconds of its one thread, without the evaluation of forces and errors.
    pub seconds: f64,
    /// The first measured time of each evaluation.
    pub units: Units,
    /// The peak number of bytes, by the plan.
    pub bytes: u64,
}

impl Cost {
    /// The counts times the time of each evaluation, in seconds: independent of other load on the machine.
    pub fn counted(&self, units: &Units) -> f64 {
        let tally = &self.tally;
        units.shapes * tally.steps as f64
            + units.projection * tally.projections as f64
            + units.residual * tally.residuals as f64
            + units.linearization * tally.linearizations as f64
            + units.product * tally.products as f64
    }
}

/// Takes `steps` steps of the nominal length, and shows the simulation to `watch` after each.
pub(super) fn drive<const D: usize>(
    simulation: &mut Simulation<D>,
    steps: u64,
    mut watch: impl FnMut(&Simulation<D>) -> Result<(), StudyError>,
) -> Result<Cost, StudyError> {
    let (units, bytes) = Units::of(simulation)?;
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
    Ok(Cost { tally, seconds, units, bytes })
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

/// Seconds of one evaluation of each kind, at the start of a run.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Units {
    shapes: f64,
    projection: f64,
    residual: f64,
    linearization: f64,
    /// One product with the tangent.
    product: f64,
    /// One product with the tangent for one particle.
    pub product_of_one: f64,
}

impl Units {
    /// The shorter time of each evaluation.
    pub fn least(&self, other: &Self) -> Self {
        Self {
            shapes: self.shapes.min(other.shapes),
            projection: self.projection.min(other.projection),
            residual: self.residual.min(other.residual),
            linearization: self.linearization.min(other.linearization),
            product: self.product.min(other.product),
            product_of_one: self.product_of_one.min(other.product_of_one),
        }
    }

    /// Measures the evaluations, and asks the plan for the peak number of bytes.
    pub fn of<const D: usize>(simulation: &Simulation<D>) -> Result<(Self, u64), StudyError> {
        let simulation = &arranged(simulation.clone())?;
        let prepared = Prepared::new(simulation)?;
        let equilibrium = prepared.equilibrium(simulation);
        let (count, lumping) = (prepared.nodes.len(), simulation.settings.lumping);
        let positions = &simulation.particles.position;
        let mut dphi = vec![Vector::zeros(); count];
        prepared.prescribe(&mut dphi);
        let u: Vec<Vector<f64, D>> = vec![Vector::repeat(1e-3); count];
        let mut out = vec![Vector::zeros(); count];
        let shapes = best(|| Supports::new(&simulation.approximation, &simulation.grid, positions).map(drop));
        let projection = best(|| Nodal::project(&simulation.particles, &prepared.supports, lumping).map(drop));
        let residual = best(|| equilibrium.residual::<f64>(&dphi).map(drop));
        let bytes = Plan::of(simulation)?.bytes();
        let linearization = best(|| equilibrium.tangent(&dphi).map(drop));
        let tangent = equilibrium.tangent(&dphi)?;
        let product = best(|| tangent.product(&u, &mut out));
        let projection = projection / prepared.nodal.iterations.max(1) as f64;
        let product_of_one = product / simulation.particles.len() as f64;
        Ok((Self { shapes, projection, residual, linearization, product, product_of_one }, bytes))
    }
}

/// The shortest of a few runs, in seconds.
fn best<R>(mut run: impl FnMut() -> R) -> f64 {
    (0..4).fold(f64::INFINITY, |best: f64, _| {
        let start = Thread::now();
        black_box(run());
        let wall = start.wall();
        // Every long run is interrupted by other processes, and the processor clock is too coarse for short runs.
        best.min(if wall < TICK { wall.as_secs_f64() } else { start.elapsed() })
    })
}
