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

use crate::parallel;
use bodies::Bodies;

/// The extension E in sparse rows: each outer node, the inner nodes that it follows, and their weights. E is the identity at all other
/// nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Extension {
    /// The polynomial degree of the shape functions.
    degree: u32,
    /// The outer nodes, ascending.
    outer: Vec<u32>,
    /// For each outer node, the start of its row in `leaders` and `weights`; the last entry is the end of the last row.
    starts: Vec<u32>,
    leaders: Vec<u32>,
    weights: Vec<f64>,
    transpose: Transpose,
}

/// Eᵀ: the rows of an extension, sorted by inner node.
#[derive(Clone, Debug, Default, PartialEq)]
struct Transpose {
    /// The inner nodes that outer nodes follow, ascending.
    inner: Vec<u32>,
    /// For each of these nodes, the start of its row in `followers` and `weights`; the last entry is the end of the last row.
    starts: Vec<u32>,
    /// Places of outer nodes.
    followers: Vec<u32>,
    weights: Vec<f64>,
}

impl Transpose {
    fn of(extension: &Extension) -> Self {
        let nodes = extension.leaders.iter().max().map_or(0, |&last| last as usize + 1);
        let mut ends = vec![0_u32; nodes];
        extension.leaders.iter().for_each(|&leader| ends[leader as usize] += 1);
        let mut transpose = Self { starts: vec![0], ..Self::default() };
        let mut end = 0;
        for (node, count) in ends.iter_mut().enumerate().filter(|(_, count)| **count > 0) {
            transpose.inner.push(node as u32);
            (*count, end) = (end, end + *count);
            transpose.starts.push(end);
        }
        transpose.followers = vec![0; extension.leaders.len()];
        transpose.weights = vec![0.0; extension.leaders.len()];
        for place in 0..extension.len() {
            for (leader, weight) in extension.leaders(place) {
                let at = ends[leader] as usize;
                (transpose.followers[at], transpose.weights[at]) = (place as u32, weight);
                ends[leader] += 1;
            }
        }
        transpose
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
        let mut extension = Self { degree: pieces.degree, starts: vec![0], ..Self::default() };
        for (node, row) in outer.into_iter().zip(rows).filter_map(|(node, row)| Some((node, row?))) {
            extension.outer.push(node);
            for (leader, weight) in row.into_iter().filter(|(_, weight)| *weight != 0.0) {
                extension.leaders.push(leader);
                extension.weights.push(weight);
            }
            extension.starts.push(extension.leaders.len() as u32);
        }
        extension.transpose = Transpose::of(&extension);
        extension
    }

    /// The extension of several parts that share no nodes, in ascending order: each with the number of its first node.
    pub(crate) fn joined(degree: u32, parts: impl Iterator<Item = (usize, Self)>) -> Self {
        let mut all = Self { degree, starts: vec![0], ..Self::default() };
        for (first, part) in parts {
            let (first, rows) = (first as u32, all.leaders.len() as u32);
            all.outer.extend(part.outer.iter().map(|outer| first + outer));
            all.starts.extend(part.starts.iter().skip(1).map(|start| rows + start));
            all.leaders.extend(part.leaders.iter().map(|leader| first + leader));
            all.weights.extend(part.weights);
        }
        all.transpose = Transpose::of(&all);
        all
    }

    /// The degree of the functions, 1 to 3.
    pub(crate) fn degree(&self) -> u32 {
        self.degree
    }

    /// Number of outer nodes.
    pub fn len(&self) -> usize {
        self.outer.len()
    }

    /// Whether every node is an unknown.
    pub fn is_empty(&self) -> bool {
        self.outer.is_empty()
    }

    /// The outer nodes, ascending.
    pub fn outer(&self) -> &[u32] {
        &self.outer
    }

    /// The inner nodes that the outer node `outer()[place]` follows, and their weights.
    pub(crate) fn leaders(&self, place: usize) -> impl Iterator<Item = (usize, f64)> + use<'_> {
        let range = self.starts[place] as usize..self.starts[place + 1] as usize;
        self.leaders[range.clone()].iter().zip(&self.weights[range]).map(|(&leader, &weight)| (leader as usize, weight))
    }

    /// Every outer node with the inner nodes that it follows, and their weights.
    pub fn rows(&self) -> impl Iterator<Item = (usize, impl Iterator<Item = (usize, f64)>)> {
        self.outer.iter().enumerate().map(|(place, &outer)| (outer as usize, self.leaders(place)))
    }

    /// Bytes of all lists.
    pub(crate) fn bytes(&self) -> usize {
        let Self { outer, starts, leaders, weights, transpose, .. } = self;
        let numbers = outer.len() + starts.len() + leaders.len();
        let transposed = transpose.inner.len() + transpose.starts.len() + transpose.followers.len();
        (numbers + transposed) * size_of::<u32>() + (weights.len() + transpose.weights.len()) * size_of::<f64>()
    }

    /// The inner nodes that outer nodes follow, ascending.
    pub(crate) fn inner(&self) -> &[u32] {
        &self.transpose.inner
    }

    /// The places of the outer nodes that follow the inner node at `place` of [`Self::inner`], ascending, with their weights.
    pub(crate) fn followers(&self, place: usize) -> impl Iterator<Item = (usize, f64)> + use<'_> {
        let Transpose { starts, followers, weights, .. } = &self.transpose;
        let range = starts[place] as usize..starts[place + 1] as usize;
        followers[range.clone()].iter().zip(&weights[range]).map(|(&outer, &weight)| (outer as usize, weight))
    }
}
