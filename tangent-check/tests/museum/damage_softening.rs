//! UMAT-ABAQUS_library, pull request 5 (10 June 2026), its bug C1: damage without its softening term.
//!
//! Our law: S = r(W) S₀, r = 1/[1 + exp(β (W − W½))]. W, S₀ and ℂ₀ are those of a neo-Hookean solid. While W grows,
//!
//! ∂S/∂E = r ℂ₀ + r' S₀ ⊗ S₀, r' = −β r (1 − r).
//!
//! In unloading, r is that of the greatest W so far. Before: ∂S/∂E = r ℂ₀ always. State: the greatest W, 1 − r.

use crate::algebra::{RightCauchyGreen, Story, Version, matrix, vector};
use crate::check::{all, assert_diagnosed, assert_law_wrong};
use crate::neo_hooke;
use tangent_check::convention::Measure;
use tangent_check::law::{Response, Step};
use tangent_check::tensor::scaled;

const SHARPNESS: f64 = 1.5;
const HALF_ENERGY: f64 = 1.0;

pub const STORY: Story = Story {
    law: "Sigmoid damage",
    measure: Measure::SecondPiolaByGreen,
    rest: || vec![0.0, 1.0 - reduction(0.0)],
    respond,
};

fn respond(version: Version, step: &Step) -> Response {
    let [greatest, damage] = [step.state[0], step.state[1]];
    let at = RightCauchyGreen::new(&step.gradient);
    let energy = neo_hooke::energy(&at);
    let grows = energy >= greatest;
    let r = if grows { reduction(energy) } else { 1.0 - damage };
    let softening = if grows && version == Version::After { -SHARPNESS * r * (1.0 - r) } else { 0.0 };
    let elastic = neo_hooke::second_piola(&at);
    let tangent = matrix(|i, j, k, l| {
        r * neo_hooke::green_modulus(&at, [i, j, k, l]) + softening * elastic[i][j] * elastic[k][l]
    });
    Response { stress: vector(&scaled(r, &elastic)), tangent, state: vec![energy.max(greatest), 1.0 - r] }
}

/// r(W).
fn reduction(energy: f64) -> f64 {
    1.0 / (1.0 + (SHARPNESS * (energy - HALF_ENERGY)).exp())
}

#[test]
fn before_the_tangent_does_not_soften() {
    let (report, finding) = assert_law_wrong(&STORY, &[(0, 0)], &all(6, 6));
    assert!((0.015..0.016).contains(&finding.deviation), "{}", finding.deviation);
    assert_diagnosed(&report, "the elastic one in place of the algorithmic one");
}
