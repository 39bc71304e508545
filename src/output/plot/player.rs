//! The snapshots of a run for `player.js`: one block of 16-bit numbers, and JSON with the place of every channel in the block.

use super::axes::extremes;
use super::colouring::words;
use super::neighbours::Neighbours;
use super::palette::VIRIDIS;
use crate::output::OutputError;
use crate::output::history::AXES;
use crate::output::snapshots::beside;
use crate::output::vtu::{Array, Background, Snapshot};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Largest number of values on a page: 20 MB, and 27 MB as base64.
const MOST: usize = 10_000_000;

/// Largest number of snapshots that are shown of a run with more than [`MOST`] values. The particles of the run are then sampled.
const MOST_SNAPSHOTS: usize = 100;

/// Code of a value that is not finite. Finite values have the codes 0 to 65534.
const NONE: u16 = u16::MAX;

/// The data of a page for the player.
pub(super) struct Played {
    /// Description of the numbers as JSON, which contains no `<` and so ends no element of the page.
    pub meta: String,
    /// The numbers, in base64.
    pub numbers: String,
    /// A note on data left out.
    pub note: Option<String>,
}

/// Number of channels of the first snapshot alone: positions, and distances of neighbours.
const RESTING: usize = 4;

/// One number per shown particle, in the first snapshot or in all snapshots.
struct Channel {
    field: String,
    /// Empty for a scalar.
    component: String,
    /// Values, snapshot by snapshot.
    values: Vec<f64>,
}

impl Channel {
    /// Smallest and largest finite value; 0 if there is none.
    fn range(&self) -> (f64, f64) {
        let (low, high) = extremes(self.values.iter().copied());
        if low <= high { (low, high) } else { (0.0, 0.0) }
    }
}

/// The snapshots of a run, or an even sample of them.
pub(super) struct Recording {
    pub(super) background: Background,
    times: Vec<f64>,
    /// The segments of obstacles in the plane at each time: both ends, in thousandths of a cell from the origin of the grid. `None` where the
    /// segments are those of the snapshot before.
    outlines: Vec<Option<Vec<i64>>>,
    /// The outlines of bodies at each time, in the same form. Empty if there are none.
    bodies: Vec<Option<Vec<i64>>>,
    /// Number of all snapshots, and of all particles.
    snapshots: usize,
    particles: usize,
    /// Number of shown particles.
    shown: usize,
    /// Lower and upper corner of a box around all particles in these snapshots.
    bounds: [[f64; 3]; 2],
    /// Positions and distances of neighbours in the first snapshot, displacements since then, and the written fields.
    channels: Vec<Channel>,
}

impl Recording {
    /// Reads the snapshots in `files`; `None` if there are no files.
    pub(super) fn read(files: &[PathBuf]) -> Result<Option<Self>, OutputError> {
        let Some(path) = files.first() else { return Ok(None) };
        let first = Snapshot::read(path)?;
        let particles = first.points.len();
        let numbers = 3 + coloured(&first).map(|array| array.components.len()).sum::<usize>();
        let too_many = files.len().saturating_mul(particles).saturating_mul(numbers) > MOST;
        let snapshots = if too_many { files.len().min(MOST_SNAPSHOTS) } else { files.len() };
        let ids = sample(particles, MOST / (numbers * snapshots));
        let mut recording = Self {
            background: first.background,
            times: Vec::new(),
            outlines: Vec::new(),
            bodies: Vec::new(),
            snapshots: files.len(),
            particles,
            shown: ids.len(),
            bounds: [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]],
            channels: channels(&first, &ids),
        };
        for k in 0..snapshots {
            // The first, the last, and evenly between them.
            recording.add(&first, &files[k * (files.len() - 1) / (snapshots - 1).max(1)], &ids)?;
        }
        Ok(Some(recording))
    }

    /// Adds the snapshot in the file `path` of a run that begins with `first`.
    fn add(&mut self, first: &Snapshot, path: &Path, ids: &[usize]) -> Result<(), OutputError> {
        let snapshot = Snapshot::read(path)?;
        let shape = |s: &Snapshot| s.arrays.iter().map(|a| (a.name.clone(), a.components.len())).collect::<Vec<_>>();
        if snapshot.points.len() != first.points.len() || shape(&snapshot) != shape(first) {
            return Err(OutputError::content(path, "has other particles or fields than the first snapshot of the run"));
        }
        self.times.push(snapshot.time);
        let obstacles = self.segments(beside(path, "obstacles"))?;
        add_changed(&mut self.outlines, obstacles);
        let bodies = self.segments(beside(path, "bodies"))?;
        add_changed(&mut self.bodies, bodies);
        for axis in 0..3 {
            let (low, high) = extremes(snapshot.points.iter().map(|point| point[axis]));
            self.bounds[0][axis] = self.bounds[0][axis].min(low);
            self.bounds[1][axis] = self.bounds[1][axis].max(high);
        }
        let moved = |axis: usize| ids.iter().map(|&p| snapshot.points[p][axis] - first.points[p][axis]).collect();
        let written = coloured(&snapshot).flat_map(|array| {
            let width = array.components.len();
            (0..width).map(move |component| ids.iter().map(|&p| array.values[p * width + component]).collect())
        });
        let added: Vec<Vec<f64>> = (0..3).map(moved).chain(written).collect();
        for (channel, values) in self.channels[RESTING..].iter_mut().zip(added) {
            channel.values.extend(values);
        }
        Ok(())
    }

    /// Both ends of all segments in a file, in thousandths of a cell from the origin of the grid. `None` without a file, and for triangles.
    fn segments(&self, file: Option<PathBuf>) -> Result<Option<Vec<i64>>, OutputError> {
        let Some(path) = file else { return Ok(None) };
        let segments = Snapshot::read(&path)?;
        let Background { origin, spacing, .. } = self.background;
        let in_plane = segments.points.iter().flat_map(|x| [x[0] - origin[0], x[1] - origin[1]]);
        let in_cells = in_plane.map(|x| (1000.0 * x / spacing).round() as i64);
        Ok((segments.corners == 2).then(|| in_cells.collect()))
    }

    /// Horizontal and vertical axis of the pictures.
    ///
    /// The direction of sight is the axis with the least motion: a ball that falls along y is not drawn on the x–z plane. If several axes
    /// have the least motion, up to a tenth, the last of them is taken.
    pub(super) fn plane(&self) -> [usize; 2] {
        if self.background.dimension < 3 {
            return [0, 1];
        }
        let largest = |channel: &Channel| channel.values.iter().fold(0.0, |most: f64, u| most.max(u.abs()));
        plane_of([0, 1, 2].map(|axis| largest(&self.channels[RESTING + axis])))
    }

    /// Lower and upper corner of a box around all particles at all times.
    pub(super) fn bounds(&self) -> [[f64; 3]; 2] {
        let [low, high] = self.bounds;
        // Possibly no particle has a finite position.
        if low[0] <= high[0] { [low, high] } else { [self.background.origin; 2] }
    }

    /// The data for `player.js`, with the axes of the picture.
    pub(super) fn page(&self) -> Played {
        let [right, up] = self.plane();
        let mut numbers: Vec<u8> = Vec::new();
        let mut list: Vec<Value> = Vec::new();
        for channel in &self.channels {
            let (low, high) = channel.range();
            let Channel { field, component, values } = channel;
            let is_constant = low == high && values.iter().all(|x| x.is_finite());
            // Start of the channel, counted in 16-bit numbers.
            let start = (!is_constant).then_some(numbers.len() / 2);
            if !is_constant {
                numbers.extend(values.iter().flat_map(|&x| quantized(x, low, high).to_le_bytes()));
            }
            list.push(json!({ "field": field, "component": component, "low": low, "high": high, "start": start }));
        }
        let Background { dimension, origin, spacing, cells } = self.background;
        let meta = json!({
            "dimension": dimension, "origin": origin, "cell": spacing, "cells": cells, "right": right, "up": up,
            "times": self.times, "snapshots": self.snapshots, "particles": self.particles, "shown": self.shown,
            "channels": list, "colours": VIRIDIS, "outlines": self.outlines, "bodies": self.bodies,
        });
        Played {
            meta: meta.to_string().replace('<', "\\u003c"),
            numbers: BASE64_STANDARD.encode(numbers),
            note: self.note(),
        }
    }

    /// A note on data left out to keep the page small.
    fn note(&self) -> Option<String> {
        let counts = [(self.shown, self.particles, "particles"), (self.times.len(), self.snapshots, "snapshots")];
        let parts = counts.into_iter().filter(|(shown, of, _)| shown < of);
        let parts: Vec<String> = parts.map(|(shown, of, what)| format!("{shown} of {of} {what}")).collect();
        let note = || format!("The page shows {}, evenly chosen; the files have all.", parts.join(" and "));
        (!parts.is_empty()).then(note)
    }
}

/// Adds segments to a list; `None` where they are those of the snapshot before.
fn add_changed(list: &mut Vec<Option<Vec<i64>>>, segments: Option<Vec<i64>>) {
    let before = list.iter().rev().flatten().next();
    let changed = segments.filter(|segments| Some(segments) != before);
    list.push(changed);
}

/// The plane on which a motion is best seen, with the largest displacements `motion` along the axes.
fn plane_of(motion: [f64; 3]) -> [usize; 2] {
    let least = 1.1 * motion.iter().fold(f64::INFINITY, |a, &b| a.min(b));
    match motion.map(|u| u <= least) {
        [_, _, true] => [0, 1],
        [_, true, _] => [0, 2],
        _ => [1, 2],
    }
}

/// The arrays that the player needs. Displacements follow from the positions.
fn coloured(snapshot: &Snapshot) -> impl Iterator<Item = &Array> {
    snapshot.arrays.iter().filter(|array| array.name != "displacement")
}

/// The channels of a run that begins with `first`. Positions and distances are filled, other channels are empty.
fn channels(first: &Snapshot, ids: &[usize]) -> Vec<Channel> {
    let channel =
        |field: &str, component: &str, values| Channel { field: words(field), component: component.to_owned(), values };
    let rest = AXES.iter().enumerate().map(|(axis, name)| {
        channel("position at the start", name, ids.iter().map(|&p| first.points[p][axis]).collect())
    });
    let distances = channel("distance of neighbours", "", Neighbours::new(first, ids).distances(ids));
    let displacement = AXES.iter().map(|name| channel("displacement", name, Vec::new()));
    let written =
        coloured(first).flat_map(|array| array.components.iter().map(|name| channel(&array.name, name, Vec::new())));
    rest.chain([distances]).chain(displacement).chain(written).collect()
}

/// About `most` of `count` ids; all ids if there are not more. Knuth's multiplicative hash (multiples of the golden ratio modulo 1) samples
/// evenly, whatever the order of the particles.
fn sample(count: usize, most: usize) -> Vec<usize> {
    let part = most as f64 / count.max(1) as f64;
    let kept = |id: &usize| f64::from((*id as u32).wrapping_mul(2_654_435_769)) < part * 2_f64.powi(32);
    (0..count).filter(|id| part >= 1.0 || kept(id)).collect()
}

/// `x` in steps of (high − low)/65534, or [`NONE`] if `x` is not finite.
fn quantized(x: f64, low: f64, high: f64) -> u16 {
    if x.is_finite() { ((x - low) / (high - low) * f64::from(NONE - 1)).round() as u16 } else { NONE }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_is_seen_from_the_side() {
        // a ball that falls along y, one along z, a bar drawn out along x; a beam along y that bends towards z; nothing moves
        let motions = [[0.1, 2.0, 0.1000001], [0.1, 0.1, 2.0], [1.0, 0.3, 0.3], [0.0, 1.0, 3.0], [0.0; 3]];
        assert_eq!(motions.map(plane_of), [[0, 1], [0, 2], [0, 1], [1, 2], [0, 1]]);
    }

    #[test]
    fn numbers_come_back_to_half_a_step_and_what_is_none_stays_none() {
        let (low, high) = (-3.0, 1e7);
        let back = |q: u16| low + f64::from(q) / 65534.0 * (high - low);
        for x in [low, -2.9, 0.0, 12.5, 9_999_999.0, high] {
            assert!((back(quantized(x, low, high)) - x).abs() <= 0.5001 * (high - low) / 65534.0, "{x}");
        }
        assert_eq!([f64::NAN, f64::INFINITY].map(|x| quantized(x, low, high)), [NONE; 2]);
    }

    #[test]
    fn a_sample_has_the_size_asked_for_and_no_gaps() {
        assert_eq!(sample(5, 7), [0, 1, 2, 3, 4]);
        let ids = sample(100_000, 15_384);
        assert!(ids.len().abs_diff(15_384) < 20, "{}", ids.len());
        // rows of any length are sampled evenly: no stripes
        for row in [7, 13, 40, 64] {
            let mut columns = vec![0; row];
            ids.iter().for_each(|id| columns[id % row] += 1);
            let mean = ids.len() / row;
            assert!(columns.iter().all(|n: &usize| n.abs_diff(mean) < mean / 4), "{row}: {columns:?}");
        }
    }
}
