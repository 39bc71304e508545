//! The command-line program: joins scenes, simulations and output.

use bfree::material::Material;
use bfree::output::plot::plot_run;
use bfree::output::{OutputSettings, Place, Probe, Recorder, Reference, nearest};
use bfree::plan::Plan;
use bfree::scene::{self, Override, Scene, output::At};
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use clap::{Args, Parser, Subcommand};
use std::error::Error;
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
    /// End at this time instead of the scene's.
    #[arg(long, value_name = "T")]
    until: Option<f64>,
    /// Take at most this many whole time steps.
    #[arg(long, value_name = "N")]
    steps: Option<u64>,
    /// Threads [default: all cores]. The results have the same bits for any number.
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroU64>,
    /// Compare the tangent with dual numbers every EVERY steps, and stop where they part.
    #[arg(long, value_name = "EVERY", num_args = 0..=1, default_missing_value = "1")]
    check_tangent: Option<NonZeroU64>,
    /// Show no progress and no summary.
    #[arg(long)]
    quiet: bool,
}

/// How the program ends: 2 for a scene that cannot be used, 1 for a run that failed.
enum Failure {
    Scene(Box<dyn Error>),
    Run(Box<dyn Error>),
}

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
        Err(Failure::Scene(error)) => (error, 2),
        Err(Failure::Run(error)) => (error, 1),
    };
    eprintln!("error: {error}");
    let mut cause = error.source();
    while let Some(error) = cause {
        eprintln!("  because: {error}");
        cause = error.source();
    }
    ExitCode::from(code)
}

fn plot(directory: &Path) -> Result<(), Failure> {
    for picture in plot_run(directory).map_err(Failure::run)? {
        println!("{}", picture.display());
    }
    Ok(())
}

fn print_schema() -> Result<(), Failure> {
    println!("{}", serde_json::to_string_pretty(&scene::schema()).map_err(Failure::run)?);
    Ok(())
}

impl SceneArguments {
    fn read(&self) -> Result<Scene, Failure> {
        let overrides: Result<Vec<Override>, _> = self.overrides.iter().map(|text| text.parse()).collect();
        scene::read_file(&self.scene, &overrides.map_err(Failure::scene)?).map_err(Failure::scene)
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
        let simulation = scene.build::<D>(self.folder()).map_err(Failure::scene)?;
        if let Some(title) = &scene.title {
            println!("{title}");
        }
        let steps = steps_until(&simulation, scene.time.end);
        println!("steps         {steps} of {} to t = {}", scene.time.step, scene.time.end);
        print!("{}", Plan::of(&simulation).map_err(Failure::scene)?);
        Ok(())
    }
}

impl Run {
    fn execute(&self) -> Result<(), Failure> {
        let scene = self.scene.read()?;
        if let Some(threads) = self.threads {
            let threads = usize::try_from(threads.get()).unwrap_or(usize::MAX).min(1024);
            rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().map_err(Failure::run)?;
        }
        match scene.dimension() {
            1 => self.execute_in::<1>(&scene),
            2 => self.execute_in::<2>(&scene),
            _ => self.execute_in::<3>(&scene),
        }
    }

    fn execute_in<const D: usize>(&self, scene: &Scene) -> Result<(), Failure> {
        let mut simulation = scene.build::<D>(self.scene.folder()).map_err(Failure::scene)?;
        simulation.settings.check_tangent = self.check_tangent;
        let last = self.last_step(&simulation, scene.time.end);
        let directory = self.out.clone().unwrap_or_else(|| {
            Path::new("out").join(self.scene.scene.file_stem().unwrap_or(self.scene.scene.as_os_str()))
        });
        let settings = OutputSettings {
            directory: directory.clone(),
            fields: scene.output.fields.clone(),
            snapshot_every: scene.output.every,
            probes: probes(scene, &simulation),
            end_time: last as f64 * simulation.clock.nominal(),
            quiet: self.quiet,
        };
        let interrupted = stop_on_interrupt().map_err(Failure::run)?;
        let reference = Reference::of(&simulation);
        let mut recorder = Recorder::start(settings, &simulation, reference).map_err(Failure::run)?;
        let mut failure = None;
        while simulation.clock.nominal_steps() < last && !interrupted.load(Ordering::Relaxed) {
            match simulation.advance() {
                Ok(step) => recorder.record(&simulation, &step).map_err(Failure::run)?,
                Err(error) => {
                    failure = Some(error);
                    break;
                }
            }
        }
        let settings = serde_json::to_value(scene).map_err(Failure::run)?;
        let message = match &failure {
            Some(error) => Some(chain(error)),
            None if interrupted.load(Ordering::Relaxed) => Some("interrupted".to_owned()),
            None => None,
        };
        let summary = recorder.finish(&simulation, &settings, message.as_deref()).map_err(Failure::run)?;
        if !self.quiet {
            println!("{summary}\nresults   {}", directory.display());
        }
        match failure {
            Some(error) => {
                eprintln!(
                    "stopped at t = {} after the last good step; its state is in {}",
                    simulation.clock.time(),
                    directory.display()
                );
                Err(Failure::run(error))
            }
            None => Ok(()),
        }
    }

    /// Whole steps the run takes.
    fn last_step<const D: usize>(&self, simulation: &Simulation<D>, end: f64) -> u64 {
        let until = steps_until(simulation, self.until.unwrap_or(end));
        self.steps.map_or(until, |steps| steps.min(until))
    }
}

/// An error and its causes on one line.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text
}

/// Whole steps that reach `end`, to within a billionth of a step; a last step may lead beyond it.
fn steps_until<const D: usize>(simulation: &Simulation<D, Material>, end: f64) -> u64 {
    (end / simulation.clock.nominal() - 1e-9).ceil().max(0.0) as u64
}

/// Set by Ctrl-C: the run then ends after the current step.
fn stop_on_interrupt() -> Result<Arc<AtomicBool>, ctrlc::Error> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed))?;
    Ok(interrupted)
}

/// The probes of a scene, those on particles bound to the nearest one.
fn probes<const D: usize>(scene: &Scene, simulation: &Simulation<D>) -> Vec<Probe<D>> {
    let probe = |probe: &scene::output::Probe| {
        let body = |name: &String| simulation.bodies.iter().position(|body| body.name == *name).map(|body| body as u32);
        let body = probe.body.as_ref().and_then(body);
        let (At::Particle(x) | At::Point(x)) = &probe.at;
        let point = Vector::<f64, D>::from_iterator(x.iter().copied());
        let place = match &probe.at {
            At::Particle(_) => Place::Particle(nearest(&simulation.particles, &point, body)?),
            At::Point(_) => Place::Nearest { point, body },
        };
        Some(Probe { name: probe.name.clone(), field: probe.field, place })
    };
    scene.output.probes.iter().filter_map(probe).collect()
}
