//! The findings that a story must have.

use crate::algebra::{Story, Told, Version};
use std::collections::BTreeSet;
use tangent_check::convention::Tensor;
use tangent_check::finding::{Finding, Report, Verdict};
use tangent_check::judge::check_columns;
use tangent_check::law::{Law, Step};
use tangent_check::matrix::Matrix;
use tangent_check::roads::{Perturbed, check_law, inputs_read, roads};
use tangent_check::states::for_law;

const SEED: u64 = 7;

/// A general F with J = 1.2, which stretches all fibres.
pub const GRADIENT: Tensor = [[1.3, 0.2, 0.1], [-0.1, 1.1, 0.15], [0.05, -0.2, 0.8]];
/// A general strain increment.
const STRAIN: Tensor = [[0.1, 0.03, -0.02], [0.03, -0.05, 0.04], [-0.02, 0.04, 0.02]];

/// An entry is right within this many errors of the measurement, and wrong beyond.
const ERRORS: f64 = 10.0;

/// The report over all states that the checker makes itself.
pub fn report(law: &mut dyn Law) -> Report {
    let paths = for_law(law, SEED).expect("paths");
    check_law(law, &paths, SEED)
}

/// The check in one general state from rest.
fn finding(law: &mut dyn Law) -> Finding {
    let step = Step {
        length: 1.0,
        gradient: GRADIENT,
        strain_increment: STRAIN,
        stress: vec![0.0; 6],
        state: law.state_at_rest(),
        ..Step::at_rest()
    };
    let claimed = law.respond(&step).expect("a response").tangent;
    let read = inputs_read(law, &step).expect("inputs");
    let road = roads(&read, law.convention().measure)[0];
    let mut perturbed = Perturbed::new(law, &step, road);
    let value = perturbed.value(0, 0.0).expect("a value");
    check_columns("general state", &claimed, &value, &mut |k, h| perturbed.value(k, h))
}

/// The check of a vector function.
pub fn vector_finding(claimed: &Matrix, f: &mut dyn FnMut(usize, f64) -> Vec<f64>) -> Finding {
    let value = f(0, 0.0);
    check_columns("residual", claimed, &value, &mut |k, h| Ok(f(k, h)))
}

/// The rows and columns of the entries that are not within their errors.
pub fn wrong_entries(finding: &Finding) -> BTreeSet<(usize, usize)> {
    let Matrix { rows, columns, .. } = finding.claimed;
    let round_off = 4.0 * f64::EPSILON * finding.measured.greatest();
    let wrong = |&(row, column): &(usize, usize)| {
        let entry = (row, column);
        let deviation = (finding.claimed[entry] - finding.measured[entry]).abs();
        deviation.is_nan() || deviation > ERRORS * (finding.errors[entry] + round_off)
    };
    all(rows, columns).into_iter().filter(wrong).collect()
}

/// All entries of a matrix.
pub fn all(rows: usize, columns: usize) -> BTreeSet<(usize, usize)> {
    (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))).collect()
}

/// Asserts that a finding is wrong at exactly these entries, and worst at one of `worst`, whose deviations are equal by the formula.
pub fn assert_wrong(finding: &Finding, worst: &[(usize, usize)], entries: &BTreeSet<(usize, usize)>) {
    assert_eq!(finding.verdict, Verdict::Wrong);
    assert_eq!(&wrong_entries(finding), entries);
    let found = finding.worst.expect("a worst entry");
    assert!(worst.contains(&(found.row, found.column)), "{found:?}");
}

/// Asserts that a finding is consistent, and that its negative control saw an error of 1e-8.
pub fn assert_consistent(finding: &Finding) {
    assert_eq!(finding.verdict, Verdict::Consistent, "{}: {:?} {:?}", finding.name, finding.reason, finding.worst);
    let control = finding.control.expect("a control");
    assert!(control <= 1e-8, "the control saw {control:e} only");
}

/// Asserts what must be found in a law before the repair: wrong in a general state at exactly these entries, and in the whole report.
/// Returns the report and the finding of the general state.
pub fn assert_law_wrong(
    story: &Story,
    worst: &[(usize, usize)],
    entries: &BTreeSet<(usize, usize)>,
) -> (Report, Finding) {
    let mut law = Told(story, Version::Before);
    let finding = finding(&mut law);
    assert_wrong(&finding, worst, entries);
    let report = report(&mut law);
    assert_eq!(report.verdict(), Verdict::Wrong);
    (report, finding)
}

/// Asserts that a report has one diagnosis with these words.
pub fn assert_diagnosed(report: &Report, words: &str) {
    let [diagnosis] = report.diagnoses.as_slice() else { panic!("{:?}", report.diagnoses) };
    assert!(diagnosis.sentence.contains(words), "{}", diagnosis.sentence);
}

/// Asserts that nothing of the list of frequent mistakes explains a wrong tangent.
pub fn assert_not_named(report: &Report) {
    assert!(report.diagnoses.is_empty(), "{:?}", report.diagnoses);
}
