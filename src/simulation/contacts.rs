//! Contact with obstacles and between bodies at the end of a step: forces, work, friction loss, and the new state of friction.

use super::work::halfway;
use super::{Simulation, StepError};
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::contact::{Carrier, ContactPoint, Response, Surroundings, Touching, obstacle_points};
use crate::mechanics::facing::{DEEPEST, Overlap, REACH, facing, overlaps};
use crate::mechanics::free_obstacle::FreeMotion;
use crate::mechanics::loads::{Contacts, Facing, Obstacle, Pose, RigidBody};
use crate::mechanics::schemes::Alphas;
use crate::mechanics::terms::{ContactForce, Step, penalties};
use crate::shape::Shape;
use crate::tensor::Vector;
use nalgebra::Vector3;
use std::collections::HashMap;

/// A point may enter an obstacle or another body in one step by this many spacings at most. A longer step is repeated with half its length.
const DEEPEST_ENTRY: f64 = 0.25;

/// The path of a point in a step is tested for obstacles at places this far apart, in spacings, and at this many places at most.
const SAMPLED: f64 = 0.05;
const MOST_SAMPLES: f64 = 1000.0;

/// The contact of all bodies with one obstacle, or of a pair of bodies, at the end of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactForces<const D: usize> {
    /// The force on the obstacle, or on the second body of the pair, at t_{n+1}.
    pub force: Vector<f64, D>,
    /// The moment of the force. In 2D the moment is the last component. For an obstacle, it is about the middle of its bounding box, which
    /// moves with the obstacle; an unbounded obstacle has its moment about the origin of its frame. For a pair, it is about the origin.
    pub moment: [f64; 3],
    /// The reference area of contact.
    pub area: f64,
    /// The largest depth of a point in the obstacle or in the other body (length).
    pub depth: f64,
    /// The work of the moving obstacle on the bodies since the start; 0 for a pair.
    pub work: f64,
    /// The energy dissipated by friction since the start.
    pub friction_loss: f64,
}

/// The changes at all contacts in a step.
#[derive(Debug, Default)]
pub(super) struct ContactUpdate<const D: usize> {
    pub obstacles: Vec<ContactForces<D>>,
    pub pairs: Vec<ContactForces<D>>,
    /// The new anchors of friction, by obstacle.
    anchors: Vec<Vec<Vector<f64, D>>>,
    /// The new slips between bodies, by point.
    slips: Vec<Vector<f64, D>>,
    /// The energy stored in the contact between bodies.
    energy: f64,
    /// The new state of every obstacle that moves freely.
    free: Vec<Option<RigidBody<D>>>,
    /// The work of all obstacles in the step.
    pub work: f64,
    /// The friction loss of all contacts in the step.
    pub friction_loss: f64,
}

impl<const D: usize> ContactForces<D> {
    /// No contact yet.
    pub(crate) const NONE: Self = Self {
        force: Vector::from_array_storage(nalgebra::ArrayStorage([[0.0; D]])),
        moment: [0.0; 3],
        area: 0.0,
        depth: 0.0,
        work: 0.0,
        friction_loss: 0.0,
    };
}

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// Finds the points that may touch another body in the coming step.
    pub(super) fn find_facing(&mut self) {
        let Some(mut between) = self.loads.contacts.between.take() else { return };
        between.facing = facing(&self.loads.contacts, &between, &self.particles, &self.grid, self.clock.step());
        self.loads.contacts.between = Some(between);
    }

    /// The contact at the end of a step, with the nodal motion `phi` since the last grid reset.
    ///
    /// # Errors
    /// A point enters an obstacle or another body too deeply, or goes through it. A free obstacle meets another obstacle, or has no balance of
    /// forces.
    pub(super) fn contact_update(
        &self,
        step: &Step<'_, D, L>,
        phi: &[Vector<f64, D>],
    ) -> Result<ContactUpdate<D>, StepError> {
        let contacts = &self.loads.contacts;
        if !contacts.exist() {
            return Ok(ContactUpdate::default());
        }
        // Forces at both ends are those of an instant.
        let alphas = Alphas { discrete_gradient: false, ..step.alphas };
        let end = Step { time: self.load() + self.clock.step(), alphas, ..*step };
        let before: Vec<_> = step.nodal.moved(step.supports.nodes()).collect();
        let free = self.free_after(step, &before, phi)?;
        let after = |(pose, body): (Pose<D>, &Option<RigidBody<D>>)| {
            body.as_ref().map_or(pose, |body| body.pose(&Vector::zeros()))
        };
        let motion = Motion {
            poses: [self.poses(self.load()), self.poses(end.time).into_iter().zip(&free).map(after).collect()],
            positions: self.point_positions(step, phi),
            relative: self.relative_motions(step, phi),
        };
        self.check_entry(&motion.poses, &motion.positions)?;
        self.check_overlap(&motion)?;
        self.check_meeting(&motion.poses)?;
        let mut update = ContactUpdate { free, ..self.untouched(&motion) };
        let at_end = points_at(&end, phi, &motion.poses[1]);
        at_end.iter().for_each(|one| update.add_end(one, contacts, &motion));
        let mut work = |share, points: &[ContactPoint<f64, D>]| {
            points.iter().for_each(|one| update.add_work(share, one, &motion, &self.ends(one, &motion.positions)));
        };
        if step.alphas.discrete_gradient {
            work(1.0, &points_at(step, &halfway(&before, phi), &self.poses(step.time)));
            return Ok(update);
        }
        work(0.5, &at_end);
        let start = Step { time: self.load(), ..end };
        mutant!("obstacles: the forces at the start of a step do no work": { return Ok(update); });
        work(0.5, &points_at(&start, &before, &motion.poses[0]));
        Ok(update)
    }

    /// The free obstacles at the end of a step, whose nodes move from `before` to `phi`. Forces are in balance at a part θ of the step.
    pub(super) fn free_after(
        &self,
        step: &Step<'_, D, L>,
        before: &[Vector<f64, D>],
        phi: &[Vector<f64, D>],
    ) -> Result<Vec<Option<RigidBody<D>>>, StepError> {
        let (contacts, scheme) = (&self.loads.contacts, &self.settings.scheme);
        let force = ContactForce::pressure(step).filter(|_| contacts.has_free_obstacle());
        let Some(force) = force else { return Ok(contacts.obstacles.iter().map(|_| None).collect()) };
        let (theta, end) = (scheme.instant(), scheme.end(self.clock.step()));
        let balanced: Vec<_> = before.iter().zip(phi).map(|(before, phi)| before + (phi - before) * theta).collect();
        let after = |(obstacle, motion): (&Obstacle<D>, Option<FreeMotion>)| {
            let (Some(body), Some(motion)) = (&obstacle.free, motion) else { return Ok(None) };
            // Newton's method of the bodies has used forces that are wrong if they are not in balance on the obstacle.
            let refused = StepError::FreeObstacle { obstacle: obstacle.name.clone() };
            let q = motion.q / theta;
            mutant!("free obstacles: they stay where forces are in balance": q = motion.q);
            if motion.is_balanced { Ok(Some(body.after(&q, &end))) } else { Err(refused) }
        };
        contacts.obstacles.iter().zip(force.free_motions(&balanced)).map(after).collect()
    }

    /// Refuses a step in which a free obstacle and another one enter each other, or go through each other: obstacles do not push each other.
    fn check_meeting(&self, [start, end]: &[Vec<Pose<D>>; 2]) -> Result<(), StepError> {
        let (contacts, h) = (&self.loads.contacts, self.grid.spacing);
        for ([one, other], point) in contacts.apart() {
            let seen = |poses: &[Pose<D>]| poses[other].to_frame(&poses[one].to_space(point));
            let (shape, ends) = (&contacts.obstacles[other].shape, [seen(start), seen(end)]);
            if shape.signed_distance(&ends[1]) < 0.0 || entry(shape, &ends, h).is_some() {
                let names = [one, other].map(|number| contacts.obstacles[number].name.clone());
                let position = end[one].to_space(point).iter().copied().collect();
                return Err(StepError::ObstaclesMeet { names, position });
            }
        }
        Ok(())
    }

    /// The update of a step in which nothing touches.
    fn untouched(&self, motion: &Motion<D>) -> ContactUpdate<D> {
        let contacts = &self.loads.contacts;
        let since = |work, friction_loss| ContactForces { work, friction_loss, ..ContactForces::NONE };
        let pairs = contacts.between.iter().flat_map(|between| &between.pairs);
        let slips = contacts.between.as_ref().map_or(0, |between| between.slips.len());
        let anchors = contacts.obstacles.iter().zip(&motion.poses[1]);
        ContactUpdate {
            obstacles: contacts.obstacles.iter().map(|one| since(one.work, one.friction_loss)).collect(),
            pairs: pairs.map(|pair| since(0.0, pair.friction_loss)).collect(),
            anchors: anchors.map(|(one, pose)| free_anchors(one, pose, &motion.positions)).collect(),
            slips: vec![Vector::zeros(); slips],
            ..ContactUpdate::default()
        }
    }

    /// For each facing point, its motion in the step relative to the other body: the positions at both ends.
    fn relative_motions(&self, step: &Step<'_, D, L>, phi: &[Vector<f64, D>]) -> HashMap<usize, [Vector<f64, D>; 2]> {
        let (contacts, reference) = (&self.loads.contacts, self.particles.reference().position);
        let facing = contacts.between.iter().flat_map(|between| &between.facing);
        let of = |one: &Facing<D>| {
            let position = |carrier: &Carrier<D>| carrier.position(reference, step.supports, phi) * carrier.share;
            (one.number, [one.start, one.carriers(contacts).iter().map(position).sum()])
        };
        facing.map(of).collect()
    }

    /// Refuses a step in which a point enters another body too deeply, or in which a body may have gone through another one.
    fn check_overlap(&self, motion: &Motion<D>) -> Result<(), StepError> {
        let contacts = &self.loads.contacts;
        let Some(between) = &contacts.between else { return Ok(()) };
        let h = self.grid.spacing;
        let body_of = |number: usize| self.particles.body[contacts.points[number].particle];
        let start = |number: usize| self.particles.position[contacts.points[number].particle];
        let refused = |number: usize, pair: usize, depth: f64| {
            let own = body_of(number);
            let other = between.pairs[pair].bodies.into_iter().find(|&body| body != own).unwrap_or(own);
            let names = [own, other].map(|body| self.bodies[body as usize].name.clone());
            StepError::EntersBody { bodies: names, position: start(number).iter().copied().collect(), depth }
        };
        let depth = |one: &Facing<D>, relative: &Vector<f64, D>| -one.normal.dot(relative) / h;
        let before: HashMap<usize, f64> =
            between.facing.iter().map(|one| (one.number, depth(one, &one.start).max(0.0))).collect();
        let known = between.facing.iter().map(|one| {
            let depth = depth(one, &motion.relative[&one.number][1]);
            (one.number, one.pair, depth)
        });
        // A point may have come around an edge, or along a curved surface.
        let ends = overlaps(contacts, between, &self.particles, &self.grid, &motion.positions);
        mutant!("contact: a point that did not face a body may enter it": ends = Vec::new());
        let new = ends.iter().map(|&Overlap { number, pair, depth }| (number, pair, depth / h));
        for (number, pair, depth) in known.chain(new) {
            let entered = depth - before.get(&number).copied().unwrap_or(0.0);
            if depth > DEEPEST || entered > DEEPEST_ENTRY {
                return Err(refused(number, pair, depth));
            }
        }
        // The search has seen what is within its reach, so nothing may come from farther away.
        let boxes = self.boxes(&motion.positions);
        for pair in &between.pairs {
            let [Some(one), Some(other)] = pair.bodies.map(|body| boxes[body as usize]) else { continue };
            let meet = (0..D).all(|k| one.low[k] <= other.high[k] && other.low[k] <= one.high[k]);
            let apart = one.motion - other.motion;
            if meet && apart.norm() + one.spread + other.spread > f64::from(REACH) * h {
                let bodies = pair.bodies.map(|body| self.bodies[body as usize].name.clone());
                return Err(StepError::PassesBody { bodies, reach: REACH });
            }
        }
        Ok(())
    }

    /// The boxes through which the surfaces of all bodies move in the step; `None` for a body without surface points.
    fn boxes(&self, positions: &[Vector<f64, D>]) -> Vec<Option<Swept<D>>> {
        let mut boxes: Vec<Option<Swept<D>>> = vec![None; self.bodies.len()];
        for (point, end) in self.loads.contacts.points.iter().zip(positions) {
            let start = &self.particles.position[point.particle];
            let (low, high, motion) = (start.inf(end), start.sup(end), end - start);
            let swept = boxes[self.particles.body[point.particle] as usize];
            let new = Swept { low, high, motion, spread: 0.0 };
            boxes[self.particles.body[point.particle] as usize] = Some(swept.map_or(new, |swept| Swept {
                low: swept.low.inf(&low),
                high: swept.high.sup(&high),
                motion: swept.motion,
                spread: swept.spread.max((motion - swept.motion).norm()),
            }));
        }
        boxes
    }

    /// The positions of all points at the end of the step.
    fn point_positions(&self, step: &Step<'_, D, L>, phi: &[Vector<f64, D>]) -> Vec<Vector<f64, D>> {
        let reference = self.particles.reference().position;
        let at = |p: usize| reference[p] + step.supports.value_at(p, phi);
        self.loads.contacts.points.iter().map(|point| at(point.particle)).collect()
    }

    /// The positions of a point at both ends of the step.
    fn ends(&self, one: &ContactPoint<f64, D>, positions: &[Vector<f64, D>]) -> [Vector<f64, D>; 2] {
        [self.particles.position[one.carriers[0].particle], positions[one.number]]
    }

    /// The poses of all obstacles at a time.
    fn poses(&self, time: f64) -> Vec<Pose<D>> {
        self.loads.contacts.obstacles.iter().map(|one| one.pose(time)).collect()
    }

    /// Refuses a step in which a point enters an obstacle too deeply, or goes through an obstacle.
    fn check_entry(&self, poses: &[Vec<Pose<D>>; 2], positions: &[Vector<f64, D>]) -> Result<(), StepError> {
        let (contacts, h) = (&self.loads.contacts, self.grid.spacing);
        mutant!("obstacles: a point may enter deeply in one step": { return Ok(()); });
        for (point, end) in contacts.points.iter().zip(positions) {
            let start = &self.particles.position[point.particle];
            for (number, obstacle) in contacts.obstacles.iter().enumerate() {
                let ends = [poses[0][number].to_frame(start), poses[1][number].to_frame(end)];
                if let Some(depth) = entry(&obstacle.shape, &ends, h) {
                    let position = start.iter().copied().collect();
                    return Err(StepError::EntersObstacle { obstacle: obstacle.name.clone(), position, depth });
                }
            }
        }
        Ok(())
    }

    /// Writes the state of friction, the work and the losses.
    pub(super) fn accept_contacts(&mut self, update: &ContactUpdate<D>) {
        mutant!("obstacles: the state of friction is not kept": { return; });
        let list = self.loads.contacts.obstacles.iter_mut();
        for ((obstacle, contact), anchors) in list.zip(&update.obstacles).zip(&update.anchors) {
            obstacle.anchors.clone_from(anchors);
            (obstacle.work, obstacle.friction_loss) = (contact.work, contact.friction_loss);
        }
        let free = self.loads.contacts.obstacles.iter_mut().zip(&update.free);
        free.for_each(|(obstacle, body)| obstacle.free.clone_from(body));
        if let Some(between) = &mut self.loads.contacts.between {
            between.slips.clone_from(&update.slips);
            between.energy = update.energy;
            let pairs = between.pairs.iter_mut().zip(&update.pairs);
            pairs.for_each(|(pair, contact)| pair.friction_loss = contact.friction_loss);
        }
    }

    /// The energy stored in the contact with obstacles and between bodies: Σ ½ k g² A.
    pub fn contact_energy(&self) -> f64 {
        let (particles, penalties) = (&self.particles, penalties(&self.bodies, self.grid.spacing));
        let around = Surroundings {
            t: self.load(),
            start: None,
            spacing: self.grid.spacing,
            stiffness: |p: usize| penalties[particles.body[p] as usize],
            position: |carrier: &Carrier<D>| particles.position[carrier.particle],
        };
        let touching = obstacle_points(&self.loads.contacts, &around, &self.poses(self.load()));
        let between = self.loads.contacts.between.as_ref().map_or(0.0, |between| between.energy);
        touching.iter().fold(between, |sum, one| sum + one.law.energy(&one.y) * one.area)
    }
}

/// The motion of obstacles and surfaces in a step.
struct Motion<const D: usize> {
    /// The poses of all obstacles at both ends.
    poses: [Vec<Pose<D>>; 2],
    /// The positions of all points at the end.
    positions: Vec<Vector<f64, D>>,
    /// The positions of facing points relative to the other body, at both ends.
    relative: HashMap<usize, [Vector<f64, D>; 2]>,
}

/// The box through which the surface of a body moves in a step.
#[derive(Clone, Copy)]
struct Swept<const D: usize> {
    low: Vector<f64, D>,
    high: Vector<f64, D>,
    /// The motion of one point.
    motion: Vector<f64, D>,
    /// The largest difference of another point's motion.
    spread: f64,
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
            Touching::Pair { pair, is_first } => {
                if let Some(slip) = self.slips.get_mut(*number) {
                    *slip = law.along(&(y - law.new_anchor(y)));
                }
                self.energy += law.energy(y) * area;
                (&mut self.pairs[pair], motion.positions[*number], if is_first { -force } else { force })
            }
        };
        contact.force += on_other;
        contact.moment = add(contact.moment, moment(&arm, &on_other));
        contact.area += area;
        contact.depth = contact.depth.max(law.depth(y));
    }

    /// Adds a share of the work of a force in the step: a half for the force at each end, or all for the force in the middle. The point moves
    /// between its `positions` at both ends. Friction loses the work along the motion of the point relative to the obstacle or to the other
    /// body.
    fn add_work(
        &mut self,
        share: f64,
        one: &ContactPoint<f64, D>,
        motion: &Motion<D>,
        positions: &[Vector<f64, D>; 2],
    ) {
        let friction = one.law.traction(Response::Friction, &one.y) * one.area;
        let (contact, relative, work) = match one.touching {
            Touching::Obstacle(obstacle) => {
                let [start, end] = [&motion.poses[0][obstacle], &motion.poses[1][obstacle]];
                let moved = end.to_space(&one.y) - start.to_space(&one.y);
                let relative = end.to_frame(&positions[1]) - start.to_frame(&positions[0]);
                (&mut self.obstacles[obstacle], relative, share * one.force().dot(&moved))
            }
            Touching::Pair { pair, .. } => {
                let [start, end] = motion.relative[&one.number];
                (&mut self.pairs[pair], end - start, 0.0)
            }
        };
        let loss = -share * friction.dot(&relative);
        mutant!("obstacles: friction loses nothing": loss = 0.0);
        contact.work += work;
        self.work += work;
        contact.friction_loss += loss;
        self.friction_loss += loss;
    }
}

/// All points in contact at the time of `step`, with the nodal motion `phi` since the last grid reset and the poses of all obstacles.
fn points_at<const D: usize, L: Law>(
    step: &Step<'_, D, L>,
    phi: &[Vector<f64, D>],
    poses: &[Pose<D>],
) -> Vec<ContactPoint<f64, D>> {
    ContactForce::pressure(step).map_or_else(Vec::new, |force| force.contact_points_at(phi, poses))
}

/// The depth, in spacings, of a point that enters an obstacle too deeply or goes through it; `None` for an allowed motion. The point moves
/// straight between two positions in the frame of the obstacle.
fn entry<const D: usize>(shape: &Shape<D>, [start, end]: &[Vector<f64, D>; 2], h: f64) -> Option<f64> {
    let length = (end - start).norm();
    let before = shape.signed_distance(start);
    // A positive distance is at most the distance of the surface. NaN stays outside.
    if before >= length || before.is_nan() {
        return None;
    }
    let (after, normal) = shape.distance_and_normal(end);
    let depth = -after / h;
    if before < 0.0 {
        let turned = after < 0.0 && shape.normal(start).dot(&normal) < 0.0;
        return turned.then_some(depth);
    }
    if depth > DEEPEST_ENTRY {
        return Some(depth);
    }
    let samples = (length / (SAMPLED * h)).ceil().min(MOST_SAMPLES);
    let at = |sample: f64| shape.signed_distance(&(start + (end - start) * (sample / samples)));
    let deepest = (1..samples as u32).map(|sample| at(f64::from(sample))).fold(0.0, f64::min);
    (after >= 0.0 && deepest < 0.0).then_some(-deepest / h)
}

/// The anchors of points that touch nothing: their positions.
fn free_anchors<const D: usize>(
    obstacle: &Obstacle<D>,
    pose: &Pose<D>,
    positions: &[Vector<f64, D>],
) -> Vec<Vector<f64, D>> {
    if obstacle.friction > 0.0 { positions.iter().map(|x| pose.to_frame(x)).collect() } else { Vec::new() }
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
