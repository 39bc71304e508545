//! UMAT-ABAQUS_library, pull request 6 (10 June 2026): a user element is fed the tangent of a UMAT.
//!
//! Our law: the spatial tangent c (Truesdell rate) of a neo-Hookean solid, as the element asks for it. Before: DDSDDE, which is
//! c + ½ (δᵢₖ σⱼₗ + σᵢₖ δⱼₗ + δᵢₗ σⱼₖ + σᵢₗ δⱼₖ). The element itself is not modelled.

use crate::algebra::{ORDER, Story, Version};
use crate::check::{all, assert_diagnosed, assert_law_wrong};
use crate::neo_hooke;
use tangent_check::convention::Measure;
use tangent_check::law::{Response, Step};

pub const STORY: Story = Story { law: "Law of a user element", measure: Measure::Truesdell, rest: Vec::new, respond };

fn respond(version: Version, step: &Step) -> Response {
    neo_hooke::spatial_response(step, |_| [1.0, if version == Version::Before { 1.0 } else { 0.0 }])
}

#[test]
fn before_the_element_gets_the_jaumann_rate() {
    // δᵢₖ σⱼₗ: components that share an index
    let shares = |&(row, column): &(usize, usize)| {
        let ((i, j), (k, l)) = (ORDER[row], ORDER[column]);
        i == k || i == l || j == k || j == l
    };
    let entries = all(6, 6).into_iter().filter(shares).collect();
    let (report, finding) = assert_law_wrong(&STORY, &[(0, 0)], &entries);
    assert!((0.6..0.7).contains(&finding.deviation), "{}", finding.deviation);
    assert_diagnosed(&report, "another rate: the Jaumann rate of the Kirchhoff stress over J");
}
