//! Simcoon 2.2, its law EPKCP (tried on 26 November 2026): kinematic hardening that the tangent forgets.
//!
//! Our law: J2 plasticity with linear kinematic hardening K and no other. With ξ = dev σ − β, n = ξ/‖ξ‖ of the trial state and
//! Δγ = (‖ξ‖ − √⅔ σ₀)/(2G + ⅔ K),
//!
//! ∂σ/∂ε = κ I ⊗ I + 2 G θ I_dev − 2 G θ̄ n ⊗ n, θ = 1 − 2 G Δγ/‖ξ‖, θ̄ = 1/(1 + K/3G) − (1 − θ).
//!
//! Before: θ̄ = θ, as without hardening. State: β, which turns with the body.

use crate::algebra::{Story, Told, Version, delta, matrix, square, symmetric_tensor, vector};
use crate::check::report;
use tangent_check::convention::Measure;
use tangent_check::finding::Verdict;
use tangent_check::law::{Response, Step};
use tangent_check::tensor::{IDENTITY, norm, product3, scaled, sum, trace, transposed};

const BULK: f64 = 160.0;
const SHEAR: f64 = 80.0;
const STRENGTH: f64 = 1.0;
const KINEMATIC: f64 = 5.0;

pub const STORY: Story =
    Story { law: "Kinematic hardening", measure: Measure::CauchyByStrain, rest: || vec![0.0; 6], respond };

fn respond(version: Version, step: &Step) -> Response {
    let turn = |v: &[f64]| product3(&step.rotation, &symmetric_tensor(v), &transposed(&step.rotation));
    let (old, back) = (turn(&step.stress), turn(&step.state));
    let growth = trace(&step.strain_increment);
    let elastic =
        sum(&scaled(BULK * growth, &IDENTITY), 2.0 * SHEAR, &sum(&step.strain_increment, -growth / 3.0, &IDENTITY));
    let trial = sum(&old, 1.0, &elastic);
    let xi = sum(&sum(&trial, -trace(&trial) / 3.0, &IDENTITY), -1.0, &back);
    let (size, radius) = (norm(&xi), (2.0_f64 / 3.0).sqrt() * STRENGTH);
    let (gamma, n) = match size > radius {
        true => ((size - radius) / (2.0 * SHEAR + 2.0 / 3.0 * KINEMATIC), scaled(1.0 / size, &xi)),
        false => (0.0, scaled(0.0, &xi)),
    };
    let theta = if gamma > 0.0 { 1.0 - 2.0 * SHEAR * gamma / size } else { 1.0 };
    let hardening = if version == Version::After { KINEMATIC / (3.0 * SHEAR) } else { 0.0 };
    let theta_bar = 1.0 / (1.0 + hardening) - (1.0 - theta);
    let tangent = matrix(|i, j, k, l| {
        let deviatoric = square(&IDENTITY, [i, j, k, l]) - delta(i, j) * delta(k, l) / 3.0;
        BULK * delta(i, j) * delta(k, l) + 2.0 * SHEAR * (theta * deviatoric - theta_bar * n[i][j] * n[k][l])
    });
    let stress = vector(&sum(&trial, -2.0 * SHEAR * gamma, &n));
    Response { stress, tangent, state: vector(&sum(&back, 2.0 / 3.0 * KINEMATIC * gamma, &n)) }
}

#[test]
fn before_the_tangent_forgets_the_hardening() {
    let report = report(&mut Told(&STORY, Version::Before));
    assert_eq!(report.verdict(), Verdict::Wrong);
    // About yielding, columns at a kink deviate for another reason.
    let away = report.findings.iter().filter(|finding| finding.name.starts_with("path"));
    let wrong = away.filter(|finding| finding.verdict == Verdict::Wrong);
    let worst = wrong.map(|finding| finding.deviation).fold(0.0, f64::max);
    assert!((0.005..0.02).contains(&worst), "{worst}");
    assert!(report.diagnoses.is_empty(), "{:?}", report.diagnoses);
}
