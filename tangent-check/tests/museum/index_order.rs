//! MOOSE, issue 22225 (26 September 2022): the rows of DDSDDE are its columns.
//!
//! Our law: plasticity whose strength depends on the pressure p = K tr ε and whose flow keeps the volume. The trial stress is
//! STRESS + ℂ : DSTRAN, N = s_tr/‖s_tr‖. Where ‖s_tr‖ > √2 k(p), with k(p) = k₀ exp(−p/p₀):
//!
//! s = √2 k(p) N, ∂σ/∂ε = K I ⊗ I + √2 k' K N ⊗ I + 2G √2 k/‖s_tr‖ (I ⊙ I − ⅓ I ⊗ I − N ⊗ N).
//!
//! The term N ⊗ I has no counterpart I ⊗ N, because the flow is not associated. Before: the transposed matrix.

use crate::algebra::{Story, Version, delta, matrix, square, symmetric_tensor, vector};
use crate::check::{all, assert_diagnosed, assert_law_wrong};
use tangent_check::convention::Measure;
use tangent_check::law::{Response, Step};
use tangent_check::matrix::Matrix;
use tangent_check::tensor::{IDENTITY, norm, scaled, sum, trace};

const BULK: f64 = 2.0;
const SHEAR: f64 = 1.0;
const STRENGTH: f64 = 0.05;
const PRESSURE: f64 = 2.0;

pub const STORY: Story =
    Story { law: "Frictional plasticity", measure: Measure::CauchyByStrain, rest: Vec::new, respond };

fn respond(version: Version, step: &Step) -> Response {
    let old = symmetric_tensor(&step.stress);
    let volume = trace(&step.strain_increment);
    let deviator = sum(&step.strain_increment, -volume / 3.0, &IDENTITY);
    let pressure = trace(&old) / 3.0 + BULK * volume;
    let trial = sum(&sum(&old, -trace(&old) / 3.0, &IDENTITY), 2.0 * SHEAR, &deviator);
    let radius = 2.0_f64.sqrt() * STRENGTH * (-pressure / PRESSURE).exp();
    let size = norm(&trial);
    let yields = size > radius;
    let ratio = if yields { radius / size } else { 1.0 };
    let direction = if yields { scaled(1.0 / size, &trial) } else { scaled(0.0, &trial) };
    let friction = -BULK * radius / PRESSURE;
    let tangent = matrix(|i, j, k, l| {
        let deviatoric = square(&IDENTITY, [i, j, k, l]) - delta(i, j) * delta(k, l) / 3.0;
        BULK * delta(i, j) * delta(k, l)
            + friction * direction[i][j] * delta(k, l)
            + 2.0 * SHEAR * ratio * (deviatoric - direction[i][j] * direction[k][l])
    });
    let stress = sum(&scaled(ratio, &trial), pressure, &IDENTITY);
    let tangent = if version == Version::Before { Matrix::from_entries(6, 6, |i, j| tangent[(j, i)]) } else { tangent };
    Response { stress: vector(&stress), tangent, state: Vec::new() }
}

#[test]
fn before_rows_and_columns_are_transposed() {
    // N ⊗ I − I ⊗ N
    let entries = all(6, 6).into_iter().filter(|&(row, column)| row != column && row.min(column) < 3).collect();
    let (report, _) = assert_law_wrong(&STORY, &[(0, 1), (1, 0)], &entries);
    assert_diagnosed(&report, "rows and columns transposed");
}
