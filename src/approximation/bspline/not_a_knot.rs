//! B-splines that may curve at walls.

use super::uniform::Bspline;
use crate::aggregation::Pieces;
use crate::approximation::product::Place;
use crate::approximation::{ApproximationError, AxisWeights, Separable, Validate};
use crate::grid::Axis;

/// B-splines without a knot next to the end of an axis: up to the second knot from a wall they are one polynomial, which may curve.
/// [`Bspline`] has u₋₁ = 2u₀ − u₁, and so u″ = 0 at the wall. Here u₋₁ continues the polynomial: 3u₀ − 3u₁ + u₂ for quadratic splines,
/// 4u₀ − 6u₁ + 4u₂ − u₃ for cubic splines. The unknown of a wall node is the value there, in place of u₀. The space is that of an open
/// knot vector.
///
/// Linear consistency holds with the nodes at their grid positions. N of the third node is negative near the wall: down to −1/16 for
/// quadratic splines, −0.19 for cubic splines. If a body ends there, a lumped mass would be negative, too. Sums over particles must be
/// integrals. With regular particles the functions of [`Bspline`], which are mirrored at walls, have smaller errors. So these splines are
/// for Gauss points without a lumped mass. Axes of fewer than four cells have no room for two ends, and use the functions of [`Bspline`].
///
/// ```
/// use bfree::approximation::{ApproximationError, AxisWeights, Bspline, NotAKnotBspline, Separable};
/// use bfree::grid::Axis;
///
/// // The deflection of a clamped beam, x², near the clamp, from its coefficients x_I² − h²/3; at the wall the value itself.
/// let (axis, mut weights) = (Axis { origin: 0.0, spacing: 1.0, cells: 8 }, AxisWeights::default());
/// let coefficient = |node: u32| if node == 0 { 0.0 } else { f64::from(node * node) - 1.0 / 3.0 };
/// let mut deflection = |shape: &dyn Separable| -> Result<f64, ApproximationError> {
///     shape.axis(&axis, 0.5, &mut weights)?;
///     Ok((weights.first..).zip(&weights.values).map(|(node, n)| n * coefficient(node)).sum::<f64>())
/// };
/// assert!((deflection(&NotAKnotBspline(Bspline::Cubic))? - 0.25).abs() < 1e-15);
/// assert!((deflection(&Bspline::Cubic)? - 0.25).abs() > 0.05);
/// # Ok::<(), ApproximationError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotAKnotBspline(pub Bspline);

/// The fewest cells that an axis needs for two ends.
const ROOM: u32 = 4;

/// At s spacings from a wall, N = b s + c s² + e s³, plus 1 for node 0. Nodes count from the wall.
struct End {
    /// The distance of the second knot from the wall: further inside, the functions are those of [`Bspline`].
    reach: f64,
    /// b, c, e
    coefficients: &'static [[f64; 3]],
}

const QUADRATIC: End = End {
    reach: 1.5,
    coefficients: &[[-4.0 / 3.0, 4.0 / 9.0, 0.0], [5.0 / 3.0, -8.0 / 9.0, 0.0], [-1.0 / 3.0, 4.0 / 9.0, 0.0]],
};

const CUBIC: End = End {
    reach: 2.0,
    coefficients: &[
        [-1.5, 0.75, -0.125],
        [2.25, -1.875, 19.0 / 48.0],
        [-1.0, 1.5, -5.0 / 12.0],
        [0.25, -0.375, 7.0 / 48.0],
    ],
};

impl End {
    /// N and dN/ds of the first nodes.
    fn at(&self, s: f64) -> impl DoubleEndedIterator<Item = (f64, f64)> {
        self.coefficients.iter().enumerate().map(move |(node, [b, c, e])| {
            let own = if node == 0 { 1.0 } else { 0.0 };
            mutant!("shapes: functions at a wall are a thousandth of s³ off": own = own + 1e-3 * s * s * s);
            (own + s * (b + s * (c + s * e)), b + s * (2.0 * c + s * 3.0 * e))
        })
    }
}

impl Validate for NotAKnotBspline {}

impl Separable for NotAKnotBspline {
    fn axis(&self, axis: &Axis, x: f64, out: &mut AxisWeights) -> Result<(), ApproximationError> {
        let end = match self.0 {
            Bspline::Quadratic => &QUADRATIC,
            Bspline::Cubic => &CUBIC,
        };
        let place = Place::new(axis, x)?;
        let from_lower = f64::from(place.cell) + place.below;
        let from_upper = f64::from(axis.cells - 1 - place.cell) + place.above;
        if axis.cells < ROOM || from_lower.min(from_upper) >= end.reach {
            return self.0.axis(axis, x, out);
        }
        if from_lower < from_upper {
            out.start(0);
            end.at(from_lower).for_each(|(value, slope)| out.push(value, slope / axis.spacing));
        } else {
            out.start(axis.cells + 1 - end.coefficients.len() as u32);
            end.at(from_upper).rev().for_each(|(value, slope)| out.push(value, -slope / axis.spacing));
        }
        Ok(())
    }

    fn width(&self) -> usize {
        self.0.width()
    }

    fn pieces(&self) -> Pieces {
        let own = self.0.pieces();
        Pieces { curves_at_walls: true, extension: own.degree, ..own }
    }
}
