//! Arrays that go to Python: they own what is in them, so that nothing the solver moves is ever seen from there.

use numpy::{Element, PyArray1, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A read-only array of this shape.
pub fn frozen<'py, T: Element>(py: Python<'py>, data: Vec<T>, shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    let flat = PyArray1::from_vec(py, data).readwrite().make_nonwriteable();
    Ok(flat.reshape(shape)?.into_any())
}

/// The numbers of an array of so many, in whatever shape, one row after the other.
pub fn numbers(what: &str, array: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<f64>> {
    let double = [("dtype", "float64"), ("order", "C")];
    let array = array.py().import("numpy")?.call_method(
        "asarray",
        (array,),
        Some(&pyo3::types::IntoPyDict::into_py_dict(double, array.py())?),
    )?;
    let array: PyReadonlyArrayDyn<'_, f64> = array.extract()?;
    if array.len() != count {
        let message =
            format!("{what} has {} numbers, in the shape {:?}; {count} are needed", array.len(), array.shape());
        return Err(PyValueError::new_err(message));
    }
    Ok(array.as_array().iter().copied().collect())
}
