//! The motion that Newton's method starts from.

use super::{InitialGuess, Simulation, StepError};
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::loads::{Pose, PrescribedDof};
use crate::mechanics::residual::Equilibrium;
use crate::mechanics::sweep::Supports;
use crate::mechanics::transfer::Nodal;
use crate::pooled::Pooled;
use crate::tensor::Vector;

/// The depth, in spacings, of a body that is moved into an obstacle.
const DEPTH: f64 = 0.01;

/// Steps of the search for the obstacle. Each one is the distance of the nearest obstacle.
const MOST_STEPS: u32 = 1000;

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// The Δφ that Newton's method starts from.
    pub(super) fn initial_guess(&self, supports: &Supports<D>, nodal: &Nodal<D>, dt: f64) -> Pooled<Vector<f64, D>> {
        let mut dphi: Pooled<Vector<f64, D>> = supports.field();
        let rate: &[Vector<f64, D>] = match self.settings.initial_guess {
            InitialGuess::Zero => &[],
            InitialGuess::Velocity => &nodal.velocity,
            InitialGuess::LastStep => &self.history.rate,
        };
        dphi.iter_mut().zip(rate).for_each(|(dphi, rate)| *dphi = rate * dt);
        dphi
    }

    /// Moves bodies into the obstacles that hold them, in load steps. Such a body has no stiffness while it touches nothing, so Newton's method
    /// would not find the obstacle. The body moves along the resultant of its loads, in the directions that no condition prescribes.
    pub(super) fn meet_obstacles(
        &self,
        equilibrium: &Equilibrium<'_, D, L>,
        prescribed: &[PrescribedDof],
        phi: &mut [Vector<f64, D>],
    ) -> Result<(), StepError> {
        let (contacts, supports) = (&self.loads.contacts, equilibrium.step.supports);
        if self.settings.scheme.has_inertia() || contacts.obstacles.is_empty() {
            return Ok(());
        }
        let residual = equilibrium.residual(phi)?;
        let poses: Vec<Pose<D>> = contacts.obstacles.iter().map(|one| one.pose(equilibrium.step.time)).collect();
        let mut positions = self.particles.reference().position.to_vec();
        supports.each_value(phi, |p, u| positions[p] += u);
        for field in 0..supports.field_count() {
            let nodes = supports.nodes_of(field);
            let is_free = |k: usize| !prescribed.iter().any(|dof| nodes.contains(&dof.node) && dof.component == k);
            let load: Vector<f64, D> = -residual[nodes.clone()].iter().sum::<Vector<f64, D>>();
            let free = Vector::<f64, D>::from_fn(|k, _| if is_free(k) { load[k] } else { 0.0 });
            let along = free.try_normalize(0.0);
            let particles = contacts.points.iter().map(|point| point.particle);
            let own: Vec<_> = particles.filter(|&p| supports.field_of(self.particles.body[p]) == field).collect();
            if let Some(motion) = along.and_then(|along| self.way_to_obstacle(&own, &positions, &poses, &along)) {
                phi[nodes].iter_mut().for_each(|phi| *phi += motion);
            }
        }
        Ok(())
    }

    /// The motion along a unit vector that takes the first of the particles `own` into an obstacle; `None` if one is in an obstacle already, or
    /// if there is no obstacle on the way.
    fn way_to_obstacle(
        &self,
        own: &[usize],
        positions: &[Vector<f64, D>],
        poses: &[Pose<D>],
        along: &Vector<f64, D>,
    ) -> Option<Vector<f64, D>> {
        let (obstacles, depth) = (&self.loads.contacts.obstacles, DEPTH * self.grid.spacing);
        let distance = |way: f64| {
            let of = |&p: &usize| {
                let x = positions[p] + along * way;
                let all = obstacles.iter().zip(poses).map(|(one, pose)| one.shape.signed_distance(&pose.to_frame(&x)));
                all.fold(f64::INFINITY, f64::min)
            };
            own.iter().map(of).fold(f64::INFINITY, f64::min)
        };
        let mut way = 0.0;
        if distance(way) < 0.0 {
            return None;
        }
        let longest: f64 = self.grid.cells.iter().map(|&cells| f64::from(cells) * self.grid.spacing).sum();
        for _ in 0..MOST_STEPS {
            let gap = distance(way);
            if gap < -0.5 * depth {
                return Some(along * way);
            }
            way += gap.max(0.0) + depth;
            if way.is_nan() || way > longest {
                break;
            }
        }
        None
    }
}
