//! Energy and stress at one deformation: in `f64`, in double-double, and by textbook formulas.

use crate::double_double::DoubleDouble;
use crate::studies::short;
use bfree::material::{Lame, Law, Material, MaterialState, MooneyRivlin, NeoHookean, StVenantKirchhoff};
use bfree::scalar::Real;
use bfree::tensor::{Tensor, Vector, contract, determinant, identity, inverse, outer, scaled, trace};
use num_traits::Signed;

/// ν = 0.3. Laws in logarithmic strains have no textbook formula that double-double could evaluate, and are left out.
pub(super) fn laws() -> Vec<(String, Material)> {
    let closed = |(name, law): (&str, Material)| {
        let spectral = matches!(
            law,
            Material::Ogden(_) | Material::Viscoelastic(_) | Material::VonMises(_) | Material::DruckerPrager(_)
        );
        // e^{k₂ (I₄ − 1)²} exceeds the range of f64 there.
        let exponential = matches!(law, Material::FibreReinforced(_));
        (!spectral && !exponential).then(|| (short(name), law))
    };
    Material::examples(Lame { lambda: 576.0, shear: 384.0 }).into_iter().filter_map(closed).collect()
}

/// A model for the rounding of the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rounding {
    /// H changes by eps ‖H‖ in any direction, as it does when H is stored or composed from increments.
    Displacement,
    /// Every entry of F changes by eps of itself: for deformations along the axes, whose F is exact.
    Entries,
    /// H changes by eps ‖H‖, and det F by eps of its six products. The products are as large as ‖F‖³. If one stretch is much larger than
    /// the others and not along an axis, they cancel, and no smaller error is possible without pivoting.
    Products,
}

/// Errors at one deformation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Errors {
    /// |δW| and ‖δS‖ over the effect of rounding result and input, eps (|W| + κ) and eps (‖S‖ + κ): a number of roundings.
    pub energy: f64,
    pub stress: f64,
}

impl Errors {
    pub const NONE: Self = Self { energy: 0.0, stress: 0.0 };

    pub fn worse(self, other: Self) -> Self {
        let worse = super::worse;
        Self { energy: worse(self.energy, other.energy), stress: worse(self.stress, other.stress) }
    }
}

/// Measures the errors of `law` at `h`.
///
/// To first order in eps, rounding of the input changes S by ‖∂S/∂H‖ eps ‖H‖ and W by ‖P‖ eps ‖H‖. If W is of second order in a strain
/// below eps, it also changes by ½ ‖∂P/∂H‖ (eps ‖H‖)².
pub(super) fn judge<const D: usize>(law: &Material, h: &Tensor<f64, D>, rounding: Rounding) -> Errors {
    let at = MaterialState::new(*h);
    let exact_at = MaterialState::new(h.map(DoubleDouble::from));
    let (exact_w, exact_s) = (law.energy(&exact_at), law.stress(&exact_at));
    let error = |w: f64, s: Tensor<f64, D>| {
        let w = (DoubleDouble::from(w) - exact_w).magnitude();
        let s = s.zip_map(&exact_s, |s, exact| (DoubleDouble::from(s) - exact).magnitude()).norm();
        (w, s)
    };
    let (energy, stress) = error(law.energy(&at), law.stress(&at));

    let (w, s) = (exact_w.magnitude(), exact_s.map(DoubleDouble::value));
    let piola = at.f * s;
    let unit = |k: usize| Vector::<f64, D>::from_fn(|i, _| if i == k { 1.0 } else { 0.0 });
    let response = |i: usize, k: usize| {
        let strain = at.f.transpose() * outer(&unit(i), &unit(k));
        law.elasticity(&at, &strain).norm()
    };
    let pairs = || (0..D).flat_map(|i| (0..D).map(move |k| (i, k)));
    let stiffness = pairs().map(|(i, k)| response(i, k).powi(2)).sum::<f64>().sqrt();
    let (change_w, change_s) = match rounding {
        Rounding::Displacement => (piola.norm() * h.norm(), stiffness * h.norm()),
        Rounding::Products => {
            // δF = F δJ/(D J) is a purely volumetric change.
            let volume = permanent(&at.f.abs()) / (D as f64 * at.jacobian);
            let response = law.elasticity(&at, &(at.f.transpose() * at.f)).norm();
            let change_w = piola.norm() * h.norm() + contract(&piola, &at.f).abs() * volume;
            (change_w, stiffness * h.norm() + response * volume)
        }
        Rounding::Entries => {
            (contract(&piola.abs(), &at.f.abs()), pairs().map(|(i, k)| at.f[(i, k)].abs() * response(i, k)).sum())
        }
    };
    let second = 0.5 * (at.f.norm() * stiffness + s.norm()) * (f64::EPSILON * h.norm()).powi(2);
    Errors {
        energy: ratio(energy, f64::EPSILON * (w + change_w) + second),
        stress: ratio(stress, f64::EPSILON * (s.norm() + change_s)),
    }
}

/// The generic formulas against the textbook formulas, both in double-double, relative to the result.
pub(super) fn reference<const D: usize>(law: &Material, h: &Tensor<f64, D>) -> f64 {
    let h = h.map(DoubleDouble::from);
    let at = MaterialState::new(h);
    let (w, s) = (law.energy(&at), law.stress(&at));
    let (naive_w, naive_s) = naive(law, &h);
    let stress = s.zip_map(&naive_s, |a, b| (a - b).magnitude()).norm() / s.map(DoubleDouble::magnitude).norm();
    super::worse((w - naive_w).abs().magnitude() / w.magnitude(), stress)
}

/// The sum of the products in the determinant, all with the sign +.
fn permanent<const D: usize>(a: &Tensor<f64, D>) -> f64 {
    let minor = |i: usize, k: usize| a[(1, i)] * a[(2, k)] + a[(1, k)] * a[(2, i)];
    match D {
        1 => a[(0, 0)],
        2 => a[(0, 0)] * a[(1, 1)] + a[(0, 1)] * a[(1, 0)],
        _ => a[(0, 0)] * minor(1, 2) + a[(0, 1)] * minor(0, 2) + a[(0, 2)] * minor(0, 1),
    }
}

fn ratio(error: f64, size: f64) -> f64 {
    if error == 0.0 { 0.0 } else { error / size }
}

/// W and S through C = FᵀF, with ln J = ½ ln det C and tr C − 3: the usual formulas.
fn naive<T: Real, const D: usize>(law: &Material, h: &Tensor<T, D>) -> (T, Tensor<T, D>) {
    let one = identity::<T, D>();
    let f = one + h;
    let c = f.transpose() * f;
    let (lit, d) = (T::lit, T::lit(D as f64));
    let det_c = determinant(&c);
    let ln_j = det_c.ln() * lit(0.5);
    let (lame, u, pressure) = match law {
        Material::NeoHookean(NeoHookean { lame, .. }) => {
            let lambda = lit(lame.lambda);
            let u = lambda * lit(0.25) * (det_c - T::one()) - lambda * lit(0.5) * ln_j;
            (lame, u, lambda * lit(0.5) * (det_c - T::one()))
        }
        Material::NeoHookeanLogarithmic(NeoHookean { lame, .. }) => {
            let lambda = lit(lame.lambda);
            (lame, lambda * lit(0.5) * ln_j * ln_j, lambda * ln_j)
        }
        Material::MooneyRivlin(solid @ MooneyRivlin { c1, c2, .. }) => {
            // I₁ and I₂ of the 3×3 C, whose other diagonal entries are 1.
            let (c1, c2, lambda) = (lit(*c1), lit(*c2), lit(solid.volumetric_lambda()));
            let missing = lit((3 - D) as f64);
            let first = trace(&c) + missing;
            let second = (first * first - contract(&c, &c) - missing) * lit(0.5);
            let u = lambda * lit(0.25) * (det_c - T::one()) - lambda * lit(0.5) * ln_j;
            let three = lit(3.0);
            let w = c1 * (first - three) + c2 * (second - three) - lit(2.0) * (c1 + c2 + c2) * ln_j + u;
            let of_c_inverse = lambda * lit(0.5) * (det_c - T::one()) - lit(2.0) * (c1 + c2 + c2);
            let s =
                scaled(&one, lit(2.0) * (c1 + c2 * first)) - scaled(&c, c2 + c2) + scaled(&inverse(&c), of_c_inverse);
            return (w, s);
        }
        Material::Ogden(_)
        | Material::FibreReinforced(_)
        | Material::Viscoelastic(_)
        | Material::VonMises(_)
        | Material::DruckerPrager(_)
        | Material::Foreign(_) => {
            return (lit(f64::NAN), Tensor::from_element(lit(f64::NAN)));
        }
        Material::StVenantKirchhoff(StVenantKirchhoff { lame }) => {
            let (lambda, shear) = (lit(lame.lambda), lit(lame.shear));
            let e = scaled(&(c - one), lit(0.5));
            let tr_e = trace(&e);
            let w = lambda * lit(0.5) * tr_e * tr_e + shear * contract(&e, &e);
            return (w, scaled(&one, lambda * tr_e) + scaled(&e, lit(2.0) * shear));
        }
    };
    let (shear, c_inverse) = (lit(lame.shear), inverse(&c));
    let w = u - shear * ln_j + shear * lit(0.5) * (trace(&c) - d);
    (w, scaled(&c_inverse, pressure) + scaled(&(one - c_inverse), shear))
}
