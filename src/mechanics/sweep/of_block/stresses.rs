//! Gathers L, asks a point function for σ, and scatters it.

use super::{Double, Point, by_dimension};
use crate::mechanics::sweep::kernel::{OnlyGradient, gather, load, scatter, store};
use crate::mechanics::sweep::lanes::{LANES, Lanes, Number, WithLanes};

/// As [`super::each`], for point functions of L alone that give σ alone.
pub(in crate::mechanics::sweep) fn stresses(groups: &Double, nodal: &[f64], buffer: &mut [f64], point: &Point<'_>) {
    by_dimension!(f64, groups, Stresses { groups, nodal, buffer, point });
}

struct Stresses<'a, const D: usize> {
    groups: &'a Double,
    nodal: &'a [f64],
    buffer: &'a mut [f64],
    point: &'a Point<'a>,
}

impl<const D: usize> WithLanes<f64, LANES> for Stresses<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes<LANES, X = f64>>(self, s: S) {
        let mut rows = [[0.0; LANES]; 12];
        for group in 0..self.groups.len() {
            let window = self.groups.window(group);
            store(s, &gather::<S, D, LANES, false>(s, &window, self.nodal), &mut rows);
            (self.point)(self.groups.particles(group), &mut rows);
            scatter::<S, OnlyGradient, D, LANES>(s, &window, &load(s, &rows), self.buffer);
        }
    }
}
