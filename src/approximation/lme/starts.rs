//! Where Newton starts inside a body of nodes: q = exp μ as a function of the place in the cell, tabulated once.
//!
//! Away from walls the root depends on nothing but the distance a from the lower node of the cell. A table does what the last
//! step's λ would do, for all particles alike and without being remembered: a step is the same whatever went before it.

use super::separable::Lme;
use crate::approximation::interior::FURTHEST;
use crate::approximation::product::Place;

/// Beyond this locality the table would leave the first-level cache; functions are nearly linear there.
const LARGEST_GAMMA: f64 = 10.0;

/// Wider functions, in spacings, have more nodes than vector lanes have room for, and cost more to sum than to start.
const LARGEST_RADIUS: f64 = FURTHEST as f64 + 1.0;

/// Intervals for each unit of γ̂. q varies like exp(γ̂(1 − 2a)): a cubic misses it by (2γ̂ δa)⁴/384, here 5e-10 at most. One
/// step of Newton's method from there is exact to rounding, and a second shows it, also where nodes come into reach within an interval.
const INTERVALS: f64 = 96.0;

/// q and dq/da at equally spaced a in 0 … 1.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Starts(Vec<[f64; 2]>);

impl Starts {
    /// The table of `lme`; `None` where functions reach no further than the cell or very far, or for a large γ̂.
    pub(super) fn new(lme: &Lme) -> Option<Self> {
        let narrow_enough = lme.radius() > 1.0 && lme.radius() <= LARGEST_RADIUS;
        if !(narrow_enough && lme.gamma() > 0.0 && lme.gamma() <= LARGEST_GAMMA) {
            return None;
        }
        let intervals = (INTERVALS * lme.gamma().max(1.0)).ceil();
        let at = |i: u32| {
            let below = f64::from(i) / intervals;
            lme.table_entry(&Place { cell: 0, below, above: 1.0 - below })
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
