//! Solids of pixels (voxels in 3D), as pictures and scans have them: each pixel is a box that belongs to the solid or does not.

use super::{Face, Solid, axis};
use crate::tensor::Vector;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Of a pixel: it lies outside of the solid, or inside; of a group of them, whether one does.
const OUT: u8 = 1;
const IN: u8 = 2;

/// Planes of faces near a point that are named one by one, at most.
const PLANES: usize = 6;

/// Which pixels belong to a solid; in 2D they are one layer of voxels. It is shared, not copied.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask(Arc<Pyramid>);

/// Pixels, groups of 2ᴰ of them, groups of groups, up to one.
#[derive(Debug, PartialEq)]
struct Pyramid {
    levels: Vec<Level>,
    /// The first and the last pixel along each axis that belong to the solid.
    bounds: [[usize; 2]; 3],
}

#[derive(Debug, PartialEq)]
struct Level {
    count: [usize; 3],
    /// [`OUT`], [`IN`] or both, the first axis fastest.
    flags: Vec<u8>,
}

/// What is inside of pixels of a picture that covers a box.
#[derive(Clone, Debug, PartialEq)]
pub struct Pixels<const D: usize> {
    lower: Vector<f64, D>,
    /// Of one pixel.
    edges: Vector<f64, D>,
    mask: Mask,
}

impl Level {
    fn at(&self, [i, j, k]: [usize; 3]) -> u8 {
        let [n, m, _] = self.count;
        self.flags[i + n * (j + m * k)]
    }

    /// Groups of 2 × 2 × 2.
    fn coarser(&self) -> Self {
        let count = self.count.map(|n| n.div_ceil(2));
        let mut flags = vec![0; count.iter().product()];
        let mut fine = self.flags.iter();
        for k in 0..self.count[2] {
            for j in 0..self.count[1] {
                let row = count[0] * (j / 2 + count[1] * (k / 2));
                for (i, flag) in fine.by_ref().take(self.count[0]).enumerate() {
                    flags[row + i / 2] |= flag;
                }
            }
        }
        Self { count, flags }
    }
}

impl Mask {
    /// The mask of pixels for which `inside` is true, so many along each axis, the first axis fastest; `None` if no pixel is inside, or
    /// there are not as many as `count` says.
    pub fn new(count: [usize; 3], inside: impl Iterator<Item = bool>) -> Option<Self> {
        let flags: Vec<u8> = inside.map(|inside| if inside { IN } else { OUT }).collect();
        if Some(flags.len()) != count[0].checked_mul(count[1]).and_then(|n| n.checked_mul(count[2])) {
            return None;
        }
        let mut bounds = [[usize::MAX, 0]; 3];
        for (i, _) in flags.iter().enumerate().filter(|(_, flag)| **flag == IN) {
            let place = [i % count[0], i / count[0] % count[1], i / count[0] / count[1]];
            for (bounds, at) in bounds.iter_mut().zip(place) {
                *bounds = [bounds[0].min(at), bounds[1].max(at)];
            }
        }
        if bounds[0][0] > bounds[0][1] {
            return None;
        }
        let mut levels = vec![Level { count, flags }];
        while let Some(coarser) = levels.last().filter(|level| level.flags.len() > 1).map(Level::coarser) {
            levels.push(coarser);
        }
        Some(Self(Arc::new(Pyramid { levels, bounds })))
    }

    fn count(&self) -> [usize; 3] {
        self.0.levels[0].count
    }

    /// Whether a pixel belongs to the solid; none beyond the picture does.
    fn holds<const D: usize>(&self, pixel: &[i64; D]) -> bool {
        let mut place = [0; 3];
        for (k, (&at, place)) in pixel.iter().zip(&mut place).enumerate() {
            match usize::try_from(at) {
                Ok(at) if at < self.count()[k] => *place = at,
                _ => return false,
            }
        }
        self.0.levels[0].at(place) == IN
    }
}

impl<const D: usize> Pixels<D> {
    /// The solid of a mask that covers the box from `min` to `max`; `None` in 2D if it has more than one layer, and in 1D.
    ///
    /// ```
    /// use bfree::shape::{Mask, Pixels, Shape};
    /// use bfree::tensor::Vector;
    ///
    /// // An L of three squares.
    /// let mask = Mask::new([2, 2, 1], [true, true, true, false].into_iter()).ok_or("no pixel")?;
    /// let corner = Shape::from(Pixels::<2>::new(Vector::zeros(), Vector::from([2.0, 2.0]), mask).ok_or("plane")?);
    /// assert_eq!(corner.signed_distance(&Vector::from([1.5, 1.25])), 0.25);
    /// assert_eq!(corner.normal(&Vector::from([1.5, 0.75])), Vector::from([0.0, 1.0]));
    /// // What of a box lies in it.
    /// let (volume, centroid) = corner.part(&Vector::from([0.5, 0.5]), &Vector::from([1.0, 1.0]), 1.0);
    /// assert_eq!((volume, centroid), (0.75, Vector::from([2.75 / 3.0, 2.75 / 3.0])));
    /// # Ok::<(), &str>(())
    /// ```
    pub fn new(min: Vector<f64, D>, max: Vector<f64, D>, mask: Mask) -> Option<Self> {
        let count = mask.count();
        let fits = D == 3 || (D == 2 && count[2] == 1);
        let edges = Vector::from_fn(|k, _| (max[k] - min[k]) / count[k] as f64);
        fits.then_some(Self { lower: min, edges, mask })
    }

    /// Where pixel `i` along axis `k` begins.
    fn face(&self, k: usize, i: f64) -> f64 {
        self.lower[k] + i * self.edges[k]
    }

    /// The pixel along axis `k` that `x` lies in, the first one being 0; `as` saturates far away.
    fn pixel(&self, k: usize, x: f64) -> i64 {
        ((x - self.lower[k]) / self.edges[k]).floor().clamp(-2.0, self.mask.count()[k] as f64 + 1.0) as i64
    }

    /// What pixels along axis `k` have of the interval: their number, the length, and its middle.
    fn overlaps(&self, k: usize, from: f64, to: f64) -> Vec<(usize, f64, f64)> {
        let last = self.mask.count()[k] as i64 - 1;
        let pixels = self.pixel(k, from).max(0)..=self.pixel(k, to).min(last);
        let overlap = |i: i64| {
            let (from, to) = (from.max(self.face(k, i as f64)), to.min(self.face(k, (i + 1) as f64)));
            (to > from).then_some((i as usize, to - from, 0.5 * (from + to)))
        };
        pixels.filter_map(overlap).collect()
    }

    /// Looks in a group of pixels for the one nearest to `x` that is `wanted`, if it is nearer than what was found.
    fn search(&self, x: &Vector<f64, D>, wanted: u8, level: usize, group: [usize; 3], found: &mut Found<D>) {
        let here = &self.mask.0.levels[level];
        if here.at(group) & wanted == 0 {
            return;
        }
        let end = |k: usize| ((group[k] + 1) << level).min(self.mask.count()[k]) as f64;
        let begin = |k: usize| (group[k] << level) as f64;
        let foot = Vector::from_fn(|k, _| x[k].max(self.face(k, begin(k))).min(self.face(k, end(k))));
        let squared = (x - foot).norm_squared();
        if squared >= found.squared {
            return;
        }
        if level == 0 {
            let center = Vector::from_fn(|k, _| self.face(k, begin(k) + 0.5));
            *found = Found { squared, foot, center };
            return;
        }
        // The half that x is in, or nearer to, first.
        let (finer, mut near) = (self.mask.0.levels[level - 1].count, [0_usize; 3]);
        for k in 0..D {
            near[k] = usize::from(x[k] >= self.face(k, ((2 * group[k] + 1) << (level - 1)) as f64));
        }
        for other in 0..1_usize << D {
            let child: [usize; 3] = std::array::from_fn(|k| 2 * group[k] + (near[k] ^ ((other >> k) & 1)));
            if (0..3).all(|k| child[k] < finer[k]) {
                self.search(x, wanted, level - 1, child, found);
            }
        }
    }
}

/// The nearest pixel so far: how far, where, and its middle.
struct Found<const D: usize> {
    squared: f64,
    foot: Vector<f64, D>,
    center: Vector<f64, D>,
}

impl<const D: usize> Solid<D> for Pixels<D> {
    /// The nearest pixel of the other kind.
    fn nearest(&self, x: &Vector<f64, D>) -> Face<D> {
        let inside = self.mask.holds::<D>(&std::array::from_fn(|k| self.pixel(k, x[k])));
        let mut found = Found { squared: f64::INFINITY, foot: *x, center: *x };
        if inside {
            // Around the picture is nothing.
            for (k, sign) in (0..D).flat_map(|k| [(k, -1.0), (k, 1.0)]) {
                let mut foot = *x;
                foot[k] = self.face(k, if sign > 0.0 { self.mask.count()[k] as f64 } else { 0.0 });
                let squared = (x - foot).norm_squared();
                if squared < found.squared {
                    found = Found { squared, foot, center: foot + axis(k, 0.5 * sign * self.edges[k]) };
                }
            }
        }
        self.search(x, if inside { OUT } else { IN }, self.mask.0.levels.len() - 1, [0; 3], &mut found);
        let (distance, sign) = (found.squared.sqrt(), if inside { -1.0 } else { 1.0 });
        let away = (x - found.foot) * sign;
        if distance > 0.0 {
            return (sign * distance, away / distance);
        }
        // On a face: the direction is that in which the pixel beyond lies.
        let beyond = (x - found.center).component_div(&self.edges) * sign;
        let k = beyond.iamax();
        (sign * distance, axis(k, if beyond[k] < 0.0 { -1.0 } else { 1.0 }))
    }

    /// The planes of the faces that come so near; if they are too many, the box is to be halved.
    fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64 {
        let first: [i64; D] = std::array::from_fn(|k| self.pixel(k, x[k] - radius) - 1);
        let count: [u64; D] = std::array::from_fn(|k| (self.pixel(k, x[k] + radius) - first[k] + 1) as u64);
        let mut near = BTreeSet::new();
        for within in crate::grid::indices(count) {
            let pixel: [i64; D] = std::array::from_fn(|k| first[k] + within[k] as i64);
            let inside = self.mask.holds(&pixel);
            for k in 0..D {
                let mut next = pixel;
                next[k] += 1;
                if self.mask.holds(&next) == inside {
                    continue;
                }
                let foot = Vector::from_fn(|j, _| {
                    let begin = if j == k { next[j] } else { pixel[j] };
                    x[j].max(self.face(j, begin as f64)).min(self.face(j, (pixel[j] + 1) as f64))
                });
                if (x - foot).norm() < radius {
                    near.insert((k, next[k], inside));
                }
            }
            if near.len() > PLANES {
                return 2.0 * radius;
            }
        }
        planes.extend(near.into_iter().map(|(k, i, upwards)| {
            let sign = if upwards { 1.0 } else { -1.0 };
            (sign * (x[k] - self.face(k, i as f64)), axis(k, sign))
        }));
        0.0
    }

    fn reach(&self, n: &Vector<f64, D>) -> f64 {
        let along = |k: usize| {
            let [first, last] = self.mask.0.bounds[k];
            (n[k] * self.face(k, first as f64)).max(n[k] * self.face(k, (last + 1) as f64))
        };
        (0..D).map(along).sum()
    }

    /// Σ over pixels of what they and a box have in common.
    fn row(&self, lower: &Vector<f64, D>, edges: &Vector<f64, D>, count: usize) -> Option<Vec<(f64, Vector<f64, D>)>> {
        let mut across = [const { Vec::new() }; 2];
        for (k, overlaps) in (1..).zip(&mut across) {
            let layer = || vec![(0, 1.0, 0.0)];
            *overlaps = if k < D { self.overlaps(k, lower[k], lower[k] + edges[k]) } else { layer() };
        }
        let level = &self.mask.0.levels[0];
        let of_box = |number: usize| {
            let from = lower[0] + number as f64 * edges[0];
            let along = self.overlaps(0, from, from + edges[0]);
            let (mut volume, mut moment) = (0.0, [0.0; 3]);
            for &(k, dz, z) in &across[1] {
                for &(j, dy, y) in &across[0] {
                    for &(_, dx, x) in along.iter().filter(|(i, ..)| level.at([*i, j, k]) == IN) {
                        let part = dx * dy * dz;
                        volume += part;
                        moment.iter_mut().zip([x, y, z]).for_each(|(moment, x)| *moment += part * x);
                    }
                }
            }
            let centroid = if volume > 0.0 { Vector::from_fn(|k, _| moment[k] / volume) } else { *lower };
            (volume, centroid)
        };
        Some((0..count).map(of_box).collect())
    }
}
