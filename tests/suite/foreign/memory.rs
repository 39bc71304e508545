//! The state that the program keeps for a law from a library: its work, and tensors that turn with the body.

use super::{LAMBDA, Library, SHEAR, block};
use crate::support::{Failure, built, run_to, with};
use bfree::simulation::Simulation;
use serde_json::{Value, json};
use std::path::Path;

/// The strain energy after load steps of this length, with a law of ours and with one from a library.
fn energy(law: &Value, step: f64) -> Result<f64, Failure> {
    let mut simulation: Simulation<2> = built(&with(block(2, true, law), &[("/time/step", json!(step))]))?;
    run_to(&mut simulation, 1.0)?;
    Ok(simulation.strain_energy())
}

/// The program adds up the work of a law from a library by the trapezoidal rule. That of an elastic law is its energy.
#[test]
fn the_work_of_an_elastic_law_is_its_energy_to_second_order() -> Result<(), Failure> {
    let ours = json!({"neo_hookean_logarithmic": {"lambda": LAMBDA, "shear": SHEAR}});
    let Some(library) = Library::of("neo_hookean.f")? else { return Ok(()) };
    let theirs = json!({"umat": {"library": library.name(), "properties": [LAMBDA, SHEAR]}});
    let exact = energy(&ours, 0.5)?;
    let [coarse, fine] = [0.25, 0.125].map(|step| energy(&theirs, step));
    let [coarse, fine] = [coarse? / exact - 1.0, fine? / exact - 1.0];
    assert!(exact > 1e-3 && coarse.abs() < 0.01 && fine.abs() < 0.3 * coarse.abs(), "{exact}: {coarse} {fine}");
    Ok(())
}

/// A bar that is turned by one end and bends under its weight.
fn turned(behaviour: &str, library: &Library) -> Value {
    json!({
        "grid": {"size": [3, 3], "spacing": 0.5},
        "approximation": {"bspline": {"degree": 2}},
        "time": {"step": 0.25, "end": 1, "scheme": "none"},
        "bodies": [{"name": "bar", "density": 0.1, "shape": {"box": {"min": [0.5, 1], "max": [2.5, 2]}},
                    "material": {"mfront": {"library": library.name(), "behaviour": behaviour, "properties": [1, 0.3]}}}],
        "prescribed": [{"region": {"box": {"min": [0, 0], "max": [1, 3]}}, "rotation": {"center": [0.5, 1.5], "angle": [[0, 0], [1, 0.6]]}}],
        "gravity": {"acceleration": [0.02, -0.05], "curve": [[0, 0], [1, 1]]},
        "solver": {"krylov": {"method": {"gmres": {}}}, "newton": {"tolerance": 1e-12}}
    })
}

#[test]
fn every_tensor_among_the_variables_turns_with_the_body() -> Result<(), Failure> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/suite/foreign");
    let Some(library) = Library::compiled(&folder, "two_tensors.c")? else { return Ok(()) };
    let [mut one, mut two]: [Simulation<2>; 2] =
        [built(&turned("Elasticity", &library))?, built(&turned("TwoStrains", &library))?];
    run_to(&mut one, 1.0)?;
    run_to(&mut two, 1.0)?;
    let (one, two) = (one.particles.by_id(), two.particles.by_id());
    let apart = one.position.iter().zip(&two.position).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    let strained = (0..one.len()).map(|p| one.state(p, 0.0).internal[3].abs()).fold(0.0, f64::max);
    assert!(apart < 1e-10 && strained > 1e-3, "{apart:e}, with strains of {strained}");
    for p in 0..two.len() {
        let internal = two.state(p, 0.0).internal.to_vec();
        assert!((0..6).all(|k| (internal[k] - internal[6 + k]).abs() < 1e-12), "particle {p}: {internal:?}");
    }
    Ok(())
}
