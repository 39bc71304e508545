//! The extremes. Each row says beforehand whether it is solvable. Solvable rows must reach the stated accuracy; the others must be refused
//! for the right reason.
//!
//! A solvable row holds its error against arithmetic of higher precision, an exact answer or a balance, with a bound from theory. A row to
//! be refused holds the number of answers that differ from the expected error; the number must be zero.

pub(super) mod bodies;
mod contrast;
mod crushed;
mod deformations;
mod double;
mod durations;
mod flight;
mod impossible;
mod points;
mod sliding;
mod small;
mod strains;
mod units;

use super::{Effort, Outcome, StudyError, worse};
use crate::report::{Bound, Report, chain};

/// The summary in the list of studies.
pub(super) const ABOUT: &str =
    "strains, deformations, contrasts, units, lone particles, time steps and overlaps at their extremes";

/// The entry in the column `beforehand` of a row that must be solved.
const SOLVABLE: &str = "solvable";

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let mut outcome = Outcome::default();
    outcome.reports.push(double::run());
    strains::run(effort, &mut outcome);
    deformations::run(&mut outcome);
    outcome.reports.push(impossible::run());
    outcome.reports.push(crushed::run()?);
    outcome.reports.push(contrast::run()?);
    outcome.reports.push(units::run()?);
    small::run(&mut outcome);
    durations::run(effort, &mut outcome)?;
    flight::run(effort, &mut outcome)?;
    sliding::run(&mut outcome)?;
    Ok(outcome)
}

/// A report of rows: the action, the case, and the expectation stated beforehand.
fn rows(title: &str) -> Report {
    Report::new(title, &["what", "case", "beforehand"])
}

/// A row that must be solved: its error with a bound, or the cause of its failure.
fn solvable<E: Into<StudyError>>(report: &mut Report, what: &str, case: &str, measured: Result<f64, E>, bound: f64) {
    match measured {
        Ok(error) => at_most(report, what, case, error, bound),
        Err(error) => report.push_error(&[what, case, SOLVABLE], error.into().as_ref()),
    }
}

/// A row that was solved: its error with a bound.
fn at_most(report: &mut Report, what: &str, case: &str, error: f64, bound: f64) {
    report.push(&[what, case, SOLVABLE], error, Bound::AtMost(bound));
}

/// Takes `asked` steps, or as many as possible, and adds a row with their number. Returns the number.
fn steps<E: Into<StudyError>>(
    report: &mut Report,
    what: &str,
    case: &str,
    asked: u32,
    mut step: impl FnMut() -> Result<(), E>,
) -> u32 {
    let mut taken = 0;
    let result = (0..asked).try_for_each(|_| step().map(|()| taken += 1));
    let labels = [what, &format!("{case}: steps taken, of {asked}"), SOLVABLE];
    report.push(&labels, taken.into(), Bound::AtLeast(asked.into()));
    if let Err(error) = result {
        report.note(format!("{what}, {case}: {}", chain(error.into().as_ref())));
    }
    taken
}

/// A row that must be refused with the error named: the value counts the other answers.
fn refused<T, E: std::error::Error>(
    report: &mut Report,
    what: &str,
    case: &str,
    error: &str,
    answers: impl IntoIterator<Item = Result<T, E>>,
    expected: impl Fn(&E) -> bool,
) {
    let beforehand = format!("refused: {error}");
    let (mut answered, mut wrong) = (0, 0);
    for answer in answers {
        answered += 1;
        let found = match &answer {
            Err(found) if expected(found) => continue,
            Err(found) => chain(found),
            Ok(_) => "accepted".into(),
        };
        wrong += 1;
        report.note(format!("{what}, {case}: {found}"));
    }
    // Without an answer there was no refusal.
    let value = if answered > 0 { f64::from(wrong) } else { f64::NAN };
    report.push(&[what, case, &beforehand], value, Bound::AtMost(0.0));
}
