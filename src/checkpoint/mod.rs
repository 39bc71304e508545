//! Checkpoints: from which a run that was killed continues with the same bits.
//!
//! Two files in the directory of the results take turns, so that the one before is there while a new one is written; each is
//! written under a temporary name, synced and renamed. A checkpoint holds what a step inherits (`state.rs`), the scene, and where
//! the files of the results ended ([`Mark`]): [`restore`] puts the simulation back, [`Recorder::resume`] cuts the files off there.
//! A new array has its place in `state.rs`.
//!
//! ```
//! use bfree::checkpoint::{Checkpoints, Identity, forget, restore, unfinished};
//! use bfree::output::{Audience, OutputSettings, Recorder, Reference};
//!
//! let (folder, scene) = (tempfile::tempdir()?, bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?);
//! let (start, directory) = (scene.build::<2>("scenes".as_ref())?, folder.path().to_owned());
//! let identity = Identity::new(serde_json::to_value(&scene)?, &start.particles);
//! let settings = OutputSettings {
//!     directory: directory.clone(), fields: vec![], snapshot_every: None, probes: vec![], end_time: 1.0,
//!     audience: Audience::Nobody,
//! };
//! // A run that is killed at t = 0.15, with a checkpoint every 0.1.
//! let mut simulation = start.clone();
//! let mut recorder = Recorder::start(settings, &simulation, Reference::of(&simulation))?;
//! let mut checkpoints = Checkpoints::new(directory.clone(), identity.clone(), serde_json::Value::Null, 0.1, None);
//! for _ in 0..3 {
//!     let step = simulation.advance()?;
//!     recorder.record(&simulation, &step)?;
//!     checkpoints.write_if_due(&simulation, &mut recorder)?;
//! }
//! assert_eq!(unfinished(&directory).map(|run| run.steps), Some(2));
//! // It goes on from t = 0.1, to the same bits.
//! let mut continued = start.clone();
//! restore(&directory, &identity, &mut continued)?;
//! assert_eq!(continued.clock.time(), 0.1);
//! continued.advance()?;
//! assert_eq!((&continued.particles, continued.clock), (&simulation.particles, simulation.clock));
//! // Or a checkpoint now, whether one is due or not; and none any more.
//! checkpoints.write(&simulation, &mut recorder)?;
//! let mut last = start.clone();
//! restore(&directory, &identity, &mut last)?;
//! assert_eq!(last.clock, simulation.clock);
//! forget(&directory)?;
//! assert!(restore(&directory, &identity, &mut last).is_err());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod container;
mod difference;
mod state;

use crate::clock::Reached;
use crate::output::files::write_atomically;
use crate::output::snapshots::multiples;
use crate::output::{Mark, OutputError, Recorder};
use crate::particles::Particles;
use crate::simulation::Simulation;
use container::{Array, Damage};
use difference::Difference;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs::File;
use std::io::{BufReader, ErrorKind};
use std::path::{Path, PathBuf};

/// The files that take turns.
const NAMES: [&str; 2] = ["checkpoint_0.bfree", "checkpoint_1.bfree"];

/// The program that writes.
const PROGRAM: &str = concat!("bfree ", env!("CARGO_PKG_VERSION"));

/// What belongs to a run and to no other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// The scene with all defaults.
    scene: Value,
    /// Checksums of the particles at the start.
    start: Vec<(String, u32)>,
}

impl Identity {
    /// Of the run of `scene` that starts with `particles`.
    pub fn new<const D: usize>(scene: Value, particles: &Particles<D>) -> Self {
        Self { scene, start: state::fingerprint(particles) }
    }

    /// Whether a checkpoint of `then` continues this run.
    fn check(&self, then: &Self, path: &Path) -> Result<(), CheckpointError> {
        let path = path.to_owned();
        let shown = |value: Option<Value>| value.map_or_else(|| "nothing".to_owned(), |value| shortened(&value));
        if let Some(Difference { key, then, now }) = difference::first(&then.scene, &self.scene) {
            return Err(CheckpointError::OtherScene { path, key, then: shown(then), now: shown(now) });
        }
        match self.start.iter().find(|array| !then.start.contains(array)) {
            Some((array, _)) => Err(CheckpointError::OtherParticles { path, array: array.clone() }),
            None => Ok(()),
        }
    }
}

/// A value, as far as it fits into a line.
fn shortened(value: &Value) -> String {
    const SHOWN: usize = 60;
    let text = value.to_string();
    let more = if text.chars().count() > SHOWN { "…" } else { "" };
    text.chars().take(SHOWN).chain(more.chars()).collect()
}

/// The JSON of a checkpoint.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    program: String,
    identity: Identity,
    /// What was asked on the command line, for whoever looks into the file.
    command: Value,
    clock: Reached,
    mark: Mark,
}

/// Checkpoints that cannot be written, or from which the run cannot be continued.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The results could not be put on the disk, or the checkpoint not be written.
    #[error("no checkpoint could be written at t = {time}{}", before.as_ref().map_or(String::new(), |path| {
        format!("; the one before, {}, is whole: --restart continues from it", path.display())
    }))]
    Write {
        /// Time of the state.
        time: f64,
        /// The checkpoint before.
        before: Option<PathBuf>,
        /// Why.
        source: OutputError,
    },
    /// A checkpoint of an earlier run could not be removed.
    #[error("cannot remove {}", path.display())]
    Remove {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// There is none.
    #[error(
        "{} has no checkpoint to continue from; the key output.checkpoint says how often one is written, and without --restart \
         the run begins anew", directory.display()
    )]
    Absent {
        /// The directory of the results.
        directory: PathBuf,
    },
    /// There are some, but none can be used.
    #[error("no checkpoint in {} can be used: {}", directory.display(), list(unusable))]
    NoneGood {
        /// The directory of the results.
        directory: PathBuf,
        /// All of them.
        unusable: Vec<Unusable>,
    },
    /// The scene has changed.
    #[error(
        "{} is of another scene: {key} was {then} and is {now}; only title, time.end and output.checkpoint may differ",
        path.display()
    )]
    OtherScene {
        /// The checkpoint.
        path: PathBuf,
        /// The key that differs.
        key: String,
        /// Its value in the checkpoint.
        then: String,
        /// Its value now.
        now: String,
    },
    /// The particles at the start are others.
    #[error(
        "{} is of a run that started with other particles: {array} differs; has a file of particles, triangles or pixels changed?", path.display()
    )]
    OtherParticles {
        /// The checkpoint.
        path: PathBuf,
        /// The quantity that differs.
        array: String,
    },
}

/// A checkpoint that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {reason}", path.display())]
pub struct Unusable {
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub reason: String,
}

fn list(unusable: &[Unusable]) -> String {
    unusable.iter().map(Unusable::to_string).collect::<Vec<_>>().join("; ")
}

/// Writes the checkpoints of a run.
#[derive(Debug)]
pub struct Checkpoints {
    directory: PathBuf,
    identity: Identity,
    command: Value,
    /// Time between checkpoints.
    every: f64,
    /// How many multiples of it had passed when the last one was due.
    passed: Option<f64>,
    /// The last one, and the steps taken then.
    last: Option<(usize, u64)>,
}

impl Checkpoints {
    /// Of the run `identity` into `directory`, whenever the time passes a multiple of `every` > 0. After a restart, the checkpoint
    /// it came from stays until the next two are written.
    pub fn new(directory: PathBuf, identity: Identity, command: Value, every: f64, from: Option<&Restored>) -> Self {
        Self { directory, identity, command, every, passed: None, last: from.map(|restored| restored.place) }
    }

    /// Writes one if the time has reached a multiple of `every` since the last, or if there is none yet.
    ///
    /// # Errors
    /// The system refuses; the last checkpoint is whole.
    pub fn write_if_due<const D: usize, L, A>(
        &mut self,
        simulation: &Simulation<D, L, A>,
        recorder: &mut Recorder<D>,
    ) -> Result<(), CheckpointError> {
        let passed = multiples(&simulation.clock, self.every);
        if self.passed.is_some_and(|before| passed <= before) {
            return Ok(());
        }
        self.passed = Some(passed);
        self.write(simulation, recorder)
    }

    /// Writes one, unless the last is of the same state.
    ///
    /// # Errors
    /// The system refuses; the last checkpoint is whole.
    pub fn write<const D: usize, L, A>(
        &mut self,
        simulation: &Simulation<D, L, A>,
        recorder: &mut Recorder<D>,
    ) -> Result<(), CheckpointError> {
        let steps = simulation.clock.steps();
        if self.last.is_some_and(|(_, last)| last == steps) {
            return Ok(());
        }
        let slot = self.last.map_or(0, |(last, _)| 1 - last);
        let path = self.directory.join(NAMES[slot]);
        // What a checkpoint says of the files must be on the disk before it is.
        let written = recorder.mark().and_then(|mark| {
            let content = Content {
                program: PROGRAM.to_owned(),
                identity: self.identity.clone(),
                command: self.command.clone(),
                clock: simulation.clock.reached(),
                mark,
            };
            write_atomically(&path, |file| container::write(file, &content, &state::inherited(simulation)))
        });
        let before = || self.last.map(|(last, _)| self.directory.join(NAMES[last]));
        written.map_err(|source| CheckpointError::Write { time: simulation.clock.time(), before: before(), source })?;
        self.last = Some((slot, steps));
        Ok(())
    }
}

/// A run that was put back.
#[derive(Debug)]
pub struct Restored {
    /// The checkpoint.
    pub path: PathBuf,
    /// Its number, and the steps taken then.
    place: (usize, u64),
    /// Where the files ended.
    pub mark: Mark,
    /// Snapshots written before it that are not there any more.
    pub missing: Vec<PathBuf>,
    /// Checkpoints that would have been newer, or cannot be read.
    pub unusable: Vec<Unusable>,
    /// The program that wrote it, if it was another version: the bits may differ then.
    pub other_program: Option<String>,
}

struct Candidate {
    slot: usize,
    path: PathBuf,
    content: Content,
    arrays: Vec<Array>,
}

/// Puts a simulation that is as at the start of the run `identity` into the state of the last good checkpoint in `directory`.
///
/// # Errors
/// There is no good one, or it is of another run; the simulation is then as before.
pub fn restore<const D: usize, L, A>(
    directory: &Path,
    identity: &Identity,
    simulation: &mut Simulation<D, L, A>,
) -> Result<Restored, CheckpointError> {
    let (mut candidates, mut unusable) = (Vec::new(), Vec::new());
    for (slot, name) in NAMES.iter().enumerate() {
        let path = directory.join(name);
        match read(&path) {
            Ok((content, arrays)) => candidates.push(Candidate { slot, path, content, arrays }),
            Err(Damage::Io(error)) if error.kind() == ErrorKind::NotFound => {}
            Err(damage) => unusable.push(Unusable { path, reason: damage.to_string() }),
        }
    }
    if candidates.is_empty() && unusable.is_empty() {
        return Err(CheckpointError::Absent { directory: directory.to_owned() });
    }
    candidates.sort_by_key(|candidate| std::cmp::Reverse(candidate.content.clock.steps()));
    for Candidate { slot, path, content, arrays } in candidates {
        let Content { program, identity: then, command: _, clock, mark } = content;
        identity.check(&then, &path)?;
        let files = mark.check(directory).map_err(|error| error.to_string());
        match files.and_then(|()| state::restore(simulation, clock, &arrays)) {
            Ok(()) => {
                let other_program = (program != PROGRAM).then_some(program);
                let missing = mark.missing(directory);
                return Ok(Restored { path, place: (slot, clock.steps()), mark, missing, unusable, other_program });
            }
            Err(reason) => unusable.push(Unusable { path, reason }),
        }
    }
    Err(CheckpointError::NoneGood { directory: directory.to_owned(), unusable })
}

fn read(path: &Path) -> Result<(Content, Vec<Array>), Damage> {
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    container::read(BufReader::new(file), length)
}

/// A run that was killed or interrupted, and could be continued.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unfinished {
    /// Its last checkpoint that can be read.
    pub path: PathBuf,
    /// Steps taken then.
    pub steps: u64,
}

/// The run in `directory` that was killed or interrupted, if there is one with a checkpoint that can be read.
pub fn unfinished(directory: &Path) -> Option<Unfinished> {
    // A run that was killed wrote no report.
    let over = outcome(directory).is_some_and(|outcome| outcome != "interrupted");
    let readable = NAMES.iter().filter_map(|name| {
        let path = directory.join(name);
        let (content, _) = read(&path).ok()?;
        Some(Unfinished { path, steps: content.clock.steps() })
    });
    readable.max_by_key(|one| one.steps).filter(|_| !over)
}

/// What the report of the run in `directory` says of its end.
fn outcome(directory: &Path) -> Option<Value> {
    let text = std::fs::read(directory.join("report.json")).ok()?;
    Some(serde_json::from_slice::<Value>(&text).ok()?["outcome"].take())
}

/// Removes the checkpoints of an earlier run: a new one in the same directory must not be continued from them.
///
/// # Errors
/// The system refuses.
pub fn forget(directory: &Path) -> Result<(), CheckpointError> {
    for path in NAMES.map(|name| directory.join(name)) {
        match std::fs::remove_file(&path) {
            Err(source) if !matches!(source.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                return Err(CheckpointError::Remove { path, source });
            }
            _ => {}
        }
    }
    Ok(())
}
