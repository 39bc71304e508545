//! Pictures of a finished (or killed) run: energies, momentum, iterations, Newton's convergence, the particles of the last snapshot;
//! and all of them with the numbers of the run on one page, `report.html`, that opens anywhere.
//!
//! Everything is drawn as SVG; the PNG beside it is made from the SVG with an embedded DejaVu Sans, so that no fonts need to be installed.

mod chart;
mod convergence;
mod html;
mod palette;
mod particles;
pub mod png;
mod table;

use super::files::write_atomically;
use super::snapshots::SERIES;
use super::vtu::{ReadError, Snapshot};
use super::{OutputError, vtu};
use chart::{Line, Panel};
use serde_json::Value;
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
    /// The report is none.
    #[error("{} is no report written by bfree: {source}", path.display())]
    Report {
        /// The file.
        path: PathBuf,
        /// What JSON says.
        source: serde_json::Error,
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

/// Draws what is in the directory of a run, as `.svg` and `.png`, into the same directory: `energies`, `momentum`, `iterations`,
/// `convergence` once there are steps, and `particles` if there are snapshots; and writes `report.html`, with all of them in it.
/// Returns the files written.
///
/// ```
/// use bfree::output::{Audience, Outcome, OutputSettings, Recorder, Reference, plot::plot_run};
///
/// let (folder, scene) = (tempfile::tempdir()?, bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?);
/// let (mut simulation, directory) = (scene.build::<2>("scenes".as_ref())?, folder.path().to_owned());
/// let settings = OutputSettings {
///     directory, fields: vec![], snapshot_every: None, probes: vec![], end_time: 0.1, audience: Audience::Nobody,
/// };
/// let mut recorder = Recorder::start(settings, &simulation, Reference::of(&simulation))?;
/// let step = simulation.advance()?;
/// recorder.record(&simulation, &step)?;
/// recorder.finish(&simulation, &serde_json::Map::new(), Outcome::Finished)?;
/// // The page holds the pictures themselves: it opens wherever it is taken.
/// let written = plot_run(folder.path())?;
/// assert!(written.contains(&folder.path().join("energies.svg")));
/// let page = std::fs::read_to_string(folder.path().join("report.html"))?;
/// assert!(page.contains("<svg") && !page.contains("src=\"energies"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// `history.csv` is missing or damaged, or the report or the last snapshot is damaged; the system refuses.
pub fn plot_run(directory: &Path) -> Result<Vec<PathBuf>, PlotError> {
    let history = Columns::read(directory.join("history.csv"))?;
    let report = report(directory)?;
    let line = |column: &'static str, label: &str, color| -> Result<Line, PlotError> {
        Ok(Line { label: label.to_owned(), color, points: history.pairs("time", column)? })
    };
    let panel = |y, lines, share| Panel { x: "time", x_labels: 10, y, lines, share };
    let energies = vec![
        line("total", "total", palette::BLACK)?,
        line("kinetic", "kinetic", palette::BLUE)?,
        line("strain", "strain", palette::VERMILLION)?,
        line("external", "external work", palette::GREEN)?,
    ];
    let balance = vec![line("balance", "total - initial - external work", palette::PURPLE)?];
    let axes = [
        ("momentum_x", "x", palette::BLUE),
        ("momentum_y", "y", palette::VERMILLION),
        ("momentum_z", "z", palette::GREEN),
    ];
    let axes = axes.into_iter().filter(|(column, ..)| history.has(column));
    let momentum: Vec<Line> =
        axes.map(|(column, label, color)| line(column, label, color)).collect::<Result<_, _>>()?;
    // The first row is the state before the first step.
    let of_steps = |line: Line| Line { points: line.points.into_iter().skip(1).collect(), ..line };
    let newton = vec![of_steps(line("newton", "Newton", palette::BLUE)?)];
    let krylov = vec![of_steps(line("krylov", "Krylov", palette::VERMILLION)?)];

    let mut pictures = vec![
        ("energies", chart::draw("energies", "Energy", &[panel("energy", energies, 3), panel("balance", balance, 2)])?),
        ("momentum", chart::draw("momentum", "Momentum", &[panel("momentum", momentum, 1)])?),
        (
            "iterations",
            chart::draw(
                "iterations",
                "Iterations per step",
                &[panel("Newton", newton, 1), panel("Krylov", krylov, 1)],
            )?,
        ),
    ];
    if let Some(panel) = convergence::panel(report.as_ref(), directory)? {
        pictures.push(("convergence", chart::draw("convergence", "Convergence of Newton's method", &[panel])?));
    }
    if let Some(path) = last_snapshot(directory)? {
        pictures.push(("particles", particles::draw("particles", &Snapshot::read(&path)?)?));
    }
    let mut written = Vec::new();
    let mut keep = |file: &str, content: &[u8]| -> Result<(), PlotError> {
        let path = directory.join(file);
        write_atomically(&path, |file| file.write_all(content))?;
        written.push(path);
        Ok(())
    };
    for (name, svg) in &pictures {
        keep(&format!("{name}.svg"), svg.as_bytes())?;
        keep(&format!("{name}.png"), &png::from_svg(name, svg)?)?;
    }
    // What one looks at first stands first.
    let shift = usize::from(pictures.last().is_some_and(|(name, _)| *name == "particles"));
    pictures.rotate_right(shift);
    keep("report.html", html::page(report.as_ref(), &pictures).as_bytes())?;
    Ok(written)
}

/// The report of a run that has ended.
fn report(directory: &Path) -> Result<Option<Value>, PlotError> {
    let path = directory.join("report.json");
    match std::fs::read(&path) {
        Ok(bytes) => serde_json::from_slice(&bytes).map(Some).map_err(|source| PlotError::Report { path, source }),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(source) => Err(PlotError::Read { path, source }),
    }
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
