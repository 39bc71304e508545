//! libCEED, pull request 474 (review of 24 March 2020): half the shear stiffness.
//!
//! Source: <https://github.com/CEED/libCEED/pull/474>, "Is this Jacobian really correct (Newton converges quadratically)?" and "I think
//! we're getting confused with the factor of 2 that Voigt inserts". The Jacobian had `0.5*TwoMu*de[1][2]`: the modulus μ of engineering
//! shears γ = 2ε, applied to the tensor's ε. A reviewer saw it before the merge of 26 March 2020.
//!
//! Our law is libCEED's small-strain law: σ = Λ ln(1 + tr ε) I + 2μ ε, ∂σ/∂ε = Λ/(1 + tr ε) I ⊗ I + 2μ I ⊙ I.
//! Before: the entries of the three shears are halved.

use crate::algebra::{Version, delta, matrix, square, vector};
use crate::check::{assert_diagnosed, assert_law_consistent, assert_law_wrong};
use tangent_check::convention::{Convention, Measure};
use tangent_check::law::{CallFailed, Law, Response, Step};
use tangent_check::tensor::{IDENTITY, from_entries, sum, trace};

const LAMBDA: f64 = 1.5;
const SHEAR: f64 = 1.0;

pub struct LogarithmicVolume(pub Version);

impl Law for LogarithmicVolume {
    fn name(&self) -> String {
        self.0.label("Small strain with logarithmic volume")
    }

    fn convention(&self) -> Convention {
        Convention::abaqus(Measure::CauchyByStrain)
    }

    fn state_at_rest(&self) -> Vec<f64> {
        Vec::new()
    }

    fn respond(&mut self, step: &Step) -> Result<Response, CallFailed> {
        let strain = sum(&step.strain, 1.0, &step.strain_increment);
        let growth = 1.0 + trace(&strain);
        let pressure = LAMBDA * growth.ln();
        let stress = from_entries(|i, j| pressure * delta(i, j) + 2.0 * SHEAR * strain[i][j]);
        let factor = if self.0 == Version::Before { 0.5 } else { 1.0 };
        let tangent = matrix(|i, j, k, l| {
            let shear = if i == j { 2.0 * SHEAR } else { factor * 2.0 * SHEAR };
            LAMBDA / growth * delta(i, j) * delta(k, l) + shear * square(&IDENTITY, [i, j, k, l])
        });
        Ok(Response { stress: vector(&stress), tangent, state: Vec::new() })
    }
}

#[test]
fn before_the_shears_have_half_their_stiffness() {
    let entries = [(3, 3), (4, 4), (5, 5)].into_iter().collect();
    let (report, _) = assert_law_wrong(&mut LogarithmicVolume(Version::Before), &[(3, 3), (4, 4), (5, 5)], &entries);
    // An isotropic law has the entries of shear by shear alone, so that four mistakes are the same here.
    assert_diagnosed(&report, "the entries of shear by shear multiplied by ½ (engineering shear)");
    assert_eq!(report.diagnoses[0].candidates.len(), 4);
}

#[test]
fn after_the_shears_have_their_stiffness() {
    assert_law_consistent(&mut LogarithmicVolume(Version::After));
}
