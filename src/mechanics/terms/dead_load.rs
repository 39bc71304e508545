//! Dead loads, constant forces f on the nodes: the terms −f, with the energies −f·φ and without tangents.

use super::term::{Role, Step, Sum, Term, summed};
use crate::mechanics::kinematics::Inadmissible;
use crate::mechanics::loads::{ForceField, Pressing};
use crate::mechanics::sweep::Number;
use crate::parallel;
use crate::pooled::Pooled;
use crate::tensor::Vector;

/// A dead load.
pub(crate) struct DeadLoad<const D: usize> {
    name: &'static str,
    role: Role,
    force: Pooled<Vector<f64, D>>,
}

impl<const D: usize> DeadLoad<D> {
    /// Σ_p m b N_I: gravity, and fields b(x, t) given in code.
    pub(super) fn body_force<L>(step: &Step<'_, D, L>) -> Option<Self> {
        let (loads, particles) = (step.loads, step.particles);
        if loads.gravity.is_none() && loads.field.is_none() {
            return None;
        }
        let mut force: Pooled<Vector<f64, D>> = step.connectivity.field();
        if let Some(gravity) = &loads.gravity {
            // Σ_p m b N_I = m_I b: gravity is uniform, so the lumped mass already holds the sum.
            let b = gravity.acceleration * gravity.curve.value(step.time);
            parallel::zip(&mut force, &step.nodal.mass, |force, m| *force = b * *m);
        }
        if let Some(ForceField(field)) = &loads.field {
            let time = step.time;
            let of_particle = |p: usize| field(particles.id[p] as usize, &particles.position[p], time);
            step.connectivity.spread(&mut force, |p| of_particle(p) * particles.mass[p]);
        }
        Some(Self { name: "body force", role: Role::Loads, force })
    }

    /// Σ_Γ T N_I A: nominal tractions on the particles of a surface.
    pub(super) fn traction<L>(step: &Step<'_, D, L>) -> Option<Self> {
        let mut force = None;
        for load in &step.loads.surface {
            let Pressing::Traction(traction) = load.pressing else { continue };
            let force = force.get_or_insert_with(|| step.connectivity.field::<Vector<f64, D>>());
            let traction = traction * load.curve.value(step.time);
            mutant!("loads: a traction has the other sign": traction = -traction);
            for point in &load.points {
                for (node, n, _) in step.connectivity.of(point.particle) {
                    force[node] += traction * (point.area * n);
                }
            }
        }
        Some(Self { name: "traction", role: Role::Loads, force: force? })
    }

    /// R₀, the out-of-balance force: the residual, on a new grid, of the last state that was in balance on the old grid. R₀ is constant in
    /// all steps until the next reset. Without R₀, each reset would add an error of its own to the stresses.
    pub(super) fn out_of_balance<L>(step: &Step<'_, D, L>) -> Option<Self> {
        let force = &step.nodal.out_of_balance;
        mutant!("reference: no force is carried over": { return None; });
        (!force.is_empty()).then(|| Self { name: "out-of-balance force", role: Role::Stores, force: force.clone() })
    }
}

impl<const D: usize> Term<D> for DeadLoad<D> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn role(&self) -> Role {
        self.role
    }

    fn add_at_nodes<T: Number>(&self, _: &[Vector<T, D>], out: &mut [Vector<T, D>]) {
        parallel::zip(out, &self.force, |out, force| *out -= force.map(T::lit));
    }

    fn energy<T: Number>(&self, phi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
        let energy = |(force, phi): (&Vector<f64, D>, &Vector<T, D>)| -force.map(T::lit).dot(phi);
        Some(Ok(summed(self.force.iter().zip(phi).map(energy))))
    }

    fn add_magnitudes_at_nodes(&self, _: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        parallel::zip(out, &self.force, |out, force| *out += force.abs());
    }
}
