//! One-dimensional functions and their tensor product, which all separable families share.

use super::error::{ApproximationError, Validate};
use super::interior::InLanes;
use super::support::Support;
use crate::aggregation::Pieces;
use crate::grid::{Axis, Grid, indices};
use crate::tensor::Vector;

/// N and dN/dx along one axis at one coordinate, for the nodes `first .. first + values.len()`. The buffer is reused.
///
/// ```
/// use bfree::approximation::AxisWeights;
///
/// // Hats at x = 7.25 on an axis of spacing 1.
/// let mut weights = AxisWeights::default();
/// weights.start(7);
/// weights.push(0.75, -1.0);
/// weights.push(0.25, 1.0);
/// let place: f64 = (7..).zip(&weights.values).map(|(node, n)| f64::from(node) * n).sum();
/// assert_eq!((place, weights.values.iter().sum(), weights.derivatives.iter().sum()), (7.25, 1.0, 0.0));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AxisWeights {
    /// The first node of the list.
    pub first: u32,
    /// N of each node.
    pub values: Vec<f64>,
    /// dN/dx of each node, in 1/length.
    pub derivatives: Vec<f64>,
}

impl AxisWeights {
    /// Empties the list and starts it anew at node `first`.
    #[inline]
    pub fn start(&mut self, first: u32) {
        self.first = first;
        self.values.clear();
        self.derivatives.clear();
    }

    /// Appends N and dN/dx of the next node.
    #[inline]
    pub fn push(&mut self, value: f64, derivative: f64) {
        self.values.push(value);
        self.derivatives.push(derivative);
    }

    /// Sets the hat functions of the two nodes of a cell, `below`·h above the lower node and `above`·h below the upper node.
    #[inline]
    pub(super) fn hats(&mut self, place: &Place, spacing: f64) {
        self.start(place.cell);
        self.push(place.above, -1.0 / spacing);
        self.push(place.below, 1.0 / spacing);
    }
}

/// A shape function that is a product of one-dimensional functions, N(x) = Π_k N_k(x_k).
///
/// ```
/// use bfree::approximation::{AxisWeights, Bspline, Separable};
/// use bfree::grid::Axis;
///
/// let axis = Axis { origin: 0.0, spacing: 1.0, cells: 8 };
/// let mut weights = AxisWeights::default();
/// // A quadratic spline on the middle of an axis, and at a wall: there its first node alone has N ≠ 0.
/// Bspline::Quadratic.axis(&axis, 4.0, &mut weights)?;
/// assert_eq!((weights.first, weights.values.as_slice()), (3, [0.125, 0.75, 0.125].as_slice()));
/// assert!(weights.values.len() <= Bspline::Quadratic.width());
/// Bspline::Quadratic.axis(&axis, 0.0, &mut weights)?;
/// assert_eq!((weights.first, weights.values[0], weights.values[1]), (0, 1.0, 0.0));
/// # Ok::<(), bfree::approximation::ApproximationError>(())
/// ```
pub trait Separable: Validate + Send + Sync {
    /// Fills `out` with the functions of `axis` that do not vanish at `x`.
    ///
    /// # Errors
    /// `x` is outside the axis or not a number, or the axis has no cells.
    fn axis(&self, axis: &Axis, x: f64, out: &mut AxisWeights) -> Result<(), ApproximationError>;

    /// The largest number of nodes that [`Self::axis`] lists on a long axis. The list always contains the nodes of the cell.
    fn width(&self) -> usize;

    /// The same functions away from walls, in vector lanes. Without them, the transfer between particles and nodes calls [`Self::axis`] for
    /// every particle.
    fn in_lanes(&self) -> Option<&dyn InLanes> {
        None
    }

    /// The functions through which loads act on a surface and the motion of a surface is read.
    fn at_surface(&self) -> AtSurface<'_> {
        AtSurface::Own
    }

    /// The polynomial pieces by which outer nodes at the boundary of a body follow inner nodes.
    fn pieces(&self) -> Pieces {
        Pieces::LINEAR
    }
}

/// The functions at a point x of a loaded surface. Loads must act through functions that balance the internal force. Under uniform stress,
/// the sum σ Σ_p V_p ∇N_I(x_p) over the particles of a body then equals the nodal force of the tractions on its surface.
#[derive(Clone, Copy)]
pub enum AtSurface<'a> {
    /// The functions of the family. If the particles are quadrature points, the internal force and the load balance.
    Own,
    /// Other functions. For uGIMP, V_p ∇N_I is the difference of a hat function between the ends of the particle. The sum telescopes to hat
    /// functions.
    Other(&'a dyn Separable),
    /// The functions of the nearest particle, continued linearly along each axis, so that they reach only the nodes of that particle.
    NearestParticle,
}

/// Calls [`Separable::axis`] and checks that the list is not longer than [`Separable::width`]: the transfer has no room for more nodes.
///
/// # Errors
/// Errors of [`Separable::axis`], or a list that is too long.
#[inline]
pub(crate) fn list<S: Separable + ?Sized>(
    family: &S,
    axis: &Axis,
    x: f64,
    out: &mut AxisWeights,
) -> Result<(), ApproximationError> {
    family.axis(axis, x, out)?;
    let (listed, allowed) = (out.values.len(), family.width());
    if listed <= allowed { Ok(()) } else { Err(ApproximationError::TooManyNodes { listed, allowed }) }
}

/// The position of a coordinate in its cell, in units of the spacing. Both distances are accurate at the walls.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// The number of the cell, and of its lower node. A point on the upper wall belongs to the last cell.
    pub cell: u32,
    /// Distance from the lower node, 0 … 1.
    pub below: f64,
    /// Distance from the upper node, 1 − `below`.
    pub above: f64,
}

/// Round-off of a position that many steps have added up, in spacings.
const ACCUMULATED: f64 = 1e-12;

impl Place {
    /// # Errors
    /// The point is outside the axis, or the axis has no cells.
    #[inline]
    pub(crate) fn new(axis: &Axis, x: f64) -> Result<Self, ApproximationError> {
        check(axis)?;
        axis.local(x).map(|s| Self::at(axis, s)).ok_or_else(|| outside(&[*axis], &[x]))
    }

    /// The position at `s` spacings from the origin, 0 … cells.
    #[inline(always)]
    pub(crate) fn at(axis: &Axis, s: f64) -> Self {
        let cell = (s as u32).min(axis.cells - 1);
        // This difference is exact: s and the cell number agree in their leading digits.
        let below = s - f64::from(cell);
        Self { cell, below, above: 1.0 - below }
    }

    /// The signed distance D from a node of the axis, in spacings.
    #[inline(always)]
    pub(super) fn distance(&self, node: i64) -> f64 {
        let offset = (node - i64::from(self.cell)) as f64;
        if offset <= 0.0 { self.below - offset } else { -(self.above + (offset - 1.0)) }
    }

    /// The place, moved onto the edge of a support if only round-off separates them. Otherwise round-off would decide whether a node is
    /// active whose N and h|∇N| are round-off themselves, and nothing would hold such a node. `edge` is the distance from a node of the
    /// cell to the edges of supports in the cell, in spacings.
    #[inline(always)]
    pub(crate) fn at_edge(self, edge: f64, round_off: f64) -> Self {
        let round_off = round_off + ACCUMULATED;
        mutant!("shapes: round-off decides which nodes are active": round_off = -1.0);
        // At 0 supports end on faces of cells, and `Axis::spacings` has moved the point.
        if edge == 0.0 {
            self
        } else if (self.below - edge).abs() <= round_off {
            Self { below: edge, above: 1.0 - edge, ..self }
        } else if (self.above - edge).abs() <= round_off {
            Self { below: 1.0 - edge, above: edge, ..self }
        } else {
            self
        }
    }
}

/// # Errors
/// The axis has no cells, or no finite and positive spacing.
#[inline]
pub(crate) fn check(axis: &Axis) -> Result<(), ApproximationError> {
    if axis.cells == 0 || !(axis.spacing > 0.0 && axis.spacing.is_finite()) {
        return Err(ApproximationError::Grid { spacing: axis.spacing, cells: axis.cells });
    }
    Ok(())
}

/// The error of a point outside the box spanned by `axes`.
#[cold]
pub(super) fn outside(axes: &[Axis], x: &[f64]) -> ApproximationError {
    ApproximationError::Outside {
        position: x.to_vec(),
        lower: axes.iter().map(|axis| axis.origin).collect(),
        upper: axes.iter().map(|axis| axis.origin + f64::from(axis.cells) * axis.spacing).collect(),
    }
}

/// Checks that the point lies in the grid; the error names all coordinates.
#[inline]
pub(super) fn inside<const D: usize>(grid: &Grid<D>, x: &Vector<f64, D>) -> Result<(), ApproximationError> {
    if grid.contains(x) {
        return Ok(());
    }
    let axes: [Axis; D] = std::array::from_fn(|k| grid.axis(k));
    Err(outside(&axes, x.as_slice()))
}

/// N_I = Π_k N_k,   ∂N_I/∂x_k = N_k' Π_{m≠k} N_m,   the first axis running fastest.
///
/// A node is left out only if its value and every component of its gradient are exactly zero. On a cell face the far node of the linear
/// functions has N = 0 and a finite gradient. Without that node F would be wrong.
#[inline]
pub(super) fn product<const D: usize>(axes: &[AxisWeights; 3], out: &mut Support<D>) {
    out.clear();
    for at in indices::<D>(std::array::from_fn(|k| axes[k].values.len() as u64)).map(|at| at.map(|i| i as usize)) {
        let value: f64 = (0..D).map(|k| axes[k].values[at[k]]).product();
        let gradient: [f64; D] = std::array::from_fn(|k| {
            (0..D).map(|m| if m == k { axes[m].derivatives[at[m]] } else { axes[m].values[at[m]] }).product()
        });
        mutant!("shapes: nodes with N = 0 are left out": { if value == 0.0 { continue; } });
        if value != 0.0 || gradient.iter().any(|&g| g != 0.0) {
            out.push(std::array::from_fn(|k| axes[k].first + at[k] as u32), value, gradient);
        }
    }
}
