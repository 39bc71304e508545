//! Uniform B-splines centred on the nodes.

use crate::aggregation::Pieces;
use crate::approximation::kernel::{Kernel, folded, piecewise};
use crate::approximation::{ApproximationError, AxisWeights, InLanes, Separable, Validate};
use crate::grid::Axis;
use crate::lanes::Lane;

/// A uniform B-spline of degree 2 or 3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bspline {
    /// Continuous first derivative, three nodes per axis.
    Quadratic,
    /// Continuous second derivative, four nodes per axis.
    Cubic,
}

impl Validate for Bspline {}

impl Kernel for Bspline {
    #[inline(always)]
    fn radius(&self) -> f64 {
        match self {
            Self::Quadratic => 1.5,
            Self::Cubic => 2.0,
        }
    }

    /// With d = |D|:
    ///
    /// ```text
    /// quadratic  φ = ¾ − d²          d < ½         cubic  φ = 2/3 − d² + ½ d³   d < 1
    ///                ½ (3/2 − d)²    ½ ≤ d < 3/2              (2 − d)³/6        1 ≤ d < 2
    /// ```
    #[inline(always)]
    fn at<T: Lane>(&self, distance: T) -> (T, T) {
        let c = |x: f64| distance.constant(x);
        let d = distance.abs();
        let rest = c(Kernel::radius(self)) - d;
        let rest = rest.where_less(c(0.0), c(0.0), rest);
        let towards_node = |slope: T| distance.where_less(c(0.0), slope, c(0.0) - slope);
        match self {
            Self::Quadratic => {
                let near = (c(0.75) - d * d, c(-2.0) * distance);
                piecewise(d, 0.5, near, (c(0.5) * rest * rest, towards_node(rest)))
            }
            Self::Cubic => {
                let near = (c(2.0 / 3.0) - d * d * (c(1.0) - c(0.5) * d), distance * (c(1.5) * d - c(2.0)));
                piecewise(d, 1.0, near, (rest * rest * rest / c(6.0), towards_node(c(0.5) * rest * rest)))
            }
        }
    }
}

impl Separable for Bspline {
    #[inline]
    fn axis(&self, axis: &Axis, x: f64, out: &mut AxisWeights) -> Result<(), ApproximationError> {
        folded(self, axis, x, out)
    }

    fn in_lanes(&self) -> Option<&dyn InLanes> {
        Some(self)
    }

    fn width(&self) -> usize {
        match self {
            Self::Quadratic => 3,
            Self::Cubic => 4,
        }
    }

    fn pieces(&self) -> Pieces {
        Pieces { degree: self.width() as u32 - 1, share: 0.75, ..Pieces::LINEAR }
    }
}
