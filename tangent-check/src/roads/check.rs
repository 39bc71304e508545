//! The check of a law along paths.

use super::cause::Causes;
use super::observations::{SIDES, observations};
use super::ranges;
use super::{History, Input, PROBED, Perturbed, Road, Visit, inputs_read, objectivity, roads};
use crate::convention::{Convention, Measure};
use crate::diagnosis::{diagnose, invisible, nearest};
use crate::finding::{Finding, Report, Verdict};
use crate::judge::{self, Loading, check_along};
use crate::law::{CallFailed, Law, Response};
use crate::matrix::Matrix;
use crate::states::Path;
use std::cell::RefCell;

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
    let mut stiffness = None;
    let all = roads(&read, convention.measure).into_iter();
    let travelled: Vec<Travelled> = all.map(|road| travel(law, road, &visits, &mut stiffness)).collect();
    report.notes.extend(objectivity::note(law, &visits));
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
    judge::failed(name, &Matrix::zeros(0, 0), 0, 0, format!("{name}: {}", failed.0), 1)
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

/// Checks all visits on a road. The first one that is sharp, nearly at rest, gives the stiffness of the law.
fn travel(law: &mut dyn Law, road: Road, visits: &[Visit], stiffness: &mut Option<f64>) -> Travelled {
    let mut findings = Vec::new();
    for visit in visits {
        let finding = checked(law, road, visit, stiffness.unwrap_or(0.0));
        let measured = finding.measured.greatest();
        *stiffness = stiffness.or(Some(measured).filter(|_| finding.error <= SIDES));
        findings.push(finding);
    }
    Causes { law, road, visits }.name(&mut findings);
    Travelled { road, findings }
}

/// The check by differences. It also looks along the step for jumps of a loose local iteration.
fn checked(law: &mut dyn Law, road: Road, visit: &Visit, stiffness: f64) -> Finding {
    let Visit { name, step, response, .. } = visit;
    let mut perturbed = Perturbed::new(law, step, road);
    let value = match perturbed.value(0, 0.0) {
        Ok(value) => value,
        Err(failed) => return not_checked(name, failed),
    };
    let size = perturbed.size();
    let shared = RefCell::new(perturbed);
    let loading = Loading { size, respond: &mut |part| shared.borrow_mut().part(part), stiffness };
    check_along(name, &response.tangent, &value, &mut |k, h| shared.borrow_mut().value(k, h), Some(loading))
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
