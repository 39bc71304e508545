//! The columns of reactions: forces, torques, and the load of a path.

use super::run::Run;
use super::{DENSITY, assert_near, assert_vector, elastic};
use crate::support::{Failure, merged, with};
use nalgebra::Vector3;
use serde_json::{Value, json};

/// A block whose weight one condition carries.
fn hanging(condition: Value) -> Value {
    let scene = json!({
        "grid": {"size": [1, 1, 1], "spacing": 0.125},
        "approximation": "linear",
        "time": {"step": 0.5, "end": 1, "scheme": "none"},
        "gravity": {"acceleration": [8.0, -15.0, 4.0]},
        "bodies": [elastic("block", [0.25; 3], [0.75; 3])],
        "solver": {"newton": {"tolerance": 1e-12}},
        "output": {"every": 0.5, "fields": ["mass"]}
    });
    merged(scene, condition)
}

#[test]
fn reactions_have_the_components_of_the_weight() -> Result<(), Failure> {
    for (k, face) in ["left", "right", "bottom", "top", "back", "front"].into_iter().enumerate() {
        let (mut min, mut max) = ([0.25; 3], [0.75; 3]);
        (min[k / 2], max[k / 2]) = if k % 2 == 0 { (0.0, 0.5) } else { (0.5, 1.0) };
        let scene = with(
            hanging(json!({"boundary": {face: "fixed"}})),
            &[("/bodies/0/shape/box", json!({"min": min, "max": max}))],
        );
        let run = Run::of(&scene)?;
        let reactions = run.table("reactions.csv")?.vectors(&format!("{face}_"));
        let weight = Vector3::new(8.0, -15.0, 4.0) * (DENSITY * 0.125);
        assert_eq!(reactions.len(), 2);
        reactions.iter().for_each(|one| assert_vector(one, &-weight, 1e-8, face));
    }
    Ok(())
}

#[test]
fn the_torque_of_a_rotation_is_that_of_the_weight_about_its_axis() -> Result<(), Failure> {
    let (center, axis) = (Vector3::new(0.3, 0.45, 0.6), Vector3::new(0.3, 1.0, -0.5));
    let scene = |angle: f64| {
        let rotation = json!({"center": center.as_slice(), "axis": axis.as_slice(), "angle": [[0, 0], [1, angle]]});
        let region = json!({"box": {"min": [0, 0, 0], "max": [1, 0.3, 1]}});
        hanging(json!({"prescribed": [{"region": region, "rotation": rotation}]}))
    };
    torque_of_a_rotation(&scene(0.4), center, axis)?;
    // Two bodies of different size have nodes of their own, and one region holds them all. They reach no other node of it.
    let bodies = json!([
        elastic("block", [0.25; 3], [0.5, 0.75, 0.75]),
        elastic("other", [0.625, 0.25, 0.375], [0.875, 0.625, 0.75])
    ]);
    torque_of_a_rotation(&merged(scene(-0.1), json!({"bodies": bodies, "contact": {}})), center, axis)
}

/// Compares the reaction and the torque about an axis with the weight.
fn torque_of_a_rotation(scene: &Value, center: Vector3<f64>, axis: Vector3<f64>) -> Result<(), Failure> {
    let run = Run::of(scene)?;
    let (states, reactions) = (run.snapshots("particles")?, run.table("reactions.csv")?);
    let name = reactions.0.keys().find_map(|name| name.strip_suffix("_torque")).ok_or("no torque")?;
    let (forces, torques) = (reactions.vectors(&format!("{name}_")), reactions.column(&format!("{name}_torque")));
    let gravity = Vector3::new(8.0, -15.0, 4.0);
    for (k, state) in states.iter().enumerate().skip(1) {
        let weight = |p: usize| gravity * state.scalar("mass", p);
        assert_vector(&forces[k - 1], &-state.sum(weight), 1e-8, "reaction");
        let moment: Vector3<f64> = state.sum(|p| (state.position(p) - center).cross(&weight(p)));
        assert_near(torques[k - 1], -moment.dot(&axis.normalize()), 1e-8, "torque");
    }
    assert!(torques.len() == 2 && torques.iter().all(|torque| torque.abs() > 5e-3), "{torques:?}");
    Ok(())
}

#[test]
fn the_load_of_a_path_is_that_of_the_reaction() -> Result<(), Failure> {
    let traction = [2.0, -3.0, 5.0];
    let run = Run::of(&json!({
        "grid": {"size": [2, 1, 1], "spacing": 0.125},
        "approximation": "linear",
        "time": {"step": 0.1, "end": 0.5, "scheme": "arc_length"},
        "bodies": [elastic("beam", [0.0, 0.25, 0.25], [1.0, 0.75, 0.75])],
        "boundary": {"left": "fixed"},
        "tractions": [{"body": "beam", "region": {"half_space": {"point": [1, 0, 0], "normal": [-1, 0, 0]}}, "traction": traction,
                       "curve": [[0, 0], [10, 10]]}],
        "solver": {"newton": {"tolerance": 1e-12}}
    }))?;
    let (history, reactions) = (run.table("history.csv")?, run.table("reactions.csv")?.vectors("left_"));
    let load = history.column("load");
    assert!(load[0] == 0.0 && reactions.len() >= 5 && load[5] > 0.2, "{load:?}");
    for (load, reaction) in load[1..].iter().zip(&reactions) {
        assert_vector(reaction, &(Vector3::from(traction) * (-load * 0.25)), 1e-8, "reaction");
    }
    Ok(())
}
