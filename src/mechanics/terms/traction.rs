//! Nominal tractions −Σ_Γ T N_I A, dead loads on the particles of a surface.

use super::{Given, Reason, Role, Step, Sum, Term, dead_load};
use crate::mechanics::constitutive::Inadmissible;
use crate::mechanics::loads::Pressing;
use crate::mechanics::sweep::Number;
use crate::pooled::Pooled;
use crate::tensor::Vector;

/// Σ_Γ T N_I A
pub struct Traction<const D: usize>(Pooled<Vector<f64, D>>);

impl<const D: usize> Traction<D> {
    pub(super) fn of<L>(step: &Step<'_, D, L>) -> Option<Self> {
        let mut force = None;
        for load in &step.loads.surface {
            let Pressing::Traction(traction) = load.pressing else { continue };
            let force = force.get_or_insert_with(|| step.supports.field::<Vector<f64, D>>());
            let traction = traction * load.curve.value(step.time);
            mutant!("loads: a traction has the other sign": traction = -traction);
            for point in &load.points {
                for (node, n, _) in step.supports.of(point.particle) {
                    force[node] += traction * (point.area * n);
                }
            }
        }
        force.map(Self)
    }

    fn reasons(given: Given<'_, D>) -> Vec<Reason> {
        let loaded = given.loads.loaded(|pressing| matches!(pressing, Pressing::Traction(_)));
        vec![("tractions", loaded > 0, format!("{loaded} loaded particles"))]
    }
}

dead_load!(Traction<D>, "traction", Loads);
