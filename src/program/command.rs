//! The command line: chooses the command, and turns its result into an exit code.

use super::check_law::CheckLaw;
use super::failure::{Failure, print, tell};
use super::new::New;
use super::newton::Newton;
use super::options::whole;
use super::pack::pack;
use super::reproduce::Reproduce;
use super::run::Run;
use super::scene_arguments::SceneArguments;
use crate::causes;
use crate::output::OutputError;
use crate::output::plot::{Look, View, plot_frames, plot_run};
use crate::scene;
use clap::{Parser, Subcommand};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

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
    Check {
        #[command(flatten)]
        scene: SceneArguments,
        /// Say also whether the scene runs on the GPU of this machine, and how much of its memory it takes.
        #[arg(long)]
        gpu: bool,
        /// Say also what each of this many processes of MPI would hold, and tell the others.
        #[arg(long, value_name = "N", value_parser = whole(1, 100_000))]
        ranks: Option<u64>,
    },
    /// Write a starter scene and explain its keys. Without a problem, list the problems.
    New(New),
    /// Check that the tangent of a law in a shared library (UMAT, MFront, C) is the derivative of its stress.
    CheckLaw(CheckLaw),
    /// Show the residuals of Newton's method in each step of a scene, and the order of convergence.
    Newton(Newton),
    /// Draw energies, iterations and particles of a run as SVG and PNG. The page report.html also has a player of the snapshots.
    Plot {
        /// The directory of the run's results.
        directory: PathBuf,
        /// Draw every snapshot instead, as frame_0000.png, frame_0001.png, … in this directory. An encoder makes the movie:
        /// ffmpeg -framerate 10 -i FRAMES/frame_%04d.png -pix_fmt yuv420p movie.mp4
        #[arg(long, value_name = "FRAMES")]
        movie: Option<PathBuf>,
        /// The field, or a component of a field, that colours the particles: von_mises, stress_xx, displacement_y, displacement (its
        /// length)
        /// [default: plastic_strain, else von_mises, else the first field of the snapshot].
        #[arg(long, value_name = "FIELD")]
        field: Option<String>,
        /// The direction of sight: a plane (xy), degrees by which the eye moves to the right and up (30,20), or both (xz,30,20)
        /// [default: the plane of the largest motion, in three dimensions with 30,20].
        #[arg(long, value_name = "VIEW", allow_negative_numbers = true)]
        view: Option<View>,
        /// Draw the snapshot nearest to this time [default: the last].
        #[arg(long, value_name = "T", allow_negative_numbers = true, conflicts_with = "movie")]
        time: Option<f64>,
        /// The format of the pictures.
        #[arg(long, value_parser = ["both", "svg", "png"], default_value = "both", conflicts_with = "movie")]
        format: String,
    },
    /// Run the scene of earlier results again, with the same flags, and say of every file whether it has the same bits.
    Reproduce(Reproduce),
    /// Write all snapshots of a run into one file that ParaView, PyVista and VTK open with its times, particles.vtkhdf. The other series, such
    /// as obstacles, get a file each. The snapshots themselves stay: pictures and --restart need them.
    Pack {
        /// The directory of the run's results.
        directory: PathBuf,
    },
    /// Print the JSON schema of scenes.
    Schema,
}

/// Runs the program with the arguments of this process. Returns its exit code.
pub fn main() -> ExitCode {
    // `check-law` calls libraries in a child process, which is this program.
    if let Some(code) = tangent_check::library::child::serve_if_asked() {
        return code;
    }
    let command = Arguments::parse().command;
    let json = matches!(&command, Command::Run(run) if run.tells_json());
    let result = match command {
        Command::Run(run) => run.execute(),
        Command::Check { scene, gpu, ranks } => scene.check(gpu, ranks),
        Command::New(new) => new.execute(),
        Command::CheckLaw(check) => check.execute(),
        Command::Newton(newton) => newton.execute(),
        Command::Plot { directory, movie, field, view, time, format } => {
            let mut look = Look { field, view, time, ..Look::default() };
            look.formats.retain(|one| format == "both" || format == *one);
            plot(&directory, movie.as_deref(), &look)
        }
        Command::Reproduce(reproduce) => reproduce.execute(),
        Command::Pack { directory } => pack(&directory),
        Command::Schema => serde_json::to_string_pretty(&scene::schema()).map_err(Failure::run).and_then(print),
    };
    let Err(failure) = result else { return ExitCode::SUCCESS };
    let code = failure.code();
    let (Failure::Scene(error) | Failure::Run(error)) = failure else { return ExitCode::from(code) };
    let messages = causes::messages(&*error);
    if json {
        tell(json!({"event": "error", "code": code, "message": messages.first(), "because": messages.get(1..)}));
    } else {
        tell(format_args!("error: {}", messages.join("\n  because: ")));
    }
    ExitCode::from(code)
}

fn plot(directory: &Path, movie: Option<&Path>, look: &Look) -> Result<(), Failure> {
    let pictures = movie.map_or_else(|| plot_run(directory, look), |frames| plot_frames(directory, frames, look));
    let pictures = pictures.map_err(|error| match error {
        // The option --field names a field that the snapshots do not hold.
        OutputError::NoField { .. } => Failure::scene(error),
        error => Failure::run(error),
    })?;
    print(pictures.iter().map(|picture| picture.display().to_string()).collect::<Vec<_>>().join("\n"))
}
