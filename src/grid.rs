//! The Cartesian background grid: node positions and numbering. It stores nothing per node.
//!
//! Nodes are numbered brick by brick. A brick is a cube of 64 nodes: 64, 8 × 8 or 4 × 4 × 4. So nodes that lie near each other have near numbers.

use crate::tensor::Vector;

/// A position this near to a node lies on the node. The distance is a round-off bound, relative to the coordinates of the position and of
/// the grid's origin.
const ON_NODE: f64 = 32.0 * f64::EPSILON;

/// Number of nodes in a brick.
pub(crate) const BRICK: u64 = 64;

/// Edge of a brick in nodes.
pub(crate) const fn brick_edge(dimension: usize) -> u64 {
    match dimension {
        1 => 64,
        2 => 8,
        _ => 4,
    }
}

/// The uniform background grid of a box: `cells[k]` cells of edge `spacing` along axis `k`, nodes at the cell corners.
///
/// ```
/// use bfree::grid::Grid;
/// use bfree::tensor::Vector;
///
/// let grid = Grid { origin: Vector::from([0.0, -1.0]), spacing: 0.5, cells: [4, 2] };
/// // The first axis runs fastest in a brick of 8 × 8 nodes.
/// assert_eq!((grid.id([1, 0]), grid.id([0, 1])), (1, 8));
/// assert_eq!(grid.position([4, 2]), Vector::from([2.0, 0.0]));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid<const D: usize> {
    /// The lower corner of the box.
    pub origin: Vector<f64, D>,
    /// The distance h between neighbouring nodes, the same along every axis.
    pub spacing: f64,
    /// Cells along each axis.
    pub cells: [u32; D],
}

/// One axis of the grid, along which a product shape function is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Position of node 0.
    pub origin: f64,
    /// The spacing h.
    pub spacing: f64,
    /// Number of cells; nodes are `0..=cells`.
    pub cells: u32,
}

impl Axis {
    /// `x` in units of the spacing, from node 0; `None` outside the axis (or if `x` is not a number).
    ///
    /// The upper end is the last node: rounding in (x − origin)/h does not push the node out. A position within round-off of a node lies on
    /// it. The gradients of linear shape functions jump there, and round-off must not decide the side.
    #[inline]
    pub(crate) fn local(&self, x: f64) -> Option<f64> {
        let cells = f64::from(self.cells);
        let inside = x >= self.origin && x <= self.origin + cells * self.spacing;
        inside.then(|| self.spacings(x).min(cells))
    }

    /// (x − origin)/h, for an x that is not below the origin.
    #[inline(always)]
    pub(crate) fn spacings(&self, x: f64) -> f64 {
        let s = (x - self.origin) / self.spacing;
        let node = f64::from((s + 0.5) as u32);
        if (s - node).abs() <= self.round_off(x) { node } else { s }
    }

    /// A bound of the round-off of [`Self::spacings`].
    #[inline(always)]
    pub(crate) fn round_off(&self, x: f64) -> f64 {
        ON_NODE * (x.abs() + self.origin.abs()) / self.spacing
    }
}

impl<const D: usize> Grid<D> {
    /// Axis `k`.
    #[inline]
    pub fn axis(&self, k: usize) -> Axis {
        Axis { origin: self.origin[k], spacing: self.spacing, cells: self.cells[k] }
    }

    /// Number of nodes of the whole box, active or not.
    pub(crate) fn node_count(&self) -> u64 {
        self.cells.iter().map(|&n| u64::from(n) + 1).product()
    }

    /// Number of a node from its index along each axis. Bricks follow each other, and nodes within a brick; the first axis runs fastest.
    #[inline]
    pub fn id(&self, index: [u32; D]) -> u64 {
        let (edge, bricks) = (brick_edge(D), self.bricks());
        let (mut brick, mut local) = (0, 0);
        for k in (0..D).rev() {
            let at = u64::from(index[k]);
            brick = brick * bricks[k] + at / edge;
            local = local * edge + at % edge;
        }
        brick * BRICK + local
    }

    /// Bricks along each axis.
    #[inline]
    fn bricks(&self) -> [u64; D] {
        self.cells.map(|cells| (u64::from(cells) + 1).div_ceil(brick_edge(D)))
    }

    /// The count of grid numbers that one nodal field takes: 64 for each brick of the box.
    #[inline]
    pub(crate) fn numbers_of_field(&self) -> u64 {
        self.bricks().iter().product::<u64>() * BRICK
    }

    /// Number of a node in one of several nodal fields on this grid. [`Self::index`] is the same in all fields.
    #[inline]
    pub(crate) fn id_in(&self, field: u32, index: [u32; D]) -> u64 {
        // Most scenes have one field.
        if field == 0 { self.id(index) } else { u64::from(field) * self.numbers_of_field() + self.id(index) }
    }

    /// The nodal field of the node numbered `id`.
    pub(crate) fn field(&self, id: u64) -> u32 {
        (id / self.numbers_of_field()) as u32
    }

    /// Index along each axis of the node numbered `id`.
    #[inline]
    pub(crate) fn index(&self, id: u64) -> [u32; D] {
        let edge = brick_edge(D);
        let (brick, local) = (digits(id / BRICK, self.bricks()), digits(id % BRICK, [edge; D]));
        std::array::from_fn(|k| (brick[k] * edge + local[k]) as u32)
    }

    /// Position of the node with the given index.
    #[inline]
    pub fn position(&self, index: [u32; D]) -> Vector<f64, D> {
        Vector::from_fn(|k, _| self.origin[k] + f64::from(index[k]) * self.spacing)
    }

    /// Whether `x` lies in the box, its faces included.
    ///
    /// ```
    /// use bfree::grid::Grid;
    /// use bfree::tensor::Vector;
    ///
    /// let grid = Grid { origin: Vector::from([0.0, 0.0]), spacing: 0.5, cells: [4, 2] };
    /// assert!(grid.contains(&Vector::from([2.0, 1.0])) && !grid.contains(&Vector::from([2.0, 1.001])));
    /// ```
    pub fn contains(&self, x: &Vector<f64, D>) -> bool {
        (0..D).all(|k| self.axis(k).local(x[k]).is_some())
    }

    /// The cell that holds `x`; a point on the upper face belongs to the last cell. `None` outside the box.
    pub(crate) fn cell(&self, x: &Vector<f64, D>) -> Option<[u32; D]> {
        self.contains(x)
            .then(|| std::array::from_fn(|k| (self.axis(k).spacings(x[k]) as u32).min(self.cells[k].saturating_sub(1))))
    }

    /// The cells at most `reach` cells away from a cell along each axis, with the cell itself.
    pub(crate) fn around(&self, cell: [u32; D], reach: u32) -> impl Iterator<Item = [u32; D]> {
        let low = cell.map(|i| i.saturating_sub(reach));
        let counts: [u64; D] = std::array::from_fn(|k| u64::from((cell[k] + reach + 1).min(self.cells[k]) - low[k]));
        indices(counts).map(move |step| std::array::from_fn(|k| low[k] + step[k] as u32))
    }
}

/// All indices below `count`, the first axis fastest.
pub(crate) fn indices<const D: usize>(count: [u64; D]) -> impl Iterator<Item = [u64; D]> {
    (0..count.iter().product()).map(move |id| digits(id, count))
}

/// The index along each axis of the `id`-th of `count` points, the first axis fastest.
#[inline]
fn digits<const D: usize>(mut id: u64, count: [u64; D]) -> [u64; D] {
    count.map(|n| {
        let index = id % n;
        id /= n;
        index
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_node_lies_in_the_box_whatever_the_rounding() {
        for cells in 1..200 {
            for tenths in 0..20 {
                let origin = f64::from(tenths) * 0.1;
                let grid = Grid { origin: Vector::from([origin]), spacing: 0.1, cells: [cells] };
                assert!(grid.contains(&grid.position([cells])), "{cells} cells from {origin}");
                assert_eq!(grid.cell(&grid.position([cells])), Some([cells - 1]));
            }
        }
    }

    #[test]
    fn ids_and_indices_are_inverse_to_each_other() {
        let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [4, 2, 3] };
        let nodes = || indices(grid.cells.map(|cells| u64::from(cells) + 1)).map(|index| index.map(|i| i as u32));
        assert_eq!(nodes().count() as u64, grid.node_count());
        for (index, field) in nodes().flat_map(|index| [0, 1, 2].map(|field| (index, field))) {
            let id = grid.id_in(field, index);
            assert_eq!((grid.index(id), grid.field(id)), (index, field));
            assert!(id < 3 * grid.numbers_of_field());
        }
    }

    #[test]
    fn a_position_within_round_off_of_a_node_lies_on_the_node() {
        let axis = Axis { origin: -1.0, spacing: 0.5, cells: 4 };
        assert_eq!([-1.0, 0.25, 1.0].map(|x| axis.local(x)), [Some(0.0), Some(2.5), Some(4.0)]);
        assert_eq!([-0.5 - 1e-15, -0.5 + 1e-15].map(|x| axis.local(x)), [Some(1.0); 2]);
        assert_eq!([1.0 + 1e-15, f64::NAN].map(|x| axis.local(x)), [None; 2]);
        // Far from 0, rounding moves positions by more: 1000.3 − 1000 is not 0.3.
        let far = Axis { origin: 1000.0, spacing: 0.1, cells: 40 };
        assert_eq!([1000.3, 1000.3 + 2e-13].map(|x| far.local(x)), [Some(3.0); 2]);
        assert!(far.local(1000.3 + 1e-9).is_some_and(|s| s > 3.0));
    }

    #[test]
    fn a_point_on_the_upper_face_belongs_to_the_last_cell() {
        let grid = Grid { origin: Vector::from([0.0, 0.0]), spacing: 0.5, cells: [4, 2] };
        let cells = [[0.5, 0.3], [2.0, 1.0], [-0.1, 0.3]].map(|x| grid.cell(&Vector::from(x)));
        assert_eq!(cells, [Some([1, 0]), Some([3, 1]), None]);
    }
}
