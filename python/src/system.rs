//! The equations of the next step: R(Δφ) and its derivative K.

use crate::arrays::{frozen, numbers};
use crate::law::BodyLaw;
use crate::step_error;
use bfree::approximation::Approximation;
use bfree::mechanics::residual::Inadmissible;
use bfree::simulation::NextStep;
use bfree::tensor::Vector;
use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::sync::Arc;

/// The coming step of any dimension; fields are lists of numbers, node after node.
pub trait System: Send + Sync {
    /// Active nodes, and components of each.
    fn shape(&self) -> [usize; 2];
    fn nodes(&self) -> Vec<f64>;
    /// The motion of what is not solved for, up to where forces are in balance; 0 elsewhere.
    fn prescribed(&self) -> Vec<f64>;
    fn free(&self) -> Vec<bool>;
    fn residual(&self, dphi: &[f64]) -> Result<Vec<f64>, Inadmissible>;
    /// K(Δφ) u of each u.
    fn products(&self, dphi: &[f64], us: &[Vec<f64>]) -> Result<Vec<Vec<f64>>, Inadmissible>;
}

/// Node after node.
fn vectors<const D: usize>(field: &[f64]) -> Vec<Vector<f64, D>> {
    field.chunks_exact(D).map(Vector::from_column_slice).collect()
}

fn flat<const D: usize>(field: &[Vector<f64, D>]) -> Vec<f64> {
    field.iter().flatten().copied().collect()
}

impl<const D: usize> System for NextStep<D, BodyLaw, Approximation> {
    fn shape(&self) -> [usize; 2] {
        [NextStep::nodes(self).len(), D]
    }

    fn nodes(&self) -> Vec<f64> {
        flat(&self.positions().collect::<Vec<_>>())
    }

    fn prescribed(&self) -> Vec<f64> {
        let mut motion = vec![0.0; NextStep::nodes(self).len() * D];
        for dof in NextStep::prescribed(self) {
            motion[dof.node * D + dof.component] = self.instant() * dof.step.increment;
        }
        motion
    }

    fn free(&self) -> Vec<bool> {
        let mut free = vec![true; NextStep::nodes(self).len() * D];
        for dof in NextStep::prescribed(self) {
            free[dof.node * D + dof.component] = false;
        }
        // Those that follow others are no unknowns either.
        let equilibrium = self.equilibrium();
        for &outer in equilibrium.step.connectivity.extension().iter().flat_map(|extension| extension.outer()) {
            free[outer as usize * D..(outer as usize + 1) * D].fill(false);
        }
        free
    }

    fn residual(&self, dphi: &[f64]) -> Result<Vec<f64>, Inadmissible> {
        Ok(flat(&self.equilibrium().residual(&self.motion(&vectors(dphi)))?))
    }

    fn products(&self, dphi: &[f64], us: &[Vec<f64>]) -> Result<Vec<Vec<f64>>, Inadmissible> {
        let equilibrium = self.equilibrium();
        let tangent = equilibrium.tangent(None, &self.motion(&vectors(dphi)))?;
        let product = |u: &Vec<f64>| {
            let mut u = vectors(u);
            equilibrium.clear_prescribed(&mut u);
            let mut out = vec![Vector::zeros(); u.len()];
            tangent.product(&u, &mut out);
            flat(&out)
        };
        Ok(us.iter().map(product).collect())
    }
}

/// K(Δφ) of the coming step, by its products.
#[pyclass(frozen, module = "bfree")]
pub struct Tangent {
    pub system: Arc<dyn System>,
    pub dphi: Vec<f64>,
}

impl Tangent {
    fn order(&self) -> usize {
        self.dphi.len()
    }

    /// As an operator of SciPy.
    pub fn operator<'py>(self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let order = self.order();
        let this = Py::new(py, self)?.into_bound(py);
        let products = [("matvec", this.getattr("matvec")?), ("matmat", this.getattr("matmat")?)];
        let how = pyo3::types::IntoPyDict::into_py_dict(products, py)?;
        how.set_item("dtype", "float64")?;
        py.import("scipy.sparse.linalg")?.call_method("LinearOperator", ((order, order),), Some(&how))
    }
}

#[pymethods]
impl Tangent {
    /// K u
    fn matvec<'py>(&self, py: Python<'py>, u: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let u = vec![numbers("u", u, self.order())?];
        let products = py.detach(|| self.system.products(&self.dphi, &u)).map_err(|error| step_error(&error))?;
        frozen(py, products.concat(), &[self.order()])
    }

    /// K U, a column at a time; K is frozen once for all of them.
    fn matmat<'py>(&self, py: Python<'py>, u: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let shape = u.cast::<PyUntypedArray>()?.shape().to_vec();
        let [rows, columns] = shape[..] else {
            return Err(PyValueError::new_err(format!("U has the shape {shape:?}; it must have two dimensions")));
        };
        if rows != self.order() {
            return Err(PyValueError::new_err(format!("U has {rows} rows; K has {}", self.order())));
        }
        let transposed = numbers("U", &u.getattr("T")?, rows * columns)?;
        let us: Vec<Vec<f64>> = transposed.chunks_exact(rows.max(1)).map(<[f64]>::to_vec).collect();
        let products = py.detach(|| self.system.products(&self.dphi, &us)).map_err(|error| step_error(&error))?;
        frozen(py, products.concat(), &[columns, rows])?.getattr("T")
    }
}
