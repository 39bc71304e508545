//! A law that is a Python function.

use crate::convention::Convention;
use crate::frozen;
use crate::raised::Raised;
use crate::report::Report;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use tangent_check::convention::{Convention as Meaning, Tensor};
use tangent_check::finding::{Reason, Report as Findings};
use tangent_check::law::{CallFailed, Law, Response, Step};
use tangent_check::matrix::Matrix;
use tangent_check::roads::check_law;
use tangent_check::states::{Path, for_law, paths};

/// The inputs of a law in a step.
#[pyclass(frozen, module = "tangent_check")]
pub struct LawStep {
    step: Step,
    stress: Tensor,
    dimension: usize,
}

impl LawStep {
    fn tensor<'py>(&self, py: Python<'py>, tensor: &Tensor) -> PyResult<Bound<'py, PyAny>> {
        let d = self.dimension;
        frozen(py, tensor[..d].iter().flat_map(|row| &row[..d]).copied().collect(), &[d, d])
    }
}

#[pymethods]
impl LawStep {
    /// F at the end of the step.
    #[getter(F)]
    fn gradient<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.tensor(py, &self.step.gradient)
    }

    /// F at the start of the step.
    #[getter(F_before)]
    fn gradient_before<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.tensor(py, &self.step.gradient_before)
    }

    /// The strain at the start of the step, turned by `rotation`.
    #[getter]
    fn strain<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.tensor(py, &self.step.strain)
    }

    /// Δε, the logarithm of the stretch of the step.
    #[getter]
    fn strain_increment<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.tensor(py, &self.step.strain_increment)
    }

    /// ΔR of F F_before⁻¹ = ΔV ΔR.
    #[getter]
    fn rotation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.tensor(py, &self.step.rotation)
    }

    /// The stress at the start of the step.
    #[getter]
    fn stress<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.tensor(py, &self.stress)
    }

    /// The internal variables at the start of the step.
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        frozen(py, self.step.state.clone(), &[self.step.state.len()])
    }

    /// Time at the start of the step.
    #[getter]
    fn time(&self) -> f64 {
        self.step.time
    }

    /// The length of the step.
    #[getter]
    fn dt(&self) -> f64 {
        self.step.length
    }

    /// The number of the step, from 1.
    #[getter]
    fn number(&self) -> usize {
        self.step.number
    }

    fn __repr__(&self) -> String {
        format!("<step {} of a law: F = {:?}, dt = {}>", self.step.number, self.step.gradient, self.step.length)
    }
}

/// A law that calls Python.
struct PythonLaw<'py> {
    name: String,
    convention: Meaning,
    dimension: usize,
    state: Vec<f64>,
    /// (stress, tangent, internal variables) of a step, as flat arrays.
    respond: Bound<'py, PyAny>,
    /// The stress alone.
    stress: Bound<'py, PyAny>,
    raised: Raised,
}

/// The numbers of a flat array.
type Numbers<'py> = PyReadonlyArray1<'py, f64>;

fn list(numbers: &Numbers<'_>) -> Vec<f64> {
    numbers.as_array().iter().copied().collect()
}

impl<'py> PythonLaw<'py> {
    fn step(&self, step: &Step) -> LawStep {
        let components = &self.convention.stress;
        let symmetric = self.convention.measure != tangent_check::convention::Measure::PiolaByGradient;
        let stress =
            if symmetric { components.symmetric_tensor(&step.stress) } else { components.full_tensor(&step.stress) };
        LawStep { step: step.clone(), stress, dimension: self.dimension }
    }
}

impl Law for PythonLaw<'_> {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn convention(&self) -> Meaning {
        self.convention.clone()
    }

    fn state_at_rest(&self) -> Vec<f64> {
        self.state.clone()
    }

    fn respond(&mut self, step: &Step) -> Result<Response, CallFailed> {
        let (given, respond) = (self.step(step), &self.respond);
        let (stress, tangent, state) = self.raised.during(respond.py(), || {
            let answer = respond.call1((given,))?;
            let (stress, tangent, state): (Numbers<'_>, Numbers<'_>, Numbers<'_>) = answer.extract()?;
            Ok((list(&stress), list(&tangent), list(&state)))
        })?;
        let [rows, columns] = [self.convention.stress.count(), self.convention.strain.count()];
        Ok(Response { stress, tangent: Matrix { rows, columns, entries: tangent }, state })
    }

    fn stress(&mut self, step: &Step) -> Result<Vec<f64>, CallFailed> {
        let (given, stress) = (self.step(step), &self.stress);
        self.raised.during(stress.py(), || Ok(list(&stress.call1((given,))?.extract::<Numbers<'_>>()?)))
    }
}

/// Paths that a user gives: a name, the deformation gradients in a row, and the length of each step.
pub type OwnPaths = Vec<(String, Vec<Tensor>, f64)>;

/// The paths of a user, or those that are made for the law.
pub fn paths_for(law: &mut dyn Law, own: Option<OwnPaths>, seed: u64) -> Vec<Path> {
    match own {
        Some(own) => own.into_iter().map(|(name, gradients, length)| Path::new(&name, gradients, length)).collect(),
        // A law that fails at the smallest strain is still called at the others.
        None => for_law(law, seed).unwrap_or_else(|_| paths(seed, law.convention().plane())),
    }
}

/// The report, or the exception that ended the check. If no state could be called at all, that is the first exception.
pub fn conclude(report: Findings, mut raised: Raised) -> PyResult<Report> {
    raised.end()?;
    let failed = |reason: &Option<Reason>| matches!(reason, Some(Reason::CallFailed(_)));
    match raised.first {
        Some(error) if report.findings.iter().all(|finding| failed(&finding.reason)) => Err(error),
        exception => Ok(Report { report, exception }),
    }
}

/// Checks a law.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "called by the package alone")]
pub fn check_python_law(
    name: String,
    convention: &Convention,
    dimension: usize,
    state: Vec<f64>,
    respond: Bound<'_, PyAny>,
    stress: Bound<'_, PyAny>,
    states: Option<OwnPaths>,
    seed: u64,
) -> PyResult<Report> {
    let convention = convention.0.clone();
    let raised = Raised::default();
    let mut law = PythonLaw { name, convention, dimension, state, respond, stress, raised };
    let paths = paths_for(&mut law, states, seed);
    let report = check_law(&mut law, &paths, seed);
    conclude(report, law.raised)
}
