//! A piece of a body beyond an empty cell, or another body there, changes nothing in a body.
//!
//! Newton's method measures the residual of the whole scene. Its tolerance is therefore the only difference that is allowed.

use crate::support::{Failure, built, merged, solid, with};
use bfree::simulation::Simulation;
use bfree::tensor::{Tensor, Vector};
use serde_json::{Value, json};
use std::collections::BTreeMap;

const SPACING: f64 = 0.25;

/// Residuals are 1e-13 of their largest force; soft bodies have larger errors of position and velocity.
const ROUND_OFF: f64 = 1e-9;

/// The left end of the second piece without gap: the right end of the first one.
const END: f64 = 1.5;

/// Families of shape functions, and the number of empty cells from which on two pieces share no node.
const FAMILIES: [(&str, f64); 5] = [
    (r#""linear""#, 1.0),
    // The particle of a cut cell keeps its half-width, and reaches a node of the empty cell. That node follows the nearest well-filled cell,
    // which must be of its own piece.
    (r#""gimp""#, 3.0),
    (r#"{"bspline": {"degree": 2}}"#, 3.0),
    (r#"{"bspline": {"degree": 3}}"#, 3.0),
    // Functions of exp(−3 |D|²/h²) are cut off at 1e-6: they reach 2.15 spacings to both sides.
    (r#"{"lme": {"gamma": 3}}"#, 5.0),
];

/// A box that stands on the floor, from `left` on.
fn upright(dimension: usize, left: f64, [width, height]: [f64; 2]) -> Value {
    let (mut min, mut max) = (vec![0.5; dimension], vec![1.0; dimension]);
    (min[0], min[1]) = (left, 0.0);
    (max[0], max[1]) = (left + width, height);
    json!({"box": {"min": min, "max": max}})
}

/// The first piece.
fn first(dimension: usize) -> Value {
    upright(dimension, 0.5, [END - 0.5, 1.0])
}

/// Widths and heights of the second piece.
const SIZES: [[f64; 2]; 2] = [[0.5, 0.75], [0.3, 0.6]];

/// The width of a second piece in a part of a cell. Load steps have no equilibrium of such a piece.
const THIN: f64 = 0.07;

fn scene(dimension: usize, family: &str, (statics, reset): (bool, &str), bodies: Vec<Value>) -> Result<Value, Failure> {
    let time = if statics {
        json!({"step": 0.5, "end": 1, "scheme": "none"})
    } else {
        json!({"step": 0.02, "end": 1, "lumping": 0.3})
    };
    let (mut size, mut load) = (vec![1.5; dimension], vec![0.0; dimension]);
    size[0] = 4.5;
    (load[0], load[1]) = (3.0, -8.0);
    Ok(json!({
        "grid": {"size": size, "spacing": SPACING, "reset": reset},
        "approximation": serde_json::from_str::<Value>(family)?,
        "time": time,
        "bodies": bodies,
        "boundary": {"bottom": "fixed"},
        "gravity": {"acceleration": load},
        "solver": {"newton": {"tolerance": 1e-13}}
    }))
}

fn body(name: &str, young: u32, shape: Value, statics: bool) -> Value {
    let dimension = shape
        .pointer("/box/min")
        .or(shape.pointer("/union/0/box/min"))
        .map_or(2, |min| min.as_array().map_or(2, Vec::len));
    let velocity: Vec<f64> = [0.4, -0.3, 0.2].into_iter().take(dimension).collect();
    let moving = if statics { json!({}) } else { json!({"velocity": velocity}) };
    merged(solid(name, young, shape), moving)
}

/// Position, velocity and deformation.
type State<const D: usize> = (Vector<f64, D>, Vector<f64, D>, Tensor<f64, D>);

/// The state of each particle of the first piece after three steps (two in load steps), by its position at the start.
fn first_piece<const D: usize>(scene: &Value) -> Result<BTreeMap<Vec<u64>, State<D>>, Failure> {
    let mut simulation: Simulation<D> = built(scene).map_err(|error| format!("{scene}: {error}"))?;
    let start = simulation.particles.by_id();
    while simulation.clock.steps() < 3 && simulation.clock.time() < 0.99 {
        let step = simulation.advance().map_err(|error| format!("{scene}: {}", bfree::causes::on_one_line(&error)))?;
        assert!(step.failed.is_empty(), "{scene}: {}", step.failed[0].why);
    }
    let end = simulation.particles.by_id();
    let own = (0..start.len()).filter(|&p| start.is_solid(p) && start.body[p] == 0 && start.position[p][0] < END);
    let state = |p: usize| {
        let velocity = end.velocity.get(p).copied().unwrap_or_else(Vector::zeros);
        (end.position[p], velocity, end.displacement_gradient[p])
    };
    Ok(own.map(|p| (start.position[p].iter().map(|x| x.to_bits()).collect(), state(p))).collect())
}

/// The largest difference of a position (in spacings), a velocity, or a deformation. The first piece must have moved.
fn apart<const D: usize>(alone: &Value, beside: &Value) -> Result<f64, Failure> {
    let (alone, beside) = (first_piece::<D>(alone)?, first_piece::<D>(beside)?);
    assert!(alone.len() > 20 && alone.keys().eq(beside.keys()), "the same particles");
    let bent = alone.values().map(|(_, _, h)| h.norm()).fold(0.0, f64::max);
    assert!(bent > 1e-3, "nothing happens: {bent}");
    let difference = |((x, v, h), (y, w, i)): (&State<D>, &State<D>)| {
        ((x - y).norm() / SPACING).max((v - w).norm()).max((h - i).norm())
    };
    Ok(alone.values().zip(beside.values()).map(difference).fold(0.0, f64::max))
}

/// All cases of one family and one kind of time.
fn independent<const D: usize>(family: &str, reach: f64, kind: (bool, &str)) -> Result<(), Failure> {
    let statics = kind.0;
    let one = || body("one", 500, first(D), statics);
    let alone = scene(D, family, kind, vec![one()])?;
    let touching = |scene: Value| with(scene, &[("/contact", json!({"friction": 0.3}))]);
    // Contact needs two bodies. The other one is far away.
    let far_away = body("two", 3000, upright(D, END + 9.0 * SPACING, SIZES[0]), statics);
    let alone_with_contact = touching(scene(D, family, kind, vec![one(), far_away])?);
    for (k, [width, height]) in SIZES.into_iter().enumerate() {
        let size = [if k > 0 && !statics { THIN } else { width }, height];
        let second = |cells: f64| upright(D, END + cells * SPACING, size);
        // With contact, bodies have nodes of their own, so that one empty cell is enough for all families.
        for cells in [1.0, 1.0 + 0.37 * (k + 1) as f64] {
            let two = body("two", 3000, second(cells), statics);
            let far = apart::<D>(&alone_with_contact, &touching(scene(D, family, kind, vec![one(), two])?))?;
            assert!(far < ROUND_OFF, "D = {D}, {family}, {kind:?}, contact, {cells} cells, {size:?}: {far:e}");
        }
        // Without contact, and for pieces of one body, functions must not share nodes.
        for cells in [reach, reach + 0.41] {
            let two = body("two", 3000, second(cells), statics);
            let far = apart::<D>(&alone, &scene(D, family, kind, vec![one(), two])?)?;
            assert!(far < ROUND_OFF, "D = {D}, {family}, {kind:?}, two bodies, {cells} cells, {size:?}: {far:e}");
            let both = body("one", 500, json!({"union": [first(D), second(cells)]}), statics);
            let far = apart::<D>(&alone, &scene(D, family, kind, vec![both])?)?;
            assert!(far < ROUND_OFF, "D = {D}, {family}, {kind:?}, two pieces, {cells} cells, {size:?}: {far:e}");
        }
    }
    Ok(())
}

#[test]
fn a_piece_beyond_an_empty_cell_changes_nothing() -> Result<(), Failure> {
    for (family, reach) in FAMILIES {
        for statics in [true, false] {
            for reset in ["never", "every_step"] {
                independent::<2>(family, reach, (statics, reset))?;
            }
        }
    }
    Ok(())
}

#[test]
fn a_piece_beyond_an_empty_cell_changes_nothing_in_space() -> Result<(), Failure> {
    let [linear, _, quadratic, ..] = FAMILIES;
    for (statics, reset) in [(true, "every_step"), (false, "never")] {
        independent::<3>(linear.0, linear.1, (statics, reset))?;
        independent::<3>(quadratic.0, quadratic.1, (statics, reset))?;
    }
    Ok(())
}
