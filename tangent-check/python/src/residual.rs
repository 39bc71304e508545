//! A residual that is a Python function of a vector, and the product of its tangent.

use crate::frozen;
use crate::raised::Raised;
use crate::report::Finding;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use std::cell::RefCell;
use tangent_check::difference::Ladder;
use tangent_check::finding::Finding as Checked;
use tangent_check::judge::{Directions, Loading, check_columns_on, check_directions};
use tangent_check::matrix::Matrix;
use tangent_check::states::Random;

/// The greatest number of unknowns whose columns are all measured.
const COLUMNS: usize = 30;

/// Up to so many columns have the finer ladder, as [`check_columns`](tangent_check::judge::check_columns) has it.
const FEW: usize = 6;

/// The random directions for more unknowns.
const DIRECTIONS: usize = 3;

/// A residual around u, in scaled unknowns: u + s ∘ w.
struct Residual<'a, 'py> {
    /// The unknowns at the start of the step.
    start: &'a [f64],
    u: &'a [f64],
    scale: &'a [f64],
    residual: &'a Bound<'py, PyAny>,
    product: &'a Bound<'py, PyAny>,
}

/// A function of a vector, called in Python.
fn call(function: &Bound<'_, PyAny>, vector: Vec<f64>) -> PyResult<Vec<f64>> {
    let size = vector.len();
    let answer = function.call1((frozen(function.py(), vector, &[size])?,))?;
    Ok(answer.extract::<PyReadonlyArray1<'_, f64>>()?.as_array().iter().copied().collect())
}

impl Residual<'_, '_> {
    /// R(u + h s ∘ w)
    fn value(&self, w: &[f64], h: f64) -> PyResult<Vec<f64>> {
        let at = self.u.iter().zip(self.scale).zip(w).map(|((u, s), w)| u + h * s * w).collect();
        call(self.residual, at)
    }

    /// J (s ∘ w)
    fn product(&self, w: &[f64]) -> PyResult<Vec<f64>> {
        call(self.product, self.scale.iter().zip(w).map(|(s, w)| s * w).collect())
    }

    /// R at a part of the way from the start of the step to u.
    fn on_the_way(&self, part: f64) -> PyResult<Vec<f64>> {
        let at = self.start.iter().zip(self.u).map(|(start, u)| start + part * (u - start)).collect();
        call(self.residual, at)
    }

    /// The greatest scaled component of the step.
    fn size(&self) -> f64 {
        let changes = self.u.iter().zip(self.start).zip(self.scale).map(|((u, start), s)| (u - start).abs() / s);
        changes.fold(0.0, f64::max)
    }

    /// All columns of the tangent.
    fn columns(&self, name: &str, value: &[f64], raised: &mut Raised) -> PyResult<Checked> {
        let size = self.u.len();
        let units = directions(&vec![1.0; size], 0);
        let mut claimed = Matrix::zeros(value.len(), size);
        for (k, unit) in units.iter().enumerate() {
            for (i, entry) in self.product(unit)?.into_iter().enumerate().take(value.len()) {
                claimed[(i, k)] = entry;
            }
        }
        let raised = RefCell::new(raised);
        let mut f = |k: usize, h: f64| raised.borrow_mut().during(self.residual.py(), || self.value(&units[k], h));
        let mut respond = |part: f64| raised.borrow_mut().during(self.residual.py(), || self.on_the_way(part));
        let ladder = if size > FEW { Ladder::coarse() } else { Ladder::default() };
        let loading = Loading { size: self.size(), respond: &mut respond, stiffness: 0.0 };
        let mut finding = check_columns_on(name, &claimed, value, ladder, &mut f, Some(loading));
        for matrix in [&mut finding.claimed, &mut finding.measured, &mut finding.errors] {
            for (place, entry) in matrix.entries.iter_mut().enumerate() {
                *entry /= self.scale[place % size];
            }
        }
        self.unscale(&mut finding);
        Ok(finding)
    }

    /// Products with random directions.
    fn directions(&self, name: &str, value: &[f64], seed: u64, raised: &mut Raised) -> Checked {
        let py = self.residual.py();
        let raised = RefCell::new(raised);
        let mut product = |w: &[f64]| raised.borrow_mut().during(py, || self.product(w));
        let mut f = |w: &[f64], h: f64| raised.borrow_mut().during(py, || self.value(w, h));
        let mut respond = |part: f64| raised.borrow_mut().during(py, || self.on_the_way(part));
        let loading = Some(Loading { size: self.size(), respond: &mut respond, stiffness: 0.0 });
        let directions = Directions { count: DIRECTIONS, seed, ladder: Ladder::default(), loading };
        let mut finding = check_directions(name, self.u.len(), value, &mut product, &mut f, directions);
        // An entry that is not located belongs to a direction, not to an unknown.
        finding.worst = finding
            .worst
            .filter(|worst| worst.column >= DIRECTIONS || finding.claimed[(worst.row, worst.column)] != worst.claimed);
        self.unscale(&mut finding);
        finding
    }

    /// The worst entry in the unit of its unknown.
    fn unscale(&self, finding: &mut Checked) {
        if let Some(worst) = &mut finding.worst {
            let scale = self.scale[worst.column];
            worst.claimed /= scale;
            worst.measured /= scale;
            worst.error /= scale;
        }
    }
}

/// The directions w that [`check_directions`] takes, scaled: s ∘ w, one a row; the unit vectors for few unknowns.
fn directions(scale: &[f64], seed: u64) -> Vec<Vec<f64>> {
    let size = scale.len();
    if size <= COLUMNS {
        return (0..size).map(|k| (0..size).map(|j| if j == k { 1.0 } else { 0.0 }).collect()).collect();
    }
    let mut random = Random::new(seed);
    (0..DIRECTIONS).map(|_| scale.iter().map(|s| s * random.signed()).collect()).collect()
}

/// A finding, the directions of its columns, and the first exception.
type Answer = (Finding, Vec<Vec<f64>>, Option<Py<PyAny>>);

/// Checks a tangent at u. `residual` and `product` take and give flat arrays.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "called by the package alone")]
pub fn check_residual(
    name: &str,
    start: Vec<f64>,
    u: Vec<f64>,
    value: Vec<f64>,
    scale: Vec<f64>,
    residual: &Bound<'_, PyAny>,
    product: &Bound<'_, PyAny>,
    seed: u64,
) -> PyResult<Answer> {
    let py = residual.py();
    let around = Residual { start: &start, u: &u, scale: &scale, residual, product };
    let mut raised = Raised::default();
    let finding = if u.len() <= COLUMNS {
        around.columns(name, &value, &mut raised)?
    } else {
        around.directions(name, &value, seed, &mut raised)
    };
    raised.end()?;
    let exception = raised.first.map(|error| error.into_value(py).into_any());
    Ok((Finding(finding), directions(&scale, seed), exception))
}
