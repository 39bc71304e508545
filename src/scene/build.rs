//! From a checked scene to a simulation. The dimension becomes a type here and nowhere else: see [`Scene::dimension`].

use super::body::Body;
use super::boundary::{Face, Table};
use super::load::{self, Loaded};
use super::particle_file::{self, ParticleFileError};
use super::transfer::Transfer;
use super::{Problems, Scene, scale};
use crate::approximation::{Approximation, Cells};
use crate::clock::Clock;
use crate::grid::Grid;
use crate::mechanics::loads::{
    Curve, CurveError, Gravity, Loads, Motion, Prescribed, Pressing, Selection, SurfaceLoad, SurfacePoint,
};
use crate::mechanics::smoothing::Smoothing;
use crate::mechanics::terms::ForceField;
use crate::particles::{self, Particles};
use crate::shape::{self, FillError, Shape, fill};
use crate::simulation::{Settings, Simulation, StepError};
use crate::solver::NewtonSettings;
use crate::tensor::Vector;
use indicatif::BinaryBytes;
use std::path::Path;
use std::sync::Arc;

/// Why a checked scene still gives no simulation.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// The scene was not checked, or is of another dimension.
    #[error("{path}: does not fit {dimension} dimensions")]
    Dimension {
        /// The key.
        path: String,
        /// The dimension asked for.
        dimension: usize,
    },
    /// The scene was not checked: constants of a law or of shape functions.
    #[error("{0}")]
    Values(Problems),
    /// A curve or table.
    #[error("{path}: {source}")]
    Curve {
        /// The key.
        path: String,
        /// What is wrong.
        source: CurveError,
    },
    /// A shape without particles, or with too many.
    #[error("{path}: {source}")]
    Fill {
        /// The key.
        path: String,
        /// What is wrong.
        source: FillError,
    },
    /// More particles than there is memory for.
    #[error(
        "{path}: {particles} particles so far need at least {} of memory, and {} can be had: use a coarser grid, fewer particles \
         per cell or a smaller body", BinaryBytes(*needed), BinaryBytes(*memory)
    )]
    Memory {
        /// The key.
        path: String,
        /// Of this body and those before.
        particles: usize,
        /// Bytes, at least.
        needed: u64,
        /// Bytes that can be had.
        memory: u64,
    },
    /// A particle file.
    #[error("{path}: {file}: {source}")]
    ParticleFile {
        /// The key.
        path: String,
        /// The file.
        file: String,
        /// What is wrong.
        source: Box<ParticleFileError>,
    },
    /// A particle of a file that lies outside the grid.
    #[error("{path}: particle {particle} of the file, at {position:?}, lies outside the grid")]
    Outside {
        /// The key.
        path: String,
        /// Its number in the file, from 1.
        particle: usize,
        /// Where it lies.
        position: Vec<f64>,
    },
    /// A surface load that finds no surface.
    #[error("{path}: nothing of the surface of body {body:?} is loaded; enlarge the region or remove the load")]
    NoSurface {
        /// The key.
        path: String,
        /// The body.
        body: String,
    },
    /// The loads at t = 0 could not be evaluated.
    #[error("the acceleration at t = 0 cannot be computed: {source}")]
    InitialAcceleration {
        /// What is wrong.
        source: Box<StepError>,
    },
    /// A number too large or too small to compute with.
    #[error(
        "{path}: {what} is {value:e}; it must lie between {least:e} and {most:e}, or its products are not numbers: choose other \
         units, or other values"
    )]
    Scale {
        /// The key.
        path: String,
        /// The quantity.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The least allowed.
        least: f64,
        /// The most allowed.
        most: f64,
    },
    /// Velocities from a file that something else forbids.
    #[error("{path}: {file} gives velocities, and {why}")]
    Velocities {
        /// The key.
        path: String,
        /// The file.
        file: String,
        /// What forbids them, and what to remove.
        why: &'static str,
    },
    /// The initial velocity could not be interpolated.
    #[error("initial_velocity: {source}")]
    InitialVelocity {
        /// What is wrong.
        source: Box<StepError>,
    },
}

/// What bodies are filled from and into.
struct Means<'a> {
    /// Where particle files are.
    folder: &'a Path,
    /// Bytes that can be had.
    memory: u64,
}

impl Means<'_> {
    /// Room for `more` particles. A step needs the state at its start, as much for that at its end, and shape functions and
    /// frozen tangents that are larger still: what it needs in all is known once the shape functions are, and less than this never.
    fn make_room<const D: usize>(
        &self,
        path: &str,
        particles: &mut Particles<D>,
        more: usize,
    ) -> Result<(), BuildError> {
        let count = particles.len() + more;
        let (needed, memory) = (3 * (count * Particles::<D>::BYTES) as u64, self.memory);
        if needed > memory {
            return Err(BuildError::Memory { path: path.to_owned(), particles: count, needed, memory });
        }
        particles.reserve(more);
        Ok(())
    }
}

impl Scene {
    /// 1 (uniaxial strain), 2 (plane strain) or 3.
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

    /// The simulation at t = 0. Particle files are looked for in `folder`.
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
    /// What only shows once particles are there; and any scene whose dimension is not `D`.
    pub fn build<const D: usize>(&self, folder: &Path) -> Result<Simulation<D>, BuildError> {
        self.build_within(folder, u64::MAX)
    }

    /// As [`Self::build`], where no more than so many bytes of memory can be had.
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
    /// As [`Self::build`]; and particles that surely need more, before room is made for them.
    pub fn build_within<const D: usize>(&self, folder: &Path, memory: u64) -> Result<Simulation<D>, BuildError> {
        let grid: Grid<D> =
            self.grid.build().ok_or_else(|| BuildError::Dimension { path: "grid".into(), dimension: D })?;
        let means = Means { folder, memory };
        let mut problems = Problems::default();
        let mut particles = Particles::default();
        let mut bodies = Vec::new();
        for (i, body) in self.bodies.iter().enumerate() {
            let path = format!("bodies[{i}]");
            self.fill(body, &path, &means, &grid, i as u32, &mut particles)?;
            if let Some(law) = body.material.law(&mut problems, &format!("{path}.material")) {
                bodies.push(particles::Body { name: body.name.clone(), law, density: body.density });
            }
        }
        let Some(approximation) = self.shape_functions(&mut problems).filter(|_| problems.is_empty()) else {
            return Err(BuildError::Values(problems));
        };
        let loads = self.loads(&means, &grid, &mut particles)?;
        particles.remember_rest(&bodies);
        let mut simulation = Simulation {
            loads,
            settings: self.settings(),
            ..Simulation::new(
                grid,
                approximation,
                bodies,
                particles,
                Clock::new(self.time.step, self.time.max_halvings),
            )
        };
        self.set_initial_velocity(&mut simulation)?;
        scale::check(self, &simulation)?;
        simulation
            .set_initial_acceleration()
            .map_err(|source| BuildError::InitialAcceleration { source: Box::new(source) })?;
        Ok(simulation)
    }

    /// The shape functions; or `None`, and what is wrong with them.
    pub(super) fn shape_functions(&self, problems: &mut Problems) -> Option<Approximation> {
        let particles_per_axis = self.bodies.first().map_or(2, |body| body.particles_per_cell);
        let cells = Cells { dimension: self.dimension(), particles_per_axis };
        self.approximation.functions(cells, problems, "approximation")
    }

    fn settings(&self) -> Settings {
        let (newton, krylov) = (&self.solver.newton, &self.solver.krylov);
        Settings {
            scheme: self.time.inertia.scheme(self.time.newmark()),
            lumping: self.time.lumping(),
            projection: self.time.projection.unwrap_or_default(),
            ghost: self.ghost(),
            renewal: self.grid.renewed(self.time.inertia),
            initial_guess: self.time.initial_guess(),
            wall_update: self.time.wall_update.unwrap_or_default(),
            smoothing: match self.transfer.unwrap_or_default() {
                Transfer::Flip => None,
                Transfer::Pic(pic) => Some(Smoothing::uniform(pic.order, f64::INFINITY)),
                Transfer::Blend(blend) => Some(Smoothing::uniform(blend.order, blend.rate)),
                Transfer::Limited(limited) => Some(Smoothing::limited(limited.rate)),
            },
            newton: NewtonSettings {
                relative_tolerance: newton.tolerance,
                max_iterations: newton.max_iterations as usize,
                forcing: krylov.forcing,
                krylov: krylov.method,
                precision: krylov.precision,
                max_krylov_iterations: krylov.max_iterations as usize,
                ..NewtonSettings::default()
            },
            preconditioner: krylov.preconditioner,
            error_tolerance: self.time.adaptive.map(|adaptive| adaptive.tolerance),
            check_tangent: None,
        }
    }

    fn loads<const D: usize>(
        &self,
        means: &Means<'_>,
        grid: &Grid<D>,
        particles: &mut Particles<D>,
    ) -> Result<Loads<D>, BuildError> {
        let mut loads = self.given_as_they_are();
        if let Some(gravity) = &self.gravity {
            let acceleration = vector("gravity.acceleration", &gravity.acceleration)?;
            let curve_in_time = curve("gravity.curve", gravity.curve.as_ref())?;
            if let Some(profile) = &gravity.profile {
                let along = vector::<D>("gravity.profile.along", &profile.along)?.normalize();
                let factor = curve("gravity.profile.factor", Some(&profile.factor))?;
                let field = move |_, x: &Vector<f64, D>, t| {
                    acceleration * (curve_in_time.value(t) * factor.value(along.dot(x)))
                };
                loads.field = Some(ForceField(Arc::new(field)));
            } else {
                loads.gravity = Some(Gravity { acceleration, curve: curve_in_time });
            }
        }
        for (k, (name, face)) in self.boundary.faces().into_iter().enumerate().take(2 * D) {
            let (Some(face), axis, upper) = (face, k / 2, k % 2 == 1) else { continue };
            let motion = face.motion::<D>(&format!("boundary.{name}"), axis)?;
            if motion.iter().any(Option::is_some) {
                loads.prescribed.push(Prescribed { name: name.into(), on: Selection::Face { axis, upper }, motion });
            }
        }
        for (i, prescribed) in self.prescribed.iter().enumerate() {
            let path = format!("prescribed[{i}]");
            let region = prescribed.region.build::<D>().ok_or_else(|| dimension::<D>(&path))?;
            let motion = match (&prescribed.displacement, &prescribed.velocity) {
                (Some(table), _) => table.motion(&format!("{path}.displacement"), Motion::Displacement)?,
                (None, Some(table)) => table.motion(&format!("{path}.velocity"), Motion::Velocity)?,
                (None, None) => std::array::from_fn(|_| None),
            };
            loads.prescribed.push(Prescribed { name: format!("region{i}"), on: Selection::Region(region), motion });
        }
        for (i, traction) in self.tractions.iter().enumerate() {
            let path = format!("tractions[{i}]");
            let pressing = Pressing::Traction(vector(&format!("{path}.traction"), &traction.traction)?);
            loads.surface.push(self.surface(&path, pressing, &traction.loaded(), means, grid, particles)?);
        }
        for (i, pressure) in self.pressures.iter().enumerate() {
            let pressing = Pressing::Pressure(pressure.pressure);
            let path = format!("pressures[{i}]");
            loads.surface.push(self.surface(&path, pressing, &pressure.loaded(), means, grid, particles)?);
        }
        Ok(loads)
    }

    /// The points of a loaded surface: of a body with a shape, where that surface is; of others, the particles that are said to stand
    /// for it.
    fn surface<const D: usize>(
        &self,
        path: &str,
        pressing: Pressing<D>,
        on: &Loaded<'_>,
        means: &Means<'_>,
        grid: &Grid<D>,
        particles: &mut Particles<D>,
    ) -> Result<SurfaceLoad<D>, BuildError> {
        let curve = curve(&format!("{path}.curve"), on.curve.as_ref())?;
        let built = |region: &super::shape::Shape| region.build::<D>().ok_or_else(|| dimension::<D>(path));
        let region = on.region.as_ref().map(built).transpose()?;
        let Some((number, body)) = self.bodies.iter().enumerate().find(|(_, body)| body.name == on.body) else {
            return Err(dimension::<D>(path));
        };
        let shape = body.shape.as_ref().and_then(|shape| shape.build::<D>());
        let points = match (&on.surface, &shape) {
            (Some(given), _) => {
                let normal = vector::<D>(&format!("{path}.surface.normal"), &given.normal)?.normalize();
                let spacing = grid.spacing / f64::from(body.particles_per_cell);
                let loaded = |&p: &usize| {
                    let x = &particles.position[p];
                    let depth = shape.as_ref().map_or(0.0, |shape| shape.signed_distance(x));
                    particles.is_solid(p)
                        && particles.body[p] as usize == number
                        && shape::is_above(depth, spacing)
                        && region.as_ref().is_none_or(|region| region.holds(x, grid.spacing))
                };
                let point = |particle| SurfacePoint { particle, normal, area: given.area };
                (0..particles.len()).filter(loaded).map(point).collect()
            }
            (None, Some(shape)) => {
                let facets = self.facets(body, shape, region.as_ref(), grid);
                means.make_room(path, particles, facets.len())?;
                let velocity = body.velocity.as_ref().map(|v| vector::<D>(path, v)).transpose()?;
                let mut points = Vec::new();
                for facet in facets {
                    points.push(SurfacePoint { particle: particles.len(), normal: facet.normal, area: facet.area });
                    // A hair inside, in the cell where the body is.
                    let x = facet.position - facet.normal * (shape::HAIR * grid.spacing);
                    if self.time.inertia.has_inertia() {
                        particles.push(x, velocity.unwrap_or_else(Vector::zeros), 0.0, 0.0, number as u32);
                    } else {
                        particles.push_without_inertia(x, 0.0, 0.0, number as u32);
                    }
                }
                points
            }
            (None, None) => Vec::new(),
        };
        if points.is_empty() {
            return Err(BuildError::NoSurface { path: path.into(), body: on.body.into() });
        }
        Ok(SurfaceLoad { pressing, curve, points })
    }

    fn fill<const D: usize>(
        &self,
        body: &Body,
        path: &str,
        means: &Means<'_>,
        grid: &Grid<D>,
        number: u32,
        particles: &mut Particles<D>,
    ) -> Result<(), BuildError> {
        let push = |particles: &mut Particles<D>, x: Vector<f64, D>, velocity: Vector<f64, D>, volume: f64| {
            let mass = body.density * volume;
            if self.time.inertia.has_inertia() {
                particles.push(x, velocity, volume, mass, number)
            } else {
                particles.push_without_inertia(x, volume, mass, number)
            }
        };
        let common = body.velocity.as_ref().map(|v| vector::<D>(&format!("{path}.velocity"), v)).transpose()?;
        if let Some(shape) = &body.shape {
            let path = format!("{path}.shape");
            let shape = shape.build::<D>().ok_or_else(|| dimension::<D>(&path))?;
            let velocity = common.unwrap_or_else(Vector::zeros);
            let seeds = fill(grid, &shape, self.filling(body))
                .map_err(|source| BuildError::Fill { path: path.clone(), source })?;
            means.make_room(&path, particles, seeds.len())?;
            for seed in seeds {
                push(particles, seed.position, velocity, seed.volume);
            }
        } else if let Some(file) = &body.particles {
            let path = format!("{path}.particles.file");
            let place = means.folder.join(&file.file);
            let read = particle_file::read_file::<D>(&place).map_err(|source| BuildError::ParticleFile {
                path: path.clone(),
                file: place.display().to_string(),
                source: Box::new(source),
            })?;
            if read.velocities.is_some() {
                let why = if !self.time.inertia.has_inertia() {
                    Some("there is no inertia; remove its columns vx, … or the key time.inertia")
                } else {
                    let twice = "so does initial_velocity; remove its columns vx, … or the key initial_velocity";
                    self.initial_velocity.as_ref().map(|_| twice)
                };
                if let Some(why) = why {
                    return Err(BuildError::Velocities { path, file: place.display().to_string(), why });
                }
            }
            means.make_room(&path, particles, read.positions.len())?;
            for (k, (x, &volume)) in read.positions.iter().zip(&read.volumes).enumerate() {
                if !grid.contains(x) {
                    let position = x.iter().copied().collect();
                    return Err(BuildError::Outside { path, particle: k + 1, position });
                }
                let own = read.velocities.as_ref().map(|velocities| velocities[k]);
                let velocity = common.or(own).unwrap_or_else(Vector::zeros);
                push(particles, *x, velocity, volume);
            }
        }
        Ok(())
    }

    fn set_initial_velocity<const D: usize>(&self, simulation: &mut Simulation<D>) -> Result<(), BuildError> {
        let Some(initial) = &self.initial_velocity else { return Ok(()) };
        let mut regions: Vec<(Shape<D>, Vector<f64, D>)> = Vec::new();
        for (i, node) in initial.nodes.iter().enumerate() {
            let path = format!("initial_velocity.nodes[{i}]");
            let region = node.region.build().ok_or_else(|| dimension::<D>(&path))?;
            regions.push((region, vector(&format!("{path}.velocity"), &node.velocity)?));
        }
        let spacing = simulation.grid.spacing;
        simulation
            .set_velocity_on_nodes(|x| {
                let last = regions.iter().rev().find(|(region, _)| region.holds(x, spacing));
                last.map_or_else(Vector::zeros, |(_, velocity)| *velocity)
            })
            .map_err(|source| BuildError::InitialVelocity { source: Box::new(source) })
    }
}

impl Face {
    /// The motion of each component on a face across `axis`.
    fn motion<const D: usize>(&self, path: &str, axis: usize) -> Result<[Option<Motion>; D], BuildError> {
        let held = |holds: &dyn Fn(usize) -> bool| std::array::from_fn(|i| holds(i).then_some(Motion::Rest));
        Ok(match self {
            Self::Free => held(&|_| false),
            Self::Sliding => held(&|i| i == axis),
            Self::Fixed => held(&|_| true),
            Self::Held(components) => held(&|i| components.get(i) == Some(&true)),
            Self::Displacement(table) => table.motion(&format!("{path}.displacement"), Motion::Displacement)?,
            Self::Velocity(table) => table.motion(&format!("{path}.velocity"), Motion::Velocity)?,
        })
    }
}

impl Table {
    /// One curve a prescribed component.
    fn motion<const D: usize>(
        &self,
        path: &str,
        kind: impl Fn(Curve) -> Motion,
    ) -> Result<[Option<Motion>; D], BuildError> {
        let mut motion = std::array::from_fn(|_| None);
        for (i, motion) in motion.iter_mut().enumerate() {
            let points: Vec<[f64; 2]> = self.0.iter().filter_map(|row| Some([row.0, (*row.1.get(i)?)?])).collect();
            if !points.is_empty() {
                *motion =
                    Some(kind(Curve::new(points).map_err(|source| BuildError::Curve { path: path.into(), source })?));
            }
        }
        Ok(motion)
    }
}

/// The factor in time of a load, 1 if none is given.
fn curve(path: &str, given: Option<&load::Curve>) -> Result<Curve, BuildError> {
    match given {
        Some(curve) => Curve::new(curve.0.clone()).map_err(|source| BuildError::Curve { path: path.into(), source }),
        None => Ok(Curve::constant(1.0)),
    }
}

fn vector<const D: usize>(path: &str, components: &[f64]) -> Result<Vector<f64, D>, BuildError> {
    super::shape::vector(components).ok_or_else(|| dimension::<D>(path))
}

fn dimension<const D: usize>(path: &str) -> BuildError {
    BuildError::Dimension { path: path.into(), dimension: D }
}
