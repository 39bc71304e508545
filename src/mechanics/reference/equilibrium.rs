//! The out-of-balance force R₀ after a grid reset in load steps: the residual of the last equilibrium on the new grid.

use crate::material::Law;
use crate::mechanics::loads::ForceField;
use crate::mechanics::loads::{Loads, PrescribedDof, Reaction};
use crate::mechanics::residual::{Equilibrium, Inadmissible};
use crate::mechanics::sweep::Connectivity;
use crate::mechanics::terms::Step;
use crate::mechanics::trial::Trial;
use crate::pooled::Pooled;
use crate::tensor::Vector;
use std::sync::Arc;

/// The last converged load step, from which the out-of-balance force on a new grid follows.
#[derive(Clone, Debug)]
pub struct LastEquilibrium<const D: usize> {
    /// The loads of the step. A force field keeps the values that it had there.
    pub(crate) loads: Loads<D>,
    /// The reactions of each prescribed condition on the bodies of each nodal field. Bodies of different fields do not share a reaction.
    pub(crate) reactions: Vec<Reaction<D>>,
    /// Whether two bodies touched or shared nodes.
    pub(crate) touching: bool,
    /// The positions at which a force field was evaluated, by particle id; empty without a force field.
    pub(crate) field_positions: Arc<[Vector<f64, D>]>,
}

impl<const D: usize> LastEquilibrium<D> {
    /// The equilibrium under `loads`, with the force field evaluated at `field_positions`.
    pub(crate) fn new(
        loads: &Loads<D>,
        reactions: Vec<Reaction<D>>,
        touching: bool,
        field_positions: Arc<[Vector<f64, D>]>,
    ) -> Self {
        let mut loads = loads.clone();
        if let Some(ForceField(field)) = loads.field.take() {
            let positions = field_positions.clone();
            loads.field = Some(ForceField(Arc::new(move |id, x, t| field(id, positions.get(id).unwrap_or(x), t))));
        }
        Self { loads, reactions, touching, field_positions }
    }

    /// Whether a condition that held bodies of a nodal field in this equilibrium has no node of the field among `prescribed`.
    pub(crate) fn lost_support(&self, connectivity: &Connectivity<D>, prescribed: &[PrescribedDof]) -> bool {
        mutant!("reference: a support that is lost still holds": { return false; });
        let fields = connectivity.field_count() as usize;
        let mut holds = vec![false; self.reactions.len()];
        for dof in prescribed {
            let holder = dof.owner * fields + connectivity.field_of_node(dof.node) as usize;
            holds.get_mut(holder).into_iter().for_each(|holds| *holds = true);
        }
        self.reactions.iter().zip(holds).any(|(reaction, holds)| *reaction != Reaction::NONE && !holds)
    }

    /// R₀ = R(0) at t_n on a new grid, under the loads of this equilibrium; `step` has the shape functions of the new grid. At prescribed
    /// nodes the last reactions are subtracted, so that they persist.
    ///
    /// # Errors
    /// det F ≤ 0.
    pub(crate) fn out_of_balance<L: Law>(
        &self,
        step: Step<'_, D, L>,
        prescribed: &[PrescribedDof],
    ) -> Result<Pooled<Vector<f64, D>>, Inadmissible> {
        let conditions = &step.loads.prescribed;
        let connectivity = step.connectivity;
        // The contacts of the last equilibrium are those at the start of this step, found anew on the new grid.
        let loads = Loads { contacts: step.loads.contacts.clone(), ..self.loads.clone() };
        mutant!("reference: contact is that of the old grid": loads = self.loads.clone());
        // With dt = 0, laws give the stress at t_n, without a change of internal variables.
        let at_start = Equilibrium::new(Step { loads: &loads, dt: 0.0, ..step }, prescribed);
        mutant!("reference: relaxation within a step is carried over": at_start = Equilibrium::new(Step { loads: &loads, ..step }, prescribed));
        let still: Pooled<Vector<f64, D>> = connectivity.field();
        let mut force: Pooled<Vector<f64, D>> = connectivity.field();
        at_start.residual_into(Trial::motion(&still), &mut force)?;
        let fields = connectivity.field_count() as usize;
        for number in 0..conditions.len() * fields {
            let condition = &conditions[number / fields];
            let holder = |dof: &&PrescribedDof| dof.owner * fields + connectivity.field_of_node(dof.node) as usize;
            let dofs: Vec<_> = prescribed.iter().filter(|dof| holder(dof) == number).collect();
            // The moment is m = Σ arm · r.
            let arm = |dof: &PrescribedDof| {
                let x = connectivity.grid().position(connectivity.grid().index(connectivity.active().id(dof.node)));
                condition.rotation().map_or(0.0, |rotation| rotation.moment(&x, dof.component, 1.0))
            };
            // A new condition has no reaction.
            let reaction = self.reactions.get(number).unwrap_or(&Reaction::NONE);
            subtract(reaction, &dofs, arm, &mut force);
        }
        Ok(force)
    }
}

/// Replaces the forces r_I at the nodes of a condition by their excess over its reaction (f, m). The excess is spread as a uniform force and
/// a turn about the axis. The resultants are Σ r − f and Σ arm · r − m.
fn subtract<const D: usize>(
    reaction: &Reaction<D>,
    dofs: &[&PrescribedDof],
    arm: impl Fn(&PrescribedDof) -> f64,
    out: &mut [Vector<f64, D>],
) {
    let (mut counts, mut force, mut arms) = ([0.0; D], -reaction.force, Vector::<f64, D>::zeros());
    let mut moment = -reaction.torque;
    for dof in dofs {
        let (i, r) = (dof.component, out[dof.node][dof.component]);
        counts[i] += 1.0;
        force[i] += r;
        arms[i] += arm(dof);
        moment += arm(dof) * r;
    }
    let [force, mean] = [force, arms].map(|sum| Vector::<f64, D>::from_fn(|i, _| sum[i] / f64::max(counts[i], 1.0)));
    // The turn uses the arms relative to their mean.
    let mut turning = 0.0;
    for dof in dofs {
        moment -= arm(dof) * force[dof.component];
        turning += (arm(dof) - mean[dof.component]).powi(2);
    }
    let turn = if turning > 0.0 { moment / turning } else { 0.0 };
    for dof in dofs {
        let i = dof.component;
        out[dof.node][i] = force[i] + turn * (arm(dof) - mean[i]);
    }
}
