//! The tangent product near the machine's limit: the fast transfer against the plain one, and the cost of every part.
//!
//! Short effort compares results and counts operations. Full effort also measures: times are tables, never verdicts.

mod equality;
mod general;
mod machine;
mod timing;
mod work;

use super::{Effort, Outcome, StudyError};
use crate::report::Report;

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "the fast sweep against the plain one; operations, bytes, rates and seconds a step (full effort)";

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let mut report = Report::new("fast sweep - plain sweep, relative to the largest entry", &["quantity", "D", "law", "shape"]);
    equality::judge::<1>(&mut report, 9)?;
    equality::judge::<2>(&mut report, 7)?;
    equality::judge::<3>(&mut report, 4)?;
    let mut outcome = Outcome { reports: vec![report], tables: vec![work::table()?], ..Outcome::default() };
    if *effort == Effort::Full {
        timing::measure(&mut outcome)?;
    } else {
        outcome.remarks.push("Full effort measures rates, steps and memory; the study `baseline` has assembled matrices.".into());
    }
    Ok(outcome)
}
