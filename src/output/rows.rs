//! The values of fields at some particles, for a snapshot, from the processes that have the particles. Process 0 asks for some rows of a field,
//! and all others answer until it has no more questions. So no process needs the state of all particles.

use super::{OutputError, Reference};
use crate::field::Field;
use crate::material::{Law, NonPositiveJacobian};
use crate::parallel::{self, PART};
use crate::simulation::Simulation;
use crate::tensor::Vector;
use std::ops::Range;

/// The end of the questions. A question is the number of a field, and the first and the last row.
const END: [u64; 3] = [u64::MAX; 3];

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
    fn exchanged(&self, field: &Field, rows: Range<usize>) -> Result<Vec<f64>, OutputError> {
        let (simulation, width) = (self.simulation, field.kind().components().len());
        let (processes, parts) = (&simulation.settings.processes, &simulation.particles.parts);
        let owner = |place: &u32| parts.owner(*place as usize);
        let (places, mut lengths) = (&self.places[rows], vec![0; processes.count()]);
        places.iter().for_each(|place| lengths[owner(place)] += width);
        let own: Vec<u32> = places.iter().copied().filter(|&place| parts.is_own(processes, place as usize)).collect();
        let values = self.evaluated(field, &own);
        let failed = values.as_ref().err().map(|error| match error {
            OutputError::Inadmissible { particle, source } => (*particle, source.det_f),
            _ => (usize::MAX, f64::NAN),
        });
        // Every process hears of a failure, and names the first particle.
        let failed = processes.told(&failed).into_iter().flatten().min_by_key(|(particle, _)| *particle);
        let values = match (values, failed) {
            (Err(error), None | Some((usize::MAX, _))) => return Err(error),
            (_, Some((particle, det_f))) => {
                return Err(OutputError::Inadmissible { particle, source: NonPositiveJacobian { det_f } });
            }
            (Ok(values), None) => values,
        };
        let Some(all) = processes.collected(&lengths, &values) else { return Ok(Vec::new()) };
        let mut next: Vec<usize> = (0..lengths.len()).map(|process| lengths[..process].iter().sum()).collect();
        let row = |place: &u32| {
            let first = &mut next[owner(place)];
            *first += width;
            &all[*first - width..*first]
        };
        Ok(places.iter().map(row).collect::<Vec<_>>().concat())
    }
}

/// Ends the questions of process 0 about snapshots of these fields, or answers them in another process.
pub(crate) fn end_or_answer<const D: usize, L: Law, A: Sync>(simulation: &Simulation<D, L, A>, fields: &[Field]) {
    let processes = &simulation.settings.processes;
    // The fields that depend on the start need no other process.
    let reference = Reference { position: Vec::new(), energy: 0.0, momentum: Vector::zeros() };
    let mut rows = None;
    loop {
        let [number, first, last] = processes.each(END)[0];
        if [number, first, last] == END {
            return;
        }
        let rows = rows.get_or_insert_with(|| Rows::new(simulation, &reference, fields));
        // Process 0 hears of an error.
        let _ = fields.get(number as usize).map(|field| rows.exchanged(field, first as usize..last as usize));
    }
}
