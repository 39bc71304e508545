//! The particles: structure of arrays, and the bodies they belong to.

use crate::material::{Law, MaterialState, VolumeResponse};
use crate::parallel::{self, Change, Parts, Processes};
use crate::pooled::{Element, Pool};
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The change of volume in the energy of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Dilatation {
    /// The change of volume of each particle.
    #[default]
    Pointwise,
    /// The mean over the particles in a cell of the grid. It keeps a nearly incompressible body from locking. For laws whose energy has a
    /// part that depends on the volume alone; not for `st_venant_kirchhoff`, `drucker_prager`, and laws
    /// from libraries.
    MeanDilatation,
}

/// A body: a law and a density shared by its particles.
#[derive(Clone, Debug)]
pub struct Body<L> {
    /// Name, for messages and output.
    pub name: String,
    /// The constitutive law.
    pub law: L,
    /// Mass per reference volume, ρ₀.
    pub density: f64,
    /// The change of volume in its energy. For a law without [`Law::volumetric`] it is always pointwise.
    pub dilatation: Dilatation,
    /// The nodal field in which the body moves, from 0. Bodies of one field stick to each other where they share nodes.
    pub field: u32,
}

impl<L: Law> Body<L> {
    /// Whether the change of volume is averaged.
    pub(crate) fn averages(&self) -> bool {
        self.dilatation == Dilatation::MeanDilatation && self.response(0.0).is_some()
    }

    /// The response of the law to the volume ratio 1 + `change`.
    pub(crate) fn response<T: Real>(&self, change: T) -> Option<VolumeResponse<T>> {
        self.law.volumetric(&Deformation::new(Tensor::<T, 1>::from_element(change)))
    }

    /// The effect of the mean dilatation θ = 1 + `change` at a particle of volume ratio J = 1 + `j`. The energy per reference volume grows
    /// by U(θ) − U(J), and each normal component of the Cauchy stress by U'(θ) − U'(J). Both are zero if the dilatation is pointwise.
    pub(crate) fn averaged(&self, change: f64, j: f64) -> [f64; 2] {
        if self.dilatation == Dilatation::Pointwise {
            return [0.0; 2];
        }
        let of = |x: f64| self.response(x).map_or([0.0; 2], |of| [of.energy, of.stress / (1.0 + x)]);
        let (mean, own) = (of(change), of(j));
        [mean[0] - own[0], mean[1] - own[1]]
    }
}

/// State of all particles, and of the points of loaded surfaces, at the last converged step. Each array has one entry per particle. Without
/// inertia the arrays of velocity and acceleration are empty.
///
/// Particles lie in memory nearly in the order of the loop over cells, and a step may rearrange them. The `id` identifies a particle in
/// results, probes and messages.
///
/// After a step of several processes, the arrays v, a, H and `memory` may hold the particles of this process alone, until
/// [`Simulation::collect_particles`](crate::simulation::Simulation::collect_particles).
///
/// ```
/// use bfree::particles::Particles;
/// use bfree::tensor::Vector;
///
/// // Two particles that meet: Σ ½ m v·v = p·p/(2M) + ½ (m₁m₂/M) |v₁ − v₂|²   (König)
/// let mut particles = Particles::<1>::default();
/// assert!(particles.is_empty());
/// particles.push(Vector::from([0.0]), Vector::from([2.0]), 1.0, 3.0, 0);
/// particles.push(Vector::from([4.0]), Vector::from([-4.0]), 1.0, 1.0, 0);
/// assert_eq!((particles.len(), particles.momentum()), (2, Vector::from([2.0])));
/// let (mass, reduced, relative) = (4.0, 0.75, 6.0);
/// let of_center = particles.momentum().norm_squared() / (2.0 * mass);
/// assert_eq!(particles.kinetic_energy(), of_center + 0.5 * reduced * relative * relative);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Particles<const D: usize> {
    /// Position x.
    pub position: Vec<Vector<f64, D>>,
    /// Velocity v.
    pub velocity: Vec<Vector<f64, D>>,
    /// Acceleration a.
    pub acceleration: Vec<Vector<f64, D>>,
    /// H = F − I, so that small strains lose no digits.
    pub displacement_gradient: Vec<Tensor<f64, D>>,
    /// Reference volume V₀ (length in 1D, area in 2D: per unit of the missing dimensions).
    pub volume: Vec<f64>,
    /// Mass m = ρ₀ V₀.
    pub mass: Vec<f64>,
    /// Index of the body in the simulation's list.
    pub body: Vec<u32>,
    /// Number of the particle in the order of creation, from 0.
    pub id: Vec<u32>,
    /// Internal variables of the laws: [`Self::variable_count`] numbers a particle, one particle after the other.
    pub memory: Vec<f64>,
    /// The largest number of internal variables of any law; 0 if all laws are elastic.
    pub variable_count: usize,
    /// θ − 1 in bodies whose change of volume is averaged, 0 in other bodies. Empty if no body averages it.
    pub dilatation: Vec<f64>,
    /// The configuration of the last grid reset; `None` if the coming step resets the grid.
    pub(crate) reference: Option<Configuration<D>>,
    /// The outlines of the undeformed bodies in the plane, for pictures. Empty if a body has no outline.
    pub(crate) outlines: Vec<Outline<D>>,
    /// The particles of each process.
    pub(crate) parts: Parts,
}

/// A closed line around an undeformed body of the plane, or around a hole in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Outline<const D: usize> {
    /// Index of the body in the simulation's list.
    pub body: u32,
    /// The corners. The body lies at the left of the line.
    pub corners: Vec<Vector<f64, D>>,
}

/// Positions and deformations of all particles in one configuration.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Configuration<const D: usize> {
    /// x
    pub position: Vec<Vector<f64, D>>,
    /// H = F − I
    pub displacement_gradient: Vec<Tensor<f64, D>>,
    /// θ − 1; empty if no body averages its change of volume.
    pub dilatation: Vec<f64>,
}

/// The particles in the reference configuration of the nodal motion φ, that of the last grid reset. The volumes V₀ belong to the undeformed
/// bodies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reference<'a, const D: usize> {
    /// x
    pub position: &'a [Vector<f64, D>],
    /// H = F − I of the particles of this process.
    displacement_gradient: &'a [Tensor<f64, D>],
    parts: &'a Parts,
    dilatation: &'a [f64],
    volume: &'a [f64],
}

impl<'a, const D: usize> Reference<'a, D> {
    /// H = F − I of the particle at index `p`.
    #[inline(always)]
    pub(crate) fn displacement_gradient(&self, p: usize) -> &'a Tensor<f64, D> {
        &self.displacement_gradient[self.parts.local_index(p)]
    }

    /// θ − 1 of the particle at index `p`.
    pub(crate) fn dilatation(&self, p: usize) -> f64 {
        self.dilatation.get(p).copied().unwrap_or(0.0)
    }

    /// V₀ J of the particle at index `p`.
    pub(crate) fn volume(&self, p: usize) -> f64 {
        self.volume[p] * Deformation::new(*self.displacement_gradient(p)).jacobian
    }
}

impl<const D: usize> Particles<D> {
    /// Bytes of one particle in the arrays of every run: x, H, volume, mass, body and id.
    pub const BYTES: usize =
        size_of::<Vector<f64, D>>() + size_of::<Tensor<f64, D>>() + 2 * size_of::<f64>() + 2 * size_of::<u32>();

    /// Number of particles.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// Whether there are no particles.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// Makes room for exactly `more` particles, because an array that doubles needs three times its size for a moment. The arrays of
    /// velocity and acceleration grow with the first particle that has inertia.
    pub(crate) fn reserve(&mut self, more: usize) {
        let Self { position, displacement_gradient, volume, mass, body, id, .. } = self;
        position.reserve_exact(more);
        displacement_gradient.reserve_exact(more);
        [volume, mass].into_iter().for_each(|array| array.reserve_exact(more));
        [body, id].into_iter().for_each(|array| array.reserve_exact(more));
    }

    /// Adds an undeformed particle with zero acceleration.
    pub fn push(&mut self, position: Vector<f64, D>, velocity: Vector<f64, D>, volume: f64, mass: f64, body: u32) {
        self.push_without_inertia(position, volume, mass, body);
        self.velocity.push(velocity);
        self.acceleration.push(Vector::zeros());
    }

    /// Adds an undeformed particle without inertia. Only gravity acts on its mass.
    ///
    /// ```
    /// use bfree::particles::Particles;
    /// use bfree::tensor::Vector;
    ///
    /// let mut particles = Particles::<2>::default();
    /// for i in 0..100 {
    ///     particles.push_without_inertia(Vector::from([f64::from(i), 0.0]), 0.5, 2.0, 0);
    /// }
    /// // The particles have weight, and do not move.
    /// assert_eq!((particles.len(), particles.mass.iter().sum::<f64>()), (100, 200.0));
    /// assert!(particles.velocity.is_empty() && particles.kinetic_energy() == 0.0);
    /// ```
    pub fn push_without_inertia(&mut self, position: Vector<f64, D>, volume: f64, mass: f64, body: u32) {
        self.reference = None;
        self.id.push(self.len() as u32);
        self.position.push(position);
        self.displacement_gradient.push(Tensor::zeros());
        self.volume.push(volume);
        self.mass.push(mass);
        self.body.push(body);
    }

    /// Adds a particle without volume that has the state of the particle at the place `p`. Returns its place.
    pub(crate) fn push_copy(&mut self, p: usize) -> usize {
        let new = self.len();
        self.push_without_inertia(self.position[p], 0.0, 0.0, self.body[p]);
        self.displacement_gradient[new] = self.displacement_gradient[p];
        for vectors in [&mut self.velocity, &mut self.acceleration] {
            vectors.extend(vectors.get(p).copied());
        }
        self.dilatation.extend(self.dilatation.get(p).copied());
        self.memory.extend_from_within(p * self.variable_count..(p + 1) * self.variable_count);
        new
    }

    /// Keeps the particles at the first `count` places.
    pub(crate) fn truncate(&mut self, count: usize) {
        let Self { position, velocity, acceleration, displacement_gradient, volume, mass, body, id, memory, .. } = self;
        [position, velocity, acceleration].into_iter().for_each(|vectors| vectors.truncate(count));
        displacement_gradient.truncate(count);
        [volume, mass, &mut self.dilatation].into_iter().for_each(|numbers| numbers.truncate(count));
        [body, id].into_iter().for_each(|numbers| numbers.truncate(count));
        memory.truncate(count * self.variable_count);
    }

    /// The reference configuration of the nodal motion φ: that of the last grid reset, or the present one if the coming step resets the
    /// grid.
    #[inline(always)]
    pub(crate) fn reference(&self) -> Reference<'_, D> {
        let (position, displacement_gradient, dilatation) = match &self.reference {
            None => (&self.position, &self.displacement_gradient, &self.dilatation),
            Some(stored) => (&stored.position, &stored.displacement_gradient, &stored.dilatation),
        };
        Reference { position, displacement_gradient, parts: &self.parts, dilatation, volume: &self.volume }
    }

    /// Stores the present configuration as the reference configuration, unless there is one.
    pub(crate) fn store_reference(&mut self) {
        if self.reference.is_none() {
            self.reference = Some(Configuration {
                position: parallel::copy_of(&self.position),
                displacement_gradient: parallel::copy_of(&self.displacement_gradient),
                dilatation: parallel::copy_of(&self.dilatation),
            });
        }
    }

    /// The state at t_n of the particle at the place `p` in memory, for a step of length `dt`.
    #[inline(always)]
    pub fn state(&self, p: usize, dt: f64) -> MaterialState<'_, f64, D> {
        let here = self.local_index(p);
        let internal = &self.memory[here * self.variable_count..(here + 1) * self.variable_count];
        MaterialState::new(self.displacement_gradient[here]).in_step(dt, internal)
    }

    /// Calls [`Self::set_internal_to_rest`] if a law has more internal variables than there is room for. Bodies set up in code need it.
    pub(crate) fn make_room_for_internal<L: Law>(&mut self, bodies: &[Body<L>]) {
        if bodies.iter().any(|body| body.law.internal_variables().len() > self.variable_count) {
            self.set_internal_to_rest(bodies);
        }
        if bodies.iter().any(Body::averages) {
            self.dilatation.resize(self.len(), 0.0);
        }
    }

    /// θ − 1 of the particle at the place `p`.
    pub(crate) fn dilatation(&self, p: usize) -> f64 {
        self.dilatation.get(p).copied().unwrap_or(0.0)
    }

    /// Sets the internal variables of every particle to the values at rest of its law.
    pub(crate) fn set_internal_to_rest<L: Law>(&mut self, bodies: &[Body<L>]) {
        self.variable_count = bodies.iter().map(|body| body.law.internal_variables().len()).max().unwrap_or(0);
        let width = self.variable_count;
        let at_rest = |&body: &u32| {
            let names = bodies[body as usize].law.internal_variables().iter().map(|one| one.at_rest);
            names.chain(std::iter::repeat(0.0)).take(width)
        };
        self.memory = self.body.iter().flat_map(at_rest).collect();
        self.dilatation.clear();
        if bodies.iter().any(Body::averages) {
            self.dilatation.resize(self.len(), 0.0);
        }
    }

    /// The places of the particles in memory, by id.
    ///
    /// Example: [`Self::rearrange`].
    pub fn places(&self) -> Vec<u32> {
        let mut places = vec![0; self.len()];
        for (place, &id) in self.id.iter().enumerate() {
            places[id as usize] = place as u32;
        }
        places
    }

    /// The place of the particle `id` in memory.
    ///
    /// Example: [`Self::rearrange`].
    pub fn place(&self, id: usize) -> Option<usize> {
        self.id.iter().position(|&one| one as usize == id)
    }

    /// The same particles in the order of their ids. This process must have all of them.
    ///
    /// Example: [`Self::rearrange`].
    pub fn by_id(&self) -> Self {
        let mut sorted = self.clone();
        sorted.parts = Parts::default();
        sorted.rearrange(&self.places());
        sorted
    }

    /// Moves the particle at `order[i]` to the place `i`; `order` must be a permutation.
    ///
    /// ```
    /// use bfree::particles::Particles;
    /// use bfree::tensor::Vector;
    ///
    /// let mut particles = Particles::<1>::default();
    /// for i in 0..3 {
    ///     particles.push(Vector::from([f64::from(i)]), Vector::zeros(), 1.0, 1.0, 0);
    /// }
    /// particles.rearrange(&[2, 0, 1]);
    /// assert_eq!((particles.position[0][0], particles.place(2)), (2.0, Some(0)));
    /// assert_eq!(particles.places(), [1, 2, 0]);
    /// assert_eq!(particles.by_id().position.iter().map(|x| x[0]).collect::<Vec<_>>(), [0.0, 1.0, 2.0]);
    /// ```
    pub fn rearrange(&mut self, order: &[u32]) {
        self.rearrange_in(order, &Pool::default(), true);
    }

    /// [`Self::rearrange`] with memory of a pool for one array at a time. Arrays that a process may have of its own particles alone are moved only
    /// if they are `whole`; otherwise [`Self::share_out`] moves them.
    pub(crate) fn rearrange_in(&mut self, order: &[u32], pool: &Pool, whole: bool) {
        let Self {
            position, velocity, acceleration, displacement_gradient, volume, mass, body, id, dilatation, ..
        } = self;
        permute(position, 1, order, pool);
        [volume, mass, dilatation].into_iter().for_each(|numbers| permute(numbers, 1, order, pool));
        for numbers in [body, id] {
            let before = parallel::copy_of(numbers);
            parallel::each(numbers, |place, number| *number = before[order[place] as usize]);
        }
        if whole {
            [velocity, acceleration].into_iter().for_each(|vectors| permute(vectors, 1, order, pool));
            permute(displacement_gradient, 1, order, pool);
            permute(&mut self.memory, self.variable_count, order, pool);
        }
        if let Some(Configuration { position, displacement_gradient, dilatation }) = &mut self.reference {
            permute(position, 1, order, pool);
            if whole {
                permute(displacement_gradient, 1, order, pool);
            }
            mutant!("mean dilatation: means of a kept grid stay where particles were": { return; });
            permute(dilatation, 1, order, pool);
        }
    }

    /// Whether this process has v, a, H and the internal variables of all particles at all times.
    pub(crate) fn are_whole(&self) -> bool {
        self.parts.are_whole()
    }

    /// Whether this process has v, a, H and the internal variables of all particles now.
    pub(crate) fn are_all_here(&self) -> bool {
        self.displacement_gradient.len() == self.len()
    }

    /// The index of a particle of this process in the arrays of v, a and H.
    #[inline(always)]
    pub(crate) fn local_index(&self, p: usize) -> usize {
        self.parts.local_index(p)
    }

    /// Changes the arrays that a process may have of its own particles alone.
    fn change(&mut self, (change, after): (impl Change, Parts)) {
        [&mut self.velocity, &mut self.acceleration].into_iter().for_each(|vectors| change.apply(vectors, 1));
        change.apply(&mut self.displacement_gradient, 1);
        change.apply(&mut self.memory, self.variable_count);
        if let Some(Configuration { displacement_gradient, .. }) = &mut self.reference {
            change.apply(displacement_gradient, 1);
        }
        self.parts = after;
    }

    /// Lets each process have the particles between its two `bounds`, after [`Self::rearrange_in`] has put all other arrays into this order.
    pub(crate) fn share_out(&mut self, order: Option<&[u32]>, bounds: Vec<usize>, processes: &Processes) {
        self.change(self.parts.moved(order, bounds, processes));
    }

    /// Fills in the particles of other processes in process 0, which has them until its next step.
    pub(crate) fn collect(&mut self, processes: &Processes) {
        self.keep_own(processes);
        if !self.are_whole() {
            let parts = self.parts.clone();
            self.change(parts.collected(processes));
        }
    }

    /// Lets every process have all particles.
    pub(crate) fn join(&mut self, processes: &Processes) {
        self.keep_own(processes);
        if !self.are_whole() {
            let parts = self.parts.clone();
            self.change(parts.joined(processes));
        }
    }

    /// Forgets the particles of other processes.
    pub(crate) fn keep_own(&mut self, processes: &Processes) {
        if !self.are_whole() {
            self.change(self.parts.kept(processes));
        }
    }

    /// Σ m v
    pub fn momentum(&self) -> Vector<f64, D> {
        self.mass.iter().zip(&self.velocity).map(|(&m, v)| v * m).sum()
    }

    /// Whether the particle at the place `p` has a volume. A point of a loaded surface has none: it moves with the body and gives the load
    /// its position.
    pub fn is_solid(&self, p: usize) -> bool {
        self.volume[p] > 0.0
    }

    /// The places in memory of the particles that have a volume, by id.
    ///
    /// ```
    /// // A body, and the points of its loaded end.
    /// let scene = bfree::scene::read_file("scenes/cantilever.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, points) = (&simulation.particles, simulation.loads.surface[0].points.len());
    /// assert_eq!(particles.solid_places().len() + points, particles.len());
    /// assert!(!particles.is_solid(simulation.loads.surface[0].points[0].particle));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn solid_places(&self) -> Vec<u32> {
        let mut places = self.places();
        places.retain(|&p| self.is_solid(p as usize));
        places
    }

    /// V₀ J, the present volume of a particle.
    pub(crate) fn present_volume(&self, p: usize) -> f64 {
        self.volume[p] * Deformation::new(self.displacement_gradient[self.local_index(p)]).jacobian
    }

    /// Σ ½ m v·v
    pub fn kinetic_energy(&self) -> f64 {
        let energies = self.mass.iter().zip(&self.velocity).map(|(&m, v)| 0.5 * m * v.norm_squared());
        // The `sum` of an empty iterator would be −0.
        energies.fold(0.0, |sum, energy| sum + energy)
    }
}

/// Moves the row at `order[i]` to the place `i`, in an array of rows of `width` elements or in an empty one.
fn permute<T: Element>(array: &mut [T], width: usize, order: &[u32], pool: &Pool) {
    if array.is_empty() {
        return;
    }
    let mut moved = pool.unspecified(array.len());
    parallel::rows(&mut moved, width, |place, row| {
        let from = order[place] as usize * width;
        row.copy_from_slice(&array[from..from + width]);
    });
    parallel::copy(&moved, array);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_configuration_at_the_last_grid_reset_goes_with_the_particles() {
        let mut particles = Particles::<1>::default();
        [0.1, 0.2].into_iter().for_each(|x| particles.push_without_inertia(Vector::from([x]), 1.0, 1.0, 0));
        let at_reset = |position: [f64; 2], dilatation: [f64; 2]| Configuration {
            position: position.map(|x| Vector::from([x])).to_vec(),
            displacement_gradient: position.map(Tensor::from_element).to_vec(),
            dilatation: dilatation.to_vec(),
        };
        particles.reference = Some(at_reset([0.3, 0.4], [0.5, 0.6]));
        particles.rearrange(&[1, 0]);
        assert_eq!(particles.id, [1, 0]);
        assert_eq!(particles.reference, Some(at_reset([0.4, 0.3], [0.6, 0.5])));
    }
}
