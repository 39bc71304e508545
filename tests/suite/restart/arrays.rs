//! Every array of a checkpoint is needed: without it, or with other numbers in it, a run of some scene is refused or ends in other files.
//! Where the grid is kept, for example, the reference configuration takes the place of the positions of the particles.

use super::files;
use crate::support::{Failure, advance, built, merged, output, solid, with};
use bfree::checkpoint::{Checkpoints, Identity, restore};
use bfree::field::Field;
use bfree::output::{Outcome, OutputSettings, Recorder, Reference};
use bfree::simulation::Simulation;
use crc32fast::hash;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The bytes before the header: the mark of the format, its version, and the length of the header.
const PREFIX: usize = 16;

/// A checkpoint: the bytes of its mark and version, its header, and its arrays in the order of the file.
#[derive(Clone)]
struct Container {
    version: Vec<u8>,
    header: Value,
    arrays: Vec<(String, Vec<f64>)>,
}

impl Container {
    fn read(bytes: &[u8]) -> Result<Self, Failure> {
        let length = u32::from_le_bytes(bytes[PREFIX - 4..PREFIX].try_into()?) as usize;
        let header: Value = serde_json::from_slice(&bytes[PREFIX..PREFIX + length])?;
        let mut rest = &bytes[PREFIX + length + 4..];
        let mut arrays = Vec::new();
        for shape in header["arrays"].as_array().ok_or("no arrays")? {
            let count = shape["length"].as_u64().ok_or("no length")? as usize;
            let (numbers, after) = rest.split_at(8 * count);
            let number = |bytes: &[u8; 8]| f64::from_le_bytes(*bytes);
            let name = shape["name"].as_str().ok_or("no name")?.to_owned();
            arrays.push((name, numbers.as_chunks().0.iter().map(number).collect()));
            rest = &after[4..];
        }
        Ok(Self { version: bytes[..PREFIX - 4].to_vec(), header, arrays })
    }

    fn bytes(&self) -> Vec<u8> {
        let shape =
            |(name, numbers): &(String, Vec<f64>)| json!({"name": name, "type": "f64", "length": numbers.len()});
        let arrays: Vec<Value> = self.arrays.iter().map(shape).collect();
        let text = merged(self.header.clone(), json!({"arrays": arrays})).to_string();
        let mut bytes = self.version.clone();
        bytes.extend((text.len() as u32).to_le_bytes());
        bytes.extend(text.bytes());
        let sum = hash(&bytes[8..]);
        bytes.extend(sum.to_le_bytes());
        for (_, numbers) in &self.arrays {
            let numbers: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
            bytes.extend(&numbers);
            bytes.extend(hash(&numbers).to_le_bytes());
        }
        bytes
    }

    fn numbers(&self, name: &str) -> Option<&Vec<f64>> {
        self.arrays.iter().find(|(other, _)| other == name).map(|(_, numbers)| numbers)
    }

    fn without(&self, name: &str) -> Self {
        let mut other = self.clone();
        other.arrays.retain(|(one, _)| one != name);
        other
    }

    fn with(&self, name: &str, numbers: &[f64]) -> Self {
        let mut other = self.clone();
        other.arrays.iter_mut().filter(|(one, _)| one == name).for_each(|(_, old)| *old = numbers.to_vec());
        other
    }
}

/// Steps after a checkpoint.
const AFTER: usize = 2;

/// A scene, and the steps before its checkpoint.
struct Case {
    name: &'static str,
    scene: Value,
    before: usize,
}

/// A run that is continued from checkpoints with other arrays.
struct Continued<const D: usize> {
    start: Simulation<D>,
    identity: Identity,
    directory: tempfile::TempDir,
    first: Container,
    last: Container,
}

type Files = BTreeMap<String, Vec<u8>>;

impl<const D: usize> Continued<D> {
    fn new(case: &Case) -> Result<Self, Failure> {
        let start: Simulation<D> = built(&case.scene).map_err(|error| format!("{}: {error}", case.name))?;
        let (identity, directory) = (Identity::new(Value::Null, &start.particles), tempfile::tempdir()?);
        let mut recorder = Recorder::start(output(directory.path()), &start, Reference::of(&start))?;
        let mut checkpoint = |simulation: &Simulation<D>| -> Result<Container, Failure> {
            let path = directory.path().to_owned();
            Checkpoints::new(path, identity.clone(), Value::Null, 1.0, None).write(simulation, &mut recorder)?;
            Container::read(&std::fs::read(directory.path().join("checkpoint_0.bfree"))?)
        };
        let first = checkpoint(&start)?;
        let mut simulation = start.clone();
        advance(&mut simulation, case.before)?;
        let last = checkpoint(&simulation)?;
        Ok(Self { start, identity, directory, first, last })
    }

    /// The files of the steps after a checkpoint, or `None` if it is refused.
    fn files(&self, checkpoint: &Container) -> Result<Option<Files>, Failure> {
        std::fs::write(self.directory.path().join("checkpoint_0.bfree"), checkpoint.bytes())?;
        let mut simulation = self.start.clone();
        if restore(self.directory.path(), &self.identity, &mut simulation).is_err() {
            return Ok(None);
        }
        let folder = tempfile::tempdir()?;
        written(simulation, Reference::of(&self.start), folder.path())?;
        files(folder.path()).map(Some)
    }

    /// Arrays with other numbers: none, zeros, those of the start, and each single kind of number with the other sign.
    /// An array without numbers has no other ones.
    fn changed(&self, name: &str, numbers: &[f64]) -> Vec<(String, Container)> {
        if numbers.iter().all(|x| *x == 0.0) {
            return Vec::new();
        }
        let zeros = self.last.with(name, &vec![0.0; numbers.len()]);
        let mut all = vec![("absent".to_owned(), self.last.without(name)), ("zeros".to_owned(), zeros)];
        all.extend(self.first.numbers(name).map(|first| ("of the start".to_owned(), self.last.with(name, first))));
        for (part, range) in self.parts(name) {
            let mut other = numbers.to_vec();
            other[range].iter_mut().for_each(|x| *x = -*x);
            all.push((part, self.last.with(name, &other)));
        }
        all.retain(|(_, other)| other.numbers(name).is_none_or(|other| other != numbers));
        all
    }

    /// The parts of an array that holds numbers of several kinds.
    fn parts(&self, name: &str) -> Vec<(String, std::ops::Range<usize>)> {
        let mut parts: Vec<(String, usize)> = Vec::new();
        match name {
            "path" => parts = ["load", "increment", "speed", "weight"].map(|part| (part.to_owned(), 1)).into(),
            "contacts" => {
                let contacts = &self.start.loads.contacts;
                let points = self.last.numbers("added_points").map_or(0, |added| added.len() / (3 + D));
                for one in &contacts.obstacles {
                    let mut add = |part: &str, count| parts.push((format!("{part} of {}", one.name), count));
                    add("work", 1);
                    add("friction loss", 1);
                    add("anchors", if one.anchors.is_empty() { 0 } else { D * (one.anchors.len() + points) });
                    if one.free.is_some() {
                        add("position", D);
                        add("rotation", 9);
                        add("velocity", 6);
                        add("acceleration", 6);
                    }
                }
                let pairs = contacts.between.as_ref().map(|between| between.pairs.len());
                parts.extend(
                    pairs
                        .map(|pairs| [("energy".to_owned(), 1), ("losses of pairs".to_owned(), pairs)])
                        .into_iter()
                        .flatten(),
                );
            }
            _ => {}
        }
        let mut from = 0;
        let ranges = parts.into_iter().map(|(part, count)| (part, (from..from + count, from += count).0));
        ranges.filter(|(_, range)| !range.is_empty()).collect()
    }
}

/// Runs and writes everything that a run can write.
fn written<const D: usize>(
    mut simulation: Simulation<D>,
    reference: Reference<D>,
    directory: &Path,
) -> Result<(), Failure> {
    let mut fields: Vec<Field> = vec![Field::Position, Field::Stress, Field::PlasticStrain];
    if simulation.settings.scheme.has_inertia() {
        fields.extend([Field::Velocity, Field::Acceleration]);
    }
    let settings = OutputSettings { fields, snapshot_every: Some(1e-3), ..output(directory) };
    let mut recorder = Recorder::start(settings, &simulation, reference)?;
    for _ in 0..AFTER {
        // A step with wrong numbers may fail.
        let Ok(step) = simulation.advance() else { break };
        recorder.record(&simulation, &step)?;
    }
    recorder.finish(&simulation, &Map::new(), Outcome::Finished)?;
    Ok(())
}

/// Whether each change of an array of a case is refused or changes a file, added to what other cases have `seen`. Returns the names of all
/// arrays.
fn effects<const D: usize>(
    case: &Case,
    seen: &mut BTreeMap<(String, String), bool>,
) -> Result<BTreeSet<String>, Failure> {
    let run = Continued::<D>::new(case)?;
    let whole = run.files(&run.last)?.ok_or("the checkpoint itself is refused")?;
    let folder = tempfile::tempdir()?;
    let mut undisturbed = run.start.clone();
    advance(&mut undisturbed, case.before)?;
    written(undisturbed, Reference::of(&run.start), folder.path())?;
    assert!(whole == files(folder.path())?, "{}: a restart changes the run", case.name);
    for (name, numbers) in &run.last.arrays {
        for (change, other) in run.changed(name, numbers) {
            let differs = run.files(&other)?.is_none_or(|files| files != whole);
            *seen.entry((name.clone(), change)).or_default() |= differs;
        }
    }
    Ok(run.last.arrays.into_iter().map(|(name, _)| name).collect())
}

/// Two plastic or viscous blocks that rub, on a floor that the lower one is held to, under a free brick that spins.
fn everything_with_inertia() -> Value {
    let metal = json!({"von_mises": {"elastic": {"young": 2000, "poisson": 0.3}, "yield_stress": {"initial": 20, "linear": 10}}});
    let block = |name: &str, min: [f64; 2], max: [f64; 2]| solid(name, 2000, json!({"box": {"min": min, "max": max}}));
    let lower = merged(block("lower", [0.5, 0.0], [2.0, 0.75]), json!({"material": metal, "velocity": [0.0, 0.0]}));
    let upper = merged(
        block("upper", [0.75, 0.76], [1.75, 1.26]),
        json!({"velocity": [3, -4], "volumetric": "mean_dilatation"}),
    );
    json!({
        "grid": {"size": [3, 3], "spacing": 0.25, "reset": "never"},
        "time": {"step": 0.005, "end": 1},
        "bodies": [lower, upper],
        "boundary": {"bottom": "fixed"},
        "prescribed": [{"region": {"box": {"min": [0, 0], "max": [0.6, 0.3]}}, "displacement": [[0, [0, 0]], [1, [0.4, 0]]]}],
        "gravity": {"acceleration": [1, -3]},
        "damping": {"mass": 0.5},
        "contact": {"friction": 0.3},
        "obstacles": [
            {"name": "brick", "shape": {"box": {"min": [1, 1.27], "max": [1.5, 1.6]}}, "friction": 0.4,
             "free": {"density": 2, "velocity": [-2, -5], "spin": [3]}},
            {"name": "wall", "shape": {"half_space": {"point": [2.01, 0], "normal": [-1, 0]}}, "friction": 0.2,
             "displacement": [[0, [0, 0]], [1, [-2, 1]]]}
        ]
    })
}

/// Bodies that are bonded and held, on a grid that is reset under loads that depend on the place.
fn load_steps() -> Value {
    let block = |name: &str, min: [f64; 2], max: [f64; 2]| solid(name, 500, json!({"box": {"min": min, "max": max}}));
    json!({
        "grid": {"size": [3, 3], "spacing": 0.25, "reset": "every_step"},
        "time": {"step": 0.1, "end": 1, "scheme": "none"},
        "bodies": [block("left", [0.5, 0.0], [1.0, 1.0]), block("right", [1.0, 0.0], [1.5, 1.0])],
        "boundary": {"bottom": "fixed"},
        "prescribed": [{"region": {"box": {"min": [0, 0.8], "max": [0.6, 1.1]}}, "displacement": [[0, [0, 0]], [1, [0.3, -0.1]]]}],
        "gravity": {"acceleration": [40, -60], "curve": [[0, 0], [1, 1]],
                    "profile": {"along": [1, 1], "factor": [[0, 1], [3, 2]]}}
    })
}

/// A scene whose grid is reset otherwise.
fn reset(scene: Value, reset: Value) -> Value {
    with(scene, &[("/grid/reset", reset)])
}

fn cantilever(scheme: &str, renewal: Value) -> Value {
    json!({
        "grid": {"size": [5, 4], "spacing": 0.25, "reset": renewal},
        "time": {"step": 0.05, "end": 1, "scheme": scheme},
        "bodies": [solid("beam", 1200, json!({"box": {"min": [0, 2], "max": [4, 2.5]}}))],
        "boundary": {"left": "fixed"},
        "tractions": [{"body": "beam", "region": {"half_space": {"point": [4, 0], "normal": [-1, 0]}}, "traction": [-2, -6], "curve": [[0, 0], [1, 1]]}]
    })
}

/// A scene whose first body averages its change of volume.
fn averaged(scene: Value) -> Value {
    with(scene, &[("/bodies/0/volumetric", json!("mean_dilatation"))])
}

fn cases() -> Vec<Case> {
    let case = |name, scene, before| Case { name, scene, before };
    vec![
        case("inertia", everything_with_inertia(), 12),
        case("inertia, resets", reset(everything_with_inertia(), json!("every_step")), 12),
        case("load steps", reset(load_steps(), json!("never")), 4),
        case("load steps, resets", load_steps(), 4),
        case("arc length, some resets", cantilever("arc_length", json!({"strain": 0.02})), 4),
        case("arc length, resets", cantilever("arc_length", json!({"strain": 1e-6})), 4),
        case("mean dilatation, some resets", averaged(cantilever("none", json!({"strain": 0.02}))), 4),
    ]
}

#[test]
fn every_array_of_a_checkpoint_is_needed() -> Result<(), Failure> {
    let (mut names, mut seen) = (BTreeSet::new(), BTreeMap::new());
    for case in cases() {
        names.extend(effects::<2>(&case, &mut seen)?);
    }
    let unseen: Vec<_> = seen.iter().filter(|(_, seen)| !**seen).map(|(change, _)| change).collect();
    assert!(unseen.is_empty(), "no file of any case differs: {unseen:?}");
    let never: Vec<_> = names.iter().filter(|name| !seen.keys().any(|(other, _)| other == *name)).collect();
    assert!(never.is_empty(), "arrays without a number in all cases: {never:?}");
    Ok(())
}
