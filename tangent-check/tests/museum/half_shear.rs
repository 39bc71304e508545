//! libCEED, pull request 474 (review of 24 March 2020): half the shear stiffness.
//!
//! Our law is libCEED's small-strain law: σ = Λ ln(1 + tr ε) I + 2μ ε, ∂σ/∂ε = Λ/(1 + tr ε) I ⊗ I + 2μ I ⊙ I.
//! Before: the entries of the three shears are halved.

use crate::algebra::{Story, Version, delta, matrix, square, vector};
use crate::check::{assert_diagnosed, assert_law_wrong};
use tangent_check::convention::Measure;
use tangent_check::law::{Response, Step};
use tangent_check::tensor::{IDENTITY, from_entries, sum, trace};

const LAMBDA: f64 = 1.5;
const SHEAR: f64 = 1.0;

pub const STORY: Story =
    Story { law: "Small strain with logarithmic volume", measure: Measure::CauchyByStrain, rest: Vec::new, respond };

fn respond(version: Version, step: &Step) -> Response {
    let strain = sum(&step.strain, 1.0, &step.strain_increment);
    let growth = 1.0 + trace(&strain);
    let pressure = LAMBDA * growth.ln();
    let stress = from_entries(|i, j| pressure * delta(i, j) + 2.0 * SHEAR * strain[i][j]);
    let factor = if version == Version::Before { 0.5 } else { 1.0 };
    let tangent = matrix(|i, j, k, l| {
        let shear = if i == j { 2.0 * SHEAR } else { factor * 2.0 * SHEAR };
        LAMBDA / growth * delta(i, j) * delta(k, l) + shear * square(&IDENTITY, [i, j, k, l])
    });
    Response { stress: vector(&stress), tangent, state: Vec::new() }
}

#[test]
fn before_the_shears_have_half_their_stiffness() {
    let entries = [(3, 3), (4, 4), (5, 5)].into_iter().collect();
    let (report, _) = assert_law_wrong(&STORY, &[(3, 3), (4, 4), (5, 5)], &entries);
    // An isotropic law has the entries of shear by shear alone, so that four mistakes are the same here.
    assert_diagnosed(&report, "the entries of shear by shear multiplied by ½ (engineering shear)");
    assert_eq!(report.diagnoses[0].candidates.len(), 4);
}
