//! Driving the solver step by step: watch a run, and stop it when you have seen enough.
//!
//! [`Simulation::advance`] takes one step and reports on it; between two steps the state is yours to read. The observer follows the elastic
//! cylinder of section 4.3 of the paper to its first impact at the wall. It stops the run when the cylinder begins to swing back: the
//! kinetic energy has then become strain energy.
//!
//! `cargo run --release --features examples --example observer`

use bfree::scene;
use bfree::simulation::{Simulation, StepReport};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;

/// Takes steps until `observer` has seen enough.
pub fn drive(
    simulation: &mut Simulation<2>,
    mut observer: impl FnMut(&Simulation<2>, &StepReport<2>) -> ControlFlow<()>,
) -> Result<(), Box<dyn Error>> {
    loop {
        let step = simulation.advance()?;
        if observer(simulation, &step).is_break() {
            return Ok(());
        }
    }
}

/// Watches the first impact.
pub fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let scene = scene::read_file(&folder.join("rebound.json"), &[])?;
    let mut simulation = scene.build::<2>(&folder)?;
    let start = simulation.particles.kinetic_energy();
    let (mut most, mut iterations, mut seconds) = (0.0, 0, 0.0);
    drive(&mut simulation, |simulation, step| {
        iterations += step.newton.history.iterations.len();
        seconds += step.seconds.seconds().iter().sum::<f64>();
        let strain = simulation.strain_energy();
        if strain > 0.5 * start && strain < most {
            return ControlFlow::Break(());
        }
        most = strain.max(most);
        // Something else may have gone wrong, so the observer also stops after t = 30.
        if simulation.clock.time() > 30.0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    let time = simulation.clock.time();
    println!(
        "swings back at t = {time:.2}: {:.1} % of the energy is strain; {} steps, {iterations} Newton iterations, {seconds:.2} s",
        100.0 * most / start,
        simulation.clock.steps()
    );
    assert!((21.0..24.0).contains(&time), "{time}");
    assert!(most > 0.85 * start && most < start, "{most} of {start}");
    Ok(())
}
