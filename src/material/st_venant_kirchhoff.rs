//! St. Venant–Kirchhoff solid (the paper's appendix B.2).

use super::closed_tangent::rows;
use super::{ClosedTangent, Lame, LameParameters, Law, Listed, MaterialState};
use crate::problems::Problems;
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector, contract, identity, outer, scaled, symmetric, trace};

/// W = Λ/2 (tr E)² + G E:E, for moderate strains. The solid softens in compression.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StVenantKirchhoff {
    /// Λ and G.
    pub lame: Lame,
}

impl Listed for StVenantKirchhoff {
    type Parameters = LameParameters;

    fn build(given: &LameParameters, problems: &mut Problems, path: &str) -> Option<Self> {
        given.lame(problems, path).map(Self::example)
    }

    fn example(lame: Lame) -> Self {
        Self { lame }
    }
}

/// Λ tr(X) I + 2G X for a symmetric X: S from E, and ℂ:X.
#[inline(always)]
fn hooke<T: Real, const D: usize>(lambda: T, shear: T, x: &Tensor<T, D>) -> Tensor<T, D> {
    scaled(&identity(), lambda * trace(x)) + scaled(x, T::lit(2.0) * shear)
}

impl Law for StVenantKirchhoff {
    #[inline(always)]
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        let e = at.green_lagrange();
        T::lit(0.5 * self.lame.lambda) * trace(&e) * trace(&e) + T::lit(self.lame.shear) * contract(&e, &e)
    }

    /// S = Λ tr(E) I + 2G E
    #[inline(always)]
    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        hooke(T::lit(self.lame.lambda), T::lit(self.lame.shear), &at.green_lagrange())
    }

    /// ℂ:X = Λ tr(X) I + 2G sym X   (B9, with 2G)
    #[inline(always)]
    fn elasticity<const D: usize>(&self, _at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        hooke(self.lame.lambda, self.lame.shear, &symmetric(x))
    }

    /// ℂmat{v,b} = Λ v⊗b + G (v·b) I + G b⊗v
    #[inline(always)]
    fn tangent_density<const D: usize>(
        &self,
        _at: &MaterialState<f64, D>,
        v: &Vector<f64, D>,
        b: &Vector<f64, D>,
    ) -> Tensor<f64, D> {
        let Lame { lambda, shear } = self.lame;
        scaled(&outer(v, b), lambda) + scaled(&identity(), shear * v.dot(b)) + scaled(&outer(b, v), shear)
    }

    /// V₀ [ L F_r S F_rᵀ + Λ (M:L) M + G M Lᵀ M + G b L b_r ],  M = F F_rᵀ: δF S + F [ℂ : Fᵀ δF] with δF = L F_r, pushed
    /// forward to the configuration of the last grid reset.
    #[inline(always)]
    fn closed<T: Real, const D: usize>(
        &self,
        f_r: &Tensor<T, D>,
        at: &MaterialState<T, D>,
        volume: T,
    ) -> Option<ClosedTangent<T, D>> {
        let shear = T::lit(self.lame.shear) * volume;
        Some(ClosedTangent {
            a: rows(&(at.f * f_r.transpose())),
            right: rows(&scaled(&(f_r * self.stress(at) * f_r.transpose()), volume)),
            bulk: T::lit(self.lame.lambda) * volume,
            q: -shear,
            factors: Some([rows(&(at.f * at.f.transpose())), rows(&scaled(&(f_r * f_r.transpose()), shear))]),
        })
    }
}
