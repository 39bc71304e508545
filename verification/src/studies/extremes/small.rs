//! Whole steps of free fall with one particle, one particle per cell, nodes of mass 1e-300, and a singular consistent mass.

use super::bodies::{
    self, PLAIN, body, fill, gravity, left_by_newton, normal, settings, simulation, stir, sum_of_momenta,
};
use super::{Outcome, Report, at_most, refused, rows, steps, worse};
use bfree::approximation::{Approximation, Bspline, Gimp, Linear, Lme};
use bfree::grid::Grid;
use bfree::mechanics::loads::Motion;
use bfree::particles::Particles;
use bfree::simulation::{InitialGuess, Simulation, StepError};
use bfree::tensor::{Deformation, Tensor, Vector};

const STEPS: u32 = 5;
/// Steps of blocks with one particle per cell.
const STEPS_OF_BLOCKS: u32 = 200;

const STEP: f64 = 0.1;

/// The projection (42) of velocity and of acceleration is solved to 1e-12 each. M̃ ≥ ε M_L amplifies this error by at most 1/ε.
const PROJECTED: f64 = 2e-12;

fn families() -> [(&'static str, Approximation); 6] {
    [
        ("linear", Linear.into()),
        ("gimp", Gimp::particles_per_axis(1).into()),
        ("quadratic", Bspline::Quadratic.into()),
        ("cubic", Bspline::Cubic.into()),
        ("LME 3", Lme::new(3.0, 1e-6).into()),
        ("LME 0.8", Lme::new(0.8, 1e-6).into()),
    ]
}

/// The initial position of a lone particle, in cells: the first `axes` coordinates, and the others. On a wall of the box the first ones are
/// held.
struct Place {
    name: &'static str,
    at: f64,
    axes: usize,
    others: f64,
}

/// 1e-300 and 1e-13 off the wall, nodes have this share of the particle's mass: one below and one above the limit of a light node.
const PLACES: [Place; 7] = [
    Place { name: "in a cell", at: 2.3, axes: 1, others: 3.6 },
    Place { name: "on a face of a cell", at: 3.0, axes: 1, others: 3.6 },
    Place { name: "on a node", at: 3.0, axes: 1, others: 3.0 },
    Place { name: "on the hull", at: 0.0, axes: 1, others: 3.6 },
    Place { name: "on two faces of the hull", at: 0.0, axes: 2, others: 3.6 },
    Place { name: "1e-300 off the hull", at: 1e-300, axes: 1, others: 3.0 },
    Place { name: "1e-13 off the hull", at: 1e-13, axes: 1, others: 3.0 },
];

pub(super) fn run(outcome: &mut Outcome) {
    let mut alone =
        rows("a lone particle in free fall: errors of velocity and place over its speed, and what it is strained");
    let mut blocks =
        rows("one particle a cell: change of the linear momentum over sum m |v|, and way over what energy allows");
    for (name, shape) in &families() {
        for lumping in [1.0, 0.5] {
            lonely::<1>(name, shape, lumping, &mut alone);
            lonely::<2>(name, shape, lumping, &mut alone);
            lonely::<3>(name, shape, lumping, &mut alone);
        }
        for lumping in [1.0, 0.5, 0.0] {
            sparse::<1>(name, shape, lumping, &mut blocks);
            sparse::<2>(name, shape, lumping, &mut blocks);
            sparse::<3>(name, shape, lumping, &mut blocks);
        }
    }
    outside::<1>(&mut alone);
    outside::<2>(&mut alone);
    outside::<3>(&mut alone);
    outcome.reports.extend([alone, blocks]);
    outcome.remarks.push(
        "eps = 0 and one particle a cell, D = 2 and 3: there are more nodes than particles, and hourglass patterns have \
         no mass; while particles are in the middle of their cells they have no stiffness either, and no force. \
         Afterwards force is of first and stiffness of second order in how far they have left it, and Newton's method no \
         longer gets to the last digits: see the known failures. Any eps > 0 gives these patterns mass."
            .into(),
    );
}

/// A single particle that starts at `place`, without velocity along held axes.
fn lone<const D: usize>(place: &Place, shape: &Approximation, lumping: f64) -> (Simulation<D>, Vector<f64, D>) {
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [6; D] };
    let near = |k: usize| k < place.axes;
    let held = |k: usize| near(k) && place.at < 1.0;
    let mut particles = Particles::default();
    let position = Vector::from_fn(|k, _| if near(k) { place.at } else { place.others });
    let velocity = Vector::from_fn(|k, _| if held(k) { 0.0 } else { 0.3 });
    particles.push(position, velocity, 1.0, 1.0, 0);
    let mut simulation = simulation(grid, shape.clone(), particles, vec![body(PLAIN, 1.0)], STEP);
    simulation.settings = settings(lumping);
    // From Δφ = 0, nodes with almost no mass would reach their solution only through finite rotations.
    simulation.settings.initial_guess = InitialGuess::Velocity;
    // On a wall, round-off alone would move it out of the box.
    simulation.loads.prescribed = (0..D).filter(|&k| held(k)).map(|k| normal(k, false, Motion::Rest)).collect();
    let g = Vector::from_fn(|k, _| if held(k) { 0.0 } else { -0.2 });
    simulation.loads.gravity = Some(gravity(g));
    simulation.particles.acceleration.fill(g);
    (simulation, g)
}

/// A lone particle moves as a point mass.
fn lonely<const D: usize>(name: &str, shape: &Approximation, lumping: f64, report: &mut Report) {
    for place in &PLACES {
        let (mut simulation, g) = lone::<D>(place, shape, lumping);
        let (start, position) = (simulation.particles.velocity[0], simulation.particles.position[0]);
        let (what, case) = (format!("{name}, D = {D}, eps = {lumping}"), place.name);
        let (mut impulse, mut residual) = (0.0, 0.0);
        let taken = steps(report, &what, case, STEPS, || {
            let step = simulation.step()?;
            residual = left_by_newton(&simulation.settings, &step);
            impulse += step.dt * residual;
            Ok::<_, StepError>(())
        });
        let particles = &simulation.particles;
        let t = f64::from(taken) * STEP;
        let velocity = (particles.velocity[0] - start - g * t).norm();
        // The error of position as a speed; the divisor covers runs without a step.
        let way = (particles.position[0] - position - start * t - g * (0.5 * t * t)).norm() / t.max(STEP);
        // If every axis is held nothing moves; the error is then relative to a speed of 1.
        let speed = if start.norm() > 0.0 { start.norm() } else { 1.0 };
        // A point has no orientation: if no node near it has mass, rotation costs nothing.
        let strain = Deformation::new(particles.displacement_gradient[0]).green_lagrange().norm();
        // v = Σ Δt (g − R/m) with m = 1; velocities and positions are rounded in each step.
        let rounding = f64::from(STEPS) * f64::EPSILON * (1.0 + position.norm() / t.max(STEP));
        let projected = if lumping < 1.0 { PROJECTED / lumping } else { 0.0 };
        let bound = impulse / speed + rounding + projected;
        at_most(report, &what, &format!("{case}: velocity, place"), worse(velocity, way) / speed, bound);
        // The remaining R is stress: Σ_I |R_I| ≥ V ‖P‖ (Σ |∇N|²)^½. With V = G = 1 the strain is half of it over a root above 0.2.
        at_most(report, &what, &format!("{case}: strain"), strain, 2.5 * residual + rounding);
    }
}

/// A particle slightly outside the box.
fn outside<const D: usize>(report: &mut Report) {
    let place = Place { name: "", at: -1e-300, axes: 1, others: 3.0 };
    let answers: Vec<_> = families().iter().map(|(_, shape)| lone::<D>(&place, shape, 1.0).0.step()).collect();
    let expected = |error: &StepError| matches!(error, StepError::ShapeFunctions(_));
    refused(report, &format!("every family, D = {D}"), "1e-300 outside", "Support", answers, expected);
}

/// One particle in the middle of each cell of a block that vibrates.
fn sparse<const D: usize>(name: &str, shape: &Approximation, lumping: f64, report: &mut Report) {
    let cells = if D == 3 { 2 } else { 3 };
    let mut simulation: Simulation<D> = bodies::block(cells, shape.clone(), STEP);
    let grid = simulation.grid;
    simulation.particles = Particles::default();
    fill(&mut simulation.particles, &grid, ([cells; D], [2 * cells; D]), 1, (0, 1.0));
    simulation.settings = settings(lumping);
    let a = Tensor::<f64, D>::from_fn(|i, k| if i == k { 0.05 - 0.04 * i as f64 } else { 0.01 });
    stir(&mut simulation, &a);
    let scale = sum_of_momenta(&simulation.particles);
    let start = simulation.particles.momentum();
    let energy: f64 = simulation.particles.velocity.iter().map(Vector::norm_squared).sum();
    let positions = simulation.particles.by_id().position;
    let (what, case) = (format!("{name}, D = {D}"), format!("eps = {lumping}"));
    let mut momentum: f64 = 0.0;
    steps(report, &what, &case, STEPS_OF_BLOCKS, || {
        simulation.step()?;
        momentum = worse(momentum, (simulation.particles.momentum() - start).norm() / scale);
        Ok::<_, StepError>(())
    });
    let moved = simulation.particles.by_id().position.into_iter().zip(positions).map(|(x, x_0)| (x - x_0).norm());
    let moved = moved.fold(0.0, worse);
    // No particle has more than the total energy, which is that of the start.
    let way = f64::from(STEPS_OF_BLOCKS) * STEP * energy.sqrt();
    at_most(report, &what, &format!("{case}: momentum"), momentum, bodies::MOMENTUM);
    at_most(report, &what, &format!("{case}: way over what energy allows"), moved / way, 1.0);
}
