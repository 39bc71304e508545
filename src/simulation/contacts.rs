//! Contact with obstacles and between bodies at the end of a step: forces, work, friction loss, and the new states of friction and of free
//! obstacles.

use super::{ContactForces, Simulation, StepError};
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::contact::{
    Carrier, ContactPoint, FreeMotion, Surroundings, Touching, candidates, obstacle_points,
};
use crate::mechanics::loads::{Contacts, Obstacle, PointInContact, Pose, RigidBody};
use crate::mechanics::schemes::Alphas;
use crate::mechanics::sweep::Connectivity;
use crate::mechanics::terms::{ContactForce, Step, penalties};
use crate::parallel;
use crate::tensor::Vector;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Points in one part of the work of a thread.
const POINTS: usize = 128;

/// The changes at all contacts in a step.
#[derive(Debug, Default)]
pub(super) struct ContactUpdate<const D: usize> {
    pub obstacles: Vec<ContactForces<D>>,
    pub pairs: Vec<ContactForces<D>>,
    /// The new anchors of friction, by obstacle.
    anchors: Vec<Vec<Vector<f64, D>>>,
    /// The new slips between bodies, by point and pair.
    slips: BTreeMap<[usize; 2], Vector<f64, D>>,
    /// The points that touch at the end of the step.
    touching: Vec<PointInContact<D>>,
    /// The energy stored in the contact between bodies.
    energy: f64,
    /// The work that friction takes in the step, by obstacle and by pair. A part of it is stored by elastic slip.
    taken: [Vec<f64>; 2],
    /// The new state of every obstacle that moves freely.
    free: Vec<Option<RigidBody<D>>>,
    /// The work of all obstacles in the step.
    pub work: f64,
    /// The friction loss of all contacts in the step.
    pub friction_loss: f64,
}

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// Finds the points that may touch another body in the coming step.
    pub(super) fn find_candidates(&mut self, connectivity: &Connectivity<D>) {
        let Some(mut between) = self.loads.contacts.between.take() else { return };
        let (dt, rate, velocity) = (self.clock.step(), &self.history.rate, &self.particles.velocity);
        let motion = |p: usize| match (velocity.get(p), rate.is_empty()) {
            (Some(v), _) => v * dt,
            (None, false) => connectivity.value_at(p, rate) * dt,
            (None, true) => Vector::zeros(),
        };
        between.candidates = candidates(&self.loads.contacts, &between, &self.particles, &self.grid, motion);
        self.loads.contacts.between = Some(between);
    }

    /// The contact at the end of a step whose nodes move from `before` to `phi` since the last grid reset, with the free obstacles and the
    /// poses of all obstacles there.
    ///
    /// # Errors
    /// A point enters an obstacle or another body too deeply, or goes through it. A free obstacle meets another obstacle.
    pub(super) fn contact_update(
        &self,
        step: &Step<'_, D, L>,
        [before, phi]: [&[Vector<f64, D>]; 2],
        free: Vec<Option<RigidBody<D>>>,
        poses: Vec<Pose<D>>,
    ) -> Result<ContactUpdate<D>, StepError> {
        let contacts = &self.loads.contacts;
        if !contacts.exist() {
            return Ok(ContactUpdate::default());
        }
        // Forces at both ends are those of an instant.
        let alphas = Alphas { discrete_gradient: false, ..step.alphas };
        let end = Step { time: self.load() + self.clock.step(), alphas, ..*step };
        let motion = Motion {
            poses: [self.poses(self.load()), poses],
            positions: self.end_positions(step, phi),
            relative: self.relative_motions(step, phi),
        };
        self.check_paths(&motion)?;
        let mut update = ContactUpdate { free, ..self.untouched(&motion) };
        let at_end = points_at(&end, phi, &motion.poses[1]);
        at_end.iter().for_each(|one| update.add_end(one, contacts, &motion));
        self.check_particles(&motion, [&update.obstacles, &update.pairs])?;
        let at_start = points_at(&Step { time: self.load(), ..end }, before, &motion.poses[0]);
        at_start.iter().for_each(|one| update.add_start(one));
        let mut work = |share, points: &[ContactPoint<f64, D>]| {
            points.iter().for_each(|one| update.add_work(share, one, &motion, &self.ends(one, &motion.positions)));
        };
        if step.alphas.discrete_gradient {
            work(1.0, &points_at(step, &halfway(before, phi), &self.poses(step.time)));
        } else {
            work(0.5, &at_end);
            mutant!("obstacles: the forces at the start of a step do no work": at_start = Vec::new());
            work(0.5, &at_start);
        }
        update.dissipate();
        Ok(update)
    }

    /// The free obstacles at the end of a step whose nodes move from `before` to `phi`. Forces are in balance at a part θ of the step.
    ///
    /// # Errors
    /// Newton's method finds no balance of forces on an obstacle, or the obstacle turns by more than half a turn. The bodies' equations have
    /// then used wrong forces.
    pub(super) fn free_after(
        &self,
        step: &Step<'_, D, L>,
        before: &[Vector<f64, D>],
        phi: &[Vector<f64, D>],
    ) -> Result<Vec<Option<RigidBody<D>>>, StepError> {
        let (contacts, scheme) = (&self.loads.contacts, &self.settings.scheme);
        let force = ContactForce::of(step).filter(|_| contacts.has_free_obstacle());
        let Some(force) = force else { return Ok(vec![None; contacts.obstacles.len()]) };
        let (theta, end) = (scheme.instant(), scheme.end(self.clock.step()));
        let balanced: Vec<_> = before.iter().zip(phi).map(|(before, phi)| before + (phi - before) * theta).collect();
        let after = |(obstacle, motion): (&Obstacle<D>, Option<FreeMotion>)| {
            let (Some(body), Some(motion)) = (&obstacle.free, motion) else { return Ok(None) };
            let refused = || StepError::FreeObstacle { obstacle: obstacle.name.clone() };
            Ok(Some(body.after(&motion.whole(theta).ok_or_else(refused)?, &end)))
        };
        contacts.obstacles.iter().zip(force.free_motions(&balanced)).map(after).collect()
    }

    /// The poses of all obstacles at the time of the end of a step, with the free ones there.
    pub(super) fn poses_after(&self, free: &[Option<RigidBody<D>>], end: f64) -> Vec<Pose<D>> {
        let pose = |(pose, body): (Pose<D>, &Option<RigidBody<D>>)| {
            body.as_ref().map_or(pose, |body| body.pose(&Vector::zeros()))
        };
        self.poses(end).into_iter().zip(free).map(pose).collect()
    }

    /// The update of a step in which nothing touches.
    fn untouched(&self, motion: &Motion<D>) -> ContactUpdate<D> {
        let contacts = &self.loads.contacts;
        let since = |work, friction_loss| ContactForces { work, friction_loss, ..ContactForces::NONE };
        let pairs = contacts.between.iter().flat_map(|between| &between.pairs);
        let anchors = |(one, pose): (&Obstacle<D>, _)| one.anchors_at(pose, &contacts.points, &motion.positions);
        ContactUpdate {
            obstacles: contacts.obstacles.iter().map(|one| since(one.work, one.friction_loss)).collect(),
            taken: [vec![0.0; contacts.obstacles.len()], vec![0.0; pairs.clone().count()]],
            pairs: pairs.map(|pair| since(0.0, pair.friction_loss)).collect(),
            anchors: contacts.obstacles.iter().zip(&motion.poses[1]).map(anchors).collect(),
            ..ContactUpdate::default()
        }
    }

    /// The position of each candidate relative to the other body, at both ends of the step.
    pub(super) fn relative_motions(&self, step: &Step<'_, D, L>, phi: &[Vector<f64, D>]) -> Vec<[Vector<f64, D>; 2]> {
        let (contacts, reference) = (&self.loads.contacts, self.particles.reference().position);
        let candidates = contacts.between.as_ref().map_or(&[][..], |between| &between.candidates);
        let of = |number: usize| {
            let one = &candidates[number];
            let position = |carrier: &Carrier<D>| carrier.position(reference, step.connectivity, phi) * carrier.share;
            [one.start, one.carriers(contacts).iter().map(position).sum()]
        };
        parallel::values_by(POINTS, candidates.len(), of)
    }

    /// The positions of all particles at the end of the step.
    pub(super) fn end_positions(&self, step: &Step<'_, D, L>, phi: &[Vector<f64, D>]) -> Vec<Vector<f64, D>> {
        let mut positions = parallel::copy_of(self.particles.reference().position);
        parallel::zip(&mut positions, &step.connectivity.values(phi), |x, u| *x += u);
        positions
    }

    /// The positions of a point at both ends of the step.
    fn ends(&self, one: &ContactPoint<f64, D>, positions: &[Vector<f64, D>]) -> [Vector<f64, D>; 2] {
        let p = one.carriers[0].particle;
        [self.particles.position[p], positions[p]]
    }

    /// The poses of all obstacles at a time.
    fn poses(&self, time: f64) -> Vec<Pose<D>> {
        self.loads.contacts.obstacles.iter().map(|one| one.pose(time)).collect()
    }

    /// Writes the state of friction, the work and the losses.
    pub(super) fn accept_contacts(&mut self, update: &ContactUpdate<D>) {
        mutant!("obstacles: the state of friction is not kept": { return; });
        let list = self.loads.contacts.obstacles.iter_mut();
        for ((obstacle, contact), anchors) in list.zip(&update.obstacles).zip(&update.anchors) {
            obstacle.anchors.clone_from(anchors);
            (obstacle.work, obstacle.friction_loss) = (contact.work, contact.friction_loss);
        }
        self.loads.contacts.touching.clone_from(&update.touching);
        let free = self.loads.contacts.obstacles.iter_mut().zip(&update.free);
        free.for_each(|(obstacle, body)| obstacle.free.clone_from(body));
        if let Some(between) = &mut self.loads.contacts.between {
            between.slips.clone_from(&update.slips);
            between.energy = update.energy;
            let pairs = between.pairs.iter_mut().zip(&update.pairs);
            pairs.for_each(|(pair, contact)| pair.friction_loss = contact.friction_loss);
        }
    }

    /// The energy stored in the contact with obstacles and between bodies: Σ ½ k (g² + |s|²) A with the elastic slip s.
    pub fn contact_energy(&self) -> f64 {
        let (particles, penalties) = (&self.particles, penalties(&self.bodies, self.grid.spacing));
        let around = Surroundings {
            t: self.load(),
            start: None,
            stiffness: |p: usize| penalties[particles.body[p] as usize],
            position: |carrier: &Carrier<D>| particles.position[carrier.particle],
        };
        let touching = obstacle_points(&self.loads.contacts, &around, &self.poses(self.load()));
        let between = self.loads.contacts.between.as_ref().map_or(0.0, |between| between.energy);
        touching.iter().fold(between, |sum, one| sum + one.stored())
    }
}

/// The motion of obstacles and surfaces in a step.
pub(super) struct Motion<const D: usize> {
    /// The poses of all obstacles at both ends.
    pub poses: [Vec<Pose<D>>; 2],
    /// The positions of all particles at the end.
    pub positions: Vec<Vector<f64, D>>,
    /// The positions of all candidates relative to the other body, at both ends.
    pub relative: Vec<[Vector<f64, D>; 2]>,
}

impl<const D: usize> ContactUpdate<D> {
    /// Adds the force, the area, the depth and the new state of friction of a point at the end of the step.
    fn add_end(&mut self, one: &ContactPoint<f64, D>, contacts: &Contacts<D>, motion: &Motion<D>) {
        let ContactPoint { touching, number, area, pose, law, y, .. } = one;
        let force = one.force();
        let (contact, arm, on_other) = match *touching {
            Touching::Obstacle(obstacle) => {
                if let Some(anchor) = self.anchors[obstacle].get_mut(*number) {
                    *anchor = law.new_anchor(y);
                }
                let arm = pose.rotation * (y - middle(&contacts.obstacles[obstacle]));
                (&mut self.obstacles[obstacle], arm, -force)
            }
            Touching::Pair { pair, is_first, .. } => {
                if law.has_friction() {
                    self.slips.insert([*number, pair], law.elastic_slip(y));
                }
                self.energy += one.stored();
                (
                    &mut self.pairs[pair],
                    motion.positions[one.carriers[0].particle],
                    if is_first { -force } else { force },
                )
            }
        };
        contact.force += on_other;
        contact.moment = add(contact.moment, moment(&arm, &on_other));
        contact.area += area;
        contact.depth = contact.depth.max(law.depth(y));
        let traction = pose.rotation * law.traction(y);
        let (pressure, gap) = (law.pressure(y), -law.depth(y));
        self.touching.push(PointInContact { number: *number, pressure, traction, gap });
        *self.taken(*touching) -= law.slip_energy(y) * area;
    }

    /// Adds the energy that elastic slip has stored at the start of the step.
    fn add_start(&mut self, one: &ContactPoint<f64, D>) {
        *self.taken(one.touching) += one.law.slip_energy(&one.y) * one.area;
    }

    /// The work that friction takes at a contact.
    fn taken(&mut self, touching: Touching) -> &mut f64 {
        let [obstacles, pairs] = &mut self.taken;
        match touching {
            Touching::Obstacle(obstacle) => &mut obstacles[obstacle],
            Touching::Pair { pair, .. } => &mut pairs[pair],
        }
    }

    /// Adds a share of the work of a force in the step: a half for the force at each end, or all for the force in the middle. The point moves
    /// between its `positions` at both ends. Friction takes the work along the motion of the point relative to the obstacle or to the other
    /// body.
    fn add_work(
        &mut self,
        share: f64,
        one: &ContactPoint<f64, D>,
        motion: &Motion<D>,
        positions: &[Vector<f64, D>; 2],
    ) {
        let relative = match one.touching {
            Touching::Obstacle(obstacle) => {
                let [start, end] = [&motion.poses[0][obstacle], &motion.poses[1][obstacle]];
                let work = share * one.force().dot(&(end.to_space(&one.y) - start.to_space(&one.y)));
                self.obstacles[obstacle].work += work;
                self.work += work;
                end.to_frame(&positions[1]) - start.to_frame(&positions[0])
            }
            Touching::Pair { candidate, .. } => motion.relative[candidate][1] - motion.relative[candidate][0],
        };
        *self.taken(one.touching) -= share * one.area * one.law.friction(&one.y).dot(&relative);
    }

    /// Adds the energy that friction dissipates in the step: its work without the part that elastic slip stores. The law dissipates nowhere less
    /// than nothing, and neither do the sums, whose error is that of the trapezoidal rule.
    fn dissipate(&mut self) {
        let contacts = self.obstacles.iter_mut().chain(&mut self.pairs);
        for (contact, taken) in contacts.zip(self.taken.iter().flatten()) {
            let loss = taken.max(0.0);
            mutant!("obstacles: friction loses nothing": loss = 0.0);
            contact.friction_loss += loss;
            self.friction_loss += loss;
        }
    }
}

/// All points in contact at the time of `step`, with the nodal motion `phi` since the last grid reset and the poses of all obstacles.
fn points_at<const D: usize, L: Law>(
    step: &Step<'_, D, L>,
    phi: &[Vector<f64, D>],
    poses: &[Pose<D>],
) -> Vec<ContactPoint<f64, D>> {
    let step = Step { poses: Some(poses), ..*step };
    ContactForce::of(&step).map_or_else(Vec::new, |force| force.contact_points(phi))
}

/// The place that moments on an obstacle are about, in its frame: the centre of mass of a free obstacle, else the middle of its bounding box,
/// or the origin where there is none.
fn middle<const D: usize>(obstacle: &Obstacle<D>) -> Vector<f64, D> {
    if let Some(body) = &obstacle.free {
        return body.center;
    }
    let (min, max) = obstacle.shape.bounding_box();
    let middle = (min + max) * 0.5;
    if middle.iter().all(|x| x.is_finite()) { middle } else { Vector::zeros() }
}

/// r × f; in 2D and 1D only the last component.
fn moment<const D: usize>(arm: &Vector<f64, D>, force: &Vector<f64, D>) -> [f64; 3] {
    let [r, f] = [arm, force].map(|x| Vector3::from_fn(|i, _| if i < D { x[i] } else { 0.0 }));
    r.cross(&f).into()
}

fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] + b[i])
}

/// The motion in the middle of a step.
pub(super) fn halfway<const D: usize>(before: &[Vector<f64, D>], after: &[Vector<f64, D>]) -> Vec<Vector<f64, D>> {
    before.iter().zip(after).map(|(before, after)| (before + after) * 0.5).collect()
}
