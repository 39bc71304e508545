//! `bfree run`.

use super::agreement::{agreed, check_likeness, check_start};
use super::directory;
use super::failure::{Failure, INTERRUPTED, print, tell};
use super::options::{number, whole};
use super::probes::{Bound, bound_probes};
use super::provenance::{Command, Provenance};
use super::scene_arguments::{SceneArguments, what_accuracy_sets};
use super::steps::{Records, Schedule, Steps};
use crate::checkpoint::{self, Checkpoints, Identity, Restored};
use crate::memory;
use crate::output::plot::{Look, plot_run};
use crate::output::{Asked, Audience, Outcome, OutputSettings, Recorder, Reference, Summary, unique};
use crate::parallel::{self, Processes};
use crate::plan::SurfaceUse;
use crate::scene::{Scene, time::MAX_STEPS};
use crate::simulation::{AdvanceError, Simulation};
use crate::solver::Stop;
use clap::{Args, ValueEnum};
use serde_json::{Map, Value, json};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;
use std::cell::OnceCell;
use std::ffi::OsStr;
use std::fs::File;
use std::num::NonZeroU64;
use std::path::{self, Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// `bfree run`.
#[derive(Args, Default)]
pub(super) struct Run {
    #[command(flatten)]
    scene: SceneArguments,
    /// Directory of the results [default: out/ and the scene's name].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// End at this time instead of time.end of the scene. The same values are allowed. If the end lies between whole steps, the last step
    /// is shortened. The last checkpoint is written before the shortened step, so a restart continues without it.
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = number)]
    until: Option<f64>,
    /// Take at most this many whole time steps; 0 writes the initial state only.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole(0, MAX_STEPS as u64))]
    steps: Option<u64>,
    /// Threads, 1 to 1024 [default: all cores; one in each of several processes]. Results are bitwise identical for any number of threads.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole(1, parallel::MOST_THREADS))]
    threads: Option<u64>,
    /// Run Newton's method and the transfers on a GPU, an NVIDIA device of compute capability 8 or higher. Results are bitwise identical.
    #[arg(long)]
    gpu: bool,
    /// Compare the tangent with dual numbers every EVERY steps, and stop if they differ.
    #[arg(long, value_name = "EVERY", num_args = 0..=1, default_missing_value = "1", allow_negative_numbers = true,
          value_parser = whole(1, MAX_STEPS as u64))]
    check_tangent: Option<u64>,
    /// Continue a run that was killed or interrupted, in its directory, from its last good checkpoint.
    #[arg(long)]
    restart: bool,
    /// Start a new run in a directory that holds another run, and discard the other run.
    #[arg(long, conflicts_with = "restart")]
    discard: bool,
    /// Draw the results at the end, as `bfree plot` does.
    #[arg(long)]
    plot: bool,
    /// Show no progress and no summary. Warnings are still written.
    #[arg(long)]
    quiet: bool,
    /// Form of the progress on standard error: a bar or lines to read, or one JSON object per line for a program.
    #[arg(long, value_enum, default_value_t, conflicts_with = "quiet")]
    progress: Form,
    /// The number of processes, once they have started.
    #[arg(skip)]
    processes: OnceCell<usize>,
}

/// A run before its first step.
struct Prepared<const D: usize> {
    steps: Steps<D>,
    /// The entries of the report that are known.
    inputs: Map<String, Value>,
    /// The warnings about the scene, which have been told.
    warnings: Vec<String>,
    directory: PathBuf,
    /// Keeps the directory locked against other runs.
    _lock: Option<File>,
}

/// Form of the progress on standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Form {
    #[default]
    Text,
    Json,
}

/// The fields and probes for which process 0 may ask the others.
fn asked<const D: usize>(scene: &Scene, probes: &[Bound<D>]) -> Asked<D> {
    Asked { fields: unique(&scene.fields()), probes: probes.iter().map(|bound| bound.probe.clone()).collect() }
}

impl Run {
    /// Whether messages are written as JSON, for a program.
    pub(crate) fn tells_json(&self) -> bool {
        self.progress == Form::Json
    }

    /// Runs the scene, together with the other processes that a launcher of MPI has started.
    pub(crate) fn execute(&self) -> Result<(), Failure> {
        let start = Instant::now();
        let processes = Processes::launched().map_err(Failure::scene)?;
        if processes.count() > 1 {
            memory::give_arrays_back();
        }
        self.processes.get_or_init(|| processes.count());
        agreed(&processes, check_likeness(&processes))?;
        let scene = agreed(&processes, self.scene_of(&processes))?;
        in_dimensions!(scene.dimension(), D => self.execute_in::<D>(&scene, start, &processes))
    }

    /// Reads the scene, and sets the number of threads: by default one, if there are several processes.
    fn scene_of(&self, processes: &Processes) -> Result<Scene, Failure> {
        let mut scene = self.scene.read()?;
        if let Some(until) = self.until {
            // The end of the scene passed all checks, so every problem is one of the option.
            scene.time.end = until;
            let problems = scene.check();
            if !problems.is_empty() {
                return Err(Failure::scene(format!("--until: {problems}")));
            }
        }
        if self.gpu && processes.count() > 1 {
            return Err(Failure::scene("--gpu: several processes cannot use a GPU yet; start one process"));
        }
        if let Some(threads) = self.threads.or((processes.count() > 1).then_some(1)) {
            parallel::use_threads(threads as usize).map_err(Failure::run)?;
        }
        Ok(scene)
    }

    fn execute_in<const D: usize>(&self, scene: &Scene, start: Instant, processes: &Processes) -> Result<(), Failure> {
        let simulation = self.scene.build_among::<D>(scene, processes)?;
        let prepared = if processes.is_first() {
            self.prepared(simulation, scene, start)
        } else {
            self.prepared_without_records(simulation, scene)
        };
        memory::give_back();
        let Prepared { mut steps, inputs, warnings, directory, _lock } = agreed(processes, prepared)?;
        agreed(processes, check_start(processes, &steps.simulation))?;
        let (settings, asked_to_stop) = (&mut steps.simulation.settings, steps.interrupted.clone());
        let others = processes.clone();
        settings.stop = Some(Stop(Arc::new(move || others.any(asked_to_stop.load(Ordering::Relaxed)))));
        settings.processes = processes.clone();
        let ended = steps.take().map_err(|error| {
            let (time, place) = (steps.simulation.clock.time(), directory.display());
            if steps.records.is_some() {
                let text = format!("stopped at t = {time}; {place} holds what was written until then, and no report");
                self.say("stopped", &text);
            }
            Failure::Run(error)
        });
        let failure = agreed(processes, ended)?;
        agreed(processes, self.report(steps, failure, &inputs, &warnings, &directory))
    }

    /// A run before its first step, in a process that writes no results.
    fn prepared_without_records<const D: usize>(
        &self,
        mut simulation: Simulation<D>,
        scene: &Scene,
    ) -> Result<Prepared<D>, Failure> {
        let directory = directory::of_results(self.out.as_deref(), &self.scene.scene)?;
        let asked = asked(scene, &bound_probes(scene, &simulation));
        if self.restart {
            let settings = serde_json::to_value(scene).map_err(Failure::run)?;
            let identity = Identity::new(settings, &simulation.particles).with_files(scene.curve_files());
            checkpoint::restore(&directory, &identity, &mut simulation).map_err(Failure::scene)?;
        }
        simulation.settings.check_tangent = self.check_tangent.and_then(NonZeroU64::new);
        let schedule = Schedule::new(&simulation.clock, scene.time.end, self.steps);
        let interrupted = stop_on_interrupt().map_err(Failure::run)?;
        let steps = Steps { simulation, records: None, asked, schedule, interrupted };
        Ok(Prepared { steps, inputs: Map::new(), warnings: Vec::new(), directory, _lock: None })
    }

    /// A run before its first step, with its files.
    fn prepared<const D: usize>(
        &self,
        mut simulation: Simulation<D>,
        scene: &Scene,
        start: Instant,
    ) -> Result<Prepared<D>, Failure> {
        self.check_room(&mut simulation)?;
        simulation.settings.check_tangent = self.check_tangent.and_then(NonZeroU64::new);
        let directory = directory::of_results(self.out.as_deref(), &self.scene.scene)?;
        let probes = bound_probes(scene, &simulation);
        let asked = asked(scene, &probes);
        let (inputs, warnings) = self.inputs(scene, &simulation, &probes, &directory)?;
        let settings = serde_json::to_value(scene).map_err(Failure::run)?;
        let provenance = self.provenance(&directory, &settings)?;
        let identity = Identity::new(settings, &simulation.particles).with_files(scene.curve_files());
        let schedule = Schedule::new(&simulation.clock, scene.time.end, self.steps);
        let output = OutputSettings {
            directory: directory.clone(),
            fields: scene.fields(),
            snapshot_every: scene.output.every,
            probes: asked.probes.clone(),
            end_time: schedule.end_time(&simulation.clock),
            audience: match self.progress {
                _ if self.quiet => Audience::Nobody,
                Form::Text => Audience::Person,
                Form::Json => Audience::Program,
            },
        };
        let interrupted = stop_on_interrupt().map_err(Failure::run)?;
        let reference = Reference::of(&simulation);
        let lock = directory::lock(&directory, !self.restart)?;
        let restored = if self.restart {
            Some(self.restore(&directory, &identity, &mut simulation, scene.time.end)?)
        } else {
            directory::clear(&directory, self.discard)?;
            None
        };
        let set_up = start.elapsed().as_secs_f64();
        let mut recorder = match &restored {
            // Files that cannot be continued are left unchanged.
            Some(restored) => {
                Recorder::resume(output, &simulation, reference, &restored.mark).map_err(Failure::scene)?
            }
            None => Recorder::start(output, &simulation, reference).map_err(Failure::run)?,
        };
        recorder.count_set_up(set_up);
        let continued_from = restored.as_ref().and_then(|restored| restored.other_program.clone());
        Provenance { continued_from, ..provenance }.write(&directory)?;
        let checkpoints = scene.output.checkpoint.map(|every| {
            Checkpoints::new(directory.clone(), identity, self.options(&directory), every, restored.as_ref())
        });
        let records = Some(Records { recorder, checkpoints });
        let steps = Steps { simulation, records, asked, schedule, interrupted };
        Ok(Prepared { steps, inputs, warnings, directory, _lock: lock })
    }

    /// Checks that the arrays of the run have room, and takes the GPU if it is asked for.
    fn check_room<const D: usize>(&self, simulation: &mut Simulation<D>) -> Result<(), Failure> {
        self.scene.plan(simulation)?;
        if self.gpu { self.scene.plan_on_gpu(simulation).map(drop) } else { Ok(()) }
    }

    /// The entries of the report that are known before the first step, and the warnings about the scene. Tells them, too.
    fn inputs<const D: usize>(
        &self,
        scene: &Scene,
        simulation: &Simulation<D>,
        probes: &[Bound<D>],
        directory: &Path,
    ) -> Result<(Map<String, Value>, Vec<String>), Failure> {
        if let Some(set) = what_accuracy_sets(scene).filter(|_| !self.quiet) {
            self.say("accuracy", &format!("accuracy {set}"));
        }
        let warnings = scene.warnings(simulation);
        for text in probes.iter().filter_map(Bound::warning).chain(warnings.iter().cloned()) {
            self.say("warning", &text);
        }
        let (krylov, why_krylov) = simulation.krylov();
        let (preconditioner, why_preconditioner) = simulation.preconditioner();
        let mut inputs = Map::from_iter([
            ("command".to_owned(), self.options(directory)),
            ("settings".to_owned(), serde_json::to_value(scene).map_err(Failure::run)?),
            ("krylov".to_owned(), json!({ "method": krylov.to_string(), "why": why_krylov })),
            ("preconditioner".to_owned(), json!({ "method": preconditioner.to_string(), "why": why_preconditioner })),
            ("gpu".to_owned(), json!(simulation.settings.gpu.as_ref().map(|gpu| gpu.name()))),
            ("scene_warnings".to_owned(), json!(warnings)),
            ("probes".to_owned(), probes.iter().map(Bound::report).collect()),
            ("surfaces".to_owned(), serde_json::to_value(SurfaceUse::of(simulation)).map_err(Failure::run)?),
        ]);
        if let Some(accuracy) = scene.accuracy {
            inputs.insert("accuracy".to_owned(), json!({ "asked": accuracy, "sets": scene.chosen }));
        }
        Ok((inputs, warnings))
    }

    /// Writes the report, the summary and the pictures of a run, and says how the run ended.
    fn report<const D: usize>(
        &self,
        steps: Steps<D>,
        failure: Option<AdvanceError>,
        inputs: &Map<String, Value>,
        warnings: &[String],
        directory: &Path,
    ) -> Result<(), Failure> {
        let is_interrupted = failure.is_none() && steps.schedule.is_left(&steps.simulation.clock);
        let outcome = match &failure {
            Some(error) => Outcome::Failed(error),
            None if is_interrupted => Outcome::Interrupted,
            None => Outcome::Finished,
        };
        let (place, is_first) = (directory.display(), steps.records.is_some());
        let say = |text: &str| {
            if is_first {
                self.say("stopped", text)
            }
        };
        let summary = steps.records.map(|records| records.recorder.finish(&steps.simulation, inputs, outcome));
        steps.asked.end_or_answer(&steps.simulation);
        if let Some(summary) = summary {
            self.show(&summary.map_err(Failure::run)?, warnings, directory)?;
        }
        let time = steps.simulation.clock.time();
        if let Some(error) = failure {
            say(&format!("stopped at t = {time} after the last good step; its state is in {place}"));
            return Err(Failure::run(error));
        }
        if is_interrupted {
            say(&format!("interrupted at t = {time} after a whole step; everything up to it is in {place}"));
            return Err(Failure::Interrupted);
        }
        Ok(())
    }

    /// Prints the summary, and draws the pictures that are asked for.
    fn show(&self, summary: &Summary, warnings: &[String], directory: &Path) -> Result<(), Failure> {
        let place = directory.display();
        if !self.quiet {
            let told = match warnings.len() + summary.warnings.len() {
                0 => String::new(),
                count => format!("\nwarnings  {count}, told above and kept in report.json"),
            };
            print(format_args!("{summary}{told}\nresults   {place}"))?;
        }
        if self.plot {
            let drawn = plot_run(directory, &Look::default()).map_err(Failure::run)?;
            if let (false, Some(page)) = (self.quiet, drawn.last()) {
                print(format_args!("pictures  {}", page.display()))?;
            }
        }
        Ok(())
    }

    /// Restores the simulation from the last good checkpoint, and reports the checkpoint.
    fn restore<const D: usize>(
        &self,
        directory: &Path,
        identity: &Identity,
        simulation: &mut Simulation<D>,
        end: f64,
    ) -> Result<Restored, Failure> {
        let restored = checkpoint::restore(directory, identity, simulation).map_err(Failure::scene)?;
        let time = simulation.clock.time();
        if simulation.clock.nominal_steps() > simulation.clock.whole_steps(end) {
            let path = restored.path.display();
            let what = format!("{path} is at t = {time}, beyond the end, t = {end}: give a later time.end or --until");
            return Err(Failure::scene(what));
        }
        let unusable = restored.unusable.iter().map(|one| format!("a checkpoint cannot be used: {one}"));
        let missing: Vec<_> = restored.missing.iter().map(|path| path.display().to_string()).collect();
        let missing = (!missing.is_empty()).then(|| {
            let text = "these snapshots of the run are not there any more, and its pictures leave them out";
            format!("{text}: {}", missing.join(", "))
        });
        let other = restored.other_program.as_ref();
        let other = other.map(|by| format!("the checkpoint was written by {by}: the bits may differ from then on"));
        for warning in unusable.chain(missing).chain(other) {
            self.say("warning", &warning);
        }
        if !self.quiet {
            let (step, path) = (simulation.clock.steps(), restored.path.display());
            self.say("restart", &format!("continues at t = {time}, step {step}, from {path}"));
        }
        Ok(restored)
    }

    /// Writes a message beside the progress, in the form of the progress.
    fn say(&self, event: &str, message: &str) {
        match self.progress {
            Form::Json => tell(json!({"event": event, "message": message})),
            Form::Text if event == "warning" => tell(format_args!("warning: {message}")),
            Form::Text => tell(message),
        }
    }

    /// The command line, for the report.
    fn options(&self, directory: &Path) -> Value {
        json!(self.command(directory))
    }

    fn command(&self, directory: &Path) -> Command {
        let absolute = |path: &PathBuf| path::absolute(path).unwrap_or_else(|_| path.clone()).display().to_string();
        Command {
            scene: self.scene.scene.display().to_string(),
            set: self.scene.overrides.clone(),
            allow_library: self.scene.libraries.iter().map(absolute).collect(),
            out: directory.display().to_string(),
            until: self.until,
            steps: self.steps,
            threads: parallel::threads() as u64,
            processes: self.processes.get().copied().unwrap_or(1),
            gpu: self.gpu,
            check_tangent: self.check_tangent,
        }
    }

    fn provenance(&self, directory: &Path, settings: &Value) -> Result<Provenance, Failure> {
        let text = self.scene.text.get().map(String::as_str).unwrap_or_default();
        let made = Provenance::new(self.command(directory), self.scene.folder(), text, settings);
        made.map_err(Failure::system("find the folder of the scene"))
    }

    /// The run of a provenance again, with results in `out`. A file of results is data, so it allows no library.
    pub(super) fn again(provenance: &Provenance, out: &Path, libraries: &[PathBuf]) -> Self {
        let Provenance { command, folder, scene, .. } = provenance;
        let Command { set: overrides, until, steps, threads, gpu, check_tangent, .. } = command.clone();
        let name = Path::new(&command.scene).file_name().unwrap_or(OsStr::new("scene.json"));
        let scene = SceneArguments {
            scene: Path::new(folder).join(name),
            overrides,
            libraries: libraries.to_vec(),
            text: OnceCell::from(scene.clone()),
        };
        let (out, threads) = (Some(out.to_owned()), Some(threads));
        Self { scene, out, until, steps, threads, gpu, check_tangent, quiet: true, ..Self::default() }
    }
}

/// A flag that is set by Ctrl-C and by the signals of batch systems. The run then ends after a whole step. A second signal ends the program
/// at once.
fn stop_on_interrupt() -> std::io::Result<Arc<AtomicBool>> {
    let interrupted = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        flag::register_conditional_shutdown(signal, i32::from(INTERRUPTED), Arc::clone(&interrupted))?;
        flag::register(signal, Arc::clone(&interrupted))?;
    }
    // With SIGXFSZ caught, a limit on the size of files is a write error. Otherwise it would end the program without a message.
    flag::register(SIGXFSZ, Arc::default())?;
    Ok(interrupted)
}
