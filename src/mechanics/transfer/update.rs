//! Grid-to-particle transfer (eqs. 45, 50–52).

use super::Nodal;
use crate::grid::Grid;
use crate::material::{Law, MaterialState, PLASTIC_STRAIN};
use crate::mechanics::dilatation;
use crate::mechanics::kinematics::{Kinematics, compose};
use crate::mechanics::loads::PrescribedDof;
use crate::mechanics::schemes::Alphas;
use crate::mechanics::smoothing::Smoothing;
use crate::mechanics::sweep::Connectivity;
use crate::mechanics::trial::Trial;
use crate::parallel::{self, First, PART};
use crate::particles::{Body, Particles};
use crate::pooled::{Pool, Pooled};
use crate::space::Space;
use crate::tensor::{Tensor, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::cell::OnceCell;
use std::ops::Range;

/// The changes of velocity and acceleration that prescribed nodes give to the particles in the update.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WallUpdate {
    /// The paper's Algorithm 1 to the letter: a resting wall changes neither velocity nor acceleration of the particles.
    #[default]
    Literal,
    /// The change is the prescribed value at the end of the step less the projected value, before the condition overwrote it.
    Consistent,
}

/// The results of a step at the particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Committed {
    /// The largest ‖½ (F_rᵀ F_r − I)‖, with F_r the deformation since the last grid reset.
    pub strain: f64,
    /// Share of the volume of all bodies with a plastic law that flowed plastically in the step.
    pub yielding: f64,
}

/// The grid-to-particle transfer at the end of a step. The particles stay untouched until [`Self::commit`].
///
/// ```
/// use bfree::mechanics::{smoothing::Smoothing, sweep::Connectivity, transfer::{Nodal, Update, WallUpdate}};
///
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// let mut simulation = scene.build::<2>("scenes".as_ref())?;
/// let (mut particles, dt) = (simulation.particles.clone(), 0.05);
/// let (connectivity, _) = Connectivity::new(&simulation.approximation, &simulation.grid, &particles.position)?;
/// let nodal = Nodal::project(&particles, &connectivity, 1.0)?;
/// // The cylinder flies with v = ½ and meets nothing: Δφ = v Δt at every node.
/// let dphi: Vec<_> = nodal.velocity.iter().map(|v| v * dt).collect();
/// let alphas = simulation.settings.scheme.end(dt);
/// let mut update = Update::new(&alphas, &nodal, &nodal, &[], WallUpdate::Literal, &dphi);
/// update.smooth(&Smoothing::limited(40.0), &particles, &connectivity, &nodal.mass, dt);
/// update.commit(&mut particles, &simulation.bodies, &connectivity, dt);
/// let flown = particles.position[7] - simulation.particles.position[7] - particles.velocity[7] * dt;
/// assert!(flown.norm() < 1e-14);
/// assert!((particles.kinetic_energy() / simulation.particles.kinetic_energy() - 1.0).abs() < 1e-12);
/// assert!(particles.displacement_gradient.iter().all(|h| h.norm() < 1e-13));
/// // The whole step gives the same result.
/// simulation.step()?;
/// let whole = simulation.particles.by_id();
/// assert!(whole.position.iter().zip(&particles.position).all(|(a, b)| (a - b).norm() < 1e-12));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Default)]
pub struct Update<'a, const D: usize> {
    dphi: &'a [Vector<f64, D>],
    /// φ = φ_n + Δφ; `None` right after a grid reset.
    kept: Option<Pooled<Vector<f64, D>>>,
    /// The dilatations of averaged cells in the mixed form; otherwise empty.
    dilatation: Vec<f64>,
    /// Δv and Δa of the nodes; empty without inertia.
    delta_velocity: Pooled<Vector<f64, D>>,
    delta_acceleration: Pooled<Vector<f64, D>>,
    impulses: Vec<f64>,
    /// The change of the particles' v and a by smoothing.
    smoothed: Option<[Pooled<Vector<f64, D>>; 2]>,
    /// The internal variables at the end of the step, by particle.
    memory: Option<Vec<f64>>,
    /// The numbers of [`Changes`], gathered once.
    changes: OnceCell<Pooled<f64>>,
}

/// The changes of this process's particles: Δx and ∇_r φ (by columns) since the last grid reset, and with inertia Δv and Δa of the step.
/// Particles are numbered from the first of this process.
struct Changes<'a, const D: usize> {
    numbers: &'a [f64],
    /// Numbers of a particle.
    count: usize,
}

impl<const D: usize> Changes<'_, D> {
    fn of(&self, own: usize) -> &[f64] {
        &self.numbers[own * self.count..(own + 1) * self.count]
    }

    /// Δx
    fn moved(&self, own: usize) -> Vector<f64, D> {
        Vector::from_column_slice(&self.of(own)[..D])
    }

    /// ∇_r φ
    fn gradient(&self, own: usize) -> Tensor<f64, D> {
        Tensor::from_column_slice(&self.of(own)[D..D + D * D])
    }

    /// Δv for `order` 0, and Δa for 1.
    fn increment(&self, own: usize, order: usize) -> Vector<f64, D> {
        let first = D + D * D + order * D;
        Vector::from_column_slice(&self.of(own)[first..first + D])
    }
}

impl<'a, const D: usize> Update<'a, D> {
    /// The nodal increments. `projected` is the nodal state before the prescribed values were put in, `nodal` the state after.
    ///
    /// a_p += Σ N Δa,  Δa = α₁(Δφ − Δt v_n) − (α₃+1)a_n      (50)
    /// v_p += Σ N Δv,  Δv = α₄(Δφ − Δt v_n) + α₆a_n           (51), both as in [`Alphas`]
    /// x_p += Σ N Δφ                                           (52)
    /// F_p  = (I + Σ Δφ ⊗ ∇_r N) F_p                            (45)
    ///
    /// Between two grid resets, x_p and F_p on the right are those of the last reset, and φ_n + Δφ stands for Δφ in (52) and (45).
    pub fn new(
        alphas: &Alphas,
        projected: &Nodal<D>,
        nodal: &Nodal<D>,
        prescribed: &[PrescribedDof],
        walls: WallUpdate,
        dphi: &'a [Vector<f64, D>],
    ) -> Self {
        let (pool, count) = (nodal.velocity.pool(), nodal.velocity.len());
        let increments = |node: usize| alphas.increments(&dphi[node], &nodal.velocity[node], &nodal.acceleration[node]);
        let mut delta_velocity = pool.made(count, |node| increments(node).0);
        let mut delta_acceleration = pool.made(count, |node| increments(node).1);
        let mut impulses = vec![0.0; prescribed.len()];
        for (dof, impulse) in prescribed.iter().zip(&mut impulses).filter(|_| !nodal.is_static()) {
            let (node, i) = (dof.node, dof.component);
            let (delta_v, delta_a) = (&mut delta_velocity[node][i], &mut delta_acceleration[node][i]);
            let by_forces = *delta_v;
            mutant!("transfer: the blow of a wall contains the forces": by_forces = 0.0);
            let literal = !dof.moving && walls == WallUpdate::Literal;
            mutant!("transfer: moving walls count as resting ones": literal = walls == WallUpdate::Literal);
            (*delta_v, *delta_a) = (0.0, 0.0);
            if !literal {
                *delta_v = dof.step.velocity_end - projected.velocity[node][i];
                *delta_a = dof.step.acceleration_end - projected.acceleration[node][i];
            }
            *impulse = nodal.mass[node] * (*delta_v - by_forces);
        }
        let mut kept = None;
        if !nodal.motion.is_empty() {
            kept = Some(nodal.motion.pool().made(dphi.len(), |node| nodal.moved(node) + dphi[node]));
            mutant!("transfer: the end of a step forgets the motion on a kept grid": { kept = Some(nodal.motion.pool().collect(dphi.iter().copied())); });
        }
        Self { dphi, kept, delta_velocity, delta_acceleration, impulses, ..Self::default() }
    }

    /// The update with dilatations of averaged cells that are unknowns of their own.
    pub(crate) fn with_dilatation(self, dilatation: Vec<f64>) -> Self {
        Self { dilatation, ..self }
    }

    /// The state of the unknowns at the end of the step.
    pub(crate) fn state(&self) -> Trial<'_, f64, D> {
        Trial { phi: self.motion(), dilatation: &self.dilatation }
    }

    /// Applies E to the increments, so that outer nodes follow inner nodes that a wall has changed.
    pub(crate) fn extended(mut self, nodal: &Nodal<D>, space: &Space<D>) -> Self {
        if nodal.is_static() || space.followers().is_empty() {
            return self;
        }
        let mut by_forces = self.delta_velocity.clone();
        space.followers().extend(&mut self.delta_velocity);
        space.followers().extend(&mut self.delta_acceleration);
        // The change of outer nodes that follow a wall node is an impulse of the wall, too.
        let after = &self.delta_velocity;
        parallel::each(&mut by_forces, |node, before| *before = (after[node] - *before) * nodal.mass[node]);
        space.followers().restrict(&mut by_forces);
        for (&(node, component), impulse) in space.prescribed().iter().zip(&mut self.impulses) {
            *impulse += by_forces[node][component];
        }
        self
    }

    /// The local error of the displacement, as Zienkiewicz and Xie (1991) estimate it for Newmark's method: the root of its mean square
    /// over the mass. The error is the difference to Taylor's series with the third derivative ȧ = Δa/Δt: e = c Δt² Δa, exact to leading
    /// order in Δt. The `constant` c is that of the scheme, β − 1/6 for Newmark. A resting wall that leaves the particles' acceleration
    /// alone adds no error, and neither does smoothing.
    pub(crate) fn local_error(
        &self,
        particles: &Particles<D>,
        connectivity: &Connectivity<D>,
        constant: f64,
        dt: f64,
    ) -> f64 {
        let mass = &particles.mass;
        let mut squares = 0.0;
        if !self.delta_acceleration.is_empty() {
            let changes = &*connectivity.values(&self.delta_acceleration);
            squares = parallel::sum(mass.len(), |p| mass[p] * changes[p].norm_squared());
        }
        constant.abs() * dt * dt * (squares / parallel::sum(mass.len(), |p| mass[p])).sqrt()
    }

    /// Stores the change of the particles' present v and a by `smoothing`; `mass` is the lumped mass of the nodes.
    pub fn smooth(
        &mut self,
        smoothing: &Smoothing,
        particles: &Particles<D>,
        connectivity: &Connectivity<D>,
        mass: &[f64],
        dt: f64,
    ) {
        if self.delta_velocity.is_empty() {
            return;
        }
        let at_kinks = smoothing.shares_at_kinks(particles, connectivity, mass, dt);
        let change = |field| smoothing.change(particles, connectivity, mass, at_kinks.as_deref(), field, dt);
        self.smoothed = Some([&particles.velocity, &particles.acceleration].map(|field| change(field)));
        mutant!("transfer: smoothing takes the velocity for the acceleration": { self.smoothed = Some([&particles.velocity; 2].map(|field| change(field))); });
    }

    /// m_I (Δv − Δv_Newmark) at every prescribed degree of freedom. A wall gives this momentum, beyond the reactions, to nodes that do not
    /// move with the wall yet.
    pub(crate) fn impulses(&self) -> &[f64] {
        &self.impulses
    }

    /// φ, the nodal motion since the last grid reset.
    pub(crate) fn motion(&self) -> &[Vector<f64, D>] {
        self.kept.as_deref().unwrap_or(self.dphi)
    }

    /// The nodal state at the end of the step, without the mass, from the state `projected`.
    pub(crate) fn end(&self, projected: &Nodal<D>, pool: &Pool) -> Nodal<D> {
        let sum = |field: &[Vector<f64, D>], delta: &[Vector<f64, D>]| {
            pool.made(field.len(), |node| field[node] + delta[node])
        };
        Nodal {
            velocity: sum(&projected.velocity, &self.delta_velocity),
            acceleration: sum(&projected.acceleration, &self.delta_acceleration),
            motion: pool.copy_of(self.motion()),
            out_of_balance: projected.out_of_balance.clone(),
            ..Nodal::default()
        }
    }

    /// Δφ/Δt
    pub(crate) fn rate(&self, dt: f64, pool: &Pool) -> Pooled<Vector<f64, D>> {
        let dphi = self.dphi;
        pool.made(dphi.len(), |node| dphi[node] / dt)
    }

    /// The changes of this process's particles.
    fn changes(&self, connectivity: &Connectivity<D>) -> Changes<'_, D> {
        let fields: [&[Vector<f64, D>]; 2] = [&self.delta_velocity, &self.delta_acceleration];
        let more = if self.delta_velocity.is_empty() { &[] } else { &fields[..] };
        let numbers = self.changes.get_or_init(|| connectivity.own_motions(self.motion(), more));
        Changes { numbers, count: D + D * D + more.len() * D }
    }

    /// The particle with the smallest id of those that would leave the grid: its id, and its position outside.
    pub(crate) fn leaving(
        &self,
        particles: &Particles<D>,
        connectivity: &Connectivity<D>,
        grid: &Grid<D>,
    ) -> Option<(usize, Vector<f64, D>)> {
        let (own, changes) = (connectivity.own_particles(), self.changes(connectivity));
        let (position, id) = (&particles.reference().position[own.clone()], &particles.id[own]);
        let first = parallel::collect(parallel::parts(id.len()), &|own: Range<usize>| {
            let ends = own.map(|p| (id[p] as usize, position[p] + changes.moved(p)));
            ends.filter(|(_, x)| !grid.contains(x)).min_by_key(|(id, _)| *id)
        });
        let first = first.into_iter().flatten().min_by_key(|(id, _)| *id);
        connectivity.processes().told(&first).into_iter().flatten().min_by_key(|(id, _)| *id)
    }

    /// Evaluates the internal variables at the end of the step, which [`Self::commit`] then writes. Returns the id of the first particle of
    /// which they, or the energy, are no numbers. Only laws with internal variables and bodies that average their dilatation can have such
    /// particles: of all others, the residual has evaluated the stress there.
    pub(crate) fn remember<L: Law>(
        &mut self,
        particles: &Particles<D>,
        bodies: &[Body<L>],
        connectivity: &Connectivity<D>,
        dt: f64,
    ) -> Option<usize> {
        let variable_count = particles.variable_count;
        // The internal variables of the particles of this process, by their local index.
        let (mut next, undefined) = (parallel::copy_of(&particles.memory), First::none());
        if variable_count > 0 || !particles.dilatation.is_empty() {
            let (own, changes) = (connectivity.own_particles(), self.changes(connectivity));
            let update = |p: usize, next: &mut [f64]| {
                let law = &bodies[particles.body[p] as usize].law;
                let memory = particles.state(p, dt).internal;
                let h = Kinematics(particles).displacement_gradient(p, &changes.gradient(p - own.start));
                let (at, det_f) = MaterialState::new(h).admissible_or_rest();
                law.update_variables(&at.in_step(dt, memory), next);
                let energy = if law.has_potential() { law.energy(&at.in_step(0.0, next)) } else { 0.0 };
                let is_defined = det_f > 0.0 && energy.is_finite() && next.iter().all(|one| one.is_finite());
                if !is_defined && particles.is_solid(p) {
                    undefined.keep(particles.id[p] as usize, ());
                }
            };
            let mut left = &mut next[particles.local_index(own.start) * variable_count..];
            let part = |first: usize| {
                let particles = first..own.end.min(first + PART);
                Some((particles.clone(), left.split_off_mut(..particles.len() * variable_count)?))
            };
            let parts = own.clone().step_by(PART).filter_map(part);
            parallel::for_each(parts, &|(particles, mut next): (Range<usize>, &mut [f64])| {
                for p in particles {
                    next.split_off_mut(..variable_count).into_iter().for_each(|next| update(p, next));
                }
            });
            if particles.are_whole() {
                connectivity.share_particles(variable_count, &mut next);
            }
        }
        self.memory = Some(next);
        undefined.anywhere(connectivity.processes()).map(|(particle, ())| particle)
    }

    /// Writes the new state to the particles, once per step. No other code of a step changes positions, deformations or internal variables.
    pub fn commit<L: Law>(
        mut self,
        particles: &mut Particles<D>,
        bodies: &[Body<L>],
        connectivity: &Connectivity<D>,
        dt: f64,
    ) -> Committed {
        particles.dilatation = dilatation::after(particles, bodies, connectivity, self.state());
        if self.memory.is_none() {
            self.remember(particles, bodies, connectivity, dt);
        }
        let next = self.memory.take().unwrap_or_default();
        let yielding = yielding(particles, bodies, connectivity, &next);
        particles.memory = next;
        let strain = self.move_particles(particles, connectivity);
        // Without inertia there are no increments.
        if !self.delta_velocity.is_empty() {
            let (own, changes) = (connectivity.own_particles(), self.changes(connectivity));
            let (here, whole) =
                (particles.local_index(own.start)..particles.local_index(own.end), particles.are_whole());
            let fields = [&mut particles.velocity, &mut particles.acceleration];
            for (order, field) in fields.into_iter().enumerate() {
                let smoothed = self.smoothed.as_ref().map(|smoothed| &smoothed[order][own.clone()]);
                parallel::each(&mut field[here.clone()], |p, field| {
                    let delta = changes.increment(p, order);
                    *field += smoothed.map_or(delta, |smoothed| delta + smoothed[p]);
                });
                if whole {
                    connectivity.share_particles(D, bytemuck::cast_slice_mut(field));
                }
            }
        }
        Committed { strain, yielding }
    }

    /// Writes x = x_r + Δx and F = (I + ∇_r φ) F_r. Returns the largest strain since the last grid reset.
    fn move_particles(&self, particles: &mut Particles<D>, connectivity: &Connectivity<D>) -> f64 {
        let (own, changes) = (connectivity.own_particles(), self.changes(connectivity));
        let (here, whole) = (particles.local_index(own.start)..particles.local_index(own.end), particles.are_whole());
        let Particles { position, displacement_gradient, reference, .. } = particles;
        let (first, reference) = ([own.start, here.start], reference.as_ref());
        let (x, h) = (&mut position[own], &mut displacement_gradient[here]);
        let parts = x.chunks_mut(PART).zip(h.chunks_mut(PART)).enumerate();
        let strains = parallel::collect(parts, &|(part, (x, h)): (usize, Part<'_, D>)| {
            let own = part * PART..part * PART + x.len();
            if let Some(reference) = reference {
                let [of_all, of_here] = first.map(|first| first + own.start..first + own.end);
                x.copy_from_slice(&reference.position[of_all]);
                h.copy_from_slice(&reference.displacement_gradient[of_here]);
            }
            let mut largest = 0.0_f64;
            for ((x, h), p) in x.iter_mut().zip(h).zip(own) {
                let g = changes.gradient(p);
                largest = largest.max((g + g.transpose() + g.transpose() * g).norm() * 0.5);
                *x += changes.moved(p);
                *h = compose(&g, h);
            }
            largest
        });
        connectivity.share_particles(D, bytemuck::cast_slice_mut(position));
        if whole {
            connectivity.share_particles(D * D, bytemuck::cast_slice_mut(displacement_gradient));
        }
        let largest = connectivity.processes().told(&strains.into_iter().fold(0.0, f64::max));
        let largest = largest.into_iter().fold(0.0, f64::max);
        mutant!("transfer: no strain resets the grid": largest = 0.0);
        largest
    }
}

/// x and H of a part of the particles.
type Part<'a, const D: usize> = (&'a mut [Vector<f64, D>], &'a mut [Tensor<f64, D>]);

/// The share of the volume of bodies with a plastic law in which the plastic strain grows to that of the memory `next`.
fn yielding<const D: usize, L: Law>(
    particles: &Particles<D>,
    bodies: &[Body<L>],
    connectivity: &Connectivity<D>,
    next: &[f64],
) -> f64 {
    let place = |body: &Body<L>| body.law.internal_variables().iter().position(|one| one.name == PLASTIC_STRAIN);
    let plastic_strain: Vec<Option<usize>> = bodies.iter().map(place).collect();
    if plastic_strain.iter().all(Option::is_none) {
        return 0.0;
    }
    let place = |p: usize| plastic_strain[particles.body[p] as usize];
    let yields = particles.parts.everywhere(connectivity.processes(), |p| {
        let variable = place(p).map(|place| particles.local_index(p) * particles.variable_count + place);
        u8::from(variable.is_some_and(|variable| next[variable] > particles.memory[variable]))
    });
    let (mut plastic, mut yielding) = (0.0, 0.0);
    for (p, volume) in particles.volume.iter().enumerate().filter(|(p, _)| place(*p).is_some()) {
        plastic += volume;
        yielding += if yields(p) > 0 { *volume } else { 0.0 };
    }
    if plastic > 0.0 { yielding / plastic } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_third_derivative_is_the_difference_to_taylors_series() -> Result<(), Box<dyn std::error::Error>> {
        use crate::mechanics::schemes::Newmark;
        let scene = crate::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
        let simulation = scene.build::<2>("scenes".as_ref())?;
        let (particles, dt) = (&simulation.particles, 0.05);
        let (connectivity, nodes) =
            Connectivity::new(&simulation.approximation, &simulation.grid, &particles.position)?;
        let (nodal, newmark) = (Nodal::at_rest(particles, &connectivity), Newmark::default());
        // From rest to the acceleration a within the step: Δφ = β Δt² a, and a third derivative a/Δt.
        let (a, beta) = (Vector::from([3.0, 4.0]), newmark.beta);
        let dphi = vec![a * (beta * dt * dt); nodes.len()];
        let update = Update::new(&newmark.alphas(dt), &nodal, &nodal, &[], WallUpdate::Literal, &dphi);
        let error = update.local_error(particles, &connectivity, beta - 1.0 / 6.0, dt);
        assert!((error / ((beta - 1.0 / 6.0) * dt * dt * a.norm()) - 1.0).abs() < 1e-12);
        Ok(())
    }
}
