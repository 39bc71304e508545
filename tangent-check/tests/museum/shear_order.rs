//! MOOSE, issues 20111 (23 January 2022) and 22225 (26 September 2022): the order of the shears.
//!
//! Our law: orthotropic elasticity, σ = 𝔻 : ε, with the shear moduli G₁₂ ≠ G₁₃ ≠ G₂₃ and the stress in Abaqus' order. Before: the tangent
//! in the order 11, 22, 33, 23, 13, 12.

use crate::algebra::{ORDER, Story, Version, vector};
use crate::check::{assert_diagnosed, assert_law_wrong};
use tangent_check::convention::Measure;
use tangent_check::law::{Response, Step};
use tangent_check::matrix::Matrix;
use tangent_check::tensor::{ZERO, sum};

/// 𝔻 of the normal components.
const NORMAL: [[f64; 3]; 3] = [[10.0, 3.0, 2.0], [3.0, 7.0, 2.5], [2.0, 2.5, 5.0]];
/// G₁₂, G₁₃, G₂₃.
const SHEARS: [f64; 3] = [1.0, 2.0, 4.0];
/// 11, 22, 33, 23, 13, 12 as places in Abaqus' order.
const VOIGT: [usize; 6] = [0, 1, 2, 5, 4, 3];

pub const STORY: Story =
    Story { law: "Orthotropic elasticity", measure: Measure::CauchyByStrain, rest: Vec::new, respond };

fn respond(version: Version, step: &Step) -> Response {
    let strain = sum(&step.strain, 1.0, &step.strain_increment);
    let mut stress = ZERO;
    for (i, row) in NORMAL.iter().enumerate() {
        stress[i][i] = (0..3).map(|j| row[j] * strain[j][j]).sum();
    }
    for (&(i, j), modulus) in ORDER[3..].iter().zip(SHEARS) {
        stress[i][j] = 2.0 * modulus * strain[i][j];
    }
    let order = if version == Version::Before { VOIGT } else { [0, 1, 2, 3, 4, 5] };
    let tangent = Matrix::from_entries(6, 6, |row, column| modulus(order[row], order[column]));
    Response { stress: vector(&stress), tangent, state: Vec::new() }
}

/// 𝔻 in Abaqus' order.
fn modulus(row: usize, column: usize) -> f64 {
    match (row, column) {
        (0..3, 0..3) => NORMAL[row][column],
        _ if row == column => SHEARS[row - 3],
        _ => 0.0,
    }
}

#[test]
fn before_two_shears_are_exchanged() {
    let (report, finding) = assert_law_wrong(&STORY, &[(3, 3), (5, 5)], &[(3, 3), (5, 5)].into_iter().collect());
    assert!((finding.deviation - 0.3).abs() < 1e-9, "{}", finding.deviation);
    assert_diagnosed(&report, "the shear components 12 and 23 exchanged");
}
