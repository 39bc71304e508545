//! Euler's elastica: the shipped beam, and one twice as long, four cells deep.

use crate::report::{Bound, Report};
use crate::shipped;
use crate::studies::{Outcome, StudyError};
use bfree::simulation::Simulation;
use bfree::tensor::Vector;

/// PL²/EI = 10: u/L and w/L of an inextensible beam that does not shear (Mattiasson, Int. J. Numer. Methods Eng. 17, 1981).
const END: [f64; 2] = [0.55500, 0.81061];

/// The distance of its end from the formula's, over w/L.
fn error(length: f64) -> Result<f64, StudyError> {
    // EI = 100
    let force = 10.0 * 100.0 / (length * length);
    let overrides = [
        format!("grid.size=[{},{length}]", length + 2.0),
        format!(r#"bodies.0.shape={{"box":{{"min":[0,{}],"max":[{length},{}]}}}}"#, length - 2.0, length - 1.0),
        format!(r#"tractions.0.region={{"half_space":{{"point":[{length},0],"normal":[-1,0]}}}}"#),
        format!("tractions.0.traction=[0,{}]", -force),
        "output.probes=[]".into(),
    ];
    let mut simulation: Simulation<2> = shipped::simulation("elastica", &overrides)?;
    let start = simulation.particles.by_id().position;
    while simulation.clock.nominal_steps() < 10 {
        simulation.advance()?;
    }
    // The mean over the points of the load.
    let now = simulation.particles.by_id();
    let at: Vec<_> = (0..now.len()).filter(|&p| !now.is_solid(p)).collect();
    let moved: Vector<f64, 2> = at.iter().map(|&p| now.position[p] - start[p]).sum();
    let end = moved / (at.len() as f64 * -length);
    Ok((end - Vector::from(END)).norm() / END[1])
}

/// A real beam shears and stretches, by (h/L)² of its displacement. The bounds are those of an independent prototype (0.65 and 0.10 %),
/// with a margin.
pub(super) fn run(outcome: &mut Outcome) -> Result<(), StudyError> {
    let mut report = Report::new("the elastica, PL²/EI = 10, 4 cells deep: error of the end over w", &["L/h"]);
    for (length, most) in [(20.0, 0.007), (40.0, 0.002)] {
        report.push(&[&length.to_string()], error(length)?, Bound::AtMost(most));
    }
    outcome.reports.push(report);
    Ok(())
}
