//! Few points with the moments of many: a body's in a box, by its pieces and the gaps between their planes and its surface.

use super::Seed;
use super::cut::{Extent, Piece};
use super::layout::{Layout, Points};
use crate::grid::indices;
use crate::solver::NonnegativeLeastSquares;
use crate::tensor::Vector;
use nalgebra::DVector;

/// What is left of moments by round-off, relative to the volume.
const ROUND_OFF: f64 = 1e-14;

/// What may be left of them.
const MET: f64 = 1e-10;

/// Points that are tried for each of the polynomials: more where fewer have not the moments.
const TRIED: [usize; 4] = [4, 16, 64, 256];

impl<const D: usize> Piece<D> {
    /// Gauss's points in it.
    fn points(&self, rules: &Rules) -> Vec<Seed<D>> {
        match &self.extent {
            Extent::Box(_) => self.in_box(&rules.of_box),
            Extent::Simplex(simplex) => in_simplex(&simplex[..=D], self.volume, &rules.of_simplex),
        }
    }

    /// The points of a rule along each axis of the box around it.
    pub(super) fn in_box(&self, along: &[(f64, f64)]) -> Vec<Seed<D>> {
        let [low, high] = self.bounds();
        let point = |i: [u64; D]| {
            let at = i.map(|i| along[i as usize]);
            let position = Vector::from_fn(|k, _| self.centroid[k] + (at[k].0 - 0.5) * (high[k] - low[k]));
            Seed { position, volume: at.iter().fold(self.volume, |volume, (_, weight)| volume * weight) }
        };
        indices([along.len() as u64; D]).map(point).collect()
    }

    /// Its place for each of a cube: equal volumes have equal volumes.
    fn place(&self, u: [f64; D]) -> Vector<f64, D> {
        match &self.extent {
            Extent::Box(edges) => Vector::from_fn(|k, _| self.centroid[k] + (u[k] - 0.5) * edges[k]),
            Extent::Simplex(simplex) => (0..D)
                .rev()
                .fold(simplex[D], |inner, k| simplex[k] + (inner - simplex[k]) * u[k].powf(((D - k) as f64).recip())),
        }
    }

    /// The box around it.
    fn bounds(&self) -> [Vector<f64, D>; 2] {
        match &self.extent {
            Extent::Box(edges) => [self.centroid - edges.abs() * 0.5, self.centroid + edges.abs() * 0.5],
            Extent::Simplex(simplex) => {
                [Vector::inf, Vector::sup].map(|bound: fn(&Vector<f64, D>, &Vector<f64, D>) -> _| {
                    simplex[1..=D].iter().fold(simplex[0], |all, corner| bound(&all, corner))
                })
            }
        }
    }
}

/// The box around some pieces.
fn bounds<const D: usize>(pieces: &[Piece<D>]) -> [Vector<f64, D>; 2] {
    let nothing: [Vector<f64, D>; 2] = [f64::INFINITY, f64::NEG_INFINITY].map(Vector::repeat);
    let around =
        |[low, high]: [Vector<f64, D>; 2], [lower, upper]: [Vector<f64, D>; 2]| [low.inf(&lower), high.sup(&upper)];
    pieces.iter().map(Piece::bounds).fold(nothing, around)
}

/// The box that these pieces fill, if they do: they do not overlap, so that they fill the box around them if they have its volume.
pub(super) fn whole_box<const D: usize>(pieces: &[Piece<D>]) -> Option<Piece<D>> {
    let [low, high] = bounds(pieces);
    let (edges, volume) = (high - low, pieces.iter().map(|piece| piece.volume).sum::<f64>());
    let fills = (edges.product() - volume).abs() <= MET * volume;
    fills.then(|| Piece { volume: edges.product(), centroid: (low + high) * 0.5, extent: Extent::Box(edges) })
}

/// Gauss's points along an axis of a piece, for products of polynomials of a degree.
struct Rules {
    of_box: Points,
    of_simplex: Points,
}

impl Rules {
    fn new<const D: usize>(degree: u32) -> Self {
        // In a simplex they are of degree D p together, and the map from a cube has D − 1 more along one axis.
        let [of_box, of_simplex] =
            [degree / 2 + 1, (D as u32 * (degree + 1)).div_ceil(2)].map(|n| Layout::Gauss.points(n));
        Self { of_box, of_simplex }
    }
}

/// Points of the simplex with d + 1 corners and this measure, those of a rule along each of d axes.
pub(super) fn in_simplex<const D: usize>(
    corners: &[Vector<f64, D>],
    measure: f64,
    along: &[(f64, f64)],
) -> Vec<Seed<D>> {
    let Some((last, others)) = corners.split_last() else { return Vec::new() };
    // x = x₀ + u₁ (x₁ − x₀ + u₂ (x₂ − x₁ + …)), of measure d! V Π u_k^(d−k)
    let start = vec![Seed { position: *last, volume: measure }];
    others.iter().rev().enumerate().fold(start, |inner, (before, corner)| {
        let mut all = Vec::with_capacity(inner.len() * along.len());
        for (u, weight) in along {
            let weight = weight * u.powi(before as i32) * (before + 1) as f64;
            all.extend(inner.iter().map(|point| Seed {
                position: corner + (point.position - corner) * *u,
                volume: point.volume * weight,
            }));
        }
        all
    })
}

/// Products of Legendre's polynomials on the box around some points.
pub(super) struct Legendre<const D: usize> {
    /// Its middle, and half of its edges.
    middle: Vector<f64, D>,
    half: Vector<f64, D>,
    degree: u32,
}

impl<const D: usize> Legendre<D> {
    pub(super) fn new(around: &[Piece<D>], degree: u32) -> Self {
        let [low, high] = bounds(around);
        Self { middle: (low + high) * 0.5, half: (high - low) * 0.5, degree }
    }

    pub(super) fn count(&self) -> usize {
        (self.degree as usize + 1).pow(D as u32)
    }

    /// What they are at a place.
    fn at(&self, x: &Vector<f64, D>, values: &mut DVector<f64>) {
        let values = values.as_mut_slice();
        values[0] = 1.0;
        let mut below = 1;
        for k in 0..D {
            let s = if self.half[k] > 0.0 { (x[k] - self.middle[k]) / self.half[k] } else { 0.0 };
            let (mut before, mut value) = (0.0, 1.0);
            let (first, others) = values.split_at_mut(below);
            for (n, others) in others.chunks_exact_mut(below).take(self.degree as usize).enumerate() {
                let n = n as f64;
                // (n + 1) P_{n+1} = (2n + 1) s P_n − n P_{n−1}
                (before, value) = (value, ((2.0 * n + 1.0) * s * value - n * before) / (n + 1.0));
                others.iter_mut().zip(&*first).for_each(|(other, first)| *other = first * value);
            }
            below *= self.degree as usize + 1;
        }
    }

    /// Adds V times what they are at these points.
    fn add_moments(&self, points: &[Seed<D>], moments: &mut DVector<f64>) {
        let mut values = DVector::zeros(self.count());
        for point in points {
            self.at(&point.position, &mut values);
            moments.axpy(point.volume, &values, 1.0);
        }
    }

    /// ∫ of them over the pieces and the gaps.
    pub(super) fn moments(&self, pieces: &[Piece<D>], gaps: &[Seed<D>]) -> DVector<f64> {
        let mut moments = DVector::zeros(self.count());
        let rules = Rules::new::<D>(self.degree);
        pieces.iter().for_each(|piece| self.add_moments(&piece.points(&rules), &mut moments));
        self.add_moments(gaps, &mut moments);
        moments
    }
}

/// As many points in the pieces as there are products of polynomials, at most, with volumes > 0 that have the moments of all and of the gaps;
/// `None` if none are found.
pub(super) fn few<const D: usize>(pieces: &[Piece<D>], gaps: &[Seed<D>], degree: u32) -> Option<Vec<Seed<D>>> {
    let legendre = Legendre::new(pieces, degree);
    let moments = legendre.moments(pieces, gaps);
    let volume = moments[0];
    let mut problem = NonnegativeLeastSquares::new(moments);
    // How much lies in the pieces up to each.
    let sum = |sum: &mut f64, piece: &Piece<D>| {
        *sum += piece.volume;
        Some(*sum)
    };
    let up_to: Vec<f64> = pieces.iter().scan(0.0, sum).collect();
    // Weyl's sequence fills the pieces evenly.
    let place = |k: usize| {
        let u = |root: f64| (root.sqrt() * (k + 1) as f64).fract();
        let within = u(2.0) * up_to.last().copied().unwrap_or(0.0);
        let piece = pieces.get(up_to.partition_point(|&sum| sum <= within)).or(pieces.last())?;
        Some(piece.place(std::array::from_fn(|k| u([3.0, 5.0, 7.0][k]))))
    };
    let (mut values, mut points, mut missed) = (DVector::zeros(legendre.count()), Vec::new(), f64::INFINITY);
    for tries in TRIED {
        for k in points.len()..tries * legendre.count() {
            let point = place(k)?;
            legendre.at(&point, &mut values);
            problem.offer(values.clone());
            points.push(point);
        }
        missed = problem.solve(ROUND_OFF * volume);
        if missed <= ROUND_OFF * volume {
            break;
        }
    }
    let found = || problem.solution().map(|(k, volume)| Seed { position: points[k], volume }).collect();
    (missed <= MET * volume).then(found)
}
