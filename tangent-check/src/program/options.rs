//! The options of the program.

use crate::convention::Measure;
use crate::library::{StressState, umat};
use crate::report::Format;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The help; PROGRAM stands for the name of the program.
pub(super) const HELP: &str = "\
Checks that the tangent of a material law is the derivative of its stress.

Usage: PROGRAM FILE… [OPTIONS]

Files:
  libmine.so            A shared library with the law, or instead
  mine.f more.f90       its sources in Fortran, C or C++. gfortran, gcc and g++ compile them; the variables FC, CC and CXX name others.
  job.inp               Beside them, an input file of Abaqus: *User Material, *Depvar, *Initial Conditions. Options replace its values.

The law:
  --umat                A UMAT of Abaqus/Standard (default)
  --mfront NAME         This behaviour of MFront, built with the interface `generic`
  --c NAME              This law with the C header bfree_law.h
  --properties X,X,…    The properties (PROPS), in the order of the law
  --state N|NAME=X,…    The internal variables (STATEV) of a UMAT: their number, or their names with values at rest, as in alpha=0,beta=1
  --tangent MEANING     The meaning of a UMAT's DDSDDE:
                        jaumann-kirchhoff  the Jaumann rate of the Kirchhoff stress over J, as Abaqus asks at finite strain (default)
                        jaumann-cauchy     the Jaumann rate of the Cauchy stress
                        strain             the derivative of STRESS by DSTRAN: laws written for small strain
  --plane-strain        Call the law in plane strain: four components for a UMAT (NTENS = 4)
  --plane-stress        Call a UMAT in plane stress: three components (NTENS = 3)
  --name NAME           The name that a UMAT is called with (CMNAME); with an input file, the material to take
  --temperature T       The temperature (TEMP) of a UMAT
  --external NAME=X     An external state variable of a behaviour of MFront, as in Temperature=300

The check:
  --allow inexact       Let an inexact tangent pass
  --states FILE         Your own paths: a JSON file, a list of {\"name\": …, \"length\": Δt, \"gradients\": [F, …]} with 3×3 F
  --seed N              The seed of the states (default 1). The same seed gives the same report.
  --limit S             The longest time of a call in seconds (default 5)
  --total-limit S       The longest time of the whole check in seconds (default 600). States beyond it are not checked.
  --report FORMAT[=FILE]  A report: terminal (default), terminal-full (each state a row), markdown, junit, github, sarif or json
  --source FILE         The source file of the law, for annotations in a code review
  --help, --version

The law runs in a child process: a crash, an endless loop or a STOP is a finding.
Exit codes: 0 consistent, or inexact with --allow inexact; 1 wrong or inexact; 2 the law cannot be called, an option is not allowed, or
the check cannot tell.
";

/// The wish of a command line.
pub(super) enum Request {
    Help,
    Version,
    Check(Box<Options>),
}

/// How the law is called.
#[derive(Clone)]
pub(super) enum Interface {
    Umat,
    Mfront(String),
    C(String),
}

/// A report and the file that takes it; standard output without a file.
pub(super) struct Reported {
    pub format: Format,
    pub file: Option<PathBuf>,
}

/// The options of a check; `None` where an input file may decide.
pub(super) struct Options {
    given: Vec<PathBuf>,
    pub interface: Interface,
    pub properties: Option<Vec<f64>>,
    pub state: Option<Vec<(String, f64)>>,
    pub tangent: Measure,
    pub stress_state: StressState,
    pub name: Option<String>,
    pub temperature: Option<f64>,
    pub external: Vec<(String, f64)>,
    pub allow_inexact: bool,
    pub states: Option<PathBuf>,
    pub seed: u64,
    pub limit: Duration,
    pub total: Duration,
    pub reports: Vec<Reported>,
    source: Option<String>,
}

/// The files of a command line by their kinds: a library or sources, and perhaps an input file.
#[derive(Default)]
pub(super) struct Files {
    pub library: Option<PathBuf>,
    pub sources: Vec<PathBuf>,
    pub input: Option<PathBuf>,
}

/// Endings of files that a compiler or the linker takes.
const SOURCES: [&str; 13] = ["f", "for", "ftn", "f77", "f90", "f95", "f03", "f08", "c", "cc", "cpp", "cxx", "o"];

/// Options without a value, those for UMATs, and those for MFront.
const FLAGS: [&str; 5] = ["--umat", "--plane-strain", "--plane-stress", "--help", "--version"];
const FOR_UMATS: [&str; 5] = ["--state", "--tangent", "--name", "--temperature", "--plane-stress"];

/// Reads a command line.
///
/// # Errors
/// A sentence: which option, which value, what is allowed.
pub(super) fn parse(arguments: impl IntoIterator<Item = OsString>) -> Result<Request, String> {
    let mut options = Options::new();
    let mut names = Vec::new();
    let mut arguments = arguments.into_iter();
    while let Some(argument) = arguments.next() {
        let Some(option) = argument.to_str().filter(|text| text.starts_with('-') && *text != "-") else {
            options.given.push(argument.into());
            continue;
        };
        let (name, inline) =
            option.split_once('=').map_or((option, None), |(name, value)| (name, Some(value.to_owned())));
        match name {
            "--help" | "-h" => return Ok(Request::Help),
            "--version" | "-V" => return Ok(Request::Version),
            _ => {}
        }
        let value = match (FLAGS.contains(&name), inline) {
            (true, Some(value)) => return Err(format!("The option {name} takes no value, but has {value:?}.")),
            (true, None) => String::new(),
            (false, Some(value)) => value,
            (false, None) => {
                let next = arguments.next().and_then(|next| next.into_string().ok());
                next.ok_or_else(|| format!("The option {name} needs a value, or does not exist."))?
            }
        };
        options.set(name, &value).map_err(|wanted| format!("{name} {value}: {wanted}."))?;
        names.push(name.to_owned());
    }
    options.agree(&names)?;
    Ok(Request::Check(Box::new(options)))
}

impl Options {
    fn new() -> Self {
        Self {
            given: Vec::new(),
            interface: Interface::Umat,
            properties: None,
            state: None,
            tangent: Measure::JaumannKirchhoff,
            stress_state: StressState::Solid,
            name: None,
            temperature: None,
            external: Vec::new(),
            allow_inexact: false,
            states: None,
            seed: 1,
            limit: crate::library::child::LIMIT,
            total: Duration::from_secs(600),
            reports: Vec::new(),
            source: None,
        }
    }

    /// Takes an option. The error is the end of a sentence: what is allowed.
    fn set(&mut self, name: &str, value: &str) -> Result<(), String> {
        match name {
            "--umat" => self.interface = Interface::Umat,
            "--mfront" => self.interface = Interface::Mfront(value.to_owned()),
            "--c" => self.interface = Interface::C(value.to_owned()),
            "--properties" if value.is_empty() => self.properties = Some(Vec::new()),
            "--properties" => self.properties = Some(value.split(',').map(number).collect::<Result<_, _>>()?),
            "--state" => self.state = Some(internal_variables(value)?),
            "--tangent" => self.tangent = tangent(value)?,
            "--plane-strain" => self.stress_state = StressState::PlaneStrain,
            "--plane-stress" => self.stress_state = StressState::PlaneStress,
            "--name" => self.name = Some(value.to_owned()),
            "--temperature" => self.temperature = Some(number(value)?),
            "--external" => self.external.push(named(value)?),
            "--allow" if value == "inexact" => self.allow_inexact = true,
            "--allow" => return Err("only `inexact` can be allowed".to_owned()),
            "--states" => self.states = Some(value.into()),
            "--seed" => self.seed = value.parse().map_err(|_| "the seed must be a whole number from 0".to_owned())?,
            "--limit" => self.limit = seconds(value)?,
            "--total-limit" => self.total = seconds(value)?,
            "--report" => self.reports.push(reported(value)?),
            "--source" => self.source = Some(value.to_owned()),
            _ => return Err("there is no such option".to_owned()),
        }
        Ok(())
    }

    /// Fails if options exclude each other; `names` are those that were given.
    fn agree(&mut self, names: &[String]) -> Result<(), String> {
        let given = |wanted: &[&str]| names.iter().find(|name| wanted.contains(&name.as_str()));
        let both = |one, other| given(&[one]).is_some() && given(&[other]).is_some();
        for (one, other) in
            [("--umat", "--mfront"), ("--umat", "--c"), ("--mfront", "--c"), ("--plane-strain", "--plane-stress")]
        {
            if both(one, other) {
                return Err(format!("The options {one} and {other} exclude each other."));
            }
        }
        if let Some(name) = given(&FOR_UMATS).filter(|_| !matches!(self.interface, Interface::Umat)) {
            return Err(format!("The option {name} is for UMATs alone."));
        }
        if !self.external.is_empty() && !matches!(self.interface, Interface::Mfront(_)) {
            return Err("The option --external is for MFront alone.".to_owned());
        }
        if self.reports.is_empty() {
            self.reports.push(Reported { format: Format::Terminal, file: None });
        }
        Ok(())
    }

    /// The files by their kinds.
    ///
    /// # Errors
    /// No law, two laws, or two input files.
    pub(super) fn files(&self) -> Result<Files, String> {
        let mut files = Files::default();
        for file in &self.given {
            let place = match ending(file).as_str() {
                "inp" => &mut files.input,
                ending if SOURCES.contains(&ending) => {
                    files.sources.push(file.clone());
                    continue;
                }
                _ => &mut files.library,
            };
            if let Some(other) = place.replace(file.clone()) {
                return Err(format!("{} and {} are two files of a kind; give one.", other.display(), file.display()));
            }
        }
        match (&files.library, files.sources.is_empty()) {
            (None, true) => Err("There is no law: give a shared library or its source files.".to_owned()),
            (Some(library), false) => {
                Err(format!("{} and source files were given; give one of both.", library.display()))
            }
            _ => Ok(files),
        }
    }

    /// The source file for annotations; without the option, the one with the UMAT.
    pub(super) fn source_file(&self) -> Option<String> {
        let holds_umat = |file: &&&PathBuf| {
            let text = std::fs::read(file).unwrap_or_default();
            String::from_utf8_lossy(&text).to_lowercase().contains("subroutine umat")
        };
        let sources: Vec<&PathBuf> =
            self.given.iter().filter(|file| SOURCES.contains(&ending(file).as_str())).collect();
        let first = || sources.iter().find(holds_umat).or(sources.first()).map(|file| file.display().to_string());
        self.source.clone().or_else(first)
    }
}

/// The ending of a file's name, in small letters.
pub(super) fn ending(file: &Path) -> String {
    file.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

fn number(text: &str) -> Result<f64, String> {
    let value = text.trim().parse().ok().filter(|value: &f64| value.is_finite());
    value.ok_or_else(|| "it must be a finite number; commas without spaces separate several".to_owned())
}

fn seconds(text: &str) -> Result<Duration, String> {
    let limit = number(text).ok().and_then(|limit| Duration::try_from_secs_f64(limit).ok());
    limit.filter(|limit| !limit.is_zero()).ok_or_else(|| "it must be a number of seconds above 0".to_owned())
}

/// A name and a number: `alpha=0`.
fn named(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("it must be a name and a number, as in alpha=0")?;
    let value = number(value).map_err(|_| format!("the value of {name} must be a finite number"))?;
    Ok((name.to_owned(), value))
}

/// The number of internal variables, or their names with values at rest.
fn internal_variables(text: &str) -> Result<Vec<(String, f64)>, String> {
    if let Ok(count) = text.parse::<u16>() {
        return Ok(umat::state(count.into()));
    }
    let variable = |one: &str| {
        let (name, value) = if one.contains('=') { named(one)? } else { (one.to_owned(), 0.0) };
        let allowed = name.starts_with(|first: char| first.is_alphabetic() || first == '_');
        let wanted = || {
            let most = u16::MAX;
            format!("it must be a number from 0 to {most}, or names that begin with a letter, as in alpha=0,beta=1")
        };
        allowed.then_some((name, value)).ok_or_else(wanted)
    };
    text.split(',').map(variable).collect()
}

fn tangent(text: &str) -> Result<Measure, String> {
    match text.replace('_', "-").as_str() {
        "jaumann-kirchhoff" => Ok(Measure::JaumannKirchhoff),
        "jaumann-cauchy" => Ok(Measure::JaumannCauchy),
        "strain" => Ok(Measure::CauchyByStrain),
        _ => Err("jaumann-kirchhoff, jaumann-cauchy and strain are allowed".to_owned()),
    }
}

fn reported(text: &str) -> Result<Reported, String> {
    let (name, file) = text.split_once('=').map_or((text, None), |(name, file)| (name, Some(file.into())));
    let format = Format::from_name(name).map_err(|error| error.trim_end_matches('.').to_owned())?;
    Ok(Reported { format, file })
}
