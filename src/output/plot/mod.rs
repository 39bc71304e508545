//! Pictures of a finished (or killed) run: energies, iterations, and the particles of the last snapshot.
//!
//! Everything is drawn as SVG; the PNG beside it is made from the SVG with an embedded DejaVu Sans, so that no fonts need to be installed.

mod chart;
mod palette;
mod particles;
pub mod png;
mod table;

use super::files::write_atomically;
use super::snapshots::SERIES;
use super::vtu::{ReadError, Snapshot};
use super::{OutputError, vtu};
use chart::{Line, Panel};
use std::io::Write;
use std::path::{Path, PathBuf};
use table::Columns;

/// Pictures could not be made.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// A file of the run cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A table lacks a column.
    #[error("{} has no column {column:?}", path.display())]
    Column {
        /// The table.
        path: PathBuf,
        /// The column.
        column: &'static str,
    },
    /// A cell of a table is no number.
    #[error("{}, line {line}: {cell:?} is not a number", path.display())]
    Cell {
        /// The table.
        path: PathBuf,
        /// The line, the header being 1.
        line: usize,
        /// What is there.
        cell: String,
    },
    /// A snapshot cannot be read.
    #[error(transparent)]
    Snapshot(#[from] vtu::ReadError),
    /// The drawing library refused.
    #[error("cannot draw {name}: {reason}")]
    Draw {
        /// The picture.
        name: &'static str,
        /// Its reason.
        reason: String,
    },
    /// A picture cannot be written.
    #[error(transparent)]
    Write(#[from] OutputError),
}

/// Draws what is in the directory of a run, as `.svg` and `.png`, into the same directory: `energies`, `iterations`, and
/// `particles` if there are snapshots. Returns the files written.
///
/// # Errors
/// `history.csv` is missing or damaged, or the last snapshot is; the system refuses.
pub fn plot_run(directory: &Path) -> Result<Vec<PathBuf>, PlotError> {
    let history = Columns::read(directory.join("history.csv"))?;
    let line = |column: &'static str, label: &'static str, color| -> Result<Line, PlotError> {
        Ok(Line { label, color, points: history.pairs("time", column)? })
    };
    let energies = vec![
        line("total", "total", palette::BLACK)?,
        line("kinetic", "kinetic", palette::BLUE)?,
        line("strain", "strain", palette::VERMILLION)?,
        line("external", "external work", palette::GREEN)?,
    ];
    let balance = vec![line("balance", "total - initial - external work", palette::PURPLE)?];
    let newton = vec![line("newton", "Newton", palette::BLUE)?];
    let krylov = vec![line("krylov", "Krylov", palette::VERMILLION)?];

    let mut written = Vec::new();
    let mut keep = |name: &'static str, svg: String| -> Result<(), PlotError> {
        let png = png::from_svg(name, &svg)?;
        for (extension, content) in [("svg", svg.as_bytes()), ("png", &png)] {
            let path = directory.join(name).with_extension(extension);
            write_atomically(&path, |file| file.write_all(content))?;
            written.push(path);
        }
        Ok(())
    };
    let panels = [Panel { y: "energy", lines: energies, share: 3 }, Panel { y: "balance", lines: balance, share: 2 }];
    keep("energies", chart::draw("energies", "Energy", &panels)?)?;
    let panels = [Panel { y: "Newton", lines: newton, share: 1 }, Panel { y: "Krylov", lines: krylov, share: 1 }];
    keep("iterations", chart::draw("iterations", "Iterations per step", &panels)?)?;
    if let Some(path) = last_snapshot(directory)? {
        keep("particles", particles::draw("particles", &Snapshot::read(&path)?)?)?;
    }
    Ok(written)
}

/// The file of the last snapshot in the series, if there is a series.
fn last_snapshot(directory: &Path) -> Result<Option<PathBuf>, PlotError> {
    let path = directory.join(SERIES);
    match std::fs::read_to_string(&path) {
        Ok(series) => {
            let file = series.rsplit_once("file=\"").and_then(|(_, rest)| rest.split('"').next());
            let damaged = || ReadError::Format { path: path.clone(), what: "the series lists no file".to_owned() };
            Ok(Some(directory.join(file.ok_or_else(damaged)?)))
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(source) => Err(PlotError::Read { path, source }),
    }
}

/// The drawing library's error, whatever its type.
fn draw_error(name: &'static str) -> impl Fn(&dyn std::error::Error) -> PlotError {
    move |error| PlotError::Draw { name, reason: error.to_string() }
}
