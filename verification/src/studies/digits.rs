//! The digits of the laws at tiny strains: the code uses H = F − I so that no digits are lost.
//!
//! At strains of 1e-12 a law is linear to 12 digits: S = ℂ:E and W = ½ E:ℂ:E with ℂ at rest. Computed from F or J, S would have 4 correct
//! digits and W none. The checks of derivatives see only part of such a loss: if W and S lose the same digits, they still agree.

use super::{Effort, Outcome, StudyError, short, worse};
use crate::random::Random;
use crate::report::{Bound, Report};
use bfree::material::{Lame, Law, Material, MaterialState};
use bfree::tensor::{Tensor, contract, symmetric};

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "the laws keep their digits at strains of 1e-12";

/// Size of the strain.
const STRAIN: f64 = 1e-12;

/// The neglected terms are of the next order; the factor allows for their coefficients.
const LINEAR: f64 = 100.0 * STRAIN;

pub(super) fn run(_effort: &Effort) -> Result<Outcome, StudyError> {
    let mut report = Report::new("strains of 1e-12 against the linear law", &["quantity", "law", "D"]);
    for (name, law) in &Material::examples(Lame::from_young_poisson(1000.0, 0.3)?) {
        // Fibres have different stiffness in tension and compression, and are linear in each.
        if matches!(law, Material::FibreReinforced(_)) {
            continue;
        }
        let name = &short(name);
        linear::<1>(name, law, &mut report);
        linear::<2>(name, law, &mut report);
        linear::<3>(name, law, &mut report);
    }
    Ok(Outcome { reports: vec![report], ..Outcome::default() })
}

fn linear<const D: usize>(name: &str, law: &Material, report: &mut Report) {
    let mut random = Random::new(37);
    let at_rest = MaterialState::new(Tensor::<f64, D>::zeros());
    let (mut stress, mut energy): (f64, f64) = (0.0, 0.0);
    for _ in 0..20 {
        let at = MaterialState::new(random.tensor::<D>() * STRAIN);
        let strain = symmetric(&at.h);
        let expected = law.elasticity(&at_rest, &strain);
        let work = 0.5 * contract(&expected, &strain);
        stress = worse(stress, (law.stress(&at) - expected).norm() / expected.norm());
        energy = worse(energy, (law.energy(&at) - work).abs() / work);
    }
    let dimension = D.to_string();
    report.push(&["S = C:E", name, &dimension], stress, Bound::AtMost(LINEAR));
    report.push(&["W = E:C:E / 2", name, &dimension], energy, Bound::AtMost(LINEAR));
}
