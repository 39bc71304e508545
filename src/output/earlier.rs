//! What an earlier run has left in the directory of this one, and what somebody else has.

use super::files::TEMPORARY;
use super::plot::is_picture;
use super::snapshots::{SERIES, SnapshotMark};
use super::{Mark, OutputError};
use serde_json::Value;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The files of a run, beside its snapshots and its pictures.
const FILES: [&str; 6] = ["history.csv", "reactions.csv", "probes.csv", "newton.jsonl", "report.json", SERIES];

/// Whether a run may write a file of this name.
fn is_output(name: &str) -> bool {
    FILES.contains(&name) || SnapshotMark::default().precedes(name) || is_picture(name)
}

/// A file that a run would replace, in a directory where no run of this program has been: none has left its history or its report.
///
/// ```
/// use bfree::output::foreign;
///
/// let folder = tempfile::tempdir()?;
/// let (history, picture) = (folder.path().join("history.csv"), folder.path().join("energies.png"));
/// std::fs::write(folder.path().join("notes.txt"), "mine")?;
/// assert_eq!(foreign(folder.path()), None);
/// std::fs::write(&picture, "mine")?;
/// assert_eq!(foreign(folder.path()), Some(picture));
/// // What a run has left beside its history may go with it.
/// std::fs::write(&history, "step,time,dt,kinetic\n")?;
/// assert_eq!(foreign(folder.path()), None);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn foreign(directory: &Path) -> Option<PathBuf> {
    let mut start = Vec::new();
    let begin = File::open(directory.join("history.csv")).and_then(|file| file.take(10).read_to_end(&mut start));
    // Of a run that died at once, the history has no line.
    let report = std::fs::read(directory.join("report.json")).unwrap_or_default();
    let report: Value = serde_json::from_slice(&report).unwrap_or_default();
    let of_ours = report["program"].as_str().is_some_and(|program| program.starts_with("bfree "));
    if of_ours || (begin.is_ok() && b"step,time,".starts_with(&start)) {
        return None;
    }
    let mut names: Vec<_> =
        std::fs::read_dir(directory).ok()?.filter_map(|entry| Some(entry.ok()?.file_name())).collect();
    names.sort();
    names.iter().find(|name| name.to_str().is_some_and(is_output)).map(|name| directory.join(name))
}

/// Removes what an earlier run left under the names this one may use and will not continue from `mark`, so that no file of it is
/// taken for a new one.
pub(super) fn remove_later_files(directory: &Path, mark: Option<&Mark>) -> Result<(), OutputError> {
    let snapshots = mark.and_then(|mark| mark.snapshots).unwrap_or_default();
    let continued = |name: &str| match name {
        SERIES => mark.is_some(),
        _ => mark.is_some_and(|mark| mark.files.contains_key(name)),
    };
    let entries = std::fs::read_dir(directory).map_err(OutputError::io("read", directory))?;
    for entry in entries {
        let entry = entry.map_err(OutputError::io("read", directory))?;
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        let file = FILES.contains(&name) && !continued(name);
        if file || is_picture(name) || snapshots.precedes(name) || name.starts_with(TEMPORARY) {
            std::fs::remove_file(entry.path()).map_err(OutputError::io("remove", &entry.path()))?;
        }
    }
    Ok(())
}
