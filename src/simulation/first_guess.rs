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
        let poses: Vec<Pose<D>> = contacts.obstacles.iter().map(|one| one.pose(equilibrium.step.time)).collect();
        let mut positions = self.particles.reference().position.to_vec();
        positions.iter_mut().zip(&*supports.values(phi)).for_each(|(x, u)| *x += u);
        let own = |field: u32| {
            let particles = contacts.points.iter().map(|point| point.particle);
            let own = particles.filter(|&p| supports.field_of(self.particles.body[p]) == field);
            own.map(|p| positions[p]).collect::<Vec<_>>()
        };
        let apart = (0..supports.field_count()).map(|field| (field, own(field)));
        let apart: Vec<_> = apart.filter(|(_, own)| self.distance_to_obstacles(own, &poses) >= 0.0).collect();
        if apart.is_empty() {
            return Ok(());
        }
        let residual = equilibrium.residual(phi)?;
        for (field, own) in apart {
            let nodes = supports.nodes_of(field);
            let is_free = |k: usize| !prescribed.iter().any(|dof| nodes.contains(&dof.node) && dof.component == k);
            let load: Vector<f64, D> = -residual[nodes.clone()].iter().sum::<Vector<f64, D>>();
            let free = Vector::<f64, D>::from_fn(|k, _| if is_free(k) { load[k] } else { 0.0 });
            let along = free.try_normalize(0.0);
            if let Some(motion) = along.and_then(|along| self.way_to_obstacle(&own, &poses, &along)) {
                phi[nodes].iter_mut().for_each(|phi| *phi += motion);
            }
        }
        Ok(())
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

    /// The motion along a unit vector that takes the first of the places into an obstacle; `None` if there is no obstacle on the way.
    fn way_to_obstacle(
        &self,
        places: &[Vector<f64, D>],
        poses: &[Pose<D>],
        along: &Vector<f64, D>,
    ) -> Option<Vector<f64, D>> {
        let depth = DEPTH * self.grid.spacing;
        let longest: f64 = self.grid.cells.iter().map(|&cells| f64::from(cells) * self.grid.spacing).sum();
        let mut way = 0.0;
        for _ in 0..MOST_STEPS {
            let moved: Vec<_> = places.iter().map(|x| x + along * way).collect();
            let gap = self.distance_to_obstacles(&moved, poses);
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
