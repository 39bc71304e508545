//! The step on one page: the paper's Algorithm 1.

use crate::approximation::{Approximation, ShapeFunction, Shipped};
use crate::causes;
use crate::clock::Clock;
use crate::grid::Grid;
use crate::material::{Law, Material, p_wave_modulus};
use crate::mechanics::check::{CheckError, direction};
use crate::mechanics::kept::{Kept, Renewal};
use crate::mechanics::loads::{Loads, PrescribedDof, prescribed_dofs};
use crate::mechanics::path::{OnPath, Path};
use crate::mechanics::residual::{Equilibrium, Inadmissible, unsymmetric};
use crate::mechanics::rigid::{Loose, loose};
use crate::mechanics::schemes::{Alphas, LONG_STEPS, Newmark, Scheme};
use crate::mechanics::smoothing::Smoothing;
use crate::mechanics::sweep::{SupportError, Supports};
use crate::mechanics::terms::{self, Role};
use crate::mechanics::transfer::{Nodal, Update, WallUpdate};
use crate::nodes::Nodes;
use crate::particles::{Body, Particles};
use crate::phases::{Phase, Stopwatch};
use crate::pooled::{Pool, Pooled};
use crate::solver::{
    Krylov, LinearError, NewtonError, NewtonHistory, NewtonReport, NewtonSettings, Preconditioning, newton,
};
use crate::tensor::{Deformation, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::num::NonZeroU64;
use std::sync::Arc;

/// Where Newton's iteration of a step starts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InitialGuess {
    /// Δφ = 0, as in the paper's tables.
    #[default]
    Zero,
    /// Δφ = Δt v.
    Velocity,
    /// Δφ goes on as in the last step, where the grid is kept; Δφ = 0 where it is new.
    LastStep,
}

/// A step grows only if its error is at most this part of the tolerance: one of twice the length has eight times the error.
const ROOM: f64 = 0.1;

/// How a step is taken.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The time scheme. If it has no inertia, neither lumping nor walls in the update, smoothing or any velocity means anything, and none of
    /// them is looked at.
    pub scheme: Arc<dyn Scheme>,
    /// ε of M̃ = (1−ε) M + ε lumped(M), in [0, 1].
    pub lumping: f64,
    /// γ of the ghost stiffness, as a share of Λ + 2G; 0 for none. It holds nodes that have little of a body: without inertia nothing else
    /// does, and with smooth shape functions the answer needs it.
    pub ghost: f64,
    /// When the grid is made anew.
    pub renewal: Renewal,
    /// Where Newton starts.
    pub initial_guess: InitialGuess,
    /// What resting walls do to particle velocities.
    pub wall_update: WallUpdate,
    /// What is taken from the particles beside the increments of eqs. 50 and 51; nothing in the paper.
    pub smoothing: Option<Smoothing>,
    /// Newton and Krylov.
    pub newton: NewtonSettings,
    /// What preconditions its linear systems, made anew each step.
    pub preconditioner: Preconditioning,
    /// The most a step may err, see [`Update::local_error`], in units of the grid spacing: a longer one is taken back and halved, as
    /// often as the clock allows, and it grows back only when its error is small. `None` for steps as given, and without inertia.
    pub error_tolerance: Option<f64>,
    /// Compare the tangent with dual numbers at the end of every so many steps.
    pub check_tangent: Option<NonZeroU64>,
}

impl Default for Settings {
    /// The trapezoidal rule with a lumped mass, Newton from Δφ = 0, walls as in the paper.
    fn default() -> Self {
        Self {
            scheme: Arc::new(Newmark::default()),
            lumping: 1.0,
            ghost: 0.0,
            renewal: Renewal::default(),
            initial_guess: InitialGuess::default(),
            wall_update: WallUpdate::default(),
            smoothing: None,
            newton: NewtonSettings::default(),
            preconditioner: Preconditioning::default(),
            error_tolerance: None,
            check_tangent: None,
        }
    }
}

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
    /// How a step is taken.
    pub settings: Settings,
    /// Where in time.
    pub clock: Clock,
    /// Work of gravity, tractions, pressure and moving walls since the start.
    pub external_work: f64,
    /// Energy that damping and ghost stiffness have taken since the start.
    pub dissipated: f64,
    /// Where on its path it is, for a scheme that follows one.
    pub path: Path,
    /// The grid that is kept, if it is: a step then goes on from there, and not from the places and deformations that are written into the
    /// particles by hand. Put `None` here first.
    pub kept: Option<Kept<D>>,
    /// What the next step uses again; nothing depends on it.
    pub workspace: Workspace<D>,
}

/// The shape functions of the last step, in whose memory the next one makes its own, and from whose order of particles it starts to
/// sort, and memory for its vectors. They are no state: a clone has none, no checkpoint holds them, and a step that fails leaves no shape
/// functions.
#[derive(Debug, Default)]
pub struct Workspace<const D: usize> {
    supports: Option<Supports<D>>,
    /// Whether they serve again as they are: those of a grid that is kept.
    serves: bool,
    pool: Pool,
}

impl<const D: usize> Clone for Workspace<D> {
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// What a step did.
#[derive(Clone, Debug)]
pub struct StepReport<const D: usize> {
    /// Its length.
    pub dt: f64,
    /// Active nodes.
    pub active_nodes: usize,
    /// Newton's iterations and residuals.
    pub newton: NewtonReport,
    /// Iterations of the projection (42), 0 for a lumped mass.
    pub projection_iterations: usize,
    /// Force of each of [`Loads::prescribed`] on the bodies: the reaction at t_{n+1}, and spread over the step the impulse
    /// with which a wall takes along nodes that do not move with it yet.
    pub reactions: Vec<Vector<f64, D>>,
    /// Its local error in units of the grid spacing, where a tolerance asks for it; above the tolerance only if it could not be halved.
    pub error: Option<f64>,
    /// Whether the grid was new.
    pub renewed: bool,
    /// Seconds, and passes over the particles, by phase.
    pub seconds: Stopwatch,
    /// The attempts before it, each of which failed or was too long, and was repeated with half of its length.
    pub failed: Vec<FailedAttempt>,
}

/// An attempt at a step that failed.
#[derive(Clone, Debug)]
pub struct FailedAttempt {
    /// Its length.
    pub dt: f64,
    /// Whether all that was wrong is its error.
    pub inaccurate: bool,
    /// Why it failed, on one line.
    pub why: String,
    /// Iterations of the projection (42).
    pub projection_iterations: usize,
    /// What Newton's method did; empty if it was not reached.
    pub newton: NewtonHistory,
    /// Seconds, by phase.
    pub seconds: Stopwatch,
}

/// What an attempt has spent so far.
struct Spent {
    watch: Stopwatch,
    projection_iterations: usize,
}

impl Spent {
    fn nothing() -> Self {
        Self { watch: Stopwatch::start(), projection_iterations: 0 }
    }
}

impl FailedAttempt {
    fn new(dt: f64, mut spent: Spent, error: &StepError) -> Self {
        spent.watch.give_up();
        let newton = match error {
            StepError::Newton(source) | StepError::Loose { source, .. } => (*source.history).clone(),
            StepError::Inaccurate { newton, .. } => (**newton).clone(),
            _ => NewtonHistory::default(),
        };
        let inaccurate = matches!(error, StepError::Inaccurate { .. });
        let Spent { watch: seconds, projection_iterations } = spent;
        Self { dt, inaccurate, why: causes::on_one_line(error), projection_iterations, newton, seconds }
    }
}

/// Why a step failed. The particles are untouched.
#[derive(Debug, thiserror::Error)]
pub enum StepError {
    /// Shape functions could not be evaluated.
    #[error("the shape functions cannot be evaluated")]
    Support(#[from] SupportError),
    /// Velocities so large that their projection overflows.
    #[error("the projection to the nodes failed")]
    Projection(#[from] LinearError),
    /// Newton found no equilibrium.
    #[error("no equilibrium was found")]
    Newton(#[from] NewtonError<Inadmissible>),
    /// What was kept is not of these particles and functions.
    #[error(
        "the grid that was kept has {kept} nodes, and the particles have {nodes}: after a change by hand, put None into \
         Simulation::kept"
    )]
    OtherGrid {
        /// Nodes that have moved.
        kept: usize,
        /// Active nodes.
        nodes: usize,
    },
    /// A path of equilibria, along which loads no longer change.
    #[error(
        "the path ends at load = {load}: no load changes there; give the curves of the loads points on both sides of it"
    )]
    PathEnds {
        /// λ
        load: f64,
    },
    /// Without inertia, bodies are pushed where nothing holds them.
    #[error(
        "{loose}: without inertia there is no equilibrium; hold them with a boundary condition, or give the scene inertia"
    )]
    Loose {
        /// Which bodies, and where.
        loose: Loose,
        /// What Newton's method says.
        source: NewtonError<Inadmissible>,
    },
    /// The step is too long for the tolerance, and can be halved.
    #[error("the local error is {error:.2e} grid spacings; {tolerance:.2e} are allowed")]
    Inaccurate {
        /// The error.
        error: f64,
        /// The most allowed.
        tolerance: f64,
        /// What Newton's method did.
        newton: Box<NewtonHistory>,
    },
    /// The state at the start of the step is impossible.
    #[error(transparent)]
    Inadmissible(#[from] Inadmissible),
    /// The tangent is not the derivative of the residual.
    #[error("the check of the tangent failed")]
    Tangent(#[from] CheckError),
    /// A particle would leave the grid.
    #[error(
        "particle {particle} leaves the grid at {position:?}; enlarge the grid or hold the body with a boundary condition"
    )]
    LeftGrid {
        /// Id of the particle.
        particle: usize,
        /// Where it would be.
        position: Vec<f64>,
    },
}

/// The simulation cannot go on. The particles are as after the last good step.
#[derive(Debug, thiserror::Error)]
#[error("the step from t = {time} failed, the last time with dt = {dt:e} (attempts: {})", failed.len())]
pub struct AdvanceError {
    /// t_n
    pub time: f64,
    /// Δt of the last attempt.
    pub dt: f64,
    /// Why the last attempt failed.
    #[source]
    pub cause: Box<StepError>,
    /// All attempts, the last one included.
    pub failed: Vec<FailedAttempt>,
}

impl<const D: usize, L, A> Simulation<D, L, A> {
    /// Bodies at their start, with no loads and [`Settings::default`]: what is to be otherwise is written beside it.
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
    /// let bodies = vec![Body { name: "bar".into(), law, density: 1.0 }];
    /// let simulation = Simulation {
    ///     settings: Settings { scheme: Arc::new(Statics), ..Settings::default() },
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
            kept: None,
            workspace: Workspace::default(),
        }
    }

    /// Puts the particle that lies at `order[i]` in memory to the place `i`, wherever places are known; `order` must be a permutation.
    /// [`Self::step`] does it where it saves time. Sums over nodes do not depend on it, sums over all particles, such as energies, in their
    /// last bits.
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
        self.workspace.supports = None;
        self.particles.rearrange(order);
        self.kept.iter_mut().for_each(|kept| kept.rearrange(order));
        let mut points = self.loads.surface.iter_mut().flat_map(|load| &mut load.points).peekable();
        if points.peek().is_some() {
            let mut places = vec![0; order.len()];
            order.iter().enumerate().for_each(|(to, &from)| places[from as usize] = to);
            points.for_each(|point| point.particle = places[point.particle]);
        }
    }
}

impl<const D: usize, L: Law, A> Simulation<D, L, A> {
    /// Whether something takes energy on purpose: damping, or ghost stiffness.
    pub(crate) fn dissipates(&self) -> bool {
        self.loads.damping.is_some() || self.settings.ghost > 0.0
    }

    /// The method that solves the linear systems, and why it does.
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
        let mut unsymmetric = unsymmetric(&self.bodies, &self.loads);
        if self.settings.scheme.follows_path() {
            unsymmetric = Some("on a path of equilibria, the load is unknown too");
        }
        let asked = self.settings.newton.krylov;
        let why = match asked {
            Krylov::Automatic => unsymmetric.unwrap_or("the tangent is symmetric"),
            Krylov::Gmres { .. } | Krylov::ConjugateGradient => "it was asked for",
        };
        (asked.chosen(unsymmetric.is_none()), why)
    }
}

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// The preconditioner of the linear systems, and why it is.
    ///
    /// ```
    /// use bfree::solver::Preconditioning;
    ///
    /// let simulation = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?.build::<2>("scenes".as_ref())?;
    /// assert_eq!(simulation.preconditioner(), (Preconditioning::BlockJacobi, "inertia dominates"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn preconditioner(&self) -> (Preconditioning, &'static str) {
        let across = self.clock.nominal() / self.grid.spacing;
        let courant = |body: &Body<L>| (p_wave_modulus(&body.law) / body.density).sqrt() * across;
        let long = !self.settings.scheme.has_inertia() || self.bodies.iter().any(|body| courant(body) > LONG_STEPS);
        let shipped = self.approximation.separable().and_then(|functions| functions.shipped());
        let splines = matches!(shipped, Some(Shipped::Bspline(_)));
        let on_path = self.settings.scheme.follows_path();
        self.settings.preconditioner.chosen::<D>(self.particles.len(), splines, long, on_path)
    }

    /// One step of Algorithm 1, from t_n to t_{n+1} = t_n + Δt.
    ///
    /// ```
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// simulation.particles.velocity.iter_mut().for_each(|v| *v *= 1e4);
    /// let before = simulation.particles.clone();
    /// // A step that would carry particles out of the box fails, and leaves the state as it was.
    /// let error = simulation.step().err().ok_or("out of the box")?;
    /// assert!(error.to_string().contains("leaves the grid"), "{error}");
    /// assert_eq!((simulation.particles, simulation.clock.steps()), (before, 0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// No equilibrium found, or a particle would leave the grid; the simulation is then as before the call.
    pub fn step(&mut self) -> Result<StepReport<D>, StepError> {
        self.attempt(&mut Spent::nothing())
    }

    /// As [`Self::step`]; a step that fails leaves what it has spent.
    fn attempt(&mut self, spent: &mut Spent) -> Result<StepReport<D>, StepError> {
        // Over a grid that is kept, a step starts where that was new.
        let mut kept = self.kept.take();
        kept.iter_mut().for_each(|kept| kept.exchange(&mut self.particles));
        let report = self.attempt_from(&mut kept, spent);
        if report.is_err() {
            kept.iter_mut().for_each(|kept| kept.exchange(&mut self.particles));
            self.kept = kept;
        }
        report
    }

    fn attempt_from(&mut self, kept: &mut Option<Kept<D>>, spent: &mut Spent) -> Result<StepReport<D>, StepError> {
        self.particles.remember(&self.bodies);
        let (t, dt) = (self.clock.time(), self.clock.step());
        let scheme = self.settings.scheme.clone();
        let watch = &mut spent.watch;

        let pool = self.workspace.pool.clone();
        let supports = self.supports(kept.is_some())?;
        let nodes = supports.active().clone();
        let prescribed = self.prescribed(&nodes);
        watch.lap(Phase::ShapeFunctions, supports.passes());

        let projected = match kept {
            Some(kept) if kept.motion.len() != nodes.len() => {
                return Err(StepError::OtherGrid { kept: kept.motion.len(), nodes: nodes.len() });
            }
            Some(kept) => kept.state(self.masses(&supports), &pool),
            None => self.project(&supports)?,
        };
        spent.projection_iterations = projected.iterations;
        let nodal = projected.with_prescribed(&prescribed);
        watch.lap(Phase::Projection, supports.passes());

        // To t_n + θ Δt, where forces are in balance; for θ = 1 that is the end.
        let theta = scheme.instant();
        let (from, mut to) =
            if scheme.follows_path() { (self.path.load, self.path.load_step(dt)) } else { (t, t + theta * dt) };
        let under = |load: f64| self.equilibrium(&supports, &nodal, &prescribed, scheme.balance(dt), load);
        let mut equilibrium = under(to);
        let mut phi = self.initial_guess(&supports, &nodal, kept.as_ref(), theta * dt);
        for dof in &prescribed {
            phi[dof.node][dof.component] = theta * dof.step.increment;
        }
        phi.iter_mut().zip(&nodal.motion).for_each(|(phi, before)| *phi += before);
        let (mut preconditioner, x) = (self.preconditioner().0.anew::<D>(), bytemuck::cast_slice_mut(&mut phi));
        let settings = &self.settings.newton;
        let newton = match kept.as_ref().filter(|_| scheme.follows_path()) {
            None => newton(&equilibrium, &mut *preconditioner, x, settings, &pool)
                .map_err(|error| self.explained(error, &equilibrium, &nodes))?,
            Some(kept) => {
                let start = under(from);
                let force = |load| under(load).free_external_force(&nodal.motion);
                let path = OnPath::new(self.path, &start, &force, &kept.rate, dt)?;
                let report = newton(&path, &mut *preconditioner, x, settings, &pool)?;
                to = path.load(&phi);
                if path.ends(to)? {
                    return Err(StepError::PathEnds { load: to });
                }
                equilibrium = under(to);
                report
            }
        };
        watch.lap(Phase::Newton, supports.passes());
        self.check_tangent(&equilibrium, &phi)?;
        let mut dphi = phi;
        dphi.iter_mut().zip(nodal.moved(nodes.len())).for_each(|(dphi, before)| *dphi = (*dphi - before) / theta);

        let (end, walls) = (scheme.end(dt), self.settings.wall_update);
        let mut update = Update::new(&end, &projected, &nodal, &prescribed, walls, &dphi);
        let error = self.local_error(&update, &supports, dt, &newton)?;
        if let Some(smoothing) = &self.settings.smoothing {
            update.smooth(smoothing, &self.particles, &supports, &nodal.mass, dt);
        }
        if let Some((particle, position)) = update.leaving(&self.particles, &supports, &self.grid) {
            return Err(StepError::LeftGrid { particle, position: position.iter().copied().collect() });
        }
        let (reactions, work, dissipated) = self.reactions_and_work(&equilibrium, from, dt, &dphi, &update)?;
        let renewed = kept.is_none();
        let mut next = kept.take().unwrap_or_default();
        if self.settings.renewal != Renewal::EveryStep {
            next.renew(&self.particles, &update.end(&projected), &dphi, dt);
        }
        let strain = update.commit(&mut self.particles, &self.bodies, &supports, dt);
        if scheme.follows_path() {
            self.path = self.path.after(to, &dphi, dt);
        }
        let passes = supports.passes();
        self.keep(next, supports, strain);
        watch.lap(Phase::Update, passes);
        self.external_work += work;
        self.dissipated += dissipated;
        let small = |error| self.settings.error_tolerance.is_none_or(|most| error <= ROOM * most);
        // What took Newton's method long would take it longer in a longer step.
        let easy = 2 * newton.history.iterations.len() <= self.settings.newton.max_iterations;
        self.clock.advance_and_grow_if(easy && error.is_none_or(small));
        let active_nodes = nodes.len();
        Ok(StepReport {
            dt,
            active_nodes,
            newton,
            projection_iterations: projected.iterations,
            reactions,
            error,
            renewed,
            seconds: *watch,
            failed: Vec::new(),
        })
    }

    /// The shape functions of a step, those of the last one if the grid is kept.
    fn supports(&mut self, kept: bool) -> Result<Supports<D>, SupportError> {
        let (Workspace { supports, serves, pool }, Particles { position, id, .. }) =
            (&mut self.workspace, &self.particles);
        let spare = supports.take();
        match spare {
            Some(supports) if kept && *serves => Ok(supports.again()),
            spare => {
                let precision = self.settings.newton.precision;
                Ok(Supports::renewed(spare, &self.approximation, &self.grid, position, Some(id), precision, pool)?.0)
            }
        }
    }

    /// Keeps the grid, unless a strain or a wall makes it anew; and its functions, or their memory, with the particles in their order.
    fn keep(&mut self, kept: Kept<D>, supports: Supports<D>, strain: f64) {
        let (position, loads) = (&self.particles.position, &self.loads.prescribed);
        let keeps = self.settings.renewal.keeps(strain) && !kept.meets(position, loads, &self.grid, supports.active());
        self.kept = keeps.then_some(kept);
        let leaping = supports.leaping();
        leaping.iter().for_each(|order| self.rearrange(order));
        self.workspace.supports = Some(if leaping.is_some() { supports.rearranged() } else { supports });
        // Those of particles that lie elsewhere now are good for their memory alone.
        self.workspace.serves = keeps && leaping.is_none();
    }

    /// As [`Self::step`], halving Δt while Newton fails or the error is too large, down to the clock's limit; Δt grows back afterwards.
    ///
    /// ```
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// let step = simulation.advance()?;
    /// assert_eq!((step.dt, simulation.clock.time()), (0.05, 0.05));
    /// // One particle of 112 torn away at 200 times its speed, and Newton's method is not given the time to follow.
    /// simulation.particles.velocity[50] *= 200.0;
    /// simulation.settings.newton.max_iterations = 2;
    /// let step = simulation.advance()?;
    /// assert!(!step.failed.is_empty());
    /// assert_eq!(step.dt, 0.05 / f64::from(1 << step.failed.len()));
    /// assert_eq!(simulation.clock.time(), 0.05 + step.dt);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The last failure, once Δt cannot be halved further, or a failure that a shorter step does not mend.
    pub fn advance(&mut self) -> Result<StepReport<D>, AdvanceError> {
        let mut failed = Vec::new();
        loop {
            let (time, dt) = (self.clock.time(), self.clock.step());
            let mut spent = Spent::nothing();
            let cause = match self.attempt(&mut spent) {
                Ok(report) => return Ok(StepReport { failed, ..report }),
                Err(cause) => cause,
            };
            failed.push(FailedAttempt::new(dt, spent, &cause));
            let mended = match cause {
                StepError::Newton(_) | StepError::Inaccurate { .. } => true,
                // A step too long to see a wall.
                StepError::LeftGrid { .. } => self.settings.error_tolerance.is_some(),
                // In balance before its end, and inside out there.
                StepError::Inadmissible(_) => self.settings.scheme.instant() < 1.0,
                _ => false,
            };
            if !(mended && self.clock.halve()) {
                return Err(AdvanceError { time, dt, cause: Box::new(cause), failed });
            }
        }
    }

    /// The degrees of freedom prescribed in the coming step.
    ///
    /// ```
    /// use bfree::mechanics::sweep::Supports;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// let held = |of: &bfree::simulation::Simulation<2>| -> Result<_, Box<dyn std::error::Error>> {
    ///     let (_, nodes) = Supports::new(&of.approximation, &of.grid, &of.particles.position)?;
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
        prescribed_dofs(&self.loads.prescribed, &self.grid, nodes, self.clock.time(), self.clock.step())
    }

    /// The equilibrium at time `t` on given supports.
    ///
    /// ```
    /// use bfree::mechanics::{sweep::Supports, transfer::Nodal};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, grid, dt) = (&simulation.particles, &simulation.grid, simulation.clock.step());
    /// let (supports, _) = Supports::new(&simulation.approximation, grid, &particles.position)?;
    /// let nodal = Nodal::project(particles, &supports, simulation.settings.lumping)?;
    /// let alphas = simulation.settings.scheme.end(dt);
    /// let equilibrium = simulation.equilibrium(&supports, &nodal, &[], alphas, dt);
    /// // A body in free flight is in equilibrium at Δφ = Δt v.
    /// let dphi: Vec<_> = nodal.velocity.iter().map(|v| v * dt).collect();
    /// let residual = equilibrium.residual(&dphi)?;
    /// assert!(residual.iter().map(|r| r.norm_squared()).sum::<f64>().sqrt() < 1e-13 * equilibrium.magnitude(&dphi)?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn equilibrium<'a>(
        &'a self,
        supports: &'a Supports<D>,
        nodal: &'a Nodal<D>,
        prescribed: &'a [PrescribedDof],
        alphas: Alphas,
        t: f64,
    ) -> Equilibrium<'a, D, L> {
        let Self { particles, bodies, loads, settings, .. } = self;
        // Without inertia nothing is consistent.
        let lumping = if nodal.is_static() { 1.0 } else { settings.lumping };
        // At t_n, too, laws are asked about a step.
        let dt = if alphas.dt > 0.0 { alphas.dt } else { self.clock.step() };
        Equilibrium::new(
            terms::Step {
                particles,
                bodies,
                loads,
                supports,
                nodal,
                alphas,
                lumping,
                time: t,
                dt,
                ghost: settings.ghost,
            },
            prescribed,
        )
    }

    /// What the nodes inherit from the particles; without inertia their mass at most, and that for gravity alone.
    ///
    /// ```
    /// use bfree::mechanics::sweep::Supports;
    /// use bfree::tensor::Vector;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (supports, _) = Supports::new(&simulation.approximation, &simulation.grid, &simulation.particles.position)?;
    /// let nodal = simulation.project(&supports)?;
    /// let momentum: Vector<f64, 2> = nodal.mass.iter().zip(&nodal.velocity).map(|(&m, v)| v * m).sum();
    /// assert!((momentum - simulation.particles.momentum()).norm() < 1e-13);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Particle velocities so large that the projection overflows.
    pub fn project(&self, supports: &Supports<D>) -> Result<Nodal<D>, LinearError> {
        if self.settings.scheme.has_inertia() {
            return Nodal::project(&self.particles, supports, self.settings.lumping);
        }
        Ok(self.masses(supports))
    }

    /// The mass of the nodes, where something asks for it.
    fn masses(&self, supports: &Supports<D>) -> Nodal<D> {
        let weighs = self.settings.scheme.has_inertia() || self.loads.gravity.is_some();
        if weighs { Nodal::mass_alone(&self.particles, supports) } else { Nodal::default() }
    }

    /// The Δφ that Newton's method starts from.
    fn initial_guess(
        &self,
        supports: &Supports<D>,
        nodal: &Nodal<D>,
        kept: Option<&Kept<D>>,
        dt: f64,
    ) -> Pooled<Vector<f64, D>> {
        let mut dphi: Pooled<Vector<f64, D>> = supports.field();
        let rate: &[Vector<f64, D>] = match self.settings.initial_guess {
            InitialGuess::Zero => &[],
            InitialGuess::Velocity => &nodal.velocity,
            InitialGuess::LastStep => kept.map_or(&[], |kept| &kept.rate),
        };
        dphi.iter_mut().zip(rate).for_each(|(dphi, rate)| *dphi = rate * dt);
        dphi
    }

    /// Without inertia, a body that nothing holds has no equilibrium; Newton's method can only say that it found none.
    fn explained(
        &self,
        error: NewtonError<Inadmissible>,
        equilibrium: &Equilibrium<'_, D, L>,
        nodes: &Nodes,
    ) -> StepError {
        let loose = equilibrium.step.nodal.is_static().then(|| loose(&self.grid, equilibrium, nodes));
        match loose.flatten() {
            Some(loose) => StepError::Loose { loose, source: error },
            None => StepError::Newton(error),
        }
    }

    /// The error of a step that ends in `update`, where somebody asks for it.
    fn local_error(
        &self,
        update: &Update<'_, D>,
        supports: &Supports<D>,
        dt: f64,
        newton: &NewtonReport,
    ) -> Result<Option<f64>, StepError> {
        let Some(tolerance) = self.settings.error_tolerance else { return Ok(None) };
        let error = update.local_error(&self.particles, supports, self.settings.scheme.error_constant(), dt);
        let error = error / self.grid.spacing;
        // Not a number is no small error.
        if (error.is_nan() || error > tolerance) && self.clock.can_halve() {
            return Err(StepError::Inaccurate { error, tolerance, newton: Box::new(newton.history.clone()) });
        }
        Ok(Some(error))
    }

    /// Reactions at t_{n+1} and impulses J over Δt, summed over each prescribed condition, and the work of the step,
    /// Σ [½ (f_n + f_{n+1}) + J/Δt]·Δφ over all external forces, the reactions of moving walls among them.
    fn reactions_and_work(
        &self,
        balanced: &Equilibrium<'_, D, L>,
        t: f64,
        dt: f64,
        dphi: &[Vector<f64, D>],
        update: &Update<'_, D>,
    ) -> Result<(Vec<Vector<f64, D>>, f64, f64), StepError> {
        let (terms::Step { supports, nodal, .. }, phi) = (balanced.step, update.motion());
        let mut end = balanced;
        let after;
        if self.settings.scheme.instant() < 1.0 {
            after = self.equilibrium(supports, nodal, balanced.prescribed, self.settings.scheme.end(dt), t + dt);
            // Nothing has asked yet whether this end is possible.
            after.forces(Role::Stores, phi)?;
            end = &after;
        }
        let mut reactions = vec![Vector::zeros(); self.loads.prescribed.len()];
        let mut work = 0.0;
        if !end.prescribed.is_empty() {
            let mut residual: Pooled<Vector<f64, D>> = supports.field();
            end.residual_into::<f64>(phi, &mut residual)?;
            for (dof, impulse) in end.prescribed.iter().zip(update.impulses()) {
                let (reaction, blow) = (residual[dof.node][dof.component], impulse / dt);
                reactions[dof.owner][dof.component] += reaction + blow;
                work += (0.5 * reaction + blow) * dof.step.increment;
            }
        }
        // At t_n: a = a_n and Δφ = 0.
        let before = supports.pool().collect(nodal.moved(supports.nodes()));
        let start = self.equilibrium(supports, nodal, end.prescribed, Alphas::START, t);
        if end.prescribed.iter().any(|dof| dof.moving) {
            let mut residual: Pooled<Vector<f64, D>> = supports.field();
            start.residual_into::<f64>(&before, &mut residual)?;
            for dof in end.prescribed {
                work += 0.5 * residual[dof.node][dof.component] * dof.step.increment;
            }
        }
        work += mean_work(&end.external_force(phi)?, &start.external_force(&before)?, dphi);
        let mut dissipated = 0.0;
        if self.dissipates() {
            let lost = |equilibrium: &Equilibrium<'_, D, L>, phi| equilibrium.forces(Role::Dissipates, phi);
            dissipated = mean_work(&lost(end, phi)?, &lost(&start, &before)?, dphi);
        }
        Ok((reactions, work, dissipated))
    }

    /// The check a run may ask for: the tangent at the solution against dual numbers, in a direction of its own for each step.
    fn check_tangent(&self, equilibrium: &Equilibrium<'_, D, L>, dphi: &[Vector<f64, D>]) -> Result<(), StepError> {
        match self.settings.check_tangent {
            Some(every) if self.clock.steps().is_multiple_of(every.get()) => {
                Ok(equilibrium.check_tangent(dphi, &direction(dphi.len(), self.clock.steps()))?)
            }
            _ => Ok(()),
        }
    }

    /// The same simulation with other laws, one for each body; particles remember what these do at rest.
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
        let bodies = self.bodies.iter();
        let bodies = bodies
            .map(|body| Body { name: body.name.clone(), law: law(body), density: body.density })
            .collect::<Vec<_>>();
        let mut particles = self.particles;
        particles.remember_rest(&bodies);
        Simulation {
            loads: self.loads,
            settings: self.settings,
            external_work: self.external_work,
            dissipated: self.dissipated,
            path: self.path,
            kept: self.kept,
            ..Simulation::new(self.grid, self.approximation, bodies, particles, self.clock)
        }
    }

    /// Σ V₀ W, the strain energy of all particles.
    ///
    /// ```
    /// use bfree::tensor::Tensor;
    ///
    /// // A small uniaxial strain ε: ½ (Λ + 2G) ε² times the volume; Λ + 2G = 170 + 4/3 · 30 = 210.
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// assert_eq!(simulation.strain_energy(), 0.0);
    /// let strain = 1e-8;
    /// simulation.particles.displacement_gradient.fill(Tensor::<f64, 2>::new(strain, 0.0, 0.0, 0.0));
    /// let linear = 0.5 * 210.0 * strain * strain * simulation.particles.volume.iter().sum::<f64>();
    /// assert!((simulation.strain_energy() / linear - 1.0).abs() < 1e-7);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn strain_energy(&self) -> f64 {
        let particles = &self.particles;
        (0..particles.len())
            .map(|p| {
                let at = Deformation::new(particles.displacement_gradient[p]);
                let law = &self.bodies[particles.body[p] as usize].law;
                particles.volume[p] * law.energy(&at, &particles.start(p, 0.0))
            })
            .sum()
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
        let (supports, nodes) = Supports::new(&self.approximation, &self.grid, &self.particles.position)?;
        let nodal: Vec<_> = nodes.positions(&self.grid).map(|(_, x)| velocity(&x)).collect();
        self.particles.velocity = supports.values(&nodal);
        Ok(())
    }

    /// Gives the particles the acceleration that the loads and the damping present at the start ask for, a₀ = (f_ext − f_int − C v₀)/m_I
    /// on the nodes, g̈ where the motion is prescribed. Without it they act half a step late.
    ///
    /// The lumped mass serves for every ε: it is exact for uniform loads, and of second order in h for others.
    ///
    /// Without inertia it does nothing.
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
        let (supports, nodes) = Supports::new(&self.approximation, &self.grid, &self.particles.position)?;
        let prescribed = self.prescribed(&nodes);
        let mut nodal = Nodal::at_rest(&self.particles, &supports);
        if self.loads.damping.is_some() {
            nodal.velocity = self.project(&supports)?.with_prescribed(&prescribed).velocity;
        }
        // Δφ and a_n are zero, and with them the inertia; damping acts on v_n.
        let equilibrium = self.equilibrium(&supports, &nodal, &prescribed, Alphas::START, self.clock.time());
        let unbalanced = equilibrium.residual::<f64>(&nodal.acceleration)?;
        nodal.accelerate(&self.particles, &unbalanced);
        self.particles.acceleration = supports.values(&nodal.with_prescribed(&prescribed).acceleration);
        Ok(())
    }
}

/// The work of a force along Δφ, by the mean of its values at the ends of the step.
fn mean_work<const D: usize>(end: &[Vector<f64, D>], start: &[Vector<f64, D>], dphi: &[Vector<f64, D>]) -> f64 {
    end.iter().zip(start).zip(dphi).map(|((end, start), dphi)| 0.5 * (end + start).dot(dphi)).sum()
}
