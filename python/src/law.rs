//! The law of a body: one of the shipped ones, or that of an energy in Python.

use crate::energy::Recorded;
use bfree::material::{FromEnergy, Law as _, Material, MaterialState};
use bfree::tensor::Tensor;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use verification::check_material;

/// A stiffness below zero by less than this share of the largest is none.
const ROUNDING: f64 = 1e-9;

/// Failed checks that an error lists.
const SHOWN: usize = 8;

/// The least and the largest eigenvalue of ℂ of the body at rest, for strains of size 1. If the least one is negative, the body is
/// unstable.
fn stiffness_at_rest(law: &FromEnergy<Recorded>) -> [f64; 2] {
    // An orthonormal basis of the symmetric strains.
    let basis = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)].map(|(i, j)| {
        let mut strain = Tensor::<f64, 3>::zeros();
        (strain[(i, j)], strain[(j, i)]) = if i == j { (1.0, 1.0) } else { (0.5_f64.sqrt(), 0.5_f64.sqrt()) };
        strain
    });
    let stresses = basis.map(|strain| law.elasticity(&MaterialState::new(Tensor::zeros()), &strain));
    let stiffness = Tensor::<f64, 6>::from_fn(|row, column| stresses[column].dot(&basis[row]));
    let values = ((stiffness + stiffness.transpose()) * 0.5).symmetric_eigenvalues();
    [values.min(), values.max()]
}

/// A law from its strain energy density W(E), a function of the 3×3 Green–Lagrange strain, written in Python.
#[pyclass(frozen, module = "bfree")]
pub struct Law {
    pub law: FromEnergy<Recorded>,
}

#[pymethods]
impl Law {
    #[new]
    #[pyo3(signature = (energy, *, check = true))]
    fn new(py: Python<'_>, energy: &Bound<'_, PyAny>, check: bool) -> PyResult<Self> {
        let law = FromEnergy(Recorded::call(energy)?);
        if check {
            let report = py.detach(|| check_material(&law));
            let failures: Vec<String> =
                report.failures().map(|cell| format!("\n  {}: {}", cell.name(), cell.finding())).collect();
            if let Some(first) = failures.get(..failures.len().min(SHOWN)).filter(|first| !first.is_empty()) {
                let message = "the energy is none of an elastic body (quantity, dimension, regime: value and bound)";
                let more = failures.len() - first.len();
                let more = if more > 0 { format!("\n  and {more} more") } else { String::new() };
                return Err(PyValueError::new_err(format!("{message}{}{more}", first.concat())));
            }
            let [least, largest] = stiffness_at_rest(&law);
            if least < -ROUNDING * largest.abs().max(least.abs()) {
                return Err(PyValueError::new_err(format!(
                    "the energy has a negative stiffness at rest: the stiffnesses of unit strains lie between {least:.3e} and {largest:.3e}, \
                     and a body with one below zero collapses by itself; change the sign of that part of the energy"
                )));
            }
        }
        Ok(Self { law })
    }

    /// The results of the checks of laws: rows of quantity, dimension, regime, value and bound.
    fn check(&self, py: Python<'_>) -> String {
        py.detach(|| check_material(&self.law)).to_string()
    }

    /// How many operations the energy has.
    #[getter]
    fn operations(&self) -> usize {
        self.law.0.len()
    }

    fn __repr__(&self) -> String {
        format!("<law of an energy of {} operations>", self.law.0.len())
    }
}

/// The law of a body.
#[derive(Clone)]
pub enum BodyLaw {
    Shipped(Material),
    Energy(FromEnergy<Recorded>),
}

/// All of it is the law's own; as one of the shipped ones it has their fast loops.
impl bfree::material::Law for BodyLaw {
    bfree::law_of_variants!(Self: Shipped, Energy);

    fn shipped(&self) -> Option<&dyn std::any::Any> {
        match self {
            Self::Shipped(law) => law.shipped(),
            Self::Energy(_) => None,
        }
    }
}
