//! Pictures of a finished (or killed) run: energies, momentum, probes, reactions, forces of contact, iterations, Newton's convergence, and
//! the particles of the last snapshot. The page `report.html` shows the charts, the numbers of the run and a player of its snapshots. The
//! page needs no other file.
//!
//! A picture becomes SVG or PNG. The program contains the font, DejaVu Sans, so no fonts need to be installed.

mod axes;
mod box_edges;
mod chart;
mod colouring;
mod convergence;
mod facets;
mod font;
mod histories;
mod html;
mod neighbours;
mod palette;
mod particles;
mod picture;
mod player;
mod png;
mod run_report;
mod segments;
mod table;
mod view;

pub(crate) use convergence::newton_norms;
pub use view::View;

use super::OutputError;
use super::files::write_atomically;
use super::pvd::{self, SERIES};
use super::snapshots::beside;
use super::vtu::Snapshot;
use axes::extremes;
pub(super) use axes::rounded;
use chart::{Heading, Line, Panel};
use colouring::Colouring;
use histories::ROUND_OFF;
use particles::Surfaces;
use picture::{Color, Picture};
use player::Recording;
use run_report::{has_inertia, quantity, title};
use serde_json::Value;
use std::io::Write;
use std::path::{Path, PathBuf};
use table::Columns;

/// Names of all possible pictures.
const PICTURES: [&str; 9] =
    ["energies", "momentum", "iterations", "convergence", "probes", "reactions", "obstacles", "contacts", "particles"];

/// The tables that become pictures, and their titles.
const TABLES: [(&str, &str); 4] = [
    ("probes", "Probes"),
    ("reactions", "Reactions: forces of walls and regions on the bodies"),
    ("obstacles", "Obstacles: forces of the bodies on them"),
    ("contacts", "Contact: forces of the first body on the second"),
];

/// Height of a picture.
const HEIGHT: f64 = 640.0;

/// File name of the page.
const PAGE: &str = "report.html";

/// Field, view, time and file formats of the pictures.
///
/// ```
/// use bfree::output::plot::Look;
///
/// // Missing settings have defaults: the von Mises stress, the plane of the motion, the last snapshot.
/// let look = Look { field: Some("stress_xx".into()), view: Some("30,20".parse()?), ..Look::default() };
/// assert_eq!(look.formats, ["svg", "png"]);
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// The field that colours particles: its name, `stress_xx` for a component, `von_mises` where there is a stress.
    pub field: Option<String>,
    /// Direction of sight.
    pub view: Option<View>,
    /// Time of the picture of particles: the nearest snapshot is drawn.
    pub time: Option<f64>,
    /// Formats of the pictures: `svg`, `png`.
    pub formats: Vec<&'static str>,
}

impl Default for Look {
    fn default() -> Self {
        Self { field: None, view: None, time: None, formats: vec!["svg", "png"] }
    }
}

/// Whether [`plot_run`] writes a file of this name.
pub(crate) fn is_picture(file: &str) -> bool {
    let picture = file.strip_suffix(".svg").or(file.strip_suffix(".png"));
    file == PAGE || picture.is_some_and(|name| PICTURES.contains(&name))
}

/// Draws the results in the directory of a run, as `.svg` and `.png` in the same directory. Returns the files written.
///
/// The pictures are `energies`, `momentum` and `iterations`, and `convergence` once there are steps. A run that has probes, reactions,
/// obstacles, pairs of bodies that touched, or snapshots also gets `probes`, `reactions`, `obstacles`, `contacts` or `particles`. A picture
/// in which all values are round-off is left out. The page `report.html` holds the charts and a player of the snapshots.
///
/// ```
/// use bfree::output::{Audience, Outcome, OutputSettings, Recorder, Reference, plot::{Look, plot_run}};
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
/// // The page holds the charts themselves, so it opens anywhere.
/// let written = plot_run(folder.path(), &Look::default())?;
/// assert!(written.contains(&folder.path().join("energies.svg")));
/// let page = std::fs::read_to_string(folder.path().join("report.html"))?;
/// assert!(page.contains("<svg") && !page.contains("src=\"energies"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// `history.csv` is missing or damaged. Another table, the report or a snapshot is damaged. The snapshots do not hold the field of `look`.
/// The operating system refuses.
pub fn plot_run(directory: &Path, look: &Look) -> Result<Vec<PathBuf>, OutputError> {
    let report = run_report::read(directory)?;
    let pictures = charts(directory, &report)?;
    let snapshots = pvd::files(directory, SERIES[0])?;
    let recording = Recording::read(&snapshots)?;
    // The particles are not on the page: the player shows them.
    let mut particles = None;
    if let Some(recording) = &recording {
        let (snapshot, surfaces) = at_time(directory, &snapshots, look.time)?;
        let colouring = Colouring::chosen(&snapshot, look.field.as_deref())?;
        let span = colouring.as_ref().map_or((0.0, 1.0), Colouring::extremes);
        let scene = scene(look, recording, span, &report);
        particles = Some(("particles", particles::draw(&snapshot, &surfaces, &scene, colouring.as_ref())));
    }
    let mut written = Vec::new();
    let mut keep = |file: &str, content: &[u8]| -> Result<(), OutputError> {
        let path = directory.join(file);
        write_atomically(&path, |file| file.write_all(content))?;
        written.push(path);
        Ok(())
    };
    for (name, picture) in pictures.iter().chain(&particles) {
        for &format in &look.formats {
            let file = format!("{name}.{format}");
            keep(&file, &if format == "png" { picture.png(name)? } else { picture.svg().into_bytes() })?;
        }
    }
    let played = recording.as_ref().map(Recording::page);
    let charts: Vec<_> = pictures.iter().map(|(name, picture)| (*name, picture.svg())).collect();
    keep(PAGE, html::page(&report, played.as_ref(), &charts).as_bytes())?;
    Ok(written)
}

/// The snapshot nearest to a time, with its surfaces; without a time, the last snapshot.
fn at_time(directory: &Path, snapshots: &[PathBuf], time: Option<f64>) -> Result<(Snapshot, Surfaces), OutputError> {
    let [earlier @ .., last] = snapshots else { return Err(OutputError::NoSnapshots(directory.to_owned())) };
    let (mut nearest, mut file) = (Snapshot::read(last)?, last);
    for path in earlier.iter().rev() {
        let Some(time) = time else { break };
        let snapshot = Snapshot::read(path)?;
        if (nearest.time - time).abs() <= (snapshot.time - time).abs() {
            break;
        }
        (nearest, file) = (snapshot, path);
    }
    Ok((nearest, surfaces(file)?))
}

/// The obstacles and the outlines of bodies beside a snapshot of particles, if there are any.
fn surfaces(particles: &Path) -> Result<Surfaces, OutputError> {
    let read = |series| beside(particles, series).map(|path| Snapshot::read(&path)).transpose();
    Ok(Surfaces { obstacles: read("obstacles")?, bodies: read("bodies")? })
}

/// The settings that all pictures of the particles of a run have in common.
fn scene(look: &Look, recording: &Recording, span: (f64, f64), report: &Value) -> particles::Scene {
    let directions = view::Directions::new(look.view, recording.background.dimension, recording.plane());
    particles::Scene { directions, bounds: recording.bounds(), span, run: title(report).to_owned() }
}

/// The charts over time, with their names.
fn charts(directory: &Path, report: &Value) -> Result<Vec<(&'static str, Picture)>, OutputError> {
    let history = Columns::read(directory.join("history.csv"))?;
    let mut pictures = Vec::new();
    let mut draw = |name, what: &str, height, panels: &[Panel]| {
        let heading = Heading { what: what.to_owned(), run: title(report).to_owned() };
        pictures.push((name, chart::draw(&heading, height, panels)));
    };
    draw("energies", "Energies", HEIGHT, &energies(&history, has_inertia(report))?);
    if let Some(panel) = momentum(&history, report)? {
        draw("momentum", "Momentum", HEIGHT, &[panel]);
    }
    for (name, title) in TABLES {
        let path = directory.join(format!("{name}.csv"));
        if !path.is_file() {
            continue;
        }
        let table = if name == "contacts" { history.of_pairs(path)? } else { Columns::read(path)? };
        // Of an obstacle, the columns without a name of their own are the force.
        let shown = |panel: &str| name != "obstacles" || table.has(&format!("{panel}_area"));
        let quantity = |panel: &str| quantity(report, name, panel);
        let (mut panels, left_out) = histories::panels(&table, shown, quantity)?;
        if name != "probes" {
            histories::on_one_scale(&mut panels, quantity);
        }
        if !panels.is_empty() {
            draw(name, &format!("{title}{left_out}"), 110.0 + 190.0 * panels.len() as f64, &panels);
        }
    }
    // The first row is the state before the first step.
    let count = |column: &str, name: &str, color| -> Result<Panel, OutputError> {
        let points = history.pairs("time", column)?.into_iter().skip(1).collect();
        Ok(Panel::over_time(name, vec![Line::new(name, color, points)]))
    };
    let iterations = [count("newton", "Newton", palette::BLUE)?, count("krylov", "Krylov", palette::VERMILLION)?];
    draw("iterations", "Iterations in each step", HEIGHT, &iterations);
    if let Some(panel) = convergence::panel(report, directory)? {
        draw("convergence", "Convergence of Newton's method", HEIGHT, &[panel]);
    }
    Ok(pictures)
}

/// Columns of the history as lines: each with its name, label and colour.
fn lines(history: &Columns, columns: &[(&str, &str, Color)]) -> Result<Vec<Line>, OutputError> {
    let line = |(name, label, color): &(&str, &str, Color)| Ok(Line::new(label, *color, history.pairs("time", name)?));
    columns.iter().map(line).collect()
}

/// Panels of the energies, and of their balance if there is inertia. In load steps, loads act at once, and a balance says nothing of their
/// work.
fn energies(history: &Columns, has_inertia: bool) -> Result<Vec<Panel>, OutputError> {
    let mut columns = vec![("strain", "strain", palette::VERMILLION), ("external", "external work", palette::GREEN)];
    if history.has("dissipated") && history.pairs("time", "dissipated")?.iter().any(|point| point.1 != 0.0) {
        columns.push(("dissipated", "dissipated", palette::SKY));
    }
    if !has_inertia {
        return Ok(vec![Panel::over_time("energy", lines(history, &columns)?)]);
    }
    columns.extend([("total", "total", palette::BLACK), ("kinetic", "kinetic", palette::BLUE)]);
    let energies = Panel { share: 3.0, ..Panel::over_time("energy", lines(history, &columns)?) };
    let balance = Panel::over_time("balance", lines(history, &[("balance", "balance", palette::PURPLE)])?);
    let caption = "balance: total + dissipated − initial energy − external work".to_owned();
    if balance.size() <= ROUND_OFF * energies.size() {
        let caption = format!("{caption}, at most {:.0e}", balance.size());
        return Ok(vec![Panel { caption, ..energies }]);
    }
    Ok(vec![energies, Panel { caption, share: 2.0, ..balance }])
}

/// The momentum of a run with inertia. `None` if it is round-off of its scale, |p| ≤ √(2 M K), with the mass M and the largest kinetic
/// energy K.
fn momentum(history: &Columns, report: &Value) -> Result<Option<Panel>, OutputError> {
    if !has_inertia(report) {
        return Ok(None);
    }
    let mut axes = vec![
        ("momentum_x", "x", palette::BLUE),
        ("momentum_y", "y", palette::VERMILLION),
        ("momentum_z", "z", palette::GREEN),
    ];
    axes.retain(|(column, ..)| history.has(column));
    let panel = Panel::over_time("momentum", lines(history, &axes)?);
    let kinetic = Panel::over_time("", lines(history, &[("kinetic", "", palette::BLUE)])?).size();
    let mass = report["mass"].as_f64().unwrap_or(0.0);
    Ok(Some(panel).filter(|panel| panel.size() > ROUND_OFF * (2.0 * mass * kinetic).sqrt()))
}

/// Draws all snapshots of a run as `frame_0000.png`, `frame_0001.png`, … in the directory `frames`, which is created. An encoder makes a
/// movie of the frames. All frames have the same axes and the same range of colours. Returns the files written.
///
/// # Errors
/// There are no snapshots, or a snapshot is damaged. The snapshots do not hold the field of `look`. The operating system refuses.
pub fn plot_frames(directory: &Path, frames: &Path, look: &Look) -> Result<Vec<PathBuf>, OutputError> {
    let snapshots = pvd::files(directory, SERIES[0])?;
    let none = || OutputError::NoSnapshots(directory.to_owned());
    let recording = Recording::read(&snapshots)?.ok_or_else(none)?;
    std::fs::create_dir_all(frames).map_err(OutputError::io("create", frames))?;
    let mut ends = Vec::new();
    for path in &snapshots {
        let colouring = Colouring::chosen(&Snapshot::read(path)?, look.field.as_deref())?;
        let (low, high) = colouring.as_ref().map_or((0.0, 1.0), Colouring::extremes);
        ends.extend([low, high]);
    }
    let scene = scene(look, &recording, extremes(ends.into_iter()), &run_report::read(directory)?);
    let mut written = Vec::new();
    for (number, path) in snapshots.iter().enumerate() {
        let snapshot = Snapshot::read(path)?;
        let colouring = Colouring::chosen(&snapshot, look.field.as_deref())?;
        let picture = particles::draw(&snapshot, &surfaces(path)?, &scene, colouring.as_ref());
        let (png, path) = (picture.png("a frame")?, frames.join(format!("frame_{number:04}.png")));
        write_atomically(&path, |file| file.write_all(&png))?;
        written.push(path);
    }
    Ok(written)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn no_panel_shows_round_off() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("history.csv");
        let table = |momentum: f64, balance: f64| -> Result<Columns, Box<dyn std::error::Error>> {
            let header = "step,time,kinetic,strain,external,total,balance,momentum_x\n0,0,2,0,0,2,0,0\n";
            std::fs::write(&path, format!("{header}1,1,1,1,0,2,{balance},{momentum}\n"))?;
            Ok(Columns::read(path.clone())?)
        };
        // Bodies of mass 4 that move with an energy of 2 have a momentum of up to 4.
        let report = json!({ "mass": 4.0 });
        let momentum = |history: &Columns| momentum(history, &report).map(|panel| panel.is_some());
        let (round_off, real) = (table(-1e-15, 3e-16)?, table(1e-9, 1e-9)?);
        assert_eq!((momentum(&round_off)?, momentum(&real)?), (false, true));
        // A balance of round-off is described in the caption.
        assert_eq!((energies(&round_off, true)?.len(), energies(&real, true)?.len()), (1, 2));
        assert!(energies(&round_off, true)?[0].caption.ends_with("at most 3e-16"));
        Ok(())
    }
}
