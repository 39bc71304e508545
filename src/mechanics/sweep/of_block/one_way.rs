//! Gathers without a scatter, and a scatter without a gather.

use super::{Double, Point, by_dimension};
use crate::mechanics::sweep::kernel::{Gathered, OnlyValue, Rows, gather, load, scatter, store};
use crate::mechanics::sweep::lanes::{LANES, Lanes, Number, WithLanes};

/// u and L of every group.
pub(in crate::mechanics::sweep) fn gather_all(groups: &Double, nodal: &[f64], rows: &mut [Rows]) {
    by_dimension!(f64, groups, GatherAll { groups, nodal, rows });
}

/// u of every group, in the first rows of each.
pub(in crate::mechanics::sweep) fn gather_values(groups: &Double, nodal: &[f64], rows: &mut [Rows]) {
    by_dimension!(f64, groups, GatherValues { groups, nodal, rows });
}

/// Scatters q alone; nothing is gathered.
pub(in crate::mechanics::sweep) fn spread(groups: &Double, buffer: &mut [f64], point: &Point<'_>) {
    by_dimension!(f64, groups, Spread { groups, buffer, point });
}

struct GatherAll<'a, const D: usize> {
    groups: &'a Double,
    nodal: &'a [f64],
    rows: &'a mut [Rows],
}

impl<const D: usize> WithLanes<f64, LANES> for GatherAll<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes<LANES, X = f64>>(self, s: S) {
        for (group, rows) in self.rows.iter_mut().enumerate() {
            store(s, &gather::<S, D, LANES, true>(s, &self.groups.window(group), self.nodal), rows);
        }
    }
}

struct GatherValues<'a, const D: usize> {
    groups: &'a Double,
    nodal: &'a [f64],
    rows: &'a mut [Rows],
}

impl<const D: usize> WithLanes<f64, LANES> for GatherValues<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes<LANES, X = f64>>(self, s: S) {
        for (group, rows) in self.rows.iter_mut().enumerate() {
            // L is not stored, and so not computed.
            let Gathered { value, .. } = gather::<S, D, LANES, true>(s, &self.groups.window(group), self.nodal);
            for (value, row) in value.into_iter().zip(rows) {
                s.store(value, row);
            }
        }
    }
}

struct Spread<'a, const D: usize> {
    groups: &'a Double,
    buffer: &'a mut [f64],
    point: &'a Point<'a>,
}

impl<const D: usize> WithLanes<f64, LANES> for Spread<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes<LANES, X = f64>>(self, s: S) {
        let mut rows = [[0.0; LANES]; 12];
        for group in 0..self.groups.len() {
            (self.point)(self.groups.particles(group), &mut rows);
            scatter::<S, OnlyValue, D, LANES>(s, &self.groups.window(group), &load(s, &rows), self.buffer);
        }
    }
}
