//! Whether the stress of a law turns with the body, σ(Q F) = Q σ(F) Qᵀ, and which use of the rotation increment ΔR (DROT) would mend it.
//!
//! A tensor at the start of the step is to be turned by ΔR once. A law that leaves ΔR out, turns twice or turns back is objective again if
//! the tensor that it gets has been turned by ΔR, ΔR⁻¹ or ΔR².

use super::{PROBED, Visit};
use crate::convention::{Components, Tensor, cauchy_stress};
use crate::law::{Law, Step};
use crate::tensor::{norm, product, product3, rotation_about, sum, transposed};
use std::ops::Range;

/// A stress that errs by more than this of its size after a rotation does not turn with the body.
const OBJECTIVE: f64 = 1e-6;

/// A tensor at the start of the step.
enum Place {
    Stress,
    /// Internal variables, with this factor of shears.
    State(Range<usize>, f64),
}

/// The turns by ΔR that a tensor lacks, and the mistake of the law.
const TURNS: [(i32, &str); 3] = [
    (1, "The law does not turn {} by DROT."),
    (-1, "The law turns {} by DROT once too often; Abaqus has turned STRESS and STRAN already."),
    (2, "The law turns {} back: its DROT is transposed."),
];

/// A note about a law that is not objective. The check along a frozen rotation cannot see it.
pub(super) fn note(law: &mut dyn Law, visits: &[Visit]) -> Option<String> {
    let steps: Vec<&Step> =
        visits.iter().step_by(visits.len().div_ceil(PROBED).max(1)).map(|visit| &visit.step).collect();
    let greatest = steps.iter().filter_map(|step| error(law, step, &Clone::clone)).fold(0.0, f64::max);
    if greatest <= OBJECTIVE {
        return None;
    }
    let mistake = mistake(law, &steps).unwrap_or_else(|| "Its axes should turn with the body.".to_string());
    Some(format!(
        "The stress does not turn with the body: after a rotation it errs by up to {greatest:.0e} of its size. The law is not objective, and its \
         tangent can hold only without rotation. {mistake}"
    ))
}

/// The error of the stress after a rotation of the body, over its size. The law is given what `input` makes of a step.
fn error(law: &mut dyn Law, step: &Step, input: &dyn Fn(&Step) -> Step) -> Option<f64> {
    let convention = law.convention();
    let rotation = rotation_about(if convention.plane() { [0.0, 0.0, 0.4] } else { [0.3, -0.5, 0.4] });
    let mut turned = step.clone();
    if !turned.turn_to(&product(&rotation, &step.gradient)) {
        return None;
    }
    let mut stress = |step: &Step| cauchy_stress(&convention, &law.stress(&input(step)).ok()?, &step.gradient).ok();
    let [stress, other] = [stress(step)?, stress(&turned)?];
    let expected = product3(&rotation, &stress, &transposed(&rotation));
    Some(norm(&sum(&other, -1.0, &expected)) / norm(&stress).max(f64::MIN_POSITIVE))
}

/// The mistake without which the law would be objective.
fn mistake(law: &mut dyn Law, steps: &[&Step]) -> Option<String> {
    let convention = law.convention();
    if !convention.measure.spatial() {
        return None;
    }
    let size = convention.stress.count();
    let starts = 0..(law.state_at_rest().len() + 1).saturating_sub(size);
    let states = starts.flat_map(|start| [1.0, 2.0].map(|shear| Place::State(start..start + size, shear)));
    for place in std::iter::once(Place::Stress).chain(states) {
        for (turns, sentence) in TURNS {
            let input = |step: &Step| given(step, &place, &convention.stress, turns);
            if steps.iter().all(|step| error(law, step, &input).is_some_and(|error| error <= OBJECTIVE)) {
                let tensor = match &place {
                    Place::Stress => "STRESS".to_string(),
                    Place::State(range, _) => format!("STATEV({}) to STATEV({})", range.start + 1, range.end),
                };
                return Some(sentence.replace("{}", &tensor));
            }
        }
    }
    None
}

/// The step with one tensor turned by ΔRⁿ.
fn given(step: &Step, place: &Place, stress: &Components, turns: i32) -> Step {
    let mut step = step.clone();
    let once = if turns < 0 { transposed(&step.rotation) } else { step.rotation };
    let rotation: Tensor = (1..turns.abs()).fold(once, |rotation, _| product(&rotation, &once));
    let (vector, shear) = match place {
        Place::Stress => (&mut step.stress[..], stress.shear),
        Place::State(range, shear) => (&mut step.state[range.clone()], *shear),
    };
    let components = Components { shear, ..stress.clone() };
    let turned = product3(&rotation, &components.symmetric_tensor(vector), &transposed(&rotation));
    vector.copy_from_slice(&components.vector(&turned));
    step
}
