//! The extremes: whether rows said beforehand to be solvable are solved, and to what accuracy, and the others refused for the right reason.
//!
//! A solvable row ends with its error against arithmetic of higher precision, an exact answer or a balance, and a bound from theory;
//! a row to be refused with the number of answers that were not the one error expected: none.

mod bodies;
mod contrast;
mod crushed;
mod deformations;
mod double;
mod durations;
mod flight;
mod impossible;
mod places;
mod points;
mod sliding;
mod small;
mod strains;
mod units;

use super::{Effort, Outcome, StudyError};
use crate::report::{Bound, Report, chain};

/// What the study shows.
pub(super) const ABOUT: &str = "strains, deformations, contrasts, units, places, lone particles, time steps and overlaps at their extremes";

/// What is written in the column `beforehand` of a row that must be solved.
const SOLVABLE: &str = "solvable";

/// Runs the study.
pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let mut outcome = Outcome::default();
    outcome.reports.push(double::run());
    strains::run(effort, &mut outcome);
    deformations::run(&mut outcome);
    outcome.reports.push(impossible::run());
    outcome.reports.push(crushed::run()?);
    outcome.reports.push(contrast::run()?);
    outcome.reports.push(units::run()?);
    outcome.reports.push(places::run());
    small::run(&mut outcome);
    durations::run(effort, &mut outcome)?;
    flight::run(effort, &mut outcome)?;
    sliding::run(effort, &mut outcome)?;
    Ok(outcome)
}

/// A report of rows: what is done, to what, and what was said of it beforehand.
fn rows(title: &str) -> Report {
    Report::new(title, &["what", "case", "beforehand"])
}

/// A row that must be solved: its error against a bound, or why it failed.
fn solvable<E: Into<StudyError>>(report: &mut Report, what: &str, case: &str, measured: Result<f64, E>, bound: f64) {
    match measured {
        Ok(error) => at_most(report, what, case, error, bound),
        Err(error) => report.push_error(&[what, case, SOLVABLE], error.into().as_ref()),
    }
}

/// A row that was solved: its error against a bound.
fn at_most(report: &mut Report, what: &str, case: &str, error: f64, bound: f64) {
    report.push(&[what, case, SOLVABLE], error, Bound::AtMost(bound));
}

/// Takes `asked` steps, or as many as can be, with a row for how many; and says how many.
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

/// A row that must be refused with the error named: the value counts answers that are another one.
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
    // Without an answer nothing was refused.
    let value = if answered > 0 { f64::from(wrong) } else { f64::NAN };
    report.push(&[what, case, &beforehand], value, Bound::AtMost(0.0));
}

/// The larger one, and NaN if either is.
fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}
