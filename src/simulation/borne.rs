//! The out-of-balance force after a grid reset in load steps: the residual of the last equilibrium on the new grid, which is carried over.

use super::{Reaction, Simulation};
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::kept::touch;
use crate::mechanics::loads::{Loads, PrescribedDof};
use crate::mechanics::residual::{Equilibrium, Inadmissible};
use crate::mechanics::schemes::Alphas;
use crate::mechanics::sweep::Supports;
use crate::mechanics::terms;
use crate::mechanics::transfer::Nodal;
use crate::pooled::Pooled;
use crate::tensor::Vector;

/// The last converged load step, from which the out-of-balance force on a new grid follows.
#[derive(Clone, Debug, PartialEq)]
pub struct Borne<const D: usize> {
    /// The loads of the step.
    pub loads: Loads<D>,
    /// The reaction of each prescribed condition.
    pub reactions: Vec<Reaction<D>>,
    /// Whether two bodies touched or shared nodes.
    pub(crate) together: bool,
    /// Particle positions at which the force field was evaluated; empty without a force field.
    pub(crate) asked: Vec<Vector<f64, D>>,
}

impl<const D: usize> Borne<D> {
    /// Reorders the particle positions like [`Particles::rearrange`](crate::particles::Particles::rearrange).
    pub(crate) fn rearrange(&mut self, order: &[u32]) {
        if !self.asked.is_empty() {
            self.asked = order.iter().map(|&from| self.asked[from as usize]).collect();
        }
    }

    /// The reaction of a condition; zero for a new condition.
    fn reaction(&self, condition: usize) -> Reaction<D> {
        self.reactions.get(condition).copied().unwrap_or(Reaction { force: Vector::zeros(), torque: 0.0 })
    }
}

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// Stores the last converged load step, with the force field evaluated at the positions `asked`. Stores nothing with inertia, and
    /// nothing while the grid is not reset.
    pub(super) fn bear(&mut self, reactions: Vec<Reaction<D>>, asked: Vec<Vector<f64, D>>, supports: &Supports<D>) {
        let carries = self.kept.is_none() && !self.settings.scheme.has_inertia();
        let together = carries && self.together(supports);
        self.borne = carries.then(|| Borne { loads: self.loads.clone(), reactions, together, asked });
    }

    fn together(&self, supports: &Supports<D>) -> bool {
        self.bodies.len() > 1 && touch(&self.particles, &self.grid, supports)
    }

    /// The out-of-balance force R₀ = R(0) at t_n on a new grid, under the loads of the last equilibrium. At prescribed nodes the last
    /// reactions are subtracted, so that they persist. Empty where a body has lost a condition or another body that held it: the reaction
    /// of a lost support must not act any longer.
    pub(super) fn unbalanced(
        &self,
        supports: &Supports<D>,
        nodal: &Nodal<D>,
        prescribed: &[PrescribedDof],
    ) -> Result<Pooled<Vector<f64, D>>, Inadmissible> {
        let Some(borne) = self.borne.as_ref().filter(|_| nodal.is_static()) else { return Ok(Pooled::default()) };
        let nothing = Reaction { force: Vector::zeros(), torque: 0.0 };
        let lost = |one| borne.reaction(one) != nothing && prescribed.iter().all(|dof| dof.owner != one);
        if (0..borne.reactions.len()).any(lost) || borne.together && !self.together(supports) {
            return Ok(Pooled::default());
        }
        let t = if self.settings.scheme.follows_path() { self.path.load } else { self.clock.time() };
        let nodal = Nodal { asked: supports.pool().collect(borne.asked.iter().copied()), ..nodal.clone() };
        let step = self.equilibrium(supports, &nodal, prescribed, Alphas::START, t).step;
        // With dt = 0, laws give the stress at t_n, without a change of internal variables.
        let at_start = Equilibrium::new(terms::Step { loads: &borne.loads, dt: 0.0, ..step }, prescribed);
        let (still, mut unbalanced): (Pooled<Vector<f64, D>>, Pooled<_>) = (supports.field(), supports.field());
        at_start.residual_into::<f64>(&still, &mut unbalanced)?;
        for condition in 0..self.loads.prescribed.len() {
            let dofs: Vec<_> = prescribed.iter().filter(|dof| dof.owner == condition).collect();
            self.leave(&borne.reaction(condition), condition, &dofs, supports, &mut unbalanced);
        }
        Ok(unbalanced)
    }

    /// Replaces the forces r_I at the nodes of a condition by their excess over its reaction (f, m). The excess is spread as a uniform
    /// force and a turn about the axis. The resultants are Σ r − f and Σ arm · r − m.
    fn leave(
        &self,
        reaction: &Reaction<D>,
        condition: usize,
        dofs: &[&PrescribedDof],
        supports: &Supports<D>,
        unbalanced: &mut [Vector<f64, D>],
    ) {
        // The moment is m = Σ arm · r. The turn uses the arms relative to their mean.
        let rotation = self.loads.prescribed[condition].rotation();
        let arm = |dof: &PrescribedDof| {
            let x = self.grid.position(self.grid.index(supports.active().ids()[dof.node]));
            rotation.map_or(0.0, |rotation| rotation.moment(&x, dof.component, 1.0))
        };
        let (mut counts, mut force, mut arms) = ([0.0; D], -reaction.force, Vector::<f64, D>::zeros());
        let mut moment = -reaction.torque;
        for dof in dofs {
            let (i, r) = (dof.component, unbalanced[dof.node][dof.component]);
            counts[i] += 1.0;
            force[i] += r;
            arms[i] += arm(dof);
            moment += arm(dof) * r;
        }
        let [force, mean] =
            [force, arms].map(|sum| Vector::<f64, D>::from_fn(|i, _| sum[i] / f64::max(counts[i], 1.0)));
        let mut turning = 0.0;
        for dof in dofs {
            moment -= arm(dof) * force[dof.component];
            turning += (arm(dof) - mean[dof.component]).powi(2);
        }
        let turn = if turning > 0.0 { moment / turning } else { 0.0 };
        for dof in dofs {
            let i = dof.component;
            unbalanced[dof.node][i] = force[i] + turn * (arm(dof) - mean[i]);
        }
    }
}
