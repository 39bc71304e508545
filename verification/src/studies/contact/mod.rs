//! Contact with rigid obstacles and between bodies: the tangent of every state of contact against dual numbers, and forces and motions against exact answers.

mod bar;
mod between;
mod bounce;
mod cone;
mod disc;
mod free;
mod images;
mod incline;
mod indentation;
mod piles;
mod plates;
mod slopes;
mod tangent;
mod wedge;

use super::{Effort, Outcome, StudyError};
use bfree::simulation::Simulation;
use serde_json::Value;

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "contact with obstacles and between bodies: tangent, impact of bars, sliding and rolling, a wedge, patch test, Hertz, discs beside finite elements, the paper's disc, free obstacles, random blocks on slopes, plates and images, a dragged block, a ball that bounces";

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let mut reports = tangent::reports()?;
    let (of_bar, table) = bar::report(effort)?;
    reports.push(of_bar);
    reports.push(between::impact(effort)?);
    reports.push(incline::report(effort)?);
    reports.push(between::slope(effort)?);
    reports.push(between::mirrored(effort)?);
    reports.push(disc::beside_elements(effort)?);
    reports.push(disc::of_the_paper(effort)?);
    reports.push(wedge::report(effort)?);
    reports.extend(free::reports(effort)?);
    reports.push(indentation::patch()?);
    reports.extend(slopes::reports(effort)?);
    reports.push(piles::report(effort)?);
    reports.push(plates::report(effort)?);
    reports.push(images::report(effort)?);
    reports.push(cone::report(effort)?);
    reports.push(bounce::report(effort)?);
    if *effort == Effort::Full {
        reports.push(indentation::hertz()?);
        reports.push(indentation::point()?);
    }
    Ok(Outcome { reports, tables: vec![table], ..Outcome::default() })
}

/// The simulation of a scene in JSON.
fn built<const D: usize>(scene: &Value) -> Result<Simulation<D>, StudyError> {
    Ok(bfree::scene::read(&scene.to_string(), &[])?.build::<D>(".".as_ref())?)
}
