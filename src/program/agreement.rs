//! The agreement of processes: they succeed or fail together, and refuse to go on with different numbers.

use super::failure::{Failure, INTERRUPTED};
use super::provenance::Maker;
use crate::lanes;
use crate::parallel::Processes;
use crate::simulation::{Simulation, StepReport};
use bytemuck::Pod;
use std::error::Error;

/// The result of this process, if all processes succeed. Otherwise the first process that fails returns its failure, which the program tells. The
/// others end without a word and with exit code 0, because a launcher kills all processes when it sees another code.
pub(super) fn agreed<R>(processes: &Processes, result: Result<R, Failure>) -> Result<R, Failure> {
    let codes = processes.each(result.as_ref().err().map_or(0, Failure::code));
    match codes.iter().position(|code| *code != 0) {
        // Nothing is told of an interruption, which all processes have seen.
        Some(first) if first != processes.rank() && codes[first] != INTERRUPTED => Err(Failure::Told(0)),
        _ => result,
    }
}

/// Refuses processes whose `own` differs from that of process 0. `difference` completes the sentence "process N …".
fn refuse_other<K: Pod + PartialEq>(processes: &Processes, own: K, difference: &str) -> Result<(), String> {
    processes.first_other(own).map_or(Ok(()), |rank| Err(format!("process {rank} {difference}")))
}

/// Refuses processes that start from another state, such as another checkpoint.
pub(super) fn check_start<const D: usize>(processes: &Processes, simulation: &Simulation<D>) -> Result<(), Failure> {
    let positions: &[u8] = bytemuck::cast_slice(&simulation.particles.position);
    let own = [simulation.clock.steps() as u32, crc32fast::hash(positions)];
    let difference =
        "starts from another state than process 0: its folder of the scene or of the results is not the same";
    refuse_other(processes, own, difference).map_err(Failure::scene)
}

/// Refuses processes of another build, or on a processor that rounds otherwise.
pub(super) fn check_likeness(processes: &Processes) -> Result<(), Failure> {
    if processes.count() == 1 {
        return Ok(());
    }
    let own = format!("{:?} {}", Maker::here().build, lanes::rounds_once());
    let difference = "is another build than process 0, or its processor does not round a product and a sum in the same way: start all processes \
                      with one program, on machines of one kind";
    refuse_other(processes, crc32fast::hash(own.as_bytes()), difference).map_err(Failure::scene)
}

/// Compares the last residual of a step. Processes with different numbers would take different decisions.
///
/// # Errors
/// The residuals of a step do not have the same bits in all processes.
pub(super) fn check_step<const D: usize>(processes: &Processes, step: &StepReport<D>) -> Result<(), Box<dyn Error>> {
    let last = step.newton.history.iterations.last();
    let difference = "computes other numbers than process 0, perhaps with another processor or another mathematical library: start all \
                      processes on machines of one kind";
    Ok(refuse_other(processes, last.map_or(0, |one| one.residual.to_bits()), difference)?)
}
