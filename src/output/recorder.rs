//! Everything that is written about a run, in one place.

use super::history::{Cost, Energies, History};
use super::probes::{Probe, Probes};
use super::progress::{Progress, Shown};
use super::reactions::Reactions;
use super::report::{Counts, NewtonLog, Outcome, Report, Seconds};
use super::snapshots::{SERIES, Snapshots};
use super::{OutputError, Reference, Summary};
use crate::approximation::ShapeFunction;
use crate::field::Field;
use crate::material::Law;
use crate::simulation::{Simulation, StepReport};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What to write, and where.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputSettings<const D: usize> {
    /// The directory; it is made if it is missing, and files of an earlier run in it are replaced.
    pub directory: PathBuf,
    /// Fields of the snapshots.
    pub fields: Vec<Field>,
    /// Time between snapshots, > 0: the first state is written, every state that reaches a multiple of it, and the last. Without it
    /// there are no snapshots.
    pub snapshot_every: Option<f64>,
    /// Fields at particles or points, every step.
    pub probes: Vec<Probe<D>>,
    /// Time at which the run will end, for the progress bar.
    pub end_time: f64,
    /// Show no progress.
    pub quiet: bool,
}

/// Writes a run: [`Recorder::start`], then [`Recorder::record`] after every step, then [`Recorder::finish`], also after a failure.
///
/// ```no_run
/// # use bfree::{output::{Outcome, OutputSettings, Recorder, Reference}, simulation::Simulation};
/// # fn run(mut simulation: Simulation<2>, settings: OutputSettings<2>) -> Result<(), Box<dyn std::error::Error>> {
/// let reference = Reference::of(&simulation);
/// let mut recorder = Recorder::start(settings, &simulation, reference)?;
/// while simulation.clock.nominal_steps() < 100 {
///     let step = simulation.advance()?;
///     recorder.record(&simulation, &step)?;
/// }
/// println!("{}", recorder.finish(&simulation, &serde_json::Map::new(), Outcome::Finished)?);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Recorder<const D: usize> {
    directory: PathBuf,
    reference: Reference<D>,
    history: History,
    reactions: Option<Reactions>,
    probes: Option<Probes<D>>,
    snapshots: Option<Snapshots>,
    newton: NewtonLog,
    progress: Progress,
    counts: Counts,
    seconds: Seconds,
    since: Instant,
}

impl<const D: usize> Recorder<D> {
    /// Makes the directory and the files, and writes the state before the first step.
    ///
    /// # Errors
    /// The system refuses; a probe at a particle that does not exist; names that lead to equal columns; a time between snapshots that is not positive; a reference with another number of particles.
    pub fn start<L: Law, A: ShapeFunction>(
        settings: OutputSettings<D>,
        simulation: &Simulation<D, L, A>,
        reference: Reference<D>,
    ) -> Result<Self, OutputError> {
        reference.check(simulation)?;
        let OutputSettings { directory, fields, snapshot_every, probes, end_time, quiet } = settings;
        std::fs::create_dir_all(&directory).map_err(OutputError::io("create", &directory))?;
        remove_earlier_run(&directory)?;
        let at = |name: &str| directory.join(name);
        let loads = &simulation.loads;
        let mut recorder = Self {
            history: History::create(at("history.csv"), D)?,
            reactions: match loads.prescribed.is_empty() {
                true => None,
                false => Some(Reactions::create(at("reactions.csv"), loads)?),
            },
            probes: match probes.is_empty() {
                true => None,
                false => Some(Probes::create(at("probes.csv"), probes)?),
            },
            snapshots: match snapshot_every {
                None => None,
                Some(every) => Some(Snapshots::new(directory.clone(), &fields, every)?),
            },
            newton: NewtonLog::create(at("newton.jsonl"))?,
            progress: Progress::new(simulation.clock.time(), end_time, quiet),
            counts: Counts { particles: simulation.particles.len(), ..Counts::default() },
            seconds: Seconds::default(),
            since: Instant::now(),
            reference,
            directory,
        };
        recorder.write_state(simulation, Cost::default())?;
        recorder.flush()?;
        Ok(recorder)
    }

    /// Writes a step that has succeeded.
    ///
    /// # Errors
    /// The system refuses.
    pub fn record<L: Law, A: ShapeFunction>(
        &mut self,
        simulation: &Simulation<D, L, A>,
        step: &StepReport<D>,
    ) -> Result<(), OutputError> {
        self.counts.add(step);
        self.seconds.add(step);
        self.newton.write(simulation.clock.time(), step)?;
        if let Some(reactions) = &mut self.reactions {
            reactions.write(simulation.clock.time(), &step.reactions)?;
        }
        let newton = &step.newton.history;
        let cost = Cost { dt: step.dt, newton: newton.iterations.len(), krylov: newton.counts.krylov_iterations };
        self.write_state(simulation, cost)?;
        let clock = &simulation.clock;
        self.progress.show(clock.time(), Shown { step: clock.steps(), newton: cost.newton, krylov: cost.krylov });
        Ok(())
    }

    /// Writes the last snapshot and the report, with `asked` among its entries: what the caller knows of the run, such as the scene
    /// and the command line.
    ///
    /// # Errors
    /// The system refuses.
    pub fn finish<L: Law, A: ShapeFunction>(
        mut self,
        simulation: &Simulation<D, L, A>,
        asked: &Map<String, Value>,
        outcome: Outcome<'_>,
    ) -> Result<Summary, OutputError> {
        if let Outcome::Failed(error) = outcome {
            self.counts.add_failed(&error.failed);
        }
        if let Some(snapshots) = &mut self.snapshots {
            snapshots.write(simulation, &self.reference)?;
        }
        self.flush()?;
        self.progress.finish();
        let (counts, time) = (self.counts, simulation.clock.time());
        let seconds = Seconds { total: self.since.elapsed().as_secs_f64(), ..self.seconds };
        let energies = Energies::of(simulation, &self.reference);
        let report = Report { asked, outcome, time, energies, counts, seconds };
        report.write(&self.directory.join("report.json"), self.newton)?;
        let particles = &simulation.particles;
        Ok(Summary {
            time,
            energies,
            momentum_change: (particles.momentum() - self.reference.momentum).norm(),
            momentum_scale: particles.mass.iter().zip(&particles.velocity).map(|(m, v)| m * v.norm()).sum(),
            counts,
            seconds,
        })
    }

    fn write_state<L: Law, A: ShapeFunction>(
        &mut self,
        simulation: &Simulation<D, L, A>,
        cost: Cost,
    ) -> Result<(), OutputError> {
        self.history.write(simulation, &self.reference, cost)?;
        if let Some(probes) = &mut self.probes {
            probes.write(simulation, &self.reference)?;
        }
        if let Some(snapshots) = &mut self.snapshots {
            snapshots.write_if_due(simulation, &self.reference)?;
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), OutputError> {
        self.history.flush()?;
        self.newton.flush()?;
        self.reactions.as_mut().map_or(Ok(()), Reactions::flush)?;
        self.probes.as_mut().map_or(Ok(()), Probes::flush)
    }
}

/// Removes what an earlier run left under the names this one may use, so that no file of it is taken for a new one.
fn remove_earlier_run(directory: &Path) -> Result<(), OutputError> {
    let entries = std::fs::read_dir(directory).map_err(OutputError::io("read", directory))?;
    for entry in entries {
        let entry = entry.map_err(OutputError::io("read", directory))?;
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        let numbered = name.strip_prefix("particles_").and_then(|rest| rest.strip_suffix(".vtu"));
        let snapshot = numbered.is_some_and(|number| number.len() >= 6 && number.bytes().all(|b| b.is_ascii_digit()));
        if snapshot || ["reactions.csv", "probes.csv", "newton.jsonl", "report.json", SERIES].contains(&name) {
            std::fs::remove_file(entry.path()).map_err(OutputError::io("remove", &entry.path()))?;
        }
    }
    Ok(())
}
