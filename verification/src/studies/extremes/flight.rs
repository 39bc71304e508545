//! Long runs: free flight and rotation.

use super::bodies::{self, PLAIN, settings, stir, sum_of_momenta};
use super::{Effort, Outcome, Report, StudyError, rows, solvable, worse};
use crate::table::Table;
use bfree::approximation::{Approximation, Bspline, Linear, Lme};
use bfree::mechanics::reference::Renewal;
use bfree::mechanics::schemes::GeneralizedAlpha;
use bfree::mechanics::transfer::Projection;
use bfree::particles::Particles;
use bfree::simulation::{InitialGuess, Simulation};
use bfree::tensor::{Tensor, Vector};
use std::sync::Arc;

/// The change of angular momentum that Newton's tolerance allows in 10⁴ steps.
const SPIN: f64 = 1e-10;

/// The step over the time a wave needs for a cell.
const STEP: f64 = 0.1;

pub(super) fn run(effort: &Effort, outcome: &mut Outcome) -> Result<(), StudyError> {
    let steps = if *effort == Effort::Full { 100_000 } else { 1000 };
    let mut report = rows(&format!("{steps} steps of free flight and of rotation: change of the linear momentum over sum m |v|"));
    let families = [("linear", Approximation::from(Linear)), ("LME 3", Lme::new(3.0, 1e-6).into())];
    for (name, shape) in &families {
        for (motion, spin, breath) in [("rigid", 0.0, 0.0), ("vibrating", 0.0, 0.1), ("rotating", 0.2, 0.0)] {
            flies(name, shape, motion, (spin, breath), steps, &mut report);
        }
    }
    outcome.reports.push(report);

    let time = if *effort == Effort::Full { 40.0 } else { 4.0 };
    let mut table = Table::new(
        format!("rotation at 0.2 rad a wave time: drift over t = {time} h/c, over the start, and its order in dt"),
        ["quantity", "shape", "eps", "projection", "dt = 0.2 h/c", "dt = 0.1 h/c", "dt = 0.05 h/c", "orders"],
    );
    let families =
        [("linear", Approximation::from(Linear)), ("cubic", Bspline::Cubic.into()), ("LME 3", Lme::new(3.0, 1e-6).into())];
    for (name, shape) in &families {
        for (lumping, projection) in [(1.0, Projection::Mass), (1.0, Projection::Affine), (0.01, Projection::Mass)] {
            rotates(name, shape, (lumping, projection), time, &mut table)?;
        }
    }
    outcome.tables.push(table);

    let steps = if *effort == Effort::Full { 10_000 } else { 300 };
    let mut report = rows(&format!("rotation over {steps} steps, the grid kept, midpoint rule, eps = 0: change of the angular momentum over its start"));
    for (name, shape) in families.iter().filter(|(name, _)| *name == "linear") {
        solvable(&mut report, "angular momentum", name, spins(shape, steps), SPIN);
    }
    outcome.reports.push(report);
    outcome.remarks.push(
        "A lumped mass takes angular momentum and energy from a rotation at a rate that does not depend on dt (order 0); with eps = 0.01 a hundredth of it."
            .into(),
    );
    Ok(())
}

/// A square of 4 × 4 cells with the given motion; its box has room for a flight of 2 cells.
fn square(shape: &Approximation, lumping: f64, dt: f64, (spin, breath): (f64, f64)) -> Simulation<2> {
    let sound = PLAIN.p_wave_modulus().sqrt();
    let mut simulation = bodies::block::<2>(4, shape.clone(), dt / sound);
    simulation.settings = settings(lumping);
    simulation.settings.initial_guess = InitialGuess::Velocity;
    stir(&mut simulation, &(Tensor::<f64, 2>::new(breath, -spin, spin, 0.7 * breath) * sound));
    simulation
}

/// The largest change over `steps` steps, in which the square crosses two cells.
fn flies(name: &str, shape: &Approximation, motion: &str, stirred: (f64, f64), steps: u32, report: &mut Report) {
    // A rotation is slower in the long run; a vibration is not.
    let (spin, breath) = stirred;
    let mut simulation = square(shape, 1.0, STEP, (spin, 0.25 * breath));
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

/// Σ m x × v about the centre of mass, of a square without translation.
fn angular_momentum(particles: &Particles<2>) -> f64 {
    let mass: f64 = particles.mass.iter().sum();
    let centre = particles.position.iter().zip(&particles.mass).map(|(x, &m)| x * m).sum::<Vector<f64, 2>>() / mass;
    let spin = |p: usize| {
        let (x, v) = (particles.position[p] - centre, &particles.velocity[p]);
        particles.mass[p] * (x[0] * v[1] - x[1] * v[0])
    };
    (0..particles.len()).map(spin).sum()
}

/// The largest change of the angular momentum on a total Lagrangian grid, with the midpoint rule and a consistent mass. The method then
/// conserves angular momentum exactly.
fn spins(shape: &Approximation, steps: u32) -> Result<f64, StudyError> {
    let mut simulation = square(shape, 0.0, STEP, (0.2, 0.0));
    simulation.settings.renewal = Renewal::Never;
    simulation.settings.scheme = Arc::new(GeneralizedAlpha { spectral_radius: 1.0 });
    let start = angular_momentum(&simulation.particles);
    (0..steps).try_fold(0.0, |worst, _| {
        simulation.step()?;
        Ok(worse(worst, (angular_momentum(&simulation.particles) / start - 1.0).abs()))
    })
}

fn rotates(
    name: &str,
    shape: &Approximation,
    (lumping, projection): (f64, Projection),
    time: f64,
    table: &mut Table,
) -> Result<(), StudyError> {
    let mut drifts = [Vec::new(), Vec::new()];
    for dt in [0.2, 0.1, 0.05] {
        let mut simulation = square(shape, lumping, dt, (0.2, 0.0));
        simulation.settings.projection = projection;
        let measured = |simulation: &Simulation<2>| {
            [angular_momentum(&simulation.particles), simulation.particles.kinetic_energy() + simulation.strain_energy()]
        };
        let start = measured(&simulation);
        for _ in 0..(time / dt).round() as u32 {
            simulation.step()?;
        }
        for ((drifts, end), start) in drifts.iter_mut().zip(measured(&simulation)).zip(start) {
            drifts.push((end - start) / start);
        }
    }
    for (quantity, drifts) in ["angular momentum", "energy"].into_iter().zip(&drifts) {
        let order = |k: usize| format!("{:.2}", (drifts[k] / drifts[k + 1]).abs().log2());
        let shown = drifts.iter().map(|drift| format!("{drift:.2e}"));
        let row = [quantity.into(), name.into(), lumping.to_string(), format!("{projection:?}")].into_iter().chain(shown);
        table.push(row.chain([format!("{}, {}", order(0), order(1))]));
    }
    Ok(())
}
