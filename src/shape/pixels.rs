//! Solids of pixels (voxels in 3D), from pictures and scans. Each pixel is a box that belongs to the solid or does not.

use super::{Face, GridBox, Part, Solid, axis};
use crate::grid::indices;
use crate::tensor::Vector;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Flags of a pixel: outside or inside the solid. A group of pixels has the flags of all its pixels.
const OUT: u8 = 1;
const IN: u8 = 2;

/// The largest number of planes of faces near a point that are listed one by one.
const PLANES: usize = 6;

/// The pixels that belong to a solid; in 2D they are one layer of voxels. Clones share the pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    /// The pixels, groups of 2ᴰ pixels, groups of groups, up to a single group.
    levels: Arc<[Level]>,
    /// The first and the last pixel along each axis that belong to the solid.
    bounds: [[usize; 2]; 3],
}

#[derive(Debug, PartialEq)]
struct Level {
    count: [usize; 3],
    /// [`OUT`], [`IN`] or both, the first axis fastest.
    flags: Vec<u8>,
}

/// The inside pixels of a picture that covers a box.
#[derive(Clone, Debug, PartialEq)]
pub struct Pixels<const D: usize> {
    lower: Vector<f64, D>,
    /// The edges of one pixel.
    edges: Vector<f64, D>,
    mask: Mask,
}

impl Level {
    fn at(&self, [i, j, k]: [usize; 3]) -> u8 {
        let [n, m, _] = self.count;
        self.flags[i + n * (j + m * k)]
    }

    /// The next coarser level, with groups of 2 × 2 × 2.
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
    /// The mask of the pixels for which `inside` is true, with `count` pixels along each axis, the first axis fastest. `None` if no pixel
    /// is inside, or if the number of pixels differs from `count`.
    pub fn new(count: [usize; 3], inside: impl Iterator<Item = bool>) -> Option<Self> {
        let flags: Vec<u8> = inside.map(|inside| if inside { IN } else { OUT }).collect();
        if Some(flags.len()) != count[0].checked_mul(count[1]).and_then(|n| n.checked_mul(count[2])) {
            return None;
        }
        let mut bounds = [[usize::MAX, 0]; 3];
        for (at, _) in indices(count.map(|n| n as u64)).zip(&flags).filter(|(_, flag)| **flag == IN) {
            bounds = [0, 1, 2].map(|k| [bounds[k][0].min(at[k] as usize), bounds[k][1].max(at[k] as usize)]);
        }
        if bounds[0][0] > bounds[0][1] {
            return None;
        }
        let coarser = |level: &Level| (level.flags.len() > 1).then(|| level.coarser());
        let levels = std::iter::successors(Some(Level { count, flags }), coarser).collect();
        Some(Self { levels, bounds })
    }

    fn count(&self) -> [usize; 3] {
        self.levels[0].count
    }

    /// Whether a pixel belongs to the solid; pixels beyond the picture do not.
    fn holds<const D: usize>(&self, pixel: &[i64; D]) -> bool {
        let count = self.count();
        let is_in_picture = (0..D).all(|k| (0..count[k] as i64).contains(&pixel[k]));
        let place = || std::array::from_fn(|k| pixel.get(k).map_or(0, |&at| at as usize));
        is_in_picture && self.levels[0].at(place()) == IN
    }
}

impl<const D: usize> Pixels<D> {
    /// The solid of a mask that covers the box from `min` to `max`. `None` in 1D, and in 2D if the mask has more than one layer.
    ///
    /// ```
    /// use bfree::shape::{GridBox, Mask, Pixels, Shape};
    /// use bfree::tensor::Vector;
    ///
    /// // An L of three squares.
    /// let mask = Mask::new([2, 2, 1], [true, true, true, false].into_iter()).ok_or("no pixel")?;
    /// let corner = Shape::from(Pixels::<2>::new(Vector::zeros(), Vector::from([2.0, 2.0]), mask).ok_or("plane")?);
    /// assert_eq!(corner.signed_distance(&Vector::from([1.5, 1.25])), 0.25);
    /// assert_eq!(corner.normal(&Vector::from([1.5, 0.75])), Vector::from([0.0, 1.0]));
    /// // The part of it in a box.
    /// let square = GridBox { lower: Vector::from([0.5, 0.5]), edges: Vector::from([1.0, 1.0]), spacing: 1.0 };
    /// let (volume, centroid) = corner.part(&square);
    /// assert_eq!((volume, centroid), (0.75, Vector::from([2.75 / 3.0, 2.75 / 3.0])));
    /// # Ok::<(), &str>(())
    /// ```
    pub fn new(min: Vector<f64, D>, max: Vector<f64, D>, mask: Mask) -> Option<Self> {
        let count = mask.count();
        let fits = D == 3 || (D == 2 && count[2] == 1);
        let edges = Vector::from_fn(|k, _| (max[k] - min[k]) / count[k] as f64);
        fits.then_some(Self { lower: min, edges, mask })
    }

    /// The coordinate at which pixel `i` along axis `k` begins.
    fn face(&self, k: usize, i: f64) -> f64 {
        self.lower[k] + i * self.edges[k]
    }

    /// The number along axis `k` of the pixel that contains `x`, from 0; numbers far outside are clamped.
    fn pixel(&self, k: usize, x: f64) -> i64 {
        ((x - self.lower[k]) / self.edges[k]).floor().clamp(-2.0, self.mask.count()[k] as f64 + 1.0) as i64
    }

    /// The overlaps of an interval with the pixels along axis `k`: the number of the pixel, and the length and the middle of the overlap.
    fn overlaps(&self, k: usize, from: f64, to: f64) -> Vec<(usize, f64, f64)> {
        let last = self.mask.count()[k] as i64 - 1;
        let pixels = self.pixel(k, from).max(0)..=self.pixel(k, to).min(last);
        let overlap = |i: i64| {
            let (from, to) = (from.max(self.face(k, i as f64)), to.min(self.face(k, (i + 1) as f64)));
            (to > from).then_some((i as usize, to - from, 0.5 * (from + to)))
        };
        pixels.filter_map(overlap).collect()
    }

    /// Searches a group for the `wanted` pixel nearest to `x`, and keeps that pixel if it is nearer than `found`.
    fn search(&self, x: &Vector<f64, D>, wanted: u8, level: usize, group: [usize; 3], found: &mut Found<D>) {
        let here = &self.mask.levels[level];
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
        // Search the half that contains x, or is nearer to x, first.
        let (finer, mut near) = (self.mask.levels[level - 1].count, [0_usize; 3]);
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

/// The nearest pixel so far: squared distance, nearest point and centre of the pixel.
struct Found<const D: usize> {
    squared: f64,
    foot: Vector<f64, D>,
    center: Vector<f64, D>,
}

impl<const D: usize> Solid<D> for Pixels<D> {
    /// The signed distance to the nearest pixel of the other kind: outside if `x` is inside, else inside.
    fn nearest(&self, x: &Vector<f64, D>) -> Face<D> {
        let inside = self.mask.holds::<D>(&std::array::from_fn(|k| self.pixel(k, x[k])));
        let mut found = Found { squared: f64::INFINITY, foot: *x, center: *x };
        if inside {
            // Everything around the picture is outside.
            let ends = |k: usize| [(k, 0.0, -1.0), (k, self.mask.count()[k] as f64, 1.0)];
            for (k, end, sign) in (0..D).flat_map(ends) {
                let mut foot = *x;
                foot[k] = self.face(k, end);
                let squared = (x - foot).norm_squared();
                if squared < found.squared {
                    found = Found { squared, foot, center: foot + axis(k, 0.5 * sign * self.edges[k]) };
                }
            }
        }
        self.search(x, if inside { OUT } else { IN }, self.mask.levels.len() - 1, [0; 3], &mut found);
        let (distance, sign) = (found.squared.sqrt(), if inside { -1.0 } else { 1.0 });
        let away = (x - found.foot) * sign;
        if distance > 0.0 {
            return (sign * distance, away / distance);
        }
        // `x` lies on a face: the normal follows the axis along which the pixel beyond lies.
        let beyond = (x - found.center).component_div(&self.edges) * sign;
        let k = beyond.iamax();
        (sign * distance, axis(k, if beyond[k] < 0.0 { -1.0 } else { 1.0 }))
    }

    /// The planes of the faces within `radius` of `x`. If there are too many, the large departure makes the caller halve the box.
    fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64 {
        let first: [i64; D] = std::array::from_fn(|k| self.pixel(k, x[k] - radius) - 1);
        let count: [u64; D] = std::array::from_fn(|k| (self.pixel(k, x[k] + radius) - first[k] + 1) as u64);
        let mut near = BTreeSet::new();
        for within in indices(count) {
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
            let [first, last] = self.mask.bounds[k];
            (n[k] * self.face(k, first as f64)).max(n[k] * self.face(k, (last + 1) as f64))
        };
        (0..D).map(along).sum()
    }

    /// Sums over the inside pixels: volume and first moment of the overlap of a pixel and a box.
    fn row(&self, first: &GridBox<D>, count: usize) -> Option<Vec<Part<D>>> {
        let GridBox { lower, edges, .. } = first;
        // A picture in 2D is one layer of voxels.
        let across = [1, 2].map(|k| match k < D {
            true => self.overlaps(k, lower[k], lower[k] + edges[k]),
            false => vec![(0, 1.0, 0.0)],
        });
        let level = &self.mask.levels[0];
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
