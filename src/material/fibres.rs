//! One family of fibres in an elastic matrix.

use super::listed::elastic_base;
use super::{Lame, Law, Listed, MaterialState, TangentBlocks, VolumeResponse};
use crate::problems::Problems;
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor, Vector, contract, outer, scaled};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The constants of [`FibreReinforced`].
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[schemars(rename = "FibreReinforced")]
#[serde(deny_unknown_fields)]
pub struct FibreReinforcedParameters<P> {
    /// The law of the matrix. It must be an elastic law.
    pub base: Box<P>,
    /// Direction of the fibres in the undeformed body, of any length but 0. It has three numbers in every dimension.
    pub direction: [f64; 3],
    /// k₁ (stress), > 0. At rest, fibres add 4 k₁ to Young's modulus along their direction.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub modulus: f64,
    /// k₂ (no unit), ≥ 0. The larger it is, the sooner fibres stiffen. With 0 their energy is k₁/2 (I₄ − 1)².
    #[serde(default)]
    #[schemars(range(min = 0))]
    pub exponent: f64,
}

/// W = W_base + k₁/(2k₂) (e^{k₂ (I₄ − 1)²} − 1) with I₄ = a·C a, for fibres in the direction a. Fibres bear tension alone (Holzapfel,
/// Gasser, Ogden, J. Elasticity 61, 2000).
///
/// ```
/// use bfree::material::{FibreReinforced, Lame, Law, MaterialState, NeoHookean};
/// use bfree::tensor::{Tensor, Vector};
///
/// let base = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
/// let law = FibreReinforced::new(base, Vector::from([2.0, 0.0, 0.0]), 10.0, 0.0).ok_or("an elastic base, and a direction")?;
/// let fibres = |h: f64| {
///     let at = MaterialState::new(Tensor::<f64, 1>::from_element(h));
///     (law.stress(&at) - base.stress(&at))[(0, 0)]
/// };
/// // S = 2k₁ (I₄ − 1) with I₄ = 1.21; nothing in compression.
/// assert!((fibres(0.1) - 2.0 * 10.0 * 0.21).abs() < 1e-13);
/// assert_eq!(fibres(-0.1), 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FibreReinforced<B> {
    base: Box<B>,
    /// a
    direction: Vector<f64, 3>,
    /// k₁
    modulus: f64,
    /// k₂
    exponent: f64,
}

impl<B: Law> FibreReinforced<B> {
    /// Fibres in a matrix. `None` unless the matrix is elastic, the direction has a length, `modulus` > 0 and `exponent` ≥ 0.
    pub fn new(base: B, direction: Vector<f64, 3>, modulus: f64, exponent: f64) -> Option<Self> {
        let unit = direction.try_normalize(0.0).filter(|unit| (unit.norm() - 1.0).abs() < 1e-9);
        let good = base.internal_variables().is_empty() && modulus > 0.0 && exponent >= 0.0;
        unit.filter(|_| good).map(|direction| Self { base: Box::new(base), direction, modulus, exponent })
    }

    /// a ⊗ a, and I₄ − 1 = 2 a·E a if it is positive. `D` components of a are enough, because nothing is stretched along the other axes.
    fn stretched<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> (Tensor<T, D>, Option<T>) {
        let along = Tensor::from_fn(|i, k| T::lit(self.direction[i] * self.direction[k]));
        let stretch = contract(&along, &at.green_lagrange()) * T::lit(2.0);
        (along, (stretch.value() > 0.0).then_some(stretch))
    }

    /// k₁ e^{k₂ x²} with x = I₄ − 1.
    fn stiffness<T: Real>(&self, x: T) -> T {
        (x * x * T::lit(self.exponent)).exp() * T::lit(self.modulus)
    }

    /// 4 W″ = 4k₁ (1 + 2k₂ x²) e^{k₂ x²}, the factor of a ⊗ a ⊗ a ⊗ a in ℂ.
    fn slope(&self, x: f64) -> f64 {
        self.stiffness(x) * (4.0 + x * x * (8.0 * self.exponent))
    }
}

impl<B: Law> Law for FibreReinforced<B> {
    fn volumetric<T: Real>(&self, at: &Deformation<T, 1>) -> Option<VolumeResponse<T>> {
        self.base.volumetric(at)
    }

    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        let base = self.base.energy(at);
        self.stretched(at).1.map_or(base, |x| {
            let squared = x * x;
            let (k_1, k_2) = (T::lit(0.5 * self.modulus), T::lit(self.exponent));
            base + if self.exponent > 0.0 { (squared * k_2).exp_m1() * k_1 / k_2 } else { squared * k_1 }
        })
    }

    /// S = S_base + 2 W′ a ⊗ a
    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        let (base, (along, stretch)) = (self.base.stress(at), self.stretched(at));
        stretch.map_or(base, |x| base + scaled(&along, self.stiffness(x) * x * T::lit(2.0)))
    }

    /// ℂ:X = ℂ_base:X + 4 W″ (a·X a) a ⊗ a
    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        let (base, (along, stretch)) = (self.base.elasticity(at, x), self.stretched(at));
        stretch.map_or(base, |i| base + scaled(&along, self.slope(i) * contract(&along, x)))
    }

    /// The blocks of the base, plus 4 W″ (a·F_rᵀ e_k) (a·F_rᵀ e_l) F a ⊗ F a.
    fn tangent_blocks<const D: usize>(&self, f_r: &Tensor<f64, D>, at: &MaterialState<f64, D>) -> TangentBlocks<D> {
        let mut blocks = self.base.tangent_blocks(f_r, at);
        if let (_, Some(x)) = self.stretched(at) {
            let a = Vector::<f64, D>::from_fn(|i, _| self.direction[i]);
            let (now, before) = (at.f * a, f_r * a);
            let block = outer(&now, &now) * self.slope(x);
            for (blocks, k) in blocks.iter_mut().zip(before.iter()) {
                blocks.iter_mut().zip(before.iter()).for_each(|(sum, l)| *sum += block * (k * l));
            }
        }
        blocks
    }
}

impl<B: Listed> Listed for FibreReinforced<B> {
    type Parameters = FibreReinforcedParameters<B::Parameters>;

    fn build(given: &Self::Parameters, problems: &mut Problems, path: &str) -> Option<Self> {
        let at = |key: &str| format!("{path}.{key}");
        let base = elastic_base::<B>(&given.base, problems, path);
        let direction = Vector::<f64, 3>::from(given.direction);
        problems.vector(&at("direction"), &given.direction, 3);
        problems.require(direction.amax() > 0.0, &at("direction"), "0", "must have a length");
        problems.positive(&at("modulus"), given.modulus);
        problems.not_negative(&at("exponent"), given.exponent);
        // A direction of any length must not overflow.
        let direction = direction / direction.amax();
        base.and_then(|base| Self::new(base, direction, given.modulus, given.exponent))
    }

    /// Fibres as stiff as the matrix, in no coordinate plane. The law is Hooke's only in compression along the fibres.
    fn example(lame: Lame) -> Self {
        let base = Box::new(B::example(lame));
        Self { base, direction: Vector::from([0.6, 0.64, 0.48]), modulus: 0.5 * lame.shear, exponent: 1e-3 }
    }
}
