//! A moment of a run from which its files can be continued.

use super::OutputError;
use super::counts::{Counts, Seconds};
use super::files::Written;
use super::snapshots::SnapshotMark;
use super::touched::Touched;
use super::warnings::Watch;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Ends of the files of a run at one moment, and the counts until then. [`Recorder::resume`](super::Recorder::resume) needs nothing else to continue the files.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mark {
    /// Content of every growing file at the mark.
    pub(super) files: BTreeMap<String, Written>,
    pub(super) snapshots: Option<SnapshotMark>,
    pub(super) watch: Watch,
    pub(super) touched: Vec<Touched>,
    /// Pairs of bodies that touched so far.
    pub(super) touched_pairs: Vec<Touched>,
    pub(super) counts: Counts,
    pub(super) seconds: Seconds,
}

impl Mark {
    /// Checks that the growing files in `directory` still hold their content at the mark.
    ///
    /// # Errors
    /// A file is missing, shorter, or has other content.
    pub(crate) fn check(&self, directory: &Path) -> Result<(), OutputError> {
        self.files.iter().try_for_each(|(name, written)| written.check(&directory.join(name)))?;
        self.snapshots.map_or(Ok(()), |snapshots| snapshots.check(directory))
    }

    /// Snapshots that were written before the mark and are missing in `directory` now. A continued run does not need them.
    pub(crate) fn missing(&self, directory: &Path) -> Vec<PathBuf> {
        self.snapshots.map_or_else(Vec::new, |snapshots| snapshots.missing(directory))
    }
}

#[cfg(test)]
mod tests {

    use crate::output::{Audience, OutputSettings, Recorder, Reference};

    #[test]
    fn a_file_is_continued_at_the_mark_if_it_still_holds_what_it_did() -> Result<(), Box<dyn std::error::Error>> {
        let (folder, scene) = (tempfile::tempdir()?, crate::scene::read_file("scenes/rebound.json".as_ref(), &[])?);
        let (mut simulation, directory) = (scene.build::<2>("scenes".as_ref())?, folder.path().to_owned());
        let (fields, probes, audience) = (vec![], vec![], Audience::Nobody);
        let settings = OutputSettings { directory, fields, snapshot_every: None, probes, end_time: 1.0, audience };
        let reference = Reference::of(&simulation);
        let mut recorder = Recorder::start(settings.clone(), &simulation, reference.clone())?;
        let (mark, marked, history) = (recorder.mark()?, simulation.clone(), folder.path().join("history.csv"));
        let length = std::fs::metadata(&history)?.len();
        let step = simulation.advance()?;
        recorder.record(&simulation, &step)?;
        drop(recorder);
        // Rows written after the mark are cut off.
        mark.check(folder.path())?;
        assert!(std::fs::metadata(&history)?.len() > length);
        drop(Recorder::resume(settings, &marked, reference, &mark)?);
        assert_eq!(std::fs::metadata(&history)?.len(), length);
        // A file that has become shorter cannot be continued, and neither can one with a changed digit.
        std::fs::write(&history, "step\n")?;
        assert!(mark.check(folder.path()).is_err());
        let mut text = std::fs::read(&history)?;
        text.resize(length as usize, b'7');
        std::fs::write(&history, text)?;
        assert!(mark.check(folder.path()).unwrap_err().to_string().contains("not what it was"));
        Ok(())
    }
}
