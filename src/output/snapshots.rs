//! Snapshots of the particles, of the obstacles, of surfaces that may touch and of the outlines of bodies: `particles_*.vtu`,
//! `obstacles_*.vtu`, `contacts_*.vtu`, `bodies_*.vtu`, and their series, such as `particles.pvd`.

use super::fields::padded;
use super::moved_outlines::MovedOutlines;
use super::outlines::Outlines;
use super::pvd::{self, SERIES};
use super::rows::Rows;
use super::vtu::Background;
use super::vtu_writer::{Column, Head};
use super::{OutputError, Reference, surfaces};
use crate::clock::Clock;
use crate::field::{Field, Kind};
use crate::material::Law;
use crate::simulation::Simulation;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Writes snapshots.
#[derive(Debug)]
pub(crate) struct Snapshots<const D: usize> {
    directory: PathBuf,
    fields: Vec<Field>,
    /// The obstacles, if there are any.
    outlines: Option<Outlines<D>>,
    /// The outlines of the bodies, if pictures need them.
    bodies: Option<MovedOutlines<D>>,
    /// The entries of each of [`SERIES`].
    entries: [String; SERIES.len()],
    /// Time between snapshots.
    every: f64,
    pub(crate) mark: SnapshotMark,
}

/// Progress of the snapshots of a run, for a checkpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SnapshotMark {
    written: usize,
    /// Steps taken when the last snapshot was written.
    last: Option<u64>,
    /// Multiples of the time between snapshots that had passed when the last snapshot was due.
    passed: Option<f64>,
}

/// The name of a file of a series.
fn name(series: &str, number: usize) -> String {
    format!("{series}_{number:06}.vtu")
}

/// The file of another series at the time of a file of particles, if there is one.
pub(crate) fn beside(particles: &Path, series: &str) -> Option<PathBuf> {
    let end = particles.file_name()?.to_str()?.strip_prefix(SERIES[0])?;
    Some(particles.with_file_name(format!("{series}{end}"))).filter(|path| path.is_file())
}

impl SnapshotMark {
    /// Checks that the series in `directory` still lists all written snapshots.
    pub(crate) fn check(&self, directory: &Path) -> Result<(), OutputError> {
        // Nothing is written before the first snapshot.
        if self.written > 0 {
            pvd::first_entries(&pvd::file(directory, SERIES[0]), self.written)?;
        }
        Ok(())
    }

    /// The written snapshots that are not in `directory`.
    pub(crate) fn missing(&self, directory: &Path) -> Vec<PathBuf> {
        let files = (0..self.written).map(|number| directory.join(name(SERIES[0], number)));
        files.filter(|path| !path.is_file()).collect()
    }

    /// Whether a file of this name is a snapshot that was written later.
    pub(crate) fn precedes(&self, name: &str) -> bool {
        let rest = SERIES.iter().find_map(|series| name.strip_prefix(series)?.strip_prefix('_'));
        let number = rest.and_then(|rest| rest.strip_suffix(".vtu"));
        let digits = number.filter(|number| number.len() >= 6 && number.bytes().all(|b| b.is_ascii_digit()));
        digits.is_some_and(|digits| digits.parse().map_or(true, |number: usize| number >= self.written))
    }
}

impl<const D: usize> Snapshots<D> {
    /// Snapshots of `fields` in `directory`, due whenever the time passes a multiple of `every`. A repeated field is written once. The
    /// snapshots up to `mark` are continued.
    pub(crate) fn new<L, A>(
        directory: PathBuf,
        fields: &[Field],
        simulation: &Simulation<D, L, A>,
        reference: &Reference<D>,
        every: f64,
        mark: SnapshotMark,
    ) -> Result<Self, OutputError> {
        if !(every > 0.0 && every.is_finite()) {
            return Err(OutputError::SnapshotEvery(every));
        }
        let mut entries = [const { String::new() }; SERIES.len()];
        let (contacts, grid) = (&simulation.loads.contacts, &simulation.grid);
        let outlines = (!contacts.obstacles.is_empty()).then(|| Outlines::of(contacts, grid));
        let bodies = MovedOutlines::of(&simulation.particles, reference, grid.spacing);
        let is_written = [true, outlines.is_some(), contacts.exist(), bodies.is_some()];
        for k in (0..SERIES.len()).filter(|&k| is_written[k] && mark.written > 0) {
            let path = pvd::file(&directory, SERIES[k]);
            entries[k] = pvd::first_entries(&path, mark.written)?;
            pvd::write(&path, &entries[k])?;
        }
        Ok(Self { fields: unique(fields), directory, outlines, bodies, entries, every, mark })
    }

    /// Whether the time has reached a multiple of `every` since the last call that was due, or there was no such call.
    pub(crate) fn is_due(&mut self, clock: &Clock) -> bool {
        let is_due = self.is_next(clock);
        if is_due {
            self.mark.passed = Some(multiples(clock, self.every));
        }
        is_due
    }

    /// Whether one process needs the state of all particles to write a snapshot.
    pub(crate) fn need_particles(&self) -> bool {
        self.bodies.is_some()
    }

    /// The answer of the next call of [`Self::is_due`].
    pub(crate) fn is_next(&self, clock: &Clock) -> bool {
        self.mark.passed.is_none_or(|before| multiples(clock, self.every) > before)
    }

    /// Writes the present state, unless it is already written.
    pub(crate) fn write<L: Law, A: Sync>(
        &mut self,
        simulation: &Simulation<D, L, A>,
        reference: &Reference<D>,
    ) -> Result<(), OutputError> {
        let step = simulation.clock.steps();
        if self.mark.last == Some(step) {
            return Ok(());
        }
        let head = head(simulation);
        if let Some(outlines) = &self.outlines {
            let outlines = outlines.at(&simulation.loads.contacts, simulation.clock.time(), &head);
            self.add(1, &head, |path| outlines.write(path))?;
        }
        if simulation.loads.contacts.exist() {
            self.add(2, &head, |path| surfaces::snapshot(simulation, &head).write(path))?;
        }
        if let Some(bodies) = &self.bodies {
            let bodies = bodies.at(&simulation.particles, &head);
            self.add(3, &head, |path| bodies.write(path))?;
        }
        let fields = self.fields.clone();
        self.add(0, &head, |path| write_particles(path, &head, simulation, reference, &fields))?;
        self.mark.written += 1;
        self.mark.last = Some(step);
        Ok(())
    }

    /// Writes the next file of a series, given by its number in [`SERIES`], and the entry of this file.
    fn add(
        &mut self,
        series: usize,
        head: &Head,
        write: impl FnOnce(&Path) -> Result<(), OutputError>,
    ) -> Result<(), OutputError> {
        let file = name(SERIES[series], self.mark.written);
        write(&self.directory.join(&file))?;
        self.entries[series] += &pvd::entry(head.time, &file);
        pvd::write(&pvd::file(&self.directory, SERIES[series]), &self.entries[series])
    }
}

/// Number of multiples of `every` that the time has reached.
pub(crate) fn multiples(clock: &Clock, every: f64) -> f64 {
    // A step that ends on a multiple must reach the multiple in spite of round-off.
    ((clock.time() + 1e-6 * clock.nominal()) / every).floor()
}

/// The fields without repetitions.
pub(crate) fn unique(fields: &[Field]) -> Vec<Field> {
    let first = fields.iter().enumerate().filter(|&(k, field)| !fields[..k].contains(field));
    first.map(|(_, field)| field.clone()).collect()
}

/// The time and the grid of a snapshot.
fn head<const D: usize, L, A>(simulation: &Simulation<D, L, A>) -> Head {
    let grid = &simulation.grid;
    Head {
        time: simulation.clock.time(),
        background: Background {
            dimension: D as u32,
            origin: padded(&grid.origin),
            spacing: grid.spacing,
            cells: std::array::from_fn(|k| grid.cells.get(k).copied().unwrap_or(0)),
        },
        corners: 1,
    }
}

/// Writes the given fields of the particles, in the order of their ids. No other field is computed.
fn write_particles<const D: usize, L: Law, A: Sync>(
    path: &Path,
    head: &Head,
    simulation: &Simulation<D, L, A>,
    reference: &Reference<D>,
    fields: &[Field],
) -> Result<(), OutputError> {
    let all = &Rows::new(simulation, reference, fields);
    let count = all.places.len();
    let names = |field: &Field| field.kind().components().iter().map(|&name| name.to_owned()).collect();
    let components: Vec<Vec<String>> = fields.iter().map(names).collect();
    let mut columns = Vec::new();
    for (number, (field, components)) in fields.iter().zip(&components).enumerate() {
        field.check(simulation)?;
        let about = (field.name(), components.as_slice(), field.kind() == Kind::Index);
        columns.push(Column::new(about, count, move |rows, out| all.append(number, rows, out)));
    }
    head.write(path, columns, count, |rows, out| {
        out.extend(all.places[rows].iter().flat_map(|&p| padded(&simulation.particles.position[p as usize])));
        Ok(())
    })
}
