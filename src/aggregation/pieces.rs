//! The polynomial pieces of shape functions, and the continuation of one cell's polynomial beyond that cell.

/// The fewest cells of an axis on which functions may curve at both ends.
const ROOM: i64 = 4;

/// The polynomial pieces of shape functions along an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pieces {
    /// The degree p, 1 to 3; 1 for functions that are not polynomials.
    pub degree: u32,
    /// The degree with which outer nodes continue the polynomial of a cell: p if the particles are quadrature points, else 1. For other
    /// particles a higher degree would increase the errors of sums over particles.
    pub extension: u32,
    /// Whether functions may curve next to a wall of the grid ([`NotAKnotBspline`](crate::approximation::NotAKnotBspline)). If so, the
    /// unknown of a wall node is the value there. If not, coefficients beyond a wall continue linearly.
    pub curves_at_walls: bool,
    /// θ: a knot cell is good if a body fills at least this fraction of the cell; no unit.
    pub share: f64,
}

impl Pieces {
    /// The pieces of linear functions, also used for functions that are not polynomials.
    pub const LINEAR: Self = Self { degree: 1, extension: 1, curves_at_walls: false, share: 0.5 };

    /// Whether knots lie in the middle of grid cells, so that a knot cell is centred on a node.
    fn is_even(self) -> bool {
        self.degree.is_multiple_of(2)
    }

    /// The knot cell at `local` spacings from the first node of an axis of `cells` cells.
    pub(crate) fn cell(self, local: f64, cells: u32) -> u32 {
        if self.is_even() { (local + 0.5) as u32 } else { (local as u32).min(cells.saturating_sub(1)) }
    }

    /// The knot cells that an interval along an axis overlaps, each with the fraction of the interval in that cell. `middle` and `length`
    /// are in spacings, and `middle` counts from the first node.
    pub(crate) fn overlaps(self, middle: f64, length: f64, cells: u32) -> Vec<(u32, f64)> {
        let (from, to) = ((middle - 0.5 * length).max(0.0), (middle + 0.5 * length).min(f64::from(cells)));
        if from >= to {
            return vec![(self.cell(middle, cells), 1.0)];
        }
        let begin = |cell: u32| f64::from(cell) - if self.is_even() { 0.5 } else { 0.0 };
        let part = |cell: u32| (to.min(begin(cell + 1)) - from.max(begin(cell))).max(0.0) / (to - from);
        (self.cell(from, cells)..=self.cell(to, cells)).map(|cell| (cell, part(cell))).collect()
    }

    /// The fraction of a knot cell inside the grid, along an axis: a wall halves a knot cell of even degree.
    pub(crate) fn within(self, cell: u32, cells: u32) -> f64 {
        if self.is_even() && (cell == 0 || cell == cells) { 0.5 } else { 1.0 }
    }

    /// The centre of a cell, in half spacings.
    pub(super) fn centre(self, cell: i64) -> i64 {
        if self.is_even() { 2 * cell } else { 2 * cell + 1 }
    }

    /// The nodes of a cell's functions along an axis of `cells` cells.
    pub(super) fn window(self, cell: i64, cells: i64) -> std::ops::RangeInclusive<i64> {
        let first = self.first(cell, cells);
        first.max(0)..=(first + i64::from(self.degree)).min(cells)
    }

    /// The first coefficient of a cell's polynomial, as a node index; the index may lie beyond a wall.
    fn first(self, cell: i64, cells: i64) -> i64 {
        let first = cell - i64::from(self.degree / 2);
        let last = cells - i64::from(self.degree);
        if self.curves(cells) { first.clamp(0, last) } else { first }
    }

    fn curves(self, cells: i64) -> bool {
        self.curves_at_walls && cells >= ROOM && self.degree > 1
    }

    /// The unknown of `node` from the continued polynomial of `cell`, as nodes and weights. The axis has `cells` cells.
    pub(super) fn follow(self, cell: i64, cells: i64, node: i64) -> Vec<(i64, f64)> {
        if self.window(cell, cells).contains(&node) {
            return vec![(node, 1.0)];
        }
        if self.curves(cells) && (node == 0 || node == cells) {
            // The unknown of a wall node is the value there, not the coefficient.
            let value = if self.degree == 2 { &VALUE_QUADRATIC[..] } else { &VALUE_CUBIC[..] };
            let terms = inwards(node, value).map(|(at, weight)| (self.coefficient(cell, cells, at), weight));
            return terms.flat_map(|(list, weight)| scaled(list, weight)).collect();
        }
        self.coefficient(cell, cells, node)
    }

    /// The coefficient `at` = j of a cell's polynomial, by Lagrange's formula from the coefficients k in the window of the cell:
    /// e_jk = Π_{l≠k} (j − l)/(k − l).
    fn coefficient(self, cell: i64, cells: i64, at: i64) -> Vec<(i64, f64)> {
        let (first, by) = (self.first(cell, cells), i64::from(self.extension.min(self.degree)));
        let last = first + i64::from(self.degree);
        // The window coefficients nearest to `at`.
        let window = if at < first { first..=first + by } else { last - by..=last };
        let mut list = Vec::new();
        for k in window.clone() {
            let others = window.clone().filter(|&l| l != k);
            let weight: f64 = others.map(|l| (at - l) as f64 / (k - l) as f64).product();
            mutant!("unknowns: outer nodes follow by nine tenths": weight = 0.9 * weight);
            list.extend(scaled(self.unknowns(k, cells), weight));
        }
        list
    }

    /// The coefficient `k` in terms of unknowns. Beyond a wall u₋ₖ = 2u₀ − uₖ. Where functions curve, u₀ is the value at the wall.
    fn unknowns(self, k: i64, cells: i64) -> Vec<(i64, f64)> {
        let wall = k.clamp(0, cells);
        if self.curves(cells) && (k == 0 || k == cells) {
            let own = if self.degree == 2 { &COEFFICIENT_QUADRATIC[..] } else { &COEFFICIENT_CUBIC[..] };
            inwards(k, own).collect()
        } else if k == wall {
            vec![(k, 1.0)]
        } else {
            vec![(wall, 2.0), (2 * wall - k, -1.0)]
        }
    }
}

/// The nodes from a wall inwards, with these weights.
fn inwards(wall: i64, weights: &[f64]) -> impl Iterator<Item = (i64, f64)> {
    let step = if wall == 0 { 1 } else { -1 };
    weights.iter().zip(0..).map(move |(&weight, k)| (wall + k * step, weight))
}

fn scaled(list: Vec<(i64, f64)>, factor: f64) -> impl Iterator<Item = (i64, f64)> {
    list.into_iter().map(move |(node, weight)| (node, factor * weight))
}

/// The weights of c₀, c₁, … that give the value u₀ at a wall (`VALUE_…`), and the weights of u₀, c₁, … that give c₀
/// (`COEFFICIENT_…`). The c are the coefficients of the polynomial at the wall.
/// Quadratic: u₀ = (c₋₁ + 6c₀ + c₁)/8 with c₋₁ = 3c₀ − 3c₁ + c₂. Cubic: u₀ = (c₋₁ + 4c₀ + c₁)/6 with c₋₁ = 4c₀ − 6c₁ + 4c₂ − c₃.
const VALUE_QUADRATIC: [f64; 3] = [9.0 / 8.0, -2.0 / 8.0, 1.0 / 8.0];
const VALUE_CUBIC: [f64; 4] = [8.0 / 6.0, -5.0 / 6.0, 4.0 / 6.0, -1.0 / 6.0];
const COEFFICIENT_QUADRATIC: [f64; 3] = [8.0 / 9.0, 2.0 / 9.0, -1.0 / 9.0];
const COEFFICIENT_CUBIC: [f64; 4] = [6.0 / 8.0, 5.0 / 8.0, -4.0 / 8.0, 1.0 / 8.0];
