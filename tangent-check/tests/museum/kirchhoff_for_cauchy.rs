//! fedoo, pull request 48 (9 July 2026): a Kirchhoff tangent is used as a Cauchy tangent.
//!
//! Our law models the factor J alone: a neo-Hookean solid as a UMAT, whose DDSDDE is the Jaumann rate of the Kirchhoff stress over J,
//!
//! ℂ = c + ½ (δᵢₖ σⱼₗ + σᵢₖ δⱼₗ + δᵢₗ σⱼₖ + σᵢₗ δⱼₖ).
//!
//! Before: J ℂ, not divided by J. The factor is invisible where the volume is kept.

use crate::algebra::{Story, Version};
use crate::check::{GRADIENT, all, assert_diagnosed, assert_law_wrong};
use crate::neo_hooke;
use tangent_check::convention::Measure;
use tangent_check::law::{Response, Step};
use tangent_check::tensor::determinant;

pub const STORY: Story = Story { law: "Neo-Hookean UMAT", measure: Measure::JaumannKirchhoff, rest: Vec::new, respond };

fn respond(version: Version, step: &Step) -> Response {
    neo_hooke::spatial_response(step, |jacobian| if version == Version::Before { [jacobian; 2] } else { [1.0; 2] })
}

#[test]
fn before_the_tangent_is_j_times_too_large() {
    // A neo-Hookean tangent has no entry for a normal component and a shear that does not share its index.
    let zero = [(0, 5), (1, 4), (2, 3)];
    let entries = all(6, 6).into_iter().filter(|&(row, column)| !zero.contains(&(row.min(column), row.max(column))));
    let entries = entries.collect();
    let (report, finding) = assert_law_wrong(&STORY, &[(0, 0)], &entries);
    assert!((finding.deviation - (determinant(&GRADIENT) - 1.0)).abs() < 1e-9, "{}", finding.deviation);
    assert_diagnosed(&report, "an additional factor J");
}
