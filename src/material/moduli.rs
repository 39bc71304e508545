//! Numbers that follow from a law: moduli of the body at rest, and the out-of-plane stress.

use super::{Law, MaterialState};
use crate::tensor::{Tensor, embed};
use nalgebra::SMatrix;

/// The largest Poisson's ratio of the body at rest, ℂ₁₁₂₂/(ℂ₁₁₁₁ + ℂ₁₁₂₂) over the axes. For isotropic laws it is ν.
///
/// ```
/// use bfree::material::{Lame, NeoHookean, poissons_ratio};
///
/// let law = NeoHookean::logarithmic(Lame::from_young_poisson(100.0, 0.45)?);
/// assert!((poissons_ratio(&law) - 0.45).abs() < 1e-12);
/// # Ok::<(), bfree::material::LameError>(())
/// ```
pub fn poissons_ratio<L: Law>(law: &L) -> f64 {
    let of = |k: usize| {
        let stress = stress_along(law, k);
        let across = (0..3).filter(|&i| i != k).map(|i| stress[(i, i)]).fold(f64::NEG_INFINITY, f64::max);
        across / (across + stress[(k, k)])
    };
    of(0).max(of(1)).max(of(2))
}

/// The least and the largest eigenvalue of ℂ of the body at rest, for strains of size 1. If the least one is negative, the body is
/// unstable.
///
/// ```
/// use bfree::material::{Energy, FromEnergy, Lame, NeoHookean, stiffness_at_rest};
/// use bfree::scalar::Real;
/// use bfree::tensor::{Tensor, contract};
///
/// // 2G in shear, 3Λ + 2G under pressure.
/// let [least, largest] = stiffness_at_rest(&NeoHookean::logarithmic(Lame::new(1.0, 2.0)?));
/// assert!((least - 4.0).abs() < 1e-12 && (largest - 7.0).abs() < 1e-12);
///
/// /// W = −E:E
/// struct Wrong;
///
/// impl Energy for Wrong {
///     fn energy<T: Real>(&self, e: &Tensor<T, 3>) -> T {
///         -contract(e, e)
///     }
/// }
///
/// assert!(stiffness_at_rest(&FromEnergy(Wrong)).iter().all(|stiffness| (stiffness + 2.0).abs() < 1e-12));
/// # Ok::<(), bfree::material::LameError>(())
/// ```
pub fn stiffness_at_rest<L: Law>(law: &L) -> [f64; 2] {
    // An orthonormal basis of the symmetric strains.
    let basis = |k: usize| {
        let (i, j) = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)][k];
        let mut strain = Tensor::<f64, 3>::zeros();
        (strain[(i, j)], strain[(j, i)]) = if i == j { (1.0, 1.0) } else { (0.5_f64.sqrt(), 0.5_f64.sqrt()) };
        strain
    };
    let mut stiffness = SMatrix::<f64, 6, 6>::zeros();
    for column in 0..6 {
        let stress = stress_of(law, &basis(column));
        (0..6).for_each(|row| stiffness[(row, column)] = stress.dot(&basis(row)));
    }
    let values = ((stiffness + stiffness.transpose()) * 0.5).symmetric_eigenvalues();
    [values.min(), values.max()]
}

/// ℂ : X of the body at rest.
fn stress_of<L: Law>(law: &L, strain: &Tensor<f64, 3>) -> Tensor<f64, 3> {
    let internal: Vec<f64> = law.internal_variables().iter().map(|one| one.at_rest).collect();
    law.elasticity(&MaterialState::new(Tensor::zeros()).in_step(0.0, &internal), strain)
}

/// ℂ : e_k ⊗ e_k of the body at rest.
fn stress_along<L: Law>(law: &L, k: usize) -> Tensor<f64, 3> {
    stress_of(law, &Tensor::from_fn(|i, j| if i == k && j == k { 1.0 } else { 0.0 }))
}

/// The largest modulus of pressure waves along an axis of the body at rest, ℂ₁₁₁₁. For isotropic laws it is Λ + 2G.
///
/// ```
/// use bfree::material::{Lame, NeoHookean, p_wave_modulus};
///
/// let lame = Lame::from_young_poisson(100.0, 0.3)?;
/// assert_eq!(p_wave_modulus(&NeoHookean::logarithmic(lame)), lame.p_wave_modulus());
/// # Ok::<(), bfree::material::LameError>(())
/// ```
pub fn p_wave_modulus<L: Law>(law: &L) -> f64 {
    let along = |k| stress_along(law, k)[(k, k)];
    along(0).max(along(1)).max(along(2))
}

/// The out-of-plane Cauchy stress under plane or uniaxial strain, for output. The deformation is embedded in 3D, which is valid for
/// isotropic laws.
///
/// ```
/// use bfree::material::{Lame, MaterialState, StVenantKirchhoff, out_of_plane_stress};
/// use bfree::tensor::Tensor;
///
/// // Uniaxial strain, small: σ_zz = Λ ε = ν (σ_xx + σ_yy)
/// let law = StVenantKirchhoff { lame: Lame::from_young_poisson(2.5, 0.25)? };
/// let strain = 1e-9;
/// let at = MaterialState::new(Tensor::<f64, 1>::from_element(strain));
/// assert!((out_of_plane_stress(&law, &at) / (law.lame.lambda * strain) - 1.0).abs() < 1e-8);
/// # Ok::<(), bfree::material::LameError>(())
/// ```
pub fn out_of_plane_stress<L: Law, const D: usize>(law: &L, at: &MaterialState<f64, D>) -> f64 {
    // σ_zz = P_zz F_zz / J with F_zz = 1
    law.stress(&at.deformed(embed(&at.h)))[(2, 2)] / at.jacobian
}
