//! UMAT-ABAQUS_library, pull request 5 (10 June 2026), its bug B1: the dispersion of fibres is lost.
//!
//! Our law: Gasser, Ogden and Holzapfel's fibre of direction a in a neo-Hookean solid, A = a ⊗ a, H = κ I + (1 − 3κ) A:
//! W = k₁/(2k₂) [exp(k₂ E²) − 1] with E = H : C − 1 > 0. With g = k₁ E exp(k₂ E²) and h = dg/dE,
//!
//! S = S₀ + 2 g H, ∂S/∂E = ℂ₀ + 4 h H ⊗ H.
//!
//! Before: S = S₀ + 2 g (1 − 3κ) A and ℂ₀ + 4 h [(1 − 3κ)² A ⊗ A + κ (1 − 3κ) (I ⊗ A + A ⊗ I)]: all derivatives by I₁ alone are lost.
//! The mixed term I ⊗ A stays without its stress. The library splits off the volume (C̄); our law does not, as the mistake is the same.

use crate::algebra::{RightCauchyGreen, Story, Version, delta, double_dot, matrix, tension, vector};
use crate::check::{assert_law_wrong, assert_not_named};
use crate::neo_hooke;
use tangent_check::convention::Measure;
use tangent_check::law::{Response, Step};
use tangent_check::tensor::from_entries;

const STIFFNESS: f64 = 2.0;
const EXPONENT: f64 = 0.4;
/// κ: 0 for parallel fibres, 1/3 for fibres in all directions.
const DISPERSION: f64 = 0.15;
/// a, a unit vector.
pub const DIRECTION: [f64; 3] = [0.8, 0.6, 0.0];

fn along(i: usize, j: usize) -> f64 {
    (1.0 - 3.0 * DISPERSION) * DIRECTION[i] * DIRECTION[j]
}

/// H.
fn structure(i: usize, j: usize) -> f64 {
    DISPERSION * delta(i, j) + along(i, j)
}

pub const STORY: Story =
    Story { law: "Dispersed fibres", measure: Measure::SecondPiolaByGreen, rest: Vec::new, respond };

fn respond(version: Version, step: &Step) -> Response {
    let at = RightCauchyGreen::new(&step.gradient);
    let ground = neo_hooke::second_piola(&at);
    let (g, h) = tension(STIFFNESS, EXPONENT, double_dot(&from_entries(structure), &at.c) - 1.0);
    let before = version == Version::Before;
    let stress = from_entries(|i, j| ground[i][j] + 2.0 * g * if before { along(i, j) } else { structure(i, j) });
    let tangent = matrix(|i, j, k, l| {
        // The term of I₁ alone was built before the fibres were known.
        let lost = if before { DISPERSION * DISPERSION * delta(i, j) * delta(k, l) } else { 0.0 };
        neo_hooke::green_modulus(&at, [i, j, k, l]) + 4.0 * h * (structure(i, j) * structure(k, l) - lost)
    });
    Response { stress: vector(&stress), tangent, state: Vec::new() }
}

#[test]
fn before_the_term_identity_by_fibre_has_no_stress() {
    // I ⊗ A with a in the plane 1, 2
    let entries = [0, 1, 2].into_iter().flat_map(|row| [0, 1, 3].map(|column| (row, column))).collect();
    let (report, finding) = assert_law_wrong(&STORY, &[(0, 0), (1, 0), (2, 0)], &entries);
    assert!((0.08..0.09).contains(&finding.deviation), "{}", finding.deviation);
    assert_not_named(&report);
}
