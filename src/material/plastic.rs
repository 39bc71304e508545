//! Finite plasticity: Hencky's elasticity, and a return map in logarithmic strains to a yield criterion.

use super::hencky::{Principal, Radial, Strained};
use super::{
    DISSIPATED, InternalVariable, Lame, Law, Listed, Logarithmic, MaterialState, PLASTIC_STRAIN, TangentBlocks,
    VolumeResponse, Volumetric,
};
use crate::problems::Problems;
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor};

/// The yield criterion and the flow rule of an isotropic solid. It is a type, so that a loop over particles does not branch on it.
///
/// The return map takes the trial strain as v = tr ε and d = ‖dev ε‖, and gives the Kirchhoff stress. It keeps the direction of the
/// deviator.
pub trait Criterion: Clone + Send + Sync + Sized + 'static {
    /// The parameters of the criterion in a scene.
    type Parameters;

    /// Whether plastic flow is normal to the yield surface. The tangent is then symmetric.
    fn is_associated(&self) -> bool;

    /// Whether the dissipation of a step is a potential of the plastic flow. The flow must be associated, and the hardening work integrated
    /// along the step, not taken at its end.
    const HAS_POTENTIAL: bool;

    /// Whether plastic flow keeps the volume, so that tr ε = ln J, and neither the deviatoric stress nor the flow depends on the pressure.
    const ISOCHORIC: bool;

    /// The elastic constants and the criterion. `None` if a value below the key `path` is not allowed; `problems` then says why.
    fn build(given: &Self::Parameters, problems: &mut Problems, path: &str) -> Option<(Lame, Self)>;

    /// An example that a solid of these constants reaches at strains of a few percent.
    fn example(solid: &Lame) -> Self;

    /// The return map of a step with the trial strain (v, d). `before` is the accumulated plastic strain at t_n.
    fn return_map<T: Real>(&self, solid: &Lame, v: T, d: T, before: f64) -> ReturnMapped<T>;
}

/// The result of a return map.
#[derive(Clone, Copy, Debug)]
pub struct ReturnMapped<T> {
    /// The stress, and its derivatives with respect to the trial strain.
    pub radial: Radial<T>,
    /// The accumulated plastic strain.
    pub plastic_strain: T,
    /// The energy dissipated by plastic flow in this step, per reference volume.
    pub dissipated: T,
}

impl<T: Real> ReturnMapped<T> {
    /// A step without plastic flow.
    pub(crate) fn elastic(solid: &Lame, v: T, before: f64) -> Self {
        Self { radial: Radial::elastic(solid, v), plastic_strain: T::lit(before), dissipated: T::zero() }
    }
}

/// The number of roundings allowed for in a trial strain.
const ROUNDINGS: f64 = 1024.0;

/// Round-off bound of a stress with this modulus, at the elastic strain `d` after the plastic strain `before`. A state after plastic flow lies
/// on the yield surface, and round-off must not decide whether it flows again.
pub(super) fn round_off(modulus: f64, d: f64, before: f64) -> f64 {
    ROUNDINGS * f64::EPSILON * modulus * (d + before)
}

/// An isotropic elastoplastic solid. Its elastic energy W = K/2 (tr ε)² + G dev ε : dev ε depends on the logarithmic elastic strain ε = ½
/// ln(F C_p⁻¹ Fᵀ).
///
/// A step takes the trial strain with C_p⁻¹ held fixed, and then updates C_p⁻¹ by the exponential map (Simo, Comput. Methods Appl. Mech.
/// Eng. 99, 1992; de Souza Neto, Perić, Owen, Computational Methods for Plasticity, 2008, ch. 14).
///
/// ```
/// use bfree::material::{Hardening, Lame, Law, MaterialState, Plastic, VonMises};
/// use bfree::tensor::Tensor;
///
/// // Sheared far beyond yield, the solid bears √3 τ_xy = σ_y, up to a rotation of the stress of the order of the elastic strain.
/// let solid = Lame::from_young_poisson(1000.0, 0.3)?;
/// let law = Plastic { solid, criterion: VonMises { yield_stress: Hardening::perfect(0.1) } };
/// let at = MaterialState::new(Tensor::<f64, 2>::new(0.0, 0.01, 0.0, 0.0));
/// let stress = at.f * law.stress(&at) * at.f.transpose();
/// assert!((3.0_f64.sqrt() * stress[(0, 1)] / 0.1 - 1.0).abs() < 1e-3);
/// # Ok::<(), bfree::material::LameError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plastic<Y> {
    /// Λ and G.
    pub solid: Lame,
    /// The yield criterion.
    pub criterion: Y,
}

/// The accumulated plastic strain, the dissipated energy, and C_p⁻¹ − I.
const INTERNAL: [InternalVariable; 8] = [
    InternalVariable::zero(PLASTIC_STRAIN),
    InternalVariable::zero(DISSIPATED),
    InternalVariable::zero("inverse_plastic_xx"),
    InternalVariable::zero("inverse_plastic_yy"),
    InternalVariable::zero("inverse_plastic_zz"),
    InternalVariable::zero("inverse_plastic_xy"),
    InternalVariable::zero("inverse_plastic_yz"),
    InternalVariable::zero("inverse_plastic_xz"),
];

/// The plastic strain and C_p⁻¹ − I at t_n. Without internal variables both are those of a body at rest.
fn at_start<'a, T: Real, const D: usize>(at: &MaterialState<'a, T, D>) -> (f64, &'a [f64]) {
    (at.internal.first().copied().unwrap_or(0.0), at.internal.get(2..).unwrap_or(&[]))
}

impl<Y: Criterion> Plastic<Y> {
    fn return_map<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> (Strained<T>, ReturnMapped<T>) {
        let (before, inverse_inelastic) = at_start(at);
        let strained = Strained::new(at, inverse_inelastic);
        let returned = self.criterion.return_map(&self.solid, strained.volume, strained.norm(), before);
        (strained, returned)
    }

    fn principal<const D: usize>(&self, at: &MaterialState<f64, D>) -> (Principal, ReturnMapped<f64>) {
        let (before, inverse_inelastic) = at_start(at);
        let principal = Principal::new(at, inverse_inelastic);
        let returned = self.criterion.return_map(&self.solid, principal.volume(), principal.norm(), before);
        (principal, returned)
    }
}

impl<Y: Criterion> Law for Plastic<Y> {
    fn internal_variables(&self) -> &[InternalVariable] {
        &INTERNAL
    }

    fn is_symmetric(&self) -> bool {
        self.criterion.is_associated()
    }

    fn has_potential(&self) -> bool {
        Y::HAS_POTENTIAL
    }

    /// W of the elastic strain plus the dissipation of the step. For associated flow the sum is stationary with respect to the flow.
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        let (strained, ReturnMapped { radial: Radial { p, g, .. }, dissipated, .. }) = self.return_map(at);
        let (bulk, shear) = (self.solid.bulk_modulus(), self.solid.shear);
        p * p * T::lit(0.5 / bulk) + g * g * strained.square() * T::lit(0.25 / shear) + dissipated
    }

    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        let (strained, ReturnMapped { radial, .. }) = self.return_map(at);
        strained.stress(radial.p, radial.g)
    }

    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        let (principal, ReturnMapped { radial, .. }) = self.principal(at);
        principal.radial_moduli(&radial).elasticity(x)
    }

    fn tangent_blocks<const D: usize>(&self, f_r: &Tensor<f64, D>, at: &MaterialState<f64, D>) -> TangentBlocks<D> {
        let (principal, ReturnMapped { radial, .. }) = self.principal(at);
        let mut blocks = [[Tensor::zeros(); D]; D];
        principal.radial_moduli(&radial).add_blocks(f_r, &mut blocks);
        blocks
    }

    /// K/2 (ln J)², if plastic flow keeps the volume.
    fn volumetric<T: Real>(&self, at: &Deformation<T, 1>) -> Option<VolumeResponse<T>> {
        Y::ISOCHORIC.then(|| Logarithmic::response(self.solid.bulk_modulus(), at))
    }

    fn update_variables<const D: usize>(&self, at: &MaterialState<f64, D>, variables: &mut [f64]) {
        let (principal, ReturnMapped { radial, plastic_strain, dissipated }) = self.principal(at);
        let (before, inverse_inelastic) = at_start(at);
        let [strain, lost, plastic @ ..] = variables else { return };
        if plastic_strain == before {
            return;
        }
        *strain = plastic_strain;
        *lost += dissipated;
        // Δε = ε_trial − ε
        let volume = (principal.volume() - radial.p / self.solid.bulk_modulus()) / 3.0;
        mutant!("laws: the plastic change of volume is forgotten": volume = 0.0);
        let share = 1.0 - radial.g / (2.0 * self.solid.shear);
        principal.flow(principal.deviator().map(|x| share * x + volume), inverse_inelastic, plastic);
    }
}

impl<Y: Criterion> Listed for Plastic<Y> {
    type Parameters = Y::Parameters;

    fn build(given: &Y::Parameters, problems: &mut Problems, path: &str) -> Option<Self> {
        Y::build(given, problems, path).map(|(solid, criterion)| Self { solid, criterion })
    }

    fn example(solid: Lame) -> Self {
        Self { solid, criterion: Y::example(&solid) }
    }
}
