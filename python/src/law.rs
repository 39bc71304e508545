//! The law of a body: one of the shipped ones, or that of an energy in Python.

use crate::energy::Recorded;
use bfree::material::{ClosedTangent, FromEnergy, Material, Remembered, Start};
use bfree::scalar::Real;
use bfree::tensor::{Deformation, Tensor, Vector};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use verification::check_material;

/// Failed checks that an error lists.
const SHOWN: usize = 8;

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
        }
        Ok(Self { law })
    }

    /// What the checks of laws say: rows of quantity, dimension, regime, value and bound.
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

/// The call with whichever law it is.
macro_rules! either {
    ($law:expr, $one:ident => $call:expr) => {
        match $law {
            BodyLaw::Shipped($one) => $call,
            BodyLaw::Energy($one) => $call,
        }
    };
}

/// All of it is the law's own; as one of the shipped ones it has their fast loops.
impl bfree::material::Law for BodyLaw {
    fn memory(&self) -> &[Remembered] {
        either!(self, law => law.memory())
    }
    fn is_symmetric(&self) -> bool {
        either!(self, law => law.is_symmetric())
    }
    fn has_potential(&self) -> bool {
        either!(self, law => law.has_potential())
    }
    fn energy<T: Real, const D: usize>(&self, at: &Deformation<T, D>, start: &Start<'_>) -> T {
        either!(self, law => bfree::material::Law::energy(law, at, start))
    }
    fn stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>, start: &Start<'_>) -> Tensor<T, D> {
        either!(self, law => bfree::material::Law::stress(law, at, start))
    }
    fn elasticity<T: Real, const D: usize>(
        &self,
        at: &Deformation<T, D>,
        start: &Start<'_>,
        x: &Tensor<T, D>,
    ) -> Tensor<T, D> {
        either!(self, law => bfree::material::Law::elasticity(law, at, start, x))
    }
    fn tangent_density<T: Real, const D: usize>(
        &self,
        at: &Deformation<T, D>,
        start: &Start<'_>,
        v: &Vector<T, D>,
        b: &Vector<T, D>,
    ) -> Tensor<T, D> {
        either!(self, law => bfree::material::Law::tangent_density(law, at, start, v, b))
    }
    fn closed<const D: usize>(
        &self,
        f_n: &Tensor<f64, D>,
        at: &Deformation<f64, D>,
        volume: f64,
    ) -> Option<ClosedTangent<f64, D>> {
        either!(self, law => bfree::material::Law::closed(law, f_n, at, volume))
    }
    fn tangent_blocks<const D: usize>(
        &self,
        f_n: &Tensor<f64, D>,
        at: &Deformation<f64, D>,
        start: &Start<'_>,
    ) -> [[Tensor<f64, D>; D]; D] {
        either!(self, law => bfree::material::Law::tangent_blocks(law, f_n, at, start))
    }
    fn remember<const D: usize>(&self, at: &Deformation<f64, D>, start: &Start<'_>, next: &mut [f64]) {
        either!(self, law => law.remember(at, start, next));
    }
    fn shipped(&self) -> Option<&Material> {
        either!(self, law => law.shipped())
    }
}
