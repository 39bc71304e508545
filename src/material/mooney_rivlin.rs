//! A compressible Mooney–Rivlin solid.

use super::{Ciarlet, Lame, Law, Listed, MaterialState, VolumeResponse, Volumetric};
use crate::problems::{Number, Problems};
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor, contract, identity, scaled, second_invariant, symmetric, trace};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// W = c₁ (I₁ − 3) + c₂ (I₂ − 3) − 2 (c₁ + 2c₂) ln J + U(J), with Ciarlet's U, for rubber. G = 2 (c₁ + c₂). The Λ of U is the Λ of the
/// solid less 4 c₂, the contribution of I₂ (Ciarlet and Geymonat, 1982).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[schemars(description = "The constants of [`MooneyRivlin`].")]
#[serde(deny_unknown_fields)]
pub struct MooneyRivlin {
    /// c₁ (stress), > 0. Without c₂ the shear modulus is 2 c₁.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub c1: f64,
    /// c₂ (stress), ≥ 0. The shear modulus is 2 (c₁ + c₂).
    #[schemars(range(min = 0))]
    pub c2: f64,
    /// The bulk modulus K (stress), > 4/3 `c1` + 16/3 `c2`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub bulk: f64,
}

/// 4 I₂(E), by minors in 3D. Where det E = 0, J² = det(I + 2E) gives j² − 2 (tr E − j), which keeps the digits that minors lose under
/// rotation.
fn four_minors<T: Real, const D: usize>(at: &Deformation<T, D>) -> T {
    if D < 3 {
        at.j * at.j - at.trace_e_minus_j() * T::lit(2.0)
    } else {
        second_invariant(&at.green_lagrange()) * T::lit(4.0)
    }
}

impl MooneyRivlin {
    /// Λ − 4c₂, the Λ of U.
    pub fn volumetric_lambda(&self) -> f64 {
        self.bulk - self.least_bulk()
    }

    fn least_bulk(&self) -> f64 {
        (4.0 * self.c1 + 16.0 * self.c2) / 3.0
    }

    /// 2 (c₁ + 2c₂), the factor of tr E − ln J.
    fn shear(&self) -> f64 {
        2.0 * (self.c1 + 2.0 * self.c2)
    }
}

impl Law for MooneyRivlin {
    fn volumetric<T: Real>(&self, at: &Deformation<T, 1>) -> Option<VolumeResponse<T>> {
        Some(Ciarlet::response(self.volumetric_lambda(), at))
    }

    /// 2 (c₁ + 2c₂) (tr E − ln J) + 4c₂ I₂(E) + U, for I₁ − 3 = 2 tr E and I₂ − 3 = 4 tr E + 4 I₂(E)
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        at.trace_e_minus_log_jacobian() * T::lit(self.shear())
            + four_minors(at) * T::lit(self.c2)
            + Ciarlet::energy(self.volumetric_lambda(), at)
    }

    /// S = 2 (c₁ + 2c₂) (I − C⁻¹) + 4c₂ (tr E I − E) + J U' C⁻¹, with I − C⁻¹ = F⁻¹ (H + F⁻ᵀ Hᵀ) as for the neo-Hookean solids
    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        let (f_inv_t, e) = (at.inverse_transpose(), at.green_lagrange());
        let shear = scaled(&(at.h + f_inv_t * at.h.transpose()), T::lit(self.shear()));
        let first = f_inv_t.transpose() * (scaled(&f_inv_t, Ciarlet::stress(self.volumetric_lambda(), at)) + shear);
        first + scaled(&(scaled(&identity(), trace(&e)) - e), T::lit(4.0 * self.c2))
    }

    /// ℂ:X = ΛJ² (C⁻¹:X) C⁻¹ − 2q C⁻¹ sym(X) C⁻¹ + 4c₂ (tr X I − sym X), with q = J U' − 2 (c₁ + 2c₂)
    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        let f_inv_t = at.inverse_transpose();
        let c_inv = f_inv_t.transpose() * f_inv_t;
        let x = symmetric(x);
        let q = Ciarlet::stress(self.volumetric_lambda(), at) - self.shear();
        scaled(&c_inv, Ciarlet::stiffness(self.volumetric_lambda(), at) * contract(&c_inv, &x))
            - scaled(&(c_inv * x * c_inv), q + q)
            + scaled(&(scaled(&identity(), trace(&x)) - x), 4.0 * self.c2)
    }
}

impl Listed for MooneyRivlin {
    type Parameters = Self;

    fn build(given: &Self, problems: &mut Problems, path: &str) -> Option<Self> {
        let Self { c1, c2, bulk } = *given;
        let at = |key: &str| format!("{path}.{key}");
        let mut good = problems.positive(&at("c1"), c1);
        good &= problems.not_negative(&at("c2"), c2);
        good &= problems.positive(&at("bulk"), bulk);
        let least = given.least_bulk();
        let allowed = format_args!("must be greater than 4/3 c1 + 16/3 c2 = {}", Number(least));
        let stiff = good && problems.require(bulk > least, &at("bulk"), Number(bulk), allowed);
        stiff.then_some(*given)
    }

    /// c₂ is an eighth of G, or less, so that three quarters of Λ are left to U.
    fn example(lame: Lame) -> Self {
        let c2 = (0.125 * lame.shear).min(lame.lambda / 16.0).max(0.0);
        Self { c1: 0.5 * lame.shear - c2, c2, bulk: lame.bulk_modulus() }
    }
}
