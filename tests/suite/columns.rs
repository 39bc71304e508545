//! Every column that a run in space writes, component by component, against the state in its snapshots or against a known answer.
//!
//! All components differ, so that two that are exchanged are seen.

mod run;

use crate::support::{Failure, merged, with};
use bfree::field::Field;
use nalgebra::{Matrix3, Rotation3, Vector3};
use run::{Run, State, Table};
use serde_json::{Value, json};

const LAMBDA: f64 = 900.0;
const SHEAR: f64 = 400.0;

fn assert_near(found: f64, wanted: f64, scale: f64, what: &str) {
    assert!((found - wanted).abs() <= scale, "{what}: {found} instead of {wanted}");
}

fn assert_vector(found: &Vector3<f64>, wanted: &Vector3<f64>, scale: f64, what: &str) {
    (0..3).for_each(|k| assert_near(found[k], wanted[k], scale, &format!("{what}, component {k}")));
}

/// No two numbers are as near to each other as a thousandth of the largest one, and none is that near to zero.
fn differ(numbers: &[f64]) -> bool {
    let least = 1e-3 * numbers.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let apart = |k: usize| numbers[..k].iter().all(|other| (other.abs() - numbers[k].abs()).abs() > least);
    (0..numbers.len()).all(|k| apart(k) && numbers[k].abs() > least)
}

/// The law of the elastic bodies: W = Λ/4 (J² − 1) − Λ/2 ln J + G/2 (tr C − 3) − G ln J, and Cauchy's stress.
fn law(f: &Matrix3<f64>) -> (f64, Matrix3<f64>) {
    let (j, b) = (f.determinant(), f * f.transpose());
    let energy = LAMBDA / 4.0 * (j * j - 1.0) - (LAMBDA / 2.0 + SHEAR) * j.ln() + SHEAR / 2.0 * (b.trace() - 3.0);
    let unit = Matrix3::identity();
    (energy, (unit * (LAMBDA / 2.0 * (j * j - 1.0)) + (b - unit) * SHEAR) / j)
}

/// xx, yy, zz, xy, yz, xz
fn symmetric(tensor: &Matrix3<f64>) -> Vec<f64> {
    [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)].map(|place| tensor[place]).to_vec()
}

/// All fields that follow from the deformation gradient and from other fields.
fn derived(state: &State, start: &State, p: usize) -> Vec<(Field, Vec<f64>)> {
    let f = state.gradient(p);
    let (energy, stress) = law(&f);
    let deviator = stress - Matrix3::identity() * (stress.trace() / 3.0);
    let mut principal: Vec<f64> = stress.symmetric_eigenvalues().iter().copied().collect();
    principal.sort_by(|a, b| b.total_cmp(a));
    let moved = state.position(p) - start.position(p);
    let strain = (f.transpose() * f - Matrix3::identity()) * 0.5;
    vec![
        (Field::Position, state.0.points[p].to_vec()),
        (Field::Displacement, moved.iter().copied().collect()),
        (Field::Jacobian, vec![f.determinant()]),
        (Field::Strain, symmetric(&strain)),
        (Field::Stress, symmetric(&stress)),
        (Field::PrincipalStress, principal),
        (Field::Pressure, vec![-stress.trace() / 3.0]),
        (Field::VonMises, vec![(1.5 * deviator.norm_squared()).sqrt()]),
        (Field::EnergyDensity, vec![energy]),
        (Field::PlasticStrain, vec![0.0]),
        (Field::DissipatedDensity, vec![0.0]),
        (Field::Mass, vec![DENSITY * state.scalar("volume", p)]),
        (Field::Volume, vec![start.scalar("volume", p)]),
        (Field::Body, vec![0.0]),
    ]
}

const DENSITY: f64 = 1.3;
const GRAVITY: [f64; 3] = [1.0, -2.0, 0.5];

/// The edges of the brick, and its centre at the start.
const BRICK: [f64; 3] = [0.7, 0.3, 0.9];
const CENTER: [f64; 3] = [0.85, 1.16, 0.85];
const BRICK_DENSITY: f64 = 1.5;

fn elastic(name: &str, min: [f64; 3], max: [f64; 3]) -> Value {
    json!({"name": name, "density": DENSITY, "shape": {"box": {"min": min, "max": max}},
           "material": {"neo_hookean": {"lambda": LAMBDA, "shear": SHEAR}}})
}

/// A probe of every component of every field, and one of all its components.
fn probes() -> Vec<Value> {
    let mut all = Vec::new();
    for field in Field::ALL {
        let probe = |name: String| json!({"name": name, "field": field, "at": {"particle": [0.8, 0.95, 0.7]}});
        all.push(probe(format!("all_{}", field.name())));
        for component in field.kind().components().iter().filter(|component| !component.is_empty()) {
            let name = format!("one_{}_{component}", field.name());
            all.push(merged(probe(name), json!({"component": component})));
        }
    }
    all
}

/// A brick that spins about all axes falls on a block that flies.
fn impact() -> Value {
    let corner = |sign: f64| std::array::from_fn::<f64, 3, _>(|k| CENTER[k] + sign * BRICK[k] / 2.0);
    let block = merged(elastic("block", [0.5; 3], [1.5, 1.0, 1.5]), json!({"velocity": [0.3, 0.1, -0.2]}));
    json!({
        "grid": {"size": [2, 2, 2], "spacing": 0.25, "reset": "never"},
        "approximation": {"bspline": {"degree": 2}},
        "time": {"step": 0.004, "end": 0.04, "lumping": 0},
        "gravity": {"acceleration": GRAVITY},
        "bodies": [block],
        "obstacles": [{"name": "brick", "shape": {"box": {"min": corner(-1.0), "max": corner(1.0)}}, "friction": 0.4,
                       "free": {"density": BRICK_DENSITY, "velocity": [1, -3, 0.4], "spin": [0.5, -2, 1]}}],
        "solver": {"newton": {"tolerance": 1e-11}},
        "output": {"every": 0.004, "fields": Field::ALL, "probes": probes()}
    })
}

#[test]
fn fields_and_probes_have_their_components() -> Result<(), Failure> {
    let run = Run::of(&impact())?;
    let states = run.snapshots("particles")?;
    let (start, last) = (&states[0], &states[states.len() - 1]);
    let mut all_differ = false;
    for p in 0..last.len() {
        for (field, wanted) in derived(last, start, p) {
            let scale = 1e-11 * if wanted.len() == 6 || wanted.len() == 3 { LAMBDA } else { 1.0 };
            for (k, wanted) in wanted.iter().enumerate() {
                assert_near(
                    last.at(field.name(), p)[k],
                    *wanted,
                    scale.max(1e-11 * wanted.abs()),
                    &format!("{field:?}, component {k}"),
                );
            }
        }
        let f = last.gradient(p);
        let off_diagonal = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)].map(|place| f[place]);
        all_differ |= differ(&off_diagonal) && differ(last.at("stress", p)) && differ(last.at("strain", p));
    }
    assert!(all_differ, "two components are equal in every particle");
    let probes = run.table("probes.csv")?;
    let place = [0.8, 0.95, 0.7];
    let distance = |p: &usize| (start.position(*p) - Vector3::from(place)).norm();
    let particle = (0..start.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).ok_or("no particles")?;
    for (k, state) in states.iter().enumerate() {
        for field in Field::ALL {
            for (component, value) in field.kind().components().iter().zip(state.at(field.name(), particle)) {
                let all = if component.is_empty() { String::new() } else { format!("_{component}") };
                assert_eq!(probes.column(&format!("all_{}{all}", field.name()))[k], *value, "{field:?} {component}");
                if !component.is_empty() {
                    assert_eq!(
                        probes.column(&format!("one_{}_{component}", field.name()))[k],
                        *value,
                        "{field:?} {component}"
                    );
                }
            }
        }
    }
    Ok(())
}

#[test]
fn the_history_has_the_sums_over_particles() -> Result<(), Failure> {
    let run = Run::of(&impact())?;
    let (states, history, brick) =
        (run.snapshots("particles")?, run.table("history.csv")?, run.table("obstacles.csv")?);
    let momenta = history.vectors("momentum_");
    let gravity = Vector3::from(GRAVITY);
    for (k, state) in states.iter().enumerate() {
        let near = |name: &str, wanted: f64| {
            assert_near(history.column(name)[k], wanted, 1e-11, &format!("{name} of step {k}"))
        };
        let mass = |p: usize| state.scalar("mass", p);
        let moved = |p: usize| state.position(p) - states[0].position(p);
        let of_brick = |name: &str| if k == 0 { 0.0 } else { brick.column(name)[k - 1] };
        near("step", k as f64);
        near("time", 0.004 * k as f64);
        near("dt", if k == 0 { 0.0 } else { 0.004 });
        near("kinetic", state.sum(|p| 0.5 * mass(p) * state.vector("velocity", p).norm_squared()));
        near("strain", state.sum(|p| state.scalar("volume", p) * law(&state.gradient(p)).0));
        near("external", state.sum(|p| mass(p) * gravity.dot(&moved(p))) + of_brick("brick_work"));
        near("friction", of_brick("brick_friction_loss"));
        near("dissipated", of_brick("brick_friction_loss"));
        let value = |name: &str| history.column(name)[k];
        near("total", value("kinetic") + value("strain") + value("contact"));
        near("balance", value("total") + value("dissipated") - value("external") - history.column("total")[0]);
        assert_vector(&momenta[k], &state.momenta(0.0)[0], 1e-11, "momentum");
        if k > 0 {
            let force: Vector3<f64> = state.sum(|p| state.vector("acceleration", p) * mass(p));
            let wanted = gravity * state.sum(mass) - brick.vectors("brick_")[k - 1];
            assert_vector(&force, &wanted, 1e-6, "acceleration");
        }
    }
    let [last_friction, last_work] =
        ["brick_friction_loss", "brick_work"].map(|name| brick.column(name).last().copied());
    assert!(
        last_friction > Some(1e-4) && last_work.is_some_and(|work| work.abs() > 1e-2),
        "{last_friction:?} {last_work:?}"
    );
    // The impact loses little: the energy in contact, too, has the right size.
    let balance = history.column("balance").iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    assert!(
        balance < 0.05 * history.column("external")[states.len() - 1] && differ(momenta[momenta.len() - 1].as_slice()),
        "{balance}"
    );
    Ok(())
}

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
        // Both sides have points, each for a part of its area.
        let both: f64 = points().map(|p| surfaces[step(k)].scalar("area", p)).sum();
        let share = pair.column("area")[k] / both;
        assert!(share > 0.25 && share <= 0.5 + 1e-12, "{share} of the areas of both sides");
    }
    let history = run.table("history.csv")?;
    // A step in which the bodies part has no row.
    (0..times.len()).for_each(|k| assert_eq!(history.column("friction")[step(k)], pair.column("friction_loss")[k]));
    assert!(force.iter().any(|one| differ(one.as_slice())) && moment.iter().any(|one| differ(one.as_slice())));
    Ok(())
}

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

/// What the report says of a contact, against the rows of its table: `prefix` is that of its columns.
fn assert_touched(touched: &Value, table: &Table, prefix: &str, end: f64) {
    let column = |name: &str| table.column(&format!("{prefix}{name}"));
    let number = |name: &str| touched[name].as_f64().unwrap_or(f64::NAN);
    let (times, area) = (table.column("time"), column("area"));
    let touches: Vec<f64> = times.iter().zip(area).filter(|(_, area)| **area > 0.0).map(|(time, _)| *time).collect();
    let norm = |k: &usize| column("x")[*k].hypot(column("y")[*k]);
    let strongest = (0..times.len()).max_by(|a, b| norm(a).total_cmp(&norm(b))).unwrap_or(0);
    assert_eq!((number("since"), number("until")), (touches[0], touches[touches.len() - 1]), "{touched}");
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

#[test]
fn plastic_columns_are_sums_over_particles() -> Result<(), Failure> {
    let metal = json!({"von_mises": {"elastic": {"lambda": LAMBDA, "shear": SHEAR}, "yield_stress": {"initial": 8, "linear": 20}}});
    let block = merged(
        elastic("block", [0.0, 0.25, 0.25], [1.0, 0.75, 0.75]),
        json!({"material": metal, "velocity": [1.0, 3.0, -2.0]}),
    );
    let elastic_block = elastic("other", [1.5, 0.25, 0.25], [1.75, 0.5, 0.5]);
    let run = Run::of(&json!({
        "grid": {"size": [2, 1, 1], "spacing": 0.25},
        "approximation": "linear",
        "time": {"step": 0.01, "end": 0.1},
        "bodies": [block, elastic_block],
        "boundary": {"left": "fixed"},
        "damping": {"mass": 0.7},
        "output": {"every": 0.01, "fields": ["plastic_strain", "dissipated_density", "volume", "velocity", "mass", "body"]}
    }))?;
    let (states, history) = (run.snapshots("particles")?, run.table("history.csv")?);
    let (mut damped, mut flows) = (0.0, 0);
    for k in 1..states.len() {
        let [state, before] = [&states[k], &states[k - 1]];
        let volume = |p: usize| if state.scalar("body", p) == 0.0 { state.scalar("volume", p) } else { 0.0 };
        let grew = |p: usize| state.scalar("plastic_strain", p) > before.scalar("plastic_strain", p);
        let share = state.sum(|p| if grew(p) { volume(p) } else { 0.0 }) / state.sum(volume);
        assert_near(history.column("yielding")[k], share, 1e-12, "yielding");
        flows += usize::from(share > 0.0 && share < 1.0);
        // The power of damping is a m v·v, with the velocities of the nodes in place of those of the particles.
        let kinetic = |k: usize| history.column("kinetic")[k];
        damped += 0.7 * 0.01 * (kinetic(k) + kinetic(k - 1));
        let by_law = state.sum(|p| state.scalar("volume", p) * state.scalar("dissipated_density", p));
        let dissipated = history.column("dissipated")[k];
        assert_near(dissipated - by_law, damped, 0.2 * damped, "dissipated by damping");
        assert!(k < 5 || by_law > 1e-3, "{by_law}");
    }
    assert!(flows > 3, "{flows} steps in which a part flows");
    Ok(())
}
