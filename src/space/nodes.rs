//! Active nodes have N ≠ 0 or ∇N ≠ 0 at some particle. They are numbered in the order of the [grid](Grid::id), brick by brick, so that nodes that lie
//! near each other have near numbers.

use crate::grid::{BRICK, Grid};
use crate::tensor::Vector;
use std::sync::Arc;

/// Bricks in one part of the work of a thread.
const BRICKS: usize = 32;

/// The active nodes of one step. Their memory grows with the body, not with the box.
///
/// ```
/// use bfree::grid::Grid;
/// use bfree::space::Nodes;
/// use bfree::tensor::Vector;
///
/// // Two particles in neighbouring cells of a grid of 100 × 100 cells share two of their nodes.
/// let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [100, 100] };
/// let cell = |i| [grid.id([i, 2]), grid.id([i + 1, 2]), grid.id([i, 3]), grid.id([i + 1, 3])];
/// let nodes = Nodes::new([cell(3), cell(4)].concat());
/// assert_eq!((nodes.len(), nodes.is_empty()), (6, false));
/// // Unknowns are numbered by active nodes, in the order of the grid.
/// assert_eq!(nodes.number(grid.id([5, 2])), Some(2));
/// assert_eq!((nodes.id(2), nodes.number(grid.id([6, 2]))), (grid.id([5, 2]), None));
/// assert_eq!(nodes.positions(&grid).nth(2), Some(([5, 2], Vector::from([5.0, 2.0]))));
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Nodes {
    /// The bricks with an active node, ascending.
    bricks: Arc<Vec<Brick>>,
    len: usize,
}

/// The active nodes of a brick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Brick {
    /// The grid number of the first node of the brick, over 64.
    number: u64,
    /// Bit k stands for the node k of the brick.
    active: u64,
    /// The active number of the first of them.
    first: u32,
}

impl Brick {
    /// The number of active nodes before the node k.
    fn before(self, k: u64) -> u32 {
        (self.active & ((1 << k) - 1)).count_ones()
    }
}

impl Nodes {
    /// From grid numbers in any order, with repetitions.
    pub fn new(mut ids: Vec<u64>) -> Self {
        ids.sort_unstable();
        Self::of_bricks(ids.into_iter().map(|id| [id / BRICK, 1 << (id % BRICK)]).collect())
    }

    /// From the numbers of bricks, in any order, each with bits for its active nodes. A brick may occur several times, with other nodes.
    pub(crate) fn of_bricks(mut parts: Vec<[u64; 2]>) -> Self {
        parts.sort_unstable_by_key(|&[number, _]| number);
        let mut len = 0;
        let brick = |same: &[[u64; 2]]| {
            let active = same.iter().fold(0, |all, [_, active]| all | active);
            let brick = Brick { number: same[0][0], active, first: len };
            len += active.count_ones();
            brick
        };
        let bricks: Vec<Brick> = parts.chunk_by(|one, next| one[0] == next[0]).map(brick).collect();
        Self { bricks: Arc::new(bricks), len: len as usize }
    }

    /// Number of active nodes.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether no node is active.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Grid numbers of the active nodes, ascending.
    pub(crate) fn ids(&self) -> impl Iterator<Item = u64> {
        ids_of(&self.bricks)
    }

    /// The active nodes in parts: the number of the first one, and the grid numbers of all.
    pub(crate) fn parts(&self) -> impl Iterator<Item = (usize, impl Iterator<Item = u64> + Send)> {
        self.bricks.chunks(BRICKS).map(|part| (part[0].first as usize, ids_of(part)))
    }

    /// Grid number of the active node with this number.
    ///
    /// # Panics
    /// There are not so many active nodes.
    pub fn id(&self, node: usize) -> u64 {
        let brick = &self.bricks[self.bricks.partition_point(|brick| brick.first as usize <= node) - 1];
        let mut active = brick.active;
        (brick.first as usize..node).for_each(|_| active &= active - 1);
        brick.number * BRICK + u64::from(active.trailing_zeros())
    }

    /// Active number of the node with the grid number `id`.
    pub fn number(&self, id: u64) -> Option<usize> {
        let at = self.bricks.binary_search_by_key(&(id / BRICK), |brick| brick.number).ok()?;
        let (brick, k) = (self.bricks[at], id % BRICK);
        (brick.active >> k & 1 == 1).then(|| (brick.first + brick.before(k)) as usize)
    }

    /// The active numbers of the nodes 0 to 63 of a brick that has active nodes.
    pub(crate) fn numbers_in(&self, brick: u64) -> impl Fn(u64) -> u32 {
        let at = self.bricks.partition_point(|one| one.number < brick);
        let brick = self.bricks[at];
        move |k| brick.first + brick.before(k)
    }

    /// The number of active nodes with grid numbers below that of the first node of a brick, which is a multiple of 64.
    pub(crate) fn before(&self, id: u64) -> usize {
        let at = self.bricks.partition_point(|brick| brick.number < id / BRICK);
        self.bricks.get(at).map_or(self.len, |brick| brick.first as usize)
    }

    /// Index along each axis and position of every active node.
    pub fn positions<const D: usize>(&self, grid: &Grid<D>) -> impl Iterator<Item = ([u32; D], Vector<f64, D>)> {
        self.ids().map(|id| grid.index(id)).map(|index| (index, grid.position(index)))
    }
}

/// Grid numbers of the active nodes in some bricks, ascending.
fn ids_of(bricks: &[Brick]) -> impl Iterator<Item = u64> {
    bricks.iter().flat_map(|brick| bits(brick.active).map(|k| brick.number * BRICK + k))
}

/// The bits that are set, ascending.
pub(crate) fn bits(mut set: u64) -> impl Iterator<Item = u64> {
    std::iter::from_fn(move || {
        let next = (set != 0).then(|| u64::from(set.trailing_zeros()));
        set &= set.wrapping_sub(1);
        next
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_ids_are_inverse_to_each_other() {
        let ids: Vec<u64> = (0..3000).filter(|id| id * id % 7 < 3 && !(400..900).contains(id)).collect();
        let nodes = Nodes::new(ids.iter().rev().chain(&ids).copied().collect());
        assert!(nodes.ids().eq(ids.iter().copied()));
        for id in 0..3000 {
            let place = ids.binary_search(&id).ok();
            assert_eq!(nodes.number(id), place);
            place.into_iter().for_each(|place| assert_eq!(nodes.id(place), id));
        }
        for id in (0..3200).step_by(64) {
            assert_eq!(nodes.before(id), ids.partition_point(|&one| one < id));
        }
    }
}
