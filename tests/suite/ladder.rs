//! A scene costs only what it requires. Each feature that is left out saves passes over the particles or bytes, and increases neither. The
//! size of the box around a body costs nothing.

use crate::support::{Failure, Watched, output, scene};
use bfree::field::Field;
use bfree::material::{Lame, NeoHookean};
use bfree::output::{OutputSettings, Recorder, Reference};
use bfree::phases::Phase;
use bfree::plan::Plan;
use bfree::simulation::Simulation;
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// The cost of a step, without iterations.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cost {
    /// Passes over the particles outside Newton's method.
    passes: u64,
    /// Bytes of all arrays.
    bytes: u64,
}

/// The cost of the first step.
fn cost<const D: usize>(simulation: &Simulation<D>) -> Result<Cost, Failure> {
    let plan = Plan::of(simulation)?;
    let report = simulation.clone().advance()?;
    let passes = report.seconds.passes();
    // An iteration of the projection takes one pass. The number of iterations is not part of the plan.
    let iterations = report.projection_iterations as u64;
    let outside = passes.iter().sum::<u64>() - passes[Phase::Newton as usize] - iterations;
    Ok(Cost { passes: outside, bytes: plan.arrays.iter().map(|array| array.bytes).sum() })
}

const LADDER: [(&str, &str); 8] = [
    ("limited smoothing", r#"transfer="flip""#),
    ("consistent mass", "time.lumping=1"),
    ("moving floor", r#"boundary={"bottom":"sliding","left":"sliding","right":"sliding"}"#),
    ("pressure", "pressures=[]"),
    ("inertia", r#"time={"step":0.01,"end":5,"scheme":"none"}"#),
    ("aggregation", "aggregation=false"),
    ("gravity", "gravity=null"),
    ("restarts after 50 vectors", r#"solver.krylov.method="conjugate_gradient""#),
];

/// A block with every feature.
const ALL: [&str; 7] = [
    // In load steps the grid would not be reset by default.
    r#"grid.reset="every_step""#,
    r#"transfer={"limited":{"rate":1}}"#,
    "time.lumping=0.5",
    r#"boundary={"bottom":{"velocity":[[0,[null,0]],[1,[null,0.01]]]},"left":"sliding","right":"sliding"}"#,
    r#"pressures=[{"body":"block","region":{"box":{"min":[0,0.999],"max":[1,1.1]}},"pressure":10}]"#,
    "output={}",
    // Multigrid, the default without inertia, needs memory for its levels.
    r#"solver.krylov.preconditioner="block_jacobi""#,
];

#[test]
fn each_step_down_the_ladder_is_cheaper() -> Result<(), Failure> {
    let mut overrides = ALL.to_vec();
    let mut above = cost(&scene::<2>("compaction_confined.json", &overrides)?)?;
    for (without, key) in LADDER {
        if without == "inertia" {
            // Without inertia, the keys that require inertia are dropped too.
            overrides.retain(|key| !key.starts_with("transfer") && !key.starts_with("time"));
        }
        overrides.push(key);
        let below = cost(&scene::<2>("compaction_confined.json", &overrides)?)?;
        assert!(below.passes <= above.passes && below.bytes <= above.bytes, "without {without}: {above:?}, {below:?}");
        assert!(below != above, "without {without} nothing is cheaper: {above:?}");
        above = below;
    }
    // Two passes remain: the motion of the particles with its gradient, and the reactions of the walls.
    assert_eq!(above.passes, 2);
    Ok(())
}

#[test]
fn a_dimension_less_is_fewer_bytes_of_each_particle() -> Result<(), Failure> {
    fn particles_of<const D: usize>(simulation: &Simulation<D>) -> Result<f64, Failure> {
        let plan = Plan::of(simulation)?;
        let bytes: u64 =
            plan.arrays.iter().filter(|array| array.name.starts_with("particles")).map(|one| one.bytes).sum();
        Ok(bytes as f64 / plan.particles as f64)
    }
    let [one, two, three] = [
        particles_of(&scene::<1>("riemann.json", &[])?)?,
        particles_of(&scene::<2>("rebound.json", &[])?)?,
        particles_of(&scene::<3>("ball_drop.json", &[])?)?,
    ];
    // x, v and a; H; volume, mass, body, id; cell, id and position in the order of the transfer.
    let expected = |d: f64| 8.0 * (3.0 * d + d * d) + 24.0 + 16.0;
    // The bar has a partly consistent mass, which adds two vectors.
    assert_eq!([one, two, three], [expected(1.0) + 16.0, expected(2.0), expected(3.0)]);
    Ok(())
}

#[test]
fn the_box_around_a_body_costs_nothing() -> Result<(), Failure> {
    // Two discs in flight, in a box and in a box a hundred times as large.
    let mut small = scene::<2>("collision.json", &[])?;
    let mut large = scene::<2>("collision.json", &["grid.size=[100, 50]"])?;
    let (of_small, of_large) = (Plan::of(&small)?, Plan::of(&large)?);
    assert!(of_large.grid_nodes > 90 * of_small.grid_nodes, "{} {}", of_large.grid_nodes, of_small.grid_nodes);
    assert_eq!((of_small.active_nodes, of_small.unknowns), (of_large.active_nodes, of_large.unknowns));
    assert_eq!(of_small.arrays, of_large.arrays);
    for _ in 0..3 {
        let (a, b) = (small.advance()?, large.advance()?);
        assert_eq!(a.seconds.passes(), b.seconds.passes());
        assert_eq!(a.newton.history.counts, b.newton.history.counts);
    }
    assert_eq!(small.particles, large.particles);
    Ok(())
}

/// In the first step of the falling block: how often its laws are asked for their kind, the passes over the particles, and their number.
fn asked(bodies: &str, spacing: f64) -> Result<(u64, u64, u64), Failure> {
    let overrides = [format!("bodies={bodies}"), format!("grid.spacing={spacing}"), "output={}".to_owned()];
    let overrides: Vec<&str> = overrides.iter().map(String::as_str).collect();
    let calls = Arc::default();
    let mut simulation = scene::<2>("compaction_confined.json", &overrides)?.with_laws(|body| Watched {
        listed: true,
        calls: Arc::clone(&calls),
        ..Watched::unlisted(body.law.clone(), true)
    });
    calls.kinds.store(0, Ordering::Relaxed);
    let report = simulation.advance()?;
    let passes = report.seconds.passes().iter().sum();
    Ok((calls.kinds.load(Ordering::Relaxed), passes, simulation.particles.len() as u64))
}

#[test]
fn a_law_is_chosen_once_a_pass_and_not_for_every_particle() -> Result<(), Failure> {
    let body = |name: &str, x: [f64; 2]| {
        json!({
            "name": name, "shape": { "box": { "min": [x[0], 0], "max": [x[1], 1] } }, "density": 2700,
            "material": { "neo_hookean": { "lambda": 5e4, "shear": 3e4 } },
        })
    };
    let whole = json!([body("block", [0.0, 1.0])]).to_string();
    let halves = json!([body("left", [0.0, 0.5]), body("right", [0.5, 1.0])]).to_string();
    for spacing in [0.1, 0.025] {
        let (one_law, passes, particles) = asked(&whole, spacing)?;
        // There are more groups of eight particles than passes, so one question per group would exceed the count.
        assert!(spacing > 0.05 || particles / 8 > passes, "{particles} particles, {passes} passes");
        assert!(one_law > 0 && one_law < passes, "{one_law} in {passes} passes");
        let (two_laws, same_passes, _) = asked(&halves, spacing)?;
        assert_eq!((two_laws, same_passes), (2 * one_law, passes));
    }
    Ok(())
}

#[test]
fn fields_not_asked_for_are_not_computed() -> Result<(), Failure> {
    let law = Watched::unlisted(NeoHookean::ciarlet(Lame::new(5e4, 3e4)?).into(), false);
    let simulation = scene::<2>("column_static.json", &[])?.with_laws(|_| law.clone());
    let (energies, stresses) = (&law.calls.energies, &law.calls.stresses);
    let particles = simulation.particles.len() as u64;
    let folder = tempfile::tempdir()?;
    // (fields, stresses of a snapshot: one in the plane and one out of it)
    for (fields, expected) in [
        (None, 0),
        (Some(vec![Field::Displacement, Field::Jacobian]), 0),
        (Some(vec![Field::Stress]), 2 * particles),
        (Some(vec![Field::Stress, Field::Pressure]), 4 * particles),
    ] {
        let snapshot_every = fields.as_ref().map(|_| 0.1);
        let settings = OutputSettings { snapshot_every, fields: fields.unwrap_or_default(), ..output(folder.path()) };
        let reference = Reference::of(&simulation);
        energies.store(0, Ordering::Relaxed);
        stresses.store(0, Ordering::Relaxed);
        // Writes the state before the first step.
        Recorder::start(settings, &simulation, reference)?;
        assert_eq!(stresses.load(Ordering::Relaxed), expected);
        // For history.csv.
        assert_eq!(energies.load(Ordering::Relaxed), particles);
    }
    Ok(())
}
