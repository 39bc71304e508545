//! An equilibrium path with two turning points: Williams' toggle frame (Quart. J. Mech. Appl. Math. 17, 1964), two shallow bars and a rigid
//! joint. The study `robust` compares it with its closed form.

use crate::support::{Failure, output, scene};
use bfree::output::warnings::Kind;
use bfree::output::{Outcome, OutputSettings, Recorder, Reference};
use bfree::simulation::Simulation;

const LENGTH: f64 = 10.0;
const RISE: f64 = 0.5;
const DEPTH: f64 = 0.25;
const YOUNG: f64 = 1e6;

/// Half of the frame, from its clamped foot to the joint, which slides down the plane of symmetry under half of the load, 100 λ.
fn toggle(more: &[&str]) -> Result<Simulation<2>, Failure> {
    let overrides = [
        &format!("grid.size=[{LENGTH}, 4]"),
        &format!("grid.spacing={}", DEPTH / 3.0),
        &format!(r#"bodies.0.shape={{"box":{{"min":[0,1.75],"max":[{LENGTH},2]}}}}"#),
        &format!(r#"bodies.0.material={{"neo_hookean":{{"young":{YOUNG},"poisson":0}}}}"#),
        r#"boundary={"left":"fixed","right":"sliding"}"#,
        r#"time={"step":0.02,"end":0.4,"scheme":"arc_length"}"#,
        "output={}",
        r#"tractions=[{"body":"beam","region":{"box":{"min":[9.75,2],"max":[10,3]}},"traction":[0,-400],"curve":[[-10,-10],[10,10]]}]"#,
    ];
    let mut simulation: Simulation<2> = scene("elastica.json", &[&overrides, more].concat())?;
    // The bars rise. They are sheared, so that their ends stay on the walls.
    simulation.particles.position.iter_mut().for_each(|x| x[1] += RISE / LENGTH * x[0]);
    Ok(simulation)
}

#[test]
fn a_load_is_followed_down_and_up_again() -> Result<(), Failure> {
    let mut simulation = toggle(&[])?;
    let last = (0..simulation.particles.len())
        .max_by(|&a, &b| simulation.particles.position[a].sum().total_cmp(&simulation.particles.position[b].sum()));
    let joint = simulation.particles.id[last.ok_or("no particles")?] as usize;
    let height = |of: &Simulation<2>| of.particles.by_id().position[joint][1];
    let start = height(&simulation);
    let mut path = Vec::new();
    while simulation.clock.time() < 0.55 {
        let step = simulation.advance()?;
        assert!(step.failed.is_empty() && step.newton.history.iterations.len() <= 5);
        path.push(simulation.path.load);
    }
    assert!(start - height(&simulation) > RISE, "the frame hangs: {}", start - height(&simulation));
    let turns = path.windows(3).filter(|load| (load[1] - load[0]) * (load[2] - load[1]) < 0.0).count();
    assert_eq!(turns, 2, "up, down and up again: {path:?}");
    // The work of the load, up and down, equals the stored energy, within the error of the trapezoidal rule.
    let (work, stored) = (simulation.external_work, simulation.strain_energy() + simulation.dissipated);
    assert!((work / stored - 1.0).abs() < 0.01, "{work} {stored}");
    Ok(())
}

#[test]
fn a_load_that_turns_is_told() -> Result<(), Failure> {
    let mut simulation = toggle(&[])?;
    let directory = tempfile::tempdir()?;
    let settings = OutputSettings { end_time: 0.3, ..output(directory.path()) };
    let reference = Reference::of(&simulation);
    let (mut recorder, mut largest) = (Recorder::start(settings, &simulation, reference)?, 0.0_f64);
    while simulation.clock.time() < 0.3 {
        let step = simulation.advance()?;
        largest = largest.max(simulation.path.load);
        recorder.record(&simulation, &step)?;
    }
    let summary = recorder.finish(&simulation, &serde_json::Map::new(), Outcome::Finished)?;
    let [turned] = &summary.warnings[..] else { return Err(format!("{:?}", summary.warnings).into()) };
    assert_eq!(turned.kind, Kind::PathTurned);
    assert!(turned.message.contains(&format!("{largest:.6e}, a limit point")), "{} {largest}", turned.message);
    Ok(())
}

#[test]
fn a_path_without_end_is_said_to_be_one() -> Result<(), Failure> {
    let constant = r#"tractions=[{"body":"beam","region":{"box":{"min":[9.75,2],"max":[10,3]}},"traction":[0,-400],"curve":[[0,0],[0.05,0.05]]}]"#;
    let mut simulation = toggle(&[constant])?;
    let error = loop {
        match simulation.advance() {
            Ok(_) => assert!(simulation.path.load < 0.05, "{}", simulation.path.load),
            Err(error) => break error,
        }
    };
    assert!(error.cause.to_string().contains("no load changes there"), "{}", error.cause);
    Ok(())
}

#[test]
fn what_a_path_cannot_have_is_refused() -> Result<(), Failure> {
    for (key, path) in [
        (r#"boundary={"left":{"displacement":[[0,[0,0]],[1,[0,0.1]]]}}"#, "boundary.left"),
        (r#"grid.reset="every_step""#, "grid.reset"),
        (r#"pressures=[{"body":"beam","pressure":1}]"#, "pressures[0]"),
        (r#"prescribed=[{"region":{"box":{"min":[0,0],"max":[1,4]}},"velocity":[[0,[1,0]]]}]"#, "prescribed[0]"),
    ] {
        let error = toggle(&[key]).expect_err(key).to_string();
        let words = "for dead loads, walls at rest and a grid that is kept";
        assert!(error.contains(path) && error.contains(words), "{key}: {error}");
    }
    let conjugate = toggle(&[r#"solver.krylov.method="conjugate_gradient""#]).err().ok_or("built")?.to_string();
    assert!(["solver.krylov.method", "the load is unknown", "gmres"].iter().all(|word| conjugate.contains(word)));
    // A table of zeros is a wall at rest.
    toggle(&[r#"boundary={"left":{"displacement":[[0,[0,0]]]}}"#])?;
    Ok(())
}
