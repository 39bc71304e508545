//! The order of Newton's method.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tangent_check::convergence::{Order, Solution, TableForm, table};

/// The order of convergence that residual norms show.
#[pyclass(frozen, module = "tangent_check")]
pub struct NewtonOrder {
    solution: Solution,
}

#[pymethods]
impl NewtonOrder {
    /// "quadratic", "superlinear", "linear", "round-off at once", "unknown" or "not finite".
    #[getter]
    fn kind(&self) -> &'static str {
        match self.solution.order() {
            Order::Quadratic(_) => "quadratic",
            Order::Superlinear(_) => "superlinear",
            Order::Linear(_) => "linear",
            Order::Immediate => "round-off at once",
            Order::Unknown => "unknown",
            Order::NotFinite => "not finite",
        }
    }

    /// The number.
    #[getter]
    fn order(&self) -> Option<f64> {
        match self.solution.order() {
            Order::Quadratic(order) | Order::Superlinear(order) | Order::Linear(order) => Some(order),
            _ => None,
        }
    }

    /// The order that each iteration shows, from the second on.
    #[getter]
    fn orders(&self) -> Vec<Option<f64>> {
        self.solution.orders()
    }

    /// Whether the norms do not contradict quadratic convergence.
    #[getter]
    fn is_quadratic(&self) -> bool {
        self.solution.order().is_quadratic()
    }

    fn __str__(&self) -> String {
        self.solution.order().to_string()
    }

    fn __repr__(&self) -> String {
        format!("<order of convergence: {}>", self.solution.order())
    }
}

/// The order of convergence.
#[pyfunction]
#[pyo3(signature = (norms, *, round_off = None))]
pub fn newton_order(norms: Vec<f64>, round_off: Option<f64>) -> NewtonOrder {
    NewtonOrder { solution: Solution { name: String::new(), norms, round_off } }
}

/// The table of named solutions.
#[pyfunction]
pub fn newton_rows(solutions: Vec<(String, Vec<f64>)>, form: &str, round_off: Option<f64>) -> PyResult<String> {
    let form = match form {
        "text" => TableForm::Text,
        "markdown" => TableForm::Markdown,
        "latex" => TableForm::Latex,
        "csv" => TableForm::Csv,
        other => {
            let message = format!("there is no form {other:?} of a table; allowed are text, markdown, latex, csv");
            return Err(PyValueError::new_err(message));
        }
    };
    let solutions: Vec<Solution> =
        solutions.into_iter().map(|(name, norms)| Solution { name, norms, round_off }).collect();
    Ok(table(&solutions, form))
}
