//! One particle, one particle a cell, nodes of mass 1e-300, and a consistent mass that is singular: whole steps of free fall.

use super::bodies::{self, PLAIN, body, fill, gravity, left_by_newton, normal, settings, simulation, stir, sum_of_momenta};
use super::{Outcome, Report, refused, rows, solvable, worse};
use crate::report::chain;
use bfree::approximation::{Approximation, Bspline, Gimp, Linear, Lme};
use bfree::grid::Grid;
use bfree::mechanics::loads::Motion;
use bfree::particles::Particles;
use bfree::simulation::{InitialGuess, Simulation, StepError};
use bfree::solver::NewtonSettings;
use bfree::tensor::{Deformation, Tensor, Vector};

const STEPS: u32 = 5;
const STEP: f64 = 0.1;

/// The projection (42) is solved to 1e-12, of velocity and of acceleration; M̃ ≥ ε M_L makes no more than 1/ε of it.
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

/// Where a lone particle starts, in cells: the first `axes` coordinates, and the others. At the hull those first ones are held.
struct Place {
    name: &'static str,
    at: f64,
    axes: usize,
    others: f64,
}

const HARDLY_OFF: f64 = 1e-13;

/// 1e-300 and 1e-13 off the hull nodes have so much of the particle's mass: less and more than what counts as light.
const PLACES: [Place; 7] = [
    Place { name: "in a cell", at: 2.3, axes: 1, others: 3.6 },
    Place { name: "on a face of a cell", at: 3.0, axes: 1, others: 3.6 },
    Place { name: "on a node", at: 3.0, axes: 1, others: 3.0 },
    Place { name: "on the hull", at: 0.0, axes: 1, others: 3.6 },
    Place { name: "on two faces of the hull", at: 0.0, axes: 2, others: 3.6 },
    Place { name: "1e-300 off the hull", at: 1e-300, axes: 1, others: 3.0 },
    Place { name: "1e-13 off the hull", at: HARDLY_OFF, axes: 1, others: 3.0 },
];

pub(super) fn run(outcome: &mut Outcome) {
    let mut alone = rows("a lone particle in free fall: errors of velocity and place over its speed, and what it is strained");
    let mut blocks = rows("one particle a cell: change of the linear momentum over sum m |v|");
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
        "eps = 0 and one particle in the middle of each cell, D = 3: with functions over two nodes a cell and axis a cell has 8 nodes and 4 \
         conditions, N and its gradient; hourglass patterns have neither mass nor stiffness. The first step has a solution, since no \
         force acts along them. Afterwards, as particles leave the middle, force is of first and stiffness of second order in how far: \
         displacements of many cells, or Newton's method ends with an error. Any eps > 0 gives them mass."
            .into(),
    );
}

/// A single particle that starts at `place`, at rest along axes that are held.
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
    // From Δφ = 0 nodes with hardly any mass would have to be found by finite rotations.
    simulation.settings.initial_guess = InitialGuess::Velocity;
    // On the hull round-off alone would take it out of the box.
    simulation.loads.prescribed = (0..D).filter(|&k| held(k)).map(|k| normal(k, false, Motion::Rest)).collect();
    // Nodes with 1e-13 of the mass make a condition of 1e13: GMRES ends at some 1e-11 of the first residual, so that Newton's method is
    // asked for what a scene asks by itself.
    if place.at == HARDLY_OFF {
        simulation.settings.newton.relative_tolerance = NewtonSettings::default().relative_tolerance;
    }
    let g = Vector::from_fn(|k, _| if held(k) { 0.0 } else { -0.2 });
    simulation.loads.gravity = Some(gravity(g));
    simulation.particles.acceleration.fill(g);
    (simulation, g)
}

/// A lone particle flies as a mass point.
fn lonely<const D: usize>(name: &str, shape: &Approximation, lumping: f64, report: &mut Report) {
    for place in &PLACES {
        let (mut simulation, g) = lone::<D>(place, shape, lumping);
        let (start, position) = (simulation.particles.velocity[0], simulation.particles.position[0]);
        let (mut impulse, mut residual) = (0.0, 0.0);
        let flown = (0..STEPS).try_for_each(|_| {
            let step = simulation.step()?;
            residual = left_by_newton(&simulation.settings, &step);
            impulse += step.dt * residual;
            Ok::<_, StepError>(())
        });
        let particles = &simulation.particles;
        let t = f64::from(STEPS) * STEP;
        let velocity = (particles.velocity[0] - start - g * t).norm();
        let way = (particles.position[0] - position - start * t - g * (0.5 * t * t)).norm() / t;
        // Where all is held nothing moves: the error is then that of a speed of 1.
        let speed = if start.norm() > 0.0 { start.norm() } else { 1.0 };
        // A point has no orientation: where no node near it has mass, rotation costs nothing.
        let strain = Deformation::new(particles.displacement_gradient[0]).green_lagrange().norm();
        let (what, case) = (format!("{name}, D = {D}, eps = {lumping}"), place.name);
        // v = Σ Δt (g − R/m), m being 1; velocities and places are rounded in each step.
        let rounding = f64::from(STEPS) * f64::EPSILON * (1.0 + position.norm() / t);
        let projected = if lumping < 1.0 { PROJECTED / lumping } else { 0.0 };
        let bound = impulse / speed + rounding + projected;
        let flown = flown.map(|()| (worse(velocity, way) / speed, strain)).map_err(|error| chain(&error));
        solvable(report, &what, &format!("{case}: velocity, place"), flown.clone().map(|errors| errors.0), bound);
        // What R is left over is stress: Σ_I |R_I| ≥ V ‖P‖ (Σ |∇N|²)^½, with V = G = 1 a strain of half of it over a root above 0.2.
        solvable(report, &what, &format!("{case}: strain"), flown.map(|errors| errors.1), 2.5 * residual + rounding);
    }
}

/// A hair outside of the box.
fn outside<const D: usize>(report: &mut Report) {
    let place = Place { name: "", at: -1e-300, axes: 1, others: 3.0 };
    let answers: Vec<_> = families().iter().map(|(_, shape)| lone::<D>(&place, shape, 1.0).0.step()).collect();
    let expected = |error: &StepError| matches!(error, StepError::Support(_));
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
    // See the remark: of hourglass patterns that nothing resists, one step is what has a solution.
    let two_nodes = matches!(name, "linear" | "gimp" | "quadratic");
    let (steps, case) = if D == 3 && lumping == 0.0 && two_nodes { (1, "the first step") } else { (STEPS, "5 steps") };
    let flown = (0..steps).try_fold(0.0, |worst, _| {
        simulation.step()?;
        Ok::<_, StepError>(worse(worst, (simulation.particles.momentum() - start).norm() / scale))
    });
    solvable(report, &format!("{name}, D = {D}"), &format!("eps = {lumping}: {case}"), flown, bodies::MOMENTUM);
}
