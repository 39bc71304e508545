//! UMAT-ABAQUS_library, pull request 6 (10 June 2026): a user element is fed the tangent of a UMAT.
//!
//! Source: <https://github.com/jpsferreira/UMAT-ABAQUS_library/pull/6>, "correct residual" with the modulus of the UMAT: an element that
//! adds its own geometric term needs the spatial tangent c, "not the Jaumann-corrected UMAT modulus". The library's earlier user elements
//! had used the latter, so that the stress term of the Jaumann rate was counted beside the geometric term.
//!
//! Our law: the spatial tangent c (Truesdell rate) of a neo-Hookean solid, as the element asks for it. Before: DDSDDE, which is
//! c + ½ (δᵢₖ σⱼₗ + σᵢₖ δⱼₗ + δᵢₗ σⱼₖ + σᵢₗ δⱼₖ). The element itself is not modelled.

use crate::algebra::{ORDER, Version, matrix, rotation_term, vector};
use crate::check::{all, assert_diagnosed, assert_law_consistent, assert_law_wrong};
use crate::neo_hooke;
use tangent_check::convention::{Convention, Measure};
use tangent_check::law::{CallFailed, Law, Response, Step};
use tangent_check::tensor::determinant;

pub struct ElementLaw(pub Version);

impl Law for ElementLaw {
    fn name(&self) -> String {
        self.0.label("Law of a user element")
    }

    fn convention(&self) -> Convention {
        Convention::abaqus(Measure::Truesdell)
    }

    fn state_at_rest(&self) -> Vec<f64> {
        Vec::new()
    }

    fn respond(&mut self, step: &Step) -> Result<Response, CallFailed> {
        let jacobian = determinant(&step.gradient);
        let stress = neo_hooke::cauchy(&step.gradient, jacobian);
        let factor = if self.0 == Version::Before { 1.0 } else { 0.0 };
        let tangent = matrix(|i, j, k, l| {
            neo_hooke::spatial_modulus(jacobian, [i, j, k, l]) + factor * rotation_term(&stress, [i, j, k, l])
        });
        Ok(Response { stress: vector(&stress), tangent, state: Vec::new() })
    }
}

#[test]
fn before_the_element_gets_the_jaumann_rate() {
    // δᵢₖ σⱼₗ: components that share an index
    let shares = |&(row, column): &(usize, usize)| {
        let ((i, j), (k, l)) = (ORDER[row], ORDER[column]);
        i == k || i == l || j == k || j == l
    };
    let entries = all(6, 6).into_iter().filter(shares).collect();
    let (report, finding) = assert_law_wrong(&mut ElementLaw(Version::Before), &[(0, 0)], &entries);
    assert!((0.6..0.7).contains(&finding.deviation), "{}", finding.deviation);
    assert_diagnosed(&report, "another rate: the Jaumann rate of the Kirchhoff stress over J");
}

#[test]
fn after_the_element_gets_the_spatial_tangent() {
    assert_law_consistent(&mut ElementLaw(Version::After));
}
