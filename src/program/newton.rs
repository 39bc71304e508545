//! `bfree newton`: how Newton's method converges in each step of a scene.

use super::failure::{Failure, print};
use super::scene_arguments::SceneArguments;
use crate::output::plot;
use crate::scene::{Scene, time::MAX_STEPS};
use crate::simulation::StepReport;
use crate::solver::{Convergence, Forcing, NewtonIteration, NewtonSettings};
use clap::{Args, ValueEnum};
use std::num::NonZeroU64;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use tangent_check::convergence::{Solution, TableForm, table};

/// An iteration is limited by its linear solve if the solve left at least this share of the new residual.
const LINEAR_SHARE: f64 = 0.5;

/// The tolerance of linear systems with `--exact`.
const TIGHT: f64 = 1e-12;

/// Round-off of a residual, in units of the floor of Newton's method.
const ROUND_OFF: f64 = 16.0;

/// `bfree newton`.
#[derive(Args)]
pub(super) struct Newton {
    #[command(flatten)]
    scene: SceneArguments,
    /// The steps to show, counted from 1: 12, or 10..20. The steps before them are computed, too.
    #[arg(long, value_name = "FIRST..LAST", default_value = "1..10", value_parser = range)]
    steps: RangeInclusive<u64>,
    /// Fail if a step converges more slowly, and say why. The tangent is then compared with dual numbers in each step.
    #[arg(long, value_enum)]
    expect: Option<Expected>,
    /// Solve the linear systems to 1e-12, and iterate until round-off, whatever the scene asks for.
    #[arg(long)]
    exact: bool,
    /// The form of the table.
    #[arg(long, value_enum, default_value_t)]
    form: Form,
    /// Draw the norms against the iterations, to a file that ends with .svg or .png.
    #[arg(long, value_name = "FILE", value_parser = picture)]
    plot: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Expected {
    Quadratic,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Form {
    /// Aligned columns.
    #[default]
    Text,
    Markdown,
    /// A tabular with the rules of booktabs.
    Latex,
    Csv,
}

impl Form {
    fn of_table(self) -> TableForm {
        match self {
            Self::Text => TableForm::Text,
            Self::Markdown => TableForm::Markdown,
            Self::Latex => TableForm::Latex,
            Self::Csv => TableForm::Csv,
        }
    }
}

/// Parser of `--steps`.
fn range(text: &str) -> Result<RangeInclusive<u64>, String> {
    let (first, last) = text.split_once("..").unwrap_or((text, text));
    let number = |text: &str| text.parse().ok().filter(|number| (1..=MAX_STEPS as u64).contains(number));
    match (number(first), number(last.trim_start_matches('='))) {
        (Some(first), Some(last)) if first <= last => Ok(first..=last),
        _ => Err(format!("must be a step from 1 to {MAX_STEPS}, or two of them as in 10..20, the first one not later")),
    }
}

/// Parser of `--plot`.
fn picture(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("svg" | "png") => Ok(path),
        _ => Err("must end with .svg or .png".to_owned()),
    }
}

impl Newton {
    /// Takes the steps and prints their residuals.
    pub(crate) fn execute(&self) -> Result<(), Failure> {
        let scene = self.scene.read()?;
        in_dimensions!(scene.dimension(), D => self.execute_in::<D>(&scene))
    }

    fn execute_in<const D: usize>(&self, scene: &Scene) -> Result<(), Failure> {
        let mut simulation = self.scene.build::<D>(scene)?;
        self.scene.plan(&simulation)?;
        if self.exact {
            let newton = &mut simulation.settings.newton;
            (newton.relative_tolerance, newton.forcing) = (0.0, Forcing::Fixed(TIGHT));
        }
        let of_scene = simulation.clock.whole_steps(scene.time.end);
        let first = *self.steps.start();
        if of_scene < first {
            let what = format!("the scene ends after {of_scene} steps, before step {first}");
            return Err(Failure::scene(format!("{what}: give an earlier step with --steps")));
        }
        let (mut solutions, mut slow) = (Vec::new(), Vec::new());
        for step in 1..=of_scene.min(*self.steps.end()) {
            let shown = self.steps.contains(&step);
            let every = NonZeroU64::new(u64::from(shown && self.expect.is_some()));
            simulation.settings.check_tangent = every;
            // A step that fails ends the command, but not without the table of the steps before it.
            let taken = simulation.advance();
            let Ok(report) = taken else {
                self.tell(&solutions)?;
                return taken.map(|_| ()).map_err(Failure::run);
            };
            if shown {
                let solution = solution(step, &report);
                if !solution.order().is_quadratic() {
                    slow.push(format!("{}: {}; {}", solution.name, solution.order(), cause(&solution, &report)));
                }
                solutions.push(solution);
            }
        }
        self.tell(&solutions)?;
        if self.expect.is_some() && !slow.is_empty() {
            let (count, shown) = (slow.len(), solutions.len());
            let what = format!("{count} of {shown} steps do not converge quadratically");
            return Err(Failure::run(format!("{what}:\n  {}", slow.join("\n  "))));
        }
        Ok(())
    }

    /// Prints the table, and draws the picture.
    fn tell(&self, solutions: &[Solution]) -> Result<(), Failure> {
        print(table(solutions, self.form.of_table()).trim_end())?;
        let Some(path) = &self.plot else { return Ok(()) };
        let lines: Vec<_> = solutions.iter().map(|one| (one.name.as_str(), one.norms.as_slice())).collect();
        let picture = plot::newton_norms("Convergence of Newton's method", &lines);
        let content = match path.extension().is_some_and(|extension| extension == "png") {
            true => picture.png("the norms").map_err(Failure::run)?,
            false => picture.svg().into_bytes(),
        };
        std::fs::write(path, content).map_err(Failure::system(format_args!("write {}", path.display())))
    }
}

/// The residuals of a step.
fn solution<const D: usize>(step: u64, report: &StepReport<D>) -> Solution {
    let history = &report.newton.history;
    let mut norms: Vec<f64> = history.first_residual.into_iter().collect();
    norms.extend(history.iterations.iter().map(|one| one.residual));
    let floor = ROUND_OFF * NewtonSettings::FLOOR * f64::EPSILON;
    // Newton's method itself may end because the norms only scatter: a law from a library has round-off of its own.
    let scatters = report.newton.convergence == Convergence::RoundOff;
    let scatter = norms.last().filter(|_| scatters).map_or(0.0, |last| ROUND_OFF * last);
    let round_off = history.magnitude.map(|size| scatter.max(floor * size));
    // Below round-off, norms only scatter.
    let falls = norms.iter().position(|norm| round_off.is_some_and(|round_off| *norm <= round_off));
    norms.truncate(falls.map_or(norms.len(), |last| last + 1));
    let halved = match report.failed.len() {
        0 => String::new(),
        times => format!(" (halved {times} ×)"),
    };
    Solution { name: format!("step {step}{halved}"), norms, round_off }
}

/// The reason why a step is not seen to converge quadratically: the last two iterations decide.
fn cause<const D: usize>(solution: &Solution, report: &StepReport<D>) -> String {
    let last = solution.norms.len().saturating_sub(1);
    let mut decisive =
        report.newton.history.iterations.iter().enumerate().take(last).skip(last.saturating_sub(2).max(1));
    if last < 2 {
        return "too few iterations to tell: lower solver.newton.tolerance".to_owned();
    }
    let limited = |(_, one): &(usize, &NewtonIteration)| one.krylov.relative_residual >= LINEAR_SHARE * one.ratio;
    if let Some((k, one)) = decisive.clone().find(limited) {
        let (left, ratio) = (one.krylov.relative_residual, one.ratio);
        return format!(
            "the linear solve of iteration {} leaves {left:.1e} of the residual, and {ratio:.1e} is left in all: see solver.krylov.forcing, \
             or --exact",
            k + 1
        );
    }
    if let Some((k, one)) = decisive.find(|(_, one)| one.step_length < 1.0) {
        return format!("the line search shortens the step of iteration {} to {}", k + 1, one.step_length);
    }
    if report.yielding > 0.0 {
        return "plastic bodies flow: their stress has a kink at the yield surface".to_owned();
    }
    "no cause was found: no check of the tangent failed, the linear solves are tight, and no line search shortened these iterations; the \
     solution may still be far"
        .to_owned()
}
