//! The out-of-balance force R₀: the residual, on a new grid, of the last state that was in balance on the old grid. R₀ is a constant force
//! on the nodes in all steps until the next reset. Without R₀, each reset would add an error of its own to the stresses.

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
    fn reasons(Given { scheme, may_reset, .. }: Given<'_, D>) -> Vec<Reason> {
        vec![("out-of-balance force", may_reset && !scheme.has_inertia(), "after a grid reset in load steps".into())]
    }
}

dead_load!(CarriedOver<'_, D>, "out-of-balance force", Stores);
