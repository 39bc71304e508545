//! Where particles are in cells that a solid fills.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where particles are in a whole cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// In the middle of equal boxes.
    #[default]
    Regular,
    /// At the points of Gauss's rule, with its weights: smooth stresses are integrated to a higher order. The rule is that of the pieces of
    /// the shape functions: of cells, and for quadratic B-splines, which are polynomials between the middles of cells, of those pieces,
    /// and of half cells where the body ends. Of cells that the surface cuts `fill` tells. For grids that are kept: particles that move to
    /// other cells are no Gauss points there.
    Gauss,
}

/// Points along an axis and their weights, both in cells.
pub(super) type Points = Vec<(f64, f64)>;

impl Layout {
    /// The points of a cell.
    pub(super) fn points(self, n: u32) -> Points {
        let n_f = f64::from(n);
        match self {
            Self::Regular => (0..n).map(|i| ((f64::from(i) + 0.5) / n_f, 1.0 / n_f)).collect(),
            Self::Gauss => (0..n).map(|i| gauss(n, i)).collect(),
        }
    }
}

/// Gauss's points of a cell of functions with kinks in the middle of cells: from the middle of the cell before to that of this one, and on
/// to that of the next; of half a cell where the body does not go on, below or above.
pub(super) fn between_middles(n: u32, goes_on: [bool; 2]) -> Points {
    // From a node up to the middle. A point on the node is shared.
    let half = |goes_on: bool| -> Points {
        let whole = |i| if 2 * i + 1 == n { (0.0, 0.5 * gauss(n, i).1) } else { (gauss(n, i).0 - 0.5, gauss(n, i).1) };
        let part = |i| (0.5 * gauss(n, i).0, 0.5 * gauss(n, i).1);
        if goes_on { (n / 2..n).map(whole).collect() } else { (0..n).map(part).collect() }
    };
    let [lower, upper] = goes_on.map(half);
    lower.into_iter().chain(upper.into_iter().rev().map(|(x, weight)| (1.0 - x, weight))).collect()
}

/// Point i of Gauss's rule of n on 0 … 1, and its weight: a zero of Legendre's P_n by Newton's method, w = 1/((1 − x²) P_n′²) there.
fn gauss(n: u32, i: u32) -> (f64, f64) {
    let n = f64::from(n);
    let mut x = -(std::f64::consts::PI * (f64::from(i) + 0.75) / (n + 0.5)).cos();
    let mut slope = 1.0;
    for _ in 0..10 {
        // (k + 1) P_{k+1} = (2k + 1) x P_k − k P_{k−1},   (x² − 1) P_n′ = n (x P_n − P_{n−1})
        let (mut before, mut value, mut k) = (0.0, 1.0, 0.0);
        while k < n {
            (before, value) = (value, ((2.0 * k + 1.0) * x * value - k * before) / (k + 1.0));
            k += 1.0;
        }
        slope = n * (x * value - before) / (x * x - 1.0);
        x -= value / slope;
    }
    (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
}
