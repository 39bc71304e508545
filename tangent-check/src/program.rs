//! The program `tangent-check`: whether the tangent of a law in a source file or a shared library is the derivative of its stress.
//!
//! [`run`] is the whole program, so that other programs can have it as a command.

mod abaqus_input;
mod compiler;
mod options;
mod own_paths;
mod watch;

use crate::law::{CallFailed, Law};
use crate::library::child::{Child, Host};
use crate::library::{Description, Kind, LibraryLaw, umat};
use crate::report;
use crate::roads::check_law;
use crate::states::for_law;
use abaqus_input::Input;
use compiler::Compiled;
use options::{Files, Interface, Options, Reported, Request};
use std::ffi::OsString;
use std::io::Write;
use watch::Watched;

/// The exit code if the law cannot be called or an option is not allowed.
const UNUSABLE: u8 = 2;

/// Checks a law and writes its reports; `name` is the name of the program in its help. The child process that calls the law is `host`.
/// The exit code is 0 for a consistent tangent, 1 for a wrong one and for an inexact one that is not allowed, 2 if the law cannot be called,
/// an option is not allowed, or if the check cannot tell.
pub fn run(name: &str, arguments: impl IntoIterator<Item = OsString>, host: Host) -> u8 {
    let checked = match options::parse(arguments) {
        Ok(Request::Help) => print(options::HELP.replace("PROGRAM", name).trim_end()).map(|()| 0),
        Ok(Request::Version) => print(&format!("tangent-check {}", env!("CARGO_PKG_VERSION"))).map(|()| 0),
        Ok(Request::Check(options)) => check(*options, host),
        Err(sentence) => Err(format!("{sentence} `{name} --help` lists the options.")),
    };
    checked.unwrap_or_else(|sentence| {
        let _ = writeln!(std::io::stderr(), "error: {sentence}");
        UNUSABLE
    })
}

/// Writes to standard output. A pipe that its reader has closed, as `head` does, is not an error.
fn print(text: &str) -> Result<(), String> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(format!("The standard output cannot be written: {error}."))
        }
        _ => Ok(()),
    }
}

fn check(options: Options, host: Host) -> Result<u8, String> {
    let files = options.files()?;
    let input = files.input.as_deref().map(abaqus_input::read).transpose()?;
    let described = description(&options, input.as_ref())?;
    // The compiled library is deleted when the check ends.
    let (library, compiled) = match files {
        Files { library: Some(library), .. } => (library, None),
        Files { sources, .. } => {
            let compiled = Compiled::new(&sources)?;
            (compiled.library(), Some(compiled))
        }
    };
    let description = Description { library, ..described };
    let (properties, state) = (description.properties.len(), description.state.len());
    let child = Child::start(host, description, options.limit).map_err(|CallFailed(sentence)| sentence)?;
    let law = LibraryLaw::new(Box::new(child));
    // A compiled library has another place each time; the same law must give the same report.
    let name = options.source_file().filter(|_| compiled.is_some()).unwrap_or_else(|| law.name());
    let mut law = Watched::new(law, name, options.total);
    let paths = match &options.states {
        Some(file) => own_paths::read(file)?,
        None => for_law(&mut law, options.seed).map_err(|CallFailed(sentence)| {
            format!(
                "The law fails in a first step of tiny strain. It was called with {properties} properties (--properties) and {state} \
                 internal variables (--state).\n  because: {sentence}"
            )
        })?,
    };
    law.expect(paths.iter().map(|path| path.steps()).sum());
    let report = check_law(&mut law, &paths, options.seed);
    let shown = report::Options { file: options.source_file(), allow_inexact: options.allow_inexact };
    for Reported { format, file } in &options.reports {
        let text = report::write(&report, *format, &shown);
        match file {
            None => print(text.trim_end())?,
            Some(path) => std::fs::write(path, text)
                .map_err(|error| format!("The report {} cannot be written: {error}.", path.display()))?,
        }
    }
    Ok(report.exit_code(&shown))
}

/// The law, but for its library. Options replace what the input file says.
fn description(options: &Options, input: Option<&Input>) -> Result<Description, String> {
    let mut properties = options.properties.clone().unwrap_or_default();
    let mut state = options.state.clone().unwrap_or_default();
    let mut material = options.name.clone().unwrap_or_else(|| "MATERIAL".to_owned());
    if let Some(input) = input {
        let chosen = input.material(options.name.as_deref())?;
        material = chosen.name.to_uppercase();
        if options.properties.is_none() {
            properties = chosen.properties.clone();
        }
        if options.state.is_none() {
            state = umat::state(chosen.variables);
            state.iter_mut().zip(&input.state).for_each(|((_, value), given)| *value = *given);
        }
    }
    let temperature = options.temperature.or(input.and_then(|input| input.temperature)).unwrap_or(0.0);
    let kind = match options.interface.clone() {
        Interface::Umat => Kind::Umat { material, tangent: options.tangent, temperature },
        Interface::Mfront(name) => Kind::Mfront { name, external: options.external.clone() },
        Interface::C(name) => Kind::C { name },
    };
    Ok(Description { library: Default::default(), kind, properties, state, stress_state: options.stress_state })
}
