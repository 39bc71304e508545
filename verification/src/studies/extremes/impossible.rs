//! Deformations that no body can have, as the state of one particle at the start of a step.

use super::{Report, bodies, deformations::bad, refused, rows};
use bfree::approximation::Linear;
use bfree::simulation::StepError;
use bfree::solver::NewtonFailure;
use bfree::tensor::{Vector, identity};

pub(super) fn run() -> Report {
    let mut report = rows("particles that no body can have, in whole steps: answers that are not a refusal");
    whole_steps::<1>(&mut report);
    whole_steps::<2>(&mut report);
    whole_steps::<3>(&mut report);
    report
}

fn whole_steps<const D: usize>(report: &mut Report) {
    for (case, list) in bad::<D>() {
        let answers = list.iter().take(3).map(|f| {
            let mut simulation = bodies::block::<D>(2, Linear.into(), 0.1);
            simulation.particles.velocity.fill(Vector::repeat(0.1));
            simulation.particles.displacement_gradient[3] = f - identity::<f64, D>();
            simulation.step()
        });
        refused(
            report,
            &format!("a whole step, D = {D}"),
            case,
            "Newton(Inadmissible { iteration: 0 })",
            answers,
            |error| {
                matches!(error, StepError::Newton(newton)
                if matches!(&newton.cause, NewtonFailure::Inadmissible { iteration: 0, source } if source.particle == 3))
            },
        );
    }
}
