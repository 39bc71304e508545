//! Obstacles that move freely, in whole runs: momentum is kept, tangents are exact, and wrong scenes are refused.

use crate::support::{
    Failure, advance, assert_refused, built, in_threads, merged, output, restored, run_to, solid, with,
};
use bfree::mechanics::loads::RigidBody;
use bfree::output::{Outcome, Recorder, Reference};
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use serde_json::{Value, json};
use std::num::NonZeroU64;

/// A block that floats, and a rigid disc that spins and flies towards it, off its middle.
pub fn flying() -> Value {
    merged(
        json!({
            "grid": { "size": [4, 3], "spacing": 0.125 },
            "time": { "step": 0.004, "end": 1 },
            "bodies": [solid("block", 1000, json!({ "box": { "min": [1.5, 1], "max": [2, 2] } }))]
        }),
        json!({ "obstacles": [{ "name": "disc", "shape": { "ball": { "center": [1.1, 1.3], "radius": 0.35 } }, "friction": 0.3,
                                "free": { "density": 2, "velocity": [3, 0.5], "spin": [-2] } }] }),
    )
}

/// A ball in 3D on a corner of a block, with everything in motion.
pub fn flying_3d() -> Value {
    merged(
        json!({
            "grid": { "size": [2, 2, 2], "spacing": 0.25 },
            "time": { "step": 0.01, "end": 1, "scheme": { "generalized_alpha": { "spectral_radius": 0.5 } } },
            "gravity": { "acceleration": [1, -2, 0.5] },
            "bodies": [solid("block", 1000, json!({ "box": { "min": [0.5, 0.5, 0.5], "max": [1.5, 1, 1.5] } }))]
        }),
        json!({ "obstacles": [{ "name": "brick", "shape": { "box": { "min": [0.5, 1.01, 0.4], "max": [1.2, 1.3, 1.3] } }, "friction": 0.4,
                                "free": { "density": 1.5, "velocity": [1, -2, 0.3], "spin": [0.5, -2, 1] } }] }),
    )
}

fn free<const D: usize>(simulation: &Simulation<D>) -> Result<&RigidBody<D>, Failure> {
    Ok(simulation.loads.contacts.obstacles[0].free.as_ref().ok_or("the obstacle is not free")?)
}

/// Momentum and angular momentum about the origin, of the block and of the disc.
fn momenta(simulation: &Simulation<2>) -> Result<[f64; 3], Failure> {
    let (particles, disc) = (&simulation.particles, free(simulation)?);
    let turning = |x: &Vector<f64, 2>, v: &Vector<f64, 2>| x[0] * v[1] - x[1] * v[0];
    let of_block =
        (0..particles.len()).map(|p| particles.mass[p] * turning(&particles.position[p], &particles.velocity[p]));
    let v = Vector::from([disc.velocity[0], disc.velocity[1]]);
    let linear = particles.momentum() + v * disc.mass;
    let of_disc = disc.mass * turning(&disc.position, &v) + disc.inertia[(2, 2)] * disc.velocity[5];
    Ok([linear[0], linear[1], of_block.sum::<f64>() + of_disc])
}

#[test]
fn momentum_goes_from_the_obstacle_to_the_body_and_none_is_lost() -> Result<(), Failure> {
    let mut simulation: Simulation<2> = built(&flying())?;
    let (start, speed) = (momenta(&simulation)?, free(&simulation)?.velocity);
    let mut touched = false;
    while simulation.clock.time() < 0.3 {
        touched |= simulation.advance()?.touches();
    }
    let (end, after) = (momenta(&simulation)?, free(&simulation)?.velocity);
    assert!(touched && after[0] < 0.5 * speed[0] && (after[5] - speed[5]).abs() > 0.1, "{after}");
    for k in 0..2 {
        assert!((end[k] - start[k]).abs() < 1e-10 * start[0], "{start:?} {end:?}");
    }
    Ok(())
}

/// The change of angular momentum in the impact, over the linear momentum, for steps of this length. A lumped share of the mass would lose
/// angular momentum, whatever the step.
fn change_of_angular_momentum(step: f64) -> Result<f64, Failure> {
    let changes = [("/time/step", json!(step)), ("/time/lumping", json!(0)), ("/grid/reset", json!("never"))];
    let mut simulation: Simulation<2> = built(&with(flying(), &changes))?;
    let start = momenta(&simulation)?;
    run_to(&mut simulation, 0.3)?;
    Ok((momenta(&simulation)?[2] - start[2]) / start[0])
}

#[test]
fn angular_momentum_is_kept_to_the_order_of_the_scheme() -> Result<(), Failure> {
    let [coarse, fine] = [change_of_angular_momentum(0.004)?, change_of_angular_momentum(0.001)?];
    assert!(coarse.abs() < 1e-4 && fine.abs() < 0.25 * coarse.abs(), "{coarse} {fine}");
    Ok(())
}

/// The work of the disc on the block over the energy that the disc has lost, minus 1.
fn excess_of_work(changes: &[(&str, Value)]) -> Result<f64, Failure> {
    let mut simulation: Simulation<2> = built(&with(flying(), changes))?;
    let start = free(&simulation)?.kinetic_energy();
    run_to(&mut simulation, 0.3)?;
    let lost = start - free(&simulation)?.kinetic_energy();
    let work = simulation.loads.contacts.obstacles[0].work;
    assert!(work > 0.2 * start, "{work} of {start}");
    Ok(work / lost - 1.0)
}

#[test]
fn the_energy_of_the_obstacle_is_its_work_on_the_body() -> Result<(), Failure> {
    // Without friction the disc does not turn. The trapezoidal work of Newmark's method is then exactly the change of its energy.
    let smooth = [("/obstacles/0/friction", json!(0)), ("/obstacles/0/free/spin", json!([0]))];
    assert!(excess_of_work(&smooth)?.abs() < 1e-10, "{}", excess_of_work(&smooth)?);
    // A turn leaves an error of the order of the scheme.
    let [coarse, fine] = [0.002, 0.001].map(|step| excess_of_work(&[("/time/step", json!(step))]));
    let [coarse, fine] = [coarse?.abs(), fine?.abs()];
    assert!(fine < 1e-3 && fine < 0.5 * coarse, "{coarse} {fine}");
    Ok(())
}

#[test]
fn the_work_of_a_moving_wall_closes_the_balance_beside_a_free_obstacle() -> Result<(), Failure> {
    // A layer one cell thick between the moving floor and the disc: contact acts on the nodes of the floor.
    let scene = json!({
        "grid": { "size": [3, 3], "spacing": 0.25, "reset": "never" },
        "time": { "step": 0.001, "end": 1, "lumping": 0 },
        "bodies": [solid("layer", 1000, json!({ "box": { "min": [1, 0], "max": [2, 0.25] } }))],
        "boundary": { "bottom": { "velocity": [[0, [0, 0]], [0.02, [0, 0]], [0.04, [0, 1]], [0.2, [0, 1]]] } },
        "obstacles": [{ "name": "disc", "shape": { "ball": { "center": [1.5, 0.56], "radius": 0.3 } },
                        "free": { "density": 3, "velocity": [0, -0.5] } }]
    });
    for scheme in [json!("newmark"), json!({ "generalized_alpha": { "spectral_radius": 0.9 } })] {
        let mut simulation: Simulation<2> = built(&with(scene.clone(), &[("/time/scheme", scheme.clone())]))?;
        let (mut touched, mut apart) = (false, 0.0_f64);
        while simulation.clock.time() < 0.06 {
            touched |= simulation.advance()?.touches();
            let energy =
                simulation.particles.kinetic_energy() + simulation.strain_energy() + simulation.contact_energy();
            apart = apart.max((energy - simulation.external_work).abs());
        }
        // The error of the time scheme is 0.2 %. Without the contact at the start of each step, it would be 4 %.
        let scale = simulation.external_work;
        assert!(touched && apart < 0.01 * scale, "{scheme}: {apart} of {scale}");
    }
    Ok(())
}

#[test]
fn the_tangent_is_exact_in_every_step_of_an_impact() -> Result<(), Failure> {
    let (mut plane, mut space): (Simulation<2>, Simulation<3>) = (built(&flying())?, built(&flying_3d())?);
    (plane.settings.check_tangent, space.settings.check_tangent) = (NonZeroU64::new(1), NonZeroU64::new(1));
    let (mut touched, mut most) = ([0; 2], 0);
    for _ in 0..25 {
        let step = plane.advance()?;
        touched[0] += u32::from(step.touches());
        most = most.max(step.newton.history.iterations.len());
        touched[1] += u32::from(space.advance()?.touches());
    }
    assert!(touched.into_iter().all(|count| count >= 5), "{touched:?}");
    assert!(most <= 6, "{most} Newton iterations");
    Ok(())
}

#[test]
fn bits_depend_neither_on_restarts_nor_on_threads() -> Result<(), Failure> {
    let state = |threads| {
        in_threads(threads, || {
            let mut simulation: Simulation<3> = built(&flying_3d())?;
            advance(&mut simulation, 8)?;
            Ok((simulation.particles, simulation.loads.contacts))
        })
    };
    let whole = state(1)?;
    assert_eq!(whole, state(3)?);
    let start: Simulation<3> = built(&flying_3d())?;
    let mut simulation = start.clone();
    advance(&mut simulation, 5)?;
    let mut continued = restored(&simulation, &start)?;
    advance(&mut continued, 3)?;
    assert_eq!((continued.particles, continued.loads.contacts), whole);
    Ok(())
}

#[test]
fn a_free_obstacle_that_meets_another_one_ends_the_run() -> Result<(), Failure> {
    let wall = json!({ "name": "wall", "shape": { "box": { "min": [0, 2.2], "max": [1.4, 2.5] } } });
    let mut scene = with(
        flying(),
        &[("/obstacles/0/free/velocity", json!([0, 3])), ("/obstacles/0/shape/ball/center", json!([0.5, 1.7]))],
    );
    scene["obstacles"].as_array_mut().ok_or("no list")?.push(wall);
    let mut simulation: Simulation<2> = built(&scene)?;
    let error = std::iter::repeat_with(|| simulation.advance()).take(100).find_map(Result::err).ok_or("nothing met")?;
    let text = error.cause.to_string();
    let words = ["\"disc\"", "\"wall\"", "do not push each other", "make one of the two a body"];
    assert!(words.iter().all(|word| text.contains(word)), "{text}");
    // From the start, this is an error of the scene.
    scene["obstacles"][1]["shape"]["box"]["min"] = json!([0, 2]);
    let text = built::<2>(&scene).err().map(|error| error.to_string()).unwrap_or_default();
    assert!(text.contains("obstacles[0]") && text.contains("starts in the obstacle \"wall\""), "{text}");
    Ok(())
}

#[test]
fn a_pin_in_a_free_disc_is_found() -> Result<(), Failure> {
    // No point of the disc's surface lies in the pin.
    let pin = json!({ "name": "pin", "shape": { "ball": { "center": [1.1, 1.3], "radius": 0.01 } } });
    let mut scene = flying();
    scene["obstacles"].as_array_mut().ok_or("no list")?.push(pin);
    let text = built::<2>(&scene).err().map(|error| error.to_string()).unwrap_or_default();
    assert!(text.contains("obstacles[1]") && text.contains("\"pin\" starts in the obstacle \"disc\""), "{text}");
    Ok(())
}

#[test]
fn a_free_obstacle_does_not_pass_a_thin_one_silently() -> Result<(), Failure> {
    // Per step the disc moves by more than its own size.
    let plate = json!({ "name": "plate", "shape": { "box": { "min": [0.2, 2.8], "max": [1, 2.81] } } });
    let changes = [
        ("/obstacles/0/free/velocity", json!([0, 200])),
        ("/obstacles/0/shape/ball", json!({ "center": [0.6, 2.4], "radius": 0.3 })),
    ];
    let mut scene = with(flying(), &changes);
    scene["obstacles"].as_array_mut().ok_or("no list")?.push(plate);
    let mut simulation: Simulation<2> = built(&scene)?;
    let error = simulation.advance().err().ok_or("the disc passed")?;
    assert!(error.cause.to_string().contains("\"disc\" meets the obstacle \"plate\""), "{}", error.cause);
    Ok(())
}

#[test]
fn a_free_obstacle_far_away_does_not_accelerate_a_body() -> Result<(), Failure> {
    // The slab lies where the obstacle would be if its acceleration were a displacement.
    let scene = json!({
        "grid": { "size": [4, 14], "spacing": 0.5 },
        "time": { "step": 0.01, "end": 1 },
        "gravity": { "acceleration": [0, -10] },
        "bodies": [solid("slab", 1000, json!({ "box": { "min": [1, 11], "max": [3, 11.5] } }))],
        "obstacles": [{ "name": "ball", "shape": { "ball": { "center": [2, 2], "radius": 0.8 } }, "free": { "density": 1 } }]
    });
    let mut simulation: Simulation<2> = built(&scene)?;
    simulation.advance()?;
    let fallen = simulation.particles.momentum()[1] / simulation.particles.mass.iter().sum::<f64>();
    assert!((fallen + 0.1).abs() < 1e-12, "{fallen}");
    Ok(())
}

#[test]
fn a_free_obstacle_that_leaves_the_grid_is_told() -> Result<(), Failure> {
    let scene = with(flying(), &[("/obstacles/0/free/velocity", json!([-20, 0])), ("/time/end", json!(0.2))]);
    let folder = tempfile::tempdir()?;
    let mut simulation: Simulation<2> = built(&scene)?;
    let mut recorder = Recorder::start(output(folder.path()), &simulation, Reference::of(&simulation))?;
    for _ in 0..30 {
        let step = simulation.advance()?;
        recorder.record(&simulation, &step)?;
    }
    recorder.finish(&simulation, &serde_json::Map::new(), Outcome::Finished)?;
    let report = std::fs::read_to_string(folder.path().join("report.json"))?;
    assert!(report.contains("obstacle_gone") && report.contains("has left the grid"), "{report}");
    Ok(())
}

/// A ball in the middle of a grid, and a block in a corner.
fn ball<const D: usize>() -> Result<Simulation<D>, Failure> {
    built(&json!({
        "grid": { "size": vec![2.0; D], "spacing": 0.25 },
        "time": { "step": 0.01, "end": 1 },
        "bodies": [solid("block", 1000, json!({ "box": { "min": vec![0.25; D], "max": vec![0.75; D] } }))],
        "obstacles": [{ "name": "ball", "shape": { "ball": { "center": vec![1.25; D], "radius": 0.2 } }, "free": { "density": 2 } }]
    }))
}

/// Whether a run of `steps` steps tells that the ball has left the grid. The ball flies along an axis, by 0.1 in a step.
fn tells_that_it_left<const D: usize>(
    start: &Simulation<D>,
    axis: usize,
    sign: f64,
    steps: usize,
) -> Result<bool, Failure> {
    let (mut simulation, folder) = (start.clone(), tempfile::tempdir()?);
    let body = simulation.loads.contacts.obstacles[0].free.as_mut().ok_or("the obstacle is not free")?;
    body.velocity[axis] = 10.0 * sign;
    let mut recorder = Recorder::start(output(folder.path()), &simulation, Reference::of(&simulation))?;
    for _ in 0..steps {
        let step = simulation.advance()?;
        recorder.record(&simulation, &step)?;
    }
    recorder.finish(&simulation, &serde_json::Map::new(), Outcome::Finished)?;
    Ok(std::fs::read_to_string(folder.path().join("report.json"))?.contains("obstacle_gone"))
}

#[test]
fn a_free_obstacle_leaves_through_any_face() -> Result<(), Failure> {
    let (disc, ball) = (ball::<2>()?, ball::<3>()?);
    // A ball around its bounding box has the radius 0.2 √2, or 0.2 √3 in 3D. It is outside after a way of 1.03 or 1.10, or of 1.53 or 1.60.
    for (sign, steps) in [(1.0, 11), (-1.0, 16)] {
        for axis in 0..2 {
            assert!(tells_that_it_left(&disc, axis, sign, steps)?, "axis {axis}, {sign}: it is outside");
            assert!(!tells_that_it_left(&disc, axis, sign, steps - 1)?, "axis {axis}, {sign}: a part of it is inside");
        }
        for axis in 0..3 {
            assert!(tells_that_it_left(&ball, axis, sign, steps)?, "3D, axis {axis}, {sign}: it is outside");
        }
    }
    Ok(())
}

#[test]
fn a_free_obstacle_falls_with_the_curve_of_gravity() -> Result<(), Failure> {
    let changes = [
        ("/gravity", json!({ "acceleration": [3, -10], "curve": [[0, 0.5], [0.04, 1], [0.08, -0.5]] })),
        ("/obstacles/0/shape/ball/center", json!([0.6, 2.2])),
        ("/obstacles/0/free", json!({ "density": 2, "velocity": [0.5, 1], "spin": [-2] })),
    ];
    let mut simulation: Simulation<2> = built(&with(flying(), &changes))?;
    // The trapezoidal rule of Newmark's method is exact for a curve with kinks at the ends of steps.
    for (end, integral) in [(0.04, 0.03), (0.08, 0.04)] {
        run_to(&mut simulation, end)?;
        let velocity = free(&simulation)?.velocity;
        for (k, wanted) in [0.5 + 3.0 * integral, 1.0 - 10.0 * integral].into_iter().enumerate() {
            assert!((velocity[k] - wanted).abs() < 1e-12, "t = {end}, component {k}: {} {wanted}", velocity[k]);
        }
        assert!((velocity[5] + 2.0).abs() < 1e-12, "it spins with {}", velocity[5]);
    }
    Ok(())
}

#[test]
fn in_one_dimension_nothing_spins() -> Result<(), Failure> {
    let scene = json!({
        "grid": { "size": [4], "spacing": 0.25 },
        "time": { "step": 0.01, "end": 1 },
        "bodies": [solid("bar", 100, json!({ "box": { "min": [0.5], "max": [1.5] } }))],
        "obstacles": [{ "name": "mass", "shape": { "box": { "min": [2], "max": [2.5] } }, "free": { "density": 1, "velocity": [-1], "spin": [] } }]
    });
    let mut simulation: Simulation<1> = built(&scene)?;
    advance(&mut simulation, 3)?;
    assert!((free(&simulation)?.position[0] - 2.22).abs() < 1e-12);
    Ok(())
}

#[test]
fn wrong_free_obstacles_are_refused() {
    let profile = json!({ "acceleration": [0, -1], "profile": { "along": [1, 0], "factor": [[0, 1], [1, 2]] } });
    for (pointer, value, path, words) in [
        ("/obstacles/0/free/density", json!(0), "obstacles[0].free.density", &["> 0"][..]),
        ("/obstacles/0/free/velocity", json!([1]), "obstacles[0].free.velocity", &["2"]),
        ("/obstacles/0/free/spin", json!([1, 2, 3]), "obstacles[0].free.spin", &["one component in 2D"]),
        ("/obstacles/0/velocity", json!([[0, [0, 0]]]), "obstacles[0]", &["velocity and free", "one of them"]),
        (
            "/obstacles/0/shape",
            json!({ "half_space": { "point": [0, 0], "normal": [0, 1] } }),
            "obstacles[0].shape",
            &["bounded"],
        ),
        ("/time/scheme", json!("none"), "obstacles[0].free", &["without inertia"]),
        ("/time/scheme", json!("energy_momentum"), "obstacles[0].free", &["energy_momentum"]),
        ("/gravity", profile, "obstacles[0].free", &["gravity.profile"]),
    ] {
        assert_refused(&with(flying(), &[(pointer, value)]).to_string(), path, words);
    }
    let conjugate =
        [("/obstacles/0/friction", json!(0)), ("/solver", json!({ "krylov": { "method": "conjugate_gradient" } }))];
    let words = &["moves freely", "unsymmetric", "gmres"];
    assert_refused(&with(flying(), &conjugate).to_string(), "solver.krylov.method", words);
}
