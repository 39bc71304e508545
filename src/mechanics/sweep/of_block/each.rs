//! Gathers, asks a point function for q and σ, and scatters both.

use super::{Double, Point, by_dimension};
use crate::mechanics::sweep::kernel::{Both, Window, gather, load, scatter, store};
use crate::mechanics::sweep::lanes::{LANES, Lanes, Number, WithLanes};

/// Gathers, asks `point`, and scatters.
pub(in crate::mechanics::sweep) fn each(groups: &Double, nodal: &[f64], buffer: &mut [f64], point: &Point<'_>) {
    weighted(groups, nodal, buffer, point, false);
}

/// As [`each`], with |N| and |∇N| in the scatter.
pub(in crate::mechanics::sweep) fn magnitudes(groups: &Double, nodal: &[f64], buffer: &mut [f64], point: &Point<'_>) {
    weighted(groups, nodal, buffer, point, true);
}

fn weighted(groups: &Double, nodal: &[f64], buffer: &mut [f64], point: &Point<'_>, magnitude: bool) {
    by_dimension!(f64, groups, Each { groups, nodal, buffer, point, magnitude });
}

struct Each<'a, const D: usize> {
    groups: &'a Double,
    nodal: &'a [f64],
    buffer: &'a mut [f64],
    point: &'a Point<'a>,
    /// Whether the scatter is with |N| and |∇N|.
    magnitude: bool,
}

impl<const D: usize> WithLanes<f64, LANES> for Each<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes<LANES, X = f64>>(self, s: S) {
        let mut rows = [[0.0; LANES]; 12];
        let mut weights = Vec::new();
        for group in 0..self.groups.len() {
            let mut window = self.groups.window(group);
            store(s, &gather::<S, D, LANES, true>(s, &window, self.nodal), &mut rows);
            (self.point)(self.groups.particles(group), &mut rows);
            if self.magnitude {
                weights.clear();
                weights.extend(window.weights.iter().map(|row| row.map(f64::abs)));
                window = Window { weights: &weights, ..window };
            }
            scatter::<S, Both, D, LANES>(s, &window, &load(s, &rows), self.buffer);
        }
    }
}
