//! Starting values of Newton's method away from walls: q = exp μ as a function of the position in the cell, tabulated once.
//!
//! Away from walls the root depends only on the distance a from the lower node of the cell. The table replaces the λ of the last step as a
//! starting value, for all particles. No λ is stored, so a step does not depend on the steps before it.

use crate::approximation::interior::FURTHEST;
use crate::approximation::product::Place;

/// The largest γ̂ with a table. For larger γ̂ the table would leave the first-level cache, and the functions are nearly linear.
const LARGEST_GAMMA: f64 = 10.0;

/// The largest radius with a table, in spacings. Vector lanes have no room for the nodes of wider functions, and sums over these nodes cost
/// more than the start.
const LARGEST_RADIUS: f64 = FURTHEST as f64 + 1.0;

/// Intervals of the table per unit of γ̂. q varies like exp(γ̂(1 − 2a)). The error of a cubic is (2γ̂ δa)⁴/384, here at most 5e-10. One
/// Newton step from there is exact to round-off, and a second step confirms it. This also holds where nodes come into reach within an
/// interval.
const INTERVALS: f64 = 96.0;

/// q and dq/da at equally spaced a in 0 … 1.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Starts(Vec<[f64; 2]>);

impl Starts {
    /// The table of functions with this locality and radius. `root` gives q and dq/da at a place. `None` if functions reach only the nodes
    /// of the cell, if they reach very far, or if γ̂ is large.
    pub(super) fn new(gamma: f64, radius: f64, root: impl Fn(&Place) -> [f64; 2]) -> Option<Self> {
        let has_table = radius > 1.0 && radius <= LARGEST_RADIUS && gamma > 0.0 && gamma <= LARGEST_GAMMA;
        if !has_table {
            return None;
        }
        let intervals = (INTERVALS * gamma.max(1.0)).ceil();
        let at = |i: u32| {
            let below = f64::from(i) / intervals;
            root(&Place { cell: 0, below, above: 1.0 - below })
        };
        Some(Self((0..=intervals as u32).map(at).collect()))
    }

    /// q at the distance `below` from the lower node, by cubic Hermite interpolation.
    #[inline(always)]
    pub(super) fn at(&self, below: f64) -> f64 {
        let intervals = self.0.len() - 1;
        let (x, width) = (below * intervals as f64, (intervals as f64).recip());
        let i = (x as usize).min(intervals - 1);
        let (t, [[q0, d0], [q1, d1]]) = (x - i as f64, [self.0[i], self.0[i + 1]]);
        let (d0, d1, rise) = (d0 * width, d1 * width, q1 - q0);
        q0 + t * (d0 + t * (3.0 * rise - 2.0 * d0 - d1 + t * (d0 + d1 - 2.0 * rise)))
    }
}
