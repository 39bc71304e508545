//! Body forces −Σ_p m b N_I: gravity, and fields b(x, t) given in code.

use super::{Role, Step, Sum, Term, dead_energy, subtract_dead};
use crate::mechanics::point::Inadmissible;
use crate::mechanics::sweep::Number;
use crate::pooled::Pooled;
use crate::tensor::Vector;
use std::fmt::{Debug, Formatter};
use std::sync::Arc;

/// A force per mass, `(id of the particle, its position x_n, t)`.
pub type Field<const D: usize> = dyn Fn(usize, &Vector<f64, D>, f64) -> Vector<f64, D> + Send + Sync;

/// A force per mass that varies. It acts where particles are at the beginning of a step.
#[derive(Clone)]
pub struct ForceField<const D: usize>(pub Arc<Field<D>>);

impl<const D: usize> Debug for ForceField<D> {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str("ForceField")
    }
}

/// Fields are the same if they are one.
impl<const D: usize> PartialEq for ForceField<D> {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

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
}

impl<const D: usize> Term<D> for BodyForce<D> {
    const NAME: &'static str = "body force";
    const ROLE: Role = Role::Loads;

    fn add_at_nodes<T: Number>(&self, _: &[Vector<T, D>], out: &mut [Vector<T, D>]) {
        subtract_dead(&self.0, out);
    }

    fn energy<T: Number>(&self, dphi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
        Some(Ok(dead_energy(&self.0, dphi)))
    }

    fn add_magnitudes_at_nodes(&self, _: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        out.iter_mut().zip(&self.0).for_each(|(out, force)| *out += force.abs());
    }
}
