//! Contact with rigid obstacles in whole runs: bodies leave freely, moving obstacles work, friction survives a restart, and wrong scenes are
//! refused.

use crate::support::{Failure, advance, assert_refused, built, in_threads, merged, restored, run_to, solid, with};
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use serde_json::{Value, json};

/// A square of 4 × 4 cells above the floor y = 0.5, falling and sliding with friction.
fn falling() -> Value {
    merged(
        json!({
            "grid": { "size": [4, 2], "spacing": 0.125 },
            "time": { "step": 0.01, "end": 1 },
            "bodies": [merged(solid("square", 1000, json!({ "box": { "min": [0.5, 0.55], "max": [1, 1.05] } })), json!({ "velocity": [2, -1] }))]
        }),
        json!({ "obstacles": [{ "name": "floor", "shape": { "half_space": { "point": [0, 0.5], "normal": [0, 1] } }, "friction": 0.3 }] }),
    )
}

#[test]
fn a_body_bounces_off_an_obstacle_and_momentum_is_the_impulse() -> Result<(), Failure> {
    let mut simulation: Simulation<2> = built(&falling())?;
    let before = simulation.particles.momentum();
    let (mut impulse, mut touched, mut last) = ([0.0; 2], false, [0.0; 2]);
    while simulation.clock.time() < 0.3 {
        let step = simulation.advance()?;
        let force = step.obstacles[0].force;
        // Newmark's trapezoidal rule takes the mean of the forces at both ends of a step.
        (0..2).for_each(|i| impulse[i] += 0.5 * step.dt * (force[i] + last[i]));
        last = [force[0], force[1]];
        assert!(force[1] <= 0.0, "the floor pulls: {force}");
        touched |= step.touches();
    }
    let (after, scale) = (simulation.particles.momentum(), before.norm());
    assert!(touched && after[1] > 0.5 * -before[1], "no rebound: {after}");
    assert!((0..2).all(|i| (after[i] - before[i] + impulse[i]).abs() < 0.02 * scale), "{after} {before} {impulse:?}");
    // It slides with friction, so the impulse along the floor is μ times that across the floor.
    assert!((impulse[0] / -impulse[1] - 0.3).abs() < 0.02, "{impulse:?}");
    let floor = &simulation.loads.contacts.obstacles[0];
    assert!(floor.friction_loss > 0.0 && floor.work == 0.0);
    Ok(())
}

#[test]
fn the_work_of_a_moving_obstacle_is_the_energy_of_the_body() -> Result<(), Failure> {
    // A plate pushes a square along; with damping out of the way, work is kinetic, strain and contact energy.
    let scene = with(
        falling(),
        &[
            ("/bodies/0/velocity", json!([0, 0])),
            ("/time/step", json!(0.005)),
            (
                "/obstacles",
                json!([{ "name": "plate", "shape": { "half_space": { "point": [0.49, 0], "normal": [1, 0] } },
                         "velocity": [[0, [0, 0]], [0.2, [2, 0]]] }]),
            ),
        ],
    );
    let mut simulation: Simulation<2> = built(&scene)?;
    run_to(&mut simulation, 0.4)?;
    let energy = simulation.particles.kinetic_energy() + simulation.strain_energy() + simulation.contact_energy();
    let plate = &simulation.loads.contacts.obstacles[0];
    assert!((plate.work / simulation.external_work - 1.0).abs() < 1e-12, "{}", plate.work);
    assert!((energy / plate.work - 1.0).abs() < 0.02, "{energy} {}", plate.work);
    Ok(())
}

#[test]
fn a_body_on_a_belt_takes_the_speed_of_the_belt() -> Result<(), Failure> {
    let belt = json!([{ "name": "belt", "shape": { "half_space": { "point": [0, 0.5], "normal": [0, 1] } }, "friction": 0.3,
                        "velocity": [[0, [0.2, 0]], [1, [0.2, 0]]] }]);
    let scene = with(
        falling(),
        &[
            ("/bodies/0/velocity", json!([0, 0])),
            ("/bodies/0/shape/box", json!({ "min": [0.5, 0.5], "max": [1, 1] })),
            ("/gravity", json!({ "acceleration": [0, -10] })),
            ("/obstacles", belt),
        ],
    );
    let mut simulation: Simulation<2> = built(&scene)?;
    let mass: f64 = simulation.particles.mass.iter().sum();
    // It slides at μ g for 0.2/3 time units; then it must stick, also where it has slid far. On its elastic slip ε = 0.005 h it swings with
    // the speed √(μ g ε) = 0.04; an anchor that does not follow would give it the speed 0.4.
    run_to(&mut simulation, 0.1)?;
    while simulation.clock.time() < 0.3 {
        simulation.advance()?;
        let speed = simulation.particles.momentum()[0] / mass;
        assert!((speed - 0.2).abs() < 0.1, "t = {}: {speed}", simulation.clock.time());
    }
    Ok(())
}

#[test]
fn a_restart_gives_the_same_bits_while_friction_sticks() -> Result<(), Failure> {
    let scene =
        with(falling(), &[("/obstacles/0/friction", json!(2)), ("/gravity", json!({ "acceleration": [1, -9.81] }))]);
    let start: Simulation<2> = built(&scene)?;
    let mut simulation = start.clone();
    while !simulation.advance()?.touches() {}
    let mut continued = restored(&simulation, &start)?;
    assert_eq!(continued.loads.contacts, simulation.loads.contacts);
    advance(&mut simulation, 5)?;
    advance(&mut continued, 5)?;
    assert_eq!(continued.particles, simulation.particles);
    assert_eq!(continued.loads.contacts, simulation.loads.contacts);
    Ok(())
}

#[test]
fn the_number_of_threads_does_not_change_a_bit_of_contact() -> Result<(), Failure> {
    let state = |threads| {
        in_threads(threads, || {
            let mut simulation: Simulation<2> = built(&falling())?;
            advance(&mut simulation, 15)?;
            Ok((simulation.particles, simulation.loads.contacts))
        })
    };
    assert_eq!(state(1)?, state(3)?);
    Ok(())
}

#[test]
fn a_step_that_would_enter_an_obstacle_deeply_is_halved() -> Result<(), Failure> {
    // Per step the square falls by 0.8 spacings, and the floor is too soft to stop it.
    let changes = [("/bodies/0/velocity", json!([0, -10])), ("/obstacles/0/stiffness", json!(0.01))];
    let mut simulation: Simulation<2> = built(&with(falling(), &changes))?;
    let step = simulation.advance()?;
    let failed = step.failed.first().ok_or("the step was not halved")?;
    let words = ["enters the obstacle \"floor\"", "grid spacings in one step", "shorter steps"];
    assert!(words.iter().all(|word| failed.why.contains(word)), "{}", failed.why);
    assert!(step.dt < 0.01 && step.obstacles[0].depth <= 0.25 * 0.125);
    Ok(())
}

#[test]
fn a_body_does_not_pass_a_thin_obstacle_silently() -> Result<(), Failure> {
    // A sheet a tenth of a spacing thick, that the square would jump over in one step.
    let sheet = json!([{ "name": "sheet", "shape": { "box": { "min": [0, 0.44], "max": [4, 0.4525] } } }]);
    let changes = [("/bodies/0/velocity", json!([0, -70])), ("/obstacles", sheet)];
    let mut simulation: Simulation<2> = built(&with(falling(), &changes))?;
    let error = (0..20).find_map(|_| {
        simulation
            .advance()
            .map_or_else(|error| Some(error.failed), |step| Some(step.failed).filter(|all| !all.is_empty()))
    });
    let failed = error.ok_or("the square passed")?;
    assert!(failed.iter().any(|attempt| attempt.why.contains("or goes through")), "{}", failed[0].why);
    Ok(())
}

/// A block that flies against a wall thinner than the depth of contact turns back, or the run ends with the block before the wall. The block moves
/// by 0.04 to 0.4 spacings in a step.
#[test]
fn a_body_does_not_come_out_behind_a_wall_that_is_thinner_than_a_step() -> Result<(), Failure> {
    let block =
        merged(solid("block", 1000, json!({ "box": { "min": [0, 0], "max": [1, 1] } })), json!({ "velocity": [1, 0] }));
    let mut ended = 0;
    for (thickness, step) in
        [(2e-4, 0.01), (5e-4, 0.005), (0.002, 0.005), (0.002, 0.05), (0.004, 0.01), (0.006, 0.02), (0.02, 0.005)]
    {
        for approximation in [json!("linear"), json!("gimp"), json!({ "bspline": { "degree": 3 } })] {
            let scene = json!({
                "grid": { "origin": [-2, -1], "size": [6, 3], "spacing": 0.125 },
                "approximation": approximation,
                "time": { "step": step, "end": 0.5, "max_halvings": 3 },
                "bodies": [block],
                "obstacles": [{ "name": "wall", "shape": { "box": { "min": [1.05, -0.5], "max": [1.05 + thickness, 1.5] } } }]
            });
            let mut simulation: Simulation<2> = built(&scene)?;
            while simulation.clock.time() < 0.5 - 1e-9 {
                if simulation.advance().is_err() {
                    ended += 1;
                    break;
                }
            }
            let front = simulation.particles.position.iter().map(|x| x[0]).fold(0.0, f64::max);
            assert!(front < 1.05 + thickness, "{thickness} {step} {approximation}: {front}");
        }
    }
    assert!(ended > 0);
    Ok(())
}

#[test]
fn a_turned_scene_has_turned_forces() -> Result<(), Failure> {
    // The same impact on a floor and on a wall: x and y are exchanged. Newton's method must not end at different residuals.
    let floor = with(falling(), &[("/solver", json!({ "newton": { "tolerance": 1e-13 } }))]);
    let wall = with(
        floor.clone(),
        &[
            ("/grid/size", json!([2, 4])),
            ("/bodies/0/shape/box", json!({ "min": [0.55, 0.5], "max": [1.05, 1] })),
            ("/bodies/0/velocity", json!([-1, 2])),
            ("/obstacles/0/shape/half_space", json!({ "point": [0.5, 0], "normal": [1, 0] })),
        ],
    );
    let (mut on_floor, mut on_wall): (Simulation<2>, Simulation<2>) = (built(&floor)?, built(&wall)?);
    for _ in 0..15 {
        let [one, other] = [on_floor.advance()?, on_wall.advance()?].map(|step| step.obstacles[0]);
        let scale = 1e-9 * one.force.norm().max(1.0);
        assert!((one.force[0] - other.force[1]).abs() < scale && (one.force[1] - other.force[0]).abs() < scale);
        assert!((one.area - other.area).abs() < 1e-12);
    }
    Ok(())
}

/// A soft block, 4 × 4 cells large, between smooth plates that press it to 0.3 of its height.
fn pressed() -> Value {
    let plate = |name: &str, y: f64, normal: f64, way: f64| {
        json!({ "name": name, "shape": { "half_space": { "point": [0, y], "normal": [0, normal] } }, "stiffness": 10,
                "displacement": [[0, [0, 0]], [1, [0, way]]] })
    };
    json!({
        "grid": { "size": [4, 2], "spacing": 0.125, "reset": "every_step" },
        "time": { "step": 0.01, "end": 1 },
        "approximation": "linear",
        "bodies": [solid("block", 1000, json!({ "box": { "min": [1.75, 0.75], "max": [2.25, 1.25] } }))],
        "obstacles": [plate("lower", 0.75, 1.0, 0.175), plate("upper", 1.25, -1.0, -0.175)]
    })
}

#[test]
fn a_surface_that_stretches_gets_more_points_and_a_restart_has_them() -> Result<(), Failure> {
    let start: Simulation<2> = built(&pressed())?;
    let mut simulation = start.clone();
    run_to(&mut simulation, 0.8)?;
    let (before, after) = (start.loads.contacts.points.len(), simulation.loads.contacts.points.len());
    assert!(after > before, "{before} points, {after} after the block is stretched");
    let mut continued = restored(&simulation, &start)?;
    advance(&mut simulation, 3)?;
    advance(&mut continued, 3)?;
    assert_eq!(continued.particles, simulation.particles);
    assert_eq!(continued.loads.contacts, simulation.loads.contacts);
    let particles = &simulation.particles;
    let below = (0..particles.len()).filter(|&p| (particles.position[p][1] - 1.0).abs() > 0.25);
    assert_eq!(below.count(), 0, "particles pass the plates");
    Ok(())
}

/// A strip on a rough floor, under its weight, that is pulled to more than twice its length. Its surface gets more points on the way.
#[test]
fn halves_of_a_piece_of_surface_keep_its_elastic_slip_and_carry_the_weight() -> Result<(), Failure> {
    let pulled = |from: f64, to: f64, way: f64| {
        let region = json!({ "box": { "min": [from, 0], "max": [to, 2] } });
        json!({ "region": region, "displacement": [[0, [0, null]], [1, [way, null]]] })
    };
    let mut simulation: Simulation<2> = built(&json!({
        "grid": { "size": [4, 1.5], "spacing": 0.25, "reset": "every_step" },
        "time": { "scheme": "none", "step": 0.05, "end": 1 },
        "approximation": "linear",
        "bodies": [solid("strip", 1000, json!({ "box": { "min": [1.5, 0.5], "max": [2.5, 1] } }))],
        "obstacles": [{ "name": "floor", "shape": { "half_space": { "point": [0, 0.5], "normal": [0, 1] } }, "friction": 0.3 }],
        "prescribed": [pulled(0.0, 1.6, -0.45), pulled(2.4, 4.0, 0.55)],
        "gravity": { "acceleration": [0, -100] }
    }))?;
    let (start, weight) =
        (simulation.loads.contacts.points.len(), 100.0 * simulation.particles.mass.iter().sum::<f64>());
    while simulation.clock.time() < 1.0 - 1e-9 {
        let floor = simulation.advance()?.obstacles[0];
        let (deepest, time) = (floor.depth, simulation.clock.time());
        assert!((floor.force[1] + weight).abs() < 1e-5 * weight, "t = {time}: {} of {weight}", floor.force[1]);
        let (contacts, positions) = (&simulation.loads.contacts, &simulation.particles.position);
        let anchors = contacts.points.iter().zip(&contacts.obstacles[0].anchors);
        // An elastic slip is at most μ times the depth long, and a point that touches nothing has none.
        let longest = anchors.map(|(point, anchor)| (positions[point.particle] - anchor)[0].abs()).fold(0.0, f64::max);
        assert!(longest <= 0.3 * deepest * (1.0 + 1e-6), "t = {time}: {longest} {deepest}");
    }
    assert!(simulation.loads.contacts.points.len() > start && simulation.dissipated > 0.0, "{start} points stay");
    Ok(())
}

#[test]
fn a_particle_that_surfaces_leave_bare_becomes_a_part_of_the_surface() -> Result<(), Failure> {
    let mut simulation: Simulation<2> = built(&falling())?;
    // The bottom of the square has lost its points.
    let positions = simulation.particles.position.clone();
    simulation.loads.contacts.points.retain(|point| positions[point.particle][1] > 0.56);
    let before = simulation.loads.contacts.points.len();
    run_to(&mut simulation, 0.3)?;
    let particles = &simulation.particles;
    let lowest = particles.position.iter().map(|x| x[1]).fold(f64::INFINITY, f64::min);
    assert!(simulation.loads.contacts.points.len() > before, "no particle watches");
    assert!(lowest > 0.5 - 0.1 * 0.125, "a particle lies at {lowest}, and the floor at 0.5");
    Ok(())
}

#[test]
fn a_weight_finds_the_floor_that_holds_it_in_load_steps() -> Result<(), Failure> {
    // Above the floor, beside a smooth wall of the box, and turned.
    for (gap, gravity, normal) in
        [(0.0, [0.0, -10.0], [0, 1]), (0.3, [0.0, -10.0], [0, 1]), (0.2, [10.0, 0.0], [-1, 0])]
    {
        let point = [1.5 + gap, 0.5 - gap];
        let scene = json!({
            "grid": { "size": [2, 2], "spacing": 0.125 },
            "time": { "scheme": "none", "step": 0.5, "end": 1 },
            "bodies": [solid("weight", 1000, json!({ "box": { "min": [0.5, 0.5], "max": [1.5, 1.5] } }))],
            "gravity": { "acceleration": gravity, "curve": [[0, 0], [1, 1]] },
            "obstacles": [{ "name": "floor", "shape": { "half_space": { "point": point, "normal": normal } }, "friction": 0.3 }]
        });
        let mut simulation: Simulation<2> = built(&scene)?;
        advance(&mut simulation, 1)?;
        let force = simulation.advance()?.obstacles[0].force;
        let weight = Vector::from(gravity);
        assert!(
            (force - weight).norm() < 1e-5 * weight.norm(),
            "gap {gap}: {force} on the floor, and {weight} is the weight"
        );
    }
    Ok(())
}

#[test]
fn wrong_obstacles_are_refused() {
    for (pointer, value, path, words) in [
        ("/obstacles/0/friction", json!(-0.1), "obstacles[0].friction", &["-0.1", "0", "100"][..]),
        ("/obstacles/0/stiffness", json!(0), "obstacles[0].stiffness", &["finite and > 0"]),
        ("/obstacles/0/name", json!(""), "obstacles[0].name", &["empty"]),
        ("/obstacles/0/displacement", json!([[0, [1, 0]]]), "obstacles[0].displacement[0][1][0]", &["must be 0"]),
        (
            "/obstacles/0/shape",
            json!({ "intersection": [{ "ball": { "center": [0, 0], "radius": 1 } }, { "ball": { "center": [3, 0], "radius": 1 } }] }),
            "obstacles[0].shape",
            &["empty"],
        ),
    ] {
        assert_refused(&with(falling(), &[(pointer, value)]).to_string(), path, words);
    }
    let twice = with(
        falling(),
        &[("/obstacles/0/velocity", json!([[0, [1, 0]]])), ("/obstacles/0/displacement", json!([[0, [0, 0]]]))],
    );
    assert_refused(&twice.to_string(), "obstacles[0]", &["displacement and velocity", "one of them"]);
}

#[test]
fn a_body_that_starts_in_an_obstacle_is_refused_with_place_and_depth() {
    let deep = with(falling(), &[("/obstacles/0/shape/half_space/point", json!([0, 0.6]))]);
    let error = built::<2>(&deep).err().map(|error| error.to_string()).unwrap_or_default();
    assert!(
        ["obstacles[0]", "\"square\"", "\"floor\"", "0.400 grid spacings deep"].iter().all(|word| error.contains(word)),
        "{error}"
    );
}
