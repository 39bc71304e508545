//! Body forces −Σ_p m b N_I: gravity, and fields b(x, t) given in code.

use super::{Given, Reason, Role, Step, Sum, Term, dead_load};
use crate::mechanics::constitutive::Inadmissible;
use crate::mechanics::loads::ForceField;
use crate::mechanics::sweep::Number;
use crate::pooled::Pooled;
use crate::tensor::Vector;

/// Σ_p m b N_I, a dead load.
pub struct BodyForce<const D: usize>(Pooled<Vector<f64, D>>);

impl<const D: usize> BodyForce<D> {
    pub(super) fn of<L>(step: &Step<'_, D, L>) -> Option<Self> {
        let (loads, particles) = (step.loads, step.particles);
        if loads.gravity.is_none() && loads.field.is_none() {
            return None;
        }
        let mut force: Pooled<Vector<f64, D>> = step.supports.field();
        if let Some(gravity) = &loads.gravity {
            // Σ_p m b N_I = m_I b: gravity is uniform, so the lumped mass already holds the sum.
            let b = gravity.acceleration * gravity.curve.value(step.time);
            force.iter_mut().zip(&step.nodal.mass).for_each(|(force, &m)| *force = b * m);
        }
        if let Some(ForceField(field)) = &loads.field {
            let time = step.time;
            let of_particle = |p: usize| field(particles.id[p] as usize, &particles.position[p], time);
            step.supports.spread(&mut force, |p| of_particle(p) * particles.mass[p]);
        }
        Some(Self(force))
    }

    fn reasons(given: Given<'_, D>) -> Vec<Reason> {
        let Given { loads, scheme, .. } = given;
        let why = match (&loads.gravity, &loads.field) {
            (None, None) => "only with gravity",
            (_, Some(_)) => "it varies: one pass over particles a step",
            (Some(_), None) if scheme.has_inertia() => "from the lumped mass: no pass over particles of its own",
            (Some(_), None) => "one pass over particles a step, for the nodal mass it acts on",
        };
        vec![("gravity", loads.gravity.is_some() || loads.field.is_some(), why.into())]
    }
}

dead_load!(BodyForce<D>, "body force", Loads);
