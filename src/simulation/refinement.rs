//! Surfaces that stretch get more points. Contact acts at points, and an obstacle would pass between points that are far apart.

use super::{BareParticle, Simulation};
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::loads::SurfacePoint;
use crate::tensor::{Vector, identity};
use std::collections::HashSet;

/// A piece of surface is halved if it is longer than this many grid spacings, and stretched by this factor. At the start, pieces are a quarter
/// to a half of a spacing long.
const LONGEST: f64 = 0.5;
const STRETCHED: f64 = 1.25;

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// Halves the pieces of surface that have become longer than half a cell, along their longest edge. The points of both halves lie on the
    /// piece, and move with the material there. `t` is the present time. The shape functions of a kept grid belong to its particles, so surfaces
    /// are refined before the grid is reset.
    pub(super) fn refine_surfaces(&mut self, t: f64) {
        if !self.history.resets_grid() {
            return;
        }
        let count = self.loads.contacts.points.len();
        for number in 0..count {
            let point = self.loads.contacts.points[number];
            let p = point.particle;
            if self.particles.is_solid(p) {
                continue;
            }
            let f = identity::<f64, D>() + self.particles.displacement_gradient[p];
            let edges = point.edges().into_iter().map(|edge| (f * edge, edge.norm())).enumerate();
            let longest = edges.max_by(|(_, one), (_, other)| one.0.norm().total_cmp(&other.0.norm()));
            let Some((axis, (edge, before))) = longest else {
                continue;
            };
            let ends = [-0.25, 0.25].map(|part| self.particles.position[p] + edge * part);
            let is_long = edge.norm() > (LONGEST * self.grid.spacing).max(STRETCHED * before);
            mutant!("contact: surfaces that stretch get no more points": is_long = false);
            if is_long && ends.iter().all(|x| self.grid.contains(x)) {
                self.halve(number, axis, ends, t);
            }
        }
        // In load steps, the forces of new points would become a part of the out-of-balance force, and act on the bodies for good.
        if self.loads.contacts.points.len() > count {
            self.history.equilibrium = None;
        }
    }

    /// Makes particles points of the surface. Returns whether there is a new one.
    pub(super) fn cover(&mut self, bare: &[BareParticle]) -> bool {
        let Self { particles, loads, .. } = self;
        let (contacts, places) = (&mut loads.contacts, particles.places());
        let before = contacts.points.len();
        let mut known: HashSet<usize> = contacts.points.iter().map(|point| point.particle).collect();
        for BareParticle { particle: id, outward } in bare {
            let particle = places[*id as usize] as usize;
            if !known.insert(particle) {
                continue;
            }
            // n ∝ cof F N
            let f = identity::<f64, D>() + particles.displacement_gradient[particle];
            let normal = f.tr_mul(&Vector::from_column_slice(outward)).normalize();
            let area = particles.volume[particle].powf((D - 1) as f64 / D as f64);
            let point = SurfacePoint::new(particle, normal, area);
            contacts.cover(*id, point);
            for obstacle in &mut contacts.obstacles {
                let pose = obstacle.pose(self.clock.time());
                obstacle.anchors.extend(obstacle.anchors_at(&pose, &[point], &particles.position));
            }
        }
        contacts.points.len() > before
    }

    /// Halves a piece of surface. Its point moves to the first of both ends, and a new point is added at the other one.
    fn halve(&mut self, number: usize, axis: usize, ends: [Vector<f64, D>; 2], t: f64) {
        let contacts = &mut self.loads.contacts;
        let p = contacts.points[number].particle;
        let new = self.particles.push_copy(p);
        contacts.halve(number, axis, new);
        let before = self.particles.position[p];
        [self.particles.position[p], self.particles.position[new]] = ends;
        for obstacle in contacts.obstacles.iter_mut().filter(|obstacle| !obstacle.anchors.is_empty()) {
            let back = obstacle.pose(t).rotation.transpose();
            let anchors = ends.map(|x| obstacle.anchors[number] + back * (x - before));
            obstacle.anchors[number] = anchors[0];
            obstacle.anchors.push(anchors[1]);
        }
        let last = contacts.points.len() - 1;
        if let Some(between) = &mut contacts.between {
            let slips = between.slips.range([number, 0]..[number + 1, 0]);
            let copies: Vec<_> = slips.map(|(&[_, pair], slip)| ([last, pair], *slip)).collect();
            between.slips.extend(copies);
        }
    }
}
