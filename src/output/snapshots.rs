//! Snapshots of the particles: `particles_*.vtu`, and the series `particles.pvd`.

use super::fields::padded;
use super::pvd::Series;
use super::vtu::{Array, Background, Snapshot, Values};
use super::{OutputError, Reference};
use crate::field::{Field, Kind};
use crate::material::Law;
use crate::simulation::Simulation;
use std::path::PathBuf;

/// The file of the series, in the directory of the run.
pub(crate) const SERIES: &str = "particles.pvd";

/// Writes snapshots.
#[derive(Debug)]
pub(crate) struct Snapshots {
    directory: PathBuf,
    fields: Vec<Field>,
    series: Series,
    /// Time between snapshots.
    every: f64,
    written: usize,
    /// Steps taken when the last one was written.
    last: Option<u64>,
    /// How many multiples of `every` the time had passed then.
    passed: f64,
}

impl Snapshots {
    /// Of `fields` (each once, whatever the list says), into `directory`, whenever the time passes a multiple of `every`.
    pub(crate) fn new(directory: PathBuf, fields: &[Field], every: f64) -> Result<Self, OutputError> {
        if !(every > 0.0 && every.is_finite()) {
            return Err(OutputError::SnapshotEvery(every));
        }
        let mut unique = Vec::new();
        for &field in fields {
            if !unique.contains(&field) {
                unique.push(field);
            }
        }
        let series = Series::new(directory.join(SERIES));
        Ok(Self { directory, fields: unique, series, every, written: 0, last: None, passed: f64::NEG_INFINITY })
    }

    /// Writes the present state if the time has reached a multiple of `every` since the last snapshot, or if there is none yet.
    pub(crate) fn write_if_due<const D: usize, L: Law, A>(
        &mut self,
        simulation: &Simulation<D, L, A>,
        reference: &Reference<D>,
    ) -> Result<(), OutputError> {
        // Round-off must not put a step that ends on a multiple before it.
        let clock = &simulation.clock;
        let passed = ((clock.time() + 1e-6 * clock.nominal()) / self.every).floor();
        if passed > self.passed {
            self.passed = passed;
            self.write(simulation, reference)?;
        }
        Ok(())
    }

    /// Writes the present state, unless it is already written.
    pub(crate) fn write<const D: usize, L: Law, A>(
        &mut self,
        simulation: &Simulation<D, L, A>,
        reference: &Reference<D>,
    ) -> Result<(), OutputError> {
        let step = simulation.clock.steps();
        if self.last == Some(step) {
            return Ok(());
        }
        let file = format!("particles_{:06}.vtu", self.written);
        snapshot(simulation, reference, &self.fields)?.write(&self.directory.join(&file))?;
        self.series.push(simulation.clock.time(), &file)?;
        self.written += 1;
        self.last = Some(step);
        Ok(())
    }
}

/// The particles with the fields asked for; no others are computed.
pub(crate) fn snapshot<const D: usize, L: Law, A>(
    simulation: &Simulation<D, L, A>,
    reference: &Reference<D>,
    fields: &[Field],
) -> Result<Snapshot, OutputError> {
    let grid = &simulation.grid;
    let arrays = fields.iter().map(|field| {
        let values = match field.kind() {
            Kind::Index => Values::Index(simulation.particles.body.clone()),
            _ => Values::Float(field.values(simulation, reference)?),
        };
        let components = field.kind().components().iter().map(|&name| name.to_owned()).collect();
        Ok(Array { name: field.name().to_owned(), components, values })
    });
    Ok(Snapshot {
        time: simulation.clock.time(),
        background: Background {
            dimension: D as u32,
            origin: padded(&grid.origin),
            spacing: grid.spacing,
            cells: std::array::from_fn(|k| grid.cells.get(k).copied().unwrap_or(0)),
        },
        points: simulation.particles.position.iter().map(padded).collect(),
        arrays: arrays.collect::<Result<_, OutputError>>()?,
    })
}
