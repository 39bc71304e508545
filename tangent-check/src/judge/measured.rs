//! All measurements of a function in one state.

use super::loose::Jump;
use crate::difference::Derivative;
use crate::matrix::Matrix;

/// The greatest error of the differences, over ‖C‖, with which a tangent counts as checked.
pub(super) const NOISY: f64 = 1e-6;

/// A deviation below this part of the scale of the law is inexact, and not wrong.
pub(super) const SMALL: f64 = 1e-6;

/// All that was measured of a function in one state.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The response.
    pub value: Vec<f64>,
    /// The noise of each component of the response.
    pub noise: Vec<f64>,
    /// The derivatives, one a column.
    pub columns: Vec<Derivative>,
    /// The greatest entry of the tangent of the law at rest, if it is known. It sets the scale where hardly any stiffness is left.
    pub stiffness: f64,
    /// A jump of the response, if one was found: the trace of a local iteration that stops early.
    pub jump: Option<Jump>,
    /// Calls of the function.
    pub calls: usize,
}

pub(super) fn greatest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |greatest, value| greatest.max(value.abs()))
}

/// A column of a matrix.
pub(super) fn column(matrix: &Matrix, k: usize) -> Vec<f64> {
    (0..matrix.rows).map(|i| matrix[(i, k)]).collect()
}
