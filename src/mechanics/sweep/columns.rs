//! The shape functions N(x) and dN/dx along one axis for the particles of a group, a lane each.
//!
//! Away from walls the formulas of the shipped families are evaluated in vector lanes. Near a wall, and for any other family, the list
//! of nodes and functions ([`AxisWeights`]) is evaluated for each particle.

use super::order::Key;
use super::points::Points;
use crate::approximation::{
    self, ApproximationError, AtSurface, AxisWeights, FURTHEST, InCells, InLanes, Place, Rows, SETTLED, Separable,
};
use crate::grid::Axis;
use crate::lanes::{LANES, Lanes, WithLanes, widest};
use std::collections::BTreeMap;
use std::ops::Range;

/// A family of product shape functions.
#[derive(Clone, Copy)]
pub(super) struct Family<'a> {
    product: &'a dyn Separable,
    /// The family at points on a loaded surface.
    at_surface: &'a dyn Separable,
    /// The same functions in vector lanes, if the family has them.
    in_lanes: Option<&'a dyn InLanes>,
}

/// The particles of a block along one axis.
#[derive(Default)]
pub(super) struct Along {
    /// Their coordinates.
    pub(super) x: Vec<f64>,
    /// First node and end of the nodes of each particle.
    pub(super) spans: Vec<[u32; 2]>,
    cells: Vec<u32>,
    below: Vec<f64>,
    above: Vec<f64>,
    /// Whether a wall cuts off some of the particle's nodes.
    cut: Vec<bool>,
    /// The distance by which functions are continued linearly, of points on a loaded surface, by their index in the block.
    extrapolation: BTreeMap<usize, f64>,
    list: AxisWeights,
}

impl Along {
    /// Takes from `points` the distances by which the functions of the particles `keys` are continued along axis `k`.
    pub(super) fn set_extrapolation<const D: usize>(&mut self, k: usize, keys: &[Key], points: &Points<'_, D>) {
        self.extrapolation.clear();
        if !points.extrapolation.is_empty() {
            let of = |(i, key): (usize, &Key)| Some((i, points.extrapolation.get(&key.particle)?[k]));
            self.extrapolation.extend(keys.iter().enumerate().filter_map(of));
        }
    }
}

impl<'a> Family<'a> {
    pub(super) fn new(product: &'a dyn Separable) -> Self {
        let at_surface = if let AtSurface::Other(other) = product.at_surface() { other } else { product };
        let in_lanes = product.in_lanes().filter(|functions| functions.radius() <= FURTHEST as f64 + 1.0);
        Self { product, at_surface, in_lanes }
    }

    /// Finds the nodes of the particles at `along.x`, which lie on the axis.
    ///
    /// # Errors
    /// The error of the first particle whose functions cannot be evaluated.
    pub(super) fn spans(&self, axis: &Axis, along: &mut Along) -> Result<(), ApproximationError> {
        approximation::check(axis)?;
        if let Some(functions) = self.in_lanes {
            widest(Places { axis, radius: functions.radius(), edge: functions.edge(), along });
        } else {
            along.spans.clear();
            for &x in &along.x {
                approximation::list(self.product, axis, x, &mut along.list)?;
                along.spans.push(span(&along.list));
            }
        }
        for &i in along.extrapolation.keys() {
            approximation::list(self.at_surface, axis, along.x[i], &mut along.list)?;
            along.spans[i] = span(&along.list);
        }
        Ok(())
    }

    /// Evaluates the functions of the particles `range`, at most eight.
    ///
    /// # Errors
    /// The error of the first particle whose functions cannot be evaluated.
    pub(super) fn columns(
        &self,
        axis: &Axis,
        along: &mut Along,
        range: Range<usize>,
        out: &mut Columns,
    ) -> Result<(), ApproximationError> {
        let mut listed = [true; LANES];
        if let Some(functions) = self.in_lanes {
            let mut points = InCells { below: [0.5; LANES], above: [0.5; LANES], spacing: axis.spacing };
            for (lane, i) in range.clone().enumerate().take(LANES) {
                (points.below[lane], points.above[lane]) = (along.below[i], along.above[i]);
            }
            let mut corrections = [0.0; LANES];
            let Columns { values, derivatives, smallest, .. } = out;
            let rows = Rows { values, derivatives, smallest, corrections: &mut corrections };
            let reach = functions.evaluate(&points, rows);
            for (lane, i) in range.clone().enumerate().take(LANES) {
                out.first[lane] = i64::from(along.cells[i]) - reach as i64;
                listed[lane] = along.cut[i] || corrections[lane].is_nan() || corrections[lane] > SETTLED;
                mutant!("sweep: functions beside a wall as if it were far": { listed[lane] = false; });
            }
        }
        for (lane, i) in range.clone().enumerate() {
            out.spans[lane] = along.spans[i];
            if let Some(by) = along.extrapolation.get(&i) {
                let list = &mut along.list;
                approximation::list(self.at_surface, axis, along.x[i], list)?;
                list.values.iter_mut().zip(&list.derivatives).for_each(|(n, dn)| *n += by * dn);
                out.take_list(lane, list);
            } else if listed[lane] {
                approximation::list(self.product, axis, along.x[i], &mut along.list)?;
                out.take_list(lane, &along.list);
            }
        }
        Ok(())
    }
}

/// First node and end of the nodes of a list.
fn span(list: &AxisWeights) -> [u32; 2] {
    [list.first, list.first + list.values.len() as u32]
}

/// Finds the cell of each particle, the place in the cell, and the first node and the end of its nodes.
struct Places<'a> {
    axis: &'a Axis,
    radius: f64,
    /// See [`InLanes::edge`].
    edge: f64,
    along: &'a mut Along,
}

impl WithLanes for Places<'_> {
    #[inline(always)]
    fn run<S: Lanes>(self, _: S) {
        let Self { axis, radius, edge, along } = self;
        let count = along.x.len();
        along.cells.resize(count, 0);
        along.below.resize(count, 0.0);
        along.above.resize(count, 0.0);
        along.spans.resize(count, [0; 2]);
        along.cut.resize(count, false);
        let last = f64::from(axis.cells);
        let places = along.cells.iter_mut().zip(&mut along.below).zip(&mut along.above);
        for (&x, ((cell, below), above)) in along.x.iter().zip(places) {
            let place = Place::at(axis, axis.spacings(x).min(last)).at_edge(edge, axis.round_off(x));
            (*cell, *below, *above) = (place.cell, place.below, place.above);
        }
        // Number of integers j ≥ 1 with j < R − d: nodes beyond the cell within the radius R.
        let reach = |distance: f64| (1..=FURTHEST).map(|j| u32::from((j as f64) < radius - distance)).sum::<u32>();
        let lists = along.spans.iter_mut().zip(&mut along.cut);
        for (((&cell, &below), &above), (span, cut)) in
            along.cells.iter().zip(&along.below).zip(&along.above).zip(lists)
        {
            let (lower, upper) = (reach(below), reach(above));
            *cut = (cell < lower) | (upper + 1 > axis.cells - cell);
            *span = [cell - lower.min(cell), cell + 1 + (upper + 1).min(axis.cells - cell)];
        }
    }
}

/// The largest number of nodes along an axis for which [`Columns`] have room.
pub(crate) const WIDEST: usize = 16;

/// The functions along one axis at up to eight coordinates, a lane each.
#[derive(Default)]
pub(super) struct Columns {
    /// N by rows. The i-th row belongs to the node `first + i` of each lane.
    values: [[f64; LANES]; WIDEST],
    /// dN/dx
    derivatives: [[f64; LANES]; WIDEST],
    first: [i64; LANES],
    /// First node and end of the nodes of each lane.
    pub(super) spans: [[u32; 2]; LANES],
    /// The smallest |N| of each lane.
    pub(super) smallest: [f64; LANES],
}

impl Columns {
    /// Puts a list into a lane.
    fn take_list(&mut self, lane: usize, list: &AxisWeights) {
        self.first[lane] = i64::from(list.first);
        self.spans[lane] = span(list);
        self.smallest[lane] = list.values.iter().fold(f64::INFINITY, |low, n| low.min(n.abs()));
        for row in 0..WIDEST {
            self.values[row][lane] = list.values.get(row).copied().unwrap_or(0.0);
            self.derivatives[row][lane] = list.derivatives.get(row).copied().unwrap_or(0.0);
        }
    }

    /// Writes N and dN/dx of the first `count` lanes to the rows of the nodes `low ..`. These rows hold zeros before.
    pub(super) fn write(&self, count: usize, low: u32, values: &mut [[f64; LANES]], derivatives: &mut [[f64; LANES]]) {
        // All lanes have the same nodes, as they do in one cell, so whole rows are copied.
        let skipped = usize::try_from(i64::from(low) - self.first[0]);
        if let Ok(skipped) = skipped
            && skipped + values.len() <= WIDEST
            && count == LANES
            && self.first.iter().all(|&first| first == self.first[0])
        {
            values.copy_from_slice(&self.values[skipped..skipped + values.len()]);
            derivatives.copy_from_slice(&self.derivatives[skipped..skipped + derivatives.len()]);
            return;
        }
        for lane in 0..count {
            let [first, end] = self.spans[lane];
            let rows = (i64::from(first) - self.first[lane]) as usize;
            for (i, node) in (first..end).enumerate() {
                let to = (node - low) as usize;
                values[to][lane] = self.values[rows + i][lane];
                derivatives[to][lane] = self.derivatives[rows + i][lane];
            }
        }
    }
}
