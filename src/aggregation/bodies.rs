//! Knot cells of the bodies: the search for good cells, and the good cells whose polynomials an outer node follows.

use super::pieces::Pieces;
use crate::grid::indices;
use crate::lists::Lists;
use crate::parallel;
use rustc_hash::FxHashMap;
use std::collections::{BTreeMap, HashSet};
use std::ops::RangeInclusive;

/// The part of the grid that a body occupies. Indices have three components; an axis beyond D has no cells, and index 0.
#[derive(Clone, Debug)]
pub struct Occupied<'a> {
    /// The number of dimensions D.
    pub dimension: usize,
    /// Cells along each axis.
    pub grid: [u32; 3],
    /// The active nodes.
    pub nodes: &'a [[u32; 3]],
    /// The occupied knot cells, each with its filled fraction.
    pub cells: Vec<([u32; 3], f64)>,
}

/// Cells in one part of the work of a thread.
const CELLS: usize = 256;

/// Relative tolerance of comparisons between filled fractions: round-off must not choose a cell.
const SAME: f64 = 1e-6;

/// The largest distance, in cells, at which an outer node looks for a good cell: polynomials grow with the distance. A node that finds no
/// good cell is an unknown.
const FURTHEST: i64 = 6;

/// The occupied knot cells of all bodies.
pub(super) struct Bodies {
    pieces: Pieces,
    grid: [i64; 3],
    dimension: usize,
    cells: Vec<([i64; 3], f64)>,
    places: FxHashMap<[i64; 3], usize>,
    /// For each cell, the first cell of the connected piece that contains it.
    piece: Vec<usize>,
    /// For each cell, the nodes of its functions; `None` if one of these nodes is not active.
    pub(super) windows: Vec<Option<Vec<u32>>>,
    numbers: FxHashMap<[i64; 3], u32>,
    /// For each cell, the occupied cells that share a corner with it, including the cell itself.
    neighbours: Lists<u32>,
}

impl Bodies {
    pub(super) fn new(pieces: Pieces, occupied: &Occupied<'_>) -> Self {
        let mut cells: Vec<_> = occupied.cells.iter().map(|&(cell, share)| (cell.map(i64::from), share)).collect();
        cells.sort_unstable_by_key(|(cell, _)| *cell);
        let numbers = occupied.nodes.iter().zip(0..).map(|(node, number)| (node.map(i64::from), number)).collect();
        let places = cells.iter().enumerate().map(|(place, (cell, _))| (*cell, place)).collect();
        let mut bodies = Self {
            pieces,
            grid: occupied.grid.map(i64::from),
            dimension: occupied.dimension,
            piece: (0..cells.len()).collect(),
            windows: Vec::new(),
            neighbours: Lists::default(),
            cells,
            places,
            numbers,
        };
        bodies.windows = parallel::values_by(CELLS, bodies.cells.len(), |cell| bodies.window(bodies.cells[cell].0));
        bodies.neighbours = bodies.found_neighbours();
        bodies.connect();
        bodies
    }

    /// The nodes of a cell's functions; `None` unless all of these nodes are active.
    fn window(&self, cell: [i64; 3]) -> Option<Vec<u32>> {
        let along = |k| if k < self.dimension { self.pieces.window(cell[k], self.grid[k]) } else { 0..=0 };
        in_box([0, 1, 2].map(along)).map(|node| self.numbers.get(&node).copied()).collect()
    }

    /// For each cell, the occupied cells that share a corner with it, including the cell itself.
    fn found_neighbours(&self) -> Lists<u32> {
        let beside =
            |cell: usize| -> Vec<u32> { self.around(self.cells[cell].0, 1).map(|beside| beside as u32).collect() };
        let mut neighbours = Lists::default();
        parallel::values_by(CELLS, self.cells.len(), beside).into_iter().for_each(|row| neighbours.push(row));
        neighbours
    }

    /// The occupied cells at most `reach` cells away along every axis, including the cell itself.
    fn around(&self, cell: [i64; 3], reach: i64) -> impl Iterator<Item = usize> {
        let along = |k| if k < self.dimension { cell[k] - reach..=cell[k] + reach } else { 0..=0 };
        in_box([0, 1, 2].map(along)).filter_map(|at| self.places.get(&at).copied())
    }

    /// The occupied cells that share a corner with a cell, including the cell itself.
    fn beside(&self, cell: usize) -> impl Iterator<Item = usize> + use<'_> {
        self.neighbours.row(cell).iter().map(|&beside| beside as usize)
    }

    /// Finds the connected pieces: cells that share a corner belong to one piece.
    fn connect(&mut self) {
        let mut seen = vec![false; self.cells.len()];
        for start in 0..self.cells.len() {
            let mut stack = if seen[start] { Vec::new() } else { vec![start] };
            seen[start] = true;
            while let Some(cell) = stack.pop() {
                self.piece[cell] = start;
                for next in self.beside(cell) {
                    if !std::mem::replace(&mut seen[next], true) {
                        stack.push(next);
                    }
                }
            }
        }
    }

    /// The good cells: all cells filled to at least θ. While some cells have no good neighbour, the locally fullest of these cells become
    /// good as well. The nodes of a good cell are all active.
    pub(super) fn good(&self) -> Vec<usize> {
        let cells = || 0..self.cells.len();
        let share = |cell: usize| self.cells[cell].1;
        // Cells that may be good, and have no good cell beside them yet.
        let mut alone: Vec<bool> = self.windows.iter().map(Option::is_some).collect();
        let mut good: Vec<usize> =
            cells().filter(|&cell| alone[cell] && share(cell) >= self.pieces.share * (1.0 - SAME)).collect();
        let mut new = good.clone();
        loop {
            new.iter().for_each(|&cell| self.beside(cell).for_each(|beside| alone[beside] = false));
            let fullest = |&cell: &usize| {
                let mut beside = self.beside(cell).filter(|&beside| alone[beside]);
                beside.all(|beside| share(cell) >= share(beside) * (1.0 - SAME))
            };
            new = cells().filter(|&cell| alone[cell]).filter(fullest).collect();
            if new.is_empty() {
                good.sort_unstable();
                return good;
            }
            good.extend(&new);
        }
    }

    /// The squared distance from a node to the centre of a cell, with lengths in half spacings.
    fn distance(&self, node: [i64; 3], cell: usize) -> i64 {
        (0..self.dimension).map(|k| (2 * node[k] - self.pieces.centre(self.cells[cell].0[k])).pow(2)).sum()
    }

    /// The good cells nearest to a node, among the connected pieces that contain the cells nearest to the node.
    pub(super) fn nearest(&self, node: [u32; 3], good: &[bool]) -> Vec<usize> {
        let node = node.map(i64::from);
        let nearest = |may: &dyn Fn(usize) -> bool| {
            let mut found = (i64::MAX, Vec::new());
            for reach in 1..=FURTHEST {
                for cell in self.around(node, reach).filter(|&cell| may(cell)) {
                    match self.distance(node, cell) {
                        nearer if nearer < found.0 => found = (nearer, vec![cell]),
                        same if same == found.0 && !found.1.contains(&cell) => found.1.push(cell),
                        _ => {}
                    }
                }
                // The search has visited all cells whose centres are this near.
                if found.0 <= (2 * reach - 1).pow(2) {
                    break;
                }
            }
            found.1
        };
        let pieces: HashSet<usize> = nearest(&|_| true).into_iter().map(|cell| self.piece[cell]).collect();
        let mut cells = nearest(&|cell| good[cell] && pieces.contains(&self.piece[cell]));
        cells.sort_unstable();
        cells
    }

    /// The row of E for a node: the mean of the polynomials of `cells` at that node, as weights of other nodes.
    pub(super) fn row(&self, node: [u32; 3], cells: &[usize]) -> BTreeMap<u32, f64> {
        let mut row = BTreeMap::new();
        for &cell in cells {
            let along = [0, 1, 2].map(|k| match k < self.dimension {
                true => self.pieces.follow(self.cells[cell].0[k], self.grid[k], i64::from(node[k])),
                false => vec![(0, 1.0)],
            });
            for at in indices(along.each_ref().map(|list| list.len() as u64)) {
                let [x, y, z] = std::array::from_fn(|k| along[k][at[k] as usize]);
                if let Some(&number) = self.numbers.get(&[x.0, y.0, z.0]) {
                    *row.entry(number).or_insert(0.0) += x.1 * y.1 * z.1 / cells.len() as f64;
                }
            }
        }
        row
    }
}

/// The indices in a box, from its range along each axis.
fn in_box(ranges: [RangeInclusive<i64>; 3]) -> impl Iterator<Item = [i64; 3]> {
    let count = ranges.each_ref().map(|range| (range.end() - range.start() + 1).max(0) as u64);
    indices(count).map(move |by| [0, 1, 2].map(|k| ranges[k].start() + by[k] as i64))
}
