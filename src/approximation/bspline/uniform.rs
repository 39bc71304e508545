//! Uniform B-splines centred on the nodes.

use crate::aggregation::Pieces;
use crate::approximation::interior::{InCells, InLanes, Rows, evaluate};
use crate::approximation::kernel::{Kernel, folded};
use crate::approximation::{ApproximationError, AxisWeights, Separable, Validate};
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

/// The kernel of [`Bspline::Quadratic`].
pub(in crate::approximation) struct Quadratic;

impl Kernel for Quadratic {
    fn radius(&self) -> f64 {
        1.5
    }

    /// φ = ¾ − d²  (d < ½),  ½ (3/2 − d)²  (d < 3/2),   d = |D|
    #[inline(always)]
    fn at<T: Lane>(&self, distance: T) -> (T, T) {
        let c = |x: f64| distance.constant(x);
        let d = distance.abs();
        let rest = (c(1.5) - d).where_less(c(0.0), c(0.0), c(1.5) - d);
        let near = (c(0.75) - d * d, c(-2.0) * distance);
        let far = (c(0.5) * rest * rest, distance.where_less(c(0.0), rest, c(0.0) - rest));
        (d.where_less(c(0.5), near.0, far.0), d.where_less(c(0.5), near.1, far.1))
    }
}

/// The kernel of [`Bspline::Cubic`].
pub(in crate::approximation) struct Cubic;

impl Kernel for Cubic {
    fn radius(&self) -> f64 {
        2.0
    }

    /// φ = 2/3 − d² + ½ d³  (d < 1),  (2 − d)³/6  (d < 2),   d = |D|
    #[inline(always)]
    fn at<T: Lane>(&self, distance: T) -> (T, T) {
        let c = |x: f64| distance.constant(x);
        let d = distance.abs();
        let rest = (c(2.0) - d).where_less(c(0.0), c(0.0), c(2.0) - d);
        let near = (c(2.0 / 3.0) - d * d * (c(1.0) - c(0.5) * d), distance * (c(1.5) * d - c(2.0)));
        let slope = c(0.5) * rest * rest;
        let far = (rest * rest * rest / c(6.0), distance.where_less(c(0.0), slope, c(0.0) - slope));
        (d.where_less(c(1.0), near.0, far.0), d.where_less(c(1.0), near.1, far.1))
    }
}

impl InLanes for Bspline {
    fn radius(&self) -> f64 {
        match self {
            Self::Quadratic => Quadratic.radius(),
            Self::Cubic => Cubic.radius(),
        }
    }

    fn edge(&self) -> f64 {
        self.radius().fract()
    }

    fn evaluate(&self, points: &InCells, out: Rows<'_>) -> usize {
        match self {
            Self::Quadratic => evaluate::<1>(&Quadratic, self.radius(), points, out),
            Self::Cubic => evaluate::<1>(&Cubic, self.radius(), points, out),
        }
    }
}

impl Separable for Bspline {
    #[inline]
    fn axis(&self, axis: &Axis, x: f64, out: &mut AxisWeights) -> Result<(), ApproximationError> {
        match self {
            Self::Quadratic => folded(&Quadratic, axis, x, out),
            Self::Cubic => folded(&Cubic, axis, x, out),
        }
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

    fn is_spline(&self) -> bool {
        true
    }
}
