//! Tangents by their definition, over dual numbers.

use super::dual::*;
use super::shipped::{Flow, Formula, Inputs};
use tangent_check::convention::{Convention, Measure, Tensor};
use tangent_check::matrix::Matrix;
use tangent_check::tensor;

pub fn inputs(gradient: D3, before: &Tensor, stress: &Tensor, state: &[f64]) -> Inputs {
    let before = constant(before);
    let increment = mul(&gradient, &inv(&before));
    let stretch = power(&mul(&increment, &t(&increment)), 0.5);
    Inputs {
        gradient,
        gradient_before: before,
        strain_increment: log(&stretch),
        rotation: mul(&inv(&stretch), &increment),
        length: 0.4,
        stress: constant(stress),
        state: state.to_vec(),
    }
}

/// F with the strain of this measure grown by ε B, by the definition of the measure.
pub fn perturbed(measure: Measure, f: &Tensor, before: &Tensor, b: &Tensor) -> D3 {
    match measure {
        Measure::PiolaByGradient | Measure::CauchyByGradient | Measure::KirchhoffByGradient => dual(f, b),
        Measure::SecondPiolaByGreen => {
            // U grows so that U² = C + 2 ε B; the rotation stays.
            let f0 = constant(f);
            let c = mul(&t(&f0), &f0);
            let u = power(&c, 0.5);
            let rotation = mul(&f0, &inv(&u));
            mul(&rotation, &power(&dual(&value(&c), &tensor::scaled(2.0, b)), 0.5))
        }
        Measure::CauchyByStrain => {
            let increment = mul(&constant(f), &inv(&constant(before)));
            let stretch = power(&mul(&increment, &t(&increment)), 0.5);
            let rotation = mul(&inv(&stretch), &increment);
            let grown = exp(&dual(&value(&log(&stretch)), b));
            mul(&mul(&grown, &rotation), &constant(before))
        }
        _ => mul(&dual(&tensor::IDENTITY, b), &constant(f)),
    }
}

/// The stress whose derivative is the tangent.
pub fn rated(measure: Measure, f: &D3, sigma: &D3, b: &Tensor) -> D3 {
    let j = det(f);
    let ratio = j / Dual::new(j.0);
    let back = dual(&tensor::IDENTITY, &tensor::scaled(-1.0, b));
    match measure {
        Measure::PiolaByGradient => times(j, &mul(sigma, &t(&inv(f)))),
        Measure::SecondPiolaByGreen => times(j, &mul(&mul(&inv(f), sigma), &t(&inv(f)))),
        Measure::CauchyByStrain | Measure::JaumannCauchy | Measure::CauchyByGradient => *sigma,
        Measure::JaumannKirchhoff => times(ratio, sigma),
        Measure::Truesdell => times(ratio, &mul(&mul(&back, sigma), &t(&back))),
        Measure::GreenNaghdi => {
            let rotation = mul(&inv(&power(&mul(f, &t(f)), 0.5)), f);
            let turned = mul(&rotation, &constant(&tensor::transposed(&value(&rotation))));
            times(ratio, &mul(&mul(&t(&turned), sigma), &turned))
        }
        Measure::KirchhoffByGradient => times(j, sigma),
    }
}

pub fn unit_strain(convention: &Convention, column: usize) -> Tensor {
    let (i, j) = convention.strain.pairs[column];
    let mut b = tensor::ZERO;
    b[i][j] = 1.0 / convention.strain.factor(column);
    if !convention.measure.by_gradient() {
        b[j][i] = b[i][j];
    }
    b
}

/// The exact tangent of a law in any convention.
pub fn exact(
    law: &dyn Formula,
    convention: &Convention,
    f: &Tensor,
    before: &Tensor,
    old: (&Tensor, &[f64]),
) -> Matrix {
    let column = |k: usize| {
        let b = unit_strain(convention, k);
        let f = perturbed(convention.measure, f, before, &b);
        let (sigma, _) = law.respond(&inputs(f, before, old.0, old.1), Flow::Algorithmic);
        convention.stress.vector(&slope(&rated(convention.measure, &f, &sigma, &b)))
    };
    let columns: Vec<Vec<f64>> = (0..convention.strain.count()).map(column).collect();
    Matrix::from_columns(convention.stress.count(), &columns)
}
