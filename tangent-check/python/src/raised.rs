//! Exceptions that a user's function raises during a check.

use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use tangent_check::law::CallFailed;

/// The exception that a user's function raised.
#[derive(Default)]
pub struct Raised {
    /// The first exception: it became a finding.
    pub first: Option<PyErr>,
    /// An exception that ends the check, such as Ctrl-C.
    pub fatal: Option<PyErr>,
}

impl Raised {
    /// Makes a call. An exception is a failed call, with its type, text and place; one that is no `Exception` ends the check.
    pub fn during<T>(&mut self, py: Python<'_>, call: impl FnOnce() -> PyResult<T>) -> Result<T, CallFailed> {
        if self.fatal.is_some() {
            return Err(CallFailed("The check was interrupted.".to_owned()));
        }
        py.check_signals().and_then(|()| call()).map_err(|error| {
            let sentence = sentence(py, &error);
            let slot = if error.is_instance_of::<PyException>(py) { &mut self.first } else { &mut self.fatal };
            slot.get_or_insert(error);
            CallFailed(sentence)
        })
    }

    /// Fails with the exception that ends the check.
    pub fn end(&mut self) -> PyResult<()> {
        self.fatal.take().map_or(Ok(()), Err)
    }
}

/// "ValueError: the text (mine.py, line 12)"
fn sentence(py: Python<'_>, error: &PyErr) -> String {
    place(py, error).map_or_else(|_| error.to_string(), |place| format!("{error}{place}"))
}

/// The innermost line of Python code that an exception came from.
fn place(py: Python<'_>, error: &PyErr) -> PyResult<String> {
    let frames = py.import("traceback")?.call_method1("extract_tb", (error.traceback(py),))?;
    if frames.len()? == 0 {
        return Ok(String::new());
    }
    let last = frames.get_item(-1)?;
    let file: std::path::PathBuf = last.getattr("filename")?.extract()?;
    let file = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(format!(" ({file}, line {})", last.getattr("lineno")?.str()?))
}
