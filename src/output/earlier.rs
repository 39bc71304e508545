//! Files of an earlier run, or of somebody else, in the directory of a run.

use super::OutputError;
use super::files::{PROVENANCE, TEMPORARY};
use super::mark::Mark;
use super::plot::is_picture;
use super::pvd::SERIES;
use super::snapshots::SnapshotMark;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The table with a row for every step.
const HISTORY: &str = "history.csv";

/// The start of that table.
const START: &[u8] = b"step,time,";

/// The files of a run, beside its snapshots and its pictures.
const FILES: [&str; 7] =
    [HISTORY, "reactions.csv", "obstacles.csv", "contacts.csv", "probes.csv", "newton.jsonl", "report.json"];

/// Whether a file of this name is a series of snapshots.
fn is_series(name: &str) -> bool {
    name.strip_suffix(".pvd").is_some_and(|series| SERIES.contains(&series))
}

/// The part that a file has in the directory of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// The run writes the file step by step, or at its end.
    Result,
    /// A picture, a page or a packed file, which a command makes from the results.
    Drawn,
    /// The file names the scene, the program and the flags of the run.
    Provenance,
}

/// The part of a file of this name; `None` if no run writes such a file.
pub(crate) fn role(name: &str) -> Option<Role> {
    let is_packed = name.strip_suffix(".vtkhdf").is_some_and(|series| SERIES.contains(&series));
    match name {
        PROVENANCE => Some(Role::Provenance),
        _ if is_picture(name) || is_packed => Some(Role::Drawn),
        _ if FILES.contains(&name) || is_series(name) || SnapshotMark::default().precedes(name) => Some(Role::Result),
        _ => None,
    }
}

/// A file that a run would replace, in a directory without a history or report of this program.
pub(crate) fn foreign(directory: &Path) -> Option<PathBuf> {
    let history = std::fs::read(directory.join(HISTORY)).ok();
    // The history of a run that died at once has no line.
    let is_history = |text: &[u8]| text.starts_with(START) || START.starts_with(text);
    if report(directory).is_some() || history.is_some_and(|text| is_history(&text)) {
        return None;
    }
    let names = std::fs::read_dir(directory).ok()?.filter_map(|entry| Some(entry.ok()?.file_name()));
    names.filter(|name| name.to_str().is_some_and(|name| role(name).is_some())).min().map(|name| directory.join(name))
}

/// The report in `directory`, if this program wrote it.
fn report(directory: &Path) -> Option<Value> {
    let report: Value = serde_json::from_slice(&std::fs::read(directory.join("report.json")).ok()?).ok()?;
    report["program"].as_str().is_some_and(|program| program.starts_with("bfree ")).then_some(report)
}

/// How the run in `directory` ended, see [`Held::outcome`].
pub(crate) fn outcome(directory: &Path) -> Option<String> {
    report(directory)?["outcome"].as_str().map(str::to_owned)
}

/// The results of an earlier run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Held {
    /// Steps taken.
    pub steps: u64,
    /// Time reached.
    pub time: f64,
    /// Outcome: `finished`, `interrupted` or `failed`. `None` if the run was killed, or its disk was full.
    pub outcome: Option<String>,
}

/// The results in a directory that a new run there would replace. A run without a step has results only if it finished.
pub(crate) fn held(directory: &Path) -> Option<Held> {
    let (report, outcome) = (report(directory).unwrap_or_default(), outcome(directory));
    let reported = || Some((report["counts"]["steps"].as_u64()?, report["time"].as_f64()?));
    let (steps, time) = last_row(&directory.join(HISTORY)).or_else(reported)?;
    let finished = outcome.as_deref() == Some("finished");
    (steps > 0 || finished).then_some(Held { steps, time, outcome })
}

/// Step and time in the last whole row of a history.
fn last_row(history: &Path) -> Option<(u64, f64)> {
    let bytes = std::fs::read(history).ok()?;
    let text = String::from_utf8_lossy(&bytes);
    let (whole, _) = text.rsplit_once('\n')?;
    let mut cells = whole.lines().next_back()?.split(',');
    Some((cells.next()?.parse().ok()?, cells.next()?.parse().ok()?))
}

/// Removes files of an earlier run that this run may write and does not continue from `mark`. Otherwise an old file could be taken for a
/// new file.
pub(super) fn remove_later_files(directory: &Path, mark: Option<&Mark>) -> Result<(), OutputError> {
    let snapshots = mark.and_then(|mark| mark.snapshots).unwrap_or_default();
    let continued = |name: &str| mark.is_some_and(|mark| is_series(name) || mark.files.contains_key(name));
    let entries = std::fs::read_dir(directory).map_err(OutputError::io("read", directory))?;
    for entry in entries {
        let entry = entry.map_err(OutputError::io("read", directory))?;
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        let file = (FILES.contains(&name) || is_series(name)) && !continued(name);
        // The provenance of a run that goes on stays until it is replaced.
        let made = role(name) == Some(Role::Drawn) || role(name) == Some(Role::Provenance) && mark.is_none();
        let is_old = file || made || snapshots.precedes(name);
        if is_old || name.starts_with(TEMPORARY) {
            std::fs::remove_file(entry.path()).map_err(OutputError::io("remove", &entry.path()))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_foreign_unless_it_lies_beside_the_history_of_a_run() -> std::io::Result<()> {
        let folder = tempfile::tempdir()?;
        let (history, picture) = (folder.path().join("history.csv"), folder.path().join("energies.png"));
        std::fs::write(folder.path().join("notes.txt"), "mine")?;
        assert_eq!(foreign(folder.path()), None);
        std::fs::write(&picture, "mine")?;
        assert_eq!(foreign(folder.path()), Some(picture));
        std::fs::write(&history, "step,time,dt,kinetic\n")?;
        assert_eq!(foreign(folder.path()), None);
        Ok(())
    }

    #[test]
    fn the_last_whole_row_of_a_killed_run_says_how_far_it_came() -> std::io::Result<()> {
        let folder = tempfile::tempdir()?;
        let history = folder.path().join("history.csv");
        std::fs::write(&history, "step,time,dt\n0,0,0\n")?;
        assert_eq!(held(folder.path()), None);
        std::fs::write(&history, "step,time,dt\n0,0,0\n1,0.5,0.5\n2,1")?;
        assert_eq!(held(folder.path()), Some(Held { steps: 1, time: 0.5, outcome: None }));
        Ok(())
    }
}
