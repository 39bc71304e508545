//! The energy–momentum scheme, from scenes. Long runs and the tangent are in the study `energy`.

use crate::damping::bar;
use crate::support::{Failure, assert_refused, built, merged, scene, solid, with};
use bfree::material::{Lame, NeoHookean};
use bfree::mechanics::loads::Rayleigh;
use bfree::mechanics::reference::GridReset;
use bfree::mechanics::schemes::EnergyMomentum;
use bfree::particles::Dilatation;
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use serde_json::{Value, json};
use std::num::NonZeroU64;
use std::sync::Arc;

/// The cylinder of `rebound.json`, which stays in its place and spins and rings, on a grid that is kept.
fn ringing(scheme: &str, step: f64) -> Result<Simulation<2>, Failure> {
    let (scheme, step) = (format!("time.scheme={scheme}"), format!("time.step={step}"));
    let kept = ["grid.reset=\"never\"", "time.lumping=0", "time.beta=null", "time.gamma=null", &scheme, &step];
    let mut simulation = scene::<2>("rebound.json", &kept)?;
    simulation.set_velocity_on_nodes(|x| {
        let x = x - Vector::from([2.5, 2.5]);
        Vector::from([-x[1], x[0]]) * 2.0 + Vector::from([x[0], -x[1]])
    })?;
    simulation.settings.newton.relative_tolerance = 1e-14;
    Ok(simulation)
}

/// Energy and angular momentum around the origin.
fn conserved(simulation: &Simulation<2>) -> [f64; 2] {
    let of = &simulation.particles;
    let moment =
        |p: usize| of.mass[p] * (of.position[p][0] * of.velocity[p][1] - of.position[p][1] * of.velocity[p][0]);
    [of.kinetic_energy() + simulation.strain_energy(), (0..of.len()).map(moment).sum()]
}

#[test]
fn energy_and_angular_momentum_do_not_change_in_steps_that_the_midpoint_rule_does_not_survive() -> Result<(), Failure> {
    let midpoint = r#"{"generalized_alpha": {"spectral_radius": 1}}"#;
    let mut simulation = ringing("\"energy_momentum\"", 0.2)?;
    simulation.settings.check_tangent = NonZeroU64::new(1);
    let start = conserved(&simulation);
    for n in 1..=60 {
        simulation.step()?;
        let change = |k: usize| (conserved(&simulation)[k] / start[k] - 1.0).abs();
        assert!(change(0) < 1e-11 && change(1) < 1e-11, "step {n}: {:e}, {:e}", change(0), change(1));
    }
    let mut other = ringing(midpoint, 0.2)?;
    assert!((0..60).any(|_| other.step().is_err()), "the midpoint rule survives these steps");
    Ok(())
}

/// A nearly incompressible cylinder whose cells average the dilatation, with the tangent checked in each step, and a reset on the way.
#[test]
fn cells_with_one_dilatation_keep_energy_too() -> Result<(), Failure> {
    let mut simulation = ringing("\"energy_momentum\"", 0.1)?;
    simulation.bodies[0].law = NeoHookean::ciarlet(Lame::from_young_poisson(80.0, 0.499)?).into();
    simulation.bodies[0].dilatation = Dilatation::MeanDilatation;
    simulation.settings.check_tangent = NonZeroU64::new(1);
    // A body that feels a wall resets the grid in every step.
    simulation.loads.prescribed.clear();
    for part in 0..2 {
        simulation.settings.grid_reset = GridReset::EveryStep;
        simulation.step()?;
        // This step still begins with a new grid, which takes some energy.
        simulation.settings.grid_reset = GridReset::Never;
        simulation.step()?;
        let start = conserved(&simulation);
        for n in 1..=20 {
            simulation.step()?;
            let change = |k: usize| (conserved(&simulation)[k] / start[k] - 1.0).abs();
            assert!(change(0) < 1e-11 && change(1) < 1e-11, "{part}, step {n}: {:e}, {:e}", change(0), change(1));
        }
    }
    let of = &simulation.particles;
    assert!((0..of.len()).any(|p| (of.dilatation[p] - of.state(p, 0.0).j).abs() > 1e-4), "one dilatation a cell");
    Ok(())
}

#[test]
fn it_is_of_second_order() -> Result<(), Failure> {
    // A bar between two walls swings in its lowest mode, with strains up to a third.
    let after = |steps: u32| -> Result<Vec<Vector<f64, 1>>, Failure> {
        let mut simulation = bar(16, 0.5 / f64::from(steps), Rayleigh { mass: 0.0, stiffness: 0.0 }, 0.3, false)?;
        simulation.settings.scheme = Arc::new(EnergyMomentum);
        simulation.settings.grid_reset = GridReset::Never;
        for _ in 0..steps {
            simulation.step()?;
        }
        Ok(simulation.particles.by_id().position.to_vec())
    };
    let (coarse, middle, fine) = (after(20)?, after(40)?, after(80)?);
    let apart =
        |a: &[Vector<f64, 1>], b: &[Vector<f64, 1>]| a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    let ratio = apart(&coarse, &middle) / apart(&middle, &fine);
    // The next term of the error is smaller by Δt².
    assert!((ratio - 4.0).abs() < 0.2, "{ratio}");
    Ok(())
}

#[test]
fn energy_is_kept_in_contact_with_friction_and_moving_obstacles() -> Result<(), Failure> {
    // A square falls onto a belt that runs against it, slides and bounces.
    let belt = json!({ "name": "belt", "shape": { "half_space": { "point": [0, 0.5], "normal": [0, 1] } }, "friction": 0.3,
                       "velocity": [[0, [-1, 0]], [1, [-1, 0]]] });
    let square = json!({ "box": { "min": [1, 0.52], "max": [1.5, 1.02] } });
    let square = merged(solid("square", 1000, square), json!({ "velocity": [2, -1] }));
    let mut scene = merged(falling(), json!({ "obstacles": [belt], "bodies": [square] }));
    scene["grid"] = json!({ "size": [4, 2], "spacing": 0.125, "reset": "never" });
    scene["gravity"] = json!({ "acceleration": [0, -5] });
    scene["time"]["step"] = json!(0.004);
    let mut simulation: Simulation<2> = built(&scene)?;
    simulation.settings.newton.relative_tolerance = 1e-13;
    let balance = |of: &Simulation<2>| {
        of.particles.kinetic_energy() + of.strain_energy() + of.contact_energy() + of.dissipated - of.external_work
    };
    let (start, mut touched) = (balance(&simulation), false);
    while simulation.clock.time() < 0.2 {
        touched |= simulation.advance()?.touches();
    }
    let error = (balance(&simulation) / start - 1.0).abs();
    assert!(touched && simulation.dissipated > 0.01 * start && error < 1e-11, "{error:e}");
    Ok(())
}

#[test]
fn the_work_of_a_plate_that_pushes_a_body_is_its_energy() -> Result<(), Failure> {
    let square = solid("square", 1000, json!({ "box": { "min": [0.5, 0.55], "max": [1, 1.05] } }));
    let plate = json!({ "name": "plate", "shape": { "half_space": { "point": [0.49, 0], "normal": [1, 0] } },
                        "velocity": [[0, [0, 0]], [0.1, [2, 0.5]]] });
    let mut scene = merged(falling(), json!({ "obstacles": [plate], "bodies": [square] }));
    scene["grid"] = json!({ "size": [4, 2], "spacing": 0.125, "reset": "never" });
    scene["time"]["step"] = json!(0.005);
    let mut simulation: Simulation<2> = built(&scene)?;
    simulation.settings.newton.relative_tolerance = 1e-13;
    let (mut touched, mut most) = (0, 0.0_f64);
    while simulation.clock.time() < 0.2 {
        touched += u32::from(simulation.advance()?.touches());
        let energy = simulation.particles.kinetic_energy() + simulation.strain_energy() + simulation.contact_energy();
        most = most.max((energy - simulation.external_work).abs());
    }
    let work = simulation.external_work;
    assert!(touched > 5 && work > 0.01 && most < 1e-10 * work, "{touched} steps: {most:e} of {work}");
    Ok(())
}

#[test]
fn the_work_of_a_moving_wall_closes_the_balance() -> Result<(), Failure> {
    let square = solid("square", 1000, json!({ "box": { "min": [0, 0], "max": [1, 1] } }));
    let pulled = json!({ "left": { "velocity": [[0, [0, 0]], [0.1, [0, 2]]] } });
    let mut scene = merged(falling(), json!({ "bodies": [square], "boundary": pulled }));
    scene["grid"] = json!({ "size": [4, 2], "spacing": 0.125, "reset": "never" });
    let mut simulation: Simulation<2> = built(&scene)?;
    simulation.settings.newton.relative_tolerance = 1e-13;
    while simulation.clock.time() < 0.2 {
        simulation.step()?;
    }
    let stored = simulation.particles.kinetic_energy() + simulation.strain_energy();
    let error = (stored / simulation.external_work - 1.0).abs();
    assert!(stored > 0.1 && error < 1e-10, "{error:e} of {stored}");
    Ok(())
}

#[test]
fn a_smooth_drum_that_turns_is_a_drum_at_rest() -> Result<(), Failure> {
    let after = |motion: Value| -> Result<Vec<Vector<f64, 2>>, Failure> {
        let drum = json!({ "name": "drum", "shape": { "ball": { "center": [1.3, 0.4], "radius": 0.4 } } });
        let square = json!({ "box": { "min": [1, 0.81], "max": [1.5, 1.31] } });
        let square = merged(solid("square", 1000, square), json!({ "velocity": [0.1, -1] }));
        let mut scene = merged(falling(), json!({ "obstacles": [merged(drum, motion)], "bodies": [square] }));
        scene["grid"] = json!({ "size": [4, 2], "spacing": 0.125, "reset": "never" });
        let mut simulation: Simulation<2> = built(&scene)?;
        let mut touched = false;
        for _ in 0..15 {
            touched |= simulation.step()?.touches();
        }
        assert!(touched);
        Ok(simulation.particles.by_id().position.to_vec())
    };
    let (rest, turning) =
        (after(json!({}))?, after(json!({ "rotation": { "center": [1.3, 0.4], "angle": [[0, 0], [1, 5]] } }))?);
    let apart = rest.iter().zip(&turning).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(apart < 1e-9, "{apart:e}");
    Ok(())
}

fn falling() -> Value {
    merged(
        json!({"grid": {"size": [4, 4], "spacing": 0.5}, "time": {"step": 0.01, "end": 1, "scheme": "energy_momentum"}}),
        json!({"approximation": "linear", "bodies": [solid("block", 10, json!({"box": {"min": [1, 1], "max": [2, 2]}}))]}),
    )
}

#[test]
fn what_has_no_mean_stress_is_refused() {
    let refused = |pointer: &str, value: Value, path: &str, words: &[&str]| {
        assert_refused(
            &serde_json::to_string_pretty(&with(falling(), &[(pointer, value)])).unwrap_or_default(),
            path,
            words,
        );
    };
    refused("/time/beta", json!(0.25), "time.beta", &["newmark"]);
    refused("/solver", json!({"krylov": {"method": "conjugate_gradient"}}), "solver.krylov.method", &["mean stress"]);
}
