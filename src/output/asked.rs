//! The questions of process 0 while it writes records. A question asks for rows of a field, or for a probe. All other processes answer until process 0
//! has no more questions. So no process needs the state of all particles.

use super::Reference;
use super::probes::{PROBE, Probe};
use super::rows::Rows;
use crate::field::Field;
use crate::material::Law;
use crate::simulation::Simulation;

/// The end of the questions. A question is the number of a field, and the first and the last row.
const END: [u64; 3] = [u64::MAX; 3];

/// The fields of snapshots and the probes, for which process 0 may ask.
#[derive(Clone, Debug)]
pub(crate) struct Asked<const D: usize> {
    pub fields: Vec<Field>,
    pub probes: Vec<Probe<D>>,
}

impl<const D: usize> Asked<D> {
    /// Ends the questions of process 0, or answers them in another process.
    pub(crate) fn end_or_answer<L: Law, A: Sync>(&self, simulation: &Simulation<D, L, A>) {
        let processes = &simulation.settings.processes;
        // Fields that depend on the start need no other process.
        let reference = Reference::unknown();
        let mut rows = None;
        loop {
            let [number, first, last] = processes.each(END)[0];
            // Process 0 receives the error.
            if number == PROBE {
                let _ = self.probes[first as usize].exchanged(simulation, last as usize);
            } else if let Some(field) = self.fields.get(number as usize) {
                let rows = rows.get_or_insert_with(|| Rows::new(simulation, &reference, &self.fields));
                let _ = rows.exchanged(field, first as usize..last as usize);
            } else {
                return;
            }
        }
    }
}
