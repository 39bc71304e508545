//! Compressible neo-Hookean solids: one shear response, two volumetric ones.

use super::closed_tangent::rows;
use super::{
    Ciarlet, ClosedTangent, Lame, LameParameters, Law, Listed, Logarithmic, MaterialState, VolumeResponse, Volumetric,
};
use crate::problems::Problems;
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor, Vector, contract, outer, scaled};

/// Compressible neo-Hookean solid, W = U(J) − G ln J + G tr E.
///
/// ```
/// use bfree::material::{Lame, Law, MaterialState, NeoHookean};
/// use bfree::tensor::Tensor;
///
/// let lame = Lame::new(1.0, 1.0)?;
/// let (ciarlet, logarithmic) = (NeoHookean::ciarlet(lame), NeoHookean::logarithmic(lame));
/// let energies = |h| {
///     let at = MaterialState::new(Tensor::<f64, 1>::from_element(h));
///     [ciarlet.energy(&at), logarithmic.energy(&at), 0.5 * lame.p_wave_modulus() * h * h]
/// };
/// // Both are linear elasticity, ½ (Λ + 2G) h², at small strain, and differ at large.
/// let [a, b, linear] = energies(1e-9);
/// assert!((a / linear - 1.0).abs() < 1e-8 && (b / linear - 1.0).abs() < 1e-8);
/// let [a, b, _] = energies(1.0);
/// assert!(a > 1.1 * b);
/// # Ok::<(), bfree::material::LameError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeoHookean<U = Ciarlet> {
    /// Λ and G.
    pub lame: Lame,
    /// U(J).
    pub volumetric: U,
}

impl NeoHookean<Ciarlet> {
    /// Ciarlet's law, the one of the paper.
    #[inline(always)]
    pub fn ciarlet(lame: Lame) -> Self {
        Self { lame, volumetric: Ciarlet }
    }
}

impl NeoHookean<Logarithmic> {
    /// The law with a logarithmic volumetric energy.
    #[inline(always)]
    pub fn logarithmic(lame: Lame) -> Self {
        Self { lame, volumetric: Logarithmic }
    }
}

impl<U: Volumetric> Listed for NeoHookean<U> {
    type Parameters = LameParameters;

    fn build(given: &LameParameters, problems: &mut Problems, path: &str) -> Option<Self> {
        given.lame(problems, path).map(|lame| Self { lame, volumetric: U::default() })
    }

    fn example(lame: Lame) -> Self {
        Self { lame, volumetric: U::default() }
    }
}

impl<U: Volumetric> Law for NeoHookean<U> {
    /// W = Λ/2 [½ j² + (j − ln J)] + G [(tr E − j) + (j − ln J)], or with Λ/2 (ln J)² in place of the first bracket.
    #[inline(always)]
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        U::energy(self.lame.lambda, at) + T::lit(self.lame.shear) * at.trace_e_minus_log_jacobian()
    }

    /// S = F⁻¹ P,  P = J U'(J) F⁻ᵀ + G (H + F⁻ᵀ Hᵀ)
    ///
    /// H + F⁻ᵀHᵀ = F − F⁻ᵀ is small where strain and rotation are small, and no larger than F where F is large. Other forms lose more
    /// digits: in C⁻¹ [J U' I + 2G E] shear is a difference of products of size ‖F‖², and in G (I − C⁻¹) a difference of numbers of size 1.
    #[inline(always)]
    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        let f_inv_t = at.inverse_transpose();
        let shear = scaled(&(at.h + f_inv_t * at.h.transpose()), T::lit(self.lame.shear));
        f_inv_t.transpose() * (scaled(&f_inv_t, U::stress(self.lame.lambda, at)) + shear)
    }

    /// ℂ:X = ΛJ² (C⁻¹:X) C⁻¹ − 2q C⁻¹ sym(X) C⁻¹, with q = J U'(J) − G
    #[inline(always)]
    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        let f_inv_t = at.inverse_transpose();
        let c_inv = f_inv_t.transpose() * f_inv_t;
        let q = U::stress(self.lame.lambda, at) - self.lame.shear;
        scaled(&c_inv, U::stiffness(self.lame.lambda, at) * contract(&c_inv, x))
            - scaled(&(c_inv * (x + x.transpose()) * c_inv), q)
    }

    /// ℂmat{v,b} = ΛJ² (C⁻¹v ⊗ C⁻¹b) − q (C⁻¹b·v) C⁻¹ − q (C⁻¹b ⊗ C⁻¹v)   (eq. 39)
    #[inline(always)]
    fn tangent_density<const D: usize>(
        &self,
        at: &MaterialState<f64, D>,
        v: &Vector<f64, D>,
        b: &Vector<f64, D>,
    ) -> Tensor<f64, D> {
        let f_inv_t = at.inverse_transpose();
        let c_inv = f_inv_t.transpose() * f_inv_t;
        let q = U::stress(self.lame.lambda, at) - self.lame.shear;
        let (cv, cb) = (c_inv * v, c_inv * b);
        scaled(&outer(&cv, &cb), U::stiffness(self.lame.lambda, at))
            - scaled(&c_inv, q * cb.dot(v))
            - scaled(&outer(&cb, &cv), q)
    }

    fn volumetric<T: Real>(&self, at: &Deformation<T, 1>) -> Option<VolumeResponse<T>> {
        Some(U::response(self.lame.lambda, at))
    }

    /// V₀ [ G L b_r + ΛJ² (A:L) A − q A Lᵀ A ],  A = ΔF⁻ᵀ = F⁻ᵀ F_rᵀ: δP = G δF + ΛJ² (F⁻ᵀ:δF) F⁻ᵀ − q F⁻ᵀ δFᵀ F⁻ᵀ pushed
    /// forward to the configuration of the last grid reset.
    #[inline(always)]
    fn closed<T: Real, const D: usize>(
        &self,
        f_r: &Tensor<T, D>,
        at: &MaterialState<T, D>,
        volume: T,
    ) -> Option<ClosedTangent<T, D>> {
        let shear = T::lit(self.lame.shear);
        Some(ClosedTangent {
            a: rows(&(at.inverse_transpose() * f_r.transpose())),
            right: rows(&scaled(&(f_r * f_r.transpose()), shear * volume)),
            bulk: U::stiffness(self.lame.lambda, at) * volume,
            q: (U::stress(self.lame.lambda, at) - shear) * volume,
            factors: None,
        })
    }
}
