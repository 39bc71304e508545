//! Uniform generalized interpolation (uGIMP).

use super::interior::InLanes;
use super::kernel::{Kernel, folded, piecewise};
use super::{ApproximationError, AtSurface, AxisWeights, Linear, Separable, Validate};
use crate::aggregation::Pieces;
use crate::grid::Axis;
use crate::lanes::Lane;

/// The hat averaged over a particle of constant width 2 l_p: Bardenhagen & Kober, CMES 5 (2004).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gimp {
    /// The half-width of a particle in units of the spacing, l_p/h, in (0, ½].
    pub half_width: f64,
}

impl Gimp {
    /// The functions for particles that fill their cell, `count` along each axis: l_p = h / (2 count).
    ///
    /// ```
    /// use bfree::approximation::{AxisWeights, Gimp, Separable};
    /// use bfree::grid::Axis;
    ///
    /// // N is a hat averaged over a particle of half a cell: at a node ¾ + 2·⅛ in place of the hat's 1.
    /// let gimp = Gimp::particles_per_axis(2);
    /// assert_eq!(gimp.half_width, 0.25);
    /// let mut weights = AxisWeights::default();
    /// gimp.axis(&Axis { origin: 0.0, spacing: 1.0, cells: 8 }, 4.0, &mut weights)?;
    /// assert_eq!(weights.values, [0.0625, 0.875, 0.0625]);
    /// # Ok::<(), bfree::approximation::ApproximationError>(())
    /// ```
    pub fn particles_per_axis(count: u32) -> Self {
        Self { half_width: 0.5 / f64::from(count) }
    }
}

impl Validate for Gimp {
    fn validate(&self, _dimension: usize) -> Result<(), ApproximationError> {
        let value = self.half_width;
        let parameter = "the half-width of a GIMP particle over the spacing";
        let error = ApproximationError::Parameter { parameter, value, allowed: "> 0 and <= 0.5" };
        if value > 0.0 && value <= 0.5 { Ok(()) } else { Err(error) }
    }
}

impl Kernel for Gimp {
    fn radius(&self) -> f64 {
        1.0 + self.half_width
    }

    fn edge(&self) -> f64 {
        self.half_width
    }

    /// With d = |D| and l = l_p/h:
    ///
    /// ```text
    /// φ = 1 − (d² + l²)/(2l)   d < l
    ///     1 − d                l ≤ d < 1 − l
    ///     (1 + l − d)²/(4l)    1 − l ≤ d < 1 + l
    /// ```
    #[inline(always)]
    fn at<T: Lane>(&self, distance: T) -> (T, T) {
        let c = |x: f64| distance.constant(x);
        let (d, l) = (distance.abs(), self.half_width);
        let sign = distance.where_less(c(0.0), c(-1.0), c(1.0));
        let rest = (c(1.0 + l) - d).where_less(c(0.0), c(0.0), c(1.0 + l) - d);
        let far = (rest * rest / c(4.0 * l), c(0.0) - sign * rest / c(2.0 * l));
        mutant!("shapes: the edge of the GIMP function is twice as high": far = (far.0 + far.0, far.1));
        let middle = (c(1.0) - d, c(0.0) - sign);
        let near = (c(1.0) - (d * d + c(l * l)) / c(2.0 * l), c(0.0) - distance / c(l));
        piecewise(d, l, near, piecewise(d, 1.0 - l, middle, far))
    }
}

impl Separable for Gimp {
    #[inline]
    fn axis(&self, axis: &Axis, x: f64, out: &mut AxisWeights) -> Result<(), ApproximationError> {
        self.validate(1)?;
        folded(self, axis, x, out)
    }

    fn in_lanes(&self) -> Option<&dyn InLanes> {
        self.validate(1).is_ok().then_some(self)
    }

    fn at_surface(&self) -> AtSurface<'_> {
        AtSurface::Other(&Linear)
    }

    fn pieces(&self) -> Pieces {
        Pieces { share: 0.75, ..Pieces::LINEAR }
    }

    fn width(&self) -> usize {
        3
    }
}
