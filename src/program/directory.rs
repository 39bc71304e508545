//! The directory of the results of a run.

use super::Failure;
use bfree::checkpoint::{self, Unfinished};
use bfree::output::{Held, foreign, held};
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
        return Err(Failure::scene(Nameless(scene.to_owned())));
    }
    Ok(Path::new("out").join(stem))
}

/// Locks the directory against other runs until the returned handle is dropped, and creates it first if `may_create`. A file system
/// without locks locks nothing.
pub fn lock(directory: &Path, may_create: bool) -> Result<Option<File>, Failure> {
    if may_create {
        let is_file = directory.exists() && !directory.is_dir();
        let created = if is_file { Err(ErrorKind::NotADirectory.into()) } else { create_dir_all(directory) };
        created.map_err(|source| Failure::run(Uncreated { directory: directory.to_owned(), source }))?;
    }
    let Ok(handle) = File::open(directory) else { return Ok(None) };
    match handle.try_lock() {
        Err(TryLockError::WouldBlock) => Err(would_be_lost(directory, Lost::Alive)),
        _ => Ok(Some(handle)),
    }
}

/// Prepares the directory for a new run. Results of an earlier run are lost only with `discard`.
pub fn clear(directory: &Path, discard: bool) -> Result<(), Failure> {
    if let Some(path) = foreign(directory) {
        return Err(would_be_lost(directory, Lost::Foreign(path)));
    }
    if !discard {
        if let Some(found) = checkpoint::unfinished(directory) {
            return Err(would_be_lost(directory, Lost::Unfinished(found)));
        }
        if let Some(found) = held(directory) {
            return Err(would_be_lost(directory, Lost::Results(found)));
        }
    }
    checkpoint::forget(directory).map_err(Failure::run)
}

fn would_be_lost(directory: &Path, why: Lost) -> Failure {
    Failure::scene(WouldBeLost { directory: directory.to_owned(), why })
}

/// The directory holds something that the run would replace.
#[derive(Debug, thiserror::Error)]
#[error("{} holds {why}write elsewhere by --out {}", directory.display(), unused(directory).display())]
struct WouldBeLost {
    directory: PathBuf,
    why: Lost,
}

#[derive(Debug, thiserror::Error)]
enum Lost {
    #[error(
        "a run that did not end, with a checkpoint after step {} ({}): continue it by --restart, give it up by --discard, or ",
        .0.steps, .0.path.display()
    )]
    Unfinished(Unfinished),
    #[error("the results of a run that {}, {} steps until t = {}: give them up by --discard, or ", ended(.0), .0.steps, .0.time)]
    Results(Held),
    #[error("a run that another program is just writing: ")]
    Alive,
    #[error("{}, which no run wrote and a run would replace: move it, or ", .0.display())]
    Foreign(PathBuf),
}

/// Outcome of an earlier run, in words.
fn ended(held: &Held) -> String {
    held.outcome.clone().unwrap_or_else(|| "did not end and left no checkpoint that can be read".to_owned())
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

/// The name of the scene file gives no name for the directory of results.
#[derive(Debug, thiserror::Error)]
#[error("the name of the scene file {} gives no name for the directory of results: rename the file, or give --out DIR", .0.display())]
struct Nameless(PathBuf);

/// The directory of the results cannot be created.
#[derive(Debug, thiserror::Error)]
#[error("cannot create the directory {}", directory.display())]
struct Uncreated {
    directory: PathBuf,
    source: std::io::Error,
}
