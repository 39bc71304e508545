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

use crate::scalar::Real;
use crate::tensor::Vector;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

/// Shares of two cells that differ by less than this, relative to the larger one, are the same: rounding does not choose a cell.
const SAME: f64 = 1e-6;

/// How many cells away an outer node looks for a good cell. Polynomials grow with the distance; a node that finds none is an unknown.
const FURTHEST: i64 = 6;

/// Axes of fewer cells have no room for two ends at which functions curve.
const ROOM: i64 = 4;

/// The polynomials of which shape functions are made, along an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pieces {
    /// The degree p, 1 to 3; 1 for functions that are no polynomials.
    pub degree: u32,
    /// The degree with which outer nodes continue the polynomial of a cell: p where sums over particles integrate, else 1. Higher degrees
    /// would make errors of sums larger.
    pub extension: u32,
    /// Whether functions curve next to a wall of the grid ([`NotAKnotBspline`](crate::approximation::NotAKnotBspline)), where the unknown of
    /// the wall's node is the value there. If not, coefficients beyond a wall continue linearly.
    pub curves_at_walls: bool,
    /// θ, the share of a knot cell that a body fills at least if the cell is good; no unit.
    pub share: f64,
}

impl Pieces {
    /// Of linear functions, and of those that are no polynomials.
    pub const LINEAR: Self = Self { degree: 1, extension: 1, curves_at_walls: false, share: 0.5 };

    /// The knot cell along an axis of `cells` cells, at `local` spacings from its first node.
    pub(crate) fn cell(self, local: f64, cells: u32) -> u32 {
        if self.degree.is_multiple_of(2) { (local + 0.5) as u32 } else { (local as u32).min(cells.saturating_sub(1)) }
    }

    /// The knot cells that a length along an axis overlaps, and which part of it lies in each; in spacings from the first node.
    pub(crate) fn overlaps(self, middle: f64, length: f64, cells: u32) -> Vec<(u32, f64)> {
        let (from, to) = ((middle - 0.5 * length).max(0.0), (middle + 0.5 * length).min(f64::from(cells)));
        if from >= to {
            return vec![(self.cell(middle, cells), 1.0)];
        }
        let begin = |cell: u32| f64::from(cell) - if self.degree.is_multiple_of(2) { 0.5 } else { 0.0 };
        let part = |cell: u32| (to.min(begin(cell + 1)) - from.max(begin(cell))).max(0.0) / (to - from);
        (self.cell(from, cells)..=self.cell(to, cells)).map(|cell| (cell, part(cell))).collect()
    }

    /// The share of a knot cell that lies within the grid along an axis: a cell of even degree is halved by a wall.
    pub(crate) fn within(self, cell: u32, cells: u32) -> f64 {
        if self.degree.is_multiple_of(2) && (cell == 0 || cell == cells) { 0.5 } else { 1.0 }
    }

    /// The centre of a cell, in half spacings.
    fn centre(self, cell: i64) -> i64 {
        if self.degree.is_multiple_of(2) { 2 * cell } else { 2 * cell + 1 }
    }

    /// The nodes of a cell's functions along an axis of `cells` cells.
    fn window(self, cell: i64, cells: i64) -> std::ops::RangeInclusive<i64> {
        let first = self.first(cell, cells);
        first.max(0)..=(first + i64::from(self.degree)).min(cells)
    }

    /// The first coefficient of a cell's polynomial, counted as a node: it may lie beyond a wall.
    fn first(self, cell: i64, cells: i64) -> i64 {
        let first = cell - i64::from(self.degree / 2);
        let last = cells - i64::from(self.degree);
        if self.curves(cells) { first.clamp(0, last) } else { first }
    }

    fn curves(self, cells: i64) -> bool {
        self.curves_at_walls && cells >= ROOM && self.degree > 1
    }

    /// The node `node`, along an axis of `cells` cells, as the polynomial of `cell` continues there: other nodes and weights.
    fn follow(self, cell: i64, cells: i64, node: i64) -> Vec<(i64, f64)> {
        if self.window(cell, cells).contains(&node) {
            return vec![(node, 1.0)];
        }
        let coefficient = |at: i64| self.coefficient(cell, cells, at);
        let scaled =
            |factor: f64, list: Vec<(i64, f64)>| list.into_iter().map(move |(node, weight)| (node, factor * weight));
        if self.curves(cells) && (node == 0 || node == cells) {
            // The unknown of a wall's node is the value.
            let inwards = if node == 0 { 1 } else { -1 };
            let value = if self.degree == 2 { &VALUE_QUADRATIC[..] } else { &VALUE_CUBIC[..] };
            return value
                .iter()
                .zip(0..)
                .flat_map(|(&weight, k)| scaled(weight, coefficient(node + k * inwards)))
                .collect();
        }
        coefficient(node)
    }

    /// The coefficient `at` of the polynomial of a cell, by Lagrange's formula from those of its window:
    /// e_jk = Π_{l≠k} (j − l)/(k − l).
    fn coefficient(self, cell: i64, cells: i64, at: i64) -> Vec<(i64, f64)> {
        let (first, by) = (self.first(cell, cells), i64::from(self.extension.min(self.degree)));
        let last = first + i64::from(self.degree);
        // Those nearest to it.
        let window = if at < first { first..=first + by } else { last - by..=last };
        let mut list = Vec::new();
        for k in window.clone() {
            let others = window.clone().filter(|&l| l != k);
            let weight: f64 = others.map(|l| (at - l) as f64 / (k - l) as f64).product();
            list.extend(self.unknowns(k, cells).into_iter().map(|(node, factor)| (node, factor * weight)));
        }
        list
    }

    /// A coefficient in terms of unknowns: beyond a wall u₋ₖ = 2u₀ − uₖ; where functions curve, u₀ is the value at the wall.
    fn unknowns(self, k: i64, cells: i64) -> Vec<(i64, f64)> {
        if self.curves(cells) {
            let own = if self.degree == 2 { &COEFFICIENT_QUADRATIC[..] } else { &COEFFICIENT_CUBIC[..] };
            return match k {
                0 => own.iter().zip(0..).map(|(&weight, node)| (node, weight)).collect(),
                _ if k == cells => own.iter().zip(0..).map(|(&weight, node)| (cells - node, weight)).collect(),
                _ => vec![(k, 1.0)],
            };
        }
        match k {
            _ if k < 0 => vec![(0, 2.0), (-k, -1.0)],
            _ if k > cells => vec![(cells, 2.0), (2 * cells - k, -1.0)],
            _ => vec![(k, 1.0)],
        }
    }
}

/// The value at a wall from the coefficients c₀, c₁, … of the polynomial there, and c₀ from the value u₀ and c₁, ….
/// Quadratic: u₀ = (c₋₁ + 6c₀ + c₁)/8 with c₋₁ = 3c₀ − 3c₁ + c₂. Cubic: u₀ = (c₋₁ + 4c₀ + c₁)/6 with c₋₁ = 4c₀ − 6c₁ + 4c₂ − c₃.
const VALUE_QUADRATIC: [f64; 3] = [9.0 / 8.0, -2.0 / 8.0, 1.0 / 8.0];
const VALUE_CUBIC: [f64; 4] = [8.0 / 6.0, -5.0 / 6.0, 4.0 / 6.0, -1.0 / 6.0];
const COEFFICIENT_QUADRATIC: [f64; 3] = [8.0 / 9.0, 2.0 / 9.0, -1.0 / 9.0];
const COEFFICIENT_CUBIC: [f64; 4] = [6.0 / 8.0, 5.0 / 8.0, -4.0 / 8.0, 1.0 / 8.0];

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

/// E of a field of vectors, of which some components are prescribed: those of an outer node do not follow.
#[derive(Clone, Debug, Default)]
pub struct Followers<const D: usize> {
    extension: Arc<Extension>,
    /// Which components of each outer node follow.
    follows: Vec<[bool; D]>,
}

impl<const D: usize> Followers<D> {
    /// Of an extension, but for the values `(node, component)` that are prescribed.
    ///
    /// ```
    /// use bfree::aggregation::{Extension, Followers, Occupied, Pieces};
    /// use bfree::tensor::Vector;
    ///
    /// let nodes: Vec<[u32; 3]> = (0..5).map(|i| [i, 0, 0]).collect();
    /// let cells = [1.0, 1.0, 1.0, 0.1].iter().zip(0..).map(|(&share, i)| ([i, 0, 0], share)).collect();
    /// let occupied = Occupied { dimension: 1, grid: [8, 0, 0], nodes: &nodes, cells };
    /// let followers = Followers::<1>::new(Extension::new(Pieces::LINEAR, &occupied).into(), [].into_iter());
    /// // u = E û continues a linear field; Eᵀ f keeps its resultant and its moment.
    /// let mut field: Vec<_> = [0.0, 1.0, 2.0, 3.0, 0.0].map(|x| Vector::from([x])).into();
    /// followers.extend(&mut field);
    /// assert_eq!(field[4][0], 4.0);
    /// let mut force: Vec<_> = [0.0, 0.0, 0.0, 0.0, 1.0].map(|x| Vector::from([x])).into();
    /// followers.restrict(&mut force);
    /// assert_eq!(force, [0.0, 0.0, -1.0, 2.0, 0.0].map(|x| Vector::from([x])));
    /// ```
    pub fn new(extension: Arc<Extension>, prescribed: impl Iterator<Item = (usize, usize)>) -> Self {
        let mut follows = vec![[true; D]; extension.len()];
        for (node, component) in prescribed {
            if let Ok(place) = extension.outer.binary_search(&(node as u32)) {
                follows[place][component] = false;
            }
        }
        Self { extension, follows }
    }

    /// Whether every node is an unknown.
    pub fn is_empty(&self) -> bool {
        self.extension.is_empty()
    }

    /// Every outer node, which of its components follow, and the inner nodes with their weights.
    pub fn rows(&self) -> impl Iterator<Item = (usize, [bool; D], impl Iterator<Item = (usize, f64)>)> {
        self.extension.rows().zip(&self.follows).map(|((outer, leaders), follows)| (outer, *follows, leaders))
    }

    /// The row of a node, if it is an outer one.
    pub(crate) fn row(&self, node: usize) -> Option<([bool; D], impl Iterator<Item = (usize, f64)>)> {
        let place = self.extension.outer.binary_search(&(node as u32)).ok()?;
        Some((self.follows[place], self.extension.leaders(place)))
    }

    /// u = E û, in place.
    pub fn extend<T: Real>(&self, field: &mut [Vector<T, D>]) {
        for (outer, follows, leaders) in self.rows() {
            let mut sum = Vector::<T, D>::zeros();
            leaders.for_each(|(leader, weight)| sum += field[leader] * T::lit(weight));
            (0..D).filter(|&i| follows[i]).for_each(|i| field[outer][i] = sum[i]);
        }
    }

    /// R̂ = Eᵀ R, in place: zero at components that follow.
    pub fn restrict<T: Real>(&self, forces: &mut [Vector<T, D>]) {
        self.restrict_with(forces, |weight| weight);
    }

    /// |E|ᵀ of magnitudes, in place.
    pub(crate) fn restrict_magnitudes<T: Real>(&self, magnitudes: &mut [Vector<T, D>]) {
        self.restrict_with(magnitudes, f64::abs);
    }

    fn restrict_with<T: Real>(&self, forces: &mut [Vector<T, D>], of: impl Fn(f64) -> f64) {
        for (outer, follows, leaders) in self.rows() {
            let mut moved = Vector::<T, D>::zeros();
            for i in (0..D).filter(|&i| follows[i]) {
                moved[i] = std::mem::replace(&mut forces[outer][i], T::zero());
            }
            leaders.for_each(|(leader, weight)| forces[leader] += moved * T::lit(of(weight)));
        }
    }
}

/// The occupied knot cells of all bodies.
struct Bodies {
    pieces: Pieces,
    grid: [i64; 3],
    dimension: usize,
    cells: Vec<([i64; 3], f64)>,
    places: HashMap<[i64; 3], usize>,
    /// The first cell of the connected piece that a cell belongs to.
    piece: Vec<usize>,
    /// The active nodes of each cell's functions; `None` where one of them is not active.
    windows: Vec<Option<Vec<u32>>>,
    numbers: HashMap<[i64; 3], u32>,
}

impl Bodies {
    fn new(pieces: Pieces, occupied: &Occupied<'_>) -> Self {
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
            cells,
            places,
            numbers,
        };
        bodies.windows = bodies.cells.iter().map(|(cell, _)| bodies.window(*cell)).collect();
        bodies.connect();
        bodies
    }

    /// The active nodes of a cell's functions, if all are active.
    fn window(&self, cell: [i64; 3]) -> Option<Vec<u32>> {
        let along = |k: usize| if k < self.dimension { self.pieces.window(cell[k], self.grid[k]) } else { 0..=0 };
        let all = along(2).flat_map(|z| along(1).flat_map(move |y| along(0).map(move |x| [x, y, z])));
        all.map(|node| self.numbers.get(&node).copied()).collect()
    }

    /// The occupied cells at most `reach` away along every axis, the cell itself among them.
    fn around(&self, cell: [i64; 3], reach: i64) -> impl Iterator<Item = usize> {
        let dimension = self.dimension;
        let range = move |k: usize| if k < dimension { -reach..=reach } else { 0..=0 };
        let all = range(2).flat_map(move |z| range(1).flat_map(move |y| range(0).map(move |x| [x, y, z])));
        all.filter_map(move |by| self.places.get(&[0, 1, 2].map(|k| cell[k] + by[k])).copied())
    }

    /// Joins neighbouring cells to pieces.
    fn connect(&mut self) {
        let mut seen = vec![false; self.cells.len()];
        for start in 0..self.cells.len() {
            let mut stack = if seen[start] { Vec::new() } else { vec![start] };
            seen[start] = true;
            while let Some(cell) = stack.pop() {
                self.piece[cell] = start;
                let beside: Vec<usize> = self.around(self.cells[cell].0, 1).filter(|&next| !seen[next]).collect();
                beside.iter().for_each(|&next| seen[next] = true);
                stack.extend(beside);
            }
        }
    }

    /// The good cells: those that are filled; then, as long as a cell has no good one beside it, the fullest of such cells.
    fn good(&self) -> Vec<usize> {
        let may = |cell: &usize| self.windows[*cell].is_some();
        let filled = |cell: &usize| self.cells[*cell].1 >= self.pieces.share * (1.0 - SAME);
        let mut good: Vec<usize> = (0..self.cells.len()).filter(|cell| may(cell) && filled(cell)).collect();
        let mut left: HashSet<usize> = (0..self.cells.len()).filter(may).collect();
        let mut new = good.clone();
        loop {
            new.iter().for_each(|&cell| self.around(self.cells[cell].0, 1).for_each(|beside| _ = left.remove(&beside)));
            let share = |cell: usize| self.cells[cell].1;
            let fullest = |&cell: &usize| {
                let mut beside = self.around(self.cells[cell].0, 1).filter(|beside| left.contains(beside));
                beside.all(|beside| share(cell) >= share(beside) * (1.0 - SAME))
            };
            new = left.iter().copied().filter(fullest).collect();
            if new.is_empty() {
                good.sort_unstable();
                return good;
            }
            good.extend(&new);
        }
    }

    /// The square of the distance from a node to the centre of a cell, in half spacings.
    fn distance(&self, node: [i64; 3], cell: usize) -> i64 {
        (0..self.dimension).map(|k| (2 * node[k] - self.pieces.centre(self.cells[cell].0[k])).pow(2)).sum()
    }

    /// The nearest good cells of the pieces whose cells are nearest to a node.
    fn nearest(&self, node: [u32; 3], good: &HashSet<usize>) -> Vec<usize> {
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
                // All cells whose centres are so near have been seen.
                if found.0 <= (2 * reach - 1).pow(2) {
                    break;
                }
            }
            found.1
        };
        let pieces: HashSet<usize> = nearest(&|_| true).into_iter().map(|cell| self.piece[cell]).collect();
        let mut cells = nearest(&|cell| good.contains(&cell) && pieces.contains(&self.piece[cell]));
        cells.sort_unstable();
        cells
    }

    /// The mean of what the polynomials of `cells` are at a node.
    fn row(&self, node: [u32; 3], cells: &[usize]) -> BTreeMap<u32, f64> {
        let mut row = BTreeMap::new();
        for &cell in cells {
            let along = |k: usize| match k < self.dimension {
                true => self.pieces.follow(self.cells[cell].0[k], self.grid[k], i64::from(node[k])),
                false => vec![(0, 1.0)],
            };
            let [x, y, z] = [along(0), along(1), along(2)];
            for &(k, of_z) in &z {
                for &(j, of_y) in &y {
                    for &(i, of_x) in &x {
                        if let Some(&number) = self.numbers.get(&[i, j, k]) {
                            *row.entry(number).or_insert(0.0) += of_x * of_y * of_z / cells.len() as f64;
                        }
                    }
                }
            }
        }
        row
    }
}
