//! A thermal strain in the stress and not in the tangent, or the reverse. TEMP rests in a check, and so does the thermal strain.
//!
//! Our law: rubber-like volume, σ = K (v + ½ c v²) I + 2G dev ε with v = tr (ε − α ΔT I), and ∂σ/∂ε = K (1 + c v) I ⊗ I + 2G dev. Before:
//! v = tr ε in one of both.

use crate::algebra::{Story, Told, delta, matrix, square, vector};
use crate::check::{assert_diagnosed, report};
use tangent_check::convention::Measure;
use tangent_check::finding::Verdict;
use tangent_check::law::{Response, Step};
use tangent_check::tensor::{IDENTITY, scaled, sum, trace};

const BULK: f64 = 2.0;
const SHEAR: f64 = 1.0;
const STIFFENING: f64 = 0.8;
/// tr α ΔT I.
const EXPANSION: f64 = 0.06;

/// Its versions are the thermal expansions in the stress, and in the tangent.
const STORY: Story<[f64; 2]> =
    Story { law: "Thermal expansion", measure: Measure::CauchyByStrain, rest: Vec::new, respond };

fn respond(expansions: [f64; 2], step: &Step) -> Response {
    let strain = sum(&step.strain, 1.0, &step.strain_increment);
    let [volume, tangent] = expansions.map(|expansion| trace(&strain) - expansion);
    let pressure = BULK * (volume + 0.5 * STIFFENING * volume * volume);
    let deviator = sum(&strain, -trace(&strain) / 3.0, &IDENTITY);
    let stress = sum(&scaled(2.0 * SHEAR, &deviator), pressure, &IDENTITY);
    let tangent = matrix(|i, j, k, l| {
        let volume = BULK * (1.0 + STIFFENING * tangent) - 2.0 / 3.0 * SHEAR;
        volume * delta(i, j) * delta(k, l) + 2.0 * SHEAR * square(&IDENTITY, [i, j, k, l])
    });
    Response { stress: vector(&stress), tangent, state: Vec::new() }
}

#[test]
fn before_the_thermal_part_is_in_one_of_both() {
    for expansions in [[EXPANSION, 0.0], [0.0, EXPANSION]] {
        let report = report(&mut Told(&STORY, expansions));
        assert_eq!(report.verdict(), Verdict::Wrong);
        assert_diagnosed(&report, "without its thermal part, or with one that the stress lacks");
    }
}

#[test]
fn after_it_is_in_both() {
    report(&mut Told(&STORY, [EXPANSION; 2])).assert_consistent();
}
