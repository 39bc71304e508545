//! bfree from Python: scenes, simulations, what a step solves, and laws by their energy.
//! `package/bfree/__init__.pyi` is its manual for Python.

mod arrays;
mod energy;
mod law;
mod model;
mod scene;
mod simulation;
mod step;
mod system;

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::{PyErr, create_exception};
use std::error::Error;

create_exception!(
    bfree,
    SceneError,
    PyValueError,
    "A scene that cannot be used: which key, its value, what is allowed."
);
create_exception!(
    bfree,
    StepError,
    PyRuntimeError,
    "A step that failed; the simulation is as after the last good one."
);

/// The messages of an error and its causes, a line each.
fn chain(error: &dyn Error) -> String {
    ::bfree::causes::messages(error).join("\n  because: ")
}

fn scene_error(error: &(impl Error + 'static)) -> PyErr {
    SceneError::new_err(chain(error))
}

fn step_error(error: &(impl Error + 'static)) -> PyErr {
    StepError::new_err(chain(error))
}

/// The module in the package `bfree`.
#[pymodule(name = "_bfree")]
mod module {
    #[pymodule_export]
    use super::energy::{Number, det};
    #[pymodule_export]
    use super::law::Law;
    #[pymodule_export]
    use super::scene::Scene;
    #[pymodule_export]
    use super::simulation::{Particles, Simulation};
    #[pymodule_export]
    use super::step::Step;
    #[pymodule_export]
    use super::system::Tangent;
    #[pymodule_export]
    use super::{SceneError, StepError};
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
