//! A simulation: the state at the last converged step, and the step that advances this state (`step.rs`).

mod balance;
mod compiled;
mod contacts;
mod entry;
mod first_guess;
mod history;
mod next_step;
mod on_gpu;
mod preconditioner;
mod refinement;
mod report;
mod settings;
mod start;
mod step;
mod sums;
mod touching;
mod work;

pub use crate::mechanics::loads::Reaction;
pub(crate) use compiled::as_type;
pub use history::History;
pub use next_step::NextStep;
pub use report::{AdvanceError, BareParticle, ContactForces, FailedAttempt, StepError, StepReport};
pub use settings::{InitialGuess, Settings};
pub use sums::Sums;
pub use touching::SharedNodes;

use crate::approximation::{Approximation, ShapeFunction};
use crate::clock::Clock;
use crate::grid::Grid;
use crate::material::{Law, Material, NonPositiveJacobian, first_piola};
use crate::mechanics::loads::{Loads, PrescribedDof};
use crate::mechanics::path::Path;
use crate::mechanics::schemes::Alphas;
use crate::mechanics::sweep::{Connectivity, Fields, Points};
use crate::mechanics::symmetry::Unsymmetric;
use crate::mechanics::transfer::Nodal;
use crate::particles::{Body, Particles};
use crate::pooled::Pool;
use crate::solver::Krylov;
use crate::tensor::{Tensor, Vector, identity};

/// An implicit material point simulation in `D` dimensions.
///
/// The fields are the state at the last converged step; [`Simulation::step`] advances it or leaves it untouched.
///
/// ```
/// let falling = "gravity={\"acceleration\": [0, -0.01]}".parse()?;
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[falling])?;
/// let mut simulation = scene.build::<2>("scenes".as_ref())?;
/// let (start, mass) = (simulation.particles.clone(), simulation.particles.mass.iter().sum::<f64>());
/// while simulation.clock.time() < 0.5 {
///     let step = simulation.advance()?;
///     assert!(step.failed.is_empty());
/// }
/// // Free flight: the momentum that weight has given, M g t, and no strain.
/// let given = simulation.particles.momentum() - start.momentum();
/// assert!((given[1] / (-0.01 * mass * simulation.clock.time()) - 1.0).abs() < 1e-10 && given[0].abs() < 1e-12);
/// assert!(simulation.strain_energy() < 1e-20);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Simulation<const D: usize, L = Material, A = Approximation> {
    /// The background grid.
    pub grid: Grid<D>,
    /// The shape functions.
    pub approximation: A,
    /// The bodies.
    pub bodies: Vec<Body<L>>,
    /// The particles.
    pub particles: Particles<D>,
    /// Gravity, surface loads, prescribed motion.
    pub loads: Loads<D>,
    /// Numerical settings of a step.
    pub settings: Settings,
    /// Time and step length.
    pub clock: Clock,
    /// Work of gravity, tractions, pressure, moving walls and moving obstacles since the start.
    pub external_work: f64,
    /// Energy dissipated by damping and by friction since the start.
    pub dissipated: f64,
    /// The point on the equilibrium path, for a scheme that follows one.
    pub path: Path,
    /// The state of the grid, and the contacts, of earlier steps. Code that writes particles, laws or shape functions by hand calls
    /// [`Self::forget`].
    pub history: History<D>,
    /// Memory that the next step reuses. Results do not depend on this memory.
    pub workspace: Workspace<D>,
}

/// Memory that the next step reuses: the shape functions of the last step, and a pool of vectors. The next step overwrites the shape
/// functions, and starts to sort particles from their last order. The workspace is no state: a clone has an empty one, and no checkpoint
/// holds it. A step that fails leaves no shape functions.
#[derive(Debug, Default)]
pub struct Workspace<const D: usize> {
    connectivity: Option<Connectivity<D>>,
    /// Whether the next step uses the shape functions unchanged, because the grid was not reset.
    connectivity_is_valid: bool,
    pool: Pool,
}

impl<const D: usize> Clone for Workspace<D> {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl<const D: usize, L, A> Simulation<D, L, A> {
    /// A simulation at its start, without loads and with [`Settings::default`]. Struct update syntax sets other values, as in the example.
    ///
    /// ```
    /// use bfree::approximation::Bspline;
    /// use bfree::clock::Clock;
    /// use bfree::grid::Grid;
    /// use bfree::material::{Lame, Material, NeoHookean};
    /// use bfree::mechanics::schemes::Statics;
    /// use bfree::particles::{Body, Particles};
    /// use bfree::simulation::{Settings, Simulation};
    /// use bfree::tensor::Vector;
    /// use std::sync::Arc;
    ///
    /// let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [4] };
    /// let law = Material::from(NeoHookean::ciarlet(Lame::new(0.5, 0.25)?));
    /// let mut particles = Particles::default();
    /// particles.push_without_inertia(Vector::from([1.75]), 0.5, 0.5, 0);
    /// let bodies = vec![Body { name: "bar".into(), law, density: 1.0, dilatation: Default::default(), field: 0 }];
    /// let simulation = Simulation {
    ///     settings: Settings { scheme: Arc::new(Statics::default()), ..Settings::default() },
    ///     ..Simulation::new(grid, Bspline::Quadratic, bodies, particles, Clock::new(1.0, 0))
    /// };
    /// assert!(simulation.external_work == 0.0 && simulation.loads.prescribed.is_empty());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn new(grid: Grid<D>, approximation: A, bodies: Vec<Body<L>>, particles: Particles<D>, clock: Clock) -> Self {
        Self {
            grid,
            approximation,
            bodies,
            particles,
            loads: Loads::default(),
            settings: Settings::default(),
            clock,
            external_work: 0.0,
            dissipated: 0.0,
            path: Path::default(),
            history: History::default(),
            workspace: Workspace::default(),
        }
    }

    /// Moves the particle at index `order[i]` to index `i`, in all arrays that refer to particles by index. `order` must be a permutation.
    /// [`Self::step`] calls this function where it saves time. Sums at nodes do not depend on the order. Sums over all particles, such as
    /// energies, depend on it in their last bits.
    ///
    /// ```
    /// let scene = bfree::scene::read_file("scenes/cantilever.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// let loaded = |of: &bfree::simulation::Simulation<2>| {
    ///     let points = of.loads.surface[0].points.iter();
    ///     points.map(|point| of.particles.id[point.particle]).collect::<Vec<_>>()
    /// };
    /// // Last first; the load is on the same particles.
    /// let before = loaded(&simulation);
    /// let order: Vec<u32> = (0..simulation.particles.len() as u32).rev().collect();
    /// simulation.rearrange(&order);
    /// assert_eq!(loaded(&simulation), before);
    /// assert_eq!(simulation.particles.id.last(), Some(&0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn rearrange(&mut self, order: &[u32]) {
        self.rearrange_among(Some(order), self.particles.parts.bounds().to_vec());
    }

    /// Fills in velocity, acceleration, deformation and internal variables of all particles in process 0, until its next step. Otherwise each of
    /// several processes may have those of its own particles alone. All processes make this call before one of them reads these arrays, asks for
    /// energies or fields, or records the step.
    ///
    /// ```
    /// use bfree::parallel::Processes;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &["grid.spacing=0.25".parse()?])?;
    /// let start = scene.build::<2>("scenes".as_ref())?;
    /// let numbers = std::thread::scope(|scope| {
    ///     let run = |processes: Processes| {
    ///         let mut simulation = start.clone();
    ///         scope.spawn(move || {
    ///             simulation.settings.processes = processes;
    ///             simulation.step()?;
    ///             let own = simulation.particles.velocity.len();
    ///             simulation.collect_particles();
    ///             Ok::<_, bfree::simulation::StepError>([own, simulation.particles.velocity.len()])
    ///         })
    ///     };
    ///     let all: Vec<_> = Processes::as_threads(2).into_iter().map(run).collect();
    ///     all.into_iter().map(|one| one.join().map_err(|_| "panicked")).collect::<Result<Result<Vec<_>, _>, _>>()
    /// })??;
    /// let (count, [[first, all], [second, still]]) = (start.particles.len(), [numbers[0], numbers[1]]);
    /// assert!(first + second == count && all == count && still == second);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn collect_particles(&mut self) {
        self.particles.collect(&self.settings.processes);
    }

    /// [`Self::rearrange`], after which each process has the particles between its two `bounds`. Without bounds, every process has all.
    fn rearrange_among(&mut self, order: Option<&[u32]>, bounds: Vec<usize>) {
        if bounds.is_empty() {
            self.particles.join(&self.settings.processes);
        }
        if let Some(order) = order {
            self.rearrange_common(order, bounds.is_empty());
        }
        if !bounds.is_empty() {
            self.particles.share_out(order, bounds, &self.settings.processes);
        }
    }

    /// Rearranges what every process has of all particles; if the particles are `whole`, that is all.
    fn rearrange_common(&mut self, order: &[u32], whole: bool) {
        self.workspace.connectivity = None;
        // Several processes need no array of all particles in a pass, so the pool shall not keep the memory of one.
        let pool = if self.settings.processes.are_several() { &Pool::default() } else { &self.workspace.pool };
        self.particles.rearrange_in(order, pool, whole);
        let last = self.history.equilibrium.iter_mut().map(|last| &mut last.loads);
        let loads = std::iter::once(&mut self.loads).chain(last);
        let mut points = loads.flat_map(Loads::points_mut).peekable();
        if points.peek().is_some() {
            let mut places = vec![0; order.len()];
            order.iter().enumerate().for_each(|(to, &from)| places[from as usize] = to);
            points.for_each(|point| point.particle = places[point.particle]);
        }
    }
}

impl<const D: usize, L: Law, A> Simulation<D, L, A> {
    /// Whether a law has an internal variable of this name.
    pub(crate) fn has_internal_variable(&self, name: &str) -> bool {
        self.bodies.iter().any(|body| body.law.internal_variables().iter().any(|one| one.name == name))
    }

    /// The Cauchy stress σ = P Fᵀ / J with P = F S (eq. 7), in the plane or along the line of the scene, of the particle at `place`.
    pub(crate) fn cauchy_stress(&self, place: usize) -> Result<Tensor<f64, D>, NonPositiveJacobian> {
        let particles = &self.particles;
        let body = &self.bodies[particles.body[place] as usize];
        let at = particles.state(place, 0.0).admissible()?;
        let stress = first_piola(&body.law, &at.f, &at) * at.f.transpose() / at.jacobian;
        let [_, mean] = body.averaged(particles.dilatation(place), at.j);
        Ok(stress + identity::<f64, D>() * mean)
    }

    /// Whether the stress in the balance of forces is the mean stress of the step.
    pub(crate) fn has_mean_stress(&self) -> bool {
        self.settings.scheme.balance(self.clock.step()).discrete_gradient
    }

    /// The method that solves the linear systems, and the reason for the choice.
    ///
    /// ```
    /// use bfree::solver::Krylov;
    ///
    /// let mut simulation = bfree::scene::read_file("scenes/cantilever.json".as_ref(), &[])?.build::<2>("scenes".as_ref())?;
    /// assert_eq!(simulation.krylov(), (Krylov::ConjugateGradient, "the tangent is symmetric"));
    /// simulation.settings.newton.krylov = Krylov::Gmres { restart: 50 };
    /// assert_eq!(simulation.krylov(), (Krylov::Gmres { restart: 50 }, "it was asked for"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn krylov(&self) -> (Krylov, &'static str) {
        let unsymmetric = Unsymmetric {
            path: self.settings.scheme.follows_path(),
            mean_stress: self.has_mean_stress(),
            mixed: self.is_mixed(),
            ..Unsymmetric::of(&self.bodies, &self.loads)
        };
        let unsymmetric = unsymmetric.reason();
        let asked = self.settings.newton.krylov;
        let why = match asked {
            Krylov::Automatic => unsymmetric.unwrap_or("the tangent is symmetric"),
            Krylov::Gmres { .. } | Krylov::ConjugateGradient => "it was asked for",
        };
        (asked.chosen(unsymmetric.is_none()), why)
    }
}

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// The simulation with other laws, one for each body. Internal variables take their values at rest.
    ///
    /// ```
    /// use bfree::material::{Energy, FromEnergy};
    /// use bfree::scalar::Real;
    /// use bfree::tensor::{Tensor, contract, trace};
    ///
    /// /// St. Venant and Kirchhoff's solid with the constants of the scene, by its energy alone.
    /// struct Quadratic;
    ///
    /// impl Energy for Quadratic {
    ///     fn energy<T: Real>(&self, e: &Tensor<T, 3>) -> T {
    ///         T::lit(75.0) * trace(e) * trace(e) + T::lit(30.0) * contract(e, e)
    ///     }
    /// }
    ///
    /// let law = "bodies.0.material={\"st_venant_kirchhoff\": {\"bulk\": 170, \"shear\": 30}}".parse()?;
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[law])?;
    /// let mut shipped = scene.build::<2>("scenes".as_ref())?;
    /// shipped.particles.displacement_gradient.fill(Tensor::<f64, 2>::new(0.1, 0.05, 0.0, -0.1));
    /// let mine = shipped.clone().with_laws(|_| FromEnergy(Quadratic));
    /// assert!((mine.strain_energy() / shipped.strain_energy() - 1.0).abs() < 1e-14);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn with_laws<M: Law>(self, law: impl Fn(&Body<L>) -> M) -> Simulation<D, M, A> {
        let with_law = |body: &Body<L>| {
            let Body { name, law: _, density, dilatation, field } = body;
            Body { name: name.clone(), law: law(body), density: *density, dilatation: *dilatation, field: *field }
        };
        let bodies: Vec<_> = self.bodies.iter().map(with_law).collect();
        let mut particles = self.particles;
        particles.set_internal_to_rest(&bodies);
        Simulation {
            loads: self.loads,
            settings: self.settings,
            external_work: self.external_work,
            dissipated: self.dissipated,
            path: self.path,
            // The new laws need not balance the loads of the last equilibrium.
            history: History { equilibrium: None, ..self.history },
            ..Simulation::new(self.grid, self.approximation, bodies, particles, self.clock)
        }
    }

    /// Gives `velocity(x_I)` to the nodes and interpolates it once to the particles, v_p = Σ N v_I (section 4.1).
    ///
    /// ```
    /// use bfree::tensor::Vector;
    ///
    /// // A linear field reaches the particles as it is; of a jump they get what the nodes can carry.
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// let rotation = |x: &Vector<f64, 2>| Vector::from([-(x[1] - 2.5), x[0] - 2.5]);
    /// simulation.set_velocity_on_nodes(rotation)?;
    /// let particles = &simulation.particles;
    /// assert!(particles.position.iter().zip(&particles.velocity).all(|(x, v)| (v - rotation(x)).norm() < 1e-12));
    /// simulation.set_velocity_on_nodes(|x| Vector::from([if x[0] < 2.5 { 1.0 } else { 0.0 }, 0.0]))?;
    /// assert!(simulation.particles.velocity.iter().any(|v| v[0] > 0.1 && v[0] < 0.9));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// A particle without shape functions.
    pub fn set_velocity_on_nodes(
        &mut self,
        velocity: impl Fn(&Vector<f64, D>) -> Vector<f64, D>,
    ) -> Result<(), StepError> {
        let points =
            Points { fields: Fields::of(&self.bodies, &self.particles.body), ..Points::at(&self.particles.position) };
        let (connectivity, nodes) =
            Connectivity::rebuilt(None, &self.approximation, &self.grid, &points, &Pool::default())?;
        let nodal: Vec<_> = nodes.positions(&self.grid).map(|(_, x)| velocity(&x)).collect();
        self.particles.velocity = connectivity.values(&nodal).to_vec();
        Ok(())
    }

    /// Sets the initial acceleration of the particles from loads and damping. At the nodes, the acceleration is a₀ = (f_ext − f_int − C
    /// v₀)/m_I, and g̈ where the motion is prescribed. Without this acceleration, loads and damping act half a step late.
    ///
    /// The lumped mass is used for every ε. The acceleration is exact for uniform loads, and of second order in h for others.
    ///
    /// Without inertia, this function does nothing.
    ///
    /// ```
    /// use bfree::mechanics::loads::{Curve, Gravity};
    /// use bfree::tensor::Vector;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// let g = Vector::from([0.0, -10.0]);
    /// simulation.loads.gravity = Some(Gravity { acceleration: g, curve: Curve::constant(1.0) });
    /// simulation.set_initial_acceleration()?;
    /// assert!(simulation.particles.acceleration.iter().all(|a| (a - g).norm() < 1e-13));
    /// // So the first step already falls by ½ g Δt², and not by half of it.
    /// let before = simulation.particles.by_id();
    /// let dt = simulation.clock.step();
    /// simulation.step()?;
    /// let fallen = simulation.particles.by_id().position[0] - before.position[0] - before.velocity[0] * dt;
    /// assert!((fallen - g * (0.5 * dt * dt)).norm() < 1e-9);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// A particle without shape functions, or with det F ≤ 0, or, with damping, velocities so large that their projection overflows.
    pub fn set_initial_acceleration(&mut self) -> Result<(), StepError> {
        if !self.settings.scheme.has_inertia() {
            return Ok(());
        }
        let connectivity = self.new_connectivity(None)?;
        let prescribed = self.prescribed(connectivity.active());
        let space = connectivity.space(prescribed.iter().map(PrescribedDof::place));
        let mut nodal = Nodal::at_rest(&self.particles, &connectivity);
        if self.loads.damping.is_some() {
            nodal.velocity = self.project(&connectivity)?.with_prescribed(&prescribed).extended(&space).velocity;
        }
        // Δφ = 0 and a_n = 0, so the inertia force is zero; damping acts on v_n.
        let equilibrium = self.equilibrium(&connectivity, &nodal, &prescribed, Alphas::START, self.clock.time());
        let unbalanced = equilibrium.residual::<f64>(&nodal.acceleration)?;
        nodal.accelerate(&self.particles, &connectivity, &unbalanced);
        let nodal = nodal.with_prescribed(&prescribed).extended(&space);
        self.particles.acceleration = connectivity.values(&nodal.acceleration).to_vec();
        Ok(())
    }
}
