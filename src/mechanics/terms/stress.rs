//! The internal force Σ_p V₀ F S ∇N (eq. 17), and its tangent, geometric and material (eqs. 34, 38).

use super::inertia::Inertia;
use super::term::{AtPoints, Step, Sum, Term, summed};
use crate::material::Law;
use crate::mechanics::constitutive::{Form, Laws, Part};
use crate::mechanics::kinematics::{Inadmissible, Kinematics};
use crate::mechanics::linearized::{Linearized, TangentRows};
use crate::mechanics::sweep::{Connectivity, Mode, Number, Weights};
use crate::mechanics::trial::Trial;
use crate::parallel::First;
use crate::tensor::{Tensor, Vector};

/// Σ_p V₀ F S F_rᵀ ∇_r N_I
pub(crate) struct Stress<'a, const D: usize, L> {
    laws: Laws<'a, D, L>,
    connectivity: &'a Connectivity<D>,
}

impl<'a, const D: usize, L: Law> Stress<'a, D, L> {
    pub(super) fn of(step: &Step<'a, D, L>) -> Self {
        let Step { particles, bodies, dt, connectivity, alphas, .. } = *step;
        Self { laws: Laws { particles, bodies, dt, discrete_gradient: alphas.discrete_gradient }, connectivity }
    }

    fn law(&self, p: usize) -> &L {
        &self.laws.bodies[self.laws.particles.body[p] as usize].law
    }

    /// Adds the forces, with the consistent part of inertia if given, or the magnitudes of the forces, on the device. Returns whether the forces
    /// were added. Otherwise `out` is unchanged.
    pub(super) fn add_on_device(
        &self,
        inertia: Option<&Inertia<'_, D>>,
        magnitudes: bool,
        phi: &[f64],
        out: &mut [f64],
    ) -> bool {
        let Some(solids) = self.laws.on_device(self.connectivity) else { return false };
        let inertia = inertia.and_then(|inertia| inertia.on_device(solids.gpu()));
        let is_added = solids.add_forces(inertia.as_ref(), magnitudes, phi, out);
        if is_added {
            self.connectivity.pass();
        }
        is_added
    }

    /// The tangent linearised at φ on the device; `None` if the laws do not run there, or a particle has det F ≤ 0.
    fn linearized_on_device(&self, phi: &[Vector<f64, D>], part: Part, form: Form) -> Option<TangentRows> {
        if part != Part::Whole || form == Form::General {
            return None;
        }
        let solids = self.laws.on_device(self.connectivity)?;
        let (count, groups) = (form.rows(D), self.connectivity.groups());
        let rows = solids.linearized(count, bytemuck::cast_slice(phi))?;
        self.connectivity.pass();
        Some(TangentRows::of_device(form, count, groups, solids.gpu(), rows, self.connectivity.pool()))
    }

    /// The tangent linearised at φ, whole or one `part`.
    pub(super) fn linearized(&self, phi: &[Vector<f64, D>], part: Part) -> Result<TangentRows, Inadmissible> {
        let form = self.laws.form();
        let count = form.rows(D);
        if let Some(rows) = self.linearized_on_device(phi, part, form) {
            return Ok(rows);
        }
        let own = self.connectivity.own_groups();
        let mut rows = self.connectivity.pool().unspecified(own.len() * count);
        let evaluate = self.laws.tangents(part, form);
        let failure = First::none();
        self.connectivity.fill_rows(phi, count, &mut rows, |group, at, rows| {
            if let Err(error) = evaluate(group, at, rows) {
                failure.keep(error.particle, error);
            }
        });
        failure.check(self.connectivity.processes())?;
        Ok(TangentRows::new(form, own.start, count, rows))
    }
}

impl<const D: usize, L: Law> Term<D> for Stress<'_, D, L> {
    fn name(&self) -> &'static str {
        "stress"
    }

    fn parts(&self) -> &'static [(Part, &'static str)] {
        &[(Part::Geometric, "geometric"), (Part::Material, "material")]
    }

    fn at_points<T: Number>(&self, part: Part, _: Trial<'_, T, D>) -> Option<(Mode, AtPoints<'_, T, D>)> {
        Some((Mode::GRADIENT, Box::new(self.laws.stresses(part))))
    }

    fn energy<T: Number>(&self, phi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
        if self.laws.discrete_gradient || !self.laws.bodies.iter().all(|body| body.law.has_potential()) {
            return None;
        }
        let particles = self.laws.particles;
        let energies = self.connectivity.interpolate(phi, |p, _, g| {
            let at = Kinematics(particles).state(p, &g, self.laws.dt)?;
            mutant!("stress: the energy lacks V_0": { return Ok(self.law(p).energy(&at)); });
            Ok(T::lit(particles.volume[p]) * self.law(p).energy(&at))
        });
        Some(energies.map(summed))
    }

    /// ‖δP‖ ≤ ‖F‖ ‖ℂ : Fᵀ δF‖ with ‖δF‖ = ‖H‖ + Σ |φ| |∇_r N| ‖F_r‖. The response to a change of volume stands for all δF.
    fn add_sensitivity(&self, phi: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) -> Result<(), Inadmissible> {
        let particles = self.laws.particles;
        self.connectivity.assemble(phi, Weights::Magnitude, out, |p, _, g| {
            let at = Kinematics(particles).state(p, &g, self.laws.dt)?;
            let f_r = Kinematics(particles).reference(p).norm();
            let moved: f64 = self.connectivity.of(p).map(|(node, _, grad_r)| phi[node].norm() * grad_r.norm()).sum();
            let response = self.law(p).elasticity(&at, &(at.f.transpose() * at.f)).norm();
            let change = response * (at.h.norm() + moved * f_r) * f_r * particles.volume[p];
            Ok((Vector::zeros(), Tensor::repeat(change)))
        })
    }

    fn linearize(&self, at: Trial<'_, f64, D>, part: Part, into: &mut Linearized<D>) -> Result<(), Inadmissible> {
        into.stresses.push(self.linearized(at.phi, part)?);
        Ok(())
    }
}
