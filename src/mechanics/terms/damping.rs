//! Rayleigh damping, (a M̃ + b K_n) v. K_n is the material part of the stiffness at the beginning of the step, so b K_n does not damp rigid
//! rotations.

use super::inertia::LinearizedMass;
use super::stress::LinearizedStress;
use super::{
    BlocksAtPoints, Given, Linearized, LinearizedTerm, ProductAtPoints, Reason, Role, Step, Stress, Sum, Term, summed,
};
use crate::material::Law;
use crate::mechanics::constitutive::{Inadmissible, Part};
use crate::mechanics::loads::Rayleigh;
use crate::mechanics::schemes::Alphas;
use crate::mechanics::sweep::{Mode, Number};
use crate::mechanics::transfer::Nodal;
use crate::tensor::{Tensor, Vector};

/// (a M̃ + b K_n) v; absent without inertia.
pub struct Damping<'a, const D: usize, L> {
    rayleigh: Rayleigh,
    step: Step<'a, D, L>,
    /// K_n; `None` if b = 0 or if a particle has det F ≤ 0. In the second case the stress has no value either, and the step fails there.
    stiffness: Option<LinearizedStress>,
}

impl<'a, const D: usize, L: Law> Damping<'a, D, L> {
    pub(super) fn of(step: &Step<'a, D, L>) -> Option<Self> {
        let rayleigh = step.loads.damping.filter(|_| !step.nodal.is_static())?;
        let stiff = (rayleigh.stiffness > 0.0).then(|| Self::stiffness(step));
        Some(Self { rayleigh, step: *step, stiffness: stiff.and_then(Result::ok) })
    }

    /// The material part of the stiffness at φ_n, the nodal motion since the last grid reset.
    fn stiffness(step: &Step<'a, D, L>) -> Result<LinearizedStress, Inadmissible> {
        let motion: Vec<_> = step.nodal.moved(step.supports.nodes()).collect();
        Stress::new(step).linearized(&motion, Part::Material)
    }
}

impl<const D: usize, L: Law> Damping<'_, D, L> {
    /// (a M̃ + b K_n) v
    fn force(&self, v: &[Vector<f64, D>]) -> Vec<Vector<f64, D>> {
        let mut force = vec![Vector::zeros(); v.len()];
        self.step.mass().add_product(self.rayleigh.mass, v, &mut force);
        if let Some((mode, add)) = self.stiffness.as_ref().and_then(|of| of.product_at_points(Some(v))) {
            let mut of_stiffness = vec![Vector::<f64, D>::zeros(); v.len()];
            self.step.supports.accumulate(Some(v), mode, &mut of_stiffness, add);
            force.iter_mut().zip(&of_stiffness).for_each(|(force, more)| *force += more * self.rayleigh.stiffness);
        }
        force
    }

    /// v = v_n + Δv at the nodes.
    fn velocity<T: Number>(&self, dphi: &[Vector<T, D>]) -> Vec<Vector<T, D>> {
        let Nodal { velocity, acceleration, .. } = self.step.nodal;
        let Alphas { dt, a4, a6, .. } = self.step.alphas;
        let state = velocity.iter().zip(acceleration).zip(self.step.nodal.moved(dphi.len()));
        let known = state.map(|((v, a), motion)| v - v * (dt * a4) + a * a6 - motion * a4);
        let all = dphi.iter().zip(known);
        all.map(|(dphi, known)| Vector::from_fn(|i, _| dphi[i] * T::lit(a4) + T::lit(known[i]))).collect()
    }

    /// (a M̃ + b K_n) v for every number type, field by field: the force is linear in v.
    fn force_of<T: Number>(&self, v: &[Vector<T, D>]) -> Vec<Vector<T, D>> {
        let mut force = vec![Vector::<T, D>::zeros(); v.len()];
        for field in 0..T::FIELDS {
            let plain: Vec<_> = v.iter().map(|v| v.map(|x| x.field(field))).collect();
            for (force, of_field) in force.iter_mut().zip(self.force(&plain)) {
                *force += of_field.map(|x| T::from_fields(|i| if i == field { x } else { 0.0 }));
            }
        }
        force
    }
}

impl<const D: usize, L: Law> Term<D> for Damping<'_, D, L> {
    const NAME: &'static str = "damping";
    const ROLE: Role = Role::Dissipates;

    fn planned(given: Given<'_, D>) -> Vec<Reason> {
        let damping = given.loads.damping.filter(|_| given.scheme.has_inertia());
        let why = |Rayleigh { mass, stiffness }| format!("{mass} M + {stiffness} K; two passes more a residual");
        vec![(Self::NAME, damping.is_some(), damping.map_or_else(|| "only with damping".into(), why))]
    }

    fn add_at_nodes<T: Number>(&self, dphi: &[Vector<T, D>], out: &mut [Vector<T, D>]) {
        let force = self.force_of(&self.velocity(dphi));
        out.iter_mut().zip(force).for_each(|(out, force)| *out += force);
    }

    /// ½ v·C v/α₄, whose gradient is C v
    fn energy<T: Number>(&self, dphi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
        let v = self.velocity(dphi);
        let energy = |(force, v): (&Vector<T, D>, &Vector<T, D>)| T::lit(0.5 / self.step.alphas.a4) * force.dot(v);
        Some(Ok(summed(self.force_of(&v).iter().zip(&v).map(energy))))
    }

    fn add_magnitudes_at_nodes(&self, dphi: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        let force = self.force(&self.velocity(dphi));
        out.iter_mut().zip(force).for_each(|(out, force)| *out += force.abs());
    }

    fn linearize(&self, _: &[Vector<f64, D>], _: Part) -> LinearizedTerm<'_, D> {
        let Rayleigh { mass, stiffness } = self.rayleigh;
        let a4 = self.step.alphas.a4;
        mutant!("damping: the product has the factor of the acceleration": a4 = self.step.alphas.a1);
        let mut of_stress = None;
        if stiffness > 0.0 {
            of_stress = Some(Self::stiffness(&self.step)?.times(a4 * stiffness));
        }
        let of_mass = LinearizedMass { mass: self.step.mass(), factor: a4 * mass };
        Ok(Some(Box::new(LinearizedDamping { of_mass, of_stress })))
    }
}

/// α₄ (a M̃ + b K_n)
struct LinearizedDamping<'a, const D: usize> {
    of_mass: LinearizedMass<'a, D>,
    of_stress: Option<LinearizedStress>,
}

impl<const D: usize> LinearizedDamping<'_, D> {
    fn each(&self) -> impl Iterator<Item = &dyn Linearized<D>> {
        let of_mass: &dyn Linearized<D> = &self.of_mass;
        let of_stress = self.of_stress.as_ref().map(|linearized| linearized as &dyn Linearized<D>);
        [Some(of_mass), of_stress].into_iter().flatten()
    }
}

impl<const D: usize> Linearized<D> for LinearizedDamping<'_, D> {
    fn add_product_at_nodes(&self, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        self.each().for_each(|linearized| linearized.add_product_at_nodes(u, out));
    }

    fn product_at_points(&self, u: Option<&[Vector<f64, D>]>) -> Option<(Mode, ProductAtPoints<'_, D>)> {
        let (modes, all): (Vec<_>, Vec<_>) = self.each().filter_map(|of| of.product_at_points(u)).unzip();
        let mode = modes.into_iter().reduce(Mode::and)?;
        Some((mode, Box::new(move |group, at, sums| all.iter().for_each(|add| add(group, at, sums)))))
    }

    fn add_blocks_at_nodes(&self, blocks: &mut [Tensor<f64, D>]) {
        self.each().for_each(|linearized| linearized.add_blocks_at_nodes(blocks));
    }

    fn blocks_at_points(&self) -> Option<BlocksAtPoints<'_>> {
        let all: Vec<_> = self.each().filter_map(Linearized::blocks_at_points).collect();
        Some(Box::new(move |group, form| all.iter().for_each(|add| add(group, form))))
    }
}
