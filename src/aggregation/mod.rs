//! Aggregation of nodes at the boundary of a body (extended B-splines: Höllig, Reif and Wipper, SIAM J. Numer. Anal. 39, 2001).
//!
//! A node that supports only a small part of a body has next to no stiffness, so its value is almost arbitrary. Such an *outer* node is not
//! an unknown. An outer node follows well-supported *inner* nodes:
//!
//! ```text
//! u = E û,    R̂ = Eᵀ R,    K̂ = Eᵀ K E
//! ```
//!
//! The weights in E come from the polynomial of the nearest *good* cell of the same connected piece of the body. E has no parameter with a
//! unit, and no stiffness. E reproduces polynomials of the functions' degree. So rigid motions and uniform strains stay exact, and so do
//! resultants and moments of loads.
//!
//! - A *knot cell* is an interval in which each function is a single polynomial: [c, c+1] for odd degrees, [c − ½, c + ½] for even degrees.
//!   The *window* of a knot cell is the set of nodes of these functions.
//! - A knot cell is *good* if the body fills at least the fraction θ of it. If no cell next to a knot cell is good, the fullest cells there
//!   count as good.
//! - A node is inner if it is in the window of a good cell, and outer otherwise.
//! - If several good cells are equally near, the mean of their polynomials counts. So mirrored bodies have mirrored motions.

mod bodies;
mod pieces;

pub use bodies::Occupied;
pub use pieces::Pieces;

use crate::lists::Lists;
use crate::parallel;
use bodies::Bodies;

/// The extension E in sparse rows: each outer node, the inner nodes that it follows, and their weights. E is the identity at all other
/// nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Extension {
    /// The polynomial degree of the shape functions.
    degree: u32,
    /// The outer nodes, with the inner nodes that each follows.
    outer: SparseRows,
    /// Eᵀ: the inner nodes that outer nodes follow, with the places of their outer nodes, ascending.
    inner: SparseRows,
}

/// Rows of a sparse matrix.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SparseRows {
    /// The node of each row, ascending.
    pub(crate) nodes: Vec<u32>,
    pub(crate) entries: Lists<u32>,
    pub(crate) weights: Vec<f64>,
}

impl SparseRows {
    fn row(&self, place: usize) -> impl Iterator<Item = (usize, f64)> + use<'_> {
        let (entries, weights) = (self.entries.row(place), &self.weights[self.entries.range(place)]);
        entries.iter().zip(weights).map(|(&entry, &weight)| (entry as usize, weight))
    }

    /// The rows of the transpose that are not empty. Their entries are places in these rows.
    fn transposed(&self) -> Self {
        let [_, entries] = self.entries.arrays();
        let count = entries.iter().max().map_or(0, |&last| last as usize + 1);
        let (places, owners) = (Lists::of_places(entries, count), self.entries.owners());
        let nodes = (0..count).filter(|&node| !places.row(node).is_empty()).map(|node| node as u32).collect();
        let weights = places.arrays()[1].iter().map(|&place| self.weights[place as usize]).collect();
        Self { nodes, entries: places.without_empty_rows().map(|place| owners[place as usize]), weights }
    }

    fn bytes(&self) -> usize {
        let [starts, entries] = self.entries.arrays();
        size_of_val(&*self.nodes) + size_of_val(starts) + size_of_val(entries) + size_of_val(&*self.weights)
    }
}

impl Extension {
    /// The extension for a body in a grid.
    ///
    /// ```
    /// use bfree::aggregation::{Extension, Occupied, Pieces};
    ///
    /// // A bar in the cells 0 to 3, of which the last one is filled to a tenth: node 4 follows nodes 2 and 3.
    /// let nodes: Vec<[u32; 3]> = (0..5).map(|i| [i, 0, 0]).collect();
    /// let cells = [1.0, 1.0, 1.0, 0.1].iter().zip(0..).map(|(&share, i)| ([i, 0, 0], share)).collect();
    /// let occupied = Occupied { dimension: 1, grid: [8, 0, 0], nodes: &nodes, cells };
    /// let extension = Extension::new(Pieces::LINEAR, &occupied);
    /// let rows: Vec<_> = extension.rows().map(|(outer, leaders)| (outer, leaders.collect::<Vec<_>>())).collect();
    /// assert_eq!(rows, [(4, vec![(2, -1.0), (3, 2.0)])]);
    /// ```
    pub fn new(pieces: Pieces, occupied: &Occupied<'_>) -> Self {
        let bodies = Bodies::new(pieces, occupied);
        let good = bodies.good();
        let (mut inner, mut is_good) = (vec![false; occupied.nodes.len()], vec![false; bodies.windows.len()]);
        for cell in good {
            is_good[cell] = true;
            bodies.windows[cell].iter().flatten().for_each(|&node| inner[node as usize] = true);
        }
        let outer: Vec<u32> = (0..).zip(inner).filter(|(_, inner)| !inner).map(|(node, _)| node).collect();
        let rows = parallel::map(outer.len(), &|row| {
            let node = occupied.nodes[outer[row] as usize];
            let nearest = bodies.nearest(node, &is_good);
            (!nearest.is_empty()).then(|| bodies.row(node, &nearest))
        });
        let mut all = SparseRows::default();
        for (node, mut row) in outer.into_iter().zip(rows).filter_map(|(node, row)| Some((node, row?))) {
            row.retain(|_, weight| *weight != 0.0);
            all.nodes.push(node);
            all.entries.push(row.keys().copied());
            all.weights.extend(row.values());
        }
        Self { degree: pieces.degree, inner: all.transposed(), outer: all }
    }

    /// The extension of several parts that share no nodes, in ascending order: each with the number of its first node.
    pub(crate) fn joined(degree: u32, parts: impl Iterator<Item = (usize, Self)>) -> Self {
        let mut all = SparseRows::default();
        for (first, Self { outer, .. }) in parts {
            let first = first as u32;
            all.nodes.extend(outer.nodes.iter().map(|node| first + node));
            for place in 0..outer.nodes.len() {
                all.entries.push(outer.entries.row(place).iter().map(|leader| first + leader));
            }
            all.weights.extend(outer.weights);
        }
        Self { degree, inner: all.transposed(), outer: all }
    }

    /// The degree of the functions, 1 to 3.
    pub(crate) fn degree(&self) -> u32 {
        self.degree
    }

    /// Number of outer nodes.
    pub fn len(&self) -> usize {
        self.outer.nodes.len()
    }

    /// Whether every node is an unknown.
    pub fn is_empty(&self) -> bool {
        self.outer.nodes.is_empty()
    }

    /// The outer nodes, ascending.
    pub fn outer(&self) -> &[u32] {
        &self.outer.nodes
    }

    /// The inner nodes that the outer node `outer()[place]` follows, and their weights.
    pub(crate) fn leaders(&self, place: usize) -> impl Iterator<Item = (usize, f64)> + use<'_> {
        self.outer.row(place)
    }

    /// Every outer node with the inner nodes that it follows, and their weights.
    pub fn rows(&self) -> impl Iterator<Item = (usize, impl Iterator<Item = (usize, f64)>)> {
        self.outer.nodes.iter().enumerate().map(|(place, &outer)| (outer as usize, self.leaders(place)))
    }

    /// Bytes of all lists.
    pub(crate) fn bytes(&self) -> usize {
        self.outer.bytes() + self.inner.bytes()
    }

    /// The inner nodes that outer nodes follow, ascending.
    pub(crate) fn inner(&self) -> &[u32] {
        &self.inner.nodes
    }

    /// The places of the outer nodes that follow the inner node at `place` of [`Self::inner`], ascending, with their weights.
    pub(crate) fn followers(&self, place: usize) -> impl Iterator<Item = (usize, f64)> + use<'_> {
        self.inner.row(place)
    }

    /// The rows of E and of Eᵀ.
    pub(crate) fn rows_and_transpose(&self) -> [&SparseRows; 2] {
        [&self.outer, &self.inner]
    }
}
