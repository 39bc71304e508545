//! One problem in other units: powers of two give the same bits, powers of ten the same dimensionless answer.

use super::bodies::{body, fill, normal, settings, simulation};
use super::{Report, StudyError, rows, solvable, worse};
use bfree::approximation::Lme;
use bfree::grid::Grid;
use bfree::material::Lame;
use bfree::mechanics::loads::{Curve, Gravity, Motion, Pressing, SurfaceLoad, SurfacePoint};
use bfree::particles::Particles;
use bfree::simulation::Simulation;
use bfree::tensor::{Tensor, Vector};

/// Steps over which answers are compared.
const STEPS: u32 = 10;

/// The requirement of the issue: inputs are rounded elsewhere, and the answers are compared after some steps.
const DIMENSIONLESS: f64 = 1e-12;

/// A unit of length, of mass and of time, in plain units.
#[derive(Clone, Copy)]
struct Units {
    length: f64,
    mass: f64,
    time: f64,
}

const ONE: Units = Units { length: 1.0, mass: 1.0, time: 1.0 };

/// The way in which units are made large and small.
#[derive(Clone, Copy)]
struct Scaling {
    name: &'static str,
    large: f64,
}

pub(super) fn run() -> Result<Report, StudyError> {
    let mut report =
        rows("units of length, mass and time: numbers that have other bits, or the largest dimensionless difference");
    let two = Scaling { name: "2^30", large: 2.0_f64.powi(30) };
    let ten = Scaling { name: "1e9", large: 1e9 };
    dimension::<1>([two, ten], &mut report)?;
    dimension::<2>([two, ten], &mut report)?;
    dimension::<3>([two, ten], &mut report)?;
    Ok(report)
}

fn dimension<const D: usize>([two, ten]: [Scaling; 2], report: &mut Report) -> Result<(), StudyError> {
    let plain = answer::<D>(ONE)?;
    let what = format!("a pressed block under gravity, D = {D}");
    for signs in 0..8_u32 {
        let power = |scaling: Scaling, bit: u32| {
            if signs >> bit & 1 == 1 { scaling.large.recip() } else { scaling.large }
        };
        let units = |scaling| Units { length: power(scaling, 0), mass: power(scaling, 1), time: power(scaling, 2) };
        let case = |scaling: Scaling| {
            let sign = |bit: u32| if signs >> bit & 1 == 1 { "/" } else { "*" };
            format!("length {}, mass {}, time {} {}", sign(0), sign(1), sign(2), scaling.name)
        };
        let bits = answer::<D>(units(two))
            .map(|other| plain.iter().zip(&other).filter(|(a, b)| a.0.to_bits() != b.0.to_bits()).count() as f64);
        solvable(report, &what, &case(two), bits, 0.0);
        let difference = answer::<D>(units(ten))
            .map(|other| plain.iter().zip(&other).fold(0.0, |worst, (a, b)| worse(worst, (a.0 - b.0).abs() / a.1)));
        solvable(report, &what, &case(ten), difference, DIMENSIONLESS);
    }
    Ok(())
}

/// The answer without units, each number with its reference size.
fn answer<const D: usize>(units: Units) -> Result<Vec<(f64, f64)>, StudyError> {
    let Units { length, time, .. } = units;
    let mut simulation = problem::<D>(units)?;
    for _ in 0..STEPS {
        simulation.step()?;
    }
    let particles = simulation.particles.by_id();
    // Sizes of the problem in plain units: the box, the speed and acceleration from the loads, a strain of 1.
    let vectors = |list: &[Vector<f64, D>], unit: f64, size: f64| {
        list.iter().flat_map(|x| x.iter().map(|x| (x / unit, size)).collect::<Vec<_>>()).collect::<Vec<_>>()
    };
    let mut numbers = vectors(&particles.position, length, 1.0);
    numbers.extend(vectors(&particles.velocity, length / time, 1.0));
    numbers.extend(vectors(&particles.acceleration, length / (time * time), 10.0));
    numbers.extend(
        particles
            .displacement_gradient
            .iter()
            .flat_map(|h: &Tensor<f64, D>| h.iter().map(|x| (*x, 1.0)).collect::<Vec<_>>()),
    );
    Ok(numbers)
}

/// A block in a corner, under growing gravity and a pressure on one side; half of the mass is consistent.
fn problem<const D: usize>(units: Units) -> Result<Simulation<D>, StudyError> {
    let Units { length, mass, time } = units;
    let grid = Grid { origin: Vector::repeat(0.25 * length), spacing: 0.5 * length, cells: [5; D] };
    let mut particles = Particles::default();
    fill(&mut particles, &grid, ([0; D], [3; D]), 2, (0, 0.0));
    particles.mass.fill(0.5 * mass);
    // Force per area: mass × length / time² per length^(D−1).
    let stress = mass * length / (time * time) / length.powi(D as i32 - 1);
    let density = 0.5 * mass / particles.volume[0];
    let lame = Lame::new(300.0 * stress, 200.0 * stress)?;
    let dt = 0.03 * time;
    let right = (0..particles.len()).filter(|&p| particles.position[p][0] > 1.5 * length);
    let normal_x = Vector::from_fn(|k, _| if k == 0 { 1.0 } else { 0.0 });
    let area = (0.25 * length).powi(D as i32 - 1);
    let points = right.map(|particle| SurfacePoint::new(particle, normal_x, area)).collect();
    let mut simulation = simulation(grid, Lme::new(3.0, 1e-6).into(), particles, vec![body(lame, density)], dt);
    simulation.settings = settings(0.5);
    simulation.loads.gravity = Some(Gravity {
        acceleration: Vector::from_fn(|k, _| -1.0 - k as f64) * (length / (time * time)),
        curve: Curve::new(vec![[0.0, 0.5], [0.2 * time, 1.0]])?,
    });
    simulation.loads.surface =
        vec![SurfaceLoad { pressing: Pressing::Pressure(10.0 * stress), curve: Curve::constant(1.0), points }];
    simulation.loads.prescribed = (0..D).map(|axis| normal(axis, false, Motion::Rest)).collect();
    simulation.set_initial_acceleration()?;
    Ok(simulation)
}
