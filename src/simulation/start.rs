//! The start of a step: shape functions, prescribed motion, nodal state, and the equilibrium problem.

use super::{Simulation, StepError};
use crate::approximation::{AtSurface, Separable, ShapeFunction};
use crate::material::Law;
use crate::mechanics::extension::extension;
use crate::mechanics::loads::{PrescribedDof, at_surface_points, prescribed_dofs};
use crate::mechanics::residual::Equilibrium;
use crate::mechanics::schemes::Alphas;
use crate::mechanics::sweep::{Connectivity, Fields, Points, ShapeFunctionError};
use crate::mechanics::terms;
use crate::mechanics::transfer::{Nodal, Projection};
use crate::particles::Body;
use crate::solver::LinearError;
use crate::space::Nodes;

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// The shape functions of a step; those of the last step if the grid is not reset. The particles then lie in the order of the blocks.
    pub(super) fn connectivity(&mut self) -> Result<Connectivity<D>, ShapeFunctionError> {
        let resets = self.history.resets_grid();
        match self.workspace.connectivity.take() {
            Some(connectivity) if !resets && self.workspace.connectivity_is_valid => {
                self.particles.keep_own(connectivity.processes());
                Ok(connectivity.with_no_pass().with_gpu(self.settings.gpu.clone()))
            }
            spare => {
                let mut connectivity = self.unaggregated(spare)?;
                let bounds = if self.needs_all_particles() { Vec::new() } else { connectivity.bounds() };
                let order = connectivity.block_order();
                self.rearrange_among(order.as_deref(), bounds);
                if order.is_some() {
                    connectivity.rearrange();
                }
                // Sums over particles are made in the order of the blocks, as after a restart.
                Ok(self.aggregated(connectivity))
            }
        }
    }

    /// Whether every process needs v, a, H and the internal variables of all particles: points of surfaces meet bodies of other processes, and
    /// the means of cells, smoothing and affine fits are computed in every process.
    pub(crate) fn needs_all_particles(&self) -> bool {
        let Self { loads, bodies, settings, .. } = self;
        let has_points = loads.surface.iter().any(|load| !load.points.is_empty()) || !loads.contacts.points.is_empty();
        let averages = bodies.iter().any(Body::averages);
        has_points || averages || settings.smoothing.is_some() || settings.projection == Projection::Affine
    }

    /// The shape functions in the reference configuration, in the memory of `spare`, which is no longer needed.
    pub(crate) fn new_connectivity(
        &self,
        spare: Option<Connectivity<D>>,
    ) -> Result<Connectivity<D>, ShapeFunctionError> {
        Ok(self.aggregated(self.unaggregated(spare)?))
    }

    /// [`Self::new_connectivity`] where every node is an unknown.
    fn unaggregated(&self, spare: Option<Connectivity<D>>) -> Result<Connectivity<D>, ShapeFunctionError> {
        let Self { particles, bodies, loads, approximation, grid, settings, workspace, .. } = self;
        let fields = Fields::of(bodies, &particles.body);
        let processes = settings.processes.clone();
        let mut points =
            Points { ids: Some(&particles.id), fields, processes, ..Points::at(particles.reference().position) };
        if settings.aggregation {
            let at_surface = approximation.separable().map_or(AtSurface::Own, Separable::at_surface);
            points = at_surface_points(points, particles, loads, grid, at_surface);
        }
        let (connectivity, _) = Connectivity::rebuilt(spare, approximation, grid, &points, &workspace.pool)?;
        Ok(connectivity.with_gpu(settings.gpu.clone()))
    }

    /// The shape functions with [`aggregation`](crate::aggregation), if the settings ask for it: nodes with little support from a body then
    /// follow other nodes.
    fn aggregated(&self, connectivity: Connectivity<D>) -> Connectivity<D> {
        if !self.settings.aggregation {
            return connectivity;
        }
        let extension = extension(self.approximation.pieces(), &self.particles, &connectivity);
        connectivity.with_extension(extension)
    }

    /// The degrees of freedom prescribed in the next step.
    ///
    /// ```
    /// use bfree::mechanics::sweep::Connectivity;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// let held = |of: &bfree::simulation::Simulation<2>| -> Result<_, Box<dyn std::error::Error>> {
    ///     let (_, nodes) = Connectivity::new(&of.approximation, &of.grid, &of.particles.position)?;
    ///     Ok(of.prescribed(&nodes))
    /// };
    /// // Only active nodes count: near the right wall, the disc sees nodes of it, and they may slide but not leave.
    /// let before = held(&simulation)?.len();
    /// simulation.particles.position.iter_mut().for_each(|x| x[0] += 11.0);
    /// let at_wall = held(&simulation)?;
    /// assert!(at_wall.len() > before);
    /// assert!(at_wall.iter().any(|dof| dof.component == 0 && dof.step.increment == 0.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn prescribed(&self, nodes: &Nodes) -> Vec<PrescribedDof> {
        let moved = self.history.grid.as_ref().map_or(&[][..], |grid| &grid.motion);
        prescribed_dofs(&self.loads.prescribed, &self.grid, nodes, moved, self.clock.time(), self.clock.step())
    }

    /// The nodal state at t_n: projected from the particles after a grid reset, otherwise that of the last step.
    pub(super) fn nodal(
        &self,
        connectivity: &Connectivity<D>,
        prescribed: &[PrescribedDof],
    ) -> Result<Nodal<D>, StepError> {
        let nodes = connectivity.nodes();
        match &self.history.grid {
            None => {
                let nodal = self.project(connectivity)?;
                Ok(Nodal { out_of_balance: self.out_of_balance(connectivity, &nodal, prescribed)?, ..nodal })
            }
            Some(grid) if grid.motion.len() == nodes => {
                Ok(Nodal { mass: self.masses(connectivity).mass, ..grid.clone() })
            }
            Some(grid) => Err(StepError::OtherGrid { stored: grid.motion.len(), nodes }),
        }
    }

    /// The nodal state, projected from the particles. Without inertia it holds at most the mass, and that for gravity alone.
    ///
    /// # Errors
    /// Particle velocities so large that the projection overflows.
    pub(crate) fn project(&self, connectivity: &Connectivity<D>) -> Result<Nodal<D>, LinearError> {
        if self.settings.scheme.has_inertia() {
            return match self.settings.projection {
                Projection::Mass => Nodal::project(&self.particles, connectivity, self.settings.lumping),
                Projection::Affine => Ok(Nodal::fit(&self.particles, connectivity)),
            };
        }
        Ok(self.masses(connectivity))
    }

    /// The nodal mass, if inertia or gravity needs it.
    pub(super) fn masses(&self, connectivity: &Connectivity<D>) -> Nodal<D> {
        let weighs = self.settings.scheme.has_inertia() || self.loads.gravity.is_some();
        if weighs { Nodal::mass_alone(&self.particles, connectivity) } else { Nodal::default() }
    }

    /// The equilibrium problem at time `t`, with given shape functions in the
    /// [reference configuration](crate::mechanics::reference).
    ///
    /// ```
    /// use bfree::mechanics::{sweep::Connectivity, transfer::Nodal};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, grid, dt) = (&simulation.particles, &simulation.grid, simulation.clock.step());
    /// let (connectivity, _) = Connectivity::new(&simulation.approximation, grid, &particles.position)?;
    /// let nodal = Nodal::project(particles, &connectivity, simulation.settings.lumping)?;
    /// let alphas = simulation.settings.scheme.end(dt);
    /// let equilibrium = simulation.equilibrium(&connectivity, &nodal, &[], alphas, dt);
    /// // A body in free flight is in equilibrium at Δφ = Δt v.
    /// let dphi: Vec<_> = nodal.velocity.iter().map(|v| v * dt).collect();
    /// let residual = equilibrium.residual(&dphi)?;
    /// assert!(residual.iter().map(|r| r.norm_squared()).sum::<f64>().sqrt() < 1e-13 * equilibrium.magnitude(&dphi)?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn equilibrium<'a>(
        &'a self,
        connectivity: &'a Connectivity<D>,
        nodal: &'a Nodal<D>,
        prescribed: &'a [PrescribedDof],
        alphas: Alphas,
        t: f64,
    ) -> Equilibrium<'a, D, L> {
        let Self { particles, bodies, loads, settings, .. } = self;
        // Without inertia there is no consistent mass.
        let lumping = if nodal.is_static() { 1.0 } else { settings.lumping };
        // At t_n, too, laws need the length of a step.
        let dt = if alphas.dt > 0.0 { alphas.dt } else { self.clock.step() };
        Equilibrium::new(
            terms::Step { particles, bodies, loads, connectivity, nodal, alphas, lumping, time: t, dt, poses: None },
            prescribed,
        )
    }
}
