//! Steps that are refused because a surface enters an obstacle or another body too deeply, or goes through it.

use super::contacts::Motion;
use super::{BareParticle, ContactForces, Simulation, StepError};
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::contact::{FASTEST, Path, paths, swallowed};
use crate::mechanics::loads::Pose;
use crate::shape::Shape;
use crate::tensor::Vector;
use std::collections::HashSet;

/// A point may enter an obstacle or another body in one step by this many spacings at most. A longer step is repeated with half its length.
const DEEPEST_ENTRY: f64 = 0.25;

/// A particle that lies deeper in an obstacle or another body than all points of surfaces, by this many spacings, becomes a point of the surface.
const DEEPER: f64 = 0.01;

/// The path of a point in a step is followed from place to place, each as far as the distance of the obstacle allows, and at least this part of the
/// path. So an obstacle thinner than this part may be missed.
const LEAST_STRIDE: f64 = 1e-3;

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// Refuses a step in which surfaces enter obstacles or bodies too deeply, or go through them.
    pub(super) fn check_paths(&self, motion: &Motion<D>) -> Result<(), StepError> {
        self.check_entry(motion)?;
        self.check_overlap(motion)?;
        self.check_meeting(motion)
    }

    /// Refuses a step in which a point enters an obstacle too deeply, or goes through an obstacle.
    fn check_entry(&self, Motion { poses, positions, .. }: &Motion<D>) -> Result<(), StepError> {
        let (contacts, h) = (&self.loads.contacts, self.grid.spacing);
        mutant!("obstacles: a point may enter deeply in one step": { return Ok(()); });
        for point in &contacts.points {
            let (start, end) = (&self.particles.position[point.particle], &positions[point.particle]);
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

    /// Refuses a step in which a point enters another body too deeply, or in which a body may have gone through another one.
    fn check_overlap(&self, motion: &Motion<D>) -> Result<(), StepError> {
        let contacts = &self.loads.contacts;
        let Some(between) = &contacts.between else { return Ok(()) };
        let h = self.grid.spacing;
        let particle = |number: usize| contacts.points[number].particle;
        let body_of = |number: usize| self.particles.body[particle(number)];
        let start = |number: usize| self.particles.position[particle(number)];
        let refused = |number: usize, pair: usize, depth: f64| {
            let own = body_of(number);
            let other = between.pairs[pair].bodies.into_iter().find(|&body| body != own).unwrap_or(own);
            let names = [own, other].map(|body| self.bodies[body as usize].name.clone());
            StepError::EntersBody { bodies: names, position: start(number).iter().copied().collect(), depth }
        };
        let ends = |number: usize| [start(number), motion.positions[particle(number)]];
        let paths = paths(contacts, between, &self.particles, &self.grid, ends);
        mutant!("contact: a point that did not face a body may enter it": paths = Vec::new());
        for Path { number, pair, depth: [before, after], deepest } in paths {
            if after > deepest || after - before.max(0.0) > DEEPEST_ENTRY * h {
                return Err(refused(number, pair, after / h));
            }
        }
        // The search has seen what is within its reach, so nothing may come from farther away.
        let boxes = self.boxes(&motion.positions);
        for pair in &between.pairs {
            let [Some(one), Some(other)] = pair.bodies.map(|body| boxes[body as usize]) else { continue };
            let meet = (0..D).all(|k| one.low[k] <= other.high[k] && other.low[k] <= one.high[k]);
            let apart = one.motion - other.motion;
            if meet && apart.norm() + one.spread + other.spread > FASTEST * h {
                let bodies = pair.bodies.map(|body| self.bodies[body as usize].name.clone());
                return Err(StepError::PassesBody { bodies, fastest: FASTEST });
            }
        }
        Ok(())
    }

    /// The boxes through which the surfaces of all bodies move in the step; `None` for a body without surface points.
    fn boxes(&self, positions: &[Vector<f64, D>]) -> Vec<Option<Swept<D>>> {
        let mut boxes: Vec<Option<Swept<D>>> = vec![None; self.bodies.len()];
        for point in &self.loads.contacts.points {
            let (start, end) = (&self.particles.position[point.particle], &positions[point.particle]);
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

    /// Refuses a step after which particles lie deeper in an obstacle or in another body than all points of surfaces: the surface has opened
    /// there.
    pub(super) fn check_particles(
        &self,
        Motion { poses: [_, poses], positions, .. }: &Motion<D>,
        [obstacles, pairs]: [&[ContactForces<D>]; 2],
    ) -> Result<(), StepError> {
        let (contacts, particles) = (&self.loads.contacts, &self.particles);
        let margin = DEEPER * self.grid.spacing;
        let covered: HashSet<usize> = contacts.points.iter().map(|point| point.particle).collect();
        let mut bare: Vec<BareParticle> = Vec::new();
        let mut add = |p: usize, outward: Vector<f64, D>| {
            if covered.contains(&p) {
                return;
            }
            bare.push(BareParticle { particle: particles.id[p], outward: outward.iter().copied().collect() });
        };
        mutant!("contact: particles do not watch": { return Ok(()); });
        for ((obstacle, pose), contact) in contacts.obstacles.iter().zip(poses).zip(obstacles) {
            let (low, high) = obstacle.shape.bounding_box();
            for p in (0..particles.len()).filter(|&p| particles.is_solid(p)) {
                let y = pose.to_frame(&positions[p]);
                if (0..D).all(|k| low[k] < y[k] && y[k] < high[k]) {
                    let (distance, normal) = obstacle.shape.distance_and_normal(&y);
                    if -distance > contact.depth + margin {
                        add(p, pose.rotation * -normal);
                    }
                }
            }
        }
        if let Some(between) = &contacts.between {
            for (p, pair, depth, normal) in swallowed(contacts, between, particles, &self.grid, positions) {
                if depth > pairs[pair].depth + margin {
                    add(p, -normal);
                }
            }
        }
        if bare.is_empty() { Ok(()) } else { Err(StepError::SurfaceOpens { bare }) }
    }

    /// Refuses a step in which a free obstacle and another one enter each other, or go through each other: obstacles do not push each other.
    fn check_meeting(&self, Motion { poses: [start, end], .. }: &Motion<D>) -> Result<(), StepError> {
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

/// The depth, in spacings, of a point that enters an obstacle too deeply or goes through it; `None` for an allowed motion. The point moves
/// straight between two positions in the frame of the obstacle.
fn entry<const D: usize>(shape: &Shape<D>, [start, end]: &[Vector<f64, D>; 2], h: f64) -> Option<f64> {
    let motion = end - start;
    let length = motion.norm();
    let before = shape.signed_distance(start);
    // A positive distance is at most the distance of the surface. NaN stays outside.
    if before >= length || before.is_nan() {
        return None;
    }
    let (after, normal) = shape.distance_and_normal(end);
    let depth = (-after / h).max(0.0);
    // The side nearest to the end pushes the point on along its motion: it is the back of the obstacle.
    let is_behind = normal.dot(&motion) > 0.0;
    mutant!("obstacles: a point may come out behind a thin obstacle": is_behind = false);
    if before < 0.0 {
        let outward = shape.normal(start);
        return (is_behind && outward.dot(&motion) < 0.0 && outward.dot(&normal) < 0.0).then_some(depth);
    }
    if after < 0.0 {
        return (depth > DEEPEST_ENTRY || is_behind).then_some(depth);
    }
    // Both ends are outside.
    let (mut at, mut distance) = (0.0, before);
    while at < 1.0 && distance >= 0.0 {
        at += (distance / length).max(LEAST_STRIDE);
        distance = shape.signed_distance(&(start + motion * at.min(1.0)));
    }
    (distance < 0.0).then_some(-distance / h)
}
