//! Pictures of a finished (or killed) run: energies, momentum, probes, reactions, iterations, Newton's convergence, the particles of
//! the last snapshot; and all of them with the numbers of the run and a player of its snapshots on one page, `report.html`, that
//! opens anywhere.
//!
//! Everything is drawn as SVG; the PNG beside it is made from the SVG with an embedded DejaVu Sans, so that no fonts need to be installed.

mod chart;
mod convergence;
mod histories;
mod html;
mod palette;
mod particles;
mod player;
pub mod png;
mod series;
mod table;

use super::files::write_atomically;
use super::vtu::Snapshot;
use super::{OutputError, vtu};
use crate::mechanics::schemes::Parameters;
use chart::{Line, Panel};
use player::Recording;
use serde::Deserialize;
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
        column: String,
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
    /// There is nothing to make a movie of.
    #[error("{} holds no snapshots: give the scene output.every", directory.display())]
    NoSnapshots {
        /// The directory.
        directory: PathBuf,
    },
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

/// The pictures that there may be.
const PICTURES: [&str; 7] = ["energies", "momentum", "iterations", "convergence", "probes", "reactions", "particles"];

/// Height of a picture, in SVG units.
const HEIGHT: u32 = 640;

/// The page.
const PAGE: &str = "report.html";

/// Whether a file of this name is one that [`plot_run`] writes.
pub(crate) fn is_picture(file: &str) -> bool {
    let picture = file.strip_suffix(".svg").or(file.strip_suffix(".png"));
    file == PAGE || picture.is_some_and(|name| PICTURES.contains(&name))
}

/// Draws what is in the directory of a run, as `.svg` and `.png`, into the same directory: `energies`, `momentum`, `iterations`,
/// `convergence` once there are steps, `probes` and `reactions` of a run that has them, and `particles` if there are snapshots; and
/// writes `report.html`, with all of them in it, and a player of the snapshots. Returns the files written.
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
/// `history.csv` is missing or damaged, or another table, the report or a snapshot is damaged; the system refuses.
pub fn plot_run(directory: &Path) -> Result<Vec<PathBuf>, PlotError> {
    let history = Columns::read(directory.join("history.csv"))?;
    let report = report(directory)?;
    let line = |column: &'static str, label: &str, color| -> Result<Line, PlotError> {
        Ok(Line { label: label.to_owned(), color, points: history.pairs("time", column)? })
    };
    let panel = |y: &str, lines, share| Panel { x: "time", x_labels: 10, y: y.to_owned(), lines, share };
    // Load steps have no momentum, and their work is done by loads that are there at once: the balance says nothing.
    let moves = moves(report.as_ref());
    let mut energies =
        vec![line("strain", "strain", palette::VERMILLION)?, line("external", "external work", palette::GREEN)?];
    if moves {
        energies.extend([line("total", "total", palette::BLACK)?, line("kinetic", "kinetic", palette::BLUE)?]);
    }
    let mut energies = vec![panel("energy", energies, 3)];
    if moves {
        let balance = line("balance", "total - initial - external work", palette::PURPLE)?;
        energies.push(panel("balance", vec![balance], 2));
    }
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

    let mut pictures = vec![("energies", chart::draw("energies", "Energy", HEIGHT, &energies)?)];
    if moves {
        pictures.push(("momentum", chart::draw("momentum", "Momentum", HEIGHT, &[panel("momentum", momentum, 1)])?));
    }
    for name in ["probes", "reactions"] {
        let path = directory.join(format!("{name}.csv"));
        if !path.is_file() {
            continue;
        }
        let (panels, there) = histories::panels(&Columns::read(path)?)?;
        let title = if panels.len() < there {
            format!("{name}: the first {} of {there}", panels.len())
        } else {
            name.to_owned()
        };
        pictures.push((name, chart::draw(name, &title, 60 + 210 * panels.len() as u32, &panels)?));
    }
    let iterations = [panel("Newton", newton, 1), panel("Krylov", krylov, 1)];
    pictures.push(("iterations", chart::draw("iterations", "Iterations per step", HEIGHT, &iterations)?));
    if let Some(panel) = convergence::panel(report.as_ref(), directory)? {
        let title = "Convergence of Newton's method";
        pictures.push(("convergence", chart::draw("convergence", title, HEIGHT, &[panel])?));
    }
    let snapshots = series::files(directory)?;
    let mut played = None;
    // Not on the page: the player shows it.
    let mut last = None;
    if let (Some(recording), Some(path)) = (Recording::read(&snapshots)?, snapshots.last()) {
        let snapshot = Snapshot::read(path)?;
        let view = series::view(snapshot.background.dimension, recording.motion());
        last = Some(("particles", particles::draw("particles", &snapshot, view, None)?));
        played = Some(recording.page(view));
    }
    let mut written = Vec::new();
    let mut keep = |file: &str, content: &[u8]| -> Result<(), PlotError> {
        let path = directory.join(file);
        write_atomically(&path, |file| file.write_all(content))?;
        written.push(path);
        Ok(())
    };
    for (name, svg) in pictures.iter().chain(&last) {
        keep(&format!("{name}.svg"), svg.as_bytes())?;
        keep(&format!("{name}.png"), &png::from_svg(name, svg)?)?;
    }
    keep(PAGE, html::page(report.as_ref(), played.as_ref(), &pictures).as_bytes())?;
    Ok(written)
}

/// Draws all snapshots of a run into the directory `frames`, which is made, as `frame_0000.png` and on: a movie for whatever
/// encoder there is. All have the same axes and the same colours. Returns the files written.
///
/// # Errors
/// There are no snapshots, or one is damaged; the system refuses.
pub fn plot_frames(directory: &Path, frames: &Path) -> Result<Vec<PathBuf>, PlotError> {
    let snapshots = series::files(directory)?;
    let Some(first) = snapshots.first() else {
        return Err(PlotError::NoSnapshots { directory: directory.to_owned() });
    };
    std::fs::create_dir_all(frames).map_err(OutputError::io("create", frames))?;
    let first = Snapshot::read(first)?;
    let (mut motion, mut range) = ([0.0_f64; 3], (f64::INFINITY, f64::NEG_INFINITY));
    for path in &snapshots {
        let snapshot = Snapshot::read(path)?;
        for (x, start) in snapshot.points.iter().zip(&first.points) {
            motion = std::array::from_fn(|axis| motion[axis].max((x[axis] - start[axis]).abs()));
        }
        let (low, high) = particles::extremes(&snapshot);
        range = (range.0.min(low), range.1.max(high));
    }
    let view = series::view(first.background.dimension, motion);
    let mut written = Vec::new();
    for (number, path) in snapshots.iter().enumerate() {
        let svg = particles::draw("a frame", &Snapshot::read(path)?, view, Some(range))?;
        let (png, path) = (png::from_svg("a frame", &svg)?, frames.join(format!("frame_{number:04}.png")));
        write_atomically(&path, |file| file.write_all(&png))?;
        written.push(path);
    }
    Ok(written)
}

/// Whether bodies had inertia, as far as the report says.
fn moves(report: Option<&Value>) -> bool {
    let scheme = report.map(|report| Parameters::deserialize(&report["settings"]["time"]["inertia"]));
    scheme.and_then(Result::ok).is_none_or(|scheme| scheme.has_inertia())
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

/// The drawing library's error, whatever its type.
fn draw_error(name: &'static str) -> impl Fn(&dyn std::error::Error) -> PlotError {
    move |error| PlotError::Draw { name, reason: error.to_string() }
}
