//! Aggregation of nodes at the boundary of a body (extended B-splines: Höllig, Reif and Wipper, SIAM J. Numer. Anal. 39, 2001).
//!
//! A node with little of a body has next to no stiffness, and its value is next to free. Such an *outer* node is no unknown. It follows
//! well-supported *inner* nodes,
//!
//! ```text
//! u = E û,    R̂ = Eᵀ R,    K̂ = Eᵀ K E
//! ```
//!
//! by the polynomial of the nearest *good* cell of its piece of body. E has no parameter with a unit and no stiffness of its own. It
//! reproduces polynomials of the functions' degree, so rigid motions, uniform strains, resultants and moments of loads stay exact.
//!
//! - A *knot cell* is where all functions are one polynomial: [c, c+1] for odd degrees, [c − ½, c + ½] for even ones. Its *window* is the
//!   nodes of these functions.
//! - A knot cell is *good* if the body fills at least the share θ of it. Where there is no good cell next to a cell, the fullest cells
//!   there count as good.
//! - A node is inner if it is in the window of a good cell, and outer if it is not.
//! - Among good cells at one distance, the mean of their polynomials counts: mirrored bodies have mirrored motions.

mod bodies;
mod followers;
mod pieces;

pub use followers::Followers;
pub use pieces::Pieces;

use bodies::Bodies;
use std::collections::{BTreeMap, HashSet};

/// E: the outer nodes, each with the inner nodes that it follows and their weights. All other nodes stay as they are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Extension {
    /// Of the functions.
    degree: u32,
    /// The outer nodes, ascending.
    outer: Vec<u32>,
    /// Where the list of each of them begins; one more at the end.
    starts: Vec<u32>,
    leaders: Vec<u32>,
    weights: Vec<f64>,
}

/// Where a body lies in the grid, as the extension sees it. Indices have three axes; an axis that does not exist has no cells, and index 0.
#[derive(Clone, Debug)]
pub struct Occupied<'a> {
    /// D
    pub dimension: usize,
    /// Cells along each axis.
    pub grid: [u32; 3],
    /// The active nodes.
    pub nodes: &'a [[u32; 3]],
    /// Each knot cell with something in it, and the share of it that is filled.
    pub cells: Vec<([u32; 3], f64)>,
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
        let inner: HashSet<u32> =
            good.iter().flat_map(|&cell| bodies.windows[cell].iter().flatten().copied()).collect();
        let is_good: HashSet<usize> = good.into_iter().collect();
        let mut extension = Self { degree: pieces.degree, starts: vec![0], ..Self::default() };
        for number in (0..occupied.nodes.len() as u32).filter(|number| !inner.contains(number)) {
            let nearest = bodies.nearest(occupied.nodes[number as usize], &is_good);
            if !nearest.is_empty() {
                extension.push(number, bodies.row(occupied.nodes[number as usize], &nearest));
            }
        }
        extension
    }

    fn push(&mut self, outer: u32, row: BTreeMap<u32, f64>) {
        self.outer.push(outer);
        for (leader, weight) in row.into_iter().filter(|(_, weight)| *weight != 0.0) {
            self.leaders.push(leader);
            self.weights.push(weight);
        }
        self.starts.push(self.leaders.len() as u32);
    }

    /// The degree of the functions, 1 to 3.
    pub fn degree(&self) -> u32 {
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

    /// The inner nodes that the outer node at `place` of [`Self::outer`] follows, and their weights.
    pub fn leaders(&self, place: usize) -> impl Iterator<Item = (usize, f64)> + use<'_> {
        let range = self.starts[place] as usize..self.starts[place + 1] as usize;
        self.leaders[range.clone()].iter().zip(&self.weights[range]).map(|(&leader, &weight)| (leader as usize, weight))
    }

    /// Every outer node with the inner nodes that it follows, and their weights.
    pub fn rows(&self) -> impl Iterator<Item = (usize, impl Iterator<Item = (usize, f64)>)> {
        self.outer.iter().enumerate().map(|(place, &outer)| (outer as usize, self.leaders(place)))
    }

    /// Bytes of all lists.
    pub fn bytes(&self) -> usize {
        let Self { outer, starts, leaders, weights, .. } = self;
        size_of_val(&outer[..]) + size_of_val(&starts[..]) + size_of_val(&leaders[..]) + size_of_val(&weights[..])
    }
}
