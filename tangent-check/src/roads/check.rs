//! The check of a law along paths.

use super::cause::Causes;
use super::observations::{SIDES, observations};
use super::ranges;
use super::{History, Input, Perturbed, Road, Visit, inputs_read, roads};
use crate::convention::{Convention, Measure, cauchy_stress};
use crate::diagnosis::{diagnose, invisible, nearest};
use crate::finding::{Finding, Reason, Report, Verdict};
use crate::judge::{Loading, check_along};
use crate::law::{CallFailed, Law, Response};
use crate::matrix::Matrix;
use crate::states::Path;
use crate::tensor::{norm, product, product3, rotation_about, sum, transposed};
use std::cell::RefCell;

/// The response with column k perturbed by h.
pub type Perturbation<'a> = dyn FnMut(usize, f64) -> Result<Vec<f64>, CallFailed> + 'a;

/// A check of a claimed tangent at a response: `judge::check_columns`, or another of the same signature.
pub type CheckColumns<'a> = dyn FnMut(&str, &Matrix, &[f64], &mut Perturbation) -> Finding + 'a;

/// From so many steps it is taken which inputs the law reads.
const PROBED: usize = 6;
/// A stress that errs by more than this of its size after a rotation does not turn with the body.
const OBJECTIVE: f64 = 1e-6;

/// The findings of one road, one for each visit.
struct Travelled {
    road: Road,
    findings: Vec<Finding>,
}

impl Travelled {
    fn wrong(&self) -> usize {
        self.findings.iter().filter(|finding| finding.verdict == Verdict::Wrong).count()
    }
}

/// Checks the tangent of a law at every step of the paths, and diagnoses a wrong one.
///
/// Every step takes stress and internal variables from the response before. A law that reads both F and Δε is checked on both roads;
/// the report has the findings of the road on which fewer states are wrong, and a note about the other.
pub fn check_law(law: &mut dyn Law, paths: &[Path], seed: u64) -> Report {
    // The first state is nearly at rest: its tangent is the stiffness of the law.
    let mut stiffness = None;
    let mut check = |name: &str, claimed: &Matrix, perturbed: &mut Perturbed| {
        let finding = checked(name, claimed, perturbed, stiffness.unwrap_or(0.0));
        let measured = finding.measured.greatest();
        stiffness = stiffness.or(Some(measured).filter(|_| finding.error <= SIDES));
        finding
    };
    report(law, paths, seed, &mut check)
}

/// [`check_law`] with another way to check a tangent column by column.
pub fn check_law_by(law: &mut dyn Law, paths: &[Path], seed: u64, check: &mut CheckColumns) -> Report {
    let mut check = |name: &str, claimed: &Matrix, perturbed: &mut Perturbed| match perturbed.value(0, 0.0) {
        Ok(value) => check(name, claimed, &value, &mut |k, h| perturbed.value(k, h)),
        Err(failed) => not_checked(name, failed),
    };
    report(law, paths, seed, &mut check)
}

/// The check of the tangent of one perturbed step.
type Check<'a> = dyn FnMut(&str, &Matrix, &mut Perturbed) -> Finding + 'a;

/// The check by differences. It also looks along the step for jumps of a loose local iteration.
fn checked(name: &str, claimed: &Matrix, perturbed: &mut Perturbed, stiffness: f64) -> Finding {
    let value = match perturbed.value(0, 0.0) {
        Ok(value) => value,
        Err(failed) => return not_checked(name, failed),
    };
    let shared = RefCell::new(perturbed);
    let size = shared.borrow().size();
    let loading = Loading { size, respond: &mut |part| shared.borrow_mut().part(part), stiffness };
    check_along(name, claimed, &value, &mut |k, h| shared.borrow_mut().value(k, h), Some(loading))
}

fn report(law: &mut dyn Law, paths: &[Path], seed: u64, check: &mut Check) -> Report {
    let convention = law.convention();
    let [stress, strain] = convention.measure.symbols();
    let mut report = Report {
        subject: law.name(),
        convention: convention.words(),
        rows: convention.stress.names_of(stress),
        columns: convention.strain.names_of(strain),
        seed,
        findings: Vec::new(),
        diagnoses: Vec::new(),
        notes: Vec::new(),
    };
    if !convention.stress.valid() || !convention.strain.valid() || convention.strain.count() == 0 {
        let text =
            "The convention of the law has no components, or names one twice or outside of 11 to 33.".to_string();
        report.findings.push(not_checked("convention", CallFailed(text)));
        return report;
    }
    let mut visits = Vec::new();
    for path in paths {
        walk(law, path, &mut visits, &mut report.findings);
    }
    let read = inputs_of(law, &visits);
    if !visits.is_empty() {
        report.notes.push(note_of_inputs(&read));
    }
    report.notes.extend(ranges::notes(&law.state_at_rest(), &visits));
    let travelled: Vec<Travelled> =
        roads(&read, convention.measure).into_iter().map(|road| travel(law, road, &visits, check)).collect();
    report.notes.extend(note_of_objectivity(law, &visits));
    let remembers = remembers(law, &visits);
    report.notes.extend(remembers.then(|| REMEMBERS.to_string()));
    report.notes.extend(note_of_roads(&travelled));
    if let Some(chosen) = travelled.into_iter().min_by_key(Travelled::wrong) {
        if !remembers {
            diagnose_into(law, &visits, &chosen, &mut report);
        }
        if chosen.wrong() > 0 {
            report.notes.extend(note_of_meaning(&read, convention.measure));
        }
        report.findings.extend(chosen.findings);
    }
    report
}

/// A finding without a check, because a call failed.
fn not_checked(name: &str, failed: CallFailed) -> Finding {
    Finding {
        name: name.to_string(),
        verdict: Verdict::NotChecked,
        reason: Some(Reason::CallFailed(format!("{name}: {}", failed.0))),
        worst: None,
        deviation: 0.0,
        error: 0.0,
        noise: 0.0,
        control: None,
        calls: 1,
        claimed: Matrix::zeros(0, 0),
        measured: Matrix::zeros(0, 0),
        errors: Matrix::zeros(0, 0),
    }
}

/// Walks along a path to its end or to the first call that fails.
fn walk(law: &mut dyn Law, path: &Path, visits: &mut Vec<Visit>, findings: &mut Vec<Finding>) {
    let convention = law.convention();
    let mut history = History::at_rest(law);
    let mut before = None;
    for (index, (gradient, length)) in path.gradients.iter().zip(&path.lengths).enumerate() {
        let name = format!("{}, step {} of {}", path.name, index + 1, path.steps());
        let no_step = || CallFailed("det F is not positive.".to_string());
        let step = history.step_to(gradient, *length).ok_or_else(no_step);
        let answer = step.and_then(|step| {
            let response = law.respond(&step)?;
            fits(&convention, &response)?;
            Ok((step, response))
        });
        match answer {
            Ok((step, response)) => {
                history = History::after(&step, &response);
                visits.push(Visit { name, step, response, before });
                before = Some(visits.len() - 1);
            }
            Err(failed) => {
                findings.push(not_checked(&name, failed));
                return;
            }
        }
    }
}

/// Whether a response has the components of the convention, all finite.
fn fits(convention: &Convention, response: &Response) -> Result<(), CallFailed> {
    let [rows, columns] = [convention.stress.count(), convention.strain.count()];
    let tangent = &response.tangent;
    if response.stress.len() != rows {
        return Err(CallFailed(format!("The law returned {} stresses in place of {rows}.", response.stress.len())));
    }
    if (tangent.rows, tangent.columns, tangent.entries.len()) != (rows, columns, rows * columns) {
        let size = format!("{} × {}", tangent.rows, tangent.columns);
        return Err(CallFailed(format!(
            "The law returned a tangent of {size} in place of {rows} × {columns} entries."
        )));
    }
    if !response.stress.iter().all(|value| value.is_finite()) {
        return Err(CallFailed("The law returned a stress that is not finite.".to_string()));
    }
    if !tangent.entries.iter().all(|value| value.is_finite()) {
        return Err(CallFailed("The law returned a tangent with an entry that is not finite.".to_string()));
    }
    Ok(())
}

/// The inputs that the law reads in any of a few steps, from all over the paths.
fn inputs_of(law: &mut dyn Law, visits: &[Visit]) -> Vec<Input> {
    let mut read: Vec<Input> = Vec::new();
    for visit in visits.iter().step_by(visits.len().div_ceil(PROBED).max(1)) {
        read.extend(inputs_read(law, &visit.step).unwrap_or_default());
    }
    read.sort_unstable();
    read.dedup();
    read
}

fn note_of_inputs(read: &[Input]) -> String {
    let names: Vec<&str> = read.iter().map(|input| input.words()).collect();
    if names.is_empty() {
        "The stress depends on no input.".to_string()
    } else {
        format!("The law reads {}.", names.join(", "))
    }
}

/// A law of the strain increment whose claimed rate is wrong may mean another tangent.
fn note_of_meaning(read: &[Input], measure: Measure) -> Option<String> {
    let small = read.contains(&Input::StrainIncrement) && !read.contains(&Input::Gradient);
    let rate = matches!(measure, Measure::JaumannKirchhoff | Measure::JaumannCauchy);
    let text = "The law reads the strain increment and not F. If it was written for small strain, its tangent means ∂σ/∂Δε: check it with this \
                meaning (tangent-check: --tangent strain).";
    (small && rate).then(|| text.to_string())
}

/// The note about a law whose answer depends on the call before.
const REMEMBERS: &str = "The law remembers the call before: the same step gave another answer after another step. It keeps a value in COMMON, \
                         SAVE, a module or a local variable that is not set. No derivative of such a law has a meaning.";

/// Whether a step is answered otherwise after another step. The law may only read the inputs of the step.
fn remembers(law: &mut dyn Law, visits: &[Visit]) -> bool {
    let chosen: Vec<&Visit> = visits.iter().step_by(visits.len().div_ceil(PROBED).max(1)).collect();
    chosen.windows(2).any(|pair| {
        let [first, _, again] = [&pair[0].step, &pair[1].step, &pair[0].step].map(|step| law.respond(step).ok());
        first != again
    })
}

/// A law whose stress does not turn with the body: σ(Q F) = Q σ(F) Qᵀ. The check along a frozen rotation cannot see it.
fn note_of_objectivity(law: &mut dyn Law, visits: &[Visit]) -> Option<String> {
    let convention = law.convention();
    let rotation = rotation_about(if convention.plane() { [0.0, 0.0, 0.4] } else { [0.3, -0.5, 0.4] });
    let mut greatest: f64 = 0.0;
    for visit in visits.iter().step_by(visits.len().div_ceil(PROBED).max(1)) {
        let mut turned = visit.step.clone();
        if !turned.turn_to(&product(&rotation, &visit.step.gradient)) {
            continue;
        }
        let stress = cauchy_stress(&convention, &visit.response.stress, &visit.step.gradient).ok();
        let other = law
            .respond(&turned)
            .ok()
            .and_then(|response| cauchy_stress(&convention, &response.stress, &turned.gradient).ok());
        if let Some((stress, other)) = stress.zip(other) {
            let expected = product3(&rotation, &stress, &transposed(&rotation));
            greatest = greatest.max(norm(&sum(&other, -1.0, &expected)) / norm(&stress).max(f64::MIN_POSITIVE));
        }
    }
    let text = format!(
        "The stress does not turn with the body: after a rotation it errs by up to {greatest:.0e} of its size. The law is not objective, and its \
         tangent can hold only without rotation. Its axes should turn with the body."
    );
    (greatest > OBJECTIVE).then_some(text)
}

fn note_of_roads(travelled: &[Travelled]) -> Option<String> {
    let [gradient, strain] = travelled else {
        return None;
    };
    let words = |road: &Travelled| {
        format!("{} of {} states are wrong {}", road.wrong(), road.findings.len(), road.road.words())
    };
    let text = "The law reads both F and the strain increment and was perturbed through both";
    Some(format!("{text}: {}, {}. The findings are those of the road with fewer.", words(gradient), words(strain)))
}

/// Checks all visits on a road.
fn travel(law: &mut dyn Law, road: Road, visits: &[Visit], check: &mut Check) -> Travelled {
    let mut findings = Vec::new();
    for visit in visits {
        let mut perturbed = Perturbed::new(law, &visit.step, road);
        findings.push(check(&visit.name, &visit.response.tangent, &mut perturbed));
    }
    Causes { law, road, visits }.name(&mut findings);
    Travelled { road, findings }
}

/// Adds what explains wrong tangents, and the mistakes that the states cannot show.
fn diagnose_into(law: &mut dyn Law, visits: &[Visit], travelled: &Travelled, report: &mut Report) {
    let convention = law.convention();
    let observations = observations(law, visits, travelled.road, &travelled.findings);
    let hidden = invisible(&convention, &observations);
    if !hidden.is_empty() {
        report.notes.push(format!("Mistakes that this check cannot show: {}.", hidden.join("; ")));
    }
    if travelled.wrong() == 0 {
        return;
    }
    match diagnose(&convention, &observations) {
        Some(diagnosis) => report.diagnoses.push(diagnosis),
        None => {
            let near = nearest(&convention, &observations).map_or_else(String::new, |(name, share)| {
                format!(" The nearest, {name}, explains {:.0} % of the deviation: there may be another.", 100.0 * share)
            });
            report.notes.push(format!("No frequent mistake explains the wrong tangent.{near}"));
        }
    }
}
