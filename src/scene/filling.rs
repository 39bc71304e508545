//! Fills bodies with particles, finds their surfaces, and reports their volumes and masses.

use super::body::Body;
use super::particle_file;
use super::vector::vector;
use super::{BuildError, Scene};
use crate::grid::{Grid, indices};
use crate::mechanics::loads::CurveError;
use crate::mechanics::reference::GridReset;
use crate::particles::{Outline, Particles};
use crate::shape::{
    CloudPoint, Facet, Fill, Filling, GridBox, Layout, NoSurface, SURFACE_DEPTH, Shape, around, cloud_surface, fill,
};
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
        let Some(drawn) = drawn else { return Ok(()) };
        write!(f, "; its shape's is {drawn:.6}, {:+.2} %", 100.0 * (volume / drawn - 1.0))
    }
}

/// The largest edge of a particle that touches, in grid spacings. Farther outside there are hardly any nodes with mass.
const LARGEST_EDGE: f64 = 1.5;

/// The grid and the particles of a simulation that is being built.
pub(super) struct Builder<'a, const D: usize> {
    pub scene: &'a Scene,
    /// Folder of the particle files.
    pub folder: &'a Path,
    /// Available memory in bytes.
    pub memory: u64,
    pub grid: Grid<D>,
    pub particles: Particles<D>,
}

impl<const D: usize> Builder<'_, D> {
    /// Reserves room for `more` particles. A step stores the state at its start and at its end. Shape functions and the linearised tangent
    /// need more memory than a state, so three states are a lower bound. The exact amount is known only once the shape functions are.
    pub(crate) fn make_room(&mut self, path: &str, more: usize) -> Result<(), BuildError> {
        let count = self.particles.len() + more;
        let needed = 3 * (count * Particles::<D>::BYTES) as u64;
        if needed > self.memory {
            let (needed, memory) = (BinaryBytes(needed), BinaryBytes(self.memory));
            let what = format!(
                "{count} particles so far need at least {needed} of memory, and {memory} can be had: use a coarser grid, fewer particles \
                 per cell or a smaller body"
            );
            return Err(BuildError::at(path, what));
        }
        self.particles.reserve(more);
        Ok(())
    }

    /// Appends a particle. Without inertia, particles have no velocities.
    pub(crate) fn push(&mut self, x: Vector<f64, D>, velocity: Vector<f64, D>, volume: f64, mass: f64, body: usize) {
        if self.scene.time.scheme().has_inertia() {
            self.particles.push(x, velocity, volume, mass, body as u32);
        } else {
            self.particles.push_without_inertia(x, volume, mass, body as u32);
        }
    }

    /// Appends the particles of body `number`.
    pub(crate) fn fill(&mut self, number: usize, body: &Body) -> Result<(), BuildError> {
        let common = body.velocity.as_ref().map(|v| vector::<D>(v));
        if let Some(shape) = &body.shape {
            let path = format!("bodies[{number}].shape");
            let velocity = common.unwrap_or_else(Vector::zeros);
            let (shape, filling) = (shape.built(&path)?, self.scene.filling(body));
            let seeds = fill(&self.grid, &shape, filling);
            let seeds = seeds.map_err(|source| BuildError::at(&path, source))?;
            self.make_room(&path, seeds.len())?;
            for seed in seeds {
                self.push(seed.position, velocity, seed.volume, body.density * seed.volume, number);
            }
            if filling.rule == Fill::Cut {
                // The outline for pictures. Its corners are as far apart as two particles of the default number per cell.
                let lines = shape.closed_lines(&self.grid, 0.5 * self.grid.spacing).into_iter().flatten();
                self.particles.outlines.extend(lines.map(|corners| Outline { body: number as u32, corners }));
            }
        } else if let Some(file) = &body.particles {
            let path = format!("bodies[{number}].particles.file");
            let place = self.folder.join(&file.file);
            let fail = |what: String| BuildError::at(&path, format!("{}{what}", place.display()));
            let read = particle_file::read_file::<D>(&place).map_err(|error| fail(format!(": {error}")))?;
            if let Some(why) = self.scene.refuses_velocities().filter(|_| read.velocities.is_some()) {
                return Err(fail(format!(" gives velocities, and {why}")));
            }
            self.make_room(&path, read.positions.len())?;
            for (k, (x, &volume)) in read.positions.iter().zip(&read.volumes).enumerate() {
                if !self.grid.contains(x) {
                    let (line, place) = (k + 1, x.as_slice());
                    let what = format!("particle {line} of the file, at {place:?}, lies outside the grid");
                    return Err(BuildError::at(&path, what));
                }
                let own = read.velocities.as_ref().map(|velocities| velocities[k]);
                self.push(*x, common.or(own).unwrap_or_else(Vector::zeros), volume, body.density * volume, number);
            }
        }
        Ok(())
    }

    /// The surface of a body as facets, one by one for the boxes of a cut cell. Faces of the grid's box that hold the normal component are
    /// planes of symmetry, and not part of the surface.
    pub(crate) fn facets(
        &self,
        body: &Body,
        shape: &Shape<D>,
        region: Option<&Shape<D>>,
    ) -> Result<Vec<Facet<D>>, CurveError> {
        let (grid, filling) = (&self.grid, self.scene.filling(body));
        let (h, n) = (grid.spacing, u64::from(filling.boxes_at_surface()));
        let edges = Vector::repeat(h / n as f64);
        let (first, count) = around(grid, shape);
        let planes = self.planes_of_symmetry()?;
        let goes_on = |facet: &Facet<D>| {
            let on = |&(k, wall, outward): &(usize, f64, f64)| {
                (facet.position[k] - wall).abs() < SURFACE_DEPTH * h && facet.normal[k] * outward > 0.5
            };
            planes.iter().any(on)
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
        Ok(facets)
    }

    /// The surface of a body from a file. Bodies of the same nodal field are joined to it.
    pub(crate) fn cloud(&self, number: usize) -> Result<Vec<CloudPoint<D>>, BuildError> {
        let (particles, fields) = (&self.particles, self.scene.nodal_fields());
        let body = |p: usize| particles.body[p] as usize;
        let solid = || (0..particles.len()).filter(|&p| particles.is_solid(p));
        let (mut own, others): (Vec<usize>, Vec<usize>) =
            solid().filter(|&p| fields[body(p)] == fields[number]).partition(|&p| body(p) == number);
        let count = own.len();
        own.extend(others);
        let cloud = own.iter().map(|&p| (particles.position[p], particles.volume[p])).collect();
        let planes: Vec<_> = self.planes_of_symmetry()?.into_iter().map(|(k, wall, _)| (k, wall)).collect();
        let points = cloud_surface(cloud, count, &planes).map_err(|NoSurface(p)| {
            let what = format!(
                "the particle at {:?} has no surface that could touch: it lies in a single layer, alone, among much smaller particles, or in an \
                 irregular cloud; give the file particles of about one size, at least three across everywhere, or the body a shape",
                particles.position[own[p]].as_slice()
            );
            BuildError::at(format!("bodies[{number}].particles"), what)
        })?;
        let edge = |p: usize| particles.volume[own[p]].powf(1.0 / D as f64) / self.grid.spacing;
        if let Some(point) = points.iter().find(|point| edge(point.particle) > LARGEST_EDGE) {
            let what = format!(
                "the particle at {:?} has an edge of {:.2} grid spacings, and touches half an edge outside; must be at most {LARGEST_EDGE}: take \
                 smaller particles or a larger grid.spacing",
                particles.position[own[point.particle]].as_slice(),
                edge(point.particle)
            );
            return Err(BuildError::at(format!("bodies[{number}].particles"), what));
        }
        Ok(points.into_iter().map(|point| CloudPoint { particle: own[point.particle], ..point }).collect())
    }

    /// The faces of the grid's box that hold the normal component: their axis, coordinate and the sign of the outward normal.
    fn planes_of_symmetry(&self) -> Result<Vec<(usize, f64, f64)>, CurveError> {
        let grid = &self.grid;
        let mut planes = Vec::new();
        for k in 0..D {
            for (upper, wall, outward) in [(false, grid.origin[k], -1.0), (true, grid.position(grid.cells)[k], 1.0)] {
                if self.scene.boundary.face(k, upper).motion::<D>(k)?[k].is_some() {
                    planes.push((k, wall, outward));
                }
            }
        }
        Ok(planes)
    }
}

impl Scene {
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
        let lumped = self.time.scheme().has_inertia() && self.lumping() > 0.0;
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
            let is_own = |p: &usize| particles.body[*p] as usize == number && particles.is_solid(*p);
            let own = || (0..particles.len()).filter(is_own);
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
}
