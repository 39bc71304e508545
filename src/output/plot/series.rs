//! The snapshots of a run.

use crate::output::OutputError;
use crate::output::files::read_if_there;
use crate::output::snapshots::SERIES;
use std::path::{Path, PathBuf};

/// The existing files of the series, in order of time; empty if there is no series.
pub(super) fn files(directory: &Path) -> Result<Vec<PathBuf>, OutputError> {
    let path = directory.join(SERIES);
    let Some(series) = read_if_there(&path)? else { return Ok(Vec::new()) };
    let series = String::from_utf8_lossy(&series);
    let names = series.split("file=\"").skip(1).filter_map(|rest| rest.split('"').next());
    let files: Vec<_> = names.map(|name| directory.join(name)).collect();
    if files.is_empty() {
        return Err(OutputError::content(&path, "lists no snapshots"));
    }
    Ok(files.into_iter().filter(|file| file.is_file()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_series_without_files_is_damaged_and_none_is_none() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        assert!(files(folder.path())?.is_empty());
        std::fs::write(folder.path().join(SERIES), "<VTKFile>")?;
        assert!(files(folder.path()).is_err());
        std::fs::write(folder.path().join(SERIES), r#"<DataSet file="a.vtu"/><DataSet part="0" file="b.vtu"/>"#)?;
        assert!(files(folder.path())?.is_empty());
        std::fs::write(folder.path().join("b.vtu"), "")?;
        assert_eq!(files(folder.path())?, [folder.path().join("b.vtu")]);
        Ok(())
    }
}
