//! A run that is continued from a checkpoint has the state of the whole run: particles, contacts, held conditions, work and losses, to the
//! bit.

use crate::support::{Failure, advance, built, merged, restored, solid};
use bfree::simulation::Simulation;
use serde_json::{Value, json};

/// Whether two simulations have the same state.
fn assert_equal<const D: usize>(one: &Simulation<D>, other: &Simulation<D>, when: &str) {
    assert_eq!(one.particles, other.particles, "particles {when}");
    assert_eq!(one.loads.contacts.points, other.loads.contacts.points, "surfaces {when}");
    assert_eq!(one.loads.contacts.obstacles, other.loads.contacts.obstacles, "obstacles {when}");
    let between = |of: &Simulation<D>| {
        of.loads.contacts.between.as_ref().map(|between| (between.pairs.clone(), between.slips.clone(), between.energy))
    };
    assert_eq!(between(one), between(other), "contact between bodies {when}");
    assert_eq!(one.history.constrained(), other.history.constrained(), "held conditions {when}");
    assert_eq!(one.history.bonded(), other.history.bonded(), "bonded bodies {when}");
    assert_eq!((one.external_work, one.dissipated), (other.external_work, other.dissipated), "work {when}");
}

/// Compares a whole run with its continuation from a checkpoint after `before` steps. `holds` says whether the run has the state that matters
/// there.
fn continued_as_whole<const D: usize>(
    scene: &Value,
    before: usize,
    holds: impl Fn(&Simulation<D>) -> bool,
) -> Result<(), Failure> {
    let start: Simulation<D> = built(scene)?;
    let mut simulation = start.clone();
    advance(&mut simulation, before)?;
    assert!(holds(&simulation), "{scene}: the run has nothing to restore");
    let mut continued = restored(&simulation, &start)?;
    assert_equal(&continued, &simulation, "of the checkpoint");
    for _ in 0..3 {
        simulation.advance()?;
        continued.advance()?;
        assert_equal(&continued, &simulation, &format!("at t = {}", simulation.clock.time()));
    }
    Ok(())
}

fn block(name: &str, min: [f64; 2], max: [f64; 2], velocity: [f64; 2]) -> Value {
    merged(solid(name, 10000, json!({"box": {"min": min, "max": max}})), json!({"velocity": velocity}))
}

#[test]
fn every_pair_of_bodies_keeps_its_slip_and_its_loss() -> Result<(), Failure> {
    let scene = json!({
        "grid": {"size": [4, 2], "spacing": 0.25},
        "time": {"step": 0.02, "end": 1},
        "bodies": [
            block("floor", [0.25, 0.5], [3.75, 1.0], [0.0, 0.0]),
            block("fast", [0.5, 1.0], [1.25, 1.5], [1.0, 0.0]),
            block("slow", [2.5, 1.0], [3.25, 1.5], [-0.3, 0.0])
        ],
        "prescribed": [{"region": {"box": {"min": [0, 0], "max": [4, 0.5]}}, "displacement": [[0, [0, 0]]]}],
        "gravity": {"acceleration": [0.3, -1]},
        "contact": {"friction": 0.5}
    });
    let holds = |simulation: &Simulation<2>| {
        let Some(between) = &simulation.loads.contacts.between else { return false };
        let losses: Vec<f64> = between.pairs.iter().map(|pair| pair.friction_loss).collect();
        let slides = |number: usize| between.slips.keys().any(|[_, pair]| *pair == number) && losses[number] > 0.0;
        slides(0) && slides(1) && losses[0] != losses[1]
    };
    continued_as_whole(&scene, 12, holds)
}

#[test]
fn a_wall_that_holds_a_body_from_the_start_still_does() -> Result<(), Failure> {
    let scene = json!({
        "grid": {"size": [2, 1], "spacing": 0.125, "reset": {"strain": 0.3}},
        "time": {"step": 0.005, "end": 1},
        "bodies": [block("stands", [0.5, 0.0], [1.25, 0.5], [0.0, 0.0])],
        "boundary": {"bottom": "sliding", "left": "sliding"},
        "gravity": {"acceleration": [3, -10]}
    });
    continued_as_whole::<2>(&scene, 8, |simulation| !simulation.history.constrained().is_empty())
}

#[test]
fn cells_keep_the_dilatation_of_the_last_grid_reset() -> Result<(), Failure> {
    let rubber = json!({"neo_hookean": {"young": 1000, "poisson": 0.49}});
    let shape = json!({"box": {"min": [0.5, 0], "max": [1.53, 1.02]}});
    let scene = json!({
        "grid": {"size": [2, 1.5], "spacing": 0.25, "reset": "never"},
        "time": {"step": 0.1, "end": 1, "scheme": "none"},
        "bodies": [merged(solid("block", 1000, shape), json!({"material": rubber, "volumetric": "mean_dilatation"}))],
        "boundary": {"bottom": "fixed"},
        "gravity": {"acceleration": [20, -200], "curve": [[0, 0], [1, 1]]}
    });
    continued_as_whole::<2>(&scene, 4, |simulation| {
        simulation.particles.dilatation.iter().any(|j| (j - 1.0).abs() > 1e-6)
    })
}

#[test]
fn a_free_obstacle_keeps_its_turn_in_space() -> Result<(), Failure> {
    let brick = json!({"name": "brick", "shape": {"box": {"min": [0.5, 1.2, 0.4], "max": [1.2, 1.5, 1.3]}}, "friction": 0.4,
                       "free": {"density": 1.5, "velocity": [0.3, -0.2, 0.1], "spin": [0.5, -2, 1]}});
    let scene = json!({
        "grid": {"size": [2, 2, 2], "spacing": 0.5},
        "time": {"step": 0.02, "end": 1},
        "bodies": [solid("block", 1000, json!({"box": {"min": [0.5, 0, 0.5], "max": [1.5, 0.5, 1.5]}}))],
        "obstacles": [brick]
    });
    let turns = |simulation: &Simulation<3>| {
        let free = simulation.loads.contacts.obstacles[0].free.as_ref();
        free.is_some_and(|body| (body.rotation - body.rotation.transpose()).norm() > 0.1)
    };
    continued_as_whole(&scene, 5, turns)
}
