//! The recorder, which writes all files of a run.

use super::earlier::remove_later_files;
use super::files::Stream;
use super::history::{Cost, Energies, History};
use super::losses::Cause;
use super::mark::Mark;
use super::probes::{Probe, Probes};
use super::progress::{Audience, Progress, Shown};
use super::reactions::Reactions;
use super::report::{Counts, NewtonLog, Outcome, Report, Seconds};
use super::snapshots::Snapshots;
use super::warnings::{Watch, Watched};
use super::{OutputError, Reference, Summary};
use crate::approximation::ShapeFunction;
use crate::field::Field;
use crate::material::Law;
use crate::simulation::{Simulation, StepReport};
use serde_json::{Map, Value};
use std::path::PathBuf;
use std::time::Instant;

/// Contents and directory of the output.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputSettings<const D: usize> {
    /// The directory. If it is missing, it is created. Files of an earlier run in the directory are replaced.
    pub directory: PathBuf,
    /// Fields of the snapshots.
    pub fields: Vec<Field>,
    /// Time between snapshots, > 0. Snapshots are written of the first state, of every state that reaches a multiple of this time, and of
    /// the last state. With `None`, there are no snapshots.
    pub snapshot_every: Option<f64>,
    /// Fields at particles or points, written in every step.
    pub probes: Vec<Probe<D>>,
    /// Time at which the run will end, for the progress bar.
    pub end_time: f64,
    /// The reader of the progress.
    pub audience: Audience,
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
    watch: Watch,
    counts: Counts,
    /// Seconds of all steps. The total counts the time before `since`.
    seconds: Seconds,
    since: Instant,
    /// Whether a run may resume from a mark.
    marked: bool,
}

impl<const D: usize> Recorder<D> {
    /// Creates the directory and the files, and writes the state before the first step.
    ///
    /// # Errors
    /// The operating system refuses. A probe names a particle that does not exist. Two columns have the same name. The time between
    /// snapshots is not positive. The reference has another number of particles.
    pub fn start<L: Law, A: ShapeFunction>(
        settings: OutputSettings<D>,
        simulation: &Simulation<D, L, A>,
        reference: Reference<D>,
    ) -> Result<Self, OutputError> {
        let mut recorder = Self::open(settings, simulation, reference, None)?;
        recorder.write_state(simulation, Cost::default())?;
        recorder.flush()?;
        Ok(recorder)
    }

    /// Continues the files of a run from `mark`. The simulation must be in its state at the mark. `reference` must belong to the start of
    /// the run. Rows written after the mark are cut off.
    ///
    /// Example: [`Mark`].
    ///
    /// # Errors
    /// The errors of [`Self::start`] and of [`Mark::check`].
    pub fn resume<L: Law, A: ShapeFunction>(
        settings: OutputSettings<D>,
        simulation: &Simulation<D, L, A>,
        reference: Reference<D>,
        mark: &Mark,
    ) -> Result<Self, OutputError> {
        mark.check(&settings.directory)?;
        Self::open(settings, simulation, reference, Some(mark))
    }

    fn open<L: Law, A: ShapeFunction>(
        settings: OutputSettings<D>,
        simulation: &Simulation<D, L, A>,
        reference: Reference<D>,
        mark: Option<&Mark>,
    ) -> Result<Self, OutputError> {
        reference.check(simulation)?;
        let OutputSettings { directory, fields, snapshot_every, probes, end_time, audience } = settings;
        std::fs::create_dir_all(&directory).map_err(OutputError::io("create", &directory))?;
        remove_later_files(&directory, mark)?;
        let at = |name: &str| directory.join(name);
        // A file that is not in the mark is created anew.
        let kept = |name: &str| mark.and_then(|mark| mark.files.get(name).copied());
        let loads = &simulation.loads;
        let snapshots = mark.and_then(|mark| mark.snapshots).unwrap_or_default();
        let begun = Counts { particles: simulation.particles.solid_places().len(), ..Counts::default() };
        Ok(Self {
            history: History::open(at("history.csv"), simulation, kept("history.csv"))?,
            reactions: (!loads.prescribed.is_empty())
                .then(|| Reactions::open(at("reactions.csv"), loads, kept("reactions.csv")))
                .transpose()?,
            probes: (!probes.is_empty())
                .then(|| Probes::open(at("probes.csv"), probes, kept("probes.csv")))
                .transpose()?,
            snapshots: snapshot_every
                .map(|every| Snapshots::new(directory.clone(), &fields, every, snapshots))
                .transpose()?,
            newton: NewtonLog::open(at("newton.jsonl"), kept("newton.jsonl"))?,
            progress: Progress::new(simulation.clock.time(), end_time, audience),
            watch: mark.map_or_else(Watch::default, |mark| mark.watch.clone()),
            counts: mark.map_or(begun, |mark| mark.counts),
            seconds: mark.map_or_else(Seconds::default, |mark| mark.seconds),
            since: Instant::now(),
            marked: mark.is_some(),
            reference,
            directory,
        })
    }

    /// Syncs all files to disk and returns their ends, from which [`Self::resume`] continues. After a mark, `newton.jsonl` is kept when the
    /// run ends.
    ///
    /// Example: [`Mark`].
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn mark(&mut self) -> Result<Mark, OutputError> {
        self.marked = true;
        let files = self.streams().map(Stream::mark).collect::<Result<_, _>>()?;
        let snapshots = self.snapshots.as_ref().map(Snapshots::mark);
        let (watch, counts, seconds) = (self.watch.clone(), self.counts, self.seconds_so_far());
        Ok(Mark { files, snapshots, watch, counts, seconds })
    }

    /// Adds the seconds in which the simulation was built, before the recorder started.
    pub fn count_set_up(&mut self, seconds: f64) {
        self.seconds.set_up += seconds;
        self.seconds.total += seconds;
    }

    fn seconds_so_far(&self) -> Seconds {
        Seconds { total: self.seconds.total + self.since.elapsed().as_secs_f64(), ..self.seconds }
    }

    /// Records a successful step.
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn record<L: Law, A: ShapeFunction>(
        &mut self,
        simulation: &Simulation<D, L, A>,
        step: &StepReport<D>,
    ) -> Result<(), OutputError> {
        self.counts.add(step);
        self.seconds.add(step);
        self.newton.write(simulation.clock.time(), step)?;
        if let Some(reactions) = &mut self.reactions {
            reactions.write(simulation.clock.time(), &simulation.loads, step)?;
        }
        let newton = &step.newton.history;
        let (iterations, krylov) = (newton.iterations.len(), newton.counts.krylov_iterations);
        let cost = Cost { dt: step.dt, newton: iterations, krylov, yielding: step.yielding };
        let energies = self.write_state(simulation, cost)?;
        let (time, number) = (simulation.clock.time(), simulation.clock.steps());
        let newton_limit = simulation.settings.newton.max_iterations;
        let failed = step.failed.iter().filter(|attempt| !attempt.inaccurate).count();
        let error = step.error.zip(simulation.settings.error_tolerance);
        let attempts = step.failed.iter().map(|attempt| &attempt.newton).chain([newton]);
        let [limited, stagnated] = attempts.fold([0, 0], |[limited, stagnated], one| {
            [limited + one.counts.krylov_limited, stagnated + one.counts.krylov_stagnated]
        });
        let krylov_limit = simulation.settings.newton.max_krylov_iterations;
        let has_inertia = simulation.settings.scheme.has_inertia();
        let seen = Watched {
            time,
            step: number,
            energies,
            has_inertia,
            cause: Cause::of(step.feels_wall, !step.sharing.is_empty(), step.reset),
            lumped: simulation.settings.lumping >= 1.0,
            cost,
            failed,
            error,
            newton_limit,
            limited,
            stagnated,
            krylov_limit,
        };
        self.watch.see(&seen).iter().for_each(|warning| self.progress.warn(warning));
        let names: Vec<&str> = simulation.bodies.iter().map(|body| body.name.as_str()).collect();
        self.watch.see_contact(&seen, &step.sharing, &names).iter().for_each(|warning| self.progress.warn(warning));
        if simulation.settings.scheme.follows_path() {
            let found = self.watch.see_path(&seen, simulation, &self.reference, step.straight);
            found.iter().for_each(|warning| self.progress.warn(warning));
        }
        let Cost { newton, krylov, .. } = cost;
        self.progress
            .show(time, Shown { step: number, newton, krylov, balance: has_inertia.then_some(energies.balance) });
        Ok(())
    }

    /// Writes the last snapshot and the report. The report includes the entries `asked` of the caller, such as the scene and the command
    /// line.
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn finish<L: Law, A: ShapeFunction>(
        mut self,
        simulation: &Simulation<D, L, A>,
        asked: &Map<String, Value>,
        outcome: Outcome<'_>,
    ) -> Result<Summary, OutputError> {
        if let Outcome::Failed(error) = outcome {
            self.counts.add_failed(&error.failed);
            self.seconds.add_failed(&error.failed);
        }
        if let Some(snapshots) = &mut self.snapshots {
            snapshots.write(simulation, &self.reference)?;
        }
        self.flush()?;
        let (counts, time, seconds) = (self.counts, simulation.clock.time(), self.seconds_so_far());
        self.watch.end(time, counts.steps).into_iter().for_each(|warning| self.progress.warn(warning));
        self.progress.finish();
        let energies = Energies::of(simulation, &self.reference);
        let particles = &simulation.particles;
        let mass = particles.mass.iter().sum();
        let (warnings, contact) = (self.watch.warnings(), self.watch.contacts());
        let report = Report { asked, outcome, time, mass, energies, counts, seconds, warnings, contact };
        report.write(&self.directory.join("report.json"), self.newton, self.marked)?;
        Ok(Summary {
            time,
            has_inertia: simulation.settings.scheme.has_inertia(),
            energies,
            momentum_change: (particles.momentum() - self.reference.momentum).norm(),
            krylov: simulation.krylov().0,
            contact: self.watch.contacts().to_vec(),
            warnings: self.watch.warnings().to_vec(),
            momentum_scale: particles.mass.iter().zip(&particles.velocity).fold(0.0, |sum, (m, v)| sum + m * v.norm()),
            counts,
            seconds,
        })
    }

    fn write_state<L: Law, A: ShapeFunction>(
        &mut self,
        simulation: &Simulation<D, L, A>,
        cost: Cost,
    ) -> Result<Energies, OutputError> {
        let energies = self.history.write(simulation, &self.reference, cost)?;
        if let Some(probes) = &mut self.probes {
            probes.write(simulation, &self.reference)?;
        }
        if let Some(snapshots) = &mut self.snapshots {
            snapshots.write_if_due(simulation, &self.reference)?;
        }
        Ok(energies)
    }

    fn flush(&mut self) -> Result<(), OutputError> {
        self.streams().try_for_each(Stream::flush)
    }

    /// All files that grow line by line.
    fn streams(&mut self) -> impl Iterator<Item = &mut Stream> {
        let reactions = self.reactions.as_mut().map(|reactions| &mut reactions.0.0);
        let probes = self.probes.as_mut().map(|probes| &mut probes.table.0);
        [&mut self.history.table.0, &mut self.newton.0].into_iter().chain(reactions).chain(probes)
    }
}
