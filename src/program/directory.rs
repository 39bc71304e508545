//! The directory of the results of a run.

use super::failure::Failure;
use crate::checkpoint;
use crate::output::{foreign, held};
use std::ffi::OsStr;
use std::fs::{File, TryLockError, create_dir_all};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The directory given by `--out`, or `out/` and the name of the scene.
pub(crate) fn of_results(out: Option<&Path>, scene: &Path) -> Result<PathBuf, Failure> {
    if let Some(out) = out {
        return Ok(out.to_owned());
    }
    let stem = scene.file_stem().unwrap_or_default();
    let letters = stem.to_string_lossy();
    // The stem `..` would give `out/..`, the working directory.
    if letters.chars().all(|letter| letter == '.') || letters == ".json" {
        let scene = scene.display();
        let what = "gives no name for the directory of results: rename the file, or give --out DIR";
        return Err(Failure::scene(format!("the name of the scene file {scene} {what}")));
    }
    Ok(Path::new("out").join(stem))
}

/// Locks the directory against other runs until the returned handle is dropped, and creates it first if `may_create`. A file system
/// without locks locks nothing.
pub(super) fn lock(directory: &Path, may_create: bool) -> Result<Option<File>, Failure> {
    if may_create {
        let is_file = directory.exists() && !directory.is_dir();
        let created = if is_file { Err(ErrorKind::NotADirectory.into()) } else { create_dir_all(directory) };
        created.map_err(Failure::system(format_args!("create the directory {}", directory.display())))?;
    }
    let Ok(handle) = File::open(directory) else { return Ok(None) };
    match handle.try_lock() {
        Err(TryLockError::WouldBlock) => Err(would_be_lost(directory, "a run that another program is just writing: ")),
        _ => Ok(Some(handle)),
    }
}

/// Prepares the directory for a new run. Results of an earlier run are lost only with `discard`.
pub(super) fn clear(directory: &Path, discard: bool) -> Result<(), Failure> {
    if let Some(path) = foreign(directory) {
        let what = format!("{}, which no run wrote and a run would replace: move it, or ", path.display());
        return Err(would_be_lost(directory, &what));
    }
    if let Some(found) = checkpoint::unfinished(directory).filter(|_| !discard) {
        let (steps, path) = (found.steps, found.path.display());
        let run = format!("a run that did not end, with a checkpoint after step {steps} ({path})");
        return Err(would_be_lost(
            directory,
            &format!("{run}: continue it by --restart, give it up by --discard, or "),
        ));
    }
    if let Some(found) = held(directory).filter(|_| !discard) {
        let (steps, time) = (found.steps, found.time);
        let ended = found.outcome.unwrap_or("did not end and left no checkpoint that can be read".to_owned());
        let run = format!("the results of a run that {ended}, {steps} steps until t = {time}");
        return Err(would_be_lost(directory, &format!("{run}: give them up by --discard, or ")));
    }
    checkpoint::forget(directory).map_err(Failure::run)
}

/// The directory holds something that the run would replace.
fn would_be_lost(directory: &Path, what: &str) -> Failure {
    let (place, unused) = (directory.display(), unused(directory));
    Failure::scene(format!("{place} holds {what}write elsewhere by --out {}", unused.display()))
}

/// The first numbered path beside `directory` that does not exist.
fn unused(directory: &Path) -> PathBuf {
    let numbered = |number: u32| {
        let mut name = directory.file_name().unwrap_or(OsStr::new("results")).to_owned();
        name.push(format!("-{number}"));
        directory.with_file_name(name)
    };
    (2..u32::MAX).map(numbered).find(|path| !path.exists()).unwrap_or_else(|| numbered(u32::MAX))
}
