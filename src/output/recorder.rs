//! The recorder, which writes all files of a run.

use super::csv::{Row, Table};
use super::earlier::remove_later_files;
use super::files::Stream;
use super::history::{self, Cost, Energies};
use super::losses::Cause;
use super::mark::Mark;
use super::path::Point;
use super::probes::{self, Probe};
use super::progress::{Audience, Progress};
use super::report::{self, Counts, Outcome, Seconds};
use super::snapshots::Snapshots;
use super::touched;
use super::warnings::Watched;
use super::{OutputError, Reference, Summary};
use crate::approximation::ShapeFunction;
use crate::clock::Clock;
use crate::field::Field;
use crate::material::Law;
use crate::mechanics::loads::Reaction;
use crate::simulation::{ContactForces, Simulation, StepReport, Sums};
use crate::tensor::Vector;
use serde_json::{Map, Value};
use std::collections::BTreeMap;
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
    /// The tables of this run, by the names of their files.
    tables: BTreeMap<&'static str, Table>,
    probes: Vec<Probe<D>>,
    snapshots: Option<Snapshots<D>>,
    newton: Stream,
    progress: Progress,
    /// The warnings, counts and seconds so far; the total of the seconds counts the time before `since`. Ends of files are those of the last
    /// mark.
    so_far: Mark,
    since: Instant,
    /// The sums over all particles after the last step that was recorded.
    sums: Sums<D>,
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
    /// # Errors
    /// The errors of [`Self::start`] and those of a mark that does not fit the files.
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
        let so_far = mark.cloned().unwrap_or_else(|| {
            let particles = simulation.particles.solid_places().len();
            Mark { counts: Counts { particles, ..Counts::default() }, ..Mark::default() }
        });
        // A file that is not in the mark is created anew.
        let kept = |name: &str| so_far.files.get(name).copied();
        let loads = &simulation.loads;
        let no_reactions = vec![Reaction::NONE; loads.prescribed.len()];
        let untouched = vec![ContactForces::NONE; loads.contacts.obstacles.len()];
        // Only the names of the columns are needed here.
        let rows = [
            ("history.csv", true, history::row(simulation, &Energies::default(), &Vector::zeros(), Cost::default())),
            ("reactions.csv", !no_reactions.is_empty(), history::reactions(0.0, loads, &no_reactions)),
            ("obstacles.csv", !untouched.is_empty(), history::obstacles(0.0, loads, &untouched)),
            ("contacts.csv", loads.contacts.between.is_some(), history::pair(0.0, [""; 2], &ContactForces::<D>::NONE)),
            ("probes.csv", !probes.is_empty(), probes::row(&probes, simulation, &reference)?),
        ];
        let mut tables = BTreeMap::new();
        for (name, _, row) in rows.iter().filter(|(_, is_written, _)| *is_written) {
            tables.insert(*name, Table::open(directory.join(name), row, kept(name))?);
        }
        let written = so_far.snapshots.unwrap_or_default();
        let snapshots = snapshot_every
            .map(|every| Snapshots::new(directory.clone(), &fields, simulation, &reference, every, written))
            .transpose()?;
        Ok(Self {
            tables,
            probes,
            snapshots,
            newton: Stream::open(directory.join("newton.jsonl"), kept("newton.jsonl"))?,
            progress: Progress::new(simulation.clock.time(), end_time, audience),
            so_far,
            since: Instant::now(),
            sums: simulation.sums_here(),
            marked: mark.is_some(),
            reference,
            directory,
        })
    }

    /// Syncs all files to disk and returns their ends, from which [`Self::resume`] continues. After a mark, `newton.jsonl` is kept when the
    /// run ends.
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn mark(&mut self) -> Result<Mark, OutputError> {
        self.marked = true;
        self.so_far.files = self.streams().map(Stream::mark).collect::<Result<_, _>>()?;
        self.so_far.snapshots = self.snapshots.as_ref().map(|snapshots| snapshots.mark);
        Ok(Mark { seconds: self.seconds_so_far(), ..self.so_far.clone() })
    }

    /// Adds the seconds in which the simulation was built, before the recorder started.
    pub(crate) fn count_set_up(&mut self, seconds: f64) {
        self.so_far.seconds.set_up += seconds;
        self.so_far.seconds.total += seconds;
    }

    fn seconds_so_far(&self) -> Seconds {
        Seconds { total: self.so_far.seconds.total + self.since.elapsed().as_secs_f64(), ..self.so_far.seconds }
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
        self.record_with(simulation, step, &simulation.sums_here())
    }

    /// Whether [`Self::record_with`] needs the state of all particles in this process.
    pub(crate) fn needs_particles(&self, clock: &Clock) -> bool {
        let is_due = |snapshots: &Snapshots<D>| snapshots.need_particles() && snapshots.is_next(clock);
        self.snapshots.as_ref().is_some_and(is_due)
    }

    /// Whether [`Self::finish`] needs the state of all particles in this process.
    pub(crate) fn needs_particles_at_end(&self) -> bool {
        self.snapshots.as_ref().is_some_and(Snapshots::need_particles)
    }

    /// [`Self::record`] of a step whose sums over all particles are known.
    pub(crate) fn record_with<L: Law, A: ShapeFunction>(
        &mut self,
        simulation: &Simulation<D, L, A>,
        step: &StepReport<D>,
        sums: &Sums<D>,
    ) -> Result<(), OutputError> {
        let started = Instant::now();
        let (time, number) = (simulation.clock.time(), simulation.clock.steps());
        let settings = &simulation.settings;
        self.so_far.counts.add(step);
        self.so_far.seconds.add(step);
        let line = report::newton_line(time, step).map_err(std::io::Error::from);
        self.newton.line(&line.map_err(OutputError::io("write", &self.newton.path))?)?;
        self.write("reactions.csv", &history::reactions(time, &simulation.loads, &step.reactions))?;
        self.write("obstacles.csv", &history::obstacles(time, &simulation.loads, &step.obstacles))?;
        for (names, contact) in pairs(simulation).zip(&step.pairs) {
            // The step in which a pair parts has a row, too, so that its force ends at zero.
            if contact.area > 0.0 || touched::touched_last(&self.so_far.touched_pairs, &names.join(" and ")) {
                self.write("contacts.csv", &history::pair(time, names, contact))?;
            }
        }
        let newton = &step.newton.history;
        let (iterations, krylov) = (newton.iterations.len(), newton.counts.krylov_iterations);
        let cost = Cost { dt: step.dt, newton: iterations, krylov, yielding: step.yielding };
        self.sums = *sums;
        let energies = self.write_state(simulation, cost)?;
        let attempts = || step.failed.iter().map(|attempt| &attempt.newton).chain([newton]);
        let seen = Watched {
            time,
            step: number,
            settings,
            energies,
            cause: Cause::of(step.touches(), step.feels_wall, !step.shared_nodes.is_empty(), step.reset),
            cost,
            failed: step.failed.iter().filter(|attempt| !attempt.inaccurate).count(),
            error: step.error,
            limited: attempts().map(|one| one.counts.krylov_limited).sum(),
            stagnated: attempts().map(|one| one.counts.krylov_stagnated).sum(),
        };
        let known = self.so_far.watch.warnings.len();
        self.so_far.watch.see(&seen);
        self.see_contacts(&seen, simulation, step);
        if settings.scheme.follows_path() {
            self.so_far.watch.see_path(&seen, Point::of(simulation, &self.reference), step.cosine);
        }
        self.so_far.watch.warnings[known..].iter().for_each(|warning| self.progress.warn(warning));
        self.progress.show(time, number, &cost, settings.scheme.has_inertia().then_some(energies.balance));
        self.so_far.seconds.output += started.elapsed().as_secs_f64();
        Ok(())
    }

    /// Examines contact with obstacles and between bodies.
    fn see_contacts<L: Law, A: ShapeFunction>(
        &mut self,
        seen: &Watched<'_>,
        simulation: &Simulation<D, L, A>,
        step: &StepReport<D>,
    ) {
        let time = seen.time;
        let contacts = &simulation.loads.contacts;
        let obstacles = contacts.obstacles.iter().map(|obstacle| obstacle.name.clone());
        touched::see(&mut self.so_far.touched, time, obstacles, &step.obstacles);
        let names = pairs(simulation).map(|names| names.join(" and "));
        touched::see(&mut self.so_far.touched_pairs, time, names, &step.pairs);
        for (obstacle, contact) in contacts.obstacles.iter().zip(&step.obstacles) {
            let place = format!("in the obstacle {:?}", obstacle.name);
            self.so_far.watch.see_depth(seen, &place, "obstacles[].stiffness", contact.depth / simulation.grid.spacing);
            if obstacle.has_left(&simulation.grid) {
                self.so_far.watch.see_gone(seen, &obstacle.name);
            }
        }
        for ([one, other], contact) in pairs(simulation).zip(&step.pairs) {
            let place = format!("in another one ({one:?}, {other:?})");
            self.so_far.watch.see_depth(seen, &place, "contact.stiffness", contact.depth / simulation.grid.spacing);
        }
        let names: Vec<&str> = simulation.bodies.iter().map(|body| body.name.as_str()).collect();
        self.so_far.watch.see_contact(seen, &step.shared_nodes, &names);
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
            self.so_far.counts.add_failed(&error.failed);
            self.so_far.seconds.add_failed(&error.failed);
        }
        if let Some(snapshots) = &mut self.snapshots {
            snapshots.write(simulation, &self.reference)?;
        }
        self.flush()?;
        let (time, known) = (simulation.clock.time(), self.so_far.watch.warnings.len());
        let has_inertia = simulation.settings.scheme.has_inertia();
        self.so_far.watch.end(time, self.so_far.counts.steps, has_inertia);
        self.so_far.watch.warnings[known..].iter().for_each(|warning| self.progress.warn(warning));
        let sums = if simulation.particles.are_all_here() { simulation.sums_here() } else { self.sums };
        let summary = Summary {
            time,
            mass: simulation.particles.mass.iter().sum(),
            has_inertia,
            energies: Energies::with(simulation, &self.reference, &sums),
            momentum_change: (sums.momentum - self.reference.momentum).norm(),
            momentum_scale: sums.momentum_scale,
            krylov: simulation.krylov().0,
            seconds: self.seconds_so_far(),
            contact: self.so_far.watch.contacts,
            obstacles: self.so_far.touched,
            pairs: self.so_far.touched_pairs,
            warnings: self.so_far.watch.warnings,
            counts: self.so_far.counts,
        };
        self.progress.finish();
        let log = &self.newton.path;
        report::write(&self.directory.join("report.json"), log, asked, outcome, &summary)?;
        if !self.marked {
            std::fs::remove_file(log).map_err(OutputError::io("remove", log))?;
        }
        Ok(summary)
    }

    fn write_state<L: Law, A: ShapeFunction>(
        &mut self,
        simulation: &Simulation<D, L, A>,
        cost: Cost,
    ) -> Result<Energies, OutputError> {
        let energies = Energies::with(simulation, &self.reference, &self.sums);
        self.write("history.csv", &history::row(simulation, &energies, &self.sums.momentum, cost))?;
        self.write("probes.csv", &probes::row(&self.probes, simulation, &self.reference)?)?;
        if let Some(snapshots) = &mut self.snapshots
            && snapshots.is_due(&simulation.clock)
        {
            snapshots.write(simulation, &self.reference)?;
        }
        Ok(energies)
    }

    /// Appends a row to a table, if the run has this table.
    fn write(&mut self, table: &str, row: &Row) -> Result<(), OutputError> {
        self.tables.get_mut(table).map_or(Ok(()), |table| table.write(row))
    }

    fn flush(&mut self) -> Result<(), OutputError> {
        self.streams().try_for_each(Stream::flush)
    }

    /// All files that grow line by line.
    fn streams(&mut self) -> impl Iterator<Item = &mut Stream> {
        std::iter::once(&mut self.newton).chain(self.tables.values_mut().map(|table| &mut table.0))
    }
}

/// The names of all pairs of bodies that may touch.
fn pairs<const D: usize, L: Law, A>(simulation: &Simulation<D, L, A>) -> impl Iterator<Item = [&str; 2]> {
    let pairs = simulation.loads.contacts.between.iter().flat_map(|between| &between.pairs);
    pairs.map(|pair| pair.bodies.map(|body| simulation.bodies[body as usize].name.as_str()))
}
