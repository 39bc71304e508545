//! The columns of obstacles and of pairs of bodies, and the pressure at their points.

use super::run::{Run, State, Table};
use super::{
    BRICK, BRICK_DENSITY, DENSITY, GRAVITY, LAMBDA, SHEAR, assert_near, assert_vector, differ, elastic, impact,
};
use crate::support::{Failure, merged};
use nalgebra::{Matrix3, Rotation3, Vector3};
use serde_json::{Value, json};

/// Force, moment, area and depth of a step from the points of the surface that touch.
fn resultants(surface: &State, center: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>, f64, f64) {
    let force = |p: usize| -surface.vector("traction", p) * surface.scalar("area", p);
    let touches = |p: usize| surface.scalar("pressure", p) > 0.0;
    let area = surface.sum(|p| if touches(p) { surface.scalar("area", p) } else { 0.0 });
    let depth = (0..surface.len()).filter(|p| touches(*p)).map(|p| -surface.scalar("gap", p)).fold(0.0, f64::max);
    (surface.sum(force), surface.sum(|p| (surface.position(p) - center).cross(&force(p))), area, depth)
}

#[test]
fn the_columns_of_an_obstacle_are_those_of_a_rigid_body() -> Result<(), Failure> {
    let run = Run::of(&impact())?;
    let (surfaces, brick) = (run.snapshots("contacts")?, run.table("obstacles.csv")?);
    let of = |what: &str| brick.vectors(&format!("brick_{what}"));
    let (force, moment, position, velocity) = (of(""), of("moment_"), of("position_"), of("velocity_"));
    let (angle, spin, kinetic) = (of("angle_"), of("spin_"), brick.column("brick_kinetic"));
    let mass = BRICK_DENSITY * BRICK.iter().product::<f64>();
    let [a, b, c] = BRICK.map(|edge| edge * edge);
    let inertia = Matrix3::from_diagonal(&(Vector3::new(b + c, a + c, a + b) * (mass / 12.0)));
    let turned = |k: usize| Rotation3::from_scaled_axis(angle[k]).into_inner();
    let in_space = |k: usize| turned(k) * inertia * turned(k).transpose();
    let (gravity, dt) = (Vector3::from(GRAVITY), 0.004);
    let strongest = moment.iter().map(|m| m.norm()).fold(0.0, f64::max);
    for k in 0..force.len() {
        let (by_points, its_moment, area, depth) = resultants(&surfaces[k + 1], &position[k]);
        assert_vector(&force[k], &by_points, 1e-9, "force");
        assert_vector(&moment[k], &its_moment, 1e-9, "moment");
        assert_near(brick.column("brick_area")[k], area, 1e-12, "area");
        assert_near(brick.column("brick_depth")[k], depth, 1e-12, "depth");
        let energy = 0.5 * (mass * velocity[k].norm_squared() + spin[k].dot(&(in_space(k) * spin[k])));
        assert_near(kinetic[k], energy, 1e-11, "kinetic energy");
        let Some(before) = k.checked_sub(1) else { continue };
        let mean = |values: &[Vector3<f64>]| (values[k] + values[before]) * 0.5;
        assert_vector(&((position[k] - position[before]) / dt), &mean(&velocity), 1e-9, "velocity");
        assert_vector(&((velocity[k] - velocity[before]) / dt), &(mean(&force) / mass + gravity), 1e-6, "acceleration");
        let turn = Rotation3::from_matrix(&(turned(k) * turned(before).transpose())).scaled_axis() / dt;
        assert_vector(&turn, &mean(&spin), 2e-3 * spin[k].norm(), "spin");
        let gained = (in_space(k) * spin[k] - in_space(before) * spin[before]) / dt;
        assert_vector(&gained, &mean(&moment), 0.02 * strongest, "angular momentum");
    }
    let unequal = |values: &[Vector3<f64>]| values.iter().any(|one| differ(one.as_slice()));
    assert!(
        [&force, &moment, &position, &velocity, &angle, &spin].into_iter().all(|values| unequal(values)),
        "equal components"
    );
    Ok(())
}

#[test]
fn the_columns_of_a_pair_are_the_rates_of_momenta() -> Result<(), Failure> {
    let moving = |body: Value, velocity: [f64; 3]| merged(body, json!({"velocity": velocity}));
    let lower = moving(elastic("lower", [0.5; 3], [1.5, 1.0, 1.25]), [0.5, 1.0, 0.2]);
    let upper = moving(elastic("upper", [0.75, 1.02, 0.75], [1.75, 1.5, 1.75]), [-0.5, -2.0, 0.7]);
    let run = Run::of(&json!({
        "grid": {"size": [2.25, 2, 2.25], "spacing": 0.25, "reset": "never"},
        "approximation": {"bspline": {"degree": 2}},
        "time": {"step": 0.004, "end": 0.06, "lumping": 0},
        "bodies": [lower, upper],
        "contact": {"friction": 0.3},
        "solver": {"newton": {"tolerance": 1e-11}},
        "output": {"every": 0.004, "fields": ["velocity", "mass", "body"]}
    }))?;
    let (states, surfaces, pair) =
        (run.snapshots("particles")?, run.snapshots("contacts")?, run.table("contacts.csv")?);
    let (times, force, moment) = (pair.column("time"), pair.vectors(""), pair.vectors("moment_"));
    let strongest = moment.iter().map(|m| m.norm()).fold(0.0, f64::max);
    assert!(times.len() > 5, "they touch: {times:?}");
    let step = |k: usize| (times[k] / 0.004).round() as usize;
    for k in 1..times.len() {
        let gained = |body: f64| {
            let [after, before] = [&states[step(k)], &states[step(k) - 1]].map(|state| state.momenta(body));
            [0, 1].map(|which| (after[which] - before[which]) / 0.004)
        };
        if step(k) != step(k - 1) + 1 {
            continue;
        }
        let mean = |values: &[Vector3<f64>]| (values[k] + values[k - 1]) * 0.5;
        let [momentum, spin] = gained(1.0);
        assert_vector(&momentum, &mean(&force), 1e-6, "force on the second body");
        assert_vector(&spin, &mean(&moment), 0.02 * strongest, "moment on the second body");
        assert_vector(&-gained(0.0)[0], &mean(&force), 1e-6, "force on the first body");
        let touching = |p: &usize| surfaces[step(k)].scalar("pressure", *p) > 0.0;
        let points = || (0..surfaces[step(k)].len()).filter(touching);
        let depth = points().map(|p| -surfaces[step(k)].scalar("gap", p)).fold(0.0, f64::max);
        assert_near(pair.column("depth")[k], depth, 1e-12, "depth");
        if points().next().is_none() {
            assert_eq!(pair.column("area")[k], 0.0, "the bodies part");
            continue;
        }
        // Both sides have points, each for a part of its area.
        let both: f64 = points().map(|p| surfaces[step(k)].scalar("area", p)).sum();
        let share = pair.column("area")[k] / both;
        assert!(share > 0.25 && share <= 0.5 + 1e-12, "{share} of the areas of both sides");
    }
    let history = run.table("history.csv")?;
    (0..times.len()).for_each(|k| assert_eq!(history.column("friction")[step(k)], pair.column("friction_loss")[k]));
    assert!(force.iter().any(|one| differ(one.as_slice())) && moment.iter().any(|one| differ(one.as_slice())));
    Ok(())
}

/// Compares the entry of a contact in the report with the rows of its table, whose columns begin with `prefix`.
fn assert_touched(touched: &Value, table: &Table, prefix: &str, end: f64) {
    let column = |name: &str| table.column(&format!("{prefix}{name}"));
    let number = |name: &str| touched[name].as_f64().unwrap_or(f64::NAN);
    let (times, area) = (table.column("time"), column("area"));
    let touches: Vec<f64> = times.iter().zip(area).filter(|(_, area)| **area > 0.0).map(|(time, _)| *time).collect();
    let norm = |k: &usize| column("x")[*k].hypot(column("y")[*k]);
    let strongest = (0..times.len()).max_by(|a, b| norm(a).total_cmp(&norm(b))).unwrap_or(0);
    assert_eq!((number("since"), number("until")), (touches[0], touches[touches.len() - 1]), "{touched}");
    let last = times.iter().rposition(|time| *time == number("until")).unwrap_or(0);
    assert_eq!(area.get(last + 1), Some(&0.0), "the step in which the contact ends has a row");
    assert!(number("since") > 0.0 && number("until") < end, "the contact begins and ends: {touched}");
    assert_near(number("largest_force"), norm(&strongest), 1e-12 * norm(&strongest), "largest force");
    assert_eq!(number("largest_at"), times[strongest]);
    assert_eq!(number("largest_depth"), column("depth").iter().copied().fold(0.0, f64::max));
    assert_eq!(number("friction_loss"), column("friction_loss")[times.len() - 1]);
    assert_eq!(touched["force"], json!([0.0, 0.0]), "nothing touches at the end");
}

#[test]
fn the_report_says_from_when_to_when_something_touched() -> Result<(), Failure> {
    let moving = |name: &str, min: [f64; 2], max: [f64; 2], velocity: [f64; 2]| {
        let material = json!({"neo_hookean": {"lambda": LAMBDA, "shear": SHEAR}});
        json!({"name": name, "density": DENSITY, "shape": {"box": {"min": min, "max": max}}, "material": material, "velocity": velocity})
    };
    let run = Run::of(&json!({
        "grid": {"size": [4, 2], "spacing": 0.125},
        "time": {"step": 0.01, "end": 0.4},
        "bodies": [
            moving("falls", [0.5, 0.32], [1.0, 0.82], [0.5, -1.0]),
            moving("left", [2.0, 1.0], [2.4, 1.4], [1.0, 0.0]),
            moving("right", [2.44, 1.06], [2.84, 1.46], [-1.0, 0.0])
        ],
        "obstacles": [{"name": "floor", "shape": {"half_space": {"point": [0, 0.3], "normal": [0, 1]}}, "friction": 0.3},
                      {"name": "far", "shape": {"half_space": {"point": [0, 1.9], "normal": [0, -1]}}}],
        "contact": {"friction": 0.2}
    }))?;
    let report = run.report()?;
    let one = |list: &str| -> Result<Value, Failure> {
        let all = report[list].as_array().ok_or("no list")?;
        assert_eq!(all.len(), 1, "{all:?}");
        Ok(all[0].clone())
    };
    let (floor, pair) = (one("obstacles")?, one("pairs")?);
    assert_eq!((&floor["name"], &pair["name"]), (&json!("floor"), &json!("left and right")));
    assert_touched(&floor, &run.table("obstacles.csv")?, "floor_", 0.4);
    assert_touched(&pair, &run.table("contacts.csv")?, "", 0.4);
    Ok(())
}

#[test]
fn the_pressure_at_a_point_is_the_sum_over_all_that_it_touches() -> Result<(), Failure> {
    let floor = |name: &str, stiffness: f64| json!({"name": name, "shape": {"half_space": {"point": [0, 1], "normal": [0, 1]}}, "stiffness": stiffness});
    let block = json!({"name": "block", "density": DENSITY, "shape": {"box": {"min": [1.5, 1], "max": [2.5, 2]}},
                       "material": {"neo_hookean": {"lambda": LAMBDA, "shear": SHEAR}}});
    let run = Run::of(&json!({
        "grid": {"size": [4, 3], "spacing": 0.25},
        "time": {"scheme": "none", "step": 0.5, "end": 1},
        "bodies": [block],
        "obstacles": [floor("hard", 3.0), floor("soft", 1.0)],
        "prescribed": [{"region": {"box": {"min": [0, 1.9], "max": [4, 3]}}, "displacement": [[0, [0, 0]], [1, [0, -0.02]]]}],
        "output": {"every": 0.5}
    }))?;
    let (surfaces, table) = (run.snapshots("contacts")?, run.table("obstacles.csv")?);
    let last = &surfaces[surfaces.len() - 1];
    let force = |name: &str| -table.column(&format!("{name}_y")).last().copied().unwrap_or(f64::NAN);
    assert_near(force("hard"), 3.0 * force("soft"), 1e-9 * force("hard"), "forces in the ratio of the stiffnesses");
    let pressed = last.sum(|p| last.scalar("pressure", p) * last.scalar("area", p));
    assert_near(pressed, force("hard") + force("soft"), 1e-9 * pressed, "pressure");
    // Without friction, the traction is the pressure along the normal of the floor.
    let apart = (0..last.len()).map(|p| (last.vector("traction", p)[1] - last.scalar("pressure", p)).abs());
    assert!(pressed > 1.0 && apart.fold(0.0, f64::max) < 1e-12 * pressed, "{pressed}");
    Ok(())
}
