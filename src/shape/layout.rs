//! Positions of particles in cells that a solid fills.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The positions of particles in a whole cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// Particles in the middle of equal boxes.
    #[default]
    Regular,
    /// Particles at Gauss points, with Gauss weights, which integrate smooth stresses to a higher order. Each polynomial piece of the shape
    /// functions has its own Gauss rule. The pieces are cells. Quadratic B-splines are an exception: their pieces lie between the middles
    /// of cells, with half cells where the body ends. `fill` describes the points in cut cells. Gauss layout is for grids that are not
    /// reset: particles that move to other cells are no Gauss points there.
    Gauss,
}

/// Points along an axis and their weights, both in units of a cell.
pub(super) type Points = Vec<(f64, f64)>;

impl Layout {
    /// The points along an axis of a cell.
    pub(super) fn points(self, n: u32) -> Points {
        let n_f = f64::from(n);
        match self {
            Self::Regular => (0..n).map(|i| ((f64::from(i) + 0.5) / n_f, 1.0 / n_f)).collect(),
            Self::Gauss => (0..n).map(|i| gauss(n, i)).collect(),
        }
    }
}

/// The Gauss points in a cell for functions with knots in the middle of cells. Each piece leads from the middle of one cell to the middle
/// of the next. If the body does not go on (`goes_on`: below, above), the piece is half a cell.
pub(super) fn between_middles(n: u32, goes_on: [bool; 2]) -> Points {
    // The points from a node up to the middle. A point on the node is shared by two cells.
    let half = |goes_on: bool| -> Points {
        let whole = |i| if 2 * i + 1 == n { (0.0, 0.5 * gauss(n, i).1) } else { (gauss(n, i).0 - 0.5, gauss(n, i).1) };
        let part = |i| (0.5 * gauss(n, i).0, 0.5 * gauss(n, i).1);
        if goes_on { (n / 2..n).map(whole).collect() } else { (0..n).map(part).collect() }
    };
    let [lower, upper] = goes_on.map(half);
    lower.into_iter().chain(upper.into_iter().rev().map(|(x, weight)| (1.0 - x, weight))).collect()
}

/// Point i of the n-point Gauss rule on 0 … 1, and its weight. The point is a zero of Legendre's P_n, found by Newton's method, and
/// w = 1/((1 − x²) P_n′²) there.
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
