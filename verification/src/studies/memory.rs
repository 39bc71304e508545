//! Laws with internal variables at a point: derivatives must hold in each regime of the return maps, as in elastic regimes.
//!
//! Tangents are compared with dual numbers through the local solve. The internal variables at the end of a step must reproduce its stress
//! when no further time passes.

use super::{Effort, Outcome, StudyError, worse};
use crate::random::Random;
use crate::report::{Bound, Report};
use bfree::material::{DISSIPATED, Lame, Law, Material, MaterialState, PLASTIC_STRAIN, internal_variable};
use bfree::tensor::{Tensor, contract, identity, inverse};
use num_dual::{Dual2_64, Dual64};

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "return maps and relaxation: tangents, potentials and memory in every regime";

/// The bound for every derivative, equal to the largest bound of `--check-tangent`.
const EXACT: f64 = 1e-10;

/// States tried in each regime.
const TRIES: u32 = 20;

/// The laws with plastic flow in the steps of a regime.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Flows {
    /// Plastic laws flow in every step.
    Always,
    /// Plastic laws flow in every step, except those that pressure strengthens.
    Metals,
    /// No law flows.
    Never,
    /// Some laws flow in some steps.
    Sometimes,
}

/// The path of a step: its history, its Δt, and its final deformation.
struct Regime {
    name: &'static str,
    /// Whether the step before caused plastic flow.
    flowed: bool,
    dt: f64,
    /// The deformation of the step: a factor on all stretches, additions to the first and the third, and a random part.
    stretch: f64,
    first: f64,
    third: f64,
    size: f64,
    flows: Flows,
}

const fn regime(name: &'static str, flowed: bool, [stretch, first, size]: [f64; 3], flows: Flows) -> Regime {
    Regime { name, flowed, dt: 1.0, stretch, first, third: 0.0, size, flows }
}

const REGIMES: &[Regime] = &[
    regime("elastic", false, [1.0, 0.0, 1e-3], Flows::Never),
    regime("yielding", false, [0.9, 0.4, 0.02], Flows::Always),
    regime("at yield", true, [1.0, 0.0, 1e-6], Flows::Sometimes),
    regime("reversal", true, [1.15, -0.4, 0.02], Flows::Metals),
    regime("apex", false, [1.2, 0.0, 0.02], Flows::Sometimes),
    Regime { third: 0.3, ..regime("double stretches", false, [0.9, 1e-9, 0.0], Flows::Sometimes) },
    Regime { third: 0.3, ..regime("double, flowed", true, [0.9, 1e-5, 0.0], Flows::Sometimes) },
    regime("triple stretches", false, [0.9, 0.0, 1e-10], Flows::Sometimes),
    regime("triple, flowed", true, [0.9, 0.0, 1e-10], Flows::Sometimes),
    Regime { dt: 1e-3, ..regime("dt=1e-3", true, [0.9, 0.3, 0.02], Flows::Sometimes) },
    Regime { dt: 1e3, ..regime("dt=1e3", true, [0.9, 0.3, 0.02], Flows::Sometimes) },
];

pub(super) fn run(_effort: &Effort) -> Result<Outcome, StudyError> {
    let title = "laws with memory: worst relative error of a regime";
    let mut report = Report::new(title, &["quantity", "law", "D", "regime"]);
    for (name, law) in Material::examples(Lame::from_young_poisson(1000.0, 0.3)?) {
        if !law.internal_variables().is_empty() {
            dimension::<1>(name, &law, &mut report)?;
            dimension::<2>(name, &law, &mut report)?;
            dimension::<3>(name, &law, &mut report)?;
        }
    }
    Ok(Outcome { reports: vec![report], ..Outcome::default() })
}

/// F of a regime: its stretches, and a small random part.
fn end<const D: usize>(regime: &Regime, random: &mut Random) -> Tensor<f64, D> {
    let longer = [regime.first, 0.0, regime.third];
    let stretch = |i: usize| regime.stretch * (1.0 + longer[i]);
    let stretches = Tensor::from_fn(|i, k| if i == k { stretch(i) } else { 0.0 });
    (identity::<f64, D>() + random.tensor() * regime.size) * stretches
}

fn dimension<const D: usize>(name: &str, law: &Material, report: &mut Report) -> Result<(), StudyError> {
    let rest: Vec<f64> = law.internal_variables().iter().map(|one| one.at_rest).collect();
    let plastic = law.internal_variables().iter().any(|one| one.name == PLASTIC_STRAIN);
    for regime in REGIMES {
        let mut random = Random::new(17);
        let (mut internal, mut f_0) = (rest.clone(), identity::<f64, D>());
        if regime.flowed {
            f_0 = end(&regime_of_flow(), &mut random);
            law.update_variables(&MaterialState::new(f_0 - identity()).in_step(1.0, &rest), &mut internal);
        }
        let mut worst = [0.0; QUANTITIES.len()];
        let mut flowed = 0;
        for _ in 0..TRIES {
            let f = end(regime, &mut random) * f_0;
            let at = MaterialState::new(f - identity()).in_step(regime.dt, &internal).admissible()?;
            let (errors, flows) = errors(law, &at, &mut random);
            flowed += u32::from(flows);
            worst.iter_mut().zip(errors).for_each(|(worst, error)| *worst = worse(*worst, error));
        }
        let dimension = D.to_string();
        for ((quantity, bound), worst) in QUANTITIES.iter().zip(worst) {
            report.push(&[quantity, name, &dimension, regime.name], worst, Bound::AtMost(*bound));
        }
        let bound = match regime.flows {
            Flows::Always => Some(Bound::AtLeast(1.0)),
            Flows::Metals => law.is_symmetric().then_some(Bound::AtLeast(1.0)),
            Flows::Never => Some(Bound::AtMost(0.0)),
            Flows::Sometimes => None,
        };
        if let Some(bound) = bound.filter(|_| plastic) {
            let share = f64::from(flowed) / f64::from(TRIES);
            report.push(&["share of steps that flow", name, &dimension, regime.name], share, bound);
        }
    }
    Ok(())
}

/// The step before the regimes that have one.
fn regime_of_flow() -> Regime {
    regime("before", false, [0.95, 0.3, 0.1], Flows::Always)
}

/// The measured quantities with their bounds.
const QUANTITIES: [(&str, f64); 7] = [
    ("C:X against dual(S)", EXACT),
    ("blocks against C:X", EXACT),
    ("S against dual(W)", EXACT),
    // If eigenvalues agree to 1e-5, a second divided difference has 11 digits.
    ("dual2(W) against dual(P)", 1e-9),
    ("S of the new memory", EXACT),
    ("energy gained by flow", 1e-14),
    ("symmetry of the tangent", EXACT),
];

/// Errors of all [`QUANTITIES`], 0 for those that the law lacks, and whether the step had plastic flow.
fn errors<const D: usize>(
    law: &Material,
    at: &MaterialState<f64, D>,
    random: &mut Random,
) -> ([f64; QUANTITIES.len()], bool) {
    let (f, delta_f) = (at.f, random.tensor::<D>());
    let delta_f = delta_f * f;
    let (stress, dual) = (law.stress(at), at.deformed(at.h.zip_map(&delta_f, Dual64::new)));
    let dual_stress = law.stress(&dual);
    let piola = (dual.f * dual_stress).map(|x| x.eps);
    let dual_stress = dual_stress.map(|x| x.eps);
    let strain = f.transpose() * delta_f;
    let elasticity = law.elasticity(at, &strain);
    let stiffness = law.elasticity(at, &(f.transpose() * f)).norm();

    let f_n = inverse(&(identity::<f64, D>() + random.tensor() * (0.3 / D as f64))) * f;
    let blocks = law.tangent_blocks(&f_n, at);
    let mut block: f64 = 0.0;
    for k in 0..D {
        for l in 0..D {
            let unit = |k: usize| f_n.row(k).transpose();
            let expected = f * law.tangent_density(at, &unit(k), &unit(l)) * f.transpose();
            block = worse(block, (blocks[k][l] - expected).norm() / stiffness);
        }
    }

    let work = (f * stress).norm() * delta_f.norm() + piola.norm() * delta_f.norm();
    let (mut potential, mut curvature, mut asymmetry) = (0.0, 0.0, 0.0);
    if law.has_potential() {
        potential = (law.energy(&dual).eps - contract(&(f * stress), &delta_f)).abs() / work;
        let second = at.deformed(at.h.zip_map(&delta_f, |h, d| Dual2_64::new(h, d, 0.0)));
        curvature = (law.energy(&second).v2 - contract(&piola, &delta_f)).abs() / work;
    }
    if law.is_symmetric() {
        let other = f.transpose() * random.tensor::<D>() * f;
        let (one, two) = (contract(&elasticity, &other), contract(&law.elasticity(at, &other), &strain));
        asymmetry = (one - two).abs() / (elasticity.norm() * other.norm());
    }

    let mut next = at.internal.to_vec();
    law.update_variables(at, &mut next);
    let after = at.in_step(0.0, &next);
    let kept = (law.stress(&after) - stress).norm() / (stress.norm() + 1e-3 * stiffness);
    let lost = |at: &MaterialState<f64, D>| internal_variable(law, at, DISSIPATED).unwrap_or(0.0);
    let gained = (lost(at) - lost(&after)).max(0.0) / stiffness;
    let strain = |at: &MaterialState<f64, D>| internal_variable(law, at, PLASTIC_STRAIN).unwrap_or(0.0);
    let flows = strain(&after) > strain(at);
    let tangent = (elasticity - dual_stress).norm() / dual_stress.norm();
    ([tangent, block, potential, curvature, kept, gained, asymmetry], flows)
}
