//! Long runs: free flight and rotation.

use super::bodies::{self, PLAIN, settings, stir, sum_of_momenta};
use super::{Effort, Outcome, Report, StudyError, rows, solvable, worse};
use crate::studies::patch::angular_momentum;
use bfree::approximation::{Approximation, Linear, Lme};
use bfree::mechanics::reference::GridReset;
use bfree::mechanics::schemes::GeneralizedAlpha;
use bfree::simulation::{InitialGuess, Simulation};
use bfree::tensor::{Tensor, Vector};
use std::sync::Arc;

/// The change of angular momentum that Newton's tolerance allows in 10⁴ steps.
const SPIN: f64 = 1e-10;

/// The step over the time a wave needs for a cell.
const STEP: f64 = 0.1;

pub(super) fn run(effort: &Effort, outcome: &mut Outcome) -> Result<(), StudyError> {
    let mut report = rows("long free flight and rotation: change of the linear momentum over sum m |v|");
    let long = if *effort == Effort::Full { 100_000 } else { 1000 };
    for (name, shape, steps) in
        [("linear", Approximation::from(Linear), 1000), ("LME 3", Lme::new(3.0, 1e-6).into(), long)]
    {
        for (motion, spin, breath) in [("rigid", 0.0, 0.0), ("vibrating", 0.0, 0.1), ("rotating", 0.2, 0.0)] {
            flies(name, &shape, motion, (spin, breath), steps, &mut report);
        }
    }
    outcome.reports.push(report);

    let steps = if *effort == Effort::Full { 10_000 } else { 300 };
    let mut report = rows(&format!(
        "rotation over {steps} steps, the grid kept, midpoint rule, eps = 0: change of the angular momentum over its start"
    ));
    solvable(&mut report, "angular momentum", "linear", spins(&Linear.into(), steps), SPIN);
    outcome.reports.push(report);
    Ok(())
}

/// A square of 4 × 4 cells with the given motion; its box has room for a flight of 2 cells.
fn square(shape: &Approximation, lumping: f64, (spin, breath): (f64, f64)) -> Simulation<2> {
    let sound = PLAIN.p_wave_modulus().sqrt();
    let mut simulation = bodies::block::<2>(4, shape.clone(), STEP / sound);
    simulation.settings = settings(lumping);
    simulation.settings.initial_guess = InitialGuess::Velocity;
    stir(&mut simulation, &(Tensor::<f64, 2>::new(breath, -spin, spin, 0.7 * breath) * sound));
    simulation
}

/// The largest change over `steps` steps, in which the square crosses two cells.
fn flies(name: &str, shape: &Approximation, motion: &str, stirred: (f64, f64), steps: u32, report: &mut Report) {
    // A rotation is slower in the long run; a vibration is not.
    let (spin, breath) = stirred;
    let mut simulation = square(shape, 1.0, (spin, 0.25 * breath));
    let speed = 2.0 / (f64::from(steps) * simulation.clock.step());
    for v in &mut simulation.particles.velocity {
        *v += Vector::from([speed, 0.7 * speed]);
    }
    let (start, scale) = (simulation.particles.momentum(), sum_of_momenta(&simulation.particles));
    let flown = (0..steps).try_fold(0.0, |worst, _| {
        simulation.step()?;
        Ok::<_, StudyError>(worse(worst, (simulation.particles.momentum() - start).norm() / scale))
    });
    solvable(report, &format!("{motion}, {steps} steps"), name, flown, bodies::MOMENTUM);
}

/// The largest change of the angular momentum on a total Lagrangian grid, with the midpoint rule and a consistent mass. The method then
/// conserves angular momentum exactly.
fn spins(shape: &Approximation, steps: u32) -> Result<f64, StudyError> {
    let mut simulation = square(shape, 0.0, (0.2, 0.0));
    simulation.settings.grid_reset = GridReset::Never;
    simulation.settings.scheme = Arc::new(GeneralizedAlpha { spectral_radius: 1.0 });
    let start = angular_momentum(&simulation.particles);
    (0..steps).try_fold(0.0, |worst, _| {
        simulation.step()?;
        Ok(worse(worst, (angular_momentum(&simulation.particles) / start - 1.0).abs()))
    })
}
