//! The tangent of a step of every shipped scene, by [`check_tangent`]: what users run, where the study `tangent` has synthetic bodies.

use super::{Effort, Outcome, StudyError};
use crate::check_tangent;
use crate::report::Report;
use crate::shipped;
use bfree::simulation::Simulation;

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "every term of the tangent, and the potential, on steps of every shipped scene";

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let steps = if *effort == Effort::Full { 40 } else { 2 };
    let title = format!("tangent of the step after {steps} steps of a scene, or three quarters of its time");
    let mut report = Report::new(title, &["quantity", "scene", "increment"]).as_matrix(&[0], 2, 1);
    for name in shipped::names()? {
        let scene = shipped::scene(&name, &[] as &[&str])?;
        let end = 0.75 * scene.time.end;
        let found = match scene.dimension() {
            1 => judged::<1>(scene.build(&shipped::folder())?, steps, end)?,
            2 => judged::<2>(scene.build(&shipped::folder())?, steps, end)?,
            _ => judged::<3>(scene.build(&shipped::folder())?, steps, end)?,
        };
        for cell in found.cells() {
            report.push(&[&cell.labels[0], &name, &cell.labels[1]], cell.value, cell.bound);
        }
    }
    Ok(Outcome { reports: vec![report], ..Outcome::default() })
}

/// The last load of a scene may be the limit of its body, and the judged step starts on a reset grid; so the run ends before `end`.
fn judged<const D: usize>(mut simulation: Simulation<D>, steps: usize, end: f64) -> Result<Report, StudyError> {
    for _ in 0..steps {
        if simulation.clock.time() > end {
            break;
        }
        simulation.advance()?;
    }
    simulation.forget();
    Ok(check_tangent(&simulation))
}
