//! The ground substance of several laws, a compressible neo-Hookean solid:
//! W = μ/2 (tr C − 3) − μ ln J + Λ/2 (ln J)².

use crate::algebra::{RightCauchyGreen, delta, matrix, rotation_term, square, vector};
use tangent_check::convention::Tensor;
use tangent_check::law::{Response, Step};
use tangent_check::tensor::{IDENTITY, determinant, from_entries, product, trace, transposed};

const SHEAR: f64 = 1.0;
const LAMBDA: f64 = 1.5;

/// W.
pub fn energy(at: &RightCauchyGreen) -> f64 {
    let log = at.jacobian.ln();
    0.5 * SHEAR * (trace(&at.c) - 3.0) - SHEAR * log + 0.5 * LAMBDA * log * log
}

/// S = μ (I − C⁻¹) + Λ ln J C⁻¹.
pub fn second_piola(at: &RightCauchyGreen) -> Tensor {
    let factor = LAMBDA * at.jacobian.ln() - SHEAR;
    from_entries(|i, j| SHEAR * IDENTITY[i][j] + factor * at.inverse[i][j])
}

/// ∂S/∂E = Λ C⁻¹ ⊗ C⁻¹ + 2 (μ − Λ ln J) C⁻¹ ⊙ C⁻¹.
pub fn green_modulus(at: &RightCauchyGreen, index: [usize; 4]) -> f64 {
    let [i, j, k, l] = index;
    let factor = 2.0 * (SHEAR - LAMBDA * at.jacobian.ln());
    LAMBDA * at.inverse[i][j] * at.inverse[k][l] + factor * square(&at.inverse, index)
}

/// σ = [μ (b − I) + Λ ln J I] / J.
pub fn cauchy(gradient: &Tensor, jacobian: f64) -> Tensor {
    let b = product(gradient, &transposed(gradient));
    let factor = LAMBDA * jacobian.ln() - SHEAR;
    from_entries(|i, j| (SHEAR * b[i][j] + factor * IDENTITY[i][j]) / jacobian)
}

/// The spatial tangent c = [Λ I ⊗ I + 2 (μ − Λ ln J) I ⊙ I] / J.
pub fn spatial_modulus(jacobian: f64, index: [usize; 4]) -> f64 {
    let [i, j, k, l] = index;
    let factor = 2.0 * (SHEAR - LAMBDA * jacobian.ln());
    (LAMBDA * delta(i, j) * delta(k, l) + factor * square(&IDENTITY, index)) / jacobian
}

/// The response with the tangent a c + b R, where R is the term that leads to the Jaumann rate of the Kirchhoff stress over J.
pub fn spatial_response(step: &Step, factors: impl Fn(f64) -> [f64; 2]) -> Response {
    let jacobian = determinant(&step.gradient);
    let stress = cauchy(&step.gradient, jacobian);
    let [a, b] = factors(jacobian);
    let tangent =
        matrix(|i, j, k, l| a * spatial_modulus(jacobian, [i, j, k, l]) + b * rotation_term(&stress, [i, j, k, l]));
    Response { stress: vector(&stress), tangent, state: Vec::new() }
}
