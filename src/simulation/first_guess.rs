//! The motion that Newton's method starts from.

use super::{InitialGuess, Simulation, StepError};
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::loads::{Candidate, Pose, PrescribedDof};
use crate::mechanics::residual::Equilibrium;
use crate::mechanics::sweep::Connectivity;
use crate::mechanics::terms::Step;
use crate::mechanics::transfer::Nodal;
use crate::parallel;
use crate::pooled::Pooled;
use crate::tensor::Vector;

/// The depth, in spacings, of a body that is moved into an obstacle or into another body.
const DEPTH: f64 = 0.01;

/// Steps of the search for the obstacle. Each one is the distance of the nearest obstacle.
const MOST_STEPS: u32 = 1000;

/// A body that moves along another one, with a smaller part of its motion along the normal, does not meet it.
const GRAZING: f64 = 1e-3;

/// A point that faces another body.
struct Faced<const D: usize> {
    /// The nodal fields of the point and of the other body.
    fields: [u32; 2],
    /// The outward normal of the other body.
    normal: Vector<f64, D>,
    /// The distance of the point from the other body.
    gap: f64,
}

/// The nodal fields of bodies that touch each other, directly or through others.
fn together<const D: usize>(count: u32, faced: &[Faced<D>]) -> Vec<Vec<u32>> {
    let mut groups: Vec<Vec<u32>> = (0..count).map(|field| vec![field]).collect();
    for [one, other] in faced.iter().filter(|one| one.gap < 0.0).map(|one| one.fields) {
        let of = |field: u32| groups.iter().position(|group| group.contains(&field));
        if let (Some(a), Some(b)) = (of(one), of(other))
            && a != b
        {
            let joined = groups.swap_remove(a.max(b));
            groups[a.min(b)].extend(joined);
        }
    }
    groups
}

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// The Δφ that Newton's method starts from.
    pub(super) fn initial_guess(
        &self,
        connectivity: &Connectivity<D>,
        nodal: &Nodal<D>,
        dt: f64,
    ) -> Pooled<Vector<f64, D>> {
        let mut dphi: Pooled<Vector<f64, D>> = connectivity.field();
        let rate: &[Vector<f64, D>] = match self.settings.initial_guess {
            InitialGuess::Zero => &[],
            InitialGuess::Velocity => &nodal.velocity,
            InitialGuess::LastStep => &self.history.rate,
        };
        parallel::zip(&mut dphi, rate, |dphi, rate| *dphi = rate * dt);
        dphi
    }

    /// Moves bodies into the obstacles and the bodies that hold them, in load steps. Such a body has no stiffness while it touches nothing, so
    /// Newton's method would not find them. Bodies that touch each other move together, along the resultant of their loads, in the directions that
    /// no condition prescribes.
    pub(super) fn meet_what_holds(
        &self,
        equilibrium: &Equilibrium<'_, D, L>,
        prescribed: &[PrescribedDof],
        phi: &mut [Vector<f64, D>],
    ) -> Result<(), StepError> {
        let (contacts, connectivity) = (&self.loads.contacts, equilibrium.step.connectivity);
        if self.settings.scheme.has_inertia() || !contacts.exist() {
            return Ok(());
        }
        let poses: Vec<Pose<D>> = contacts.obstacles.iter().map(|one| one.pose(equilibrium.step.time)).collect();
        let is_free = |fields: &[u32], k: usize| {
            let is_there = |node: usize| fields.iter().any(|&field| connectivity.nodes_of(field).contains(&node));
            !prescribed.iter().any(|dof| dof.component == k && is_there(dof.node))
        };
        // After each motion, bodies touch an obstacle or others, so there are fewer that move.
        for _ in 0..=connectivity.field_count() {
            let (places, faced) = (self.surfaces(&equilibrium.step, phi), self.faced(&equilibrium.step, phi));
            let of =
                |fields: &[u32]| fields.iter().flat_map(|&field| &places[field as usize]).copied().collect::<Vec<_>>();
            let mut apart = together(connectivity.field_count(), &faced);
            apart.retain(|fields| self.distance_to_obstacles(&of(fields), &poses) >= 0.0);
            if apart.is_empty() {
                return Ok(());
            }
            let residual = equilibrium.residual(phi)?;
            let motion = |fields: &Vec<u32>| {
                let nodes = fields.iter().flat_map(|&field| connectivity.nodes_of(field));
                let load: Vector<f64, D> = nodes.map(|node| -residual[node]).sum();
                let free = Vector::<f64, D>::from_fn(|k, _| if is_free(fields, k) { load[k] } else { 0.0 });
                let along = free.try_normalize(0.0)?;
                let ways =
                    [self.way_to_obstacle(&of(fields), &poses, &along), self.way_to_bodies(fields, &faced, &along)];
                Some((fields.clone(), along * ways.into_iter().flatten().reduce(f64::min)?))
            };
            let Some((fields, motion)) = apart.iter().find_map(motion) else { return Ok(()) };
            let nodes = fields.iter().flat_map(|&field| connectivity.nodes_of(field));
            nodes.for_each(|node| phi[node] += motion);
        }
        Ok(())
    }

    /// The positions of the points of surfaces after the nodal motion `phi`, by nodal fields.
    fn surfaces(&self, step: &Step<'_, D, L>, phi: &[Vector<f64, D>]) -> Vec<Vec<Vector<f64, D>>> {
        let (connectivity, positions) = (step.connectivity, self.end_positions(step, phi));
        let mut places = vec![Vec::new(); connectivity.field_count() as usize];
        for p in self.loads.contacts.points.iter().map(|point| point.particle) {
            places[connectivity.field_of(self.particles.body[p]) as usize].push(positions[p]);
        }
        places
    }

    /// The points that face another body, after the nodal motion `phi`.
    fn faced(&self, step: &Step<'_, D, L>, phi: &[Vector<f64, D>]) -> Vec<Faced<D>> {
        let Some(between) = &self.loads.contacts.between else { return Vec::new() };
        let of = |(one, [_, relative]): (&Candidate<D>, [Vector<f64, D>; 2])| {
            let [first, second] = between.pairs[one.pair].bodies.map(|body| step.connectivity.field_of(body));
            let fields = if one.is_first { [first, second] } else { [second, first] };
            Faced { fields, normal: one.normal, gap: one.normal.dot(&relative) }
        };
        between.candidates.iter().zip(self.relative_motions(step, phi)).map(of).collect()
    }

    /// The way along a unit vector that takes these bodies into another one; `None` if there is none on the way.
    fn way_to_bodies(&self, fields: &[u32], faced: &[Faced<D>], along: &Vector<f64, D>) -> Option<f64> {
        let way = |one: &Faced<D>| {
            let [moves, is_met] = one.fields.map(|field| fields.contains(&field));
            let nearing = -one.normal.dot(along) * (f64::from(moves) - f64::from(is_met));
            (nearing > GRAZING).then(|| (one.gap.max(0.0) + DEPTH * self.grid.spacing) / nearing)
        };
        faced.iter().filter_map(way).reduce(f64::min)
    }

    /// The least distance of places from all obstacles.
    fn distance_to_obstacles(&self, places: &[Vector<f64, D>], poses: &[Pose<D>]) -> f64 {
        let mut least = f64::INFINITY;
        for (obstacle, pose) in self.loads.contacts.obstacles.iter().zip(poses) {
            let distances = places.iter().map(|x| obstacle.shape.signed_distance(&pose.to_frame(x)));
            least = distances.fold(least, f64::min);
        }
        least
    }

    /// The way along a unit vector that takes the first of the places into an obstacle; `None` if there is no obstacle on the way.
    fn way_to_obstacle(&self, places: &[Vector<f64, D>], poses: &[Pose<D>], along: &Vector<f64, D>) -> Option<f64> {
        let depth = DEPTH * self.grid.spacing;
        let longest: f64 = self.grid.cells.iter().map(|&cells| f64::from(cells) * self.grid.spacing).sum();
        let mut way = 0.0;
        for _ in 0..MOST_STEPS {
            let moved: Vec<_> = places.iter().map(|x| x + along * way).collect();
            let gap = self.distance_to_obstacles(&moved, poses);
            if gap < -0.5 * depth {
                return Some(way);
            }
            way += gap.max(0.0) + depth;
            if way.is_nan() || way > longest {
                break;
            }
        }
        None
    }
}
