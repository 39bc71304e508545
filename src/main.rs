//! The command-line program: joins scenes, simulations and output.

use bfree::causes;
use bfree::material::Material;
use bfree::output::plot::plot_run;
use bfree::output::{Outcome, OutputSettings, Place, Probe, Recorder, Reference, nearest};
use bfree::plan::{Plan, SurfaceUse};
use bfree::scene::{self, Override, Scene, SceneError, output::At, time::MAX_STEPS};
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use clap::{Args, Parser, Subcommand};
use serde_json::{Map, Value, json};
use std::error::Error;
use std::fmt::{Display, Formatter, Write as _};
use std::io::{ErrorKind, Write as _};
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Implicit finite-strain material point method with a matrix-free, Voigt-free tangent.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run a scene.
    Run(Run),
    /// Validate a scene and print what it requires.
    Check(SceneArguments),
    /// Draw energies, iterations and particles of a run as SVG and PNG.
    Plot {
        /// The directory of the run's results.
        directory: PathBuf,
    },
    /// Print the JSON schema of scenes.
    Schema,
}

#[derive(Args)]
struct SceneArguments {
    /// The scene, a JSON file.
    scene: PathBuf,
    /// Override one key of the scene, for example time.step=0.01 or approximation='"linear"'.
    #[arg(long = "set", value_name = "KEY.PATH=JSON")]
    overrides: Vec<String>,
}

#[derive(Args)]
struct Run {
    #[command(flatten)]
    scene: SceneArguments,
    /// Directory of the results [default: out/ and the scene's name].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// End at this time instead of the scene's time.end; the same values are allowed.
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = number)]
    until: Option<f64>,
    /// Take at most this many whole time steps; 0 writes the initial state only.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole(0, MAX_STEPS as u64))]
    steps: Option<u64>,
    /// Threads, 1 to 1024 [default: all cores]. The results have the same bits for any number.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole(1, 1024))]
    threads: Option<u64>,
    /// Compare the tangent with dual numbers every EVERY steps, and stop where they part.
    #[arg(long, value_name = "EVERY", num_args = 0..=1, default_missing_value = "1", allow_negative_numbers = true,
          value_parser = whole(1, MAX_STEPS as u64))]
    check_tangent: Option<u64>,
    /// Show no progress and no summary.
    #[arg(long)]
    quiet: bool,
}

/// A whole number of an option, in a range.
fn whole(min: u64, max: u64) -> impl Fn(&str) -> Result<u64, String> + Clone {
    move |text| {
        let number = text.parse().ok().filter(|number| (min..=max).contains(number));
        number.ok_or_else(|| format!("must be a whole number from {min} to {max}"))
    }
}

/// A number of an option.
fn number(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| "must be a number".to_owned())
}

/// How the program ends: 2 for a scene or an option that cannot be used, 1 for a run that failed, 130 for one stopped by Ctrl-C.
enum Failure {
    Scene(Box<dyn Error>),
    Run(Box<dyn Error>),
    Interrupted,
}

/// The exit code of a program that Ctrl-C has ended: 128 and the number of the signal.
const INTERRUPTED: u8 = 130;

impl Failure {
    fn scene(error: impl Error + 'static) -> Self {
        Self::Scene(Box::new(error))
    }

    fn run(error: impl Error + 'static) -> Self {
        Self::Run(Box::new(error))
    }
}

fn main() -> ExitCode {
    let result = match Arguments::parse().command {
        Command::Run(run) => run.execute(),
        Command::Check(arguments) => arguments.check(),
        Command::Plot { directory } => plot(&directory),
        Command::Schema => print_schema(),
    };
    let (error, code) = match result {
        Ok(()) => return ExitCode::SUCCESS,
        Err(Failure::Interrupted) => return ExitCode::from(INTERRUPTED),
        Err(Failure::Scene(error)) => (error, 2),
        Err(Failure::Run(error)) => (error, 1),
    };
    tell(format_args!("error: {}", causes::messages(&*error).join("\n  because: ")));
    ExitCode::from(code)
}

/// Writes to standard output. A reader that has seen enough and closed the pipe, like `head`, is no failure.
fn print(text: impl Display) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Failure::run(Unwritable(error))),
        _ => Ok(()),
    }
}

/// Writes a line to standard error; where that is impossible, there is nobody to tell.
fn tell(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

/// A scene that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", path.display())]
struct Unusable {
    path: PathBuf,
    source: Box<dyn Error>,
}

/// Standard output cannot be written to.
#[derive(Debug, thiserror::Error)]
#[error("cannot write to standard output")]
struct Unwritable(#[source] std::io::Error);

fn plot(directory: &Path) -> Result<(), Failure> {
    let pictures = plot_run(directory).map_err(Failure::run)?;
    print(pictures.iter().map(|picture| picture.display().to_string()).collect::<Vec<_>>().join("\n"))
}

fn print_schema() -> Result<(), Failure> {
    print(serde_json::to_string_pretty(&scene::schema()).map_err(Failure::run)?)
}

impl SceneArguments {
    fn read(&self) -> Result<Scene, Failure> {
        let overrides: Result<Vec<Override>, _> = self.overrides.iter().map(|text| text.parse()).collect();
        scene::read_file(&self.scene, &overrides.map_err(Failure::scene)?).map_err(|error| match error {
            // The one names the file, the other is about an option.
            SceneError::File { .. } | SceneError::Override(_) => Failure::scene(error),
            error => self.unusable(error),
        })
    }

    /// Names the scene that an error is about.
    fn unusable(&self, error: impl Error + 'static) -> Failure {
        Failure::scene(Unusable { path: self.scene.clone(), source: Box::new(error) })
    }

    fn folder(&self) -> &Path {
        self.scene.parent().unwrap_or(Path::new("."))
    }

    fn check(&self) -> Result<(), Failure> {
        let scene = self.read()?;
        match scene.dimension() {
            1 => self.check_in::<1>(&scene),
            2 => self.check_in::<2>(&scene),
            _ => self.check_in::<3>(&scene),
        }
    }

    fn check_in<const D: usize>(&self, scene: &Scene) -> Result<(), Failure> {
        let simulation = scene.build::<D>(self.folder()).map_err(|error| self.unusable(error))?;
        let mut text = scene.title.as_ref().map_or_else(String::new, |title| format!("{title}\n"));
        let steps = steps_until(&simulation, scene.time.end);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "steps         {steps} of {} to t = {}", scene.time.step, scene.time.end);
        let _ = write!(text, "{}", Plan::of(&simulation).map_err(|error| self.unusable(error))?);
        for bound in bound_probes(scene, &simulation) {
            let _ = write!(text, "\nprobe         {bound}");
            bound.warning().into_iter().for_each(tell);
        }
        print(text)
    }
}

impl Run {
    fn execute(&self) -> Result<(), Failure> {
        let mut scene = self.scene.read()?;
        if let Some(until) = self.until {
            scene.time =
                scene.time.until(until, "--until").map_err(|wrong| Failure::scene(SceneError::Values(wrong)))?;
        }
        if let Some(threads) = self.threads {
            let threads = usize::try_from(threads).unwrap_or(usize::MAX);
            rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().map_err(Failure::run)?;
        }
        match scene.dimension() {
            1 => self.execute_in::<1>(&scene),
            2 => self.execute_in::<2>(&scene),
            _ => self.execute_in::<3>(&scene),
        }
    }

    fn execute_in<const D: usize>(&self, scene: &Scene) -> Result<(), Failure> {
        let mut simulation = scene.build::<D>(self.scene.folder()).map_err(|error| self.scene.unusable(error))?;
        simulation.settings.check_tangent = self.check_tangent.and_then(NonZeroU64::new);
        let until = steps_until(&simulation, scene.time.end);
        let last = self.steps.map_or(until, |steps| steps.min(until));
        let directory = self.out.clone().unwrap_or_else(|| {
            Path::new("out").join(self.scene.scene.file_stem().unwrap_or(self.scene.scene.as_os_str()))
        });
        let probes = bound_probes(scene, &simulation);
        probes.iter().filter_map(Bound::warning).for_each(tell);
        let mut asked = Map::new();
        asked.insert("command".to_owned(), self.options(&directory));
        asked.insert("settings".to_owned(), serde_json::to_value(scene).map_err(Failure::run)?);
        asked.insert("probes".to_owned(), probes.iter().map(Bound::report).collect());
        asked.insert("surfaces".to_owned(), serde_json::to_value(SurfaceUse::of(&simulation)).map_err(Failure::run)?);
        let settings = OutputSettings {
            directory: directory.clone(),
            fields: scene.output.fields.clone(),
            snapshot_every: scene.output.every,
            probes: probes.iter().map(|bound| bound.probe.clone()).collect(),
            end_time: last as f64 * simulation.clock.nominal(),
            quiet: self.quiet,
        };
        let interrupted = stop_on_interrupt().map_err(Failure::run)?;
        let reference = Reference::of(&simulation);
        let mut recorder = Recorder::start(settings, &simulation, reference).map_err(Failure::run)?;
        let mut failure = None;
        while simulation.clock.nominal_steps() < last && !interrupted.load(Ordering::Relaxed) {
            match simulation.advance() {
                Ok(step) => recorder.record(&simulation, &step).map_err(|error| {
                    let (time, place) = (simulation.clock.time(), directory.display());
                    tell(format_args!(
                        "stopped at t = {time}; {place} holds what was written until then, and no report"
                    ));
                    Failure::run(error)
                })?,
                Err(error) => {
                    failure = Some(error);
                    break;
                }
            }
        }
        let stopped = simulation.clock.nominal_steps() < last;
        let outcome = match &failure {
            Some(error) => Outcome::Failed(error),
            None if stopped => Outcome::Interrupted,
            None => Outcome::Finished,
        };
        let summary = recorder.finish(&simulation, &asked, outcome).map_err(Failure::run)?;
        if !self.quiet {
            print(format_args!("{summary}\nresults   {}", directory.display()))?;
        }
        let (time, place) = (simulation.clock.time(), directory.display());
        match failure {
            Some(error) => {
                tell(format_args!("stopped at t = {time} after the last good step; its state is in {place}"));
                Err(Failure::run(error))
            }
            None if stopped => {
                tell(format_args!("interrupted at t = {time} after a whole step; everything up to it is in {place}"));
                Err(Failure::Interrupted)
            }
            None => Ok(()),
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
            "threads": rayon::current_num_threads(),
            "check_tangent": self.check_tangent,
        })
    }
}

/// Whole steps that reach `end`, to within a billionth of a step; a last step may lead beyond it.
fn steps_until<const D: usize>(simulation: &Simulation<D, Material>, end: f64) -> u64 {
    (end / simulation.clock.nominal() - 1e-9).ceil().max(0.0) as u64
}

/// Set by Ctrl-C: the run then ends after the current step. A second Ctrl-C ends it at once.
fn stop_on_interrupt() -> Result<Arc<AtomicBool>, ctrlc::Error> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(INTERRUPTED));
        }
    })?;
    Ok(interrupted)
}

/// A probe of the scene, and the particle it looks at first.
struct Bound<const D: usize> {
    probe: Probe<D>,
    particle: usize,
    /// Its distance from the place that was asked for.
    distance: f64,
    /// The particle spacing of its body.
    spacing: f64,
}

impl<const D: usize> Bound<D> {
    fn warning(&self) -> Option<String> {
        (self.distance > self.spacing).then(|| {
            let consequence = match self.probe.place {
                Place::Particle(_) => "it is followed all the same",
                Place::Nearest { .. } => "values are NaN while none is within one grid spacing",
            };
            format!(
                "warning: probe {:?}: the nearest particle, {}, is {:.3e} away, more than the particle spacing {:.3e}; {consequence}",
                self.probe.name, self.particle, self.distance, self.spacing
            )
        })
    }

    fn report(&self) -> Value {
        json!({"name": self.probe.name, "particle": self.particle, "distance": self.distance, "warning": self.warning()})
    }
}

impl<const D: usize> Display for Bound<D> {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self { probe: Probe { name, field, place }, particle, distance, .. } = self;
        let (field, kept) = match place {
            Place::Particle(_) => (field.name(), "follows"),
            Place::Nearest { .. } => (field.name(), "fixed in space, first sees"),
        };
        write!(f, "{name}: {field}, {kept} particle {particle}, {distance:.3e} from the place given")
    }
}

/// The probes of a scene with the particles nearest to them at the start.
fn bound_probes<const D: usize>(scene: &Scene, simulation: &Simulation<D>) -> Vec<Bound<D>> {
    let particles = &simulation.particles;
    let bind = |probe: &scene::output::Probe| {
        let body = |name: &String| simulation.bodies.iter().position(|body| body.name == *name).map(|body| body as u32);
        let body = probe.body.as_ref().and_then(body);
        let (At::Particle(x) | At::Point(x)) = &probe.at;
        let point = Vector::<f64, D>::from_iterator(x.iter().copied());
        let (particle, distance) = nearest(particles, &point, body)?;
        let place = match &probe.at {
            At::Particle(_) => Place::Particle(particle),
            At::Point(_) => Place::Nearest { point, body, within: simulation.grid.spacing },
        };
        let per_cell = scene.bodies.get(particles.body[particle] as usize)?.particles_per_cell;
        let spacing = simulation.grid.spacing / f64::from(per_cell);
        let probe = Probe { name: probe.name.clone(), field: probe.field, place };
        Some(Bound { probe, particle, distance, spacing })
    };
    scene.output.probes.iter().filter_map(bind).collect()
}
