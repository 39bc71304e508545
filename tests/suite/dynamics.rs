//! Five steps of 36 jittered particles in a corner, against an independent program (tests/reference/dynamics.json).

use crate::support::{Failure, body};
use bfree::approximation::{Approximation, Linear, Lme, LmeCircle};
use bfree::clock::Clock;
use bfree::grid::Grid;
use bfree::material::{Lame, Material, NeoHookean};
use bfree::mechanics::loads::{Curve, Gravity, Loads, Motion, Prescribed, Selection};
use bfree::particles::Particles;
use bfree::simulation::{Settings, Simulation};
use bfree::solver::{Forcing, NewtonSettings};
use bfree::tensor::{Tensor, Vector};
use serde_json::Value;
use std::num::NonZeroU64;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn vectors(value: &Value) -> Vec<Vector<f64, 2>> {
    value.as_array().into_iter().flatten().map(|x| Vector::from([number(&x[0]), number(&x[1])])).collect()
}

fn wall(name: &str, axis: usize) -> Prescribed<2> {
    let mut motion = [None, None];
    motion[axis] = Some(Motion::Rest);
    Prescribed { name: name.into(), on: Selection::Face { axis, upper: false }, motion }
}

fn corner(reference: &Value, approximation: Approximation) -> Result<Simulation<2>, Failure> {
    let lame = Lame::new(number(&reference["Lambda"]), number(&reference["G"]))?;
    let (density, volume) = (number(&reference["rho0"]), number(&reference["V0"]));
    let mut particles = Particles::default();
    for (x, v) in vectors(&reference["x0"]).into_iter().zip(vectors(&reference["v0"])) {
        particles.push(x, v, volume, density * volume, 0);
    }
    let gravity = Vector::from([number(&reference["gravity"][0]), number(&reference["gravity"][1])]);
    let grid = Grid { origin: Vector::zeros(), spacing: 0.5, cells: [12, 10] };
    let bodies = vec![body(Material::from(NeoHookean::ciarlet(lame)))];
    Ok(Simulation {
        loads: Loads {
            gravity: Some(Gravity { acceleration: gravity, curve: Curve::constant(1.0) }),
            prescribed: vec![wall("left", 0), wall("bottom", 1)],
            ..Loads::default()
        },
        settings: Settings {
            // Tight tolerances, so that every iterate equals that of a direct solver.
            newton: NewtonSettings { relative_tolerance: 3e-14, forcing: Forcing::Fixed(1e-13), ..Default::default() },
            check_tangent: NonZeroU64::new(1),
            ..Settings::default()
        },
        ..Simulation::new(grid, approximation, bodies, particles, Clock::new(number(&reference["dt"]), 0))
    })
}

#[test]
fn five_steps_agree_with_an_independent_program() -> Result<(), Failure> {
    let reference: Value = serde_json::from_str(include_str!("../reference/dynamics.json"))?;
    for run in reference["runs"].as_array().into_iter().flatten() {
        let shape = run["shape"].as_str().unwrap_or_default();
        let gamma = number(&run["gamma_lme"]);
        let approximation = match shape {
            "Q4" => Linear.into(),
            "LME_circle" => LmeCircle::new(gamma, 1e-6).into(),
            _ => Lme::new(gamma, 1e-6).into(),
        };
        let mut simulation = corner(&reference, approximation)?;
        for (step, expected) in run["residuals"].as_array().into_iter().flatten().enumerate() {
            let report = simulation.step()?;
            let history = &report.newton.history;
            let norms = history.first_residual.into_iter().chain(history.iterations.iter().map(|it| it.residual));
            let scale = number(&expected[0]);
            for (k, (norm, expected)) in norms.zip(expected.as_array().into_iter().flatten()).enumerate() {
                let expected = number(expected);
                let bound = 1e-6 * expected + 1e-14 * scale;
                let what = format!("{shape}, step {step}, iteration {k}: {norm:e} instead of {expected:e}");
                assert!((norm - expected).abs() <= bound, "{what}");
            }
            let energies = &run["energies"][step];
            let (kinetic, strain) = (simulation.particles.kinetic_energy(), simulation.strain_energy());
            assert!((kinetic - number(&energies[0])).abs() < 1e-9, "{shape}, step {step}: kinetic {kinetic}");
            assert!((strain - number(&energies[1])).abs() < 1e-9, "{shape}, step {step}: strain {strain}");
            if step == 4 {
                assert_eq!(report.active_nodes as f64, number(&run["active_last"]), "{shape}: active nodes");
            }
        }
        let particles = simulation.particles.by_id();
        for (name, ours, theirs, scale) in [
            ("x", &particles.position, vectors(&run["x"]), 1.0),
            ("v", &particles.velocity, vectors(&run["v"]), 1.0),
            ("a", &particles.acceleration, vectors(&run["a"]), 20.0),
        ] {
            for (p, (ours, theirs)) in ours.iter().zip(theirs).enumerate() {
                let difference = (ours - theirs).amax();
                assert!(difference < 1e-9 * scale, "{shape}: {name} of particle {p} differs by {difference:e}");
            }
        }
        for (p, h) in particles.displacement_gradient.iter().enumerate() {
            let expected = Tensor::<f64, 2>::from_fn(|i, k| number(&run["F"][p][i][k]) - f64::from(i == k));
            assert!((h - expected).amax() < 1e-9, "{shape}: F of particle {p}");
        }
    }
    Ok(())
}

/// ω of the first mode of Timoshenko's cantilever of 8 × 1 in plane strain, E = 1000, ν = 0.3, ρ = 1: the root of the determinant of its
/// transfer matrix, with the shear coefficient 10 (1 + ν')/(12 + 11 ν'), ν' = ν/(1 − ν).
const TIMOSHENKO: f64 = 0.518_973_722_897;

/// Ten periods of a cantilever under its weight: the energy balance over the largest energy, and the error of the period.
fn vibrated(settings: &[&str]) -> Result<[f64; 2], Failure> {
    let text = r#"{"grid": {"size": [10, 4], "spacing": 0.25}, "time": {"step": 0.1, "end": 121},
             "bodies": [{"name": "beam", "shape": {"box": {"min": [0, 1.5], "max": [8, 2.5]}}, "density": 1,
                         "material": {"neo_hookean": {"young": 1000, "poisson": 0.3}}}],
             "boundary": {"left": "fixed"}, "gravity": {"acceleration": [0, -1e-3]}}"#;
    let settings = settings.iter().map(|one| one.parse()).collect::<Result<Vec<_>, _>>()?;
    let mut simulation = bfree::scene::read(text, &settings)?.build::<2>(".".as_ref())?;
    let reference = bfree::output::Reference::of(&simulation);
    let (mut before, mut turns, mut largest) = (0.0, Vec::new(), 0.0_f64);
    let mut balance = 0.0;
    while simulation.clock.time() < 121.0 - 1e-9 {
        let step = simulation.advance()?;
        let (time, momentum) = (simulation.clock.time(), simulation.particles.momentum()[1]);
        if before * momentum < 0.0 {
            turns.push(time - step.dt * momentum / (momentum - before));
        }
        before = momentum;
        let energies = bfree::output::history::Energies::of(&simulation, &reference);
        (largest, balance) = (largest.max(energies.total), energies.balance);
    }
    let [first, .., last] = turns[..] else { return Err("it does not vibrate".into()) };
    assert!(turns.len() >= 19, "{turns:?}");
    let period = 2.0 * (last - first) / (turns.len() - 1) as f64;
    Ok([balance / largest, period * TIMOSHENKO / std::f64::consts::TAU - 1.0])
}

#[test]
fn a_cantilever_that_vibrates_keeps_its_energy_and_its_frequency_by_default() -> Result<(), Failure> {
    let [balance, period] = vibrated(&[])?;
    assert!(balance.abs() < 5e-3 && period.abs() < 3e-3, "{balance} {period}");
    // The manual describes a grid that is reset in every step; a run warns of it.
    let [balance, period] = vibrated(&[r#"grid.reset="every_step""#])?;
    assert!((balance + 0.025).abs() < 0.002 && (period - 0.009).abs() < 0.001, "{balance} {period}");
    Ok(())
}
