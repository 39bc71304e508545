//! `provenance.json` lies beside the results of a run. The file holds the scene, the program and the flags, so that `bfree reproduce` can run the
//! scene again.

use super::failure::Failure;
use crate::lanes;
use crate::output::files::{PROVENANCE, Written, write_atomically};
use crate::parallel::MOST_THREADS;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::env::{consts, current_exe};
use std::fs::File;
use std::io::{self, Write as _};
use std::path::Path;

/// The command line of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Command {
    pub scene: String,
    pub set: Vec<String>,
    pub allow_library: Vec<String>,
    pub out: String,
    pub until: Option<f64>,
    pub steps: Option<u64>,
    pub threads: u64,
    /// The number of processes. Results do not depend on it, so a run is reproduced by one process.
    #[serde(default = "one")]
    pub processes: usize,
    #[serde(default)]
    pub gpu: bool,
    pub check_tangent: Option<u64>,
}

fn one() -> usize {
    1
}

/// The program and the machine. Another one may give other bits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Maker {
    pub program: String,
    /// Length and checksum of the program's file, which tell builds of one version apart.
    pub build: Option<Written>,
    pub machine: String,
}

impl Maker {
    /// This program, on this machine.
    pub(super) fn here() -> Self {
        Self {
            program: concat!("bfree ", env!("CARGO_PKG_VERSION")).to_owned(),
            build: current_exe().and_then(|path| of_file(&path)).ok(),
            machine: format!("{} {}, {}", consts::ARCH, consts::OS, lanes::instructions()),
        }
    }
}

/// Length and checksum of a file.
pub(super) fn of_file(path: &Path) -> io::Result<Written> {
    // Reading a pipe may block for ever.
    if !path.is_file() {
        return Err(io::ErrorKind::InvalidInput.into());
    }
    Written::of(File::open(path)?)
}

/// The content of `provenance.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Provenance {
    pub made_by: Maker,
    /// The program that wrote the checkpoint from which the run was continued, if it was another version.
    pub continued_from: Option<String>,
    pub command: Command,
    /// The names of the bodies, in the order of the field `body`.
    pub bodies: Vec<String>,
    /// The folder of the scene, in which the files that it names are looked for.
    pub folder: String,
    /// Length and checksum of every file that the scene or the command line names.
    pub files: BTreeMap<String, Written>,
    /// Length and checksum of the scene.
    pub checksum: Written,
    /// The scene as it was read, before `--set`.
    pub scene: String,
}

impl Provenance {
    /// The provenance of a run by this program. `settings` is the complete scene.
    pub(super) fn new(command: Command, folder: &Path, scene: &str, settings: &Value) -> io::Result<Self> {
        let (mut texts, mut rest) = (command.allow_library.clone(), vec![settings]);
        while let Some(value) = rest.pop() {
            match value {
                Value::String(text) => texts.push(text.clone()),
                Value::Array(list) => rest.extend(list),
                Value::Object(object) => rest.extend(object.values()),
                Value::Null | Value::Bool(_) | Value::Number(_) => {}
            }
        }
        let bodies = settings["bodies"].as_array();
        let file = |text: String| of_file(&folder.join(&text)).ok().map(|written| (text, written));
        Ok(Self {
            made_by: Maker::here(),
            continued_from: None,
            bodies: bodies.into_iter().flatten().filter_map(|body| body["name"].as_str().map(str::to_owned)).collect(),
            // A scene that is named without its folder has the folder "".
            folder: std::path::absolute(Path::new(".").join(folder).components().as_path())?.display().to_string(),
            files: texts.into_iter().filter_map(file).collect(),
            checksum: Written::of(scene.as_bytes())?,
            scene: scene.to_owned(),
            command,
        })
    }

    /// Writes the file in the directory of the results, all or nothing.
    pub(super) fn write(&self, directory: &Path) -> Result<(), Failure> {
        let text = serde_json::to_string_pretty(self).map_err(Failure::run)?;
        write_atomically(&directory.join(PROVENANCE), |file| writeln!(file, "{text}")).map_err(Failure::run)
    }

    /// Reads the file in the directory of the results.
    pub(super) fn read(directory: &Path) -> Result<Self, Failure> {
        let path = directory.join(PROVENANCE);
        let text = std::fs::read_to_string(&path).map_err(|error| {
            let what = "bfree run writes it beside the results; results of the library have none";
            Failure::scene(format!("cannot read {}: {error}; {what}", path.display()))
        })?;
        let wrong = |error| Failure::scene(format!("{} is no provenance of bfree: {error}", path.display()));
        let read: Self = serde_json::from_str(&text).map_err(wrong)?;
        let threads = read.command.threads;
        if !(1..=MOST_THREADS).contains(&threads) {
            let allowed = format!("must be from 1 to {MOST_THREADS}");
            return Err(Failure::scene(format!("{}: command.threads = {threads}; {allowed}", path.display())));
        }
        if Written::of(read.scene.as_bytes()).ok() != Some(read.checksum) {
            return Err(Failure::scene(format!(
                "{}: the scene differs from its checksum, so it is not the one that was run",
                path.display()
            )));
        }
        Ok(read)
    }
}
