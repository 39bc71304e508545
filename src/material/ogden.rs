//! Ogden's solid: powers of the principal stretches.

use super::hencky::{Moduli, Principal, Strained};
use super::spectral::{Function, Power, primitive_trace};
use super::{Ciarlet, Lame, Law, Listed, MaterialState, TangentBlocks, VolumeResponse, Volumetric};
use crate::problems::{Number, Problems};
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor, identity, scaled};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A term of Ogden's energy: μ/α (λ₁^α + λ₂^α + λ₃^α − 3 − α ln J).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OgdenTerm {
    /// μ (stress), with the sign of α.
    pub modulus: f64,
    /// α (no unit), not 0 and at most 100 in size.
    #[schemars(range(min = -100, max = 100))]
    pub exponent: f64,
}

/// The most terms.
const MOST: usize = 8;

/// W = Σ μ/α (λ₁^α + λ₂^α + λ₃^α − 3 − α ln J) + U(J), with Ciarlet's U, for rubber (Ogden, Proc. R. Soc. Lond. A 328, 1972). 2G = Σ μ α.
///
/// In Hencky's strain ε the Kirchhoff stress is τ = Σ μ (e^{αε} − I) + J U' I.
///
/// ```
/// use bfree::material::{Lame, Law, MaterialState, NeoHookean, Ogden, OgdenTerm};
/// use bfree::tensor::Tensor;
///
/// // One term with α = 2 is the neo-Hookean solid of μ = G.
/// let ogden = Ogden { terms: vec![OgdenTerm { modulus: 2.0, exponent: 2.0 }], bulk: 3.0 + 4.0 / 3.0 };
/// let neo_hookean = NeoHookean::ciarlet(Lame::new(3.0, 2.0)?);
/// let at = MaterialState::new(Tensor::<f64, 2>::new(0.3, 0.5, -0.2, 0.1));
/// let apart = ogden.stress(&at) - neo_hookean.stress(&at);
/// assert!(apart.norm() < 1e-14);
/// # Ok::<(), bfree::material::LameError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[schemars(description = "The constants of [`Ogden`].")]
#[serde(deny_unknown_fields)]
pub struct Ogden {
    /// The terms, 1 to 8. The shear modulus is half of the sum of `modulus` times `exponent`.
    #[schemars(length(min = 1, max = 8))]
    pub terms: Vec<OgdenTerm>,
    /// The bulk modulus K (stress), > 2/3 of the shear modulus.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub bulk: f64,
}

impl Law for Ogden {
    /// Σ μα tr R(ε) + U, with R(x) = (e^{αx} − 1 − αx)/α² and tr ε = ln J
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        let strain = Strained::new(at, &[]).strain();
        let of = |(power, factor): (Power, f64)| primitive_trace(&power, &strain) * T::lit(factor);
        let volumetric = Ciarlet::energy(self.lambda(), at);
        self.powers().map(of).fold(volumetric, |sum, term| sum + term)
    }

    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        let strained = Strained::new(at, &[]);
        let of = |(power, factor): (Power, f64)| scaled(&strained.function(&power), T::lit(factor));
        let pressure: Tensor<T, 3> = scaled(&identity(), Ciarlet::stress(self.lambda(), at));
        strained.pulled_back(&self.powers().map(of).fold(pressure, |sum, term| sum + term))
    }

    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        self.moduli(at).elasticity(x)
    }

    fn volumetric<T: Real>(&self, at: &Deformation<T, 1>) -> Option<VolumeResponse<T>> {
        Some(Ciarlet::response(self.lambda(), at))
    }

    fn tangent_blocks<const D: usize>(&self, f_r: &Tensor<f64, D>, at: &MaterialState<f64, D>) -> TangentBlocks<D> {
        let mut blocks = [[Tensor::zeros(); D]; D];
        self.moduli(at).add_blocks(f_r, &mut blocks);
        blocks
    }
}

impl Ogden {
    /// Λ
    fn lambda(&self) -> f64 {
        self.bulk - self.least_bulk()
    }

    /// 2G/3 with 2G = Σ μα
    fn least_bulk(&self) -> f64 {
        let shear = 0.5 * self.terms.iter().map(|term| term.modulus * term.exponent).sum::<f64>();
        2.0 * shear / 3.0
    }

    /// (e^{αε} − I)/α and the factor μα of each term.
    fn powers(&self) -> impl Iterator<Item = (Power, f64)> {
        self.terms.iter().map(|term| (Power(term.exponent), term.modulus * term.exponent))
    }

    /// τᵢ = Σ μ (e^{αεᵢ} − 1) + J U' and its derivatives.
    fn moduli<const D: usize>(&self, at: &Deformation<f64, D>) -> Moduli {
        let principal = Principal::new(at, &[]);
        let (strains, pressure) = (principal.strains, Ciarlet::stress(self.lambda(), at));
        let sum = |of: &dyn Fn(&Power) -> f64| {
            self.powers().map(|(power, factor)| of(&power) * factor).fold(0.0, |sum, term| sum + term)
        };
        let secant = |i: usize, j: usize| sum(&|f| f.difference(strains[i], strains[j]));
        let bulk = Ciarlet::stiffness(self.lambda(), at);
        let slopes = Tensor::from_fn(|i, j| if i == j { bulk + secant(i, i) } else { bulk });
        principal.moduli(std::array::from_fn(|i| pressure + sum(&|f| f.value(strains[i]))), slopes, secant)
    }
}

impl Listed for Ogden {
    type Parameters = Self;

    fn build(given: &Self, problems: &mut Problems, path: &str) -> Option<Self> {
        let terms = format!("{path}.terms");
        let mut good = problems.one_to(MOST, &terms, &given.terms);
        for (i, OgdenTerm { modulus, exponent }) in given.terms.iter().enumerate().take(MOST) {
            let (of_modulus, of_exponent) = (format!("{terms}[{i}].modulus"), format!("{terms}[{i}].exponent"));
            good &= problems.number(&of_modulus, *modulus) && problems.between(&of_exponent, *exponent, -100.0, 100.0);
            let allowed = "must have the sign of the exponent, and neither may be 0";
            good &= problems.require(modulus * exponent > 0.0, &of_modulus, Number(*modulus), allowed);
        }
        let bulk = format!("{path}.bulk");
        good &= problems.positive(&bulk, given.bulk);
        let least = given.least_bulk();
        let allowed = format_args!("must be greater than 2/3 of the shear modulus = {}", Number(least));
        let stiff = good && problems.require(given.bulk > least, &bulk, Number(given.bulk), allowed);
        stiff.then(|| given.clone())
    }

    /// Ogden's rubber, roughly: stretches to the powers 1.5 and −2.
    fn example(lame: Lame) -> Self {
        let (shear, term) = (lame.shear, |modulus, exponent| OgdenTerm { modulus, exponent });
        Self { terms: vec![term(shear, 1.5), term(-0.25 * shear, -2.0)], bulk: lame.bulk_modulus() }
    }
}
