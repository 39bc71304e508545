//! A law in a shared library. A child process calls it: another interpreter, with this package.

use super::Raised;
use super::law::{OwnPaths, conclude, paths_for};
use super::report::Report;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::time::Duration;
use tangent_check::convention::{Convention, Measure};
use tangent_check::law::{CallFailed, Law, Response, Step};
use tangent_check::library::child::{Child, Host, serve};
use tangent_check::library::{Description, Kind, LibraryLaw};
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

/// Checks a law in a library; `program` is the interpreter that the child runs.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "called by the package alone")]
pub fn check_law_in_library(
    py: Python<'_>,
    program: PathBuf,
    library: PathBuf,
    umat: Option<Umat>,
    mfront: Option<Mfront>,
    c: Option<String>,
    properties: Vec<f64>,
    state: Vec<(String, f64)>,
    plane_strain: bool,
    states: Option<OwnPaths>,
    seed: u64,
    limit: f64,
) -> PyResult<Report> {
    let kind = kind(umat, mfront, c)?;
    let limit = Duration::try_from_secs_f64(limit).ok().filter(|limit| !limit.is_zero());
    let limit = limit.ok_or_else(|| PyValueError::new_err("limit must be a positive number of seconds"))?;
    let arguments = ["-c", "from bfree import _bfree; _bfree.serve_law()"].map(Into::into).to_vec();
    let description = Description { library, kind, properties, state, plane_strain };
    let child = Child::start(Host { program, arguments }, description, limit);
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
