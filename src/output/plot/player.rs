//! The snapshots of a run for `player.js`: one block of 16-bit numbers, and JSON with the place of every channel in the block.

use super::colouring::words;
use super::error::PlotError;
use super::neighbours::Neighbours;
use super::palette::VIRIDIS;
use super::series::damaged;
use crate::output::vtu::{Array, Background, Snapshot, Values};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Largest number of values on a page: 20 MB, and 27 MB as base64.
const MOST: usize = 10_000_000;

/// Largest number of snapshots that are shown of a run with more than [`MOST`] values. The particles of the run are then sampled.
const MOST_SNAPSHOTS: usize = 100;

/// Code of a value that is not finite. Finite values have the codes 0 to 65534.
const NONE: u16 = u16::MAX;

/// Axis names of components.
const AXES: [&str; 3] = ["x", "y", "z"];

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
        let finite = self.values.iter().filter(|x| x.is_finite());
        let range = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)));
        if range.0 <= range.1 { range } else { (0.0, 0.0) }
    }

    /// Whether all values are finite and equal.
    fn is_constant(&self) -> bool {
        let (low, high) = self.range();
        low == high && self.values.iter().all(|x| x.is_finite())
    }
}

/// The snapshots of a run, or an even sample of them.
pub(super) struct Recording {
    background: Background,
    times: Vec<f64>,
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
    pub(super) fn read(files: &[PathBuf]) -> Result<Option<Self>, PlotError> {
        let Some(path) = files.first() else { return Ok(None) };
        let first = Snapshot::read(path)?;
        let particles = first.points.len();
        let numbers =
            3 + first.arrays.iter().filter(|array| is_coloured(array)).map(|a| a.components.len()).sum::<usize>();
        let too_many = files.len().saturating_mul(particles).saturating_mul(numbers) > MOST;
        let snapshots = if too_many { files.len().min(MOST_SNAPSHOTS) } else { files.len() };
        let ids = sample(particles, MOST / (numbers * snapshots));
        let mut recording = Self {
            background: first.background,
            times: Vec::new(),
            snapshots: files.len(),
            particles,
            shown: ids.len(),
            bounds: [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]],
            channels: channels(&first, &ids),
        };
        for k in 0..snapshots {
            // The first, the last, and evenly between them.
            let path = &files[k * (files.len() - 1) / (snapshots - 1).max(1)];
            let snapshot = Snapshot::read(path)?;
            let shape =
                |s: &Snapshot| s.arrays.iter().map(|a| (a.name.clone(), a.components.len())).collect::<Vec<_>>();
            if snapshot.points.len() != particles || shape(&snapshot) != shape(&first) {
                return Err(damaged(path, "it has other particles or fields than the first"));
            }
            recording.times.push(snapshot.time);
            for (axis, x) in
                snapshot.points.iter().flat_map(|point| point.iter().enumerate()).filter(|(_, x)| x.is_finite())
            {
                recording.bounds[0][axis] = recording.bounds[0][axis].min(*x);
                recording.bounds[1][axis] = recording.bounds[1][axis].max(*x);
            }
            let (_, moving) = recording.channels.split_at_mut(RESTING);
            let (displacements, written) = moving.split_at_mut(3);
            for (axis, channel) in displacements.iter_mut().enumerate() {
                channel.values.extend(ids.iter().map(|&p| snapshot.points[p][axis] - first.points[p][axis]));
            }
            let mut written = written.iter_mut();
            for array in snapshot.arrays.iter().filter(|array| is_coloured(array)) {
                let width = array.components.len();
                for (component, channel) in (0..width).zip(written.by_ref()) {
                    channel.values.extend(ids.iter().map(|&p| number(array, p * width + component)));
                }
            }
        }
        Ok(Some(recording))
    }

    /// The largest displacement along each axis.
    pub(super) fn motion(&self) -> [f64; 3] {
        let largest = |channel: &Channel| channel.values.iter().fold(0.0, |most: f64, u| most.max(u.abs()));
        std::array::from_fn(|axis| self.channels.get(RESTING + axis).map_or(0.0, largest))
    }

    /// Lower and upper corner of a box around all particles at all times.
    pub(super) fn bounds(&self) -> [[f64; 3]; 2] {
        let [low, high] = self.bounds;
        // Possibly no particle has a finite position.
        if low[0] <= high[0] { [low, high] } else { [self.background.origin; 2] }
    }

    /// The data for `player.js`, with the axes of the picture.
    pub(super) fn page(&self, [right, up]: [usize; 2]) -> Played {
        let (mut numbers, mut list): (Vec<u8>, Vec<Value>) = (Vec::new(), Vec::new());
        for channel in &self.channels {
            let (low, high) = channel.range();
            // Start of the channel, counted in 16-bit numbers.
            let start = (!channel.is_constant()).then_some(numbers.len() / 2);
            if start.is_some() {
                numbers.extend(channel.values.iter().flat_map(|&x| quantized(x, low, high).to_le_bytes()));
            }
            let Channel { field, component, .. } = channel;
            list.push(json!({ "field": field, "component": component, "low": low, "high": high, "start": start }));
        }
        let Background { dimension, origin, spacing, cells } = self.background;
        let meta = json!({
            "dimension": dimension, "origin": origin, "cell": spacing, "cells": cells, "right": right, "up": up,
            "times": self.times, "snapshots": self.snapshots, "particles": self.particles, "shown": self.shown,
            "channels": list, "colours": VIRIDIS,
        });
        Played {
            meta: meta.to_string().replace('<', "\\u003c"),
            numbers: BASE64_STANDARD.encode(numbers),
            note: self.note(),
        }
    }

    /// A note on data left out to keep the page small.
    fn note(&self) -> Option<String> {
        let part = |shown: usize, of: usize, what: &str| (shown < of).then(|| format!("{shown} of {of} {what}"));
        let parts =
            [part(self.shown, self.particles, "particles"), part(self.times.len(), self.snapshots, "snapshots")];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        (!parts.is_empty())
            .then(|| format!("The page shows {}, evenly chosen; the files have all.", parts.join(" and ")))
    }
}

/// Whether the player needs the array. Displacements follow from the positions.
fn is_coloured(array: &Array) -> bool {
    array.name != "displacement"
}

fn number(array: &Array, place: usize) -> f64 {
    let found = match &array.values {
        Values::Float(values) => values.get(place).copied(),
        Values::Index(values) => values.get(place).map(|&x| f64::from(x)),
    };
    found.unwrap_or(f64::NAN)
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
    let coloured = first.arrays.iter().filter(|array| is_coloured(array));
    let written = coloured.flat_map(|array| array.components.iter().map(|name| channel(&array.name, name, Vec::new())));
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
