//! Checkpoints, from which a killed run continues with bitwise identical results.
//!
//! Two files in the directory of the results are written in turn, so the previous checkpoint survives while a new one is written. Each file
//! is written under a temporary name, synced and renamed. A checkpoint holds the state at tₙ (`state.rs`), the scene, and the ends of the
//! result files ([`Mark`]). [`restore`] puts the simulation back. [`Recorder::resume`] cuts the files off at the mark. A new state array is
//! added in `state.rs`.
//!
//! ```
//! use bfree::checkpoint::{Checkpoints, Identity, restore, unfinished};
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
//! // The run continues from t = 0.1, with bitwise identical results.
//! let mut continued = start.clone();
//! restore(&directory, &identity, &mut continued)?;
//! assert_eq!(continued.clock.time(), 0.1);
//! continued.advance()?;
//! assert_eq!((&continued.particles, continued.clock), (&simulation.particles, simulation.clock));
//! // A checkpoint can be written at any time.
//! checkpoints.write(&simulation, &mut recorder)?;
//! let mut last = start.clone();
//! restore(&directory, &identity, &mut last)?;
//! assert_eq!(last.clock, simulation.clock);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod container;
mod difference;
mod state;

use crate::clock::Clock;
use crate::clock::Reached;
use crate::output::files::write_atomically;
use crate::output::snapshots::multiples;
use crate::output::{Mark, OutputError, Recorder};
use crate::particles::Particles;
use crate::simulation::Simulation;
use container::{Arrays, Damage};
use difference::Difference;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The two files, written in turn.
const NAMES: [&str; 2] = ["checkpoint_0.bfree", "checkpoint_1.bfree"];

/// Name and version of this program.
const PROGRAM: &str = concat!("bfree ", env!("CARGO_PKG_VERSION"));

/// The scene and the initial particles, which identify a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// The scene with all defaults.
    scene: Value,
    /// Checksums of the particles at the start, and of the files of curves.
    start: Vec<(String, u32)>,
}

impl Identity {
    /// Identity of the run of `scene` that starts with `particles`.
    pub fn new<const D: usize>(scene: Value, particles: &Particles<D>) -> Self {
        Self { scene, start: state::fingerprint(particles) }
    }

    /// Adds the checksums of other files that the scene names, by key.
    pub(crate) fn with_files(mut self, files: impl IntoIterator<Item = (String, u32)>) -> Self {
        self.start.extend(files);
        self
    }

    /// Checks that a checkpoint with the identity `then` belongs to this run.
    fn check(&self, then: &Self, path: &Path) -> Result<(), CheckpointError> {
        let path = path.to_owned();
        let shown = |value: Option<Value>| value.map_or_else(|| "nothing".to_owned(), |value| shortened(&value));
        if let Some(Difference { key, then, now }) = difference::first(&then.scene, &self.scene) {
            return Err(CheckpointError::OtherScene { path, key, then: shown(then), now: shown(now) });
        }
        match self.start.iter().find(|array| !then.start.contains(array)) {
            Some((array, _)) => Err(CheckpointError::OtherStart { path, array: array.clone() }),
            None => Ok(()),
        }
    }
}

/// The text of a value, cut to the length of a line.
fn shortened(value: &Value) -> String {
    const SHOWN: usize = 60;
    let text = value.to_string();
    let more = if text.chars().count() > SHOWN { "…" } else { "" };
    text.chars().take(SHOWN).chain(more.chars()).collect()
}

/// The JSON content of a checkpoint.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    program: String,
    identity: Identity,
    /// The command line, for a reader of the file. [`restore`] ignores it.
    command: Value,
    clock: Reached,
    mark: Mark,
}

/// A checkpoint cannot be written, removed or continued from.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The results could not be synced to disk, or the checkpoint could not be written.
    #[error("no checkpoint could be written at t = {time}{}", before.as_ref().map_or(String::new(), |path| {
        format!("; the one before, {}, is whole: --restart continues from it", path.display())
    }))]
    Write {
        /// Time of the state.
        time: f64,
        /// The previous checkpoint.
        before: Option<PathBuf>,
        /// The reason.
        source: OutputError,
    },
    /// A checkpoint of an earlier run could not be removed.
    #[error("cannot remove {}", path.display())]
    Remove {
        /// The file.
        path: PathBuf,
        /// Reason given by the operating system.
        source: std::io::Error,
    },
    /// The directory has no checkpoint.
    #[error(
        "{} has no checkpoint to continue from; the key output.checkpoint says how often one is written, and without --restart \
         the run begins anew", directory.display()
    )]
    Absent {
        /// The directory of the results.
        directory: PathBuf,
    },
    /// The directory has checkpoints, but none can be used.
    #[error("no checkpoint in {} can be used: {}", directory.display(), unusable.join("; "))]
    NoneGood {
        /// The directory of the results.
        directory: PathBuf,
        /// All checkpoints, with reasons.
        unusable: Vec<String>,
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
    /// The particles at the start have changed.
    #[error(
        "{} is of a run that started otherwise: {array} differs; has a file of particles, triangles, pixels or a curve changed?", path.display()
    )]
    OtherStart {
        /// The checkpoint.
        path: PathBuf,
        /// The quantity of the particles, or the key of the curve, that differs.
        array: String,
    },
}

/// Writes the checkpoints of a run.
#[derive(Debug)]
pub struct Checkpoints {
    directory: PathBuf,
    identity: Identity,
    command: Value,
    /// Time between checkpoints.
    every: f64,
    /// Multiples of `every` that had passed when the last checkpoint was due.
    passed: Option<f64>,
    /// File number of the last checkpoint, and the steps taken until then.
    last: Option<(usize, u64)>,
}

impl Checkpoints {
    /// Checkpoints of the run `identity` in `directory`, due whenever the time passes a multiple of `every` > 0. After a restart, the
    /// second new checkpoint replaces the checkpoint `from`.
    pub fn new(directory: PathBuf, identity: Identity, command: Value, every: f64, from: Option<&Restored>) -> Self {
        Self { directory, identity, command, every, passed: None, last: from.map(|restored| restored.place) }
    }

    /// Writes a checkpoint if the time has reached a multiple of `every` since the last checkpoint, or if there is none yet.
    ///
    /// # Errors
    /// The operating system refuses. The last checkpoint is still whole.
    pub fn write_if_due<const D: usize, L, A>(
        &mut self,
        simulation: &Simulation<D, L, A>,
        recorder: &mut Recorder<D>,
    ) -> Result<(), CheckpointError> {
        if !self.are_due(&simulation.clock) {
            return Ok(());
        }
        self.passed = Some(multiples(&simulation.clock, self.every));
        self.write(simulation, recorder)
    }

    /// Whether the time has reached a multiple of the time between checkpoints since the last one that was due.
    pub(crate) fn are_due(&self, clock: &Clock) -> bool {
        self.passed.is_none_or(|before| multiples(clock, self.every) > before)
    }

    /// Writes a checkpoint, unless the last checkpoint holds the same state.
    ///
    /// # Errors
    /// The operating system refuses. The last checkpoint is still whole.
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
        mutant!("checkpoint: every checkpoint overwrites the last one": slot = 0);
        let path = self.directory.join(NAMES[slot]);
        // The result files must be on disk before the checkpoint that refers to them.
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

/// A run restored from a checkpoint.
#[derive(Debug)]
pub struct Restored {
    /// The checkpoint.
    pub path: PathBuf,
    /// File number of the checkpoint, and the steps taken until then.
    place: (usize, u64),
    /// Ends of the result files.
    pub mark: Mark,
    /// Snapshots that were written before the checkpoint and are missing now.
    pub missing: Vec<PathBuf>,
    /// Newer checkpoints and unreadable checkpoints, which could not be used, with reasons.
    pub unusable: Vec<String>,
    /// The program that wrote the checkpoint, if it was another version. The results may then differ in their bits.
    pub other_program: Option<String>,
}

/// Restores the last good checkpoint in `directory`. Before, the simulation must be in its state at the start of the run `identity`.
///
/// # Errors
/// There is no good checkpoint, or it belongs to another run. The simulation is then unchanged.
pub fn restore<const D: usize, L, A>(
    directory: &Path,
    identity: &Identity,
    simulation: &mut Simulation<D, L, A>,
) -> Result<Restored, CheckpointError> {
    let (mut candidates, mut unusable) = (Vec::new(), Vec::new());
    for (slot, name) in NAMES.iter().enumerate() {
        let path = directory.join(name);
        match read(&path) {
            Ok((content, arrays)) => candidates.push((slot, path, content, arrays)),
            Err(Damage::Io(error)) if error.kind() == ErrorKind::NotFound => {}
            Err(damage) => unusable.push(format!("{}: {damage}", path.display())),
        }
    }
    if candidates.is_empty() && unusable.is_empty() {
        return Err(CheckpointError::Absent { directory: directory.to_owned() });
    }
    candidates.sort_by_key(|(_, _, content, _)| std::cmp::Reverse(content.clock.steps()));
    for (slot, path, content, arrays) in candidates {
        let Content { program, identity: then, command: _, clock, mark } = content;
        identity.check(&then, &path)?;
        let files = mark.check(directory).map_err(|error| error.to_string());
        match files.and_then(|()| state::restore(simulation, clock, &arrays)) {
            Ok(()) => {
                let other_program = (program != PROGRAM).then_some(program);
                let missing = mark.missing(directory);
                return Ok(Restored { path, place: (slot, clock.steps()), mark, missing, unusable, other_program });
            }
            Err(reason) => unusable.push(format!("{}: {reason}", path.display())),
        }
    }
    Err(CheckpointError::NoneGood { directory: directory.to_owned(), unusable })
}

fn read(path: &Path) -> Result<(Content, Arrays), Damage> {
    container::read(&std::fs::read(path)?)
}

/// A killed or interrupted run that can be continued.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unfinished {
    /// The last readable checkpoint.
    pub path: PathBuf,
    /// Steps taken up to the checkpoint.
    pub steps: u64,
}

/// The killed or interrupted run in `directory`, if it has a readable checkpoint.
pub fn unfinished(directory: &Path) -> Option<Unfinished> {
    // A killed run wrote no report.
    let report = std::fs::read(directory.join("report.json")).ok();
    let report = report.and_then(|text| serde_json::from_slice::<Value>(&text).ok());
    let over = report.is_some_and(|report| report["outcome"] != "interrupted");
    let readable = NAMES.iter().filter_map(|name| {
        let path = directory.join(name);
        let (content, _) = read(&path).ok()?;
        Some(Unfinished { path, steps: content.clock.steps() })
    });
    readable.max_by_key(|one| one.steps).filter(|_| !over)
}

/// Whether a file of this name is a checkpoint.
pub(crate) fn is_checkpoint(name: &str) -> bool {
    NAMES.contains(&name)
}

/// Removes the checkpoints of an earlier run, so that a new run in the directory is not continued from them.
///
/// # Errors
/// The operating system refuses.
pub(crate) fn forget(directory: &Path) -> Result<(), CheckpointError> {
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
