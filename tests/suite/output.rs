//! The output files of a run agree with the simulation and with each other.

mod values;

use crate::support::{Failure, body, built, output, solid};
use bfree::approximation::{Approximation, Linear};
use bfree::clock::Clock;
use bfree::field::Field;
use bfree::grid::Grid;
use bfree::material::{Lame, Material, NeoHookean};
use bfree::mechanics::loads::{Curve, Gravity, Motion, Prescribed, Selection};
use bfree::output::plot::{Look, plot_frames, plot_run};
use bfree::output::vtu::Snapshot;
use bfree::output::{Outcome, OutputError, OutputSettings, Place, Probe, Recorder, Reference};
use bfree::particles::Particles;
use bfree::simulation::{AdvanceError, Simulation, StepError};
use bfree::tensor::{Tensor, Vector};
use serde_json::{Map, Value, json};
use std::path::Path;

const LAMBDA: f64 = 150.0;
const SHEAR: f64 = 30.0;

/// One particle at rest in the middle of a unit box.
fn single<const D: usize>(h: Tensor<f64, D>) -> Result<Simulation<D>, Failure> {
    let mut particles = Particles::default();
    particles.push(Vector::repeat(0.5), Vector::zeros(), 0.25, 0.5, 0);
    particles.displacement_gradient[0] = h;
    let law = Material::from(NeoHookean::ciarlet(Lame::new(LAMBDA, SHEAR)?));
    let grid = Grid { origin: Vector::zeros(), spacing: 0.25, cells: [4; D] };
    Ok(Simulation::new(grid, Approximation::from(Linear), vec![body(law)], particles, Clock::new(0.01, 3)))
}

/// A square falls onto a sliding floor.
fn falling() -> Result<Simulation<2>, Failure> {
    let mut simulation = single::<2>(Tensor::zeros())?;
    simulation.particles = Particles::default();
    for k in 0..64 {
        let x = Vector::from([0.28125 + 0.0625 * f64::from(k % 8), 0.03125 + 0.0625 * f64::from(k / 8)]);
        simulation.particles.push(x, Vector::from([0.5, -1.0]), 0.0625 * 0.0625, 2.0 * 0.0625 * 0.0625, 0);
    }
    simulation.loads.gravity = Some(Gravity { acceleration: Vector::from([0.0, -9.81]), curve: Curve::constant(1.0) });
    let on = Selection::Face { axis: 1, upper: false };
    simulation.loads.prescribed = vec![Prescribed { name: "floor".into(), on, motion: [None, Some(Motion::Rest)] }];
    Ok(simulation)
}

fn settings<const D: usize>(directory: &Path) -> OutputSettings<D> {
    let fields = vec![Field::Stress, Field::Body, Field::Displacement];
    OutputSettings { fields, snapshot_every: Some(0.05), end_time: 0.2, ..output(directory) }
}

/// The offset from a particle to a point beside it.
const ASIDE: Vector<f64, 2> = Vector::<f64, 2>::new(0.03, 0.06);

/// Rows of a table as text, by the name of the column.
fn column(path: &Path, name: &str) -> Result<Vec<f64>, Failure> {
    let text = std::fs::read_to_string(path)?;
    let mut lines = text.lines();
    let place = lines.next().ok_or("empty")?.split(',').position(|column| column == name).ok_or("no such column")?;
    lines.map(|line| Ok(line.split(',').nth(place).ok_or("short row")?.parse()?)).collect()
}

/// A run of twenty steps with its files, and what the simulation itself said after each step.
struct Recorded {
    directory: tempfile::TempDir,
    initial: Simulation<2>,
    simulation: Simulation<2>,
    summary: bfree::output::Summary,
    energies: Vec<f64>,
    newton: Vec<usize>,
    /// The vertical force on the floor.
    floor: Vec<f64>,
    /// The vertical displacement of the last particle, and how much its deformation adds at a point beside it.
    tops: Vec<f64>,
    carried: Vec<f64>,
}

impl Recorded {
    fn file(&self, name: &str) -> std::path::PathBuf {
        self.directory.path().join(name)
    }

    fn column(&self, file: &str, name: &str) -> Result<Vec<f64>, Failure> {
        column(&self.file(file), name)
    }
}

fn recorded() -> Result<Recorded, Failure> {
    let directory = tempfile::tempdir()?;
    std::fs::write(directory.path().join("particles_000099.vtu"), "of an earlier run")?;
    let mut simulation = falling()?;
    let initial = simulation.clone();
    // The nearest particle starts at (0.71875, 0.46875).
    let corner = Vector::from([1.0, 0.875]);
    let at_point = |within| Place::Nearest { point: corner, body: None, within };
    let beside = || Place::Carried { particle: 63, offset: ASIDE };
    let probe = |name: &str, field, place| Probe { name: name.into(), field, component: None, place };
    let probes = vec![
        probe("top", Field::Displacement, Place::Particle(63)),
        probe("near", Field::Jacobian, at_point(2.0)),
        probe("beside", Field::Displacement, beside()),
        probe("there", Field::Position, beside()),
        probe("far", Field::Velocity, at_point(0.4)),
        Probe { component: Some(1), ..probe("up", Field::Displacement, Place::Particle(63)) },
    ];
    let settings = OutputSettings { probes, ..settings(directory.path()) };
    let mut recorder = Recorder::start(settings, &simulation, Reference::of(&initial))?;
    let (mut energies, mut newton, mut floor) = (Vec::new(), Vec::new(), Vec::new());
    let (mut tops, mut carried) = (Vec::new(), Vec::new());
    for _ in 0..20 {
        let step = simulation.advance()?;
        recorder.record(&simulation, &step)?;
        energies.push(simulation.particles.kinetic_energy() + simulation.strain_energy());
        newton.push(step.newton.history.iterations.len());
        floor.push(step.reactions[0].force[1]);
        let top = simulation.particles.place(63).ok_or("the particle is lost")?;
        tops.push(simulation.particles.position[top][1] - initial.particles.position[63][1]);
        carried.push((simulation.particles.displacement_gradient[top] * ASIDE)[1]);
    }
    let scene = Map::from_iter([("settings".into(), json!({"scene": "falling"}))]);
    let summary = recorder.finish(&simulation, &scene, Outcome::Finished)?;
    Ok(Recorded { directory, initial, simulation, summary, energies, newton, floor, tops, carried })
}

#[test]
fn the_tables_of_a_run_agree_with_it() -> Result<(), Failure> {
    let run = recorded()?;
    let header = "step,time,dt,kinetic,strain,external,total,balance,momentum_x,momentum_y,newton,krylov";
    assert_eq!(std::fs::read_to_string(run.file("history.csv"))?.lines().next(), Some(header));
    let history = |name: &str| run.column("history.csv", name);
    let (total, external) = (history("total")?, history("external")?);
    assert_eq!(total[1..], run.energies, "the same bits");
    assert_eq!(history("time")?.last(), Some(&run.simulation.clock.time()));
    assert_eq!(external.last(), Some(&run.simulation.external_work));
    for (k, balance) in history("balance")?.into_iter().enumerate() {
        assert_eq!(balance, total[k] - total[0] - external[k]);
    }
    assert_eq!((history("dt")?[0], history("newton")?[0]), (0.0, 0.0));
    let newton: Vec<usize> = history("newton")?.iter().map(|&x| x as usize).collect();
    assert_eq!(newton[1..], run.newton);
    assert_eq!(run.column("reactions.csv", "floor_y")?, run.floor);

    let probe = |name: &str| run.column("probes.csv", name);
    assert_eq!(probe("top_y")?[1..], run.tops);
    assert_eq!(probe("up")?, probe("top_y")?);
    let (beside, there, start) = (probe("beside_y")?, probe("there_y")?, run.initial.particles.position[63][1]);
    assert!(run.carried.iter().any(|add| add.abs() > 1e-6), "a body that deforms");
    for (k, (top, add)) in run.tops.iter().zip(&run.carried).enumerate() {
        assert_eq!(beside[k + 1], top + add);
        assert!((there[k + 1] - (start + ASIDE[1] + top + add)).abs() < 1e-14);
    }
    let near = probe("near")?;
    assert!(near.len() == 21 && near.iter().all(|x| x.is_finite()), "{near:?}");
    assert!(probe("far_y")?.iter().all(|x| x.is_nan()), "no particle is that near");
    Ok(())
}

#[test]
fn the_report_of_a_run_agrees_with_it() -> Result<(), Failure> {
    let run = recorded()?;
    let report: Value = serde_json::from_slice(&std::fs::read(run.file("report.json"))?)?;
    let steps = report["steps"].as_array().ok_or("no steps")?;
    let lengths = |key: &str| steps.iter().map(|step| step[key].as_array().map_or(0, Vec::len)).collect::<Vec<_>>();
    assert_eq!(lengths("newton_residuals"), run.newton.iter().map(|n| n + 1).collect::<Vec<_>>());
    assert_eq!(lengths("krylov_iterations"), run.newton);
    assert_eq!(lengths("krylov_residuals"), run.newton);
    let [time, krylov] = ["time", "krylov"].map(|name| run.column("history.csv", name));
    let (time, krylov) = (time?, krylov?);
    for (k, step) in steps.iter().enumerate() {
        assert_eq!((&step["time"], &step["dt"]), (&json!(time[k + 1]), &json!(0.01)));
        let sum: u64 = step["krylov_iterations"].as_array().into_iter().flatten().filter_map(Value::as_u64).sum();
        assert_eq!((json!(sum), krylov[k + 1]), (step["krylov_total"].clone(), sum as f64));
        let reached = step["krylov_residuals"].as_array().into_iter().flatten().filter_map(Value::as_f64);
        assert!(reached.into_iter().all(|x| x <= 1e-8), "{step}");
    }
    assert_eq!(report["counts"]["newton_iterations"], run.newton.iter().sum::<usize>());
    assert_eq!(report["counts"]["steps"], 20);
    assert_eq!(report["settings"]["scene"], "falling");
    assert_eq!(run.summary.counts.steps, 20);
    assert!(!run.file("newton.jsonl").exists() && !run.file("particles_000099.vtu").exists());
    Ok(())
}

#[test]
fn the_snapshots_of_a_run_agree_with_it() -> Result<(), Failure> {
    let run = recorded()?;
    let reference = Reference::of(&run.initial);
    // t = 0, 0.05, 0.1, 0.15, 0.2. At the last time an output is due and the run ends; the snapshot is written once.
    let series = std::fs::read_to_string(run.file("particles.pvd"))?;
    assert_eq!(series.matches("<DataSet").count(), 5);
    let last = Snapshot::read(&run.file("particles_000004.vtu"))?;
    assert_eq!(last.time, run.simulation.clock.time());
    assert_eq!(last.points.len(), run.simulation.particles.len());
    for (point, x) in last.points.iter().zip(&run.simulation.particles.by_id().position) {
        assert_eq!(*point, [x[0], x[1], 0.0]);
    }
    let names: Vec<_> = last.arrays.iter().map(|array| array.name.as_str()).collect();
    assert_eq!(names, ["stress", "body", "displacement"], "what was asked for, and nothing else");
    assert_eq!(last.arrays[0].values, Field::Stress.values(&run.simulation, &reference)?);
    assert_eq!(last.arrays[2].values, Field::Displacement.values(&run.simulation, &reference)?);
    Ok(())
}

/// Two blocks on a floor, pressed by 1 % between smooth walls: the pressure is the same on the floor and on both sides between the blocks.
#[test]
fn snapshots_of_surfaces_have_the_pressure_and_the_gap_of_contact() -> Result<(), Failure> {
    let block = |name, min: f64, max: f64| solid(name, 1000, json!({ "box": { "min": [0, min], "max": [2, max] } }));
    let scene = json!({
        "grid": { "size": [2, 2.25], "spacing": 0.25 },
        "time": { "scheme": "none", "step": 0.5, "end": 1 },
        "bodies": [block("lower", 0.25, 1.25), block("upper", 1.25, 2.25)],
        "boundary": { "left": "sliding", "right": "sliding", "top": { "displacement": [[0, [null, 0]], [1, [null, -0.02]]] } },
        "obstacles": [{ "name": "floor", "shape": { "half_space": { "point": [0, 0.250001], "normal": [0, 1] } } }],
        "contact": {}
    });
    let (mut simulation, directory) = (built::<2>(&scene)?, tempfile::tempdir()?);
    let (end_time, reference) = (1.0, Reference::of(&simulation));
    let settings = OutputSettings { snapshot_every: Some(1.0), end_time, ..output(directory.path()) };
    let mut recorder = Recorder::start(settings, &simulation, reference)?;
    let mut force = Vector::zeros();
    for _ in 0..2 {
        let step = simulation.advance()?;
        recorder.record(&simulation, &step)?;
        force = step.obstacles[0].force;
    }
    recorder.finish(&simulation, &Map::new(), Outcome::Finished)?;
    let surfaces = Snapshot::read(&directory.path().join("contacts_000001.vtu"))?;
    let of = |name: &str| surfaces.arrays.iter().find(|array| array.name == name).map(|array| array.values.clone());
    let [Some(pressure), Some(traction), Some(gap), Some(area)] = ["pressure", "traction", "gap", "area"].map(of)
    else {
        return Err("an array is missing".into());
    };
    let expected = -force[1] / 2.0;
    assert!(expected > 5.0, "the blocks are pressed: {expected}");
    let (mut on_floor, mut between) = (0.0, 0.0);
    for (k, x) in surfaces.points.iter().enumerate() {
        let touches = pressure[k] > 0.0;
        assert_eq!((gap[k] < 0.0, traction[3 * k + 1] != 0.0), (touches, touches), "{x:?}");
        assert!(!touches || (pressure[k] / expected - 1.0).abs() < 1e-6, "{x:?}: {} for {expected}", pressure[k]);
        on_floor += if x[1] < 0.3 { traction[3 * k + 1] * area[k] } else { 0.0 };
        between += if touches && x[1] > 0.3 { area[k] } else { 0.0 };
        assert!(touches || gap[k] > 0.0, "{x:?}");
    }
    assert!((on_floor / -force[1] - 1.0).abs() < 1e-9, "{on_floor} {force}");
    assert!((between / 4.0 - 1.0).abs() < 1e-9, "both sides between the blocks: {between}");
    Ok(())
}

#[test]
fn a_run_that_dies_leaves_what_it_did() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let mut simulation = falling()?;
    let reference = Reference::of(&simulation);
    let mut recorder = Recorder::start(settings(directory.path()), &simulation, reference)?;
    for _ in 0..7 {
        let step = simulation.advance()?;
        recorder.record(&simulation, &step)?;
        std::thread::sleep(std::time::Duration::from_millis(60));
    }
    std::mem::forget(recorder); // as if killed: nothing is dropped, nothing is flushed
    let times = column(&directory.path().join("history.csv"), "time")?;
    assert!(times.len() >= 7, "{times:?}");
    assert!(Snapshot::read(&directory.path().join("particles_000001.vtu")).is_ok());
    let pictures = plot_run(directory.path(), &Look::default())?;
    let names: Vec<_> = pictures.iter().filter_map(|path| path.file_stem()?.to_str()).collect();
    let drawn = ["energies", "momentum", "reactions", "iterations", "convergence", "particles"];
    assert_eq!(names, [&drawn.map(|name| [name; 2]).concat()[..], &["report"]].concat());
    let page = std::fs::read_to_string(directory.path().join("report.html"))?;
    assert!(page.contains("killed") && page.matches("<svg").count() == 5 && page.ends_with("</html>\n"));
    // The player contains all snapshots, at least two, and every number: 16 bits for each one that varies.
    let between = |start: &str, end: &str| page.split(start).nth(1).and_then(|rest| rest.split(end).next());
    let meta: Value = serde_json::from_str(between("id=\"snapshots\">", "</script>").ok_or("no snapshots")?)?;
    let times = meta["times"].as_array().ok_or("no times")?.len();
    let series = std::fs::read_to_string(directory.path().join("particles.pvd"))?;
    assert_eq!((times, &meta["shown"]), (series.matches("<DataSet").count(), &json!(64)));
    let varying = |still: bool| {
        let channels = meta["channels"].as_array().into_iter().flatten().enumerate();
        channels.filter(|(k, channel)| (*k < 4) == still && !channel["start"].is_null()).count()
    };
    let numbers = between("id=\"numbers\">", "</script>").ok_or("no numbers")?;
    let bytes = 2 * 64 * (varying(true) + times * varying(false));
    assert!(times > 1 && numbers.len() == bytes.div_ceil(3) * 4, "{bytes} bytes, {} letters", numbers.len());
    // A movie has one frame per snapshot.
    let frames = plot_frames(directory.path(), &directory.path().join("frames"), &Look::default())?;
    assert_eq!(frames.len(), times);
    assert!(frames.iter().all(|frame| std::fs::read(frame).is_ok_and(|png| png.starts_with(b"\x89PNG"))));
    let without_snapshots = plot_frames(&directory.path().join("frames"), directory.path(), &Look::default());
    assert!(without_snapshots.is_err());
    for picture in pictures.iter().filter(|path| path.extension().is_some_and(|extension| extension == "png")) {
        assert!(std::fs::read(picture)?.starts_with(b"\x89PNG"));
    }
    Ok(())
}

#[test]
fn one_and_three_dimensions_are_drawn_too() -> Result<(), Failure> {
    fn run<const D: usize>() -> Result<usize, Failure> {
        let directory = tempfile::tempdir()?;
        let simulation = single(Tensor::<f64, D>::zeros())?;
        let recorder = Recorder::start(settings(directory.path()), &simulation, Reference::of(&simulation))?;
        let cause = Box::new(StepError::LeftGrid { particle: 0, position: vec![7.0] });
        let error = AdvanceError { time: 0.0, dt: 0.01, cause, failed: Vec::new() };
        recorder.finish(&simulation, &Map::new(), Outcome::Failed(&error))?;
        let report: Value = serde_json::from_slice(&std::fs::read(directory.path().join("report.json"))?)?;
        assert_eq!(report["outcome"], "failed");
        let message = report["message"].as_str().unwrap_or_default();
        assert!(message.contains("from t = 0") && message.contains("particle 0 leaves the grid at [7.0]"), "{message}");
        Ok(plot_run(directory.path(), &Look::default())?.len())
    }
    // No step was taken and nothing moves: there is no history of Newton's method and no momentum to show.
    assert_eq!((run::<1>()?, run::<3>()?), (7, 7));
    Ok(())
}

#[test]
fn settings_that_make_no_sense_are_refused_with_their_numbers() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let simulation = falling()?;
    let start = |change: &dyn Fn(&mut OutputSettings<2>)| {
        let mut settings = settings(directory.path());
        change(&mut settings);
        Recorder::start(settings, &simulation, Reference::of(&simulation)).err()
    };
    let probe = |place| Probe { name: "p".into(), field: Field::Velocity, component: None, place };
    let missing = start(&|settings| settings.probes = vec![probe(Place::Particle(64))]);
    assert!(matches!(missing, Some(OutputError::ProbeParticle { particle: 64, particles: 64, .. })), "{missing:?}");
    let nowhere = Place::Nearest { point: Vector::from([f64::NAN, 0.0]), body: None, within: 1.0 };
    let nowhere = start(&|settings| settings.probes = vec![probe(nowhere)]);
    assert!(matches!(nowhere, Some(OutputError::ProbePoint { .. })), "{nowhere:?}");
    let twice = start(&|settings| settings.probes = vec![probe(Place::Particle(0)), probe(Place::Particle(1))]);
    assert!(matches!(twice, Some(OutputError::DuplicateColumn { .. })), "{twice:?}");
    let never = start(&|settings| settings.snapshot_every = Some(f64::NAN));
    assert!(matches!(never, Some(OutputError::SnapshotEvery(_))), "{never:?}");
    let file = directory.path().join("file");
    std::fs::write(&file, "")?;
    let under_a_file = start(&|settings| settings.directory = file.join("run"));
    assert!(matches!(under_a_file, Some(OutputError::Io { .. })), "{under_a_file:?}");
    let other = Recorder::start(settings(directory.path()), &simulation, Reference::of(&single(Tensor::zeros())?));
    assert!(matches!(other, Err(OutputError::Reference { reference: 1, particles: 64 })));
    Ok(())
}

#[test]
fn the_report_shows_the_projection_of_attempts_that_failed() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let mut simulation = falling()?;
    simulation.settings.lumping = 0.5;
    simulation.settings.newton.max_iterations = 0;
    let recorder = Recorder::start(settings(directory.path()), &simulation, Reference::of(&simulation))?;
    let Err(error) = simulation.advance() else { return Err("no iteration was allowed".into()) };
    let iterations: Vec<usize> = error.failed.iter().map(|attempt| attempt.projection_iterations).collect();
    assert!(iterations.len() == 4 && iterations.iter().all(|&n| n > 0), "{iterations:?}");
    recorder.finish(&simulation, &Map::new(), Outcome::Failed(&error))?;
    let report: Value = serde_json::from_slice(&std::fs::read(directory.path().join("report.json"))?)?;
    let attempts = report["failed_attempts"].as_array().ok_or("no attempts")?;
    let shown: Vec<&Value> = attempts.iter().map(|attempt| &attempt["projection_iterations"]).collect();
    assert_eq!(shown, iterations.iter().map(|&n| json!(n)).collect::<Vec<_>>().iter().collect::<Vec<_>>());
    assert_eq!(report["counts"]["projection_iterations"], iterations.iter().sum::<usize>());
    Ok(())
}
