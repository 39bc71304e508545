//! Particles pushed through zero volume in one step: the step must be halved or fail, and never return a result.

use super::bodies::{self, PLAIN, body, fill, normal, simulation};
use super::{Report, StudyError, refused, rows, solvable};
use bfree::approximation::{Approximation, Linear, Lme};
use bfree::clock::Clock;
use bfree::grid::Grid;
use bfree::mechanics::loads::{Curve, Motion};
use bfree::particles::Particles;
use bfree::simulation::{AdvanceError, InitialGuess, Simulation, StepError};
use bfree::solver::NewtonFailure;
use bfree::tensor::{Deformation, Vector};

/// Cells along each axis of the box, which the body fills.
const CELLS: u32 = 4;

/// Halvings allowed if the row is solvable: the wall then moves at least 1e-3 of a cell.
const HALVINGS: u32 = 14;

pub(super) fn run() -> Result<Report, StudyError> {
    let mut report = rows("pushed through zero volume: particles whose det F is not positive afterwards; or refused");
    for (name, shape) in [("linear", Approximation::from(Linear)), ("LME 3", Lme::new(3.0, 1e-6).into())] {
        driven::<1>(name, &shape, &mut report)?;
        driven::<2>(name, &shape, &mut report)?;
        driven::<3>(name, &shape, &mut report)?;
        thrown::<1>(name, &shape, &mut report);
        thrown::<2>(name, &shape, &mut report);
        thrown::<3>(name, &shape, &mut report);
    }
    Ok(report)
}

/// The lower end of a box of `length` times its width is filled; all faces slide.
fn filled<const D: usize>(shape: &Approximation, length: u32) -> Simulation<D> {
    let mut grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [CELLS; D] };
    grid.cells[0] *= length;
    let mut particles = Particles::default();
    fill(&mut particles, &grid, ([0; D], [CELLS; D]), 2, (0, 1.0));
    let mut simulation = simulation(grid, shape.clone(), particles, vec![body(PLAIN, 1.0)], 1.0);
    simulation.loads.prescribed = bodies::sliding();
    simulation
}

/// Runs `steps` nominal steps with any number of halvings. Returns the number of particles without a positive volume.
fn survive<const D: usize>(simulation: &mut Simulation<D>, steps: u64) -> Result<f64, AdvanceError> {
    let mut wrong = 0;
    while simulation.clock.nominal_steps() < steps {
        simulation.advance()?;
        let states = simulation.particles.displacement_gradient.iter().map(|h| Deformation::new(*h).jacobian);
        wrong += states.filter(|&jacobian| !(jacobian > 0.0 && jacobian.is_finite())).count();
    }
    Ok(wrong as f64)
}

fn inadmissible(error: &StepError) -> bool {
    matches!(error, StepError::Newton(newton) if matches!(newton.cause, NewtonFailure::Inadmissible { iteration: 0, .. }))
}

/// A wall that moves by more than its cell in one step.
fn driven<const D: usize>(name: &str, shape: &Approximation, report: &mut Report) -> Result<(), StudyError> {
    for cells in [1.5, 3.0] {
        let mut simulation = filled::<D>(shape, 1);
        let curve = Curve::new(vec![[0.0, 0.0], [1.0, -cells]])?;
        simulation.loads.prescribed[1] = normal(0, true, Motion::Displacement(curve));
        let what = format!("a wall moves {cells} cells in a step, {name}, D = {D}");
        let refusal = simulation.clone().step();
        refused(report, &what, "no halving", "Newton(Inadmissible { iteration: 0 })", [refusal], inadmissible);
        simulation.clock = Clock::new(1.0, HALVINGS);
        solvable(report, &what, "halved as often as it takes", survive(&mut simulation, 1), 0.0);
    }
    Ok(())
}

/// A body that would fly through the adjacent wall in one step.
fn thrown<const D: usize>(name: &str, shape: &Approximation, report: &mut Report) {
    // The body has room to fly back.
    let mut simulation = filled::<D>(shape, 3);
    // Half the speed of sound, and steps of several cells.
    let speed = 0.5 * PLAIN.p_wave_modulus().sqrt();
    simulation.particles.velocity.fill(Vector::from_fn(|k, _| if k == 0 { -speed } else { 0.0 }));
    simulation.settings.initial_guess = InitialGuess::Velocity;
    simulation.clock = Clock::new(5.0 / speed, 0);
    let what = format!("a body flies 5 cells a step against its wall, {name}, D = {D}");
    refused(
        report,
        &what,
        "no halving",
        "Newton(Inadmissible { iteration: 0 })",
        [simulation.clone().step()],
        inadmissible,
    );
    simulation.clock = Clock::new(5.0 / speed, HALVINGS);
    solvable(report, &what, "halved as often as it takes", survive(&mut simulation, 1), 0.0);
}
