//! Active nodes have N ≠ 0 or ∇N ≠ 0 at some particle. They are numbered in the order of the grid.

use crate::grid::Grid;
use crate::tensor::Vector;
use std::sync::Arc;

/// The active nodes of one step. Their memory grows with the body, not with the box.
///
/// ```
/// use bfree::grid::Grid;
/// use bfree::nodes::Nodes;
/// use bfree::tensor::Vector;
///
/// // Two particles in neighbouring cells of a grid of 100 × 100 cells share two of their nodes.
/// let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [100, 100] };
/// let cell = |i| [grid.id([i, 7]), grid.id([i + 1, 7]), grid.id([i, 8]), grid.id([i + 1, 8])];
/// let nodes = Nodes::new([cell(3), cell(4)].concat());
/// assert_eq!((nodes.len(), nodes.is_empty()), (6, false));
/// // Unknowns are numbered by active nodes, in the order of the grid.
/// assert_eq!(nodes.number(grid.id([5, 7])), Some(2));
/// assert_eq!((nodes.ids()[2], nodes.number(grid.id([6, 7]))), (grid.id([5, 7]), None));
/// assert_eq!(nodes.positions(&grid).nth(2), Some(([5, 7], Vector::from([5.0, 7.0]))));
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Nodes {
    /// Grid numbers of the active nodes, ascending.
    ids: Arc<Vec<u64>>,
}

impl Nodes {
    /// From grid numbers in any order, with repetitions.
    pub fn new(mut ids: Vec<u64>) -> Self {
        ids.sort_unstable();
        ids.dedup();
        Self::ascending(ids)
    }

    /// From grid numbers that ascend already.
    pub(crate) fn ascending(ids: Vec<u64>) -> Self {
        Self { ids: Arc::new(ids) }
    }

    /// The memory of the list for reuse; empty if a clone still uses it.
    pub(crate) fn into_spare(self) -> Vec<u64> {
        Arc::try_unwrap(self.ids).unwrap_or_default()
    }

    /// Number of active nodes.
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// Whether no node is active.
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    /// Grid numbers of the active nodes, ascending.
    pub fn ids(&self) -> &[u64] {
        &self.ids
    }

    /// Active number of the node with the grid number `id`.
    pub fn number(&self, id: u64) -> Option<usize> {
        self.ids.binary_search(&id).ok()
    }

    /// Index along each axis and position of every active node.
    pub fn positions<const D: usize>(&self, grid: &Grid<D>) -> impl Iterator<Item = ([u32; D], Vector<f64, D>)> {
        self.ids.iter().map(|&id| grid.index(id)).map(|index| (index, grid.position(index)))
    }
}
