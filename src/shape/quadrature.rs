//! Quadrature over what of a box lies in a solid: a few points there, with volumes > 0, that integrate products of polynomials exactly.
//! Shape functions are such products between their kinks. So a stress that does not vary is in balance with its tractions at the nodes
//! beside a surface too, and errors there fall with h.
//!
//! The moments are sums over the simplices that the box is cut into, and over the gap between their planes and a curved surface. Volumes
//! with these moments, at no more points than there are products, exist (Tchakaloff's theorem; Davis, Math. Comput. 21, 1967), and
//! non-negative least squares finds them. Surfaces have D points of the same centroid and the same second moments in each box.

use super::cut::{End, Extent, Facet, Piece, around};
use super::fill::THIN;
use super::{EDGE, Layout, Seed, Shape};
use crate::grid::indices;
use crate::solver::NonnegativeLeastSquares;
use crate::tensor::{Tensor, Vector};
use nalgebra::DVector;

/// How far a surface may depart from the planes that stand for it, relative to the spacing, where particles integrate. What lies between is
/// integrated too: planes of boxes beside each other do not meet, by the square of this.
const FINE: f64 = 1e-2;

/// The same of loaded surfaces, which are these planes, in 1D, 2D and 3D.
const OF_SURFACES: [f64; 3] = [3e-5, 3e-5, 3e-4];

/// Points along an axis of a piece of surface, and across the gap below it.
const IN_GAP: u32 = 3;

/// What is left of moments by round-off, relative to the volume.
const ROUND_OFF: f64 = 1e-14;

/// Points that are tried for each of the polynomials: more where fewer have not the moments.
const TRIED: [usize; 4] = [4, 16, 64, 256];

impl<const D: usize> Shape<D> {
    /// Points and volumes that integrate over what lies in the box every product of polynomials of this degree along each axis; `None`
    /// where the surface is one of triangles, of which only volumes and centroids are known. Of a part that is thin it is one point.
    pub(super) fn quadrature(
        &self,
        lower: &Vector<f64, D>,
        edges: &Vector<f64, D>,
        spacing: f64,
        degree: u32,
    ) -> Option<Vec<Seed<D>>> {
        if !self.has_planes(lower, edges) {
            return None;
        }
        let (mut pieces, mut gaps) = (Vec::new(), Vec::new());
        self.pieces(None, lower, edges, spacing, FINE, &mut |piece, cut| {
            self.ends(&piece, cut, spacing).iter().for_each(|end| self.add_gap(end, spacing, &mut gaps));
            pieces.push(piece);
        });
        let sum = |volume: f64, piece: &Piece<D>| volume + piece.volume;
        let (flat, gap) = (pieces.iter().fold(0.0, sum), gaps.iter().map(|gap| gap.volume).sum::<f64>());
        if flat + gap >= THIN * edges.product() {
            return Some(few(&pieces, &gaps, degree));
        }
        // It is joined to what is beside it.
        let moment: Vector<f64, D> = pieces.iter().map(|piece| piece.centroid * piece.volume).sum();
        Some(
            (flat > 0.0 && flat + gap > 0.0)
                .then(|| Seed { position: moment / flat, volume: flat + gap })
                .into_iter()
                .collect(),
        )
    }

    /// Points between a plane and the surface that it stands for, their volumes < 0 where the surface lies below it.
    fn add_gap(&self, end: &End<D>, spacing: f64, points: &mut Vec<Seed<D>>) {
        if end.departure <= EDGE * spacing {
            return;
        }
        for foot in in_simplex(&end.corners, end.area, IN_GAP) {
            let height = self.height(&foot.position, end);
            for (u, weight) in Layout::Gauss.points(IN_GAP) {
                let position = foot.position + end.outward * (u * height);
                points.push(Seed { position, volume: foot.volume * weight * height });
            }
        }
    }

    /// How far the surface is from a point of a plane that stands for it, along its normal, by Newton's method; 0 where it is not across.
    fn height(&self, x: &Vector<f64, D>, end: &End<D>) -> f64 {
        let mut height = 0.0;
        for _ in 0..4 {
            let (distance, normal) = self.distance_and_normal(&(x + end.outward * height));
            let rate = normal.dot(&end.outward);
            if rate < 0.5 {
                return 0.0;
            }
            height = (height - distance / rate).clamp(-end.departure, end.departure);
        }
        height
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
        let sides = self.sides(region, lower, edges, spacing, OF_SURFACES[D.min(3) - 1]);
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

impl<const D: usize> Piece<D> {
    /// Gauss's points in it, for products of polynomials of this degree.
    fn points(&self, degree: u32) -> Vec<Seed<D>> {
        match &self.extent {
            Extent::Box(edges) => {
                let along = Layout::Gauss.points(degree / 2 + 1);
                let point = |i: [u64; D]| {
                    let at = i.map(|i| along[i as usize]);
                    let position = Vector::from_fn(|k, _| self.centroid[k] + (at[k].0 - 0.5) * edges[k]);
                    Seed { position, volume: at.iter().fold(self.volume, |volume, (_, weight)| volume * weight) }
                };
                indices([along.len() as u64; D]).map(point).collect()
            }
            // Together they are of degree D p, and the map from a cube has D − 1 more along one axis.
            Extent::Simplex(simplex) => in_simplex(&simplex[..=D], self.volume, (D as u32 * (degree + 1)).div_ceil(2)),
        }
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
            Extent::Box(edges) => [self.centroid - edges * 0.5, self.centroid + edges * 0.5],
            Extent::Simplex(simplex) => {
                [Vector::inf, Vector::sup].map(|bound: fn(&Vector<f64, D>, &Vector<f64, D>) -> _| {
                    simplex[1..=D].iter().fold(simplex[0], |all, corner| bound(&all, corner))
                })
            }
        }
    }
}

/// Gauss's points, n along each of d axes, of the simplex with d + 1 corners and this measure.
fn in_simplex<const D: usize>(corners: &[Vector<f64, D>], measure: f64, n: u32) -> Vec<Seed<D>> {
    let along = Layout::Gauss.points(n);
    let Some((last, others)) = corners.split_last() else { return Vec::new() };
    // x = x₀ + u₁ (x₁ − x₀ + u₂ (x₂ − x₁ + …)), of measure d! V Π u_k^(d−k)
    let start = vec![Seed { position: *last, volume: measure }];
    others.iter().rev().enumerate().fold(start, |inner, (before, corner)| {
        let spread = |point: &Seed<D>, (u, weight): (f64, f64)| Seed {
            position: corner + (point.position - corner) * u,
            volume: point.volume * weight * u.powi(before as i32) * (before + 1) as f64,
        };
        inner.iter().flat_map(|point| along.iter().map(move |&at| spread(point, at))).collect()
    })
}

/// Products of Legendre's polynomials on the box around some points.
struct Legendre<const D: usize> {
    /// Its middle, and half of its edges.
    middle: Vector<f64, D>,
    half: Vector<f64, D>,
    degree: u32,
}

impl<const D: usize> Legendre<D> {
    fn new(around: &[Piece<D>], degree: u32) -> Self {
        let nothing: [Vector<f64, D>; 2] = [f64::INFINITY, f64::NEG_INFINITY].map(Vector::repeat);
        let [low, high] = around
            .iter()
            .map(Piece::bounds)
            .fold(nothing, |[low, high], [lower, upper]| [low.inf(&lower), high.sup(&upper)]);
        Self { middle: (low + high) * 0.5, half: (high - low) * 0.5, degree }
    }

    fn count(&self) -> usize {
        (self.degree as usize + 1).pow(D as u32)
    }

    /// What they are at a place.
    fn at(&self, x: &Vector<f64, D>, values: &mut Vec<f64>) {
        values.clear();
        values.push(1.0);
        for k in 0..D {
            let s = if self.half[k] > 0.0 { (x[k] - self.middle[k]) / self.half[k] } else { 0.0 };
            let below = values.len();
            let (mut before, mut value) = (0.0, 1.0);
            for n in (0..self.degree).map(f64::from) {
                // (n + 1) P_{n+1} = (2n + 1) s P_n − n P_{n−1}
                (before, value) = (value, ((2.0 * n + 1.0) * s * value - n * before) / (n + 1.0));
                (0..below).for_each(|i| values.push(values[i] * value));
            }
        }
    }

    /// Adds V times what they are at these points.
    fn add_moments(&self, points: &[Seed<D>], moments: &mut DVector<f64>) {
        let mut values = Vec::new();
        for point in points {
            self.at(&point.position, &mut values);
            moments.iter_mut().zip(&values).for_each(|(moment, value)| *moment += point.volume * value);
        }
    }

    /// ∫ of them over the pieces and the gaps.
    fn moments(&self, pieces: &[Piece<D>], gaps: &[Seed<D>]) -> DVector<f64> {
        let mut moments = DVector::zeros(self.count());
        pieces.iter().for_each(|piece| self.add_moments(&piece.points(self.degree), &mut moments));
        self.add_moments(gaps, &mut moments);
        moments
    }
}

/// As many points in the pieces as there are products of polynomials, at most, with volumes > 0 that have the moments of all and of the gaps.
fn few<const D: usize>(pieces: &[Piece<D>], gaps: &[Seed<D>], degree: u32) -> Vec<Seed<D>> {
    if let ([whole @ Piece { extent: Extent::Box(_), .. }], []) = (pieces, gaps) {
        return whole.points(degree);
    }
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
    let (mut values, mut points) = (Vec::new(), Vec::new());
    for tries in TRIED {
        for k in points.len()..tries * legendre.count() {
            let Some(point) = place(k) else { return Vec::new() };
            legendre.at(&point, &mut values);
            problem.offer(DVector::from_column_slice(&values));
            points.push(point);
        }
        if problem.solve(ROUND_OFF * volume) <= ROUND_OFF * volume {
            break;
        }
    }
    problem.solution().map(|(k, volume)| Seed { position: points[k], volume }).collect()
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
    use crate::shape::{Ball, Block, Cone, Difference, Similar, rotation};

    /// Volumes stay positive, and no moment changes, in any cell of which there is more than a sliver.
    fn has_moments_of_all<const D: usize>(shape: &Shape<D>, degree: u32, boxes: u64) {
        let edges = Vector::repeat((boxes as f64).recip());
        for i in indices([boxes; D]) {
            let lower = Vector::from_fn(|k, _| i[k] as f64 * edges[k]);
            let (mut all, mut gaps) = (Vec::new(), Vec::new());
            shape.pieces(None, &lower, &edges, edges[0], FINE, &mut |piece, cut| {
                shape.ends(&piece, cut, edges[0]).iter().for_each(|end| shape.add_gap(end, edges[0], &mut gaps));
                all.push(piece);
            });
            let few = shape.quadrature(&lower, &edges, edges[0], degree).unwrap();
            let volume: f64 = few.iter().map(|point| point.volume).sum();
            if volume < THIN * edges.product() {
                continue;
            }
            let legendre = Legendre::new(&all, degree);
            let before = legendre.moments(&all, &gaps);
            let missed = (legendre.moments(&[], &few) - &before).amax();
            let positive = few.iter().all(|point| point.volume > 0.0) && few.len() <= legendre.count();
            assert!(positive && missed <= 1e-12 * before[0], "{degree}, {boxes}, {i:?}: {missed} of {}", before[0]);
        }
    }

    /// For cells that a surface cuts in all ways, thin parts among them.
    #[test]
    fn few_points_have_the_moments_of_all() {
        let hole = Ball { center: Vector::from([0.47, 0.52]), radius: 0.23 };
        let plate = Block { min: Vector::zeros(), max: Vector::repeat(1.0) };
        let plate: Shape<2> = Difference { of: Box::new(plate.into()), minus: Box::new(hole.into()) }.into();
        for (degree, boxes) in [(1, 16), (1, 32), (2, 16), (2, 32), (2, 64), (3, 16), (3, 32)] {
            has_moments_of_all(&plate, degree, boxes);
        }
        let ball: Shape<3> = Ball { center: Vector::from([0.47, 0.52, 0.51]), radius: 0.41 }.into();
        let cube = Block { min: Vector::repeat(0.03), max: Vector::repeat(0.96) };
        let holed = Difference { of: Box::new(cube.clone().into()), minus: Box::new(ball.clone()) };
        let ends = [[0.4, 0.3, 0.3], [0.81, 0.42, 0.53]].map(Vector::from);
        let cylinder = Cone::new(ends, [0.2, 0.2]).unwrap();
        for shape in [ball, holed.into(), cylinder.into(), turned()] {
            has_moments_of_all(&shape, 3, 4);
        }
    }

    /// A turned box of edges 0.5, 0.4 and 0.3 around its middle.
    fn turned() -> Shape<3> {
        let half = Vector::from([0.25, 0.2, 0.15]);
        let about = Vector::from([0.51, 0.48, 0.53]);
        let of = Block { min: about - half, max: about + half };
        let rotation = rotation(50.0, Some(&Vector::from([1.0, 2.0, -0.5]))).unwrap();
        Similar { of: Box::new(of.into()), about, rotation, factor: 1.0 }.into()
    }

    fn sums(shape: &Shape<3>, boxes: u64, f: impl Fn(&Vector<f64, 3>) -> f64) -> f64 {
        let edges = Vector::repeat((boxes as f64).recip());
        let lowers = indices([boxes; 3]).map(|i| Vector::from_fn(|k, _| i[k] as f64 * edges[k]));
        let points = lowers.flat_map(|lower| shape.quadrature(&lower, &edges, edges[0], 3).unwrap());
        points.map(|point| point.volume * f(&point.position)).sum()
    }

    /// ∫ (e·(x − c))² dV = V a²/12 along an edge e of length a, and ∫ x² y² dV = 4π R⁷/105 in a ball: nothing is lost between planes.
    /// What is joined to neighbours is taken where it is.
    #[test]
    fn known_integrals_in_space() {
        let Shape::Similar(turned) = turned() else { panic!() };
        let (rotation, middle, shape) = (turned.rotation, turned.about, Shape::from(turned.clone()));
        for (k, edge) in [0.5_f64, 0.4, 0.3].into_iter().enumerate() {
            let found = sums(&shape, 5, |x| (rotation.transpose() * (x - middle))[k].powi(2));
            assert!((found / (0.06 * edge * edge / 12.0) - 1.0).abs() < 1e-6, "{k}: {found}");
        }
        let ball: Shape<3> = Ball { center: middle, radius: 0.45 }.into();
        let pi = std::f64::consts::PI;
        let volume = sums(&ball, 5, |_| 1.0) / (4.0 / 3.0 * pi * 0.45_f64.powi(3)) - 1.0;
        let fourth = sums(&ball, 5, |x| ((x - middle)[0] * (x - middle)[1]).powi(2));
        let fourth = fourth / (4.0 * pi * 0.45_f64.powi(7) / 105.0) - 1.0;
        assert!(volume.abs() < 1e-5 && fourth.abs() < 1e-4, "{volume:e}, {fourth:e}");
    }
}
