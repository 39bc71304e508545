//! The snapshots of a run, and the default plane of its pictures.

use super::error::PlotError;
use crate::output::snapshots::SERIES;
use crate::output::vtu::ReadError;
use std::path::{Path, PathBuf};

/// The existing files of the series, in order of time; empty if there is no series.
pub(super) fn files(directory: &Path) -> Result<Vec<PathBuf>, PlotError> {
    let path = directory.join(SERIES);
    match std::fs::read_to_string(&path) {
        Ok(series) => {
            let names = series.split("file=\"").skip(1).filter_map(|rest| rest.split('"').next());
            let files: Vec<_> = names.map(|name| directory.join(name)).collect();
            if files.is_empty() {
                return Err(damaged(&path, "the series lists no file"));
            }
            Ok(files.into_iter().filter(|file| file.is_file()).collect())
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(source) => Err(PlotError::Read { path, source }),
    }
}

/// The error for a damaged file.
pub(super) fn damaged(path: &Path, what: &str) -> PlotError {
    ReadError::Format { path: path.to_owned(), what: what.to_owned() }.into()
}

/// Horizontal and vertical axis of a picture. `motion` holds the largest displacements along the axes.
///
/// The direction of sight is the axis with the least motion: a ball that falls along y is not drawn on the x–z plane. If several axes have
/// the least motion, up to a tenth, the last of them is taken.
pub(super) fn view(dimension: u32, motion: [f64; 3]) -> [usize; 2] {
    if dimension < 3 {
        return [0, 1];
    }
    let least = 1.1 * motion.iter().fold(f64::INFINITY, |a, &b| a.min(b));
    match motion.map(|u| u <= least) {
        [_, _, true] => [0, 1],
        [_, true, _] => [0, 2],
        _ => [1, 2],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_is_seen_from_the_side() {
        // a ball that falls along y, one along z, a bar drawn out along x; a beam along y that bends towards z; nothing moves
        let motions = [[0.1, 2.0, 0.1000001], [0.1, 0.1, 2.0], [1.0, 0.3, 0.3], [0.0, 1.0, 3.0], [0.0; 3]];
        assert_eq!(motions.map(|motion| view(3, motion)), [[0, 1], [0, 2], [0, 1], [1, 2], [0, 1]]);
        assert_eq!(view(2, [0.0, 0.0, 0.0]), [0, 1]);
    }

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
