//! Rayleigh damping, (a M̃ + b K_n) v. K_n is the material part of the stiffness at the beginning of the step, so b K_n does not damp rigid
//! rotations. Of a body whose cells average the dilatation, K_n is the material part of W − U(J), and the stiffness of each cell against a change
//! of its volume. The material part of U(J) is not positive there: nothing holds the J of single particles, and J U' may be much larger than G.

use super::mean_dilatation::MeanDilatation;
use super::stress::Stress;
use super::term::{Role, Step, Sum, Term, summed};
use crate::material::Law;
use crate::mechanics::constitutive::Part;
use crate::mechanics::kinematics::Inadmissible;
use crate::mechanics::linearized::{CellRows, Linearized, TangentRows};
use crate::mechanics::loads::Rayleigh;
use crate::mechanics::schemes::Alphas;
use crate::mechanics::sweep::Number;
use crate::mechanics::transfer::Nodal;
use crate::mechanics::trial::Trial;
use crate::particles::Body;
use crate::tensor::Vector;

/// (a M̃ + b K_n) v; absent without inertia.
pub(crate) struct Damping<'a, const D: usize, L> {
    step: Step<'a, D, L>,
    /// a M̃ + b K_n; without K_n if a particle has det F ≤ 0. The stress has no value then either, and the step fails there.
    viscosity: Linearized<D>,
    failure: Option<Inadmissible>,
}

impl<'a, const D: usize, L: Law> Damping<'a, D, L> {
    pub(super) fn of(step: &Step<'a, D, L>) -> Option<Self> {
        let Rayleigh { mass, stiffness } = step.loads.damping.filter(|_| !step.nodal.is_static())?;
        let (mut viscosity, mut failure) = (Linearized { mass, ..Linearized::default() }, None);
        if stiffness > 0.0 {
            match Self::stiffness(step) {
                Ok(rows) => viscosity.stresses.push(rows.times(stiffness)),
                Err(error) => failure = Some(error),
            }
            viscosity.cells.extend(Self::stiffness_of_cells(step).map(|rows| rows.times(stiffness)));
        }
        Some(Self { step: *step, viscosity, failure })
    }

    /// The material part of the stiffness at φ_n, the nodal motion since the last grid reset, without U(J) of averaged bodies: the mean stress of
    /// a step without motion lacks U(J), and has the stiffness of the law.
    fn stiffness(step: &Step<'a, D, L>) -> Result<TangentRows, Inadmissible> {
        let motion = step.nodal.motion_of(step.connectivity.nodes(), step.connectivity.pool());
        let averages = step.bodies.iter().any(Body::averages);
        mutant!("damping: particles of averaged cells have the stiffness of U(J)": averages = false);
        let alphas = Alphas { discrete_gradient: averages, ..step.alphas };
        Stress::of(&Step { alphas, ..*step }).linearized(&motion, Part::Material)
    }

    /// The stiffness of averaged cells against a change of volume at φ_n.
    fn stiffness_of_cells(step: &Step<'a, D, L>) -> Option<CellRows<D>> {
        mutant!("damping: averaged cells have no stiffness of their own": { return None; });
        let motion = step.nodal.motion_of(step.connectivity.nodes(), step.connectivity.pool());
        let alphas = Alphas { discrete_gradient: false, ..step.alphas };
        Some(MeanDilatation::of(&Step { alphas, ..*step })?.volumetric_stiffness(&motion))
    }
}

impl<const D: usize, L: Law> Damping<'_, D, L> {
    /// (a M̃ + b K_n) v
    fn force(&self, v: &[Vector<f64, D>]) -> Vec<Vector<f64, D>> {
        let mut force = vec![Vector::zeros(); v.len()];
        self.viscosity.add_product(&self.step.mass(), v, None, &mut force);
        force
    }

    /// v = v_n + Δv at the nodes.
    fn velocity<T: Number>(&self, phi: &[Vector<T, D>]) -> Vec<Vector<T, D>> {
        let Nodal { velocity, acceleration, .. } = self.step.nodal;
        let Alphas { dt, a4, a6, .. } = self.step.alphas;
        let state = velocity.iter().zip(acceleration).enumerate();
        let known = state.map(|(node, (v, a))| v - v * (dt * a4) + a * a6 - self.step.nodal.moved(node) * a4);
        let all = phi.iter().zip(known);
        all.map(|(phi, known)| Vector::from_fn(|i, _| phi[i] * T::lit(a4) + T::lit(known[i]))).collect()
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
    fn name(&self) -> &'static str {
        "damping"
    }

    fn role(&self) -> Role {
        Role::Dissipates
    }

    fn add_at_nodes<T: Number>(&self, phi: &[Vector<T, D>], out: &mut [Vector<T, D>]) {
        let force = self.force_of(&self.velocity(phi));
        out.iter_mut().zip(force).for_each(|(out, force)| *out += force);
    }

    /// ½ v·C v/α₄, whose gradient is C v
    fn energy<T: Number>(&self, phi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
        let v = self.velocity(phi);
        let energy = |(force, v): (&Vector<T, D>, &Vector<T, D>)| T::lit(0.5 / self.step.alphas.a4) * force.dot(v);
        Some(Ok(summed(self.force_of(&v).iter().zip(&v).map(energy))))
    }

    fn add_magnitudes_at_nodes(&self, phi: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        let force = self.force(&self.velocity(phi));
        out.iter_mut().zip(force).for_each(|(out, force)| *out += force.abs());
    }

    /// α₄ (a M̃ + b K_n)
    fn linearize(&self, _: Trial<'_, f64, D>, _: Part, into: &mut Linearized<D>) -> Result<(), Inadmissible> {
        let a4 = self.step.alphas.a4;
        mutant!("damping: the product has the factor of the acceleration": a4 = self.step.alphas.a1);
        into.add_scaled(&self.viscosity, a4);
        self.failure.map_or(Ok(()), Err)
    }
}
