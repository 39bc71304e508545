//! `bfree check-law`: whether the tangent of a law in a shared library is the derivative of its stress.

use super::{Failure, print};
use bfree::material::TangentOf;
use clap::{ArgGroup, Args, ValueEnum};
use serde::Deserialize;
use std::path::{Path as FilePath, PathBuf};
use std::time::Duration;
use tangent_check::convention::Tensor;
use tangent_check::finding::Report;
use tangent_check::law::CallFailed;
use tangent_check::library::child::{Child, Host};
use tangent_check::library::{Description, Kind, LibraryLaw, umat};
use tangent_check::report::{self, Format, Options};
use tangent_check::roads::check_law;
use tangent_check::states::{Path, for_law};
use tangent_check::tensor::determinant;

/// `bfree check-law`.
#[derive(Args)]
#[command(after_help = "The library runs in a child process: a crash, an endless loop or a STOP is a finding.\n\
                        Exit codes: 0 consistent or inexact, 1 wrong, 2 the law cannot be called or an option is not allowed, 3 not checked.")]
#[command(group(ArgGroup::new("kind").required(true)))]
pub struct CheckLaw {
    /// The shared library: libmine.so. This command runs its code.
    library: PathBuf,
    /// The law is a UMAT of Abaqus/Standard.
    #[arg(long, group = "kind")]
    umat: bool,
    /// The law is this behaviour of MFront, built with the interface `generic`.
    #[arg(long, value_name = "NAME", group = "kind")]
    mfront: Option<String>,
    /// The law is this law with the C header bfree_law.h.
    #[arg(long, value_name = "NAME", group = "kind")]
    c: Option<String>,
    /// The properties (PROPS), in the order of the law.
    #[arg(long, value_name = "X,X,…", value_delimiter = ',', allow_negative_numbers = true, value_parser = number)]
    properties: Vec<f64>,
    /// The internal variables (STATEV) of a UMAT: their number, or their names with values at rest, as in alpha=0,beta=1.
    #[arg(long, value_name = "N|NAME=X,…", default_value = "0", value_parser = internal_variables, conflicts_with_all = ["mfront", "c"])]
    state: State,
    /// The meaning of a UMAT's DDSDDE.
    #[arg(long, value_enum, default_value = "jaumann-kirchhoff", conflicts_with_all = ["mfront", "c"])]
    tangent: Tangent,
    /// The name that a UMAT is called with (CMNAME).
    #[arg(long, value_name = "NAME", default_value = "BFREE", conflicts_with_all = ["mfront", "c"])]
    name: String,
    /// The temperature (TEMP) of a UMAT.
    #[arg(long, value_name = "T", default_value_t = 0.0, allow_negative_numbers = true, value_parser = number,
          conflicts_with_all = ["mfront", "c"])]
    temperature: f64,
    /// An external state variable of a behaviour of MFront, as in Temperature=300.
    #[arg(long, value_name = "NAME=X", value_parser = named, conflicts_with_all = ["umat", "c"])]
    external: Vec<(String, f64)>,
    /// Call the law in plane strain: four components for a UMAT (NTENS = 4).
    #[arg(long)]
    plane_strain: bool,
    /// Paths of your own instead of those made here: a JSON file, a list of {"name": …, "length": Δt, "gradients": [F, …]} with 3×3 F.
    #[arg(long, value_name = "FILE")]
    states: Option<PathBuf>,
    /// The seed of the states. The same seed gives the same report.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// A report: terminal, terminal-full (each state a row), markdown, junit, github, sarif or json, to standard output or to a file
    /// [default: terminal].
    #[arg(long, value_name = "FORMAT[=FILE]", value_parser = wanted)]
    report: Vec<Wanted>,
    /// The source file of the law, for annotations in a code review.
    #[arg(long, value_name = "FILE")]
    source: Option<String>,
    /// Fail also if the tangent is inexact.
    #[arg(long)]
    strict: bool,
    /// The longest time of a call in seconds.
    #[arg(long, value_name = "S", default_value = "5", value_parser = seconds)]
    limit: Duration,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Tangent {
    /// The Jaumann rate of the Kirchhoff stress over J, as Abaqus asks at finite strain.
    #[value(alias = "jaumann_kirchhoff")]
    JaumannKirchhoff,
    /// The Jaumann rate of the Cauchy stress.
    #[value(alias = "jaumann_cauchy")]
    JaumannCauchy,
    /// The derivative of the Cauchy stress by DSTRAN, with the rotation held: laws written for small strain.
    Strain,
}

/// Names of internal variables, and their values at rest.
type State = std::sync::Arc<[(String, f64)]>;

/// A report and the file that takes it; standard output without a file.
#[derive(Clone, Debug)]
struct Wanted {
    format: Format,
    file: Option<PathBuf>,
}

/// Parser of a finite number.
fn number(text: &str) -> Result<f64, String> {
    let value = text.trim().parse().ok().filter(|value: &f64| value.is_finite());
    value.ok_or_else(|| "must be a finite number; commas without spaces separate several".to_owned())
}

/// Parser of `--limit`.
fn seconds(text: &str) -> Result<Duration, String> {
    let limit = number(text).ok().and_then(|limit| Duration::try_from_secs_f64(limit).ok());
    limit.filter(|limit| !limit.is_zero()).ok_or_else(|| "must be a number of seconds above 0".to_owned())
}

/// Parser of `NAME=X`.
fn named(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("must be a name and a number, as in alpha=0")?;
    let value = number(value).map_err(|_| format!("the value of {name} must be a finite number"))?;
    Ok((name.to_owned(), value))
}

/// Parser of `--state`.
fn internal_variables(text: &str) -> Result<State, String> {
    if let Ok(count) = text.parse::<u16>() {
        return Ok(umat::state(count.into()).into());
    }
    let variable = |one: &str| {
        let (name, value) = if one.contains('=') { named(one)? } else { (one.to_owned(), 0.0) };
        let allowed = name.starts_with(|first: char| first.is_alphabetic() || first == '_');
        allowed.then_some((name, value)).ok_or_else(|| {
            format!(
                "{one:?} must be a number from 0 to {}, or names that begin with a letter, as in alpha=0,beta=1",
                u16::MAX
            )
        })
    };
    text.split(',').map(variable).collect()
}

/// Parser of `--report`.
fn wanted(text: &str) -> Result<Wanted, String> {
    let (name, file) = text.split_once('=').map_or((text, None), |(name, file)| (name, Some(file.into())));
    let format = Format::from_name(name).map_err(|error| error.to_string())?;
    Ok(Wanted { format, file })
}

/// A path of a user.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OwnPath {
    name: String,
    /// Δt of each step.
    length: f64,
    /// F at the end of each step.
    gradients: Vec<Tensor>,
}

/// The law cannot be called, or a file cannot be used.
#[derive(Debug, thiserror::Error)]
enum Unusable {
    #[error("{0}")]
    Law(String),
    #[error("cannot read the states of {}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("cannot use the states of {}", path.display())]
    States { path: PathBuf, source: serde_json::Error },
    #[error("cannot write {}", path.display())]
    Write { path: PathBuf, source: std::io::Error },
    #[error("{}: path {name:?}, step {step}: F needs a positive determinant, and the length of a step must be positive", path.display())]
    Step { path: PathBuf, name: String, step: usize },
    #[error("{}: there is no path with a step", path.display())]
    NoSteps { path: PathBuf },
    #[error(
        "the law fails in a first step of tiny strain. It was called with {properties} properties (--properties) and {state} internal variables (--state)\n  \
             because: {sentence}"
    )]
    First { properties: usize, state: usize, sentence: String },
}

impl CheckLaw {
    /// Checks the law and writes the reports.
    pub fn execute(&self) -> Result<(), Failure> {
        let mut law = self.open()?;
        let (properties, state) = (self.properties.len(), self.state.len());
        let refused = |CallFailed(sentence)| Failure::scene(Unusable::First { properties, state, sentence });
        let paths = match &self.states {
            Some(file) => own_paths(file)?,
            None => for_law(&mut law, self.seed).map_err(refused)?,
        };
        let report = check_law(&mut law, &paths, self.seed);
        self.write(&report)?;
        match report.exit_code(self.strict) {
            0 => Ok(()),
            code => Err(Failure::Told(code)),
        }
    }

    /// The law in a child process.
    fn open(&self) -> Result<LibraryLaw, Failure> {
        let kind = match (&self.mfront, &self.c) {
            (Some(name), _) => Kind::Mfront { name: name.clone(), external: self.external.clone() },
            (_, Some(name)) => Kind::C { name: name.clone() },
            _ => Kind::Umat {
                material: self.name.clone(),
                tangent: self.tangent.meaning().measure(),
                temperature: self.temperature,
            },
        };
        let description = Description {
            library: self.library.clone(),
            kind,
            properties: self.properties.clone(),
            state: self.state.to_vec(),
            plane_strain: self.plane_strain,
        };
        // Exit code 1 is a wrong tangent.
        let host = Host::this_program().map_err(Failure::scene)?;
        let child = Child::start(host, description, self.limit);
        let child = child.map_err(|CallFailed(sentence)| Failure::scene(Unusable::Law(sentence)))?;
        Ok(LibraryLaw::new(Box::new(child)))
    }

    fn write(&self, report: &Report) -> Result<(), Failure> {
        let options = Options { file: self.source.clone(), strict: self.strict };
        let terminal = [Wanted { format: Format::Terminal, file: None }];
        let all = if self.report.is_empty() { &terminal[..] } else { &self.report };
        for Wanted { format, file } in all {
            let text = report::write(report, *format, &options);
            match file {
                None => print(text.trim_end())?,
                Some(path) => std::fs::write(path, text)
                    .map_err(|source| Failure::scene(Unusable::Write { path: path.clone(), source }))?,
            }
        }
        Ok(())
    }
}

impl Tangent {
    fn meaning(self) -> TangentOf {
        match self {
            Self::JaumannKirchhoff => TangentOf::JaumannKirchhoff,
            Self::JaumannCauchy => TangentOf::JaumannCauchy,
            Self::Strain => TangentOf::Strain,
        }
    }
}

fn own_paths(file: &FilePath) -> Result<Vec<Path>, Failure> {
    let path = file.to_owned();
    let text = match std::fs::read_to_string(file) {
        Ok(text) => text,
        Err(source) => return Err(Failure::scene(Unusable::Read { path, source })),
    };
    let own: Vec<OwnPath> = match serde_json::from_str(&text) {
        Ok(own) => own,
        Err(source) => return Err(Failure::scene(Unusable::States { path, source })),
    };
    if own.iter().all(|one| one.gradients.is_empty()) {
        return Err(Failure::scene(Unusable::NoSteps { path }));
    }
    for OwnPath { name, length, gradients } in &own {
        let allowed = |gradient: &Tensor| determinant(gradient) > 0.0 && *length > 0.0;
        if let Some(step) = gradients.iter().position(|gradient| !allowed(gradient)) {
            return Err(Failure::scene(Unusable::Step { path, name: name.clone(), step: step + 1 }));
        }
    }
    Ok(own.into_iter().map(|one| Path::new(&one.name, one.gradients, one.length)).collect())
}
