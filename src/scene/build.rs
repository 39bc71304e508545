//! Builds a simulation from a checked scene, whose dimension is a type here: see [`Scene::dimension`].

use super::boundary::Prescribed;
use super::curve::Curve;
use super::filling::Builder;
use super::obstacle::Obstacle;
use super::transfer::Transfer;
use super::vector::vector;
use super::{BuildError, Problems, Scene, shape};
use crate::approximation::{Approximation, Cells};
use crate::clock::Clock;
use crate::grid::Grid;
use crate::mechanics::smoothing::Smoothing;
use crate::parallel::Processes;
use crate::particles::{self, Particles};
use crate::shape::Shape;
use crate::simulation::{Settings, Simulation, as_type};
use crate::solver::{Forcing, NewtonSettings};
use crate::tensor::Vector;
use std::path::Path;

type Build<const D: usize> = fn(&Scene, &Path, u64, bool) -> Result<Simulation<D>, BuildError>;

// Compiled once, in this crate, see `simulation/compiled.rs`.
static BUILD_1: Build<1> = Scene::build_in_this_crate;
static BUILD_2: Build<2> = Scene::build_in_this_crate;
static BUILD_3: Build<3> = Scene::build_in_this_crate;

fn other_dimension(dimension: usize) -> BuildError {
    BuildError::at("grid", format!("does not fit {dimension} dimensions"))
}

impl Scene {
    /// The dimension: 1 (uniaxial strain), 2 (plane strain) or 3.
    ///
    /// ```
    /// // The dimension is a number in a scene and a type in a simulation.
    /// let scene = bfree::scene::read_file("scenes/ball_drop.json".as_ref(), &[])?;
    /// assert_eq!(scene.dimension(), 3);
    /// assert!(scene.build::<2>("scenes".as_ref()).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn dimension(&self) -> usize {
        self.grid.dimension()
    }

    /// The simulation at t = 0. Files of particles and shapes are looked for in `folder`.
    ///
    /// ```
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// // The paper's disc: 112 particles of the volume (h/2)², ρ = 4, v = ½: an energy of ½ m v² = 3.5.
    /// assert_eq!((simulation.particles.len(), simulation.particles.volume[0]), (112, 0.0625));
    /// assert_eq!(simulation.particles.kinetic_energy(), 3.5);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// A scene whose dimension is not `D`, and errors that appear only with the particles.
    pub fn build<const D: usize>(&self, folder: &Path) -> Result<Simulation<D>, BuildError> {
        self.build_within(folder, u64::MAX)
    }

    /// Like [`Self::build`], with at most `memory` bytes available.
    ///
    /// ```
    /// // 112 particles need more than 1 kB, and less than 1 GB.
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// assert!(scene.build_within::<2>("scenes".as_ref(), 1 << 10).is_err());
    /// let simulation = scene.build_within::<2>("scenes".as_ref(), 1 << 30)?;
    /// assert_eq!(simulation.particles, scene.build::<2>("scenes".as_ref())?.particles);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The errors of [`Self::build`], and particles that certainly need more memory, before room is made for them.
    pub fn build_within<const D: usize>(&self, folder: &Path, memory: u64) -> Result<Simulation<D>, BuildError> {
        self.build_started(folder, memory, true)
    }

    /// [`Self::build_within`] without the acceleration at t = 0, which [`Self::start`] adds.
    pub(crate) fn build_unstarted<const D: usize>(
        &self,
        folder: &Path,
        memory: u64,
    ) -> Result<Simulation<D>, BuildError> {
        self.build_started(folder, memory, false)
    }

    fn build_started<const D: usize>(
        &self,
        folder: &Path,
        memory: u64,
        starts: bool,
    ) -> Result<Simulation<D>, BuildError> {
        // Unit tests need one dimension or two.
        if const { cfg!(test) } {
            return self.build_in_this_crate(folder, memory, starts);
        }
        let built = match D {
            1 => as_type(BUILD_1(self, folder, memory, starts)),
            2 => as_type(BUILD_2(self, folder, memory, starts)),
            3 => as_type(BUILD_3(self, folder, memory, starts)),
            _ => None,
        };
        built.unwrap_or_else(|| Err(other_dimension(D)))
    }

    /// [`Self::build_within`], compiled where it is called.
    fn build_in_this_crate<const D: usize>(
        &self,
        folder: &Path,
        memory: u64,
        starts: bool,
    ) -> Result<Simulation<D>, BuildError> {
        let grid: Grid<D> = self.grid.build().ok_or_else(|| other_dimension(D))?;
        self.shapes().iter().try_for_each(|(path, shape)| shape.read_files(path, folder, D))?;
        for (path, curve) in self.curves() {
            curve.read(folder).map_err(|error| BuildError::at(format!("{path}.file"), error))?;
        }
        let mut problems = self.check();
        let approximation = self.shape_functions(&mut Problems::default()).filter(|_| problems.is_empty());
        let approximation = approximation.ok_or_else(|| BuildError::Values(std::mem::take(&mut problems)))?;
        let mut builder = Builder { scene: self, folder, memory, grid, particles: Particles::default() };
        let (mut bodies, fields) = (Vec::new(), self.nodal_fields());
        for (i, (body, law)) in self.bodies.iter().zip(self.laws()).enumerate() {
            builder.fill(i, body)?;
            let (name, density, dilatation) = (body.name.clone(), body.density, body.volumetric);
            bodies.push(particles::Body { name, law, density, dilatation, field: fields[i] });
        }
        let mut loads = builder.loads()?;
        builder.refuse_overlap(&loads.contacts)?;
        builder.refuse_overlapping_bodies(&loads.contacts)?;
        let mut particles = builder.particles;
        // An outline clips a whole picture, so it needs all bodies.
        let has_outline = |body: usize| particles.outlines.iter().any(|outline| outline.body as usize == body);
        if !(0..bodies.len()).all(has_outline) {
            particles.outlines.clear();
        }
        loads.contacts.anchor(&particles.position, 0.0);
        particles.set_internal_to_rest(&bodies);
        let clock = Clock::new(self.time.step, self.time.max_halvings);
        let mut simulation = Simulation {
            loads,
            settings: self.settings(),
            ..Simulation::new(grid, approximation, bodies, particles, clock)
        };
        self.set_initial_velocity(&mut simulation)?;
        if starts { Self::start(&mut simulation).map(|()| simulation) } else { Ok(simulation) }
    }

    /// Sets the acceleration at t = 0.
    pub(crate) fn start<const D: usize>(simulation: &mut Simulation<D>) -> Result<(), BuildError> {
        let cannot = |source| BuildError::at("the acceleration at t = 0 cannot be computed", source);
        simulation.set_initial_acceleration().map_err(cannot)
    }

    /// The shape functions; `None` if their parameters are not allowed, with the reasons in `problems`.
    pub(super) fn shape_functions(&self, problems: &mut Problems) -> Option<Approximation> {
        let particles_per_axis = self.bodies.first().map_or(2, |body| body.particles_per_cell);
        let cells = Cells { dimension: self.dimension(), particles_per_axis, integrated: self.is_integrated() };
        self.approximation.functions(cells, problems, "approximation")
    }

    /// All shapes, with their paths.
    fn shapes(&self) -> Vec<(String, &shape::Shape)> {
        let bodies = self.bodies.iter().enumerate();
        let bodies = bodies.filter_map(|(i, body)| Some((format!("bodies[{i}].shape"), body.shape.as_ref()?)));
        let prescribed = self.prescribed.iter().enumerate();
        let prescribed = prescribed.map(|(i, one)| (format!("prescribed[{i}].region"), &one.region));
        let loads = self.surface_loads();
        let loads = loads.filter_map(|(path, load)| Some((format!("{path}.region"), load.region.as_ref()?)));
        let initial = self.initial_velocity.iter().flat_map(|initial| &initial.nodes).enumerate();
        let initial = initial.map(|(i, one)| (format!("initial_velocity.nodes[{i}].region"), &one.region));
        let obstacles = self.obstacles.iter().enumerate();
        let obstacles = obstacles.map(|(i, one)| (format!("obstacles[{i}].shape"), &one.shape));
        bodies.chain(prescribed).chain(loads).chain(obstacles).chain(initial).collect()
    }

    /// The checksums of the files of curves that [`Self::build`] has read, by key.
    pub(crate) fn curve_files(&self) -> impl Iterator<Item = (String, u32)> {
        self.curves().into_iter().filter_map(|(path, curve)| Some((format!("{path}.file"), curve.checksum()?)))
    }

    /// All curves, with their paths.
    fn curves(&self) -> Vec<(String, &Curve)> {
        let gravity = self.gravity.iter().flat_map(|gravity| {
            let profile = gravity.profile.iter().map(|profile| ("gravity.profile.factor".to_owned(), &profile.factor));
            gravity.curve.iter().map(|curve| ("gravity.curve".to_owned(), curve)).chain(profile)
        });
        let loads = self.surface_loads();
        let loads = loads.filter_map(|(path, load)| Some((format!("{path}.curve"), load.curve.as_ref()?)));
        let faces = self.boundary.faces().into_iter();
        let faces = faces.filter_map(|(name, face)| face?.given()?.curve(&format!("boundary.{name}")));
        let prescribed = self.prescribed.iter().map(Prescribed::given).enumerate();
        let prescribed = prescribed.map(|(i, given)| (format!("prescribed[{i}]"), given));
        let obstacles = self.obstacles.iter().map(Obstacle::given).enumerate();
        let given = prescribed.chain(obstacles.map(|(i, given)| (format!("obstacles[{i}]"), given)));
        let given = given.flat_map(|(path, given)| given.into_iter().filter_map(move |motion| motion.curve(&path)));
        gravity.chain(loads).chain(faces).chain(given).collect()
    }

    fn settings(&self) -> Settings {
        let (newton, krylov) = (&self.solver.newton, &self.solver.krylov);
        // With inertia, linear solves take few iterations, and momentum is kept to more digits by exact ones.
        let by_itself = if self.time.scheme().has_inertia() { Forcing::default() } else { Forcing::EisenstatWalker };
        Settings {
            scheme: self.time.scheme().scheme(self.time.newmark()),
            lumping: self.lumping(),
            projection: self.time.projection.unwrap_or_default(),
            aggregation: self.aggregates(),
            grid_reset: self.grid_reset(),
            initial_guess: self.time.initial_guess(),
            wall_update: self.time.wall_update.unwrap_or_default(),
            smoothing: match self.transfer.unwrap_or_default() {
                Transfer::Flip => None,
                Transfer::Pic { order } => Some(Smoothing::uniform(order, f64::INFINITY)),
                Transfer::Blend { order, rate } => Some(Smoothing::uniform(order, rate)),
                Transfer::Limited { rate } => Some(Smoothing::limited(rate)),
            },
            newton: NewtonSettings {
                relative_tolerance: newton.tolerance,
                max_iterations: newton.max_iterations as usize,
                forcing: krylov.forcing.unwrap_or(by_itself),
                krylov: krylov.method,
                max_krylov_iterations: krylov.max_iterations as usize,
            },
            preconditioner: krylov.preconditioner,
            error_tolerance: self.time.adaptive.map(|adaptive| adaptive.tolerance),
            check_tangent: None,
            gpu: None,
            processes: Processes::default(),
            stop: None,
        }
    }

    fn set_initial_velocity<const D: usize>(&self, simulation: &mut Simulation<D>) -> Result<(), BuildError> {
        let Some(initial) = &self.initial_velocity else { return Ok(()) };
        let mut regions: Vec<(Shape<D>, Vector<f64, D>)> = Vec::new();
        for (i, node) in initial.nodes.iter().enumerate() {
            let region = node.region.of_nodes(&format!("initial_velocity.nodes[{i}].region"), &simulation.grid)?;
            regions.push((region, vector(&node.velocity)));
        }
        let spacing = simulation.grid.spacing;
        simulation
            .set_velocity_on_nodes(|x| {
                let last = regions.iter().rev().find(|(region, _)| region.holds(x, spacing));
                last.map_or_else(Vector::zeros, |(_, velocity)| *velocity)
            })
            .map_err(|source| BuildError::at("initial_velocity", source))
    }
}
