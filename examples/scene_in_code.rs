//! A scene in code: a square falls 1 m onto a floor.
//!
//! A JSON scene sets the fields of [`Simulation`]: grid, shape functions, bodies, particles, loads, settings. The example checks two facts
//! of mechanics, exact to the tolerance of Newton's method. While the body is free, the centre of mass follows ½ g t². At the end, weight
//! and floor have given the body its momentum, p = m g t + Σ R Δt.
//!
//! `cargo run --release --features examples --example scene_in_code`

use bfree::approximation::{Approximation, Lme};
use bfree::clock::Clock;
use bfree::grid::Grid;
use bfree::material::{Lame, Material, NeoHookean};
use bfree::mechanics::loads::{Curve, Gravity, Loads, Motion, Prescribed, Selection};
use bfree::particles::{Body, Particles};
use bfree::shape::{Block, Filling, fill};
use bfree::simulation::{Settings, Simulation};
use bfree::solver::NewtonSettings;
use bfree::tensor::Vector;
use std::error::Error;

const GRAVITY: f64 = -10.0;
const DENSITY: f64 = 1000.0;

/// A square of 1 m, 1 m above the floor of a box of 3 m × 3 m.
pub fn square() -> Result<Simulation<2>, Box<dyn Error>> {
    let grid = Grid { origin: Vector::zeros(), spacing: 0.25, cells: [12, 12] };
    let shape = Block { min: Vector::from([1.0, 1.0]), max: Vector::from([2.0, 2.0]) }.into();
    let mut particles = Particles::default();
    for seed in fill(&grid, &shape, Filling { per_axis: 2, ..Filling::default() })? {
        particles.push(seed.position, Vector::zeros(), seed.volume, DENSITY * seed.volume, 0);
    }
    let law = Material::from(NeoHookean::ciarlet(Lame::from_young_poisson(1e6, 0.3)?));
    let floor = Prescribed {
        name: "floor".into(),
        on: Selection::Face { axis: 1, upper: false },
        motion: [None, Some(Motion::Rest)],
    };
    let gravity = Gravity { acceleration: Vector::from([0.0, GRAVITY]), curve: Curve::constant(1.0) };
    let bodies = vec![Body { name: "square".into(), law, density: DENSITY, dilatation: Default::default(), field: 0 }];
    let mut simulation = Simulation {
        loads: Loads { gravity: Some(gravity), prescribed: vec![floor], ..Loads::default() },
        settings: Settings {
            newton: NewtonSettings { relative_tolerance: 1e-10, ..NewtonSettings::default() },
            ..Settings::default()
        },
        ..Simulation::new(grid, Approximation::from(Lme::new(3.0, 1e-6)), bodies, particles, Clock::new(0.01, 10))
    };
    // Gravity acts from t = 0 on.
    simulation.set_initial_acceleration()?;
    Ok(simulation)
}

/// Drops the square, and checks the fall and the impact.
pub fn main() -> Result<(), Box<dyn Error>> {
    let mut simulation = square()?;
    let mass: f64 = simulation.particles.mass.iter().sum();
    let height = |simulation: &Simulation<2>| {
        let particles = &simulation.particles;
        particles.mass.iter().zip(&particles.position).map(|(m, x)| m * x[1]).sum::<f64>() / mass
    };
    let (start, mut impulse, mut lowest) = (height(&simulation), 0.0, f64::INFINITY);
    while simulation.clock.time() < 0.8 {
        let step = simulation.advance()?;
        let (t, fallen) = (simulation.clock.time(), height(&simulation) - start);
        // Until t = 0.2 no particle has a node of the floor in its connectivity.
        if t <= 0.2 {
            let free = 0.5 * GRAVITY * t * t;
            assert!((fallen - free).abs() < 1e-9 * free.abs(), "t = {t}: {fallen}, not {free}");
        }
        impulse += step.reactions[0].force[1] * step.dt;
        lowest = lowest.min(start + fallen);
    }
    let (t, momentum) = (simulation.clock.time(), simulation.particles.momentum()[1]);
    let given = mass * GRAVITY * t + impulse;
    println!(
        "at t = {t}: momentum {momentum:.3}, weight and floor have given {given:.3}; the centre was at {lowest:.3} m at its lowest"
    );
    assert!((momentum - given).abs() < 1e-9 * mass * GRAVITY.abs() * t, "{momentum} and {given}");
    assert!(impulse > 0.0 && lowest < start - 0.5);
    Ok(())
}
