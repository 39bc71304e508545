//! The command-line program: joins scenes, simulations and output.

mod program;

use bfree::causes;
use bfree::output::plot::{Look, PlotError, View, plot_frames, plot_run};
use bfree::scene;
use clap::{Parser, Subcommand};
use program::{Failure, INTERRUPTED, New, Run, SceneArguments, print, tell};
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
    Check(SceneArguments),
    /// Write a scene to start from, and explain its keys; without a problem, list them.
    New(New),
    /// Draw energies, iterations and particles of a run as SVG and PNG, and all of it with a player as one page, report.html.
    Plot {
        /// The directory of the run's results.
        directory: PathBuf,
        /// Draw every snapshot instead, as frame_0000.png and on in this directory, for an encoder:
        /// ffmpeg -framerate 10 -i FRAMES/frame_%04d.png -pix_fmt yuv420p movie.mp4
        #[arg(long, value_name = "FRAMES")]
        movie: Option<PathBuf>,
        /// The field that colours the particles, or a component of it: von_mises, stress_xx, displacement_y, displacement (its length)
        /// [default: plastic_strain, von_mises, or the first there is].
        #[arg(long, value_name = "FIELD")]
        field: Option<String>,
        /// From where particles are seen: a plane, or degrees to the right and up from it: xy, 30,20 or xz,30,20
        /// [default: the plane of the motion; of bodies in space 30,20].
        #[arg(long, value_name = "VIEW", allow_negative_numbers = true)]
        view: Option<View>,
        /// Draw the snapshot nearest to this time [default: the last].
        #[arg(long, value_name = "T", allow_negative_numbers = true, conflicts_with = "movie")]
        time: Option<f64>,
        /// The format of the pictures [default: both].
        #[arg(long, value_parser = ["svg", "png"], conflicts_with = "movie")]
        format: Option<String>,
    },
    /// Print the JSON schema of scenes.
    Schema,
}

fn main() -> ExitCode {
    let command = Arguments::parse().command;
    let json = matches!(&command, Command::Run(run) if run.tells_json());
    let result = match command {
        Command::Run(run) => run.execute(),
        Command::Check(arguments) => arguments.check(),
        Command::New(new) => new.execute(),
        Command::Plot { directory, movie, field, view, time, format } => {
            let mut look = Look { field, view, time, ..Look::default() };
            look.formats.retain(|one| format.as_deref().is_none_or(|format| format == *one));
            plot(&directory, movie.as_deref(), &look)
        }
        Command::Schema => print_schema(),
    };
    let (error, code) = match result {
        Ok(()) => return ExitCode::SUCCESS,
        Err(Failure::Interrupted) => return ExitCode::from(INTERRUPTED),
        Err(Failure::Scene(error)) => (error, 2),
        Err(Failure::Run(error)) => (error, 1),
    };
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
        // About an option.
        PlotError::Field { .. } => Failure::scene(error),
        error => Failure::run(error),
    })?;
    print(pictures.iter().map(|picture| picture.display().to_string()).collect::<Vec<_>>().join("\n"))
}

fn print_schema() -> Result<(), Failure> {
    print(serde_json::to_string_pretty(&scene::schema()).map_err(Failure::run)?)
}
