//! Total Lagrangian steps on one grid: the answer does not depend on the number of steps. Tests of the conditions for a grid reset.

use crate::support::{Failure, advance, apart, built, merged, scene, solid};
use bfree::mechanics::reference::GridReset;
use bfree::particles::Particles;
use bfree::simulation::{Simulation, StepError};
use bfree::tensor::Vector;
use serde_json::json;
use std::num::NonZeroU64;

const BEAM: &str = "elastica.json";
const NO_BETA: &str = "time.beta=null";
const NO_GAMMA: &str = "time.gamma=null";

/// One body that a fixed face of the box holds from the start; others may come to walls.
#[test]
fn a_clamped_body_keeps_its_grid_by_default() -> Result<(), Failure> {
    let asked = |name: &str, overrides: &[&str]| -> Result<GridReset, Failure> {
        Ok(scene::<2>(name, overrides)?.settings.grid_reset)
    };
    let (kept, new) = (GridReset::Strain(0.1), GridReset::EveryStep);
    for (overrides, renewal) in [
        (&[][..], kept),
        (&[r#"boundary.left="sliding""#], new),
        (&[r#"boundary={"right":"fixed"}"#], new),
        (&[r#"transfer={"pic":{}}"#], new),
        (&[r#"grid.reset="every_step""#], new),
        (&[r#"time.scheme="none""#, NO_BETA, NO_GAMMA], GridReset::Strain(1.0)),
    ] {
        assert_eq!(asked("cantilever.json", overrides)?, renewal, "{overrides:?}");
    }
    assert_eq!(asked("rebound.json", &[])?, new);
    Ok(())
}

/// A short beam, bent by half of its length in `steps` load steps.
fn beam(steps: u32, more: &[&str]) -> Result<Simulation<2>, Failure> {
    let step = format!("time.step={}", 1.0 / f64::from(steps));
    let short = [
        "grid.size=[8, 8]",
        "grid.spacing=0.5",
        r#"bodies.0.shape={"box":{"min":[0,6],"max":[6,7]}}"#,
        r#"tractions=[{"body":"beam","region":{"half_space":{"point":[6,0],"normal":[-1,0]}},"traction":[0,-10],"curve":[[0,0],[1,1]]}]"#,
        "output={}",
        "solver.newton.tolerance=1e-12",
        &step,
    ];
    scene(BEAM, &[&short, more].concat())
}

/// Runs to t = 1. Returns for each step whether it reset the grid.
fn run(simulation: &mut Simulation<2>) -> Result<Vec<bool>, Failure> {
    Ok(forces(simulation)?.into_iter().map(|(reset, _)| reset).collect())
}

/// The same, with the vertical force of the first wall or condition.
fn forces(simulation: &mut Simulation<2>) -> Result<Vec<(bool, f64)>, Failure> {
    let mut steps = Vec::new();
    while simulation.clock.time() < 1.0 - 1e-9 {
        let step = simulation.advance()?;
        steps.push((step.reset, step.reactions[0].force[1]));
    }
    Ok(steps)
}

#[test]
fn the_answer_does_not_depend_on_the_number_of_load_steps() -> Result<(), Failure> {
    for family in [r#"{"bspline": {"degree": 3}}"#, r#""linear""#, r#"{"lme": {"gamma": 3}}"#, r#""gimp""#] {
        let family = format!("approximation={family}");
        let mut one = beam(1, &[&family])?;
        run(&mut one)?;
        let lowest = one.particles.position.iter().map(|x| x[1]).fold(f64::INFINITY, f64::min);
        assert!(lowest < 4.0, "bent by half of its length: {lowest}");
        for steps in [2, 7] {
            let mut more = beam(steps, &[&family])?;
            let renewed = run(&mut more)?;
            assert_eq!(renewed.iter().filter(|&&renewed| renewed).count(), 1, "the first one alone");
            // Newton's tolerance of 1e-12 in residuals, for a beam of length 6 that is soft in bending.
            assert!(apart(&one, &more) < 1e-8, "{family}, {steps} steps: {:e}", apart(&one, &more));
            let ratio = more.strain_energy() / one.strain_energy();
            assert!((ratio - 1.0).abs() < 1e-8, "{family}, {steps} steps: {ratio}");
        }
        // With a grid reset in every step, the answer depends on the number of steps.
        let mut renewed = beam(7, &[&family, r#"grid.reset="every_step""#])?;
        assert!(run(&mut renewed)?.iter().all(|&renewed| renewed) && renewed.history.resets_grid());
        assert!(apart(&one, &renewed) > 1e-5, "{family}: {:e}", apart(&one, &renewed));
    }
    Ok(())
}

#[test]
fn a_strain_makes_it_anew() -> Result<(), Failure> {
    let mut simulation = beam(10, &[r#"grid.reset={"strain": 0.05}"#])?;
    let renewed = run(&mut simulation)?;
    let count = renewed.iter().filter(|&&renewed| renewed).count();
    assert!(renewed[0] && count > 1 && count < 10, "{renewed:?}");
    assert!(!GridReset::Strain(0.05).keeps(f64::NAN));
    let error = beam(1, &[r#"grid.reset={"strain": 0}"#]).err().ok_or("no strain")?.to_string();
    assert!(error.contains("grid.reset.strain") && error.contains("> 0"), "{error}");
    Ok(())
}

/// A block hangs from its top and is lowered onto a floor. At the start no particle has nodes of the floor.
#[test]
fn a_wall_that_is_met_makes_it_anew() -> Result<(), Failure> {
    let lowered = r#"prescribed=[{"region":{"half_space":{"point":[0,1.3],"normal":[0,-1]}},"displacement":[[0,[0,0]],[1,[0,-0.4]]]}]"#;
    let hanging = [
        "grid={\"size\":[2,2],\"spacing\":0.1}",
        r#"bodies.0.shape={"box":{"min":[0.5,0.3],"max":[1.5,1.4]}}"#,
        r#"boundary={"bottom":"sliding"}"#,
        "tractions=[]",
        lowered,
        "output={}",
        "time.step=0.05",
        r#"grid.reset="never""#,
    ];
    let mut simulation: Simulation<2> = scene(BEAM, &hanging)?;
    let by_floor = forces(&mut simulation)?;
    let renewals: Vec<usize> = (0..by_floor.len()).filter(|&step| by_floor[step].0).collect();
    // The block comes within a cell of the floor after t = 0.2. From the next step on, the floor carries load.
    assert!(renewals.len() >= 2 && renewals.len() <= 4 && (10..=13).contains(&renewals[1]), "{renewals:?}");
    assert!(by_floor[..renewals[1]].iter().all(|(_, force)| *force == 0.0), "{by_floor:?}");
    assert!(by_floor[renewals[1]..].windows(2).all(|pair| 0.0 < pair[0].1 && pair[0].1 < pair[1].1), "{by_floor:?}");
    let lowest = simulation.particles.position.iter().map(|x| x[1]).fold(f64::INFINITY, f64::min);
    assert!(lowest > 0.0, "{lowest}");
    Ok(())
}

/// A punch is driven onto a block. At the start they share no node. Blocks that touch at the start are bonded, which causes no grid reset.
#[test]
fn a_body_that_is_met_makes_it_anew() -> Result<(), Failure> {
    let driven = |gap: f64| -> Result<_, Failure> {
        let block = |name: &str, [low, high]: [[f64; 2]; 2]| {
            let law = json!({"neo_hookean": {"young": 1200, "poisson": 0}});
            json!({"name": name, "density": 1, "material": law, "shape": {"box": {"min": low, "max": high}}})
        };
        let (below, above) = ([[0.5, 0.0], [1.5, 0.5]], [[0.8, 0.5 + gap], [1.2, 0.9 + gap]]);
        let bodies = format!("bodies={}", json!([block("block", below), block("punch", above)]));
        // The region of the punch during the whole run.
        let grip = r#"prescribed=[{"region":{"half_space":{"point":[0,0.65],"normal":[0,-1]}},"displacement":[[0,[0,0]],[1,[0,-0.4]]]}]"#;
        let onto = [
            "grid={\"size\":[2,2],\"spacing\":0.1}",
            &bodies,
            r#"boundary={"bottom":"fixed"}"#,
            "tractions=[]",
            "output={}",
            "time.step=0.05",
            r#"approximation="linear""#,
            grip,
        ];
        let mut simulation: Simulation<2> = scene(BEAM, &onto)?;
        let by_floor = forces(&mut simulation)?;
        let end = |body: u32, best: fn(f64, f64) -> f64, start| {
            let particles = &simulation.particles;
            // The part of the block below the punch.
            let under = |(x, of): &(&Vector<f64, 2>, &u32)| **of == body && (x[0] - 1.0).abs() < 0.15;
            let of_body = particles.position.iter().zip(&particles.body).filter(under);
            of_body.map(|(x, _)| x[1]).fold(start, best)
        };
        let (highest, lowest) = (end(0, f64::max, 0.0), end(1, f64::min, 2.0));
        Ok((by_floor, lowest - highest))
    };
    let (by_floor, apart) = driven(0.3)?;
    let first = by_floor.iter().skip(1).position(|(renewed, _)| *renewed).ok_or("not made anew")? + 1;
    // Particles 0.025 above the lower end of the punch reach the cell above the block after 0.225.
    assert_eq!(first, 12, "{by_floor:?}");
    assert!(by_floor[..first].iter().all(|(_, force)| force.abs() < 1e-9), "{by_floor:?}");
    assert!(by_floor[by_floor.len() - 1].1 > 1.0 && apart > 0.0, "{apart}, {by_floor:?}");
    let (by_floor, _) = driven(0.0)?;
    // No reset occurs until the block bulges to nodes of the floor that had no load before.
    assert!(by_floor[1..10].iter().all(|(renewed, _)| !renewed) && by_floor[9].1 > 1.0, "{by_floor:?}");
    Ok(())
}

#[test]
fn a_step_that_fails_leaves_it_as_it_was() -> Result<(), Failure> {
    let mut simulation = beam(4, &[])?;
    simulation.step()?;
    let particles = simulation.particles.clone();
    simulation.settings.newton.max_iterations = 1;
    assert!(matches!(simulation.step(), Err(StepError::Unbalanced { .. })));
    assert_eq!(simulation.particles, particles);
    assert!(!simulation.history.resets_grid());
    // The next step gives the same bits, with stored or recomputed shape functions, and with particles in another order.
    simulation.settings.newton.max_iterations = 30;
    let mut other = simulation.clone();
    let backwards: Vec<u32> = (0..other.particles.len() as u32).rev().collect();
    other.rearrange(&backwards);
    simulation.step()?;
    other.step()?;
    assert_eq!(simulation.particles.by_id(), other.particles.by_id());
    Ok(())
}

#[test]
fn particles_may_lie_in_any_order() -> Result<(), Failure> {
    let mut simulation = beam(4, &[])?;
    let mut shuffled = simulation.clone();
    // Every seventh particle: an order so far from that of the cells that the first step sorts the particles.
    let count = shuffled.particles.len();
    let order: Vec<u32> = (0..7).flat_map(|start| (start..count).step_by(7)).map(|p| p as u32).collect();
    shuffled.rearrange(&order);
    for _ in 0..4 {
        simulation.step()?;
        shuffled.step()?;
        assert_eq!(simulation.particles.by_id(), shuffled.particles.by_id());
    }
    assert_ne!(shuffled.particles.id[1], 7, "they were put in order");
    Ok(())
}

#[test]
fn what_was_changed_by_hand_is_noticed() -> Result<(), Failure> {
    let mut simulation = beam(4, &[])?;
    simulation.step()?;
    simulation.forget();
    simulation.step()?;
    simulation.approximation = bfree::approximation::Linear.into();
    let error = simulation.clone().step().expect_err("other functions, other nodes").to_string();
    assert!(error.contains("call Simulation::forget"), "{error}");
    simulation.forget();
    simulation.step()?;
    Ok(())
}

/// Every piece of the tangent by dual numbers: with both masses, with damping, and with a scheme that balances within the step.
#[test]
fn the_tangent_is_the_derivative_on_a_grid_that_is_kept() -> Result<(), Failure> {
    for scheme in [r#""newmark""#, r#"{"generalized_alpha": {"spectral_radius": 0.6}}"#] {
        let (inertia, more) = (format!("time.scheme={scheme}"), r#"damping={"mass": 0.1, "stiffness": 0.01}"#);
        let kept = r#"grid.reset="never""#;
        let overrides = [&inertia, more, kept, "time.lumping=0.4", "aggregation=true", NO_BETA, NO_GAMMA];
        let mut simulation: Simulation<2> = scene("rebound.json", &overrides)?;
        simulation.settings.check_tangent = NonZeroU64::new(1);
        for step in 0..4 {
            assert_eq!(simulation.step()?.reset, step == 0);
        }
    }
    Ok(())
}

/// A disc in flight rotates and vibrates. Grids that are kept and that are reset agree, except for the losses of the projection.
#[test]
fn inertia_acts_on_a_grid_that_is_kept() -> Result<(), Failure> {
    let damped = r#"damping={"mass": 0.3, "stiffness": 0.01}"#;
    for (scheme, damping) in [
        (r#""newmark""#, "damping=null"),
        (r#""newmark""#, damped),
        (r#"{"generalized_alpha": {"spectral_radius": 0.6}}"#, damped),
    ] {
        let flown = |renewed: &str| -> Result<Simulation<2>, Failure> {
            let overrides = [
                &format!("time.scheme={scheme}"),
                &format!("grid.reset=\"{renewed}\""),
                r#"bodies[0].layout="regular""#,
                "time.step=0.01",
                "time.lumping=0.05",
                damping,
                NO_BETA,
                NO_GAMMA,
                "solver.newton.tolerance=1e-12",
                r#"gravity={"acceleration": [0, -0.1]}"#,
            ];
            let mut simulation: Simulation<2> = scene("rebound.json", &overrides)?;
            let centre = Vector::from([2.5, 2.5]);
            simulation.set_velocity_on_nodes(|x| Vector::from([1.0 - 0.2 * (x - centre)[1], 0.2 * (x - centre)[0]]))?;
            advance(&mut simulation, 100)?;
            Ok(simulation)
        };
        let (kept, renewed) = (flown("never")?, flown("every_step")?);
        let mass: f64 = kept.particles.mass.iter().sum();
        // Momentum: weight times time, less the momentum taken by damping, whatever the grid.
        let change = kept.particles.momentum() - renewed.particles.momentum();
        assert!(change.norm() < 1e-9 * mass, "{scheme}: {change}");
        let gained = kept.particles.momentum() / mass - Vector::from([1.0, -0.1]);
        assert!((gained.norm() < 1e-9) == (damping != damped), "{scheme}: {gained}");
        let difference = apart(&kept, &renewed);
        assert!(difference < 2e-3, "{scheme}: {difference:e}");
        let energy = |of: &Simulation<2>| of.particles.kinetic_energy() + of.strain_energy();
        assert!((energy(&kept) / energy(&renewed) - 1.0).abs() < 1e-2, "{scheme}");
        let lost = kept.dissipated / renewed.dissipated - 1.0;
        assert!(damping != damped || lost.abs() < 1e-2, "{scheme}: {lost}");
    }
    Ok(())
}

/// The momentum of the first body along x at the start and after some steps of a scene, and the number of grid resets.
fn resets(name: &str, reset: &str, steps: usize) -> Result<([f64; 2], usize), Failure> {
    let mut simulation: Simulation<2> = scene(name, &[&format!("grid.reset=\"{reset}\"")])?;
    let momentum = |particles: &Particles<2>| {
        let of_first = (0..particles.len()).filter(|&p| particles.body[p] == 0);
        of_first.map(|p| particles.velocity[p][0] * particles.mass[p]).sum::<f64>()
    };
    let (start, mut resets) = (momentum(&simulation.particles), 0);
    for _ in 0..steps {
        resets += usize::from(simulation.step()?.reset);
    }
    Ok(([start, momentum(&simulation.particles)], resets))
}

/// In contact the grid is reset in every step; in flight it is not. A disc rebounds from a wall, and two discs from each other. Their
/// momentum equals that of a run with a reset in every step, except for the losses of that run in flight.
#[test]
fn bodies_leave_a_wall_and_each_other() -> Result<(), Failure> {
    let ([start, kept], renewals) = resets("rebound.json", "never", 800)?;
    let ([_, renewed], _) = resets("rebound.json", "every_step", 800)?;
    assert!((kept / renewed - 1.0).abs() < 0.05 && kept < -0.85 * start, "{kept} and {renewed} of {start}");
    // The disc touches the wall for about 3 of 40 units of time.
    assert!((2..200).contains(&renewals), "{renewals}");
    let ([_, kept], renewals) = resets("collision.json", "never", 200)?;
    let ([_, renewed], _) = resets("collision.json", "every_step", 200)?;
    assert!((kept / renewed - 1.0).abs() < 0.05 && kept < 0.0, "{kept} and {renewed}");
    assert!((2..150).contains(&renewals), "{renewals}");
    Ok(())
}

/// One block stands on the floor, another one falls beside it. From the impact on the floor is a contact, which both may leave.
#[test]
fn a_wall_that_is_met_holds_nobody_from_the_start() -> Result<(), Failure> {
    let block = |name: &str, min: [f64; 2], speed: f64| {
        let shape = json!({ "box": { "min": min, "max": [min[0] + 0.5, min[1] + 0.5] } });
        merged(solid(name, 1000, shape), json!({ "velocity": [0, speed] }))
    };
    let scene = json!({
        "grid": { "size": [3, 1.5], "spacing": 0.25, "reset": "never" },
        "approximation": "linear",
        "time": { "step": 0.02, "end": 1 },
        "bodies": [block("resting", [0.25, 0.0], 0.0), block("falling", [2.0, 0.5], -2.0)],
        "boundary": { "bottom": "fixed" }
    });
    let mut simulation: Simulation<2> = built(&scene)?;
    assert!(simulation.advance()?.reset);
    assert!(simulation.history.constrained().contains(&0));
    let mut met = false;
    while simulation.clock.time() < 0.4 {
        let renewed = simulation.advance()?.reset;
        assert!(renewed == met, "at {}", simulation.clock.time());
        met = simulation.history.resets_grid();
    }
    assert!(met && simulation.history.constrained().is_empty(), "{:?}", simulation.history);
    Ok(())
}
