//! Global balances: under gravity and a traction a body gains the momentum of its loads, and its centre moves as a point mass.
//!
//! Internal forces cancel and shape functions sum to one, so this holds exactly for any shape function and any ε. The trapezoidal rule is
//! exact for a constant force. The study detects errors that no derivative of the residual shows: in the size of the mass, the loads, the
//! updates.

use super::{Effort, Outcome, StudyError};
use crate::report::{Bound, Report};
use bfree::approximation::Approximation;
use bfree::clock::Clock;
use bfree::grid::Grid;
use bfree::material::{Lame, Material, NeoHookean};
use bfree::mechanics::loads::{Curve, Gravity, Loads, Pressing, SurfaceLoad, SurfacePoint};
use bfree::particles::{Body, Particles};
use bfree::simulation::{InitialGuess, Settings, Simulation};
use bfree::solver::{Forcing, NewtonSettings};
use bfree::tensor::Vector;

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "momentum, centre of mass and work of a body under gravity and traction, exactly";

/// The error relative to the change by the loads: Newton's method stops at 1e-14 of the forces, over a few steps.
const EXACT: f64 = 1e-12;

const SPACING: f64 = 0.5;
const STEP: f64 = 0.02;
const STEPS: u32 = 5;
const DENSITY: f64 = 2.0;
/// Factors in time of gravity and of the traction. They differ from 1, so that an omitted factor shows.
const FACTORS: [f64; 2] = [0.5, 2.0];

/// All families with a lumped mass; LME with the paper's width.
fn families() -> Vec<(&'static str, Approximation)> {
    let left_out =
        |name: &str| matches!(name, "lme 0.8" | "lme 1.8" | "lme circle 1.8") || name.starts_with("not-a-knot");
    Approximation::examples().into_iter().filter(|(name, _)| !left_out(name)).collect()
}

pub(super) fn run(_effort: &Effort) -> Result<Outcome, StudyError> {
    let mut report = Report::new(
        "a free body under gravity and traction, errors over the effect of the loads",
        &["quantity", "shape", "D", "eps"],
    )
    .as_matrix(&[0, 2], 1, 3);
    for (name, shape) in &families() {
        for lumping in [1.0, 0.3] {
            fall::<1>(name, shape, lumping, &mut report)?;
            fall::<2>(name, shape, lumping, &mut report)?;
            fall::<3>(name, shape, lumping, &mut report)?;
        }
    }
    report.note("The outermost particles lie on faces of cells: linear functions then list nodes without mass.");
    Ok(Outcome { reports: vec![report], ..Outcome::default() })
}

/// A block of particles, the outermost on faces of the grid, under gravity along every axis and a traction on one side.
fn block<const D: usize>(shape: &Approximation, lumping: f64) -> Result<Simulation<D>, StudyError> {
    let per_axis: usize = if D == 3 { 4 } else { 6 };
    let distance = 0.5 * SPACING;
    let volume = distance.powi(D as i32);
    let gravity = Vector::from_fn(|k, _| 8.0 - 3.0 * k as f64);
    let traction = Vector::from_fn(|k, _| 1.0 + k as f64);
    let mut particles = Particles::<D>::default();
    let mut points = Vec::new();
    for p in 0..per_axis.pow(D as u32) {
        let index: [usize; D] = std::array::from_fn(|k| p / per_axis.pow(k as u32) % per_axis);
        let position = Vector::from_fn(|k, _| (7 + index[k]) as f64 * distance);
        particles.push(position, Vector::from_fn(|k, _| 0.5 - 0.2 * k as f64), volume, DENSITY * volume, 0);
        if index[0] == per_axis - 1 {
            let normal = Vector::from_fn(|k, _| if k == 0 { 1.0 } else { 0.0 });
            points.push(SurfacePoint::new(p, normal, 0.7 * distance.powi(D as i32 - 1)));
        }
    }
    let loads = Loads {
        gravity: Some(Gravity { acceleration: gravity, curve: Curve::constant(FACTORS[0]) }),
        surface: vec![SurfaceLoad {
            pressing: Pressing::Traction(traction),
            curve: Curve::constant(FACTORS[1]),
            points,
        }],
        ..Loads::default()
    };
    let law = Material::from(NeoHookean::ciarlet(Lame::from_young_poisson(1000.0, 0.3)?));
    let grid = Grid { origin: Vector::zeros(), spacing: SPACING, cells: [12; D] };
    let bodies = vec![Body { name: "block".into(), law, density: DENSITY, dilatation: Default::default(), field: 0 }];
    Ok(Simulation {
        loads,
        settings: Settings {
            lumping,
            initial_guess: InitialGuess::Velocity,
            newton: NewtonSettings {
                relative_tolerance: 1e-14,
                forcing: Forcing::Fixed(1e-6),
                ..NewtonSettings::default()
            },
            ..Settings::default()
        },
        ..Simulation::new(grid, shape.clone(), bodies, particles, Clock::new(STEP, 0))
    })
}

/// Σ m x / Σ m
fn centre<const D: usize>(particles: &Particles<D>, mass: f64) -> Vector<f64, D> {
    particles.position.iter().zip(&particles.mass).map(|(x, &m)| x * m).sum::<Vector<f64, D>>() / mass
}

fn fall<const D: usize>(
    name: &str,
    shape: &Approximation,
    lumping: f64,
    report: &mut Report,
) -> Result<(), StudyError> {
    let mut simulation = block::<D>(shape, lumping)?;
    let mass: f64 = simulation.particles.mass.iter().sum();
    let mut force: Vector<f64, D> = Vector::zeros();
    if let Some(gravity) = &simulation.loads.gravity {
        force += gravity.acceleration * (FACTORS[0] * mass);
    }
    for load in &simulation.loads.surface {
        if let Pressing::Traction(traction) = load.pressing {
            force += load.points.iter().map(|point| traction * (FACTORS[1] * point.area)).sum::<Vector<f64, D>>();
        }
    }
    // The rule takes a_n from the step before, so the first step must start with the acceleration of the loads.
    simulation.particles.acceleration.fill(force / mass);
    let (x, v) = (centre(&simulation.particles, mass), simulation.particles.velocity[0]);
    for _ in 0..STEPS {
        simulation.step()?;
    }
    let t = STEP * f64::from(STEPS);
    let momentum = simulation.particles.momentum() - v * mass - force * t;
    let moved = centre(&simulation.particles, mass) - x - v * t - force * (0.5 * t * t / mass);
    let accelerated: Vector<f64, D> =
        simulation.particles.acceleration.iter().zip(&simulation.particles.mass).map(|(a, &m)| a * m).sum();
    let (dimension, eps) = (D.to_string(), lumping.to_string());
    let mut push =
        |quantity: &str, value: f64| report.push(&[quantity, name, &dimension, &eps], value, Bound::AtMost(EXACT));
    push("m v = m v_0 + f t", momentum.norm() / (force.norm() * t));
    push("x = x_0 + v_0 t + f t^2 / 2m", moved.norm() * mass / (0.5 * force.norm() * t * t));
    push("m a = f", (accelerated - force).norm() / force.norm());
    Ok(())
}
