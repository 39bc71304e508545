//! The use of DROT: Abaqus turns STRESS and STRAN by it before the call, and a UMAT turns the tensors in STATEV itself.
//!
//! Our law: σ = ΔR σ₀ ΔRᵀ + 2G Δε + Λ tr Δε I − K q, where q = ΔR q₀ ΔRᵀ + Δε is kept in STATEV(2) to STATEV(7), behind the
//! accumulated tr ε. Before, one of both tensors is not turned, turned twice, or turned back. The tangent by Δε with ΔR frozen stays right:
//! only the test of objectivity can see it.

use crate::algebra::{Story, Told, symmetric_tensor, vector};
use crate::check::report;
use tangent_check::convention::{Measure, Tensor};
use tangent_check::law::{Response, Step};
use tangent_check::matrix::Matrix;
use tangent_check::tensor::{IDENTITY, product3, scaled, sum, trace, transposed};

const SHEAR: f64 = 1.0;
const LAMBDA: f64 = 1.5;
const COUPLING: f64 = 0.3;

/// Its versions say how often σ₀ and q₀ are turned by ΔR.
const STORY: Story<[i32; 2]> =
    Story { law: "Turned stress and state", measure: Measure::CauchyByStrain, rest: || vec![0.0; 7], respond };

fn respond([stress_turns, state_turns]: [i32; 2], step: &Step) -> Response {
    let turned = |v: &[f64], times: i32| {
        let once = if times < 0 { transposed(&step.rotation) } else { step.rotation };
        (0..times.abs()).fold(symmetric_tensor(v), |a: Tensor, _| product3(&once, &a, &transposed(&once)))
    };
    let growth = trace(&step.strain_increment);
    let elastic = sum(&scaled(2.0 * SHEAR, &step.strain_increment), LAMBDA * growth, &IDENTITY);
    let inner = sum(&turned(&step.state[1..], state_turns), 1.0, &step.strain_increment);
    let stress = sum(&sum(&turned(&step.stress, stress_turns), 1.0, &elastic), -COUPLING, &inner);
    let tangent = Matrix::from_entries(6, 6, |i, j| {
        let shear = if i < 3 { 2.0 * SHEAR - COUPLING } else { SHEAR - 0.5 * COUPLING };
        (if i == j { shear } else { 0.0 }) + if i < 3 && j < 3 { LAMBDA } else { 0.0 }
    });
    Response { stress: vector(&stress), tangent, state: [vec![step.state[0] + growth], vector(&inner)].concat() }
}

#[test]
fn before_the_use_of_drot_is_named() {
    for (turns, words) in [
        ([0, 1], "does not turn STRESS by DROT"),
        ([2, 1], "turns STRESS by DROT once too often"),
        ([-1, 1], "turns STRESS back: its DROT is transposed"),
        ([1, 0], "does not turn STATEV(2) to STATEV(7) by DROT"),
        ([1, 2], "turns STATEV(2) to STATEV(7) by DROT once too often"),
        ([1, -1], "turns STATEV(2) to STATEV(7) back: its DROT is transposed"),
    ] {
        let report = report(&mut Told(&STORY, turns));
        assert!(report.notes.iter().any(|note| note.contains(words)), "{words}: {:?}", report.notes);
    }
}

#[test]
fn after_both_tensors_turn_once() {
    let report = report(&mut Told(&STORY, [1, 1]));
    report.assert_consistent();
    assert!(!report.notes.iter().any(|note| note.contains("not objective")), "{:?}", report.notes);
}
