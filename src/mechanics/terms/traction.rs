//! Nominal tractions −Σ_Γ T N_I A, dead loads on the particles of a surface.

use super::{Role, Step, Sum, Term, dead_energy, subtract_dead};
use crate::mechanics::loads::Pressing;
use crate::mechanics::point::Inadmissible;
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
            for point in &load.points {
                for (node, n, _) in step.supports.of(point.particle) {
                    force[node] += traction * (point.area * n);
                }
            }
        }
        force.map(Self)
    }
}

impl<const D: usize> Term<D> for Traction<D> {
    const NAME: &'static str = "traction";
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
