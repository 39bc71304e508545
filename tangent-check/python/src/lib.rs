//! The check of tangents from Python: laws and residuals that are Python functions, laws in shared libraries, the order of Newton's method, and
//! the program. `package/tangent_check/__init__.pyi` is its manual for Python.
//!
//! The package's Python code (`package/tangent_check/checks.py`) gives the functions here flat arrays; shapes are its concern.

mod convention;
mod law;
#[cfg(unix)]
mod library;
mod newton;
mod raised;
mod report;
mod residual;

use numpy::{Element, PyArray1, PyArrayMethods};
use pyo3::prelude::*;

/// A read-only array of this shape, which owns its numbers.
fn frozen<'py, T: Element>(py: Python<'py>, data: Vec<T>, shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    let flat = PyArray1::from_vec(py, data).readwrite().make_nonwriteable();
    Ok(flat.reshape(shape)?.into_any())
}

/// The module in the package `tangent_check`.
#[pymodule(name = "_native")]
mod module {
    #[pymodule_export]
    use super::convention::Convention;
    #[pymodule_export]
    use super::law::{LawStep, check_python_law};
    #[cfg(unix)]
    #[pymodule_export]
    use super::library::{check_law_in_library, run_program, serve_law};
    #[pymodule_export]
    use super::newton::{NewtonOrder, newton_order, newton_rows};
    #[pymodule_export]
    use super::report::{Diagnosis, Entry, Finding, Report};
    #[pymodule_export]
    use super::residual::check_residual;
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
