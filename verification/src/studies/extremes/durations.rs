//! Steps from 1e-12 to 1e6 times the time a wave needs for a cell; a body without motion and loads; a body at rest under stress.

use super::bodies::{self, PLAIN, fill, simulation, sliding, stir, sum_of_momenta};
use super::{Effort, Outcome, Report, StudyError, at_most, rows, solvable, steps, worse};
use bfree::approximation::{Approximation, Gimp, Linear, Lme};
use bfree::grid::Grid;
use bfree::material::{Law, MaterialState};
use bfree::particles::Particles;
use bfree::simulation::Simulation;
use bfree::tensor::{Tensor, Vector};

/// Round-off of sums over the particles of a few nodes.
const ROUNDINGS: f64 = 64.0;

/// Largest speed over that of sound.
const MACH: f64 = 0.1;

/// Steps of each duration.
const STEPS: u32 = 5;

fn families() -> [(&'static str, Approximation); 2] {
    [("linear", Linear.into()), ("LME 3", Lme::new(3.0, 1e-6).into())]
}

pub(super) fn run(effort: &Effort, outcome: &mut Outcome) -> Result<(), StudyError> {
    let mut report = rows("durations: errors over speeds, strains and stresses of the problem");
    for (name, shape) in families() {
        for exponent in [-12, -9, -6, -3, 0, 1, 2, 3, 6] {
            vibrating::<2>(name, &shape, exponent, &mut report);
        }
        vibrating::<3>(name, &shape, -12, &mut report);
        vibrating::<3>(name, &shape, 6, &mut report);
        nothing::<1>(name, &shape, &mut report);
        nothing::<2>(name, &shape, &mut report);
        nothing::<3>(name, &shape, &mut report);
    }
    // With these two families the particles integrate a uniform stress exactly: a discrete equilibrium.
    for (name, shape) in [("linear", Linear.into()), ("gimp", Gimp::particles_per_axis(2).into())] {
        let counts = if *effort == Effort::Full { [10_000, 1000, 300] } else { [1000, 100, 30] };
        pressed::<1>(name, &shape, counts[0], &mut report);
        pressed::<2>(name, &shape, counts[1], &mut report);
        pressed::<3>(name, &shape, counts[2], &mut report);
    }
    outcome.reports.push(report);
    Ok(())
}

/// A free block that starts to deform without rotation. In short steps it hardly changes; in long steps each step ends at rest.
fn vibrating<const D: usize>(name: &str, shape: &Approximation, exponent: i32, report: &mut Report) {
    let sound = PLAIN.p_wave_modulus().sqrt();
    let ratio = 10.0_f64.powi(exponent);
    let cells = if D == 3 { 2 } else { 4 };
    let mut simulation = bodies::block::<D>(cells, shape.clone(), ratio / sound);
    let a = Tensor::<f64, D>::from_fn(|i, k| if i == k { 1.0 - 1.6 * i as f64 } else { 0.3 })
        * (MACH * sound / (2.0 * f64::from(cells)));
    stir(&mut simulation, &a);
    let start = simulation.particles.clone();
    let scale = sum_of_momenta(&start);
    let fastest = start.velocity.iter().map(Vector::norm).fold(0.0, worse);
    let (mut momentum, mut strain): (f64, f64) = (0.0, 0.0);
    let mut impulse = 0.0;
    let (what, case) = (format!("a free block vibrates, {name}, D = {D}"), format!("dt = 1e{exponent} h/c"));
    let taken = steps(report, &what, &case, STEPS, || {
        let step = simulation.step()?;
        impulse += step.dt * bodies::left_by_newton(&simulation.settings, &step);
        let particles = &simulation.particles;
        momentum = worse(momentum, (particles.momentum() - start.momentum()).norm() / scale);
        strain = particles.displacement_gradient.iter().map(|h| h.norm()).fold(strain, worse);
        Ok::<_, StudyError>(())
    });
    // In long steps the internal forces are large impulses, and so is the residual that Newton's method leaves.
    let bound = if exponent > 0 { impulse / scale } else { bodies::MOMENTUM };
    at_most(report, &what, &format!("{case}: linear momentum"), momentum, bound);
    let particles = simulation.particles.by_id();
    let waves = f64::from(taken) * ratio;
    if exponent <= -3 {
        // Stresses grow to at most Λ |A| t; the change of speed is a few times c |A| t × t c/h.
        let changed = particles.velocity.iter().zip(&start.velocity).map(|(v, v_0)| (v - v_0).norm()).fold(0.0, worse);
        let bound = 10.0 * waves * waves + ROUNDINGS * f64::EPSILON;
        at_most(report, &what, &format!("{case}: change of velocity"), changed / fastest, bound);
    } else if exponent >= 2 {
        // α₁ M Δφ + K Δφ = α₂ M v: a velocity v leaves the strain 4 (v/c) h/(c Δt), and more where the motion is longer.
        let length = f64::from(2 * cells);
        at_most(report, &what, &format!("{case}: strain"), strain, 10.0 * length * MACH / ratio);
    }
}

/// Without velocity and gravity not one bit changes.
fn nothing<const D: usize>(name: &str, shape: &Approximation, report: &mut Report) {
    let mut simulation = bodies::block::<D>(2, shape.clone(), 0.5);
    simulation.loads.gravity = Some(bodies::gravity(Vector::zeros()));
    let start = simulation.particles.clone();
    let changed = (0..100).try_for_each(|_| simulation.step().map(|_| ())).map(|()| {
        let particles = simulation.particles.by_id();
        f64::from(u8::from(particles.position != start.position) + u8::from(particles.velocity != start.velocity))
            + particles.displacement_gradient.iter().map(Tensor::norm).fold(0.0, worse)
    });
    solvable(
        report,
        &format!("zero velocity, zero gravity, 100 steps, {name}, D = {D}"),
        "what has changed",
        changed,
        0.0,
    );
}

/// A block under uniform stress that fills its box: a discrete equilibrium in which only round-off moves.
fn pressed<const D: usize>(name: &str, shape: &Approximation, steps: u32, report: &mut Report) {
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [if D == 3 { 2 } else { 3 }; D] };
    let mut particles = Particles::default();
    fill(&mut particles, &grid, ([0; D], [grid.cells[0]; D]), 2, (0, 1.0));
    let strain = Tensor::<f64, D>::from_fn(|i, k| if i == k { -0.1 - 0.05 * i as f64 } else { 0.0 });
    particles.displacement_gradient.fill(strain);
    let mut simulation: Simulation<D> = simulation(grid, shape.clone(), particles, vec![bodies::body(PLAIN, 1.0)], 0.5);
    simulation.loads.prescribed = sliding();
    let start = simulation.particles.clone();
    let rested = (0..steps).try_for_each(|_| simulation.step().map(|_| ()));
    let (what, sound) =
        (format!("under stress at rest, {steps} steps, {name}, D = {D}"), PLAIN.p_wave_modulus().sqrt());
    let particles = simulation.particles.by_id();
    let speed = particles.velocity.iter().map(Vector::norm).fold(0.0, worse) / sound;
    let moved = particles.position.iter().zip(&start.position).map(|(x, x_0)| (x - x_0).norm()).fold(0.0, worse);
    let at = MaterialState::new(strain);
    let stress = bodies::body(PLAIN, 1.0).law.stress(&at).norm() / PLAIN.p_wave_modulus();
    // Each step adds a random rounding of the stresses. Velocities grow with the root of the number of steps; displacements sum them once
    // more.
    let bound = ROUNDINGS * f64::EPSILON * stress * f64::from(steps).sqrt();
    solvable(report, &what, "speed over that of sound", rested.map(|()| speed), bound);
    solvable(report, &what, "displacement over spacing", Ok::<_, StudyError>(moved), bound * f64::from(steps));
}
