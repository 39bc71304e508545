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
use crate::report::Report;
use bfree::simulation::Simulation;
use rayon::prelude::*;
use serde_json::Value;

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "contact with obstacles and between bodies: tangent, impact of bars, sliding and rolling, a wedge, patch test, Hertz, discs beside finite elements, the paper's disc, free obstacles, random blocks on slopes, plates and images, a dragged block, a ball that bounces";

/// A part of the study.
type Part = fn(&Effort) -> Result<Vec<Report>, StudyError>;

/// The parts that run side by side, in the order of their reports.
const PARTS: [Part; 14] = [
    |_| tangent::reports(),
    |effort| Ok(vec![between::impact(effort)?]),
    |effort| Ok(vec![incline::report(effort)?]),
    |effort| Ok(vec![between::slope(effort)?]),
    |effort| Ok(vec![between::mirrored(effort)?]),
    |effort| Ok(vec![disc::beside_elements(effort)?]),
    |effort| Ok(vec![disc::of_the_paper(effort)?]),
    |effort| Ok(vec![wedge::report(effort)?, indentation::patch()?]),
    free::reports,
    slopes::reports,
    |effort| Ok(vec![piles::report(effort)?, plates::report(effort)?]),
    |effort| Ok(vec![images::report(effort)?, cone::report(effort)?]),
    |effort| Ok(vec![bounce::report(effort)?]),
    |effort| match effort {
        Effort::Full => Ok(vec![indentation::hertz()?, indentation::point()?]),
        Effort::Short => Ok(Vec::new()),
    },
];

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let (of_bar, table) = bar::report(effort)?;
    let mut parts: Vec<Vec<Report>> = PARTS.par_iter().map(|part| part(effort)).collect::<Result<_, _>>()?;
    parts.insert(1, vec![of_bar]);
    Ok(Outcome { reports: parts.concat(), tables: vec![table], ..Outcome::default() })
}

/// The simulation of a scene in JSON.
fn built<const D: usize>(scene: &Value) -> Result<Simulation<D>, StudyError> {
    Ok(bfree::scene::read(&scene.to_string(), &[])?.build::<D>(".".as_ref())?)
}
