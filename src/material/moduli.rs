//! Numbers that follow from a law: moduli of the body at rest, and the out-of-plane stress.

use super::{Law, MaterialState};
use crate::tensor::{Tensor, embed};

/// The largest Poisson's ratio of the body at rest, ℂ₁₁₂₂/(ℂ₁₁₁₁ + ℂ₁₁₂₂) over the axes. For isotropic laws it is ν.
pub(crate) fn poissons_ratio<L: Law>(law: &L) -> f64 {
    let of = |k: usize| {
        let stress = stress_along(law, k);
        let across = (0..3).filter(|&i| i != k).map(|i| stress[(i, i)]).fold(f64::NEG_INFINITY, f64::max);
        across / (across + stress[(k, k)])
    };
    of(0).max(of(1)).max(of(2))
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
pub(crate) fn out_of_plane_stress<L: Law, const D: usize>(law: &L, at: &MaterialState<f64, D>) -> f64 {
    // σ_zz = P_zz F_zz / J with F_zz = 1
    law.stress(&at.deformed(embed(&at.h)))[(2, 2)] / at.jacobian
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Lame, NeoHookean, StVenantKirchhoff};

    #[test]
    fn the_numbers_of_a_law_are_those_of_its_constants() {
        let law = NeoHookean::logarithmic(Lame::from_young_poisson(100.0, 0.45).unwrap());
        assert!((poissons_ratio(&law) - 0.45).abs() < 1e-12);
        // Uniaxial strain, small: σ_zz = Λ ε = ν (σ_xx + σ_yy)
        let law = StVenantKirchhoff { lame: Lame::from_young_poisson(2.5, 0.25).unwrap() };
        let strain = 1e-9;
        let at = MaterialState::new(Tensor::<f64, 1>::from_element(strain));
        assert!((out_of_plane_stress(&law, &at) / (law.lame.lambda * strain) - 1.0).abs() < 1e-8);
    }
}
