//! The series of snapshots as ParaView's `.pvd`: a list of times and files.

use super::OutputError;
use super::files::write_atomically;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Text before and after the entries.
const HEAD: &str = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n<Collection>\n";
const TAIL: &str = "</Collection>\n</VTKFile>\n";

/// A growing series. The file is whole after every snapshot, so the series of a killed run still opens.
#[derive(Clone, Debug)]
pub(crate) struct Series {
    path: PathBuf,
    entries: String,
}

impl Series {
    /// An empty series; the file appears with its first snapshot.
    pub fn new(path: PathBuf) -> Self {
        Self { path, entries: String::new() }
    }

    /// Continues the series at `path` after its first `count` entries. Later entries are dropped.
    ///
    /// # Errors
    /// The series has fewer entries, or the operating system refuses.
    pub fn resume(path: PathBuf, count: usize) -> Result<Self, OutputError> {
        let series = Self { entries: first_entries(&path, count)?, path };
        series.write()?;
        Ok(series)
    }

    /// Adds `file`, given relative to the directory of the series, and rewrites the list, all or nothing.
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn push(&mut self, time: f64, file: &str) -> Result<(), OutputError> {
        // Writing to a string cannot fail.
        let _ = writeln!(self.entries, r#"<DataSet timestep="{time:?}" part="0" file="{file}"/>"#);
        self.write()
    }

    fn write(&self) -> Result<(), OutputError> {
        write_atomically(&self.path, |file| write!(file, "{HEAD}{}{TAIL}", self.entries))
    }
}

/// The first `count` entries of the series at `path`, one per line.
pub(crate) fn first_entries(path: &Path, count: usize) -> Result<String, OutputError> {
    let text = std::fs::read_to_string(path).map_err(OutputError::io("continue", path))?;
    let entries = text.strip_prefix(HEAD).and_then(|rest| rest.strip_suffix(TAIL)).unwrap_or_default();
    let kept: Vec<&str> = entries.split_inclusive('\n').take(count).collect();
    if kept.len() == count { Ok(kept.concat()) } else { Err(OutputError::Shorter { path: path.to_owned() }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_is_whole_after_every_snapshot() -> Result<(), Box<dyn std::error::Error>> {
        let directory = tempfile::tempdir()?;
        let path = directory.path().join("particles.pvd");
        let mut series = Series::new(path.clone());
        let times = [0.0, 0.1 + 0.2, 1e-7];
        for (k, time) in times.into_iter().enumerate() {
            series.push(time, &format!("particles_{k}.vtu"))?;
            let text = std::fs::read_to_string(&path)?;
            assert!(text.ends_with("</Collection>\n</VTKFile>\n"));
            let read: Vec<f64> = text
                .split("timestep=\"")
                .skip(1)
                .map(|rest| rest.split('"').next().unwrap_or_default().parse())
                .collect::<Result<_, _>>()?;
            assert_eq!(read, times[..=k]);
        }
        assert_eq!(std::fs::read_dir(directory.path())?.count(), 1, "no temporary file stays");
        let whole = std::fs::read_to_string(&path)?;
        let mut shorter = Series::resume(path.clone(), 2)?;
        assert_eq!(std::fs::read_to_string(&path)?.matches("<DataSet").count(), 2);
        shorter.push(times[2], "particles_2.vtu")?;
        assert_eq!(std::fs::read_to_string(&path)?, whole);
        assert!(matches!(Series::resume(path, 4), Err(OutputError::Shorter { .. })));
        Ok(())
    }
}
