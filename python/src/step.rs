//! The report of a step.

use crate::arrays::frozen;
use bfree::mechanics::loads::Prescribed;
use bfree::simulation::StepReport;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The report of a step.
#[pyclass(frozen, module = "bfree")]
pub struct Step {
    /// t at its end.
    #[pyo3(get)]
    time: f64,
    /// Its length.
    #[pyo3(get)]
    dt: f64,
    /// Newton's iterations.
    #[pyo3(get)]
    iterations: usize,
    /// Krylov iterations of them all.
    #[pyo3(get)]
    krylov_iterations: usize,
    /// ‖R‖ at the start of Newton's method and after each of its iterations.
    #[pyo3(get)]
    residuals: Vec<f64>,
    /// Nodes that some particle sees.
    #[pyo3(get)]
    active_nodes: usize,
    /// Its local error in units of the grid spacing, where the scene gives a tolerance.
    #[pyo3(get)]
    error: Option<f64>,
    /// Why earlier attempts failed, each repeated with half of its length.
    #[pyo3(get)]
    failed: Vec<String>,
    /// Seconds it took.
    #[pyo3(get)]
    seconds: f64,
    reactions: Vec<(String, Vec<f64>)>,
}

impl Step {
    pub fn of<const D: usize>(report: &StepReport<D>, time: f64, prescribed: &[Prescribed<D>]) -> Self {
        let history = &report.newton.history;
        let forces = report.reactions.iter().map(|one| one.force.iter().copied().collect());
        Self {
            time,
            dt: report.dt,
            iterations: history.iterations.len(),
            krylov_iterations: history.counts.krylov_iterations,
            residuals: history
                .first_residual
                .into_iter()
                .chain(history.iterations.iter().map(|one| one.residual))
                .collect(),
            active_nodes: report.active_nodes,
            error: report.error,
            failed: report.failed.iter().map(|attempt| attempt.why.clone()).collect(),
            seconds: report.seconds.seconds().iter().sum(),
            reactions: prescribed.iter().map(|one| one.name.clone()).zip(forces).collect(),
        }
    }
}

#[pymethods]
impl Step {
    /// The force of each prescribed condition on the bodies.
    #[getter]
    fn reactions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for (name, force) in &self.reactions {
            all.set_item(name, frozen(py, force.clone(), &[force.len()])?)?;
        }
        Ok(all)
    }

    fn __repr__(&self) -> String {
        let Self { time, dt, iterations, krylov_iterations, .. } = self;
        format!("<step to t = {time}, dt = {dt}: {iterations} Newton and {krylov_iterations} Krylov iterations>")
    }
}
