//! The fast transfer against the plain one, which is its specification. `cargo bench --bench step` has the seconds of the parts of a step.

mod equality;
mod general;

use super::{Effort, Outcome, StudyError};
use crate::report::Report;

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "the fast sweep against the plain one, for every law and every separable shape function";

pub(super) fn run(_effort: &Effort) -> Result<Outcome, StudyError> {
    let mut report =
        Report::new("fast sweep - plain sweep, relative to the largest entry", &["quantity", "D", "law", "shape"]);
    equality::judge::<1>(&mut report, 9)?;
    equality::judge::<2>(&mut report, 7)?;
    equality::judge::<3>(&mut report, 4)?;
    Ok(Outcome { reports: vec![report], ..Outcome::default() })
}
