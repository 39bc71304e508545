//! What was out of balance when the grid was made anew, carried over as a force on its nodes: in balance on the grid before, and to be so on
//! this one, or each new grid adds an error of its own to the stresses.

use super::{Given, Reason, Role, Step, Sum, Term, dead_load};
use crate::mechanics::kept::Renewal;
use crate::mechanics::point::Inadmissible;
use crate::mechanics::sweep::Number;
use crate::pooled::Pooled;
use crate::tensor::Vector;

/// R₀
pub struct CarriedOver<const D: usize>(Pooled<Vector<f64, D>>);

impl<const D: usize> CarriedOver<D> {
    pub(super) fn of<L>(step: &Step<'_, D, L>) -> Option<Self> {
        let unbalanced = &step.nodal.unbalanced;
        (!unbalanced.is_empty()).then(|| Self(unbalanced.clone()))
    }

    fn reasons(Given { scheme, renewal, .. }: Given<'_, D>) -> Vec<Reason> {
        let used = !scheme.has_inertia() && renewal != Renewal::Never;
        vec![("carried over", used, "in load steps, what a grid that is made anew does not balance".into())]
    }
}

dead_load!(CarriedOver, "carried over", Stores);
