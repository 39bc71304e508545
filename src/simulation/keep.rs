//! The end of a step: the grid reset, and the shape functions stored for the next step.

use super::{Reaction, Simulation};
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::kept::{Kept, Renewal, pairs, touch};
use crate::mechanics::loads::PrescribedDof;
use crate::mechanics::sweep::Supports;
use crate::tensor::Vector;

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// Keeps the grid, unless a strain, a wall or another body makes a reset necessary. Stores the shape functions, or their memory alone.
    /// Reorders the particles if passes over the particles leap too often in memory.
    pub(super) fn keep(
        &mut self,
        kept: Kept<D>,
        supports: Supports<D>,
        strain: f64,
        prescribed: &[PrescribedDof],
        (reactions, asked): (Vec<Reaction<D>>, Vec<Vector<f64, D>>),
    ) {
        if self.clock.steps() == 0 {
            self.held = prescribed.iter().map(|dof| dof.owner).collect();
        }
        let renewal = self.settings.renewal;
        if self.clock.steps() == 0 && self.bodies.len() > 1 {
            self.joined = pairs(&kept.position, &self.particles.body, &self.grid);
        }
        let contact = renewal != Renewal::EveryStep && self.in_contact(&kept, &supports, prescribed);
        let keeps = renewal.keeps(strain) && !contact;
        self.kept = keeps.then_some(kept);
        self.bear(reactions, asked, &supports);
        let leaping = supports.leaping();
        leaping.iter().for_each(|order| self.rearrange(order));
        self.workspace.supports = Some(if leaping.is_some() { supports.rearranged() } else { supports });
        // After the reordering, only the memory of the shape functions is of use.
        self.workspace.serves = keeps && leaping.is_none();
    }

    /// Whether a body has come to a wall, or in load steps to another body. With inertia, also whether a body still feels a wall or touches
    /// another body: without a grid reset, it would never leave.
    fn in_contact(&mut self, kept: &Kept<D>, supports: &Supports<D>, prescribed: &[PrescribedDof]) -> bool {
        let Self { particles, grid, loads, held, joined, .. } = self;
        let comes = kept.met(&particles.position, &loads.prescribed, grid, supports.active());
        held.retain(|one| !comes.contains(one));
        let inertia = self.settings.scheme.has_inertia();
        !comes.is_empty()
            || (inertia && prescribed.iter().any(|dof| !held.contains(&dof.owner)))
            || (self.bodies.len() > 1
                && if inertia { touch(particles, grid, supports) } else { kept.meets(particles, joined, grid) })
    }
}

impl<const D: usize, L, A> Simulation<D, L, A> {
    /// Whether a strain, a wall or another body may cause a grid reset.
    pub(crate) fn may_renew(&self) -> bool {
        self.settings.renewal != Renewal::Never || !self.loads.prescribed.is_empty() || self.bodies.len() > 1
    }
}
