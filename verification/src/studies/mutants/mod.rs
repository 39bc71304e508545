//! Deliberate faults: each must turn red exactly the cells that are written down beside it.
//!
//! Wrong laws and wrong shape functions are built here, and the public checks judge them cell by cell. The shipped files have faults, too,
//! which a normal build leaves out (`src/mutant.rs`). Full effort builds the library with these faults and switches them on one by one.

mod forecast;
mod laws;
mod shapes;
mod shipped;
mod sources;
mod table;

use super::{Effort, Outcome, StudyError};

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "faults put in on purpose, each caught by the check named beforehand";

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let mut report = forecast::report();
    laws::judge(&mut report)?;
    shapes::judge(&mut report);
    let mut outcome = Outcome { reports: vec![report], ..Outcome::default() };
    let places = sources::places(&shipped::root())?;
    if *effort == Effort::Full {
        shipped::run(&places, &mut outcome)?;
    } else {
        outcome.remarks.push(format!("Full effort also tries the {} faults in the shipped files.", places.len()));
    }
    Ok(outcome)
}
