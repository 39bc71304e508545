//! The out-of-balance force R₀ of the last converged state on a grid that has just been reset, carried over as a force on the nodes. The
//! state was in balance on the old grid. Without R₀, each reset would add an error of its own to the stresses.

use super::{Given, Reason, Role, Step, Sum, Term, dead_load};
use crate::mechanics::constitutive::Inadmissible;
use crate::mechanics::sweep::Number;
use crate::tensor::Vector;

/// R₀, the out-of-balance force.
pub struct CarriedOver<'a, const D: usize>(&'a [Vector<f64, D>]);

impl<'a, const D: usize> CarriedOver<'a, D> {
    pub(super) fn of<L>(step: &Step<'a, D, L>) -> Option<Self> {
        let force = &step.nodal.out_of_balance;
        mutant!("reference: no force is carried over": { return None; });
        (!force.is_empty()).then_some(Self(force))
    }
}

impl<const D: usize> CarriedOver<'_, D> {
    fn reasons(Given { scheme, renews, .. }: Given<'_, D>) -> Vec<Reason> {
        vec![("out-of-balance force", renews && !scheme.has_inertia(), "after a grid reset in load steps".into())]
    }
}

dead_load!(CarriedOver<'_, D>, "out-of-balance force", Stores);
