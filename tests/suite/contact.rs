//! The distance between the surfaces of two bodies when contact begins: the table of `docs/src/limits.md`, measured.

use crate::support::{Failure, built, restored, solid};
use bfree::scene;
use bfree::simulation::Simulation;
use serde_json::json;

/// Two bars of 8 cells collide. They start 5 cells apart, each with half a cell per unit of time. Returns their distance in cells when they
/// have lost the first hundredth of their kinetic energy; `place` shifts both along the grid.
fn distance(approximation: &str, place: f64) -> Result<f64, Failure> {
    let bar = |name: &str, start: f64, velocity: f64| {
        let (from, to) = (start + place, start + 8.0 + place);
        format!(
            r#"{{"name": "{name}", "density": 1, "velocity": [{velocity}], "shape": {{"box": {{"min": [{from}], "max": [{to}]}}}},
                 "material": {{"neo_hookean": {{"young": 100, "poisson": 0}}}}}}"#
        )
    };
    let (left, right) = (bar("left", 8.0, 0.5), bar("right", 21.0, -0.5));
    let text = format!(
        r#"{{"grid": {{"size": [40], "spacing": 1}}, "time": {{"step": 0.02, "end": 8}}, "approximation": {approximation},
             "bodies": [{left}, {right}]}}"#
    );
    let mut simulation = scene::read(&text, &[])?.build::<1>(".".as_ref())?;
    let start = simulation.particles.kinetic_energy();
    while simulation.particles.kinetic_energy() > 0.99 * start {
        simulation.step()?;
        assert!(simulation.clock.time() < 5.0, "{approximation} at {place}: the bars ran through each other");
    }
    Ok(5.0 - simulation.clock.time())
}

#[test]
fn bodies_touch_as_far_apart_as_the_manual_says() -> Result<(), Failure> {
    let manual = include_str!("../../docs/src/limits.md");
    let mut rows = 0;
    for row in manual.lines().filter(|row| row.starts_with("| `\"approximation\": ")) {
        let [approximation, least, most] =
            <[&str; 3]>::try_from(row.trim_matches(['|', ' ']).split(" | ").collect::<Vec<_>>()).map_err(|_| row)?;
        let approximation = approximation.trim_matches('`').trim_start_matches("\"approximation\": ");
        let places = (0..10).map(|tenth| distance(approximation, 0.1 * f64::from(tenth)));
        let found = places.collect::<Result<Vec<_>, Failure>>()?;
        let range = found.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), &x| (low.min(x), high.max(x)));
        // The manual gives tenths of a cell, rounded.
        for (found, said) in [(range.0, least), (range.1, most)] {
            assert!((found - said.parse::<f64>()?).abs() < 0.06, "{row}: {found}");
        }
        // `bfree check` gives the same numbers.
        let functions: bfree::approximation::Parameters = serde_json::from_str(approximation)?;
        assert_eq!(functions.contact_distance(), Some([least.parse()?, most.parse()?]), "{row}");
        rows += 1;
    }
    assert_eq!(rows, 6);
    Ok(())
}

/// Two blocks, one on the other, without inertia. They are bonded from the start; a restart must not treat them as bodies that have met
/// later.
#[test]
fn a_restart_knows_which_bodies_are_bonded() -> Result<(), Failure> {
    let shape = |low: f64| json!({ "box": { "min": [0.5, low], "max": [1.25, low + 0.5] } });
    let scene = json!({
        "grid": { "size": [2, 1.5], "spacing": 0.25 },
        "approximation": "linear",
        "time": { "step": 0.25, "end": 1, "scheme": "none" },
        "bodies": [solid("lower", 1000, shape(0.0)), solid("upper", 1000, shape(0.5))],
        "boundary": { "bottom": "fixed" },
        "gravity": { "acceleration": [0, -20], "curve": [[0, 0], [1, 1]] }
    });
    let start: Simulation<2> = built(&scene)?;
    let mut simulation = start.clone();
    simulation.advance()?;
    assert_eq!(simulation.history.bonded(), &[[0, 1]].into());
    let mut continued = restored(&simulation, &start)?;
    assert_eq!(continued.history.bonded(), simulation.history.bonded());
    for _ in 0..2 {
        assert!(!simulation.advance()?.reset && !continued.advance()?.reset);
    }
    assert_eq!(continued.particles, simulation.particles);
    Ok(())
}
