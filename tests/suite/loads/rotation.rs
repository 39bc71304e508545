//! Faces and regions that rotate.

use crate::support::{Failure, advance, built, merged};
use bfree::scene;
use bfree::tensor::{Tensor, Vector};
use serde_json::{Value, json};
use std::f64::consts::{FRAC_PI_2, PI};

/// Half a disc. The whole body rotates about a point beside it, by `angle` within a unit of time.
fn carried(angle: f64, more: &Value) -> Value {
    let scene = json!({
        "grid": {"size": [8, 8], "spacing": 0.5, "reset": "never"},
        "approximation": {"bspline": {"degree": 3}},
        "bodies": [{
            "name": "half", "density": 2, "material": {"neo_hookean": {"young": 100, "poisson": 0.3}},
            "shape": {"intersection": [
                {"ball": {"center": [5, 4], "radius": 1}}, {"half_space": {"point": [5, 4], "normal": [1, 0]}}
            ]}
        }],
        "prescribed": [{
            "region": {"box": {"min": [-1, -1], "max": [9, 9]}},
            "rotation": {"center": [4, 4], "angle": [[0, 0], [1, angle]]}
        }],
        "time": {"scheme": "none", "step": 1, "end": 1}
    });
    merged(scene, more.clone())
}

fn rotated(x: &Vector<f64, 2>, angle: f64) -> Vector<f64, 2> {
    let center = Vector::from([4.0, 4.0]);
    center + Tensor::<f64, 2>::new(angle.cos(), -angle.sin(), angle.sin(), angle.cos()) * (x - center)
}

#[test]
fn what_rotates_as_a_whole_is_where_it_should_be_and_does_not_strain() -> Result<(), Failure> {
    // A quarter turn in one step, and in eight without and with grid resets. Splines are exact for affine motion.
    let renewed = json!({"grid": {"size": [8, 8], "spacing": 0.5, "reset": "every_step"}});
    for (more, steps) in [(json!({}), 1), (json!({}), 8), (renewed, 8)] {
        let mut simulation = built::<2>(&carried(FRAC_PI_2, &more))?;
        simulation.clock = bfree::clock::Clock::new(1.0 / steps as f64, 0);
        let start = simulation.particles.position.clone();
        advance(&mut simulation, steps)?;
        let particles = simulation.particles.by_id();
        for (x, start) in particles.position.iter().zip(&start) {
            assert!((x - rotated(start, FRAC_PI_2)).norm() < 1e-13, "{steps}: {x}");
        }
        // W is of the order of E |strain|², and the strain is round-off.
        assert!(simulation.strain_energy() < 100.0 * 2.0 * 1e-28, "{:e}", simulation.strain_energy());
    }
    Ok(())
}

#[test]
fn what_circles_is_held_by_its_centripetal_force() -> Result<(), Failure> {
    // The force is m ω² r towards the axis. On a circle Newmark's acceleration lags by the share ω Δt / 3. The velocity of the wall gives
    // half of that back, along the circle, so it counts as a torque.
    let (omega, dt) = (2.0, 0.01);
    let more = json!({"time": {"step": dt, "end": 1}, "transfer": "flip"});
    let mut simulation = built::<2>(&carried(omega, &more))?;
    let v = |x: &Vector<f64, 2>| Vector::from([-omega * (x[1] - 4.0), omega * (x[0] - 4.0)]);
    simulation.set_velocity_on_nodes(v)?;
    simulation.set_initial_acceleration()?;
    // Lumped masses lose angular momentum in the particle-to-grid transfer. The first step gives it back.
    simulation.advance()?;
    for _ in 0..5 {
        let report = simulation.advance()?;
        let particles = &simulation.particles;
        let arm = |x: &Vector<f64, 2>| x - Vector::from([4.0, 4.0]);
        let force: Vector<f64, 2> =
            particles.mass.iter().zip(&particles.position).map(|(m, x)| arm(x) * (-m * omega * omega)).sum();
        let apart = (report.reactions[0].force - force).norm();
        assert!(apart < omega * dt / 5.0 * force.norm(), "{:?} {force}", report.reactions[0]);
        // No particle is farther than 2 from the axis.
        assert!(report.reactions[0].torque.abs() < 2.0 * omega * dt / 5.0 * force.norm(), "{:?}", report.reactions[0]);
    }
    Ok(())
}

#[test]
fn a_round_bar_twists_by_its_torque() -> Result<(), Failure> {
    // T = G J θ / L with J = π R⁴ / 2 (Coulomb). The formula is exact for a bar of any length, since a circular section does not warp.
    let (shear, angle) = (40.0, 1e-3);
    let rotation = json!({"center": [2, 2, 0], "axis": [0, 0, 2], "angle": [[0, 0], [1, angle]]});
    let mut simulation = built::<3>(&json!({
        "grid": {"size": [4, 4, 3], "spacing": 0.5},
        "approximation": {"bspline": {"degree": 3}},
        "bodies": [{
            "name": "bar", "density": 1, "material": {"neo_hookean": {"lambda": 60, "shear": shear}},
            "shape": {"cylinder": {"from": [2, 2, 0], "to": [2, 2, 3], "radius": 1}}
        }],
        "boundary": {"back": "fixed", "front": {"rotation": rotation}},
        "time": {"scheme": "none", "step": 1, "end": 1}
    }))?;
    let report = simulation.advance()?;
    let exact = shear * 0.5 * PI * angle / 3.0;
    let [fixed, turned] = report.reactions[..] else { return Err("two conditions".into()) };
    assert_eq!(fixed.torque, 0.0, "it does not rotate, and has no axis");
    let turned = turned.torque;
    assert!((turned / exact - 1.0).abs() < 5e-3, "{turned} for {exact}");
    // The work and the energy of a torque that grows with its angle.
    assert!((simulation.external_work / (0.5 * turned * angle) - 1.0).abs() < 1e-6);
    assert!((simulation.strain_energy() / simulation.external_work - 1.0).abs() < 5e-3);
    // Along the axis there is a force of second order in the angle (Poynting); across the axis there is none.
    let force = report.reactions[1].force;
    assert!(force.norm() < 2.0 * angle * turned && force.xy().norm() < 1e-6 * turned, "{force}");
    Ok(())
}

#[test]
fn rotations_that_mean_nothing_are_refused() {
    let given = |rotation: Value| {
        let region = json!({"box": {"min": [0, 0], "max": [8, 8]}});
        carried(1.0, &json!({"prescribed": [{"region": region, "rotation": rotation}]}))
    };
    let cases = [
        (given(json!({"center": [4, 4], "axis": [0, 0, 1], "angle": [[0, 0]]})), ["rotation.axis", "in 2D it is z"]),
        (given(json!({"center": [4, 4, 0], "angle": [[0, 0]]})), ["rotation.center", "2"]),
        (given(json!({"center": [4, 4], "angle": [[0, 0.5]]})), ["rotation.angle[0]", "must be [0, 0]"]),
        (given(json!({"center": [4, 4], "angle": []})), ["rotation.angle", "at least one row"]),
    ];
    for (scene, parts) in cases {
        let refused = scene::read(&scene.to_string(), &[]).unwrap_err().to_string();
        assert!(parts.iter().all(|part| refused.contains(part)), "{refused}");
    }
}
