//! A simulation, and its particles as arrays.

use crate::arrays::{frozen, numbers};
use crate::model::Model;
use crate::step::Step;
use crate::system::{System, Tangent};
use crate::{chain, step_error};
use bfree::field::{Field, Kind};
use bfree::output::OutputError;
use bfree::solver::Stop;
use pyo3::exceptions::PyAttributeError;
use pyo3::prelude::*;
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

/// A simulation: an iterator over its steps.
#[pyclass(module = "bfree")]
pub struct Simulation {
    model: Box<dyn Model>,
    /// `time.end`
    end: f64,
    /// Names of the bodies.
    #[pyo3(get)]
    bodies: Vec<String>,
    /// The plan of a step, as text.
    #[pyo3(get)]
    plan: String,
    /// Results that are kept until the state changes.
    arrays: HashMap<Field, Py<PyAny>>,
    coming: Option<Arc<dyn System>>,
}

impl Simulation {
    pub fn new(model: Box<dyn Model>, end: f64, bodies: Vec<String>, plan: String) -> Self {
        Self { model, end, bodies, plan, arrays: HashMap::new(), coming: None }
    }

    fn next_step(&mut self, py: Python<'_>) -> PyResult<Arc<dyn System>> {
        if let Some(coming) = &self.coming {
            return Ok(coming.clone());
        }
        let coming = py.detach(|| self.model.next_step()).map_err(|error| step_error(&error))?;
        self.coming = Some(coming.clone());
        Ok(coming)
    }

    fn array(&mut self, py: Python<'_>, field: Field) -> PyResult<Py<PyAny>> {
        if let Some(array) = self.arrays.get(&field) {
            return Ok(array.clone_ref(py));
        }
        let values = py.detach(|| self.model.values(&field)).map_err(|error| missing(&error))?;
        let array = shaped(py, field.kind(), self.model.dimension(), &values)?.unbind();
        self.arrays.insert(field, array.clone_ref(py));
        Ok(array)
    }
}

/// An entry a particle: numbers, vectors of D components, or tensors of 3×3.
fn shaped<'py>(py: Python<'py>, kind: Kind, dimension: usize, values: &[f64]) -> PyResult<Bound<'py, PyAny>> {
    let count = values.len() / kind.components().len();
    let each = |components: &[usize]| {
        let rows = values.chunks_exact(kind.components().len());
        rows.flat_map(|row| components.iter().map(|&i| row[i])).collect::<Vec<f64>>()
    };
    match kind {
        Kind::Scalar => frozen(py, values.to_vec(), &[count]),
        Kind::Index => frozen(py, values.iter().map(|&x| x as i64).collect(), &[count]),
        Kind::Vector => frozen(py, each(&[0, 1, 2][..dimension]), &[count, dimension]),
        Kind::Principal => frozen(py, values.to_vec(), &[count, 3]),
        // xx, yy, zz, xy, yz, xz
        Kind::Symmetric => frozen(py, each(&[0, 3, 5, 3, 1, 4, 5, 4, 2]), &[count, 3, 3]),
        Kind::Tensor => frozen(py, values.to_vec(), &[count, 3, 3]),
    }
}

#[pymethods]
impl Simulation {
    /// Takes a step. Ctrl-C ends it before the next iteration of Newton's method, and nothing has moved.
    fn advance(&mut self, py: Python<'_>) -> PyResult<Step> {
        self.arrays.clear();
        self.coming = None;
        let raised = Arc::new(Mutex::new(None));
        let seen = raised.clone();
        self.model.stop(Some(Stop(Arc::new(move || {
            let signals = Python::attach(|py| py.check_signals());
            signals.map_err(|error| seen.lock().map(|mut seen| *seen = Some(error))).is_err()
        }))));
        let step = py.detach(|| self.model.advance());
        self.model.stop(None);
        match raised.lock().ok().and_then(|mut raised| raised.take()) {
            Some(error) => Err(error),
            None => step.map_err(|error| step_error(&error)),
        }
    }

    fn __iter__(this: Py<Self>) -> Py<Self> {
        this
    }

    /// Loops in C, too, can be interrupted between steps. A last step that would lead beyond the end is shortened.
    fn __next__(&mut self, py: Python<'_>) -> PyResult<Option<Step>> {
        py.check_signals()?;
        let clock = *self.model.clock();
        if clock.has_reached(self.end) {
            return Ok(None);
        }
        if let Some(rest) = clock.to(self.end).filter(|_| clock.on_nominal()) {
            self.model.set_clock(rest);
        }
        self.advance(py).map(Some)
    }

    #[getter]
    fn dimension(&self) -> usize {
        self.model.dimension()
    }

    #[getter]
    fn time(&self) -> f64 {
        self.model.clock().time()
    }

    /// Length of the coming step.
    #[getter]
    fn dt(&self) -> f64 {
        self.model.clock().step()
    }

    /// When the last step ends.
    #[getter]
    fn end(&self) -> f64 {
        self.end
    }

    #[getter]
    fn kinetic_energy(&self) -> f64 {
        self.model.kinetic_energy()
    }

    #[getter]
    fn strain_energy(&self, py: Python<'_>) -> f64 {
        py.detach(|| self.model.strain_energy())
    }

    #[getter]
    fn external_work(&self) -> f64 {
        self.model.external_work()
    }

    #[getter]
    fn dissipated(&self) -> f64 {
        self.model.dissipated()
    }

    #[getter]
    fn momentum<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        frozen(py, self.model.momentum(), &[self.model.dimension()])
    }

    #[getter]
    fn particles(this: Py<Self>) -> Particles {
        Particles { simulation: this }
    }

    /// Positions of the active nodes of the coming step.
    #[getter]
    fn nodes<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let coming = self.next_step(py)?;
        frozen(py, coming.nodes(), &coming.shape())
    }

    /// Which components of them are solved for.
    #[getter]
    fn free<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let coming = self.next_step(py)?;
        frozen(py, coming.free(), &coming.shape())
    }

    /// The motion of those that are not; 0 elsewhere.
    #[getter]
    fn prescribed<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let coming = self.next_step(py)?;
        frozen(py, coming.prescribed(), &coming.shape())
    }

    /// R(Δφ) of the coming step.
    fn residual<'py>(&mut self, py: Python<'py>, dphi: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let coming = self.next_step(py)?;
        let shape = coming.shape();
        let dphi = numbers("dphi", dphi, shape.iter().product())?;
        let residual = py.detach(|| coming.residual(&dphi)).map_err(|error| step_error(&error))?;
        frozen(py, residual, &shape)
    }

    /// K at Δφ, by default at the start of the step.
    #[pyo3(signature = (dphi = None))]
    fn tangent<'py>(&mut self, py: Python<'py>, dphi: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let system = self.next_step(py)?;
        let order = system.shape().iter().product();
        let dphi = dphi.map_or_else(|| Ok(vec![0.0; order]), |dphi| numbers("dphi", dphi, order))?;
        Tangent { system, dphi }.operator(py)
    }

    /// K at the start of the coming step.
    #[getter(K)]
    fn k<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.tangent(py, None)
    }

    /// The particles as points of PyVista, with these fields.
    #[pyo3(name = "to_pyvista", signature = (fields = vec!["displacement".to_owned(), "von_mises".to_owned(), "body".to_owned()]))]
    fn pyvista<'py>(&mut self, py: Python<'py>, fields: Vec<String>) -> PyResult<Bound<'py, PyAny>> {
        let values = py.detach(|| self.model.values(&Field::Position)).map_err(|error| missing(&error))?;
        let count = values.len() / 3;
        let points = py
            .import("pyvista")?
            .call_method1("PolyData", (frozen(py, values, &[count, 3])?.call_method0("copy")?,))?;
        let data = points.getattr("point_data")?;
        for name in fields {
            let field = field(&name);
            let array = match field.kind() {
                // Vectors have three components there.
                Kind::Vector => {
                    let values = py.detach(|| self.model.values(&field)).map_err(|error| missing(&error))?;
                    frozen(py, values, &[count, 3])?
                }
                Kind::Symmetric | Kind::Tensor => {
                    self.array(py, field)?.bind(py).call_method1("reshape", (count, 9))?
                }
                Kind::Scalar | Kind::Index | Kind::Principal => self.array(py, field)?.into_bound(py),
            };
            data.set_item(name, array.call_method0("copy")?)?;
        }
        Ok(points)
    }

    fn __repr__(&self) -> String {
        format!("<simulation in {} dimensions at t = {} of {}>", self.dimension(), self.time(), self.end())
    }
}

/// A field that this simulation does not have.
fn missing(error: &OutputError) -> PyErr {
    let OutputError::Internal { name, .. } = error else { return PyAttributeError::new_err(chain(error)) };
    let names: Vec<&str> = Field::ALL.iter().map(Field::name).collect();
    PyAttributeError::new_err(format!(
        "particles have no {name:?}; they have {}, and {}",
        names.join(", "),
        chain(error)
    ))
}

/// A field by its name. Any other name is that of an internal variable.
fn field(name: &str) -> Field {
    let known = Field::ALL.iter().find(|field| field.name() == name);
    known.cloned().unwrap_or_else(|| Field::Internal(name.to_owned()))
}

/// The particles of a simulation, by their numbers.
#[pyclass(frozen, module = "bfree")]
pub struct Particles {
    simulation: Py<Simulation>,
}

#[pymethods]
impl Particles {
    fn __getattr__(&self, py: Python<'_>, name: &str) -> PyResult<Py<PyAny>> {
        let field = field(name);
        self.simulation.try_borrow_mut(py)?.array(py, field)
    }

    fn __dir__(&self) -> Vec<&'static str> {
        Field::ALL.iter().map(Field::name).collect()
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.__getattr__(py, "mass")?.bind(py).len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("<{} particles>", self.__len__(py)?))
    }
}
