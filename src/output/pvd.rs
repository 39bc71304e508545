//! The series of snapshots as ParaView's `.pvd`: a list of times and files.

use super::OutputError;
use super::files::{read_if_there, write_atomically};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The series of a run: particles, obstacles, surfaces that may touch, and outlines of bodies. The first is `particles.pvd` with the files
/// `particles_000000.vtu`, …
pub(crate) const SERIES: [&str; 4] = ["particles", "obstacles", "contacts", "bodies"];

/// The file of a series.
pub(crate) fn file(directory: &Path, series: &str) -> PathBuf {
    directory.join(format!("{series}.pvd"))
}

/// Text before and after the entries.
const HEAD: &str = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n<Collection>\n";
const TAIL: &str = "</Collection>\n</VTKFile>\n";

/// The entry of `file`, given relative to the directory of the series.
pub(crate) fn entry(time: f64, file: &str) -> String {
    format!("<DataSet timestep=\"{time:?}\" part=\"0\" file=\"{file}\"/>\n")
}

/// Writes the series, all or nothing. It is written anew with every snapshot, so the series of a killed run still opens.
pub(crate) fn write(path: &Path, entries: &str) -> Result<(), OutputError> {
    write_atomically(path, |file| write!(file, "{HEAD}{entries}{TAIL}"))
}

/// The first `count` entries of the series at `path`, one per line.
pub(crate) fn first_entries(path: &Path, count: usize) -> Result<String, OutputError> {
    let text = std::fs::read_to_string(path).map_err(OutputError::io("continue", path))?;
    let entries = text.strip_prefix(HEAD).and_then(|rest| rest.strip_suffix(TAIL)).unwrap_or_default();
    let kept: Vec<&str> = entries.split_inclusive('\n').take(count).collect();
    if kept.len() < count {
        return Err(OutputError::content(path, "ends before the place where it was to be continued"));
    }
    Ok(kept.concat())
}

/// The existing files of a series in `directory`, in order of time; empty if there is no series.
pub(crate) fn files(directory: &Path, series: &str) -> Result<Vec<PathBuf>, OutputError> {
    Ok(listed(directory, series)?.into_iter().filter(|file| file.is_file()).collect())
}

/// All files of a series, also those that are not there any more.
pub(super) fn listed(directory: &Path, series: &str) -> Result<Vec<PathBuf>, OutputError> {
    let path = file(directory, series);
    let Some(series) = read_if_there(&path)? else { return Ok(Vec::new()) };
    let series = String::from_utf8_lossy(&series);
    let names = series.split("file=\"").skip(1).filter_map(|rest| rest.split('"').next());
    let files: Vec<_> = names.map(|name| directory.join(name)).collect();
    if files.is_empty() {
        return Err(OutputError::content(&path, "lists no snapshots"));
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_is_whole_after_every_snapshot() -> Result<(), Box<dyn std::error::Error>> {
        let directory = tempfile::tempdir()?;
        let path = directory.path().join("particles.pvd");
        let mut entries = String::new();
        let times = [0.0, 0.1 + 0.2, 1e-7];
        for (k, time) in times.into_iter().enumerate() {
            entries += &entry(time, &format!("particles_{k}.vtu"));
            write(&path, &entries)?;
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
        assert_eq!(first_entries(&path, 2)? + &entry(times[2], "particles_2.vtu"), entries);
        assert!(matches!(first_entries(&path, 4), Err(OutputError::Content { .. })));
        Ok(())
    }

    #[test]
    fn a_series_without_files_is_damaged_and_none_is_none() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        assert!(files(folder.path(), SERIES[0])?.is_empty());
        let series = folder.path().join("particles.pvd");
        std::fs::write(&series, "<VTKFile>")?;
        assert!(files(folder.path(), SERIES[0]).is_err());
        std::fs::write(&series, r#"<DataSet file="a.vtu"/><DataSet part="0" file="b.vtu"/>"#)?;
        assert!(files(folder.path(), SERIES[0])?.is_empty());
        std::fs::write(folder.path().join("b.vtu"), "")?;
        assert_eq!(files(folder.path(), SERIES[0])?, [folder.path().join("b.vtu")]);
        Ok(())
    }
}
