//! N and ∇N at a point.

use super::error::{ApproximationError, Validate};
use super::product::{AxisWeights, Separable, inside, list, product};
use super::support::Support;
use crate::aggregation::Pieces;
use crate::grid::Grid;
use crate::tensor::Vector;

/// Work arrays of a shape function; each thread has its own.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    axes: [AxisWeights; 3],
}

/// N and ∇N at a point, in `D` = 1, 2 or 3 dimensions.
///
/// ```
/// use bfree::approximation::{AxisWeights, LmeCircle, Lme, Scratch, ShapeFunction, Support};
/// use bfree::grid::Grid;
/// use bfree::tensor::Vector;
///
/// let grid = Grid { origin: Vector::from([0.0, 0.0]), spacing: 0.5, cells: [12, 10] };
/// let (x, mut scratch, mut support) = (Vector::from([2.61, 2.27]), Scratch::default(), Support::default());
/// let lme = Lme::new(3.0, 1e-6);
/// lme.evaluate(&grid, &x, &mut scratch, &mut support)?;
/// // Σ N = 1, Σ N x_I = x, Σ ∇N = 0
/// let entries = || support.nodes.iter().zip(&support.values).zip(&support.gradients);
/// assert!((support.values.iter().sum::<f64>() - 1.0).abs() < 1e-14);
/// let place: Vector<f64, 2> = entries().map(|((&node, &n), _)| grid.position(node) * n).sum();
/// assert!((place - x).norm() < 1e-13);
/// assert!(entries().map(|(_, &grad)| Vector::from(grad)).sum::<Vector<f64, 2>>().norm() < 1e-12);
/// // It is a product of functions of x and of y; on the paper's circle of nodes it is not.
/// let product = lme.separable().ok_or("a product")?;
/// let mut along_x = AxisWeights::default();
/// product.axis(&grid.axis(0), x[0], &mut along_x)?;
/// assert!(along_x.values.len() <= product.width());
/// assert!(LmeCircle::new(3.0, 1e-6).separable().is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait ShapeFunction: Validate + Clone + Send + Sync + 'static {
    /// Whether scenes use this type. Their steps are compiled once, in this crate.
    #[doc(hidden)]
    const IN_SCENES: bool = false;

    /// Fills `out` with the nodes that have N ≠ 0 or ∇N ≠ 0 at `x`. After an error the content of `out` means nothing.
    ///
    /// # Errors
    /// `x` is outside the box of the grid, or not a number. [`Validate::validate`] refuses the parameters, and they matter at `x`.
    fn evaluate<const D: usize>(
        &self,
        grid: &Grid<D>,
        x: &Vector<f64, D>,
        scratch: &mut Scratch,
        out: &mut Support<D>,
    ) -> Result<(), ApproximationError>;

    /// The one-dimensional functions of a product; `None` if the functions are not a product.
    fn separable(&self) -> Option<&dyn Separable>;

    /// The polynomial pieces by which outer nodes at the boundary of a body follow inner nodes.
    fn pieces(&self) -> Pieces {
        self.separable().map_or(Pieces::LINEAR, Separable::pieces)
    }
}

impl<S: Separable + Clone + 'static> ShapeFunction for S {
    #[inline]
    fn evaluate<const D: usize>(
        &self,
        grid: &Grid<D>,
        x: &Vector<f64, D>,
        scratch: &mut Scratch,
        out: &mut Support<D>,
    ) -> Result<(), ApproximationError> {
        inside(grid, x)?;
        for k in 0..D {
            list(self, &grid.axis(k), x[k], &mut scratch.axes[k])?;
        }
        product(&scratch.axes, out);
        Ok(())
    }

    fn separable(&self) -> Option<&dyn Separable> {
        Some(self)
    }
}
