//! Quadrature over what of a box lies in a solid: a few points there, with volumes > 0, that integrate products of polynomials exactly.
//! Shape functions are such products between their kinks. So a stress that does not vary is in balance with its tractions at the nodes
//! beside a surface too, and errors there fall with h.
//!
//! The points are Gauss's of the simplices that the box is cut into, as many of them as there are products of polynomials: the others
//! give their volumes away, one after another, so that no moment changes (Tchakaloff's theorem, by elimination: Davis, Math. Comput. 21,
//! 1967). Surfaces have D points of the same centroid and the same second moments in each box.

use super::cut::{Extent, Facet, Piece, around};
use super::{Layout, Seed, Shape};
use crate::grid::indices;
use crate::tensor::{Tensor, Vector};
use nalgebra::{DMatrix, DVector};

/// How far a surface may depart from the planes that stand for it, relative to the spacing, in 1D, 2D and 3D, where particles are as of
/// [`Shape::part`]. Planes of boxes beside each other do not meet to that: an error that does not fall with the spacing.
const FINE: [f64; 3] = [3e-5, 3e-5, 1e-3];

/// Values of polynomials that are independent of others depend on them no less than that.
const INDEPENDENT: f64 = 1e-9;

/// The share of the volume below which a point is round-off.
const NOTHING: f64 = 1e-12;

impl<const D: usize> Shape<D> {
    /// Points and volumes that integrate over what lies in the box every product of polynomials of this degree along each axis; `None`
    /// where the surface is one of triangles, of which only volumes and centroids are known, and in space, where 64 polynomials and the
    /// thousands of points of a curved surface's simplices would take seconds a cell.
    pub(super) fn quadrature(
        &self,
        lower: &Vector<f64, D>,
        edges: &Vector<f64, D>,
        spacing: f64,
        degree: u32,
    ) -> Option<Vec<Seed<D>>> {
        if D > 2 || !self.has_planes(lower, edges) {
            return None;
        }
        let mut points = Vec::new();
        self.pieces(None, lower, edges, spacing, FINE[D.min(3) - 1], &mut |piece| {
            piece.add_points(degree, &mut points)
        });
        Some(Compressed::new(&points, degree).of(points))
    }

    /// Points that integrate over the surface in a box as those of [`Fill::Cut`](super::Fill) in Gauss layout do over the volume: D for each
    /// of its sides there, and in `region` if there is one.
    ///
    /// ```
    /// use bfree::shape::{HalfSpace, Shape};
    /// use bfree::tensor::Vector;
    ///
    /// // Gauss's two points of a diagonal.
    /// let below = Shape::from(HalfSpace { point: Vector::zeros(), normal: Vector::from([1.0, 1.0]) });
    /// let points = below.surface_points(None, &Vector::from([-1.0, -1.0]), &Vector::from([2.0, 2.0]), 1.0);
    /// let at = Vector::from([1.0, -1.0]) / 3.0_f64.sqrt();
    /// assert!(points.len() == 2 && points.iter().all(|point| (point.area - 2.0_f64.sqrt()).abs() < 1e-14));
    /// assert!((points[0].position - at).norm().min((points[0].position + at).norm()) < 1e-14);
    /// assert!((points[0].position + points[1].position).norm() < 1e-14);
    /// ```
    pub fn surface_points(
        &self,
        region: Option<&Self>,
        lower: &Vector<f64, D>,
        edges: &Vector<f64, D>,
        spacing: f64,
    ) -> Vec<Facet<D>> {
        let sides = self.sides(region, lower, edges, spacing, FINE[D.min(3) - 1]);
        sides.iter().flat_map(Facet::points).collect()
    }

    /// Whether the surface in a box is found by its planes.
    fn has_planes(&self, lower: &Vector<f64, D>, edges: &Vector<f64, D>) -> bool {
        let (center, radius) = around(lower, edges);
        match self.solid().alone(&center, radius) {
            Some((part, _)) => part.has_planes(lower, edges),
            None => self.solid().row(lower, edges, 0).is_none(),
        }
    }
}

impl<const D: usize> Piece<'_, D> {
    /// Gauss's points in it, for products of polynomials of this degree.
    fn add_points(&self, degree: u32, points: &mut Vec<Seed<D>>) {
        let n = match self.extent {
            Extent::Box(_) => degree / 2 + 1,
            // Together they are of degree D p, and the map from a cube has D − 1 more along one axis.
            Extent::Simplex(..) => (D as u32 * (degree + 1)).div_ceil(2),
        };
        let along = Layout::Gauss.points(n);
        for i in indices([u64::from(n); D]) {
            let (mut position, mut volume) = (self.centroid, self.volume);
            match self.extent {
                Extent::Box(edges) => {
                    for k in 0..D {
                        let (u, weight) = along[i[k] as usize];
                        position[k] += (u - 0.5) * edges[k];
                        volume *= weight;
                    }
                }
                // x = x₀ + u₁ (x₁ − x₀ + u₂ (x₂ − x₁ + …)), of volume D! V Π u_k^(D−k)
                Extent::Simplex(simplex, _) => {
                    position = simplex[D];
                    for k in (0..D).rev() {
                        let (u, weight) = along[i[k] as usize];
                        position = simplex[k] + (position - simplex[k]) * u;
                        volume *= weight * u.powi((D - 1 - k) as i32) * (k + 1) as f64;
                    }
                }
            }
            points.push(Seed { position, volume });
        }
    }
}

/// As many points as there are products of polynomials, at most, with the moments of all that were added.
struct Compressed<const D: usize> {
    /// The box around them, on which polynomials are Legendre's: its middle, and half of its edges.
    middle: Vector<f64, D>,
    half: Vector<f64, D>,
    degree: u32,
    /// `None` as long as there are fewer.
    points: Vec<Option<Seed<D>>>,
    /// The inverse of the matrix that has as columns what the polynomials are at each point, and unit vectors in place of points that
    /// are not there yet.
    inverse: DMatrix<f64>,
    /// Σ V of what the polynomials are at all points that were added.
    moments: DVector<f64>,
}

impl<const D: usize> Compressed<D> {
    fn new(around: &[Seed<D>], degree: u32) -> Self {
        let bound = |sign: f64| {
            let far = |k: usize| around.iter().map(|point| sign * point.position[k]).fold(f64::NEG_INFINITY, f64::max);
            Vector::from_fn(|k, _| sign * far(k))
        };
        let (low, high): (Vector<f64, D>, Vector<f64, D>) = (bound(-1.0), bound(1.0));
        let count = (degree as usize + 1).pow(D as u32);
        Self {
            middle: (low + high) * 0.5,
            half: (high - low) * 0.5,
            degree,
            points: vec![None; count],
            inverse: DMatrix::identity(count, count),
            moments: DVector::zeros(count),
        }
    }

    /// Products of Legendre's polynomials.
    fn polynomials(&self, x: &Vector<f64, D>) -> DVector<f64> {
        let along: [Vec<f64>; D] = std::array::from_fn(|k| {
            let s = if self.half[k] > 0.0 { (x[k] - self.middle[k]) / self.half[k] } else { 0.0 };
            let (mut before, mut value) = (0.0, 1.0);
            let next = |n: u32| {
                let n = f64::from(n);
                // (n + 1) P_{n+1} = (2n + 1) s P_n − n P_{n−1}
                let this = value;
                (before, value) = (value, ((2.0 * n + 1.0) * s * value - n * before) / (n + 1.0));
                this
            };
            (0..=self.degree).map(next).collect()
        });
        let all = indices([u64::from(self.degree) + 1; D]);
        let products = all.map(|i| (0..D).map(|k| along[k][i[k] as usize]).product());
        DVector::from_iterator(self.points.len(), products)
    }

    /// Adds a point, which takes the place of one or gives them its volume.
    fn add(&mut self, mut point: Seed<D>) {
        let values = self.polynomials(&point.position);
        self.moments.axpy(point.volume, &values, 1.0);
        // What of its volume each of the others would get.
        let shares = &self.inverse * values;
        let slots = || self.points.iter().zip(shares.iter().copied()).enumerate();
        let empty = slots().filter(|(_, (other, share))| other.is_none() && share.abs() > INDEPENDENT);
        if let Some((slot, _)) = empty.max_by(|a, b| a.1.1.abs().total_cmp(&b.1.1.abs())) {
            self.replace(slot, point, shares);
            return;
        }
        // The first that has nothing left if this one gives, and if it takes.
        let first = |sign: f64| {
            let left = |(slot, (other, share)): (usize, (&Option<Seed<D>>, f64))| {
                other.filter(|_| sign * share < -INDEPENDENT).map(|other| (slot, -other.volume / share, share.abs()))
            };
            slots().filter_map(left).min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
        };
        let (gives, takes) = (first(1.0), first(-1.0));
        let all = gives.is_none_or(|(_, most, _)| most >= point.volume);
        // What is replaced should depend on this one as much as can be.
        let replaced = gives.filter(|gives| takes.is_none_or(|takes| gives.2 >= takes.2)).or(takes);
        let given = match replaced {
            Some((_, most, _)) if !all => most,
            _ => point.volume,
        };
        for (other, share) in self.points.iter_mut().zip(shares.iter()) {
            other.iter_mut().for_each(|other| other.volume = (other.volume + share * given).max(0.0));
        }
        if let Some((slot, ..)) = replaced.filter(|_| !all) {
            point.volume -= given;
            self.replace(slot, point, shares);
        }
    }

    /// Puts a point in a slot.
    fn replace(&mut self, slot: usize, point: Seed<D>, mut shares: DVector<f64>) {
        self.points[slot] = Some(point);
        let row = self.inverse.row(slot).transpose() / shares[slot];
        shares[slot] -= 1.0;
        self.inverse.ger(-1.0, &shares, &row, 1.0);
    }

    /// All points, as few.
    fn of(mut self, points: Vec<Seed<D>>) -> Vec<Seed<D>> {
        if points.len() <= self.points.len() {
            return points;
        }
        // Far from each other, one after another: at first each should be as independent as can be of those before.
        let count = points.len();
        let apart = |stride: &usize| (2..=*stride).all(|by| !(stride.is_multiple_of(by) && count.is_multiple_of(by)));
        let stride = (1 + 618 * count / 1000..).find(apart).unwrap_or(1);
        (0..count).for_each(|k| self.add(points[k * stride % count]));
        // What round-off has taken from the moments.
        let mut missing = self.moments.clone();
        for point in self.points.iter().flatten() {
            missing.axpy(-point.volume, &self.polynomials(&point.position), 1.0);
        }
        let more = &self.inverse * missing;
        let least = NOTHING * self.moments[0];
        let mended = self.points.into_iter().zip(more.iter());
        mended
            .filter_map(|(point, more)| point.map(|point| Seed { volume: point.volume + more, ..point }))
            .filter(|point| point.volume > least)
            .collect()
    }
}

impl<const D: usize> Facet<D> {
    /// D points with equal parts of its area, which they have centroid, spread and turn in common with: on a flat piece exact for polynomials
    /// of second degree. They lie in it where it is convex.
    fn points(&self) -> Vec<Self> {
        // q, the corners of a regular simplex: Σ q = 0 and Σ q qᵀ = D I.
        let (one, half, third) = (1.0, 0.5_f64.sqrt(), 1.5_f64.sqrt());
        let corners: &[[f64; 2]] = match D {
            1 => &[[0.0, 0.0]],
            2 => &[[one, 0.0], [-one, 0.0]],
            _ => &[[2.0 * half, 0.0], [-half, third], [-half, -third]],
        };
        // Across the axis nearest to its normal it is a graph over the others, a and b. Their part of its spread is L Lᵀ: x = L q, and
        // n − n̄ = (L⁻¹ turn)ᵀ q.
        let across = self.normal.iamax();
        let [a, b] = [(across + 1) % D, (across + 2) % D];
        let root = |x: f64| x.max(0.0).sqrt();
        let over = |x: Vector<f64, D>, y: f64| if y > 0.0 { x / y } else { Vector::zeros() };
        let row = |k: usize| self.turn.row(k).transpose();
        let first = root(self.spread[(a, a)]);
        let skew = if first > 0.0 { self.spread[(a, b)] / first } else { 0.0 };
        let second = if D > 2 { root(self.spread[(b, b)] - skew * skew) } else { 0.0 };
        let turned = over(row(a), first);
        let point = |[p, q]: &[f64; 2]| {
            let mut by = Vector::zeros();
            by[b] = skew * p + second * q;
            by[a] = first * p;
            by[across] = 0.0;
            by[across] = -self.normal.dot(&by) / self.normal[across];
            Self {
                position: self.position + by,
                normal: self.normal + turned * *p + over(row(b) - turned * skew, second) * *q,
                area: self.area / D as f64,
                spread: Tensor::zeros(),
                turn: Tensor::zeros(),
            }
        };
        corners.iter().map(point).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{Ball, Block, Difference};

    /// Volumes stay positive, and no moment changes: for cells that a hole cuts in all ways, thin parts among them.
    #[test]
    fn fewer_points_have_the_moments_of_all() {
        let hole = Ball { center: Vector::from([0.47, 0.52]), radius: 0.23 };
        let plate = Block { min: Vector::zeros(), max: Vector::repeat(1.0) };
        let plate: Shape<2> = Difference { of: Box::new(plate.into()), minus: Box::new(hole.into()) }.into();
        for (degree, boxes) in [(1, 16), (1, 32), (2, 16), (2, 32), (2, 64), (3, 16), (3, 32)] {
            let edges = Vector::repeat(f64::from(boxes).recip());
            for i in indices([boxes as u64; 2]) {
                let lower = Vector::from_fn(|k, _| i[k] as f64 * edges[k]);
                let mut all = Vec::new();
                plate.pieces(None, &lower, &edges, edges[0], 3e-5, &mut |piece| piece.add_points(degree, &mut all));
                let compressed = Compressed::new(&all, degree);
                let sums = |points: &[Seed<2>]| {
                    let zero = DVector::zeros((degree as usize + 1).pow(2));
                    points.iter().fold(zero, |sum, point| sum + compressed.polynomials(&point.position) * point.volume)
                };
                let before = sums(&all);
                let few = Compressed::new(&all, degree).of(all.clone());
                let missed = (sums(&few) - &before).amax();
                let positive = few.iter().all(|point| point.volume > 0.0) && few.len() <= before.len();
                assert!(positive && missed <= 1e-9 * before[0], "{degree}, {boxes}, {i:?}: {missed} of {}", before[0]);
            }
        }
    }
}
