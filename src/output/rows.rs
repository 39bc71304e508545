//! The values of fields at some particles, for a snapshot, from the processes that have the particles.

use super::{OutputError, Reference};
use crate::field::Field;
use crate::material::{Law, NonPositiveJacobian};
use crate::parallel::{self, PART, Processes};
use crate::simulation::Simulation;
use std::ops::Range;

/// The particles of a snapshot, in the order of their ids, and its fields.
pub(super) struct Rows<'a, const D: usize, L, A> {
    simulation: &'a Simulation<D, L, A>,
    reference: &'a Reference<D>,
    fields: &'a [Field],
    /// The places of the particles in memory.
    pub(super) places: Vec<u32>,
}

impl<'a, const D: usize, L: Law, A: Sync> Rows<'a, D, L, A> {
    pub(super) fn new(simulation: &'a Simulation<D, L, A>, reference: &'a Reference<D>, fields: &'a [Field]) -> Self {
        Self { simulation, reference, fields, places: simulation.particles.solid_places() }
    }

    /// Appends the values of a field, given by its number, in some rows.
    pub(super) fn append(&self, number: usize, rows: Range<usize>, out: &mut Vec<f64>) -> Result<(), OutputError> {
        let (field, particles) = (&self.fields[number], &self.simulation.particles);
        let values = if particles.are_all_here() || !field.needs_state() {
            self.evaluated(field, &self.places[rows])
        } else {
            self.simulation.settings.processes.each([number, rows.start, rows.end].map(|number| number as u64));
            self.exchanged(field, rows)
        };
        out.extend(values?);
        Ok(())
    }

    /// The values of a field at places of this process.
    fn evaluated(&self, field: &Field, places: &[u32]) -> Result<Vec<f64>, OutputError> {
        let of_part = |places: &[u32]| {
            let mut values = Vec::new();
            field.append_at_all(self.simulation, self.reference, places, &mut values).map(|()| values)
        };
        let values: Result<Vec<_>, _> = parallel::collect(places.chunks(PART), &of_part).into_iter().collect();
        values.map(|values| values.concat())
    }

    /// The values of a field in some rows, in process 0; nothing in the others.
    pub(super) fn exchanged(&self, field: &Field, rows: Range<usize>) -> Result<Vec<f64>, OutputError> {
        let (simulation, width) = (self.simulation, field.kind().components().len());
        let (processes, parts) = (&simulation.settings.processes, &simulation.particles.parts);
        let owner = |place: &u32| parts.owner(*place as usize);
        let (places, mut lengths) = (&self.places[rows], vec![0; processes.count()]);
        places.iter().for_each(|place| lengths[owner(place)] += width);
        let own: Vec<u32> = places.iter().copied().filter(|&place| parts.is_own(processes, place as usize)).collect();
        let Some(all) = collected(processes, &lengths, self.evaluated(field, &own))? else { return Ok(Vec::new()) };
        let mut next: Vec<usize> = (0..lengths.len()).map(|process| lengths[..process].iter().sum()).collect();
        let row = |place: &u32| {
            let first = &mut next[owner(place)];
            *first += width;
            &all[*first - width..*first]
        };
        Ok(places.iter().map(row).collect::<Vec<_>>().concat())
    }
}

/// The values of all processes, joined in process 0.
///
/// # Errors
/// The evaluation failed in a process. Every process hears of it, and names the particle with the smallest id.
pub(super) fn collected(
    processes: &Processes,
    lengths: &[usize],
    values: Result<Vec<f64>, OutputError>,
) -> Result<Option<Vec<f64>>, OutputError> {
    let failed = values.as_ref().err().map(|error| match error {
        OutputError::Inadmissible { particle, source } => (*particle, source.det_f),
        _ => (usize::MAX, f64::NAN),
    });
    let failed = processes.told(&failed).into_iter().flatten().min_by_key(|(particle, _)| *particle);
    match (values, failed) {
        (Err(error), None | Some((usize::MAX, _))) => Err(error),
        (_, Some((particle, det_f))) => {
            Err(OutputError::Inadmissible { particle, source: NonPositiveJacobian { det_f } })
        }
        (Ok(values), None) => Ok(processes.collected(lengths, &values)),
    }
}
