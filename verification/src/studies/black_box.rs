//! The shipped laws as black boxes, checked by the crate `tangent-check` like anybody's law: by differences, along paths, in three
//! conventions.

use super::{Effort, Outcome, StudyError, short};
use crate::report::{Bound, Report};
use bfree::material::{Lame, Law as _, Material, MaterialState, first_piola};
use bfree::tensor::Tensor;
use tangent_check::convention::{
    Components, Configuration, Convention, Measure, cauchy_stress, convert, stress_vector,
};
use tangent_check::finding::{Finding, Verdict};
use tangent_check::law::{self, CallFailed, Response, Step};
use tangent_check::matrix::Matrix;
use tangent_check::roads::check_law;
use tangent_check::states::for_law;

/// The summary in the list of studies.
pub(super) const ABOUT: &str =
    "the shipped laws as black boxes: no false alarm of the checker that everybody uses, in three conventions";

/// The seed of the paths.
const SEED: u64 = 1;

/// The least planted error that must be seen in every state, relative to the spoiled entry: the issue of the crate asks for 1e-9 in smooth
/// states, 1e-7 in yielding ones and 1e-6 at kinks.
const SEEN: f64 = 1e-6;

/// A shipped law that answers in a convention.
struct BlackBox {
    law: Material,
    convention: Convention,
}

impl BlackBox {
    /// P and ∂P/∂F, row by row.
    fn piola(&self, at: &MaterialState<f64, 3>) -> (Vec<f64>, Matrix) {
        let f: Tensor<f64, 3> = at.f;
        let stress = self.law.stress(at);
        let piola = first_piola(&self.law, &f, at);
        let mut tangent = Matrix::zeros(9, 9);
        for (column, (k, l)) in (0..9).map(|index| (index / 3, index % 3)).enumerate() {
            let mut delta = Tensor::zeros();
            delta[(k, l)] = 1.0;
            let changed = delta * stress + f * self.law.elasticity(at, &(f.transpose() * delta));
            (0..9).for_each(|row| tangent[(row, column)] = changed[(row / 3, row % 3)]);
        }
        ((0..9).map(|row| piola[(row / 3, row % 3)]).collect(), tangent)
    }
}

impl law::Law for BlackBox {
    fn name(&self) -> String {
        format!("{:?}", self.law)
    }

    fn convention(&self) -> Convention {
        self.convention.clone()
    }

    fn state_at_rest(&self) -> Vec<f64> {
        self.law.internal_variables().iter().map(|one| one.at_rest).collect()
    }

    fn respond(&mut self, step: &Step) -> Result<Response, CallFailed> {
        let h = Tensor::<f64, 3>::from_fn(|i, k| step.gradient[i][k] - f64::from(i == k));
        let at = MaterialState::new(h).in_step(step.length, &step.state);
        let at = at.admissible().map_err(|error| CallFailed(error.to_string()))?;
        let (stress, tangent) = self.piola(&at);
        let failed = |error: tangent_check::convention::ConversionFailed| CallFailed(error.0);
        let from = Convention::piola_in_rows();
        let cauchy = cauchy_stress(&from, &stress, &step.gradient).map_err(failed)?;
        let place = Configuration { gradient_before: step.gradient_before, gradient: step.gradient, stress: cauchy };
        let mut state = step.state.clone();
        self.law.update_variables(&at, &mut state);
        Ok(Response {
            state,
            stress: stress_vector(&self.convention, &cauchy, &step.gradient).map_err(failed)?,
            tangent: convert(&tangent, &from, &self.convention, &place).map_err(failed)?,
        })
    }
}

pub(super) fn run(_effort: &Effort) -> Result<Outcome, StudyError> {
    let conventions = [
        ("P by F", Convention::piola_in_rows()),
        (
            "S by E",
            Convention {
                measure: Measure::SecondPiolaByGreen,
                stress: Components::voigt(1.0),
                strain: Components::voigt(2.0),
            },
        ),
        ("Abaqus", Convention::abaqus(Measure::JaumannKirchhoff)),
    ];
    let title = "laws that are right: states not found consistent, and the least error that is seen in every state";
    let mut report = Report::new(title, &["law", "convention", "quantity"]);
    for (name, law) in Material::examples(Lame::from_young_poisson(1000.0, 0.3)?) {
        for (convention, meaning) in &conventions {
            let mut law = BlackBox { law: law.clone(), convention: meaning.clone() };
            let refused = |CallFailed(sentence)| sentence;
            let paths = for_law(&mut law, SEED).map_err(refused)?;
            judge(&short(name), convention, &check_law(&mut law, &paths, SEED).findings, &mut report);
        }
    }
    Ok(Outcome { reports: vec![report], ..Outcome::default() })
}

fn judge(law: &str, convention: &str, findings: &[Finding], report: &mut Report) {
    let count = |wanted: &dyn Fn(&Finding) -> bool| findings.iter().filter(|finding| wanted(finding)).count() as f64;
    let wrong = count(&|finding| matches!(finding.verdict, Verdict::Wrong | Verdict::Inexact));
    let not_checked = count(&|finding| finding.unexplained());
    report.push(&[law, convention, "states"], findings.len() as f64, Bound::AtLeast(40.0));
    report.push(&[law, convention, "false alarms"], wrong, Bound::AtMost(0.0));
    report.push(&[law, convention, "not checked, and no kink"], not_checked, Bound::AtMost(0.0));
    report.push(
        &[law, convention, "not checked at a kink"],
        count(&|finding| finding.verdict == Verdict::NotChecked),
        Bound::Reported,
    );
    let seen = findings.iter().filter_map(|finding| finding.control).fold(0.0, f64::max);
    report.push(&[law, convention, "least error seen in every state"], seen, Bound::AtMost(SEEN));
    let calls = findings.iter().map(|finding| finding.calls).max().unwrap_or(0);
    report.push(&[law, convention, "calls in a state, at most"], calls as f64, Bound::AtMost(300.0));
}
