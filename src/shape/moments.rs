//! Moment fitting: a few quadrature points with the moments of the part of a body in a box. The moments are sums over the pieces of this
//! part and over the gaps between their planes and the surface.

use super::Seed;
use super::bounds::Bounds;
use super::cut::{Extent, Piece};
use super::layout::Layout;
use crate::grid::indices;
use crate::solver::NonnegativeLeastSquares;
use crate::tensor::Vector;
use nalgebra::DVector;

/// Round-off in moments, relative to the volume.
const ROUND_OFF: f64 = 1e-14;

/// The largest error allowed in moments, relative to the volume.
const MOMENT_TOLERANCE: f64 = 1e-10;

/// Candidate points per polynomial, tried in turn: more candidates where fewer cannot match the moments.
const CANDIDATES_PER_POLYNOMIAL: [usize; 4] = [4, 16, 64, 256];

impl<const D: usize> Piece<D> {
    /// The points of a rule along each axis of the bounding box of the piece.
    pub(super) fn in_box(&self, along: &[(f64, f64)]) -> Vec<Seed<D>> {
        let Bounds(low, high) = self.bounds();
        let point = |i: [u64; D]| {
            let at = i.map(|i| along[i as usize]);
            let position = Vector::from_fn(|k, _| self.centroid[k] + (at[k].0 - 0.5) * (high[k] - low[k]));
            Seed { position, volume: at.iter().fold(self.volume, |volume, (_, weight)| volume * weight) }
        };
        indices([along.len() as u64; D]).map(point).collect()
    }

    /// The image in the piece of a point of the unit cube. The map takes equal volumes to equal volumes.
    fn place(&self, u: [f64; D]) -> Vector<f64, D> {
        match &self.extent {
            Extent::Box(edges) => Vector::from_fn(|k, _| self.centroid[k] + (u[k] - 0.5) * edges[k]),
            Extent::Simplex(simplex) => (0..D)
                .rev()
                .fold(simplex[D], |inner, k| simplex[k] + (inner - simplex[k]) * u[k].powf(((D - k) as f64).recip())),
        }
    }

    fn bounds(&self) -> Bounds<D> {
        match &self.extent {
            Extent::Box(edges) => Bounds(self.centroid - edges.abs() * 0.5, self.centroid + edges.abs() * 0.5),
            Extent::Simplex(simplex) => Bounds::of(simplex[..=D].iter().copied()),
        }
    }
}

/// The box that these pieces fill, if they fill one. Pieces do not overlap, so they fill their bounding box if they have its volume.
pub(super) fn whole_box<const D: usize>(pieces: &[Piece<D>]) -> Option<Piece<D>> {
    let Bounds(low, high) = Bounds::around(pieces.iter().map(Piece::bounds));
    let (edges, volume) = (high - low, pieces.iter().map(|piece| piece.volume).sum::<f64>());
    let fills = (edges.product() - volume).abs() <= MOMENT_TOLERANCE * volume;
    fills.then(|| Piece { volume: edges.product(), centroid: (low + high) * 0.5, extent: Extent::Box(edges) })
}

/// Points in the simplex with d + 1 corners and this measure, by a rule along each of d axes.
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

/// Products of Legendre polynomials on the bounding box of some pieces.
pub(super) struct Legendre<const D: usize> {
    /// The middle of the box; `half` holds half of its edges.
    middle: Vector<f64, D>,
    half: Vector<f64, D>,
    degree: u32,
}

impl<const D: usize> Legendre<D> {
    pub(super) fn new(pieces: &[Piece<D>], degree: u32) -> Self {
        let Bounds(low, high) = Bounds::around(pieces.iter().map(Piece::bounds));
        Self { middle: (low + high) * 0.5, half: (high - low) * 0.5, degree }
    }

    pub(super) fn count(&self) -> usize {
        (self.degree as usize + 1).pow(D as u32)
    }

    /// The values of all products at `x`.
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

    /// Adds the sum over these points of V times the products.
    fn add_moments(&self, points: &[Seed<D>], moments: &mut DVector<f64>) {
        let mut values = DVector::zeros(self.count());
        for point in points {
            self.at(&point.position, &mut values);
            moments.axpy(point.volume, &values, 1.0);
        }
    }

    /// The integrals of the products over the pieces and the gaps.
    pub(super) fn moments(&self, pieces: &[Piece<D>], gaps: &[Seed<D>]) -> DVector<f64> {
        // In a simplex the products have total degree D p, and the map from a cube adds D − 1 along one axis.
        let [of_box, of_simplex] =
            [self.degree / 2 + 1, (D as u32 * (self.degree + 1)).div_ceil(2)].map(|n| Layout::Gauss.points(n));
        let mut moments = DVector::zeros(self.count());
        for piece in pieces {
            let points = match &piece.extent {
                Extent::Box(_) => piece.in_box(&of_box),
                Extent::Simplex(simplex) => in_simplex(&simplex[..=D], piece.volume, &of_simplex),
            };
            self.add_moments(&points, &mut moments);
        }
        self.add_moments(gaps, &mut moments);
        moments
    }
}

/// Points in the pieces, with volumes > 0, that have the moments of all pieces and gaps. There are at most as many points as products of
/// polynomials. `None` if no such points are found.
pub(super) fn few<const D: usize>(pieces: &[Piece<D>], gaps: &[Seed<D>], degree: u32) -> Option<Vec<Seed<D>>> {
    let legendre = Legendre::new(pieces, degree);
    let moments = legendre.moments(pieces, gaps);
    let volume = moments[0];
    let mut problem = NonnegativeLeastSquares::new(moments);
    // The cumulative volume of the pieces.
    let mut up_to: Vec<f64> = Vec::with_capacity(pieces.len());
    for piece in pieces {
        up_to.push(up_to.last().unwrap_or(&0.0) + piece.volume);
    }
    // Weyl's sequence fills the pieces evenly.
    let place = |k: usize| {
        let u = |root: f64| (root.sqrt() * (k + 1) as f64).fract();
        let within = u(2.0) * up_to.last().copied().unwrap_or(0.0);
        let piece = pieces.get(up_to.partition_point(|&sum| sum <= within)).or(pieces.last())?;
        Some(piece.place(std::array::from_fn(|k| u([3.0, 5.0, 7.0][k]))))
    };
    let (mut values, mut points, mut residual) = (DVector::zeros(legendre.count()), Vec::new(), f64::INFINITY);
    for candidates in CANDIDATES_PER_POLYNOMIAL {
        for k in points.len()..candidates * legendre.count() {
            let point = place(k)?;
            legendre.at(&point, &mut values);
            problem.offer(values.clone());
            points.push(point);
        }
        residual = problem.solve(ROUND_OFF * volume);
        if residual <= ROUND_OFF * volume {
            break;
        }
    }
    let found = || problem.solution().map(|(k, volume)| Seed { position: points[k], volume }).collect();
    (residual <= MOMENT_TOLERANCE * volume).then(found)
}
