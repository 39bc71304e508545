//! Conventions by their names.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tangent_check::convention::{Components, Convention as Meaning, Measure};

/// The measures: their names, and the usual order of their symmetric tensors.
const MEASURES: [(&str, Measure, &str); 9] = [
    ("piola", Measure::PiolaByGradient, "voigt"),
    ("second_piola", Measure::SecondPiolaByGreen, "voigt"),
    ("abaqus", Measure::JaumannKirchhoff, "abaqus"),
    ("jaumann_cauchy", Measure::JaumannCauchy, "abaqus"),
    ("truesdell", Measure::Truesdell, "voigt"),
    ("green_naghdi", Measure::GreenNaghdi, "abaqus"),
    ("cauchy_strain", Measure::CauchyByStrain, "voigt"),
    ("cauchy_gradient", Measure::CauchyByGradient, "voigt"),
    ("kirchhoff_gradient", Measure::KirchhoffByGradient, "voigt"),
];

/// The components of a symmetric tensor: of a stress (false) or a strain (true).
type Order = fn(bool) -> Components;

/// The orders by their names.
const ORDERS: [(&str, Order); 4] = [
    ("voigt", |strain| Components::voigt(if strain { 2.0 } else { 1.0 })),
    ("abaqus", |strain| Components::abaqus(if strain { 2.0 } else { 1.0 })),
    ("explicit", |_| Components::explicit(1.0)),
    ("mfront", |_| Components::mfront()),
];

/// The meaning of a stress and its tangent.
#[pyclass(frozen, module = "tangent_check")]
pub struct Convention(pub Meaning);

#[pymethods]
impl Convention {
    /// `order` is None for the usual one. In two dimensions, components with index 3 are left out.
    #[new]
    fn new(name: &str, order: Option<&str>, dimension: usize) -> PyResult<Self> {
        let names = || MEASURES.map(|(name, ..)| format!("\"{name}\"")).join(", ");
        let (_, measure, usual) = MEASURES.into_iter().find(|(known, ..)| *known == name).ok_or_else(|| {
            PyValueError::new_err(format!("there is no convention {name:?}; allowed are {}", names()))
        })?;
        let order = order.unwrap_or(usual);
        let names = || ORDERS.map(|(name, _)| format!("\"{name}\"")).join(", ");
        let (_, components) = ORDERS.into_iter().find(|(known, _)| *known == order).ok_or_else(|| {
            PyValueError::new_err(format!("there is no order {order:?} of components; allowed are {}", names()))
        })?;
        if !matches!(dimension, 2 | 3) {
            return Err(PyValueError::new_err(format!("dimension = {dimension}: 2 and 3 are allowed")));
        }
        let gradient = |yes: bool, strain| if yes { Components::rows() } else { components(strain) };
        let mut stress = gradient(measure == Measure::PiolaByGradient, false);
        let mut strain = gradient(measure.by_gradient(), true);
        for Components { pairs, .. } in [&mut stress, &mut strain] {
            pairs.retain(|(i, j)| *i < dimension && *j < dimension);
        }
        Ok(Self(Meaning { measure, stress, strain }))
    }

    /// Index pairs of the stress's components, from 0.
    #[getter]
    fn stress(&self) -> Vec<(usize, usize)> {
        self.0.stress.pairs.clone()
    }

    /// Index pairs of the strain's components, from 0.
    #[getter]
    fn strain(&self) -> Vec<(usize, usize)> {
        self.0.strain.pairs.clone()
    }

    /// The factors of the shears in the vectors of stress and strain.
    #[getter]
    fn shear(&self) -> (f64, f64) {
        (self.0.stress.shear, self.0.strain.shear)
    }

    /// Whether the stress is symmetric, and whether the strain is.
    #[getter]
    fn symmetric(&self) -> (bool, bool) {
        (self.0.measure != Measure::PiolaByGradient, !self.0.measure.by_gradient())
    }
}
