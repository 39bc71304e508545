//! Uniform B-splines centred on the nodes.

use super::{ApproximationError, AxisWeights, Separable, Validate, kernel::folded};
use crate::grid::Axis;

/// The B-spline of the given degree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bspline {
    /// Continuous first derivative, three nodes an axis.
    Quadratic,
    /// Continuous second derivative, four nodes an axis.
    Cubic,
}

impl Validate for Bspline {
    fn validate(&self, _dimension: usize) -> Result<(), ApproximationError> {
        Ok(())
    }
}

/// φ = ¾ − d²  (d < ½),  ½ (3/2 − d)²  (d < 3/2),   d = |D|
#[inline]
fn quadratic(distance: f64) -> (f64, f64) {
    let d = distance.abs();
    if d < 0.5 {
        (0.75 - d * d, -2.0 * distance)
    } else {
        let rest = (1.5 - d).max(0.0);
        (0.5 * rest * rest, -distance.signum() * rest)
    }
}

/// φ = 2/3 − d² + ½ d³  (d < 1),  (2 − d)³/6  (d < 2),   d = |D|
#[inline]
fn cubic(distance: f64) -> (f64, f64) {
    let d = distance.abs();
    if d < 1.0 {
        (2.0 / 3.0 - d * d * (1.0 - 0.5 * d), distance * (1.5 * d - 2.0))
    } else {
        let rest = (2.0 - d).max(0.0);
        (rest * rest * rest / 6.0, -distance.signum() * 0.5 * rest * rest)
    }
}

impl Separable for Bspline {
    #[inline]
    fn axis(&self, axis: &Axis, x: f64, out: &mut AxisWeights) -> Result<(), ApproximationError> {
        match self {
            Self::Quadratic => folded(axis, x, 1.5, quadratic, out),
            Self::Cubic => folded(axis, x, 2.0, cubic, out),
        }
    }

    fn width(&self) -> usize {
        match self {
            Self::Quadratic => 3,
            Self::Cubic => 4,
        }
    }
}
