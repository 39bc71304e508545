//! What stays after a step: the grid, unless something makes it anew, and its shape functions.

use super::Simulation;
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::kept::{Kept, Renewal, touch};
use crate::mechanics::loads::PrescribedDof;
use crate::mechanics::sweep::Supports;

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// Keeps the grid, unless a strain, a wall or another body makes it anew; and its functions, or their memory, with the particles in
    /// their order.
    pub(super) fn keep(&mut self, kept: Kept<D>, supports: Supports<D>, strain: f64, prescribed: &[PrescribedDof]) {
        if self.clock.steps() == 0 {
            self.held = prescribed.iter().map(|dof| dof.owner).collect();
        }
        let renewal = self.settings.renewal;
        let contact = renewal != Renewal::EveryStep && self.in_contact(&kept, &supports, prescribed);
        let keeps = renewal.keeps(strain) && !contact;
        self.kept = keeps.then_some(kept);
        self.bear();
        let leaping = supports.leaping();
        leaping.iter().for_each(|order| self.rearrange(order));
        self.workspace.supports = Some(if leaping.is_some() { supports.rearranged() } else { supports });
        // Those of particles that lie elsewhere now are good for their memory alone.
        self.workspace.serves = keeps && leaping.is_none();
    }

    /// Whether a body has come to a wall; with inertia also whether it feels one still, or another body: on a grid that is kept it would
    /// never leave.
    fn in_contact(&mut self, kept: &Kept<D>, supports: &Supports<D>, prescribed: &[PrescribedDof]) -> bool {
        let Self { particles, grid, loads, held, .. } = self;
        let comes = kept.met(&particles.position, &loads.prescribed, grid, supports.active());
        held.retain(|one| !comes.contains(one));
        let inertia = self.settings.scheme.has_inertia();
        !comes.is_empty()
            || (inertia && prescribed.iter().any(|dof| !held.contains(&dof.owner)))
            || (inertia && self.bodies.len() > 1 && touch(particles, grid, supports))
    }
}

impl<const D: usize, L, A> Simulation<D, L, A> {
    /// Remembers the loads that are in balance where the next grid is new; with inertia nothing is carried over.
    pub(crate) fn bear(&mut self) {
        let carries = self.kept.is_none() && !self.settings.scheme.has_inertia();
        self.borne = carries.then(|| self.loads.clone());
    }
}
