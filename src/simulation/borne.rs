//! What a load step leaves to a grid that is made anew: all that was in balance, so that what the new grid does not balance of it can be
//! carried over.

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

/// What the last load step balanced.
#[derive(Clone, Debug, PartialEq)]
pub struct Borne<const D: usize> {
    /// The loads.
    pub loads: Loads<D>,
    /// The reactions, of each prescribed condition.
    pub reactions: Vec<Reaction<D>>,
    /// Whether bodies moved nodes together.
    pub(crate) together: bool,
    /// Where the particles were as a field of forces was asked for; empty without one.
    pub(crate) asked: Vec<Vector<f64, D>>,
}

impl<const D: usize> Borne<D> {
    /// As [`Particles::rearrange`](crate::particles::Particles::rearrange).
    pub(crate) fn rearrange(&mut self, order: &[u32]) {
        if !self.asked.is_empty() {
            self.asked = order.iter().map(|&from| self.asked[from as usize]).collect();
        }
    }

    /// The reaction of a condition; none of one that is new.
    fn reaction(&self, condition: usize) -> Reaction<D> {
        self.reactions.get(condition).copied().unwrap_or(Reaction { force: Vector::zeros(), torque: 0.0 })
    }
}

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// What a step has balanced whose particles were `asked` there; nothing with inertia, nor where the grid stays.
    pub(super) fn bear(&mut self, reactions: Vec<Reaction<D>>, asked: Vec<Vector<f64, D>>, supports: &Supports<D>) {
        let carries = self.kept.is_none() && !self.settings.scheme.has_inertia();
        let together = carries && self.together(supports);
        self.borne = carries.then(|| Borne { loads: self.loads.clone(), reactions, together, asked });
    }

    fn together(&self, supports: &Supports<D>) -> bool {
        self.bodies.len() > 1 && touch(&self.particles, &self.grid, supports)
    }

    /// R₀ = R(0) at t_n on a grid that is new, under the loads that were in balance on the one before; at prescribed nodes less the reactions
    /// that were, which so go on. Nothing where a body has lost what held it, a condition or another body: that must not hold it any longer.
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
        // Laws are asked what they are at t_n, and not what becomes of them in a step.
        let at_start = Equilibrium::new(terms::Step { loads: &borne.loads, dt: 0.0, ..step }, prescribed);
        let (still, mut unbalanced): (Pooled<Vector<f64, D>>, Pooled<_>) = (supports.field(), supports.field());
        at_start.residual_into::<f64>(&still, &mut unbalanced)?;
        for condition in 0..self.loads.prescribed.len() {
            let dofs: Vec<_> = prescribed.iter().filter(|dof| dof.owner == condition).collect();
            self.leave(&borne.reaction(condition), condition, &dofs, supports, &mut unbalanced);
        }
        Ok(unbalanced)
    }

    /// Leaves in R₀ what the forces r_I at the nodes of a condition are more than its reaction (f, m): the same at each node, and a turn about
    /// its axis.
    fn leave(
        &self,
        reaction: &Reaction<D>,
        condition: usize,
        dofs: &[&PrescribedDof],
        supports: &Supports<D>,
        unbalanced: &mut [Vector<f64, D>],
    ) {
        // Of m = Σ arm · r, the arms from their mean.
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
