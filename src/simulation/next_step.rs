//! The problem of the next step, for inspection: its equilibrium, shape functions, nodal state and prescribed motion.

use super::{Simulation, StepError, Workspace};
use crate::approximation::{Approximation, ShapeFunction};
use crate::material::{Law, Material};
use crate::mechanics::loads::PrescribedDof;
use crate::mechanics::residual::Equilibrium;
use crate::mechanics::schemes::Alphas;
use crate::mechanics::sweep::Connectivity;
use crate::mechanics::transfer::Nodal;
use crate::space::Nodes;
use crate::tensor::Vector;

/// The problem of the next step, built on a copy of the simulation.
///
/// ```
/// use bfree::tensor::Vector;
///
/// // Of a body in free flight the first step is solved by Δφ = Δt v.
/// let simulation = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?.build::<2>("scenes".as_ref())?;
/// let coming = simulation.next_step()?;
/// let dphi = vec![Vector::from([0.5, 0.0]) * simulation.clock.step(); coming.nodes().len()];
/// let (equilibrium, phi) = (coming.equilibrium(), coming.motion(&dphi));
/// let residual = equilibrium.residual(&phi)?;
/// assert!(residual.iter().map(|r| r.norm_squared()).sum::<f64>().sqrt() < 1e-13 * equilibrium.magnitude(&phi)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct NextStep<const D: usize, L = Material, A = Approximation> {
    /// A copy of the simulation.
    simulation: Simulation<D, L, A>,
    connectivity: Connectivity<D>,
    nodal: Nodal<D>,
    prescribed: Vec<PrescribedDof>,
    /// The coefficients of the time integrator.
    alphas: Alphas,
}

impl<const D: usize, L: Law + Clone, A: ShapeFunction + Clone> Simulation<D, L, A> {
    /// The problem of the next step, with the present step length of the clock.
    ///
    /// Example: [`NextStep`].
    ///
    /// # Errors
    /// A particle without shape functions, or velocities so large that their projection overflows.
    pub fn next_step(&self) -> Result<NextStep<D, L, A>, StepError> {
        let mut simulation = Self { workspace: Workspace::default(), ..self.clone() };
        simulation.particles.make_room_for_internal(&simulation.bodies);
        let connectivity = simulation.new_connectivity(None)?;
        simulation.find_candidates(&connectivity);
        let prescribed = self.prescribed(connectivity.active());
        let nodal = simulation.nodal(&connectivity, &prescribed)?.with_prescribed(&prescribed);
        let nodal = nodal.extended(&connectivity.space(prescribed.iter().map(PrescribedDof::place)));
        let alphas = simulation.settings.scheme.balance(simulation.clock.step());
        Ok(NextStep { simulation, connectivity, nodal, prescribed, alphas })
    }
}

impl<const D: usize, L: Law, A: ShapeFunction> NextStep<D, L, A> {
    /// The active nodes.
    pub fn nodes(&self) -> &Nodes {
        self.connectivity.active()
    }

    /// The positions of the active nodes.
    pub fn positions(&self) -> impl Iterator<Item = Vector<f64, D>> {
        self.nodes().positions(&self.simulation.grid).map(|(_, x)| x)
    }

    /// The prescribed degrees of freedom, with the increments of the whole step.
    pub fn prescribed(&self) -> &[PrescribedDof] {
        &self.prescribed
    }

    /// The state at the nodes, with prescribed values.
    pub fn nodal(&self) -> &Nodal<D> {
        &self.nodal
    }

    /// The shape functions.
    pub fn connectivity(&self) -> &Connectivity<D> {
        &self.connectivity
    }

    /// The same problem with other coefficients of the time integrator.
    pub fn with_alphas(self, alphas: Alphas) -> Self {
        Self { alphas, ..self }
    }

    /// The same problem with another implementation of the same shape functions, such as [`Connectivity::plain`].
    pub fn with_connectivity(self, connectivity: Connectivity<D>) -> Self {
        Self { connectivity, ..self }
    }

    /// The Δφ that Newton's method starts from.
    pub fn initial_guess(&self) -> Vec<Vector<f64, D>> {
        let mut dphi =
            self.simulation.initial_guess(&self.connectivity, &self.nodal, self.simulation.clock.step()).to_vec();
        self.prescribe(&mut dphi);
        dphi
    }

    /// Writes the prescribed increments of the whole step into Δφ.
    pub fn prescribe(&self, dphi: &mut [Vector<f64, D>]) {
        for dof in &self.prescribed {
            dphi[dof.node][dof.component] = dof.step.increment;
        }
    }

    /// The nodal motion φ since the last grid reset, for an increment Δφ since t_n.
    pub fn motion(&self, dphi: &[Vector<f64, D>]) -> Vec<Vector<f64, D>> {
        dphi.iter().enumerate().map(|(node, dphi)| dphi + self.nodal.moved(node)).collect()
    }

    /// The equilibrium, as a function of φ, at the instant of force balance: the end of the step, except in generalised-α.
    pub fn equilibrium(&self) -> Equilibrium<'_, D, L> {
        let Self { simulation, connectivity, nodal, prescribed, alphas } = self;
        simulation.equilibrium(connectivity, nodal, prescribed, *alphas, simulation.load_of_balance())
    }

    /// The instant of force balance, as a fraction θ of the step.
    pub fn instant(&self) -> f64 {
        self.simulation.settings.scheme.instant()
    }
}
