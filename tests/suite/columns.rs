//! Every column that a run in space writes, component by component, against the state in its snapshots or against a known answer.
//!
//! All components differ, so that two that are exchanged are seen.

mod contact;
mod reactions;
mod run;

use crate::support::{Failure, merged};
use bfree::field::Field;
use nalgebra::{Matrix3, Vector3};
use run::{Run, State};
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
