//! Contact with rigid obstacles at the end of a step: forces, work, friction loss, and the new state of friction.

use super::{Simulation, StepError};
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::contact::{ContactPoint, Response, contact_points};
use crate::mechanics::loads::{Obstacle, Pose};
use crate::mechanics::terms::{ObstacleForce, Step, penalties};
use crate::shape::Shape;
use crate::tensor::Vector;
use nalgebra::Vector3;

/// A point may enter an obstacle in one step by this many spacings at most. A longer step is repeated with half its length.
const DEEPEST_ENTRY: f64 = 0.25;

/// The path of a point in a step is tested for obstacles at places this far apart, in spacings, and at this many places at most.
const SAMPLED: f64 = 0.05;
const MOST_SAMPLES: f64 = 1000.0;

/// The contact of all bodies with one obstacle at the end of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObstacleContact<const D: usize> {
    /// The force on the obstacle at t_{n+1}.
    pub force: Vector<f64, D>,
    /// The moment of the force about the middle of the obstacle's bounding box, which moves with the obstacle. An unbounded obstacle has
    /// its moment about the origin of its frame. In 2D the moment is the last component.
    pub moment: [f64; 3],
    /// The reference area of the points that touch the obstacle.
    pub area: f64,
    /// The largest depth of a point in the obstacle (length).
    pub depth: f64,
    /// The work of the moving obstacle on the bodies since the start.
    pub work: f64,
    /// The energy dissipated by friction since the start.
    pub friction_loss: f64,
}

/// The changes at the obstacles in a step.
#[derive(Debug, Default)]
pub(super) struct ObstacleUpdate<const D: usize> {
    pub contacts: Vec<ObstacleContact<D>>,
    /// The new anchors of friction, by obstacle.
    anchors: Vec<Vec<Vector<f64, D>>>,
    /// The work of all obstacles in the step.
    pub work: f64,
    /// The friction loss of all obstacles in the step.
    pub friction_loss: f64,
}

impl<const D: usize> ObstacleContact<D> {
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
    /// The contact at the end of a step, with the nodal motion `phi` since the last grid reset.
    ///
    /// # Errors
    /// A point enters an obstacle too deeply, or goes through it.
    pub(super) fn obstacle_update(
        &self,
        step: &Step<'_, D, L>,
        phi: &[Vector<f64, D>],
    ) -> Result<ObstacleUpdate<D>, StepError> {
        let obstacles = &self.loads.obstacles;
        if obstacles.list.is_empty() {
            return Ok(ObstacleUpdate::default());
        }
        let dt = self.clock.step();
        let end = Step { time: self.load() + dt, ..*step };
        let poses = [self.poses(self.load()), self.poses(end.time)];
        let positions = self.point_positions(step, phi);
        self.check_entry(&poses, &positions)?;
        let anchors = obstacles.list.iter().zip(&poses[1]).map(|(one, pose)| free_anchors(one, pose, &positions));
        let mut update = ObstacleUpdate { anchors: anchors.collect(), ..ObstacleUpdate::default() };
        for one in &obstacles.list {
            let (work, friction_loss) = (one.work, one.friction_loss);
            update.contacts.push(ObstacleContact { work, friction_loss, ..ObstacleContact::NONE });
        }
        for one in &points_at(&end, phi) {
            let ContactPoint { obstacle, number, point, pose, law, y } = one;
            let contact = &mut update.contacts[*obstacle];
            let force = one.force();
            let arm = pose.rotation * (y - middle(&obstacles.list[*obstacle]));
            contact.force -= force;
            contact.moment = add(contact.moment, moment(&arm, &-force));
            contact.area += point.area;
            contact.depth = contact.depth.max(law.depth(y));
            if let Some(anchor) = update.anchors[*obstacle].get_mut(*number) {
                *anchor = law.new_anchor(y);
            }
            update.add_work(one, &poses, &self.ends(one, &positions));
        }
        let before: Vec<_> = step.nodal.moved(step.supports.nodes()).collect();
        let start = Step { time: self.load(), ..*step };
        for one in points_at(&start, &before) {
            mutant!("obstacles: the forces at the start of a step do no work": { break; });
            update.add_work(&one, &poses, &self.ends(&one, &positions));
        }
        Ok(update)
    }

    /// The positions of all points at the end of the step.
    fn point_positions(&self, step: &Step<'_, D, L>, phi: &[Vector<f64, D>]) -> Vec<Vector<f64, D>> {
        let reference = self.particles.reference().position;
        let at = |p: usize| reference[p] + step.supports.value_at(p, phi);
        self.loads.obstacles.points.iter().map(|point| at(point.particle)).collect()
    }

    /// The positions of a point at both ends of the step.
    fn ends(&self, one: &ContactPoint<'_, f64, D>, positions: &[Vector<f64, D>]) -> [Vector<f64, D>; 2] {
        [self.particles.position[one.point.particle], positions[one.number]]
    }

    /// The poses of all obstacles at a time.
    fn poses(&self, time: f64) -> Vec<Pose<D>> {
        self.loads.obstacles.list.iter().map(|one| one.pose(time)).collect()
    }

    /// Refuses a step in which a point enters an obstacle too deeply, or goes through an obstacle.
    fn check_entry(&self, poses: &[Vec<Pose<D>>; 2], positions: &[Vector<f64, D>]) -> Result<(), StepError> {
        let (obstacles, h) = (&self.loads.obstacles, self.grid.spacing);
        mutant!("obstacles: a point may enter deeply in one step": { return Ok(()); });
        for (point, end) in obstacles.points.iter().zip(positions) {
            let start = &self.particles.position[point.particle];
            for (number, obstacle) in obstacles.list.iter().enumerate() {
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
    pub(super) fn accept_obstacles(&mut self, update: &ObstacleUpdate<D>) {
        mutant!("obstacles: the state of friction is not kept": { return; });
        let list = self.loads.obstacles.list.iter_mut();
        for ((obstacle, contact), anchors) in list.zip(&update.contacts).zip(&update.anchors) {
            obstacle.anchors.clone_from(anchors);
            (obstacle.work, obstacle.friction_loss) = (contact.work, contact.friction_loss);
        }
    }

    /// The energy stored in the contact with obstacles: Σ ½ k g² A.
    pub fn contact_energy(&self) -> f64 {
        let (particles, penalties) = (&self.particles, penalties(&self.bodies, self.grid.spacing));
        let stiffness = |p: usize| penalties[particles.body[p] as usize];
        let touching =
            contact_points(&self.loads.obstacles, self.load(), self.grid.spacing, stiffness, |p| particles.position[p]);
        touching.iter().fold(0.0, |sum, one| sum + one.law.energy(&one.y) * one.point.area)
    }
}

impl<const D: usize> ObstacleUpdate<D> {
    /// Adds half the work of a force at one end of the step: the trapezoidal rule. The obstacle moves between the `poses` at both ends of the
    /// step, and the point between the `positions`. Friction loses the work along the motion of the point relative to the obstacle.
    fn add_work(&mut self, one: &ContactPoint<'_, f64, D>, poses: &[Vec<Pose<D>>; 2], positions: &[Vector<f64, D>; 2]) {
        let [start, end] = [&poses[0][one.obstacle], &poses[1][one.obstacle]];
        let contact = &mut self.contacts[one.obstacle];
        let moved = end.to_space(&one.y) - start.to_space(&one.y);
        let work = 0.5 * one.force().dot(&moved);
        let relative = end.to_frame(&positions[1]) - start.to_frame(&positions[0]);
        let loss = -0.5 * one.point.area * one.law.traction(Response::Friction, &one.y).dot(&relative);
        mutant!("obstacles: friction loses nothing": loss = 0.0);
        contact.work += work;
        self.work += work;
        contact.friction_loss += loss;
        self.friction_loss += loss;
    }
}

/// All points that touch an obstacle at the time of `step`, with the nodal motion `phi` since the last grid reset.
fn points_at<'a, const D: usize, L: Law>(
    step: &Step<'a, D, L>,
    phi: &[Vector<f64, D>],
) -> Vec<ContactPoint<'a, f64, D>> {
    ObstacleForce::pressure(step).map_or_else(Vec::new, |force| force.contact_points(phi))
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

/// The middle of the obstacle's bounding box at t = 0; the origin for an unbounded obstacle.
fn middle<const D: usize>(obstacle: &Obstacle<D>) -> Vector<f64, D> {
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
