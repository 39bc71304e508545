//! Uniform generalized interpolation (uGIMP).

use super::{ApproximationError, AxisWeights, Separable, Validate, kernel::folded};
use crate::grid::Axis;

/// The hat averaged over a particle of constant width 2 l_p: Bardenhagen & Kober, CMES 5 (2004).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gimp {
    /// The half-width of a particle in units of the spacing, l_p/h, in (0, ½].
    pub half_width: f64,
}

impl Gimp {
    /// Particles that fill their cell, `count` along each axis: l_p = h / (2 count).
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
        let half_width = self.half_width;
        if half_width > 0.0 && half_width <= 0.5 { Ok(()) } else { Err(ApproximationError::HalfWidth { half_width }) }
    }
}

impl Separable for Gimp {
    /// With d = |D| and l = l_p/h:
    ///
    /// ```text
    /// φ = 1 − (d² + l²)/(2l)   d < l
    ///     1 − d                l ≤ d < 1 − l
    ///     (1 + l − d)²/(4l)    1 − l ≤ d < 1 + l
    /// ```
    #[inline]
    fn axis(&self, axis: &Axis, x: f64, out: &mut AxisWeights) -> Result<(), ApproximationError> {
        self.validate(1)?;
        let l = self.half_width;
        let kernel = |distance: f64| {
            let (d, sign) = (distance.abs(), distance.signum());
            if d < l {
                (1.0 - (d * d + l * l) / (2.0 * l), -distance / l)
            } else if d < 1.0 - l {
                (1.0 - d, -sign)
            } else {
                let rest = (1.0 + l - d).max(0.0);
                (rest * rest / (4.0 * l), -sign * rest / (2.0 * l))
            }
        };
        folded(axis, x, 1.0 + l, kernel, out)
    }

    fn width(&self) -> usize {
        3
    }
}
