//! The parts of the next step of a simulation, for studies that evaluate residual and tangent directly.

use bfree::approximation::ShapeFunction;
use bfree::material::Law;
use bfree::mechanics::loads::PrescribedDof;
use bfree::mechanics::residual::Equilibrium;
use bfree::mechanics::schemes::Alphas;
use bfree::mechanics::sweep::{Fields, Points, Supports};
use bfree::mechanics::transfer::Nodal;
use bfree::nodes::Nodes;
use bfree::pooled::Pool;
use bfree::simulation::{InitialGuess, Simulation, StepError};
use bfree::tensor::Vector;

/// The parts of the equilibrium of the next step.
#[derive(Debug)]
pub struct Prepared<const D: usize> {
    /// Shape functions at x_n.
    pub supports: Supports<D>,
    /// Active nodes.
    pub nodes: Nodes,
    /// Prescribed degrees of freedom.
    pub prescribed: Vec<PrescribedDof>,
    /// Nodal state, prescribed values in place.
    pub nodal: Nodal<D>,
    /// Newmark's parameters of the step.
    pub alphas: Alphas,
    /// t_{n+1}
    pub end: f64,
}

impl<const D: usize> Prepared<D> {
    /// Does the work of a step before Newton's method, for a simulation that resets its grid ([`Simulation::forget`]).
    ///
    /// # Errors
    /// A particle without shape functions, or a projection that overflows.
    pub fn new<L: Law, A: ShapeFunction>(simulation: &Simulation<D, L, A>) -> Result<Self, StepError> {
        let (t, dt) = (simulation.clock.time(), simulation.clock.step());
        let positions = &simulation.particles.position;
        let fields = Fields::of(&simulation.bodies, &simulation.particles.body);
        let points = Points { fields, ..Points::at(positions) };
        let (supports, nodes) =
            Supports::rebuilt(None, &simulation.approximation, &simulation.grid, &points, &Pool::default())?;
        let supports = simulation.aggregated(supports);
        let prescribed = simulation.prescribed(&nodes);
        let nodal = simulation.project(&supports)?.with_prescribed(&prescribed);
        Ok(Self { supports, nodes, prescribed, nodal, alphas: simulation.settings.scheme.end(dt), end: t + dt })
    }

    /// The equilibrium of the step.
    pub fn equilibrium<'a, L: Law, A: ShapeFunction>(
        &'a self,
        simulation: &'a Simulation<D, L, A>,
    ) -> Equilibrium<'a, D, L> {
        simulation.equilibrium(&self.supports, &self.nodal, &self.prescribed, self.alphas, self.end)
    }

    /// The initial guess of the step's Newton method.
    pub fn initial_guess<L: Law, A: ShapeFunction>(&self, simulation: &Simulation<D, L, A>) -> Vec<Vector<f64, D>> {
        let mut dphi = vec![Vector::zeros(); self.nodes.len()];
        if simulation.settings.initial_guess == InitialGuess::Velocity {
            dphi.iter_mut().zip(&self.nodal.velocity).for_each(|(dphi, v)| *dphi = v * simulation.clock.step());
        }
        self.prescribe(&mut dphi);
        dphi
    }

    /// Writes the prescribed increments into Δφ.
    pub fn prescribe(&self, dphi: &mut [Vector<f64, D>]) {
        for dof in &self.prescribed {
            dphi[dof.node][dof.component] = dof.step.increment;
        }
    }
}
