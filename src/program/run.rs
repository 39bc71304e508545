//! `bfree run`.

use super::probes::{Bound, bound_probes};
use super::scene_arguments::{SceneArguments, what_accuracy_sets};
use super::{Failure, INTERRUPTED, print, tell};
use bfree::checkpoint::{self, Checkpoints, Identity, Restored, Unfinished};
use bfree::output::plot::{Look, plot_run};
use bfree::output::{Audience, Held, Outcome, OutputSettings, Recorder, Reference, foreign, held};
use bfree::parallel;
use bfree::plan::SurfaceUse;
use bfree::scene::{Scene, SceneError, time::MAX_STEPS};
use bfree::simulation::Simulation;
use bfree::solver::Stop;
use clap::{Args, ValueEnum};
use serde_json::{Map, Value, json};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;
use std::ffi::OsStr;
use std::fs::{File, TryLockError, create_dir_all};
use std::io::ErrorKind;
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// `bfree run`.
#[derive(Args)]
pub struct Run {
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
    /// Threads, 1 to 1024 [default: all cores]. Results are bitwise identical for any number of threads.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole(1, 1024))]
    threads: Option<u64>,
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
}

/// Parser of an option that takes a whole number from `min` to `max`.
fn whole(min: u64, max: u64) -> impl Fn(&str) -> Result<u64, String> + Clone {
    move |text| {
        let number = text.parse().ok().filter(|number| (min..=max).contains(number));
        number.ok_or_else(|| format!("must be a whole number from {min} to {max}"))
    }
}

/// Parser of an option that takes a number.
fn number(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| "must be a number".to_owned())
}

/// Form of the progress on standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Form {
    #[default]
    Text,
    Json,
}

/// The directory holds something that the run would replace.
#[derive(Debug, thiserror::Error)]
#[error("{} holds {why}write elsewhere by --out {}", directory.display(), free(directory).display())]
struct WouldBeLost {
    directory: PathBuf,
    why: Lost,
}

#[derive(Debug, thiserror::Error)]
enum Lost {
    #[error(
        "a run that did not end, with a checkpoint after step {} ({}): continue it by --restart, give it up by --discard, or ",
        .0.steps, .0.path.display()
    )]
    Unfinished(Unfinished),
    #[error("the results of a run that {}, {} steps until t = {}: give them up by --discard, or ", ended(.0), .0.steps, .0.time)]
    Results(Held),
    #[error("a run that another program is just writing: ")]
    Alive,
    #[error("{}, which no run wrote and a run would replace: move it, or ", .0.display())]
    Foreign(PathBuf),
}

/// Outcome of an earlier run, in words.
fn ended(held: &Held) -> String {
    held.outcome.clone().unwrap_or_else(|| "did not end and left no checkpoint that can be read".to_owned())
}

/// The first numbered path beside `directory` that does not exist.
fn free(directory: &Path) -> PathBuf {
    let numbered = |number: u32| {
        let mut name = directory.file_name().unwrap_or(OsStr::new("results")).to_owned();
        name.push(format!("-{number}"));
        directory.with_file_name(name)
    };
    (2..u32::MAX).map(numbered).find(|path| !path.exists()).unwrap_or_else(|| numbered(u32::MAX))
}

/// The name of the scene file gives no name for the directory of results.
#[derive(Debug, thiserror::Error)]
#[error("the name of the scene file {} gives no name for the directory of results: rename the file, or give --out DIR", .0.display())]
struct Nameless(PathBuf);

/// The checkpoint is later than the end of the run.
#[derive(Debug, thiserror::Error)]
#[error("{} is at t = {time}, beyond the end, t = {end}: give a later time.end or --until", path.display())]
struct Past {
    path: PathBuf,
    time: f64,
    end: f64,
}

/// The directory of the results cannot be created.
#[derive(Debug, thiserror::Error)]
#[error("cannot create the directory {}", directory.display())]
struct Unmade {
    directory: PathBuf,
    source: std::io::Error,
}

impl Run {
    /// Whether messages are written as JSON, for a program.
    pub fn tells_json(&self) -> bool {
        self.progress == Form::Json
    }

    /// Runs the scene.
    pub fn execute(&self) -> Result<(), Failure> {
        let start = Instant::now();
        let mut scene = self.scene.read()?;
        if let Some(until) = self.until {
            scene.time =
                scene.time.until(until, "--until").map_err(|wrong| Failure::scene(SceneError::Values(wrong)))?;
        }
        if let Some(threads) = self.threads {
            let threads = usize::try_from(threads).unwrap_or(usize::MAX);
            parallel::use_threads(threads).map_err(Failure::run)?;
        }
        match scene.dimension() {
            1 => self.execute_in::<1>(&scene, start),
            2 => self.execute_in::<2>(&scene, start),
            _ => self.execute_in::<3>(&scene, start),
        }
    }

    fn execute_in<const D: usize>(&self, scene: &Scene, start: Instant) -> Result<(), Failure> {
        let mut simulation = self.scene.build::<D>(scene)?;
        self.scene.plan(&simulation)?;
        simulation.settings.check_tangent = self.check_tangent.and_then(NonZeroU64::new);
        let end = scene.time.end;
        let until = simulation.clock.whole_steps(end);
        let mut last = self.steps.map_or(until, |steps| steps.min(until));
        // The shortened step counts as one more step than the whole steps `until`.
        let mut shortens = self.steps.is_none_or(|steps| steps > until);
        let directory = self.directory()?;
        if let Some(set) = what_accuracy_sets(scene).filter(|_| !self.quiet) {
            self.say("accuracy", &format!("accuracy {set}"));
        }
        let probes = bound_probes(scene, &simulation);
        probes.iter().filter_map(Bound::warning).for_each(|text| self.say("warning", &text));
        let warnings = scene.warnings(&simulation);
        warnings.iter().for_each(|text| self.say("warning", text));
        let settings = serde_json::to_value(scene).map_err(Failure::run)?;
        let identity = Identity::new(settings.clone(), &simulation.particles);
        let mut asked = Map::new();
        asked.insert("command".to_owned(), self.options(&directory));
        asked.insert("settings".to_owned(), settings);
        if let Some(accuracy) = scene.accuracy {
            let sets = serde_json::to_value(&scene.chosen).map_err(Failure::run)?;
            asked.insert("accuracy".to_owned(), json!({ "asked": accuracy, "sets": sets }));
        }
        let (method, why) = simulation.krylov();
        asked.insert("krylov".to_owned(), json!({ "method": method.to_string(), "why": why }));
        let (preconditioner, why) = simulation.preconditioner();
        asked.insert("preconditioner".to_owned(), json!({ "method": preconditioner.to_string(), "why": why }));
        asked.insert("scene_warnings".to_owned(), json!(warnings));
        asked.insert("probes".to_owned(), probes.iter().map(Bound::report).collect());
        asked.insert("surfaces".to_owned(), serde_json::to_value(SurfaceUse::of(&simulation)).map_err(Failure::run)?);
        let output = OutputSettings {
            directory: directory.clone(),
            fields: scene.fields(),
            snapshot_every: scene.output.every,
            probes: probes.iter().map(|bound| bound.probe.clone()).collect(),
            end_time: if shortens { end } else { last as f64 * simulation.clock.nominal() },
            audience: self.audience(),
        };
        let interrupted = stop_on_interrupt().map_err(Failure::run)?;
        let asked_to_stop = interrupted.clone();
        simulation.settings.stop = Some(Stop(Arc::new(move || asked_to_stop.load(Ordering::Relaxed))));
        let reference = Reference::of(&simulation);
        let _claim = self.claim(&directory)?;
        let restored = match self.restart {
            true => Some(self.restore(&directory, &identity, &mut simulation, end)?),
            false => self.begin(&directory).map(|()| None)?,
        };
        let set_up = start.elapsed().as_secs_f64();
        let mut recorder = match &restored {
            // Files that cannot be continued are left as they are.
            Some(restored) => {
                Recorder::resume(output, &simulation, reference, &restored.mark).map_err(Failure::scene)?
            }
            None => Recorder::start(output, &simulation, reference).map_err(Failure::run)?,
        };
        recorder.count_set_up(set_up);
        let mut checkpoints = scene.output.checkpoint.map(|every| {
            Checkpoints::new(directory.clone(), identity, self.options(&directory), every, restored.as_ref())
        });
        let mut failure = None;
        let unwritten = |time: f64| {
            let place = directory.display();
            let text = format!("stopped at t = {time}; {place} holds what was written until then, and no report");
            self.say("stopped", &text);
        };
        loop {
            let time = simulation.clock.time();
            if let Some(checkpoints) = &mut checkpoints {
                let due = checkpoints.write_if_due(&simulation, &mut recorder);
                due.inspect_err(|_| unwritten(time)).map_err(Failure::run)?;
            }
            let interrupted = interrupted.load(Ordering::Relaxed);
            if simulation.clock.nominal_steps() >= last || interrupted {
                // This checkpoint precedes the last snapshot and a shortened step: a longer run has neither of them here.
                if let Some(mut checkpoints) = checkpoints.take() {
                    let written = checkpoints.write(&simulation, &mut recorder);
                    written.inspect_err(|_| unwritten(time)).map_err(Failure::run)?;
                }
                let rest = simulation.clock.to(end).filter(|_| shortens && !interrupted);
                let Some(rest) = rest else { break };
                (simulation.clock, last, shortens) = (rest, 1, false);
            }
            match simulation.advance() {
                Ok(step) => {
                    let recorded = recorder.record(&simulation, &step);
                    recorded.inspect_err(|_| unwritten(simulation.clock.time())).map_err(Failure::run)?;
                }
                // The next round of the loop handles the interruption.
                Err(error) if error.cause.is_stopped() => {}
                Err(error) => {
                    failure = Some(error);
                    break;
                }
            }
        }
        let stopped = simulation.clock.nominal_steps() < last || shortens && simulation.clock.to(end).is_some();
        let outcome = match &failure {
            Some(error) => Outcome::Failed(error),
            None if stopped => Outcome::Interrupted,
            None => Outcome::Finished,
        };
        let summary = recorder.finish(&simulation, &asked, outcome).map_err(Failure::run)?;
        if !self.quiet {
            let again: String = warnings.iter().map(|text| format!("\nwarned    {text}")).collect();
            print(format_args!("{summary}{again}\nresults   {}", directory.display()))?;
        }
        if self.plot {
            let drawn = plot_run(&directory, &Look::default()).map_err(Failure::run)?;
            if let (false, Some(page)) = (self.quiet, drawn.last()) {
                print(format_args!("pictures  {}", page.display()))?;
            }
        }
        let (time, place) = (simulation.clock.time(), directory.display());
        match failure {
            Some(error) => {
                self.say(
                    "stopped",
                    &format!("stopped at t = {time} after the last good step; its state is in {place}"),
                );
                Err(Failure::run(error))
            }
            None if stopped => {
                let text = format!("interrupted at t = {time} after a whole step; everything up to it is in {place}");
                self.say("stopped", &text);
                Err(Failure::Interrupted)
            }
            None => Ok(()),
        }
    }

    /// The directory of the results.
    fn directory(&self) -> Result<PathBuf, Failure> {
        let scene = &self.scene.scene;
        let stem = scene.file_stem().unwrap_or_default().to_string_lossy();
        // The stem `..` would give `out/..`, the working directory.
        let nameless = stem.chars().all(|letter| letter == '.') || stem == ".json";
        match &self.out {
            Some(out) => Ok(out.clone()),
            None if nameless => Err(Failure::scene(Nameless(scene.clone()))),
            None => Ok(Path::new("out").join(scene.file_stem().unwrap_or_default())),
        }
    }

    /// Prepares the directory for a new run. Results of an earlier run are discarded only with `--discard`.
    fn begin(&self, directory: &Path) -> Result<(), Failure> {
        let lost = |why| Err(Failure::scene(WouldBeLost { directory: directory.to_owned(), why }));
        if let Some(path) = foreign(directory) {
            return lost(Lost::Foreign(path));
        }
        match checkpoint::unfinished(directory) {
            Some(found) if !self.discard => lost(Lost::Unfinished(found)),
            _ => match held(directory) {
                Some(found) if !self.discard => lost(Lost::Results(found)),
                _ => checkpoint::forget(directory).map_err(Failure::run),
            },
        }
    }

    /// Locks the directory against other runs until the returned handle is dropped. A file system without locks locks nothing.
    fn claim(&self, directory: &Path) -> Result<Option<File>, Failure> {
        if !self.restart {
            let not_there = directory.exists() && !directory.is_dir();
            let made = if not_there { Err(ErrorKind::NotADirectory.into()) } else { create_dir_all(directory) };
            made.map_err(|source| Failure::run(Unmade { directory: directory.to_owned(), source }))?;
        }
        let Ok(handle) = File::open(directory) else { return Ok(None) };
        match handle.try_lock() {
            Err(TryLockError::WouldBlock) => {
                Err(Failure::scene(WouldBeLost { directory: directory.to_owned(), why: Lost::Alive }))
            }
            _ => Ok(Some(handle)),
        }
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
            return Err(Failure::scene(Past { path: restored.path, time, end }));
        }
        let unusable = restored.unusable.iter();
        unusable.for_each(|one| self.say("warning", &format!("a checkpoint cannot be used: {one}")));
        if !restored.missing.is_empty() {
            let missing: Vec<_> = restored.missing.iter().map(|path| path.display().to_string()).collect();
            let text = "these snapshots of the run are not there any more, and its pictures leave them out";
            self.say("warning", &format!("{text}: {}", missing.join(", ")));
        }
        if let Some(program) = &restored.other_program {
            self.say("warning", &format!("the checkpoint was written by {program}: the bits may differ from then on"));
        }
        if !self.quiet {
            let (time, path) = (simulation.clock.time(), restored.path.display());
            self.say("restart", &format!("continues at t = {time}, step {}, from {path}", simulation.clock.steps()));
        }
        Ok(restored)
    }

    fn audience(&self) -> Audience {
        match self.progress {
            _ if self.quiet => Audience::Nobody,
            Form::Text => Audience::Person,
            Form::Json => Audience::Program,
        }
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
        json!({
            "scene": self.scene.scene.display().to_string(),
            "set": self.scene.overrides,
            "out": directory.display().to_string(),
            "until": self.until,
            "steps": self.steps,
            "threads": parallel::threads(),
            "check_tangent": self.check_tangent,
        })
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
