//! Compressible neo-Hookean solids: one shear response, two volumetric ones.

use super::closed_tangent::rows;
use super::{ClosedTangent, Elastic, Lame, LawVisitor};
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor, Vector, contract, outer, scaled};

/// How the volume resists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Volumetric {
    /// Ciarlet: Λ/4 (J²−1) − Λ/2 ln J, the paper's law (appendix B.1).
    Ciarlet,
    /// Λ/2 (ln J)², the law most other programs ship.
    Logarithmic,
}

/// Compressible neo-Hookean solid, W = U(J) − G ln J + G tr E.
///
/// ```
/// use bfree::material::{Elastic, Lame, NeoHookean};
/// use bfree::tensor::{Deformation, Tensor};
///
/// let lame = Lame::new(1.0, 1.0)?;
/// let (ciarlet, logarithmic) = (NeoHookean::ciarlet(lame), NeoHookean::logarithmic(lame));
/// let energies = |h| {
///     let at = Deformation::<f64, 1>::new(Tensor::from_element(h));
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
pub struct NeoHookean {
    /// Λ and G.
    pub lame: Lame,
    /// U(J).
    pub volumetric: Volumetric,
}

impl NeoHookean {
    /// Ciarlet's law, the one of the paper.
    #[inline(always)]
    pub fn ciarlet(lame: Lame) -> Self {
        Self { lame, volumetric: Volumetric::Ciarlet }
    }

    /// The law with a logarithmic volumetric energy.
    #[inline(always)]
    pub fn logarithmic(lame: Lame) -> Self {
        Self { lame, volumetric: Volumetric::Logarithmic }
    }

    /// Calls `visitor` with a type for each volumetric response.
    pub(super) fn with<V: LawVisitor>(&self, visitor: V) -> V::Output {
        match self.volumetric {
            Volumetric::Ciarlet => visitor.visit(Of::<false>(self.lame)),
            Volumetric::Logarithmic => visitor.visit(Of::<true>(self.lame)),
        }
    }

    /// J U'(J): Λ/2 (J²−1), or Λ ln J
    #[inline(always)]
    fn volumetric_stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> T {
        match self.volumetric {
            Volumetric::Ciarlet => T::lit(0.5 * self.lame.lambda) * at.jacobian_squared_minus_one(),
            Volumetric::Logarithmic => T::lit(self.lame.lambda) * at.log_jacobian(),
        }
    }

    /// J (J U')': ΛJ², or Λ
    #[inline(always)]
    fn volumetric_stiffness<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> T {
        match self.volumetric {
            Volumetric::Ciarlet => T::lit(self.lame.lambda) * at.jacobian * at.jacobian,
            Volumetric::Logarithmic => T::lit(self.lame.lambda),
        }
    }
}

impl Elastic for NeoHookean {
    /// W = Λ/2 [½ j² + (j − ln J)] + G [(tr E − j) + (j − ln J)], or with Λ/2 (ln J)² in place of the first bracket.
    #[inline(always)]
    fn energy<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> T {
        let half_lambda = T::lit(0.5 * self.lame.lambda);
        let volumetric = match self.volumetric {
            Volumetric::Ciarlet => T::lit(0.5) * at.j * at.j + at.j_minus_log_jacobian(),
            Volumetric::Logarithmic => at.log_jacobian() * at.log_jacobian(),
        };
        half_lambda * volumetric + T::lit(self.lame.shear) * at.trace_e_minus_log_jacobian()
    }

    /// S = F⁻¹ P,  P = J U'(J) F⁻ᵀ + G (H + F⁻ᵀ Hᵀ)
    ///
    /// H + F⁻ᵀHᵀ = F − F⁻ᵀ is small where strain and rotation are, and no larger than F where F is large: as C⁻¹ [J U' I + 2G E],
    /// shear is a difference of products of size ‖F‖², as G (I − C⁻¹) one of numbers of size 1.
    #[inline(always)]
    fn stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> Tensor<T, D> {
        let f_inv_t = at.inverse_transpose();
        let shear = scaled(&(at.h + f_inv_t * at.h.transpose()), T::lit(self.lame.shear));
        f_inv_t.transpose() * (scaled(&f_inv_t, self.volumetric_stress(at)) + shear)
    }

    /// ℂ:X = ΛJ² (C⁻¹:X) C⁻¹ − 2q C⁻¹ sym(X) C⁻¹, with q = J U'(J) − G
    #[inline(always)]
    fn elasticity<T: Real, const D: usize>(&self, at: &Deformation<T, D>, x: &Tensor<T, D>) -> Tensor<T, D> {
        let f_inv_t = at.inverse_transpose();
        let c_inv = f_inv_t.transpose() * f_inv_t;
        let q = self.volumetric_stress(at) - T::lit(self.lame.shear);
        scaled(&c_inv, self.volumetric_stiffness(at) * contract(&c_inv, x))
            - scaled(&(c_inv * (x + x.transpose()) * c_inv), q)
    }

    /// ℂmat{v,b} = ΛJ² (C⁻¹v ⊗ C⁻¹b) − q (C⁻¹b·v) C⁻¹ − q (C⁻¹b ⊗ C⁻¹v)   (eq. 39)
    #[inline(always)]
    fn tangent_density<T: Real, const D: usize>(
        &self,
        at: &Deformation<T, D>,
        v: &Vector<T, D>,
        b: &Vector<T, D>,
    ) -> Tensor<T, D> {
        let f_inv_t = at.inverse_transpose();
        let c_inv = f_inv_t.transpose() * f_inv_t;
        let q = self.volumetric_stress(at) - T::lit(self.lame.shear);
        let (cv, cb) = (c_inv * v, c_inv * b);
        scaled(&outer(&cv, &cb), self.volumetric_stiffness(at))
            - scaled(&c_inv, q * cb.dot(v))
            - scaled(&outer(&cb, &cv), q)
    }

    /// V₀ [ G L b_n + ΛJ² (A:L) A − q A Lᵀ A ],  A = ΔF⁻ᵀ = F⁻ᵀ F_nᵀ: δP = G δF + ΛJ² (F⁻ᵀ:δF) F⁻ᵀ − q F⁻ᵀ δFᵀ F⁻ᵀ pushed
    /// forward to the configuration n.
    #[inline(always)]
    fn closed<const D: usize>(
        &self,
        f_n: &Tensor<f64, D>,
        at: &Deformation<f64, D>,
        volume: f64,
    ) -> Option<ClosedTangent<f64, D>> {
        let shear = self.lame.shear;
        Some(ClosedTangent {
            a: rows(&(at.inverse_transpose() * f_n.transpose())),
            right: rows(&scaled(&(f_n * f_n.transpose()), shear * volume)),
            bulk: self.volumetric_stiffness(at) * volume,
            q: (self.volumetric_stress(at) - shear) * volume,
            both: None,
        })
    }
}

/// The solid whose volumetric response is known to the compiler: no branch is left in a loop over particles.
struct Of<const LOGARITHMIC: bool>(Lame);

impl<const LOGARITHMIC: bool> Of<LOGARITHMIC> {
    #[inline(always)]
    fn law(&self) -> NeoHookean {
        if LOGARITHMIC { NeoHookean::logarithmic(self.0) } else { NeoHookean::ciarlet(self.0) }
    }
}

impl<const LOGARITHMIC: bool> Elastic for Of<LOGARITHMIC> {
    #[inline(always)]
    fn energy<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> T {
        self.law().energy(at)
    }

    #[inline(always)]
    fn stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> Tensor<T, D> {
        self.law().stress(at)
    }

    #[inline(always)]
    fn elasticity<T: Real, const D: usize>(&self, at: &Deformation<T, D>, x: &Tensor<T, D>) -> Tensor<T, D> {
        self.law().elasticity(at, x)
    }

    #[inline(always)]
    fn closed<const D: usize>(
        &self,
        f_n: &Tensor<f64, D>,
        at: &Deformation<f64, D>,
        volume: f64,
    ) -> Option<ClosedTangent<f64, D>> {
        self.law().closed(f_n, at, volume)
    }
}
