//! A step of Algorithm 1 under a body force that varies in space, or with another solver of its equilibrium: what studies need and
//! scenes do not.

use bfree::approximation::ShapeFunction;
use bfree::material::Law;
use bfree::mechanics::loads::prescribed_dofs;
use bfree::mechanics::residual::{Equilibrium, Inadmissible};
use bfree::mechanics::sweep::Supports;
use bfree::mechanics::transfer::{Nodal, Update};
use bfree::pooled::Pool;
use bfree::simulation::{InitialGuess, Simulation, StepError};
use bfree::solver::{BlockJacobi, NewtonError, NewtonReport, NewtonSettings, newton};
use bfree::tensor::Vector;

/// One step of `simulation` with the force `force(p, t)` per unit mass on the particle that lies at `p` in memory, where it stays, in place of all its loads but the
/// prescribed motion. It mirrors [`Simulation::step`], with one line changed: f_I = Σ_p m b_p(t_{n+1}) N_I.
///
/// # Errors
/// As [`Simulation::step`]; the simulation is then untouched. A particle that leaves the grid is found at the next step.
pub fn step<const D: usize, L: Law, A: ShapeFunction>(
    simulation: &mut Simulation<D, L, A>,
    force: impl Fn(usize, f64) -> Vector<f64, D> + Sync,
) -> Result<NewtonReport, StepError> {
    let solve = |equilibrium: &Equilibrium<'_, D, L>, dphi: &mut [f64], settings: &NewtonSettings| {
        newton(equilibrium, &mut BlockJacobi::<D>::default(), dphi, settings, &Pool::default())
    };
    Ok(step_by(simulation, force, solve)?.newton)
}

/// What a step did.
#[derive(Clone, Debug)]
pub struct Forced {
    /// Newton's iterations and residuals.
    pub newton: NewtonReport,
    /// Iterations of the projection (42), 0 for a lumped mass.
    pub projection_iterations: usize,
}

/// As [`step`], with `solve` in place of [`newton`]: it finds Δφ with R(Δφ) = 0 from the initial guess.
///
/// # Errors
/// As [`step`].
pub fn step_by<const D: usize, L: Law, A: ShapeFunction>(
    simulation: &mut Simulation<D, L, A>,
    force: impl Fn(usize, f64) -> Vector<f64, D> + Sync,
    solve: impl FnOnce(
        &Equilibrium<'_, D, L>,
        &mut [f64],
        &NewtonSettings,
    ) -> Result<NewtonReport, NewtonError<Inadmissible>>,
) -> Result<Forced, StepError> {
    let (t, dt) = (simulation.clock.time(), simulation.clock.step());
    let (particles, settings) = (&simulation.particles, &simulation.settings);
    let alphas = settings.newmark.alphas(dt);

    let (grid, precision) = (&simulation.grid, settings.newton.precision);
    let (supports, nodes) = Supports::with_precision(&simulation.approximation, grid, &particles.position, precision)?;
    let prescribed = prescribed_dofs(&simulation.loads.prescribed, &simulation.grid, &nodes, t, dt);
    let projected = Nodal::project(particles, &supports, nodes.len(), settings.lumping)?;
    let nodal = projected.with_prescribed(&prescribed);

    let forces: Vec<_> = (0..particles.len()).map(|p| force(p, t + dt) * particles.mass[p]).collect();
    let mut dead_load = vec![Vector::zeros(); nodes.len()];
    supports.scatter(&mut dead_load, |p, n, _| forces[p] * n);

    let equilibrium = Equilibrium::new(
        particles,
        &simulation.bodies,
        &supports,
        alphas,
        settings.lumping,
        &nodal,
        dead_load,
        Vec::new(),
        &prescribed,
    );
    let mut dphi: Vec<_> = match settings.initial_guess {
        InitialGuess::Zero => vec![Vector::zeros(); nodes.len()],
        InitialGuess::Velocity => nodal.velocity.iter().map(|v| v * dt).collect(),
    };
    for dof in &prescribed {
        dphi[dof.node][dof.component] = dof.step.increment;
    }
    let newton = solve(&equilibrium, bytemuck::cast_slice_mut(&mut dphi), &settings.newton)?;

    let walls = settings.wall_update;
    let mut update = Update::new(&alphas, &projected, &nodal, &prescribed, walls, &dphi);
    if let Some(smoothing) = &settings.smoothing {
        update.smooth(smoothing, particles, &supports, &nodal.mass, dt);
    }
    update.commit(&mut simulation.particles, &supports);
    simulation.clock.advance();
    Ok(Forced { newton, projection_iterations: projected.iterations })
}
