//! Reactions of a step, and the work of all external forces.

use super::contacts::{ContactUpdate, halfway};
use super::{Reaction, Simulation, StepError};
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::residual::Equilibrium;
use crate::mechanics::schemes::Alphas;
use crate::mechanics::terms::{self, Role};
use crate::mechanics::transfer::Update;
use crate::mechanics::trial::Trial;
use crate::parallel;
use crate::pooled::Pooled;
use crate::tensor::Vector;

/// Forces, work and losses of a step.
pub(super) struct Accounts<const D: usize> {
    pub reactions: Vec<Reaction<D>>,
    /// The reactions on the bodies of each nodal field: those of the first condition, then those of the second one, and so on.
    pub by_field: Vec<Reaction<D>>,
    /// The work of loads, of moving walls and of moving obstacles.
    pub work: f64,
    /// The energy dissipated by damping and by friction.
    pub dissipated: f64,
    pub contacts: ContactUpdate<D>,
}

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// The reactions, the work of the step, and the energy dissipated by damping and friction.
    ///
    /// A reaction is the force at t_{n+1} plus J/Δt, with J the impulse, summed over a prescribed condition. The work of all external
    /// forces, including the reactions of moving walls, is Σ [½ (f_n + f_{n+1}) + J/Δt]·Δφ; in the energy–momentum scheme it is
    /// Σ (f_{n+½} + J/Δt)·Δφ. In the mixed form, `dilatation` is that of the cells at t_n.
    pub(super) fn accounts(
        &self,
        balanced: &Equilibrium<'_, D, L>,
        dphi: &[Vector<f64, D>],
        dilatation: &[f64],
        update: &Update<'_, D>,
    ) -> Result<Accounts<D>, StepError> {
        let (terms::Step { connectivity, nodal, .. }, phi) = (balanced.step, update.motion());
        let (t, dt) = (self.load(), self.clock.step());
        let before = nodal.motion_of(connectivity.nodes(), connectivity.pool());
        let free = self.free_after(&balanced.step, &before, phi)?;
        let poses = self.poses_after(&free, t + dt);
        let mut end = balanced;
        let after;
        if self.settings.scheme.instant() < 1.0 {
            let ends = self.equilibrium(connectivity, nodal, balanced.prescribed, self.settings.scheme.end(dt), t + dt);
            after = Equilibrium::new(terms::Step { poses: Some(&poses), ..ends.step }, ends.prescribed);
            // The stress at the end is evaluated here for the first time, and fails where det F ≤ 0.
            after.forces(Role::Stores, phi)?;
            end = &after;
        }
        let is_mean = balanced.step.alphas.discrete_gradient;
        let (by_field, mut work) = self.reactions(end, update, is_mean)?;
        let reactions = by_field.chunks(connectivity.field_count() as usize).map(Reaction::sum).collect();
        // At t_n: a = a_n and Δφ = 0.
        let start = self.equilibrium(connectivity, nodal, end.prescribed, Alphas::START, t);
        let middle = if is_mean { halfway(&before, phi) } else { Vec::new() };
        if end.prescribed.iter().any(|dof| dof.moving) {
            let mut residual: Pooled<Vector<f64, D>> = connectivity.pool().unspecified(phi.len());
            let share = if is_mean { 1.0 } else { 0.5 };
            match is_mean {
                true => balanced.residual_into(Trial::motion(&middle), &mut residual)?,
                false => start.residual_into(Trial { phi: &before, dilatation }, &mut residual)?,
            }
            for dof in end.prescribed {
                work += share * residual[dof.node][dof.component] * dof.step.increment;
            }
        }
        let work_of = |role| match is_mean {
            true => Ok(along(&balanced.forces(role, &middle)?, dphi)),
            false => end.forces(role, phi).and_then(|end| Ok(mean_work(&end, &start.forces(role, &before)?, dphi))),
        };
        work -= work_of(Role::Loads)?;
        let dissipated = if self.loads.damping.is_some() { work_of(Role::Dissipates)? } else { 0.0 };
        let contacts = self.contact_update(&balanced.step, [&before, phi], free, poses)?;
        let (work, dissipated) = (work + contacts.work, dissipated + contacts.friction_loss);
        Ok(Accounts { reactions, by_field, work, dissipated, contacts })
    }

    /// The reactions at the end of a step, by condition and nodal field, and their part of the work of moving walls: half of the force, or none of it where forces act in the
    /// middle, and the whole impulse.
    fn reactions(
        &self,
        end: &Equilibrium<'_, D, L>,
        update: &Update<'_, D>,
        is_mean: bool,
    ) -> Result<(Vec<Reaction<D>>, f64), StepError> {
        let (terms::Step { connectivity, .. }, phi, dt) = (end.step, update.motion(), self.clock.step());
        let conditions = &self.loads.prescribed;
        let fields = connectivity.field_count() as usize;
        let mut reactions = vec![Reaction::NONE; conditions.len() * fields];
        let mut work = 0.0;
        if !end.prescribed.is_empty() {
            let mut residual: Pooled<Vector<f64, D>> = connectivity.pool().unspecified(phi.len());
            end.residual_into(update.state(), &mut residual)?;
            for (dof, impulse) in end.prescribed.iter().zip(update.impulses()) {
                let (reaction, blow) = (residual[dof.node][dof.component], impulse / dt);
                mutant!("step: reactions and work lack the blow of a wall": blow = 0.0);
                let of_field = &mut reactions[dof.owner * fields + connectivity.field_of_node(dof.node) as usize];
                of_field.force[dof.component] += reaction + blow;
                if let Some(rotation) = conditions[dof.owner].rotation() {
                    let x = self.grid.position(self.grid.index(connectivity.active().id(dof.node))) + phi[dof.node];
                    of_field.torque += rotation.moment(&x, dof.component, reaction + blow);
                }
                work += (if is_mean { blow } else { 0.5 * reaction + blow }) * dof.step.increment;
            }
        }
        Ok((reactions, work))
    }
}

/// The work of a force along Δφ.
fn along<const D: usize>(force: &[Vector<f64, D>], dphi: &[Vector<f64, D>]) -> f64 {
    parallel::sum(dphi.len(), |node| force[node].dot(&dphi[node]))
}

/// The work of a force along Δφ, with the mean of its values at both ends of the step.
fn mean_work<const D: usize>(end: &[Vector<f64, D>], start: &[Vector<f64, D>], dphi: &[Vector<f64, D>]) -> f64 {
    parallel::sum(dphi.len(), |node| 0.5 * (end[node] + start[node]).dot(&dphi[node]))
}
