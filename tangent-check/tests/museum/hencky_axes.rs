//! bfree's own best mutant: "laws: Δ for Δ coth Δ in the moduli" (`src/material/hencky.rs`).
//!
//! Our law: Hencky's solid, τ = Λ ln J I + 2G ln V. In the axes of V, a stretching L changes ln V by Δ coth Δ Lᵢⱼ with Δ = ln λᵢ − ln λⱼ,
//! because δb = L b + b L. The Jaumann rate of τ over J is therefore
//!
//! ℂ : L = [Λ tr L I + 2G Σᵢⱼ (Δ coth Δ) Lᵢⱼ nᵢ ⊗ nⱼ] / J.
//!
//! Before: 1 for Δ coth Δ, the secant (τᵢ − τⱼ)/(2GΔ). ℂ is then Hooke's tensor over J. The mistake is of second order in Δ.

use crate::algebra::{Story, Version, delta, matrix, vector};
use crate::check::{all, assert_law_wrong, assert_not_named};
use tangent_check::convention::Measure;
use tangent_check::law::{Response, Step};
use tangent_check::tensor::{IDENTITY, determinant, eigenvalues, from_entries, product, transposed};

const LAMBDA: f64 = 1.5;
const SHEAR: f64 = 1.0;

pub const STORY: Story = Story { law: "Hencky's solid", measure: Measure::JaumannKirchhoff, rest: Vec::new, respond };

fn respond(version: Version, step: &Step) -> Response {
    let jacobian = determinant(&step.gradient);
    let (squares, axes) = eigenvalues(&product(&step.gradient, &transposed(&step.gradient)));
    let strains = squares.map(|square| 0.5 * square.ln());
    let pressure = LAMBDA * jacobian.ln();
    let stress = from_entries(|i, j| {
        let logarithm: f64 = (0..3).map(|a| strains[a] * axes[i][a] * axes[j][a]).sum();
        (pressure * IDENTITY[i][j] + 2.0 * SHEAR * logarithm) / jacobian
    });
    let factor = |a: usize, b: usize| match version {
        Version::Before => 1.0,
        Version::After => delta_coth(strains[a] - strains[b]),
    };
    let tangent = matrix(|i, j, k, l| {
        let mut shear = 0.0;
        for a in 0..3 {
            for b in 0..3 {
                let dyad = from_entries(|m, n| axes[m][a] * axes[n][b]);
                shear += factor(a, b) * dyad[i][j] * 0.5 * (dyad[k][l] + dyad[l][k]);
            }
        }
        (LAMBDA * delta(i, j) * delta(k, l) + 2.0 * SHEAR * shear) / jacobian
    });
    Response { stress: vector(&stress), tangent, state: Vec::new() }
}

/// Δ coth Δ, by its series near 0.
fn delta_coth(delta: f64) -> f64 {
    if delta.abs() < 1e-3 { 1.0 + delta * delta / 3.0 - delta.powi(4) / 45.0 } else { delta / delta.tanh() }
}

#[test]
fn before_shears_between_the_axes_are_too_soft() {
    let (report, finding) = assert_law_wrong(&STORY, &[(4, 4)], &all(6, 6));
    assert!((0.021..0.022).contains(&finding.deviation), "{}", finding.deviation);
    assert_not_named(&report);
}
