//! Reports, with their findings and diagnoses.

use crate::frozen;
use pyo3::exceptions::PyAssertionError;
use pyo3::prelude::*;
use tangent_check::finding::{
    Diagnosis as Explained, Entry as Compared, Finding as Checked, Reason, Report as Findings,
};
use tangent_check::matrix::Matrix;
use tangent_check::report::{Format, Options, write};

/// The checks of a law or a residual.
#[pyclass(frozen, module = "tangent_check")]
pub struct Report {
    pub report: Findings,
    /// The first exception that a function of the user raised.
    pub exception: Option<PyErr>,
}

impl Report {
    fn write(&self, format: Format, allow_inexact: bool, file: Option<String>) -> String {
        write(&self.report, format, &Options { file, allow_inexact })
    }

    /// The exit code.
    fn code(&self, allow_inexact: bool) -> u8 {
        self.report.exit_code(&Options { file: None, allow_inexact })
    }
}

#[pymethods]
impl Report {
    /// For the package alone.
    #[new]
    fn new(
        subject: String,
        names: (Vec<String>, Vec<String>),
        seed: u64,
        findings: Vec<PyRef<'_, Finding>>,
        diagnoses: Vec<PyRef<'_, Diagnosis>>,
        notes: Vec<String>,
        exception: Option<Bound<'_, PyAny>>,
    ) -> Self {
        let (rows, columns) = names;
        let findings = findings.iter().map(|finding| finding.0.clone()).collect();
        let diagnoses = diagnoses.iter().map(|diagnosis| diagnosis.0.clone()).collect();
        let report = Findings { rows, columns, seed, diagnoses, notes, ..Findings::new(&subject, findings) };
        Self { report, exception: exception.map(PyErr::from_value) }
    }

    /// "consistent", "inexact", "not checked" or "wrong".
    #[getter]
    fn verdict(&self) -> String {
        self.report.verdict().to_string()
    }

    /// Whether the tangent is consistent.
    #[getter]
    fn ok(&self) -> bool {
        self.code(false) == 0
    }

    /// The name of the state or term.
    #[getter]
    fn subject(&self) -> &str {
        &self.report.subject
    }

    /// The meaning of the tangent, with the order of its components.
    #[getter]
    fn convention(&self) -> &str {
        &self.report.convention
    }

    /// The seed of the states or directions.
    #[getter]
    fn seed(&self) -> u64 {
        self.report.seed
    }

    /// The checks.
    #[getter]
    fn findings(&self) -> Vec<Finding> {
        self.report.findings.iter().cloned().map(Finding).collect()
    }

    /// The mistakes that explain a wrong tangent.
    #[getter]
    fn diagnoses(&self) -> Vec<Diagnosis> {
        self.report.diagnoses.iter().cloned().map(Diagnosis).collect()
    }

    /// Sentences for the reader.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.report.notes.clone()
    }

    /// The first exception that a function of the user raised.
    #[getter]
    fn exception<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyAny>> {
        self.exception.as_ref().map(|error| error.value(py).clone().into_any())
    }

    /// Raises an AssertionError with the report unless the tangent is consistent, or inexact and `allow_inexact`.
    #[pyo3(signature = (*, allow_inexact = false))]
    fn assert_consistent(&self, py: Python<'_>, allow_inexact: bool) -> PyResult<()> {
        if self.code(allow_inexact) == 0 {
            return Ok(());
        }
        let error =
            PyAssertionError::new_err(format!("\n{}", self.write(Format::Terminal, allow_inexact, None).trim_end()));
        error.set_cause(py, self.exception.as_ref().map(|exception| exception.clone_ref(py)));
        Err(error)
    }

    /// The exit code of a program: 0 consistent, 1 wrong or inexact, 2 not checked. An inexact tangent gives 0 if `allow_inexact`.
    #[pyo3(signature = (*, allow_inexact = false))]
    fn exit_code(&self, allow_inexact: bool) -> u8 {
        self.code(allow_inexact)
    }

    /// GitHub's Markdown.
    #[pyo3(signature = (*, allow_inexact = false))]
    fn to_markdown(&self, allow_inexact: bool) -> String {
        self.write(Format::Markdown, allow_inexact, None)
    }

    /// All numbers.
    #[pyo3(signature = (*, allow_inexact = false))]
    fn to_json(&self, allow_inexact: bool) -> String {
        self.write(Format::Json, allow_inexact, None)
    }

    /// JUnit XML.
    #[pyo3(signature = (*, allow_inexact = false))]
    fn to_junit(&self, allow_inexact: bool) -> String {
        self.write(Format::Junit, allow_inexact, None)
    }

    /// A SARIF 2.1.0 log; its results point to `file`.
    #[pyo3(signature = (file = None, *, allow_inexact = false))]
    fn to_sarif(&self, file: Option<String>, allow_inexact: bool) -> String {
        self.write(Format::Sarif, allow_inexact, file)
    }

    /// Annotations of GitHub Actions, which point to `file`.
    #[pyo3(signature = (file = None, *, allow_inexact = false))]
    fn to_github(&self, file: Option<String>, allow_inexact: bool) -> String {
        self.write(Format::Github, allow_inexact, file)
    }

    fn _repr_markdown_(&self) -> String {
        self.write(Format::Markdown, false, None)
    }

    fn __str__(&self) -> String {
        self.write(Format::Terminal, false, None).trim_end().to_owned()
    }

    fn __repr__(&self) -> String {
        let Findings { subject, findings, .. } = &self.report;
        format!("<tangent check of {subject}: {}, {} findings>", self.report.verdict(), findings.len())
    }
}

/// The check of one tangent in one state.
#[pyclass(frozen, module = "tangent_check")]
pub struct Finding(pub Checked);

fn array<'py>(py: Python<'py>, matrix: &Matrix) -> PyResult<Bound<'py, PyAny>> {
    frozen(py, matrix.entries.clone(), &[matrix.rows, matrix.columns])
}

#[pymethods]
impl Finding {
    /// The state or term.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// "consistent", "inexact", "not checked" or "wrong".
    #[getter]
    fn verdict(&self) -> String {
        self.0.verdict.to_string()
    }

    /// Why the tangent is inexact or was not checked, in a word or two.
    #[getter]
    fn reason(&self) -> Option<&'static str> {
        self.0.reason.as_ref().map(|reason| match reason {
            Reason::ForwardDifference(_) => "forward difference",
            Reason::SinglePrecision => "single precision",
            Reason::LocalIteration(_) => "local iteration",
            Reason::RoundOff => "round-off",
            Reason::NotFound => "not found",
            Reason::Kink => "kink",
            Reason::NothingExercised => "nothing exercised",
            Reason::ZeroResponse => "zero response",
            Reason::TooNoisy(_) => "too noisy",
            Reason::ControlMissed(_) => "control missed",
            Reason::CallFailed(_) => "call failed",
        })
    }

    /// Why the tangent is inexact or was not checked, in a sentence.
    #[getter]
    fn sentence(&self) -> Option<String> {
        self.0.reason.as_ref().map(ToString::to_string)
    }

    /// The entry that deviates most.
    #[getter]
    fn worst(&self) -> Option<Entry> {
        self.0.worst.map(Entry)
    }

    /// The greatest deviation, relative to the greatest entry.
    #[getter]
    fn deviation(&self) -> f64 {
        self.0.deviation
    }

    /// The greatest estimated error of the differences, with the same scale.
    #[getter]
    fn error(&self) -> f64 {
        self.0.error
    }

    /// The noise of the response, relative to its greatest component.
    #[getter]
    fn noise(&self) -> f64 {
        self.0.noise
    }

    /// The smallest planted error that the check saw, relative to the spoiled entry.
    #[getter]
    fn control(&self) -> Option<f64> {
        self.0.control
    }

    /// Calls of the stress or residual.
    #[getter]
    fn calls(&self) -> usize {
        self.0.calls
    }

    /// The tangent as claimed.
    #[getter]
    fn claimed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, &self.0.claimed)
    }

    /// The tangent as measured.
    #[getter]
    fn measured<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, &self.0.measured)
    }

    /// The estimated errors of the measured entries.
    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, &self.0.errors)
    }

    fn __repr__(&self) -> String {
        format!("<{}: {}, deviation {:.1e}>", self.0.name, self.0.verdict, self.0.deviation)
    }
}

/// An entry of a tangent.
#[pyclass(frozen, module = "tangent_check")]
pub struct Entry(Compared);

#[pymethods]
impl Entry {
    /// From 0.
    #[getter]
    fn row(&self) -> usize {
        self.0.row
    }

    /// From 0.
    #[getter]
    fn column(&self) -> usize {
        self.0.column
    }

    /// As claimed.
    #[getter]
    fn claimed(&self) -> f64 {
        self.0.claimed
    }

    /// As measured.
    #[getter]
    fn measured(&self) -> f64 {
        self.0.measured
    }

    /// The estimated error of `measured`.
    #[getter]
    fn error(&self) -> f64 {
        self.0.error
    }

    fn __repr__(&self) -> String {
        let Compared { row, column, claimed, measured, error } = self.0;
        format!("<entry ({row}, {column}): claimed {claimed:e}, measured {measured:e} ± {error:.0e}>")
    }
}

/// A mistake that explains a wrong tangent.
#[pyclass(frozen, module = "tangent_check")]
pub struct Diagnosis(pub Explained);

#[pymethods]
impl Diagnosis {
    /// For the package alone.
    #[new]
    fn new(sentence: String) -> Self {
        let candidates = vec![sentence.clone()];
        Self(Explained { sentence, candidates, states_that_tell: Vec::new(), coefficient: None, share: 1.0 })
    }

    /// The mistake in a sentence.
    #[getter]
    fn sentence(&self) -> &str {
        &self.0.sentence
    }

    /// All mistakes that explain the tangent equally well.
    #[getter]
    fn candidates(&self) -> Vec<String> {
        self.0.candidates.clone()
    }

    /// States that would tell the candidates apart.
    #[getter]
    fn states_that_tell(&self) -> Vec<String> {
        self.0.states_that_tell.clone()
    }

    /// The part of the deviation that the mistake explains.
    #[getter]
    fn share(&self) -> f64 {
        self.0.share
    }

    /// The coefficient of a fitted term.
    #[getter]
    fn coefficient(&self) -> Option<f64> {
        self.0.coefficient
    }

    fn __str__(&self) -> String {
        self.0.sentence.clone()
    }

    fn __repr__(&self) -> String {
        format!("<diagnosis: {}>", self.0.sentence)
    }
}
