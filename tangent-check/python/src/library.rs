//! Laws in shared libraries, and the program. A child process calls the law: another interpreter, with this module alone.

use crate::law::{OwnPaths, conclude, paths_for};
use crate::raised::Raised;
use crate::report::Report;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;
use tangent_check::convention::{Convention, Measure};
use tangent_check::law::{CallFailed, Law, Response, Step};
use tangent_check::library::child::{Child, Host, serve};
use tangent_check::library::{Description, Kind, LibraryLaw, StressState};
use tangent_check::roads::check_law;

/// The meanings of DDSDDE by their names.
const TANGENTS: [(&str, Measure); 3] = [
    ("jaumann_kirchhoff", Measure::JaumannKirchhoff),
    ("jaumann_cauchy", Measure::JaumannCauchy),
    ("strain", Measure::CauchyByStrain),
];

/// The measure of a UMAT's tangent.
fn measure(name: &str) -> PyResult<Measure> {
    let known = TANGENTS.into_iter().find(|(known, _)| *known == name);
    known.map(|(_, measure)| measure).ok_or_else(|| {
        let names = TANGENTS.map(|(name, _)| format!("\"{name}\"")).join(", ");
        PyValueError::new_err(format!("there is no tangent {name:?} of a UMAT; allowed are {names}"))
    })
}

/// How a UMAT is called: its CMNAME, its tangent, TEMP.
type Umat = (String, String, f64);

/// How a behaviour of MFront is called: its name, its external state variables.
type Mfront = (String, Vec<(String, f64)>);

fn kind(umat: Option<Umat>, mfront: Option<Mfront>, c: Option<String>) -> PyResult<Kind> {
    match (umat, mfront, c) {
        (Some((material, tangent, temperature)), None, None) => {
            Ok(Kind::Umat { material, tangent: measure(&tangent)?, temperature })
        }
        (None, Some((name, external)), None) => Ok(Kind::Mfront { name, external }),
        (None, None, Some(name)) => Ok(Kind::C { name }),
        _ => Err(PyValueError::new_err("say how the law is called: one of umat=True, mfront=NAME, c=NAME")),
    }
}

/// A law whose check Ctrl-C ends.
struct Interruptible<'py> {
    law: LibraryLaw,
    raised: Raised,
    py: Python<'py>,
}

impl Law for Interruptible<'_> {
    fn name(&self) -> String {
        self.law.name()
    }

    fn convention(&self) -> Convention {
        self.law.convention()
    }

    fn state_at_rest(&self) -> Vec<f64> {
        self.law.state_at_rest()
    }

    fn respond(&mut self, step: &Step) -> Result<Response, CallFailed> {
        self.raised.during(self.py, || Ok(()))?;
        self.law.respond(step)
    }
}

/// Loads this module, whose file is the argument, and serves. The module's symbols are global, so that a law finds the utility routines of Abaqus.
const CHILD: &str = "\
import os, sys, importlib.machinery as machinery, importlib.util as util
sys.setdlopenflags(os.RTLD_NOW | os.RTLD_GLOBAL)
loader = machinery.ExtensionFileLoader('_native', sys.argv[1])
module = util.module_from_spec(util.spec_from_loader('_native', loader))
loader.exec_module(module)
module.serve_law()";

/// The child: this interpreter, without the packages of the user, and the file of this module.
fn host(interpreter: PathBuf, module: PathBuf) -> Host {
    let mut arguments: Vec<OsString> = ["-I", "-S", "-c", CHILD].map(Into::into).to_vec();
    arguments.push(module.into());
    Host { program: interpreter, arguments }
}

/// Runs the program with its arguments; gives its exit code.
#[pyfunction]
pub fn run_program(py: Python<'_>, interpreter: PathBuf, module: PathBuf, arguments: Vec<OsString>) -> u8 {
    py.detach(|| tangent_check::program::run("tangent-check", arguments, host(interpreter, module)))
}

/// Checks a law in a library.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "called by the package alone")]
pub fn check_law_in_library(
    py: Python<'_>,
    interpreter: PathBuf,
    module: PathBuf,
    library: PathBuf,
    umat: Option<Umat>,
    mfront: Option<Mfront>,
    c: Option<String>,
    properties: Vec<f64>,
    state: Vec<(String, f64)>,
    plane_strain: bool,
    plane_stress: bool,
    states: Option<OwnPaths>,
    seed: u64,
    limit: f64,
) -> PyResult<Report> {
    let kind = kind(umat, mfront, c)?;
    let limit = Duration::try_from_secs_f64(limit).ok().filter(|limit| !limit.is_zero());
    let limit = limit.ok_or_else(|| PyValueError::new_err("limit must be a positive number of seconds"))?;
    let stress_state = match (plane_strain, plane_stress) {
        (false, false) => StressState::Solid,
        (true, false) => StressState::PlaneStrain,
        (false, true) => StressState::PlaneStress,
        _ => return Err(PyValueError::new_err("plane_strain and plane_stress exclude each other")),
    };
    let description = Description { library, kind, properties, state, stress_state };
    let child = Child::start(host(interpreter, module), description, limit);
    let child = child.map_err(|CallFailed(sentence)| PyValueError::new_err(sentence))?;
    let mut law = Interruptible { law: LibraryLaw::new(Box::new(child)), raised: Raised::default(), py };
    let paths = paths_for(&mut law, states, seed);
    let report = check_law(&mut law, &paths, seed);
    conclude(report, law.raised)
}

/// The Python code that the child process runs.
#[pyfunction]
pub fn serve_law(py: Python<'_>) -> PyResult<()> {
    py.detach(serve).map_err(|error| PyOSError::new_err(format!("this is for child processes alone: {error}")))
}
