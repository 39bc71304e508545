//! Moving walls, follower pressure, tractions: facts about loads on whole runs.

mod rotation;

use crate::support::{Failure, advance, assert_refused, body, built, run_to};
use bfree::approximation::{Approximation, Linear};
use bfree::grid::Grid;
use bfree::material::{Lame, Material, NeoHookean};
use bfree::mechanics::loads::{Curve, ForceField, Gravity, Loads, Pressing, SurfaceLoad, SurfacePoint};
use bfree::mechanics::residual::Equilibrium;
use bfree::mechanics::schemes::Newmark;
use bfree::mechanics::sweep::Connectivity;
use bfree::mechanics::terms::Step;
use bfree::mechanics::transfer::Nodal;
use bfree::particles::Particles;
use bfree::scene;
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use serde_json::json;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// A body that fills a box whose four faces all follow `table`.
fn carried(table: &serde_json::Value, velocity: f64, step: f64) -> serde_json::Value {
    let moving = json!({"velocity": table});
    json!({
        "grid": {"size": [2, 2], "spacing": 0.5},
        "time": {"step": step, "end": 1},
        "approximation": {"lme": {}},
        "bodies": [{
            "name": "load", "shape": {"box": {"min": [0, 0], "max": [2, 2]}}, "density": 1, "velocity": [velocity, 0],
            "material": {"neo_hookean": {"lambda": 1000, "shear": 1000}}, "particles_per_cell": 2
        }],
        "boundary": {"left": moving, "right": moving, "bottom": moving, "top": moving}
    })
}

/// Walls with the velocity V sin 2πt have moved by V/π at t = ½.
#[test]
fn a_base_motion_is_a_sine_or_the_rows_of_a_file() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let rows: String = (0..=100).map(|k| 0.01 * f64::from(k)).map(|t| format!("{t}, {}\n", (TAU * t).sin())).collect();
    std::fs::write(folder.path().join("ground.csv"), format!("time, velocity\n{rows}"))?;
    for curve in [json!({"sine": {"frequency": 1}}), json!({"file": "ground.csv"})] {
        let scene = carried(&json!({"direction": [0.1, 0], "curve": curve}), 0.0, 0.01).to_string();
        let mut simulation: Simulation<2> = scene::read(&scene, &[])?.build(folder.path())?;
        let start = simulation.particles.by_id().position;
        run_to(&mut simulation, 0.5)?;
        let moved = simulation.particles.by_id().position[0][0] - start[0][0];
        assert!((moved * PI / 0.1 - 1.0).abs() < 1e-3, "{curve}: {moved}");
    }
    let missing = carried(&json!({"direction": [0.1, null], "curve": {"file": "no.csv"}}), 0.0, 0.01).to_string();
    let error = scene::read(&missing, &[])?.build::<2>(folder.path()).expect_err("no file").to_string();
    assert!(error.starts_with("boundary.left.velocity.curve.file: cannot be read"), "{error}");
    Ok(())
}

#[test]
fn a_wrong_curve_is_refused_with_its_place() {
    let with = |bottom: serde_json::Value| {
        let mut scene = carried(&json!([[0, [0, 0]], [1, [0.1, 0]]]), 0.0, 0.01);
        scene["boundary"] = json!({"bottom": {"displacement": bottom}});
        scene.to_string()
    };
    let along = |direction: serde_json::Value, sine| with(json!({"direction": direction, "curve": {"sine": sine}}));
    let at = "boundary.bottom.displacement";
    let late = along(json!([1, null]), json!({"frequency": 1, "phase": 1}));
    assert_refused(&late, &format!("{at}.curve"), &["must be 0 at t = 0", "displacements"]);
    let still = along(json!([1, null]), json!({"frequency": 0}));
    assert_refused(&still, &format!("{at}.curve.sine.frequency"), &["> 0"]);
    let nowhere = along(json!([null, null]), json!({"frequency": 1}));
    assert_refused(&nowhere, &format!("{at}.direction"), &["at least one component"]);
    let unknown = with(json!({"direction": [1, null], "curve": {"cosine": {}}}));
    let error = scene::read(&unknown, &[]).expect_err("unknown").to_string();
    assert!(error.contains("unknown variant `cosine`, expected one of `sine`, `file`"), "{error}");
}

#[test]
fn accelerating_walls_take_the_body_along_and_their_work_is_its_energy() -> Result<(), Failure> {
    // V(t) = 0.1 t is slow compared with waves, which cross the box in 2/√3000 = 0.037.
    let mut simulation: Simulation<2> = built(&carried(&json!([[0, [0, 0]], [1, [0.1, 0]]]), 0.0, 0.01))?;
    let mut reactions = Vector::zeros();
    for _ in 0..100 {
        reactions = simulation.advance()?.reactions.iter().map(|one| one.force).sum();
    }
    let mass: f64 = simulation.particles.mass.iter().sum();
    let mean = simulation.particles.momentum() / mass;
    assert!((mean - Vector::from([0.1, 0.0])).amax() < 2e-3, "mean velocity {mean}");
    for velocity in &simulation.particles.velocity {
        assert!((velocity - Vector::from([0.1, 0.0])).amax() < 1e-2, "v = {velocity}");
    }
    // F = m a up to the ringing, and the work is the kinetic energy (the strain is of order 1e-8).
    assert!((reactions[0] - 0.1 * mass).abs() < 0.05 * mass, "reactions {reactions}");
    let kinetic = simulation.particles.kinetic_energy();
    assert!((simulation.external_work - kinetic).abs() < 0.05 * kinetic, "{} {kinetic}", simulation.external_work);
    Ok(())
}

/// One free body far from every wall.
fn falling(step: f64, lumping: f64) -> serde_json::Value {
    json!({
        "grid": {"size": [4, 4], "spacing": 0.5},
        "time": {"step": step, "end": 1, "lumping": lumping},
        "bodies": [{"name": "stone", "shape": {"box": {"min": [1, 2], "max": [2, 3]}}, "density": 1,
                    "velocity": [0.5, 0], "material": {"neo_hookean": {"lambda": 1000, "shear": 1000}}}],
        "gravity": {"acceleration": [0, -9.81]}
    })
}

#[test]
fn a_load_present_at_the_start_acts_from_the_start() -> Result<(), Failure> {
    for (step, lumping) in [(0.02, 1.0), (0.005, 1.0), (0.02, 0.5)] {
        let mut simulation: Simulation<2> = built(&falling(step, lumping))?;
        let start = simulation.particles.position.clone();
        run_to(&mut simulation, 0.2)?;
        // The trapezoidal rule is exact for a constant acceleration.
        let t = simulation.clock.time();
        for (x, x0) in simulation.particles.by_id().position.iter().zip(&start) {
            let fallen = x - x0 - Vector::from([0.5 * t, -0.5 * 9.81 * t * t]);
            assert!(fallen.amax() < 1e-9, "step {step}, lumping {lumping}: off by {fallen}");
        }
    }
    Ok(())
}

#[test]
fn a_body_among_accelerating_walls_has_their_velocity_after_every_step() -> Result<(), Failure> {
    // A body of one cell: every node is prescribed, so v_p = Σ N V(t_{n+1}) = V(t_{n+1}) exactly.
    let moving = json!({"velocity": [[0, [0, 0]], [1, [3, 1]]]});
    let mut simulation: Simulation<2> = built(&json!({
        "grid": {"size": [1, 1], "spacing": 1}, "time": {"step": 0.01, "end": 1}, "approximation": "linear",
        "bodies": [{"name": "load", "shape": {"box": {"min": [0.25, 0.25], "max": [0.75, 0.75]}}, "density": 1,
                    "material": {"neo_hookean": {"lambda": 10, "shear": 10}}}],
        "boundary": {"left": moving, "right": moving, "bottom": moving, "top": moving}
    }))?;
    let start = simulation.particles.position.clone();
    for _ in 0..10 {
        simulation.advance()?;
        let t = simulation.clock.time();
        // The walls have moved by the integral of their velocity, for any step.
        for (x, x0) in simulation.particles.by_id().position.iter().zip(&start) {
            assert!((x - x0 - Vector::from([1.5, 0.5]) * t * t).amax() < 1e-13, "x = {x} at t = {t}");
        }
        for (v, a) in simulation.particles.velocity.iter().zip(&simulation.particles.acceleration) {
            assert!((v - Vector::from([3.0, 1.0]) * t).amax() < 1e-13, "v = {v} at t = {t}");
            assert!((a - Vector::from([3.0, 1.0])).amax() < 1e-12, "a = {a} at t = {t}");
        }
    }
    Ok(())
}

/// (momentum, ∫ reactions dt, energy, work) of a bar between two walls that start at once with the velocity 1.
fn struck(step: f64) -> Result<[f64; 4], Failure> {
    let moving = json!({"velocity": [[0, [1]]]});
    let mut simulation: Simulation<1> = built(&json!({
        "grid": {"size": [2], "spacing": 0.1}, "time": {"step": step, "end": 0.1}, "approximation": {"lme": {}},
        "bodies": [{"name": "bar", "shape": {"box": {"min": [0.1], "max": [1.9]}}, "density": 1,
                    "material": {"neo_hookean": {"lambda": 1000, "shear": 1000}}, "particles_per_cell": 2}],
        "boundary": {"left": moving, "right": moving}
    }))?;
    let mut impulse = 0.0;
    while simulation.clock.time() < 0.06 - 1e-9 {
        let report = simulation.advance()?;
        impulse += report.dt * report.reactions.iter().map(|one| one.force[0]).sum::<f64>();
    }
    let energy = simulation.particles.kinetic_energy() + simulation.strain_energy();
    Ok([simulation.particles.momentum()[0], impulse, energy, simulation.external_work])
}

#[test]
fn the_blow_of_walls_that_start_at_once_is_in_their_reactions_and_their_work() -> Result<(), Failure> {
    for step in [2e-3, 5e-4] {
        let [momentum, impulse, energy, work] = struck(step)?;
        assert!((impulse - momentum).abs() < 0.02 * momentum, "step {step}: {impulse} for the momentum {momentum}");
        // The walls accelerate their nodes without a rebound: part of the work is lost, and none is gained.
        assert!(energy < work && work < 4.0 * energy, "step {step}: work {work}, energy {energy}");
    }
    Ok(())
}

#[test]
fn every_load_follows_its_curve() -> Result<(), Failure> {
    let ramp = Curve::new(vec![[0.0, 0.0], [4.0, 2.0]])?;
    let point = SurfacePoint::new(0, Vector::from([0.6, 0.8]), 0.25);
    let surface = |pressing| SurfaceLoad { pressing, curve: ramp.clone(), points: vec![point] };
    let loads = Loads::<2> {
        gravity: Some(Gravity { acceleration: Vector::from([0.0, -8.0]), curve: ramp.clone() }),
        surface: vec![surface(Pressing::Traction(Vector::from([16.0, 0.0]))), surface(Pressing::Pressure(40.0))],
        ..Loads::default()
    };
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [1, 1] };
    let mut particles = Particles::default();
    particles.push(Vector::from([0.5, 0.5]), Vector::zeros(), 1.0, 3.0, 0);
    let law = Material::from(NeoHookean::ciarlet(Lame::new(1.0, 1.0)?));
    let bodies = [body(law)];
    let (connectivity, nodes) = Connectivity::new(&Approximation::from(Linear), &grid, &particles.position)?;
    let (nodal, zero) = (Nodal::at_rest(&particles, &connectivity), vec![Vector::zeros(); nodes.len()]);
    let alphas = Newmark::default().alphas(1.0);
    for (t, factor) in [(0.0, 0.0), (1.0, 0.5), (2.0, 1.0), (9.0, 2.0)] {
        // A particle of mass 3 in the middle of four nodes: a quarter of m b, and of T A, to each.
        let (particles, bodies, connectivity, nodal) = (&particles, &bodies[..], &connectivity, &nodal);
        let forces = |gravity: Option<Gravity<2>>, surface: &[SurfaceLoad<2>]| {
            let loads = &Loads { gravity, surface: surface.to_vec(), ..Loads::default() };
            let step = Step {
                particles,
                bodies,
                loads,
                connectivity,
                nodal,
                alphas,
                lumping: 1.0,
                time: t,
                dt: 1.0,
                poses: None,
            };
            Equilibrium::new(step, &[]).external_force(&zero)
        };
        for force in &forces(loads.gravity.clone(), &loads.surface[..1])? {
            assert_eq!(*force, Vector::from([0.25 * 16.0 * 0.25, 0.75 * -8.0]) * factor, "t = {t}");
        }
        // −p A N on the particle at rest.
        for force in &forces(None, &loads.surface[1..])? {
            assert!((force + Vector::from([6.0, 8.0]) * (0.25 * factor)).norm() < 1e-14, "t = {t}");
        }
        let pressures = loads.pressures(t);
        assert_eq!((pressures.len(), pressures[0].particle), (1, 0));
        // p A N
        assert!((pressures[0].force - Vector::from([6.0, 8.0]) * factor).norm() < 1e-14, "t = {t}");
    }
    Ok(())
}

/// A falling stone. Its weight comes from gravity, or from the same field given in code; with inertia and without.
#[test]
fn a_uniform_field_is_gravity() -> Result<(), Failure> {
    let held = json!({"grid": {"size": [2, 2], "spacing": 0.5}, "time": {"scheme": "none", "step": 0.5, "end": 1},
        "bodies": [{"name": "block", "shape": {"box": {"min": [0, 0], "max": [2, 1]}}, "density": 3,
                    "material": {"neo_hookean": {"lambda": 1000, "shear": 1000}}}],
        "boundary": {"left": "fixed", "right": "fixed", "bottom": "fixed"}, "gravity": {"acceleration": [0, -9.81]}});
    for scene in [falling(0.02, 1.0), falling(0.02, 0.5), held] {
        let mut by_gravity: Simulation<2> = built(&scene)?;
        let mut by_field = by_gravity.clone();
        let Some(Gravity { acceleration, curve }) = by_field.loads.gravity.take() else { return Err("gravity".into()) };
        by_field.loads.field = Some(ForceField(Arc::new(move |_, _, t| acceleration * curve.value(t))));
        advance(&mut by_gravity, 2)?;
        advance(&mut by_field, 2)?;
        let (one, other) = (by_gravity.particles.by_id(), by_field.particles.by_id());
        for (x, y) in one.position.iter().zip(&other.position) {
            assert!((x - y).norm() < 1e-12, "{x} {y}");
        }
        for (g, h) in one.displacement_gradient.iter().zip(&other.displacement_gradient) {
            assert!((g - h).norm() < 1e-11, "{g} {h}");
        }
        let [a, b] = [by_gravity.external_work, by_field.external_work];
        assert!(a.abs() > 1e-6 && (a - b).abs() < 1e-11 * a.abs(), "{a} {b}");
    }
    Ok(())
}

#[test]
fn a_field_acts_on_each_particle_where_it_is_and_when() -> Result<(), Failure> {
    let mut simulation: Simulation<2> = built(&falling(0.02, 1.0))?;
    let gravity = simulation.loads.gravity.clone().ok_or("gravity")?;
    // The field depends on particle, position and time; the test detects an exchange of any of the three.
    let b = |id: usize, x: &Vector<f64, 2>, t: f64| Vector::from([0.1 * id as f64 + t, x[0] * x[1] - 2.0 * t]);
    simulation.loads.field = Some(ForceField(Arc::new(b)));
    let order: Vec<u32> = (0..simulation.particles.len() as u32).rev().collect();
    simulation.rearrange(&order);
    let particles = &simulation.particles;
    let (connectivity, nodes) = Connectivity::new(&simulation.approximation, &simulation.grid, &particles.position)?;
    let nodal = Nodal::project(particles, &connectivity, 1.0)?;
    let alphas = simulation.settings.scheme.end(0.02);
    let zero = vec![Vector::zeros(); nodes.len()];
    for t in [0.0, 0.3] {
        let equilibrium = simulation.equilibrium(&connectivity, &nodal, &[], alphas, t);
        let (force, mut expected) = (equilibrium.external_force(&zero)?, zero.clone());
        let mut sum = Vector::zeros();
        for p in 0..particles.len() {
            let of_particle =
                (b(particles.id[p] as usize, &particles.position[p], t) + gravity.acceleration) * particles.mass[p];
            sum += of_particle;
            connectivity.of(p).for_each(|(node, n, _)| expected[node] += of_particle * n);
        }
        let largest = expected.iter().map(|f| f.norm()).fold(0.0, f64::max);
        assert!(force.iter().zip(&expected).all(|(a, b)| (a - b).norm() < 1e-14 * largest), "t = {t}");
        // Σ f_I = Σ m b
        let total: Vector<f64, 2> = force.iter().sum();
        assert!((total - sum).norm() < 1e-13 * sum.norm(), "t = {t}: {total} for {sum}");
    }
    Ok(())
}

/// Gravity that varies along a line. In free fall the momentum grows by Σ m b Δt, with b from the table at each particle.
#[test]
fn gravity_follows_its_profile() -> Result<(), Failure> {
    let falling = |profile: serde_json::Value| {
        built::<2>(&json!({
            "grid": {"size": [4, 4], "spacing": 0.5},
            "time": {"step": 0.01, "end": 1},
            "bodies": [{
                "name": "block", "shape": {"box": {"min": [1, 1], "max": [2.25, 3]}}, "density": 2,
                "material": {"neo_hookean": {"lambda": 100, "shear": 100}}, "particles_per_cell": 2
            }],
            "gravity": {"acceleration": [0.3, -1], "curve": [[0, 1], [1, 3]], "profile": profile}
        }))
    };
    // s = (3 x + 4 y)/5 runs from 1.4 to 3.75: below 2 the factor is 0.5, above 3 it is 2.
    let table = json!({"along": [3, 4], "factor": [[2, 0.5], [3, 2]]});
    let factor = |x: &Vector<f64, 2>| 0.5 + 1.5 * ((3.0 * x[0] + 4.0 * x[1]) / 5.0 - 2.0).clamp(0.0, 1.0);
    let mut simulation = falling(table)?;
    let particles = &simulation.particles;
    let force: f64 = particles.position.iter().zip(&particles.mass).map(|(x, m)| m * factor(x)).sum();
    let before = particles.momentum();
    simulation.step()?;
    // The trapezoidal rule: b at both ends of the step, at t = 0 and 0.01.
    let given = Vector::from([0.3, -1.0]) * (force * 0.01 * 0.5 * (1.0 + 1.02));
    let gained = simulation.particles.momentum() - before;
    assert!((gained - given).norm() < 1e-9 * given.norm(), "{gained} for {given}");
    Ok(())
}

/// Quadrature points of faces and particles match, so a uniform load on a cube strains all particles alike. Particles at edges and corners would
/// show if they did not: functions there are products of cubic polynomials in the plane of the face.
#[test]
fn a_cube_under_uniform_loads_has_one_strain() -> Result<(), Failure> {
    let faces = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    for (degree, size) in [(1, 1.0), (2, 1.0), (3, 1.0), (3, 1.15)] {
        let on = |normal: &[i32; 3]| json!({ "half_space": { "point": normal.map(|n| f64::from(n) * size), "normal": normal.map(|n| -n) } });
        let pressed: Vec<_> =
            faces.iter().map(|normal| json!({ "body": "cube", "region": on(normal), "pressure": 5 })).collect();
        let pulled = json!([{ "body": "cube", "region": on(&faces[0]), "traction": [5, 0, 0] }]);
        for (load, of) in [("pressures", json!(pressed)), ("tractions", pulled)] {
            let body = json!({ "name": "cube", "density": 1, "shape": { "box": { "min": [0, 0, 0], "max": [size, size, size] } },
                               "material": { "neo_hookean": { "young": 1000, "poisson": 0.3 } } });
            let approximation = if degree == 1 { json!("linear") } else { json!({ "bspline": { "degree": degree } }) };
            let mut simulation: Simulation<3> = built(&json!({
                "grid": { "size": [2, 2, 2], "spacing": 0.5 }, "time": { "step": 1, "end": 1, "scheme": "none" }, "bodies": [body],
                "boundary": { "left": "sliding", "bottom": "sliding", "back": "sliding" }, "approximation": approximation,
                "solver": { "newton": { "tolerance": 1e-12 } }, load: of
            }))?;
            simulation.step()?;
            let strains = &simulation.particles.displacement_gradient;
            let apart = strains.iter().map(|h| (h - strains[0]).norm() / strains[0].norm()).fold(0.0, f64::max);
            assert!(apart < 1e-8 && strains[0].norm() > 1e-3, "degree {degree}, {size}, {load}: {apart:e}");
        }
    }
    Ok(())
}
