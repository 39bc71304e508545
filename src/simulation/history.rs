//! The history of a simulation: the state of a grid that is not reset, and what decides when to reset it (`mechanics::reference`).

use super::Simulation;
use super::work::Accounts;
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::loads::PrescribedDof;
use crate::mechanics::reference::{GridReset, LastEquilibrium, pairs, reached_body, reached_conditions, touch};
use crate::mechanics::residual::Inadmissible;
use crate::mechanics::schemes::Alphas;
use crate::mechanics::sweep::Connectivity;
use crate::mechanics::transfer::{Committed, Nodal, Update};
use crate::pooled::Pooled;
use crate::tensor::Vector;
use std::collections::BTreeSet;
use std::sync::Arc;

/// The state that the next step takes from earlier steps, beside the particles. A simulation writes it; see [`Simulation::forget`].
#[derive(Clone, Debug, Default)]
pub struct History<const D: usize> {
    /// The nodal state; `None` if the next step resets the grid.
    pub(crate) grid: Option<Nodal<D>>,
    /// Δφ/Δt of the last step; empty if the next step resets the grid.
    pub(crate) rate: Pooled<Vector<f64, D>>,
    /// The prescribed conditions that held bodies in the first step, without those that a body has reached since. All other conditions are
    /// contacts.
    pub(crate) constrained: BTreeSet<usize>,
    /// Pairs of bodies that touched at the start.
    pub(crate) bonded: BTreeSet<[u32; 2]>,
    /// The last load step, if the next one resets the grid and no surface has got more points since.
    pub(crate) equilibrium: Option<LastEquilibrium<D>>,
}

impl<const D: usize> History<D> {
    /// Whether the next step resets the grid.
    pub fn resets_grid(&self) -> bool {
        self.grid.is_none()
    }

    /// The prescribed conditions, by index, that have held bodies since the first step. All other conditions are contacts.
    pub fn constrained(&self) -> &BTreeSet<usize> {
        &self.constrained
    }

    /// Pairs of bodies, by index, that touched at the start. In load steps they stay bonded.
    pub fn bonded(&self) -> &BTreeSet<[u32; 2]> {
        &self.bonded
    }
}

impl<const D: usize, L, A> Simulation<D, L, A> {
    /// Clears the history. Call this after a change of particle positions, deformations, laws or shape functions by hand: otherwise the
    /// next step starts from the grid of the last one, and ignores or carries over the change.
    pub fn forget(&mut self) {
        self.particles.reference = None;
        self.history = History::default();
    }

    /// Whether a strain, a wall or another body may cause a grid reset.
    pub(crate) fn may_reset(&self) -> bool {
        self.settings.grid_reset != GridReset::Never || !self.loads.prescribed.is_empty() || self.bodies.len() > 1
    }

    /// The positions at which the coming load step evaluates a force field, by particle id; empty if no step will ask for them.
    pub(super) fn field_positions(&self) -> Arc<[Vector<f64, D>]> {
        if self.loads.field.is_none() || self.settings.scheme.has_inertia() {
            return Arc::default();
        }
        self.particles.places().iter().map(|&p| self.particles.position[p as usize]).collect()
    }
}

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// Writes a step to the particles and its work to the accounts, and decides whether the next step resets the grid. `projected` is the nodal state at t_n without the
    /// prescribed values. Returns the share of the volume of plastic bodies that flowed plastically.
    pub(super) fn accept(
        &mut self,
        update: Update<'_, D>,
        projected: &Nodal<D>,
        prescribed: &[PrescribedDof],
        accounts: &Accounts<D>,
        connectivity: &Connectivity<D>,
    ) -> f64 {
        self.external_work += accounts.work;
        self.dissipated += accounts.dissipated;
        self.accept_contacts(&accounts.contacts);
        let dt = self.clock.step();
        let field_positions = self.field_positions();
        let mut grid = None;
        if self.settings.grid_reset != GridReset::EveryStep {
            self.particles.store_reference();
            self.history.rate = update.rate(dt, connectivity.pool());
            grid = Some(update.end(projected, connectivity.pool()));
        }
        let Committed { strain, yielding } = update.commit(&mut self.particles, &self.bodies, connectivity, dt);
        if self.clock.steps() == 0 {
            self.record_first_contacts(prescribed, connectivity);
        }
        // Contact detection also updates the constrained conditions.
        let contact = grid.is_some() && self.in_contact(connectivity, prescribed);
        self.history.grid = grid.filter(|_| !contact && self.settings.grid_reset.keeps(strain));
        self.history.equilibrium = None;
        if self.history.resets_grid() {
            self.history.rate = Pooled::default();
            self.particles.reference = None;
            if !self.settings.scheme.has_inertia() {
                let touching = self.bodies_touch(connectivity);
                let last = LastEquilibrium::new(&self.loads, accounts.by_field.clone(), touching, field_positions);
                self.history.equilibrium = Some(last);
            }
        }
        yielding
    }

    /// Records the prescribed conditions that hold bodies from the start, and the bodies that touch.
    fn record_first_contacts(&mut self, prescribed: &[PrescribedDof], connectivity: &Connectivity<D>) {
        self.history.constrained = prescribed.iter().map(|dof| dof.owner).collect();
        if self.settings.grid_reset != GridReset::EveryStep && self.bodies.len() > 1 {
            let at_start = self.particles.reference().position;
            self.history.bonded = pairs(at_start, &self.particles.body, connectivity);
        }
    }

    fn bodies_touch(&self, connectivity: &Connectivity<D>) -> bool {
        self.bodies.len() > 1 && touch(&self.particles, connectivity)
    }

    /// Whether a contact, a prescribed condition outside [`History::constrained`], has active nodes in this step.
    pub(super) fn feels_wall(&self, prescribed: &[PrescribedDof]) -> bool {
        self.clock.steps() > 0 && prescribed.iter().any(|dof| !self.history.constrained.contains(&dof.owner))
    }

    /// Whether a body has reached a wall, or in load steps another body. With inertia, also whether a body still feels a wall or touches
    /// another body: without a grid reset, it would never leave.
    fn in_contact(&mut self, connectivity: &Connectivity<D>, prescribed: &[PrescribedDof]) -> bool {
        let reached = reached_conditions(&self.particles, &self.loads.prescribed, connectivity);
        self.history.constrained.retain(|one| !reached.contains(one));
        if !reached.is_empty() {
            return true;
        }
        if self.settings.scheme.has_inertia() {
            return self.feels_wall(prescribed) || self.bodies_touch(connectivity);
        }
        self.bodies.len() > 1 && reached_body(&self.particles, &self.history.bonded, connectivity)
    }

    /// The out-of-balance force R₀ on a new grid; empty with inertia and on the first grid. Also empty where a body has lost a condition or
    /// another body that held it: the reaction of a lost support must not act any longer.
    pub(super) fn out_of_balance(
        &self,
        connectivity: &Connectivity<D>,
        nodal: &Nodal<D>,
        prescribed: &[PrescribedDof],
    ) -> Result<Pooled<Vector<f64, D>>, Inadmissible> {
        let Some(last) = self.history.equilibrium.as_ref().filter(|_| nodal.is_static()) else {
            return Ok(Pooled::default());
        };
        if last.lost_support(connectivity, prescribed) || last.touching && !self.bodies_touch(connectivity) {
            return Ok(Pooled::default());
        }
        last.out_of_balance(
            self.equilibrium(connectivity, nodal, prescribed, Alphas::START, self.load()).step,
            prescribed,
        )
    }
}
