//! Fills bodies with particles, finds their surfaces, and reports their volumes and masses.

use super::body::Body;
use super::boundary::Face;
use super::particle_file;
use super::vector::vector;
use super::{BuildError, Scene};
use crate::grid::{Grid, indices};
use crate::mechanics::reference::GridReset;
use crate::particles::Particles;
use crate::shape::{Facet, Filling, GridBox, Layout, SURFACE_DEPTH, Shape, around, fill};
use crate::simulation::Simulation;
use crate::tensor::Vector;
use indicatif::BinaryBytes;
use std::fmt::{Display, Formatter};
use std::path::Path;

/// The particles of a body: number, volume and mass.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyUse {
    /// Name of the body.
    pub name: String,
    /// Number of particles.
    pub particles: usize,
    /// Volume of the particles (area in 2D, length in 1D).
    pub volume: f64,
    /// Mass of the particles.
    pub mass: f64,
    /// Volume of the shape, if the body has a shape.
    pub drawn: Option<f64>,
}

impl Display for BodyUse {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self { name, particles, volume, mass, drawn } = self;
        write!(f, "{name}: {particles} particles, mass {mass:.6e}, volume {volume:.6}")?;
        match drawn {
            Some(drawn) => write!(f, "; its shape's is {drawn:.6}, {:+.2} %", 100.0 * (volume / drawn - 1.0)),
            None => Ok(()),
        }
    }
}

/// The folder and the memory for filling bodies.
pub(super) struct Means<'a> {
    /// Folder of the particle files.
    pub folder: &'a Path,
    /// Available memory in bytes.
    pub memory: u64,
}

impl Means<'_> {
    /// Reserves room for `more` particles. A step stores the state at its start and at its end. Shape functions and the linearised tangent
    /// need more memory than a state, so three states are a lower bound. The exact amount is known only once the shape functions are.
    pub(crate) fn make_room<const D: usize>(
        &self,
        path: &str,
        particles: &mut Particles<D>,
        more: usize,
    ) -> Result<(), BuildError> {
        let count = particles.len() + more;
        let (needed, memory) = (3 * (count * Particles::<D>::BYTES) as u64, self.memory);
        if needed > memory {
            return Err(BuildError::at(
                path,
                format!(
                    "{count} particles so far need at least {} of memory, and {} can be had: use a coarser grid, fewer particles per \
                     cell or a smaller body",
                    BinaryBytes(needed),
                    BinaryBytes(memory)
                ),
            ));
        }
        particles.reserve(more);
        Ok(())
    }
}

impl Scene {
    /// Appends the particles of body `number`.
    pub(super) fn fill<const D: usize>(
        &self,
        body: &Body,
        path: &str,
        means: &Means<'_>,
        grid: &Grid<D>,
        number: u32,
        particles: &mut Particles<D>,
    ) -> Result<(), BuildError> {
        let has_inertia = self.time.scheme().has_inertia();
        let push = |particles: &mut Particles<D>, x: Vector<f64, D>, velocity: Vector<f64, D>, volume: f64| {
            let mass = body.density * volume;
            if has_inertia {
                particles.push(x, velocity, volume, mass, number)
            } else {
                particles.push_without_inertia(x, volume, mass, number)
            }
        };
        let common = body.velocity.as_ref().map(|v| vector::<D>(v));
        if let Some(shape) = &body.shape {
            let path = format!("{path}.shape");
            let velocity = common.unwrap_or_else(Vector::zeros);
            let seeds = fill(grid, &shape.built(&path)?, self.filling(body));
            let seeds = seeds.map_err(|source| BuildError::at(&path, source))?;
            means.make_room(&path, particles, seeds.len())?;
            for seed in seeds {
                push(particles, seed.position, velocity, seed.volume);
            }
        } else if let Some(file) = &body.particles {
            let path = format!("{path}.particles.file");
            let place = means.folder.join(&file.file);
            let fail = |what: String| BuildError::at(&path, format!("{}{what}", place.display()));
            let read = particle_file::read_file::<D>(&place).map_err(|error| fail(format!(": {error}")))?;
            if let Some(why) = self.refuses_velocities().filter(|_| read.velocities.is_some()) {
                return Err(fail(format!(" gives velocities, and {why}")));
            }
            means.make_room(&path, particles, read.positions.len())?;
            for (k, (x, &volume)) in read.positions.iter().zip(&read.volumes).enumerate() {
                if !grid.contains(x) {
                    let (number, place) = (k + 1, x.as_slice());
                    let what = format!("particle {number} of the file, at {place:?}, lies outside the grid");
                    return Err(BuildError::at(&path, what));
                }
                let own = read.velocities.as_ref().map(|velocities| velocities[k]);
                let velocity = common.or(own).unwrap_or_else(Vector::zeros);
                push(particles, *x, velocity, volume);
            }
        }
        Ok(())
    }

    /// The reason why a file of particles must give no velocities, and what to remove.
    fn refuses_velocities(&self) -> Option<&'static str> {
        if !self.time.scheme().has_inertia() {
            Some("there is no inertia; remove its columns vx, … or the key time.scheme")
        } else if self.initial_velocity.is_some() {
            Some("so does initial_velocity; remove its columns vx, … or the key initial_velocity")
        } else {
            None
        }
    }

    /// The rule by which the shape of a body is filled.
    ///
    /// ```
    /// use bfree::shape::Layout;
    ///
    /// // Load steps keep their grid, on which Gauss's points stay what they are.
    /// for (name, layout) in [("elastica", Layout::Gauss), ("rebound", Layout::Regular)] {
    ///     let scene = bfree::scene::read_file(format!("scenes/{name}.json").as_ref(), &[])?;
    ///     assert_eq!(scene.filling(&scene.bodies[0]).layout, layout);
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn filling(&self, body: &Body) -> Filling {
        let gauss = self.is_kept() && !self.approximation.one_half_width();
        let by_itself = if gauss { Layout::Gauss } else { Layout::Regular };
        Filling {
            per_axis: body.particles_per_cell,
            layout: body.layout.unwrap_or(by_itself),
            rule: body.fill,
            degree: self.approximation.degree(),
        }
    }

    fn is_kept(&self) -> bool {
        self.grid_reset() != GridReset::EveryStep
    }

    /// Whether sums over particles are Gauss quadrature. The conditions are a grid that is not reset in every step, Gauss layout in all
    /// bodies, and no lumped mass, not even in part.
    pub(super) fn is_integrated(&self) -> bool {
        let gauss = |body: &Body| body.shape.is_some() && self.filling(body).layout == Layout::Gauss;
        let lumped = self.time.scheme().has_inertia() && self.time.lumping() > 0.0;
        !lumped && self.is_kept() && self.bodies.iter().all(gauss)
    }

    /// Number, volume and mass of the particles of each body, beside the volume of the shape.
    ///
    /// ```
    /// // The paper's disc of radius 1.5: its particles count in full or not at all.
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let disc = scene.filled(&scene.build::<2>("scenes".as_ref())?).remove(0);
    /// assert_eq!((disc.particles, disc.volume), (112, 7.0));
    /// assert!((disc.drawn.ok_or("a shape")? / (2.25 * std::f64::consts::PI) - 1.0).abs() < 1e-3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn filled<const D: usize>(&self, simulation: &Simulation<D>) -> Vec<BodyUse> {
        let (grid, particles) = (&simulation.grid, &simulation.particles);
        let drawn = |shape: &super::shape::Shape| {
            let shape = shape.build::<D>()?;
            let (first, count) = around(grid, &shape);
            let cell = |i: [u64; D]| GridBox::cell(grid, std::array::from_fn(|k| (first[k] + i[k]) as u32));
            Some(indices(count).map(|i| shape.part(&cell(i)).0).sum::<f64>())
        };
        let of = |(number, body): (usize, &Body)| {
            let own =
                || (0..particles.len()).filter(|&p| particles.body[p] as usize == number && particles.is_solid(p));
            BodyUse {
                name: body.name.clone(),
                particles: own().count(),
                volume: own().map(|p| particles.volume[p]).sum(),
                mass: own().map(|p| particles.mass[p]).sum(),
                drawn: body.shape.as_ref().and_then(drawn),
            }
        };
        self.bodies.iter().enumerate().map(of).collect()
    }

    /// The surface of a body as facets, one by one for the boxes of a cut cell. Faces of the grid's box that hold the normal component are
    /// planes of symmetry, and not part of the surface.
    pub(super) fn facets<const D: usize>(
        &self,
        body: &Body,
        shape: &Shape<D>,
        region: Option<&Shape<D>>,
        grid: &Grid<D>,
    ) -> Vec<Facet<D>> {
        let filling = self.filling(body);
        let (h, n) = (grid.spacing, u64::from(filling.boxes_at_surface()));
        let edges = Vector::repeat(h / n as f64);
        let (first, count) = around(grid, shape);
        let goes_on = |facet: &Facet<D>| {
            (0..2 * D).any(|face| {
                let (k, upper) = (face / 2, face % 2 == 1);
                let (wall, outward) = if upper { (grid.position(grid.cells)[k], 1.0) } else { (grid.origin[k], -1.0) };
                let there = (facet.position[k] - wall).abs() < SURFACE_DEPTH * h && facet.normal[k] * outward > 0.5;
                there && self.boundary.face(k, upper).holds_across(k)
            })
        };
        let mut facets = Vec::new();
        for cell in indices(count) {
            let corner: Vector<f64, D> = Vector::from_fn(|k, _| grid.origin[k] + (first[k] + cell[k]) as f64 * h);
            let middle = corner.add_scalar(0.5 * h);
            if shape.signed_distance(&middle).abs() > h * (D as f64).sqrt() {
                continue;
            }
            for i in indices([n; D]) {
                let lower = corner + Vector::from_fn(|k, _| i[k] as f64 * edges[k]);
                let of = GridBox { lower, edges, spacing: h };
                facets.extend(match filling.layout {
                    Layout::Regular => shape.facets(region, &of),
                    Layout::Gauss => shape.surface_points(region, &of),
                });
            }
        }
        facets.retain(|facet| !goes_on(facet));
        facets
    }
}

impl Face {
    /// Whether the condition prescribes the component along `axis`, normal to the face.
    fn holds_across(&self, axis: usize) -> bool {
        match self {
            Self::Free => false,
            Self::Sliding | Self::Fixed => true,
            Self::Held(components) => components.get(axis) == Some(&true),
            Self::Displacement(table) | Self::Velocity(table) => {
                table.0.iter().any(|row| row.1.get(axis).is_some_and(Option::is_some))
            }
            Self::Rotation(_) => true,
        }
    }
}
