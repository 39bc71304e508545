//! Deliberate faults: each must turn red exactly the cells that are written down beside it.
//!
//! Wrong laws and wrong shape functions are built here, and the public checks judge them cell by cell. Full effort also patches files under
//! `src/`, including the terms and the transfer, in a copy of the workspace, and runs the copy's own checks (see [`schemata`]).
//! the copy's own checks (see [`schemata`]).

mod forecast;
mod laws;
mod patches;
mod schemata;
mod shapes;
mod shipped;

use super::{Effort, Outcome, StudyError};

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "faults put in on purpose, each caught by the check named beforehand";

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let mut report = forecast::report();
    laws::judge(&mut report)?;
    shapes::judge(&mut report);
    let mut outcome = Outcome { reports: vec![report], ..Outcome::default() };
    if *effort == Effort::Full {
        shipped::run(&mut outcome)?;
    } else {
        shipped::fit()?;
        outcome.remarks.push(format!("Full effort patches the shipped files too: {} faults, which still fit their files.", patches::PATCHES.len()));
    }
    Ok(outcome)
}
