//! Quadrature over the part of a box in a solid: a few points with volumes > 0 integrate products of polynomials exactly. Shape functions
//! are such products between their knots. So a uniform stress balances its tractions also at the nodes beside a surface, and errors there
//! fall with h.
//!
//! The moments are sums over the simplices of the cut box, and over the gap between their planes and a curved surface. Volumes with these
//! moments exist at no more points than there are products (Tchakaloff's theorem; Davis, Math. Comput. 21, 1967). Non-negative least
//! squares finds these volumes. In each box, a surface has 2^(D−1) points with the centroid and the second moments of the surface.

use super::cut::{End, Facet, Piece};
use super::moments::{few, in_simplex, whole_box};
use super::{GridBox, Layout, Seed, Shape, Similar};
use crate::grid::indices;
use crate::tensor::{Tensor, Vector, identity};
use std::cmp::Ordering;

/// The largest distance between a surface and its planes, relative to the spacing, where particles are quadrature points. The gap between
/// surface and planes is integrated, too. Planes of neighbouring boxes do not quite meet, by the square of this number.
const FLAT_FOR_PARTICLES: f64 = 1e-2;

/// The largest distance between a loaded surface and its planes, relative to the spacing, in 1D, 2D and 3D. Loads act on the planes.
const FLAT_FOR_LOADS: [f64; 3] = [3e-5, 3e-5, 3e-4];

/// The number of points along an axis of a piece of surface, and across the gap below the piece.
const GAP_POINTS: u32 = 3;

/// Parts below this fraction of a box have one particle, which is joined to a neighbour. Joining changes second moments, so the limit is
/// smaller than that of regular particles.
pub(super) const THIN_PART: f64 = 1e-3;

/// A box that lacks no larger part of its volume is full.
const WHOLE: f64 = 1e-12;

impl<const D: usize> Shape<D> {
    /// Points and volumes that integrate, over the part of the solid in a box, every product of polynomials of this degree along each axis.
    ///
    /// A thin part has one point. A part that is itself a box has Gauss points: `per_axis` along an axis, or as many as the degree needs.
    /// `None` for surfaces of triangles, of which only volumes and centroids are known, and if no such points are found.
    ///
    /// Images of a solid have images of these points. A box is measured with its axes in the order and in the directions in which the solid rises
    /// there; where several orders are equal, the result is their mean.
    pub(super) fn quadrature(&self, of: &GridBox<D>, degree: u32, per_axis: u32) -> Option<Vec<Seed<D>>> {
        if !self.has_planes(of) {
            return None;
        }
        if let Some(points) = self.whole_or_nothing(of, degree, per_axis) {
            return Some(points);
        }
        let images = self.images(of);
        let (first, fitted) = self.of_image(&images[0], of, degree, per_axis)?;
        if !fitted || images.len() == 1 {
            return Some(first);
        }
        let mut all: Vec<Seed<D>> = Vec::new();
        for image in &images {
            all.extend(self.of_image(image, of, degree, per_axis)?.0);
        }
        all.iter_mut().for_each(|point| point.volume /= images.len() as f64);
        Some(all)
    }

    /// The points of a box that is full or empty. They do not depend on the order of the axes. `None` for other boxes.
    fn whole_or_nothing(&self, of: &GridBox<D>, degree: u32, per_axis: u32) -> Option<Vec<Seed<D>>> {
        let (pieces, gaps) = self.pieces_and_gaps(of);
        if !gaps.is_empty() {
            return None;
        }
        let volume: f64 = pieces.iter().map(|piece| piece.volume).sum();
        if volume == 0.0 {
            return Some(Vec::new());
        }
        let whole = whole_box(&pieces).filter(|_| volume >= of.edges.product() * (1.0 - WHOLE))?;
        Some(whole.in_box(&Layout::Gauss.points(per_axis.max(degree / 2 + 1))))
    }

    /// The images x ↦ c + R (x − c) of the solid about the centre of a box in which it rises along all axes, most along the first one: one, or
    /// several where the part of the solid in the box is symmetric.
    fn images(&self, of: &GridBox<D>) -> Vec<Tensor<f64, D>> {
        let (center, radius) = of.around();
        let value = |x: &Vector<f64, D>| self.signed_distance(&(center + x));
        if value(&Vector::zeros()).abs() >= radius {
            return vec![identity()];
        }
        let corner = |i: [u64; D]| Vector::<f64, D>::from_fn(|k, _| (i[k] as f64 - 0.5) * of.edges[k]);
        let rise: Vector<f64, D> = indices([2; D]).map(corner).map(|x| x.map(f64::signum) * value(&x)).sum();
        let rises = |image: &Tensor<f64, D>| image * rise;
        let mut all = signed_permutations::<D>();
        let order = |one: &Tensor<f64, D>, other: &Tensor<f64, D>| {
            let falls = rises(other) - rises(one);
            falls.iter().find(|fall| fall.abs() > of.round_off()).map_or(Ordering::Equal, |fall| fall.total_cmp(&0.0))
        };
        let Some(first) = all.iter().min_by(|one, other| order(one, other)).copied() else { return all };
        all.retain(|image| order(image, &first).is_eq());
        // Equal rises are symmetries only if the solid is the same everywhere in the box.
        let places =
            || indices([5; D]).map(|i| Vector::<f64, D>::from_fn(|k, _| (i[k] as f64 / 4.0 - 0.5) * of.edges[k]));
        let is_same = |image: &Tensor<f64, D>| {
            let at = |x: &Vector<f64, D>| value(&image.tr_mul(x)) - value(&first.tr_mul(x));
            places().all(|x| at(&x).abs() <= of.round_off())
        };
        if all.len() > 1 {
            all.retain(is_same);
        }
        all
    }

    /// Points of an image of the solid, taken back to the solid, and whether they were fitted.
    fn of_image(
        &self,
        image: &Tensor<f64, D>,
        of: &GridBox<D>,
        degree: u32,
        per_axis: u32,
    ) -> Option<(Vec<Seed<D>>, bool)> {
        mutant!("solids: quadrature points depend on the axes": { return self.quadrature_in_order(of, degree, per_axis); });
        if *image == identity::<f64, D>() {
            return self.quadrature_in_order(of, degree, per_axis);
        }
        let about = of.around().0;
        let edges = image.abs() * of.edges;
        let of = GridBox { lower: about - edges * 0.5, edges, ..*of };
        let solid = Similar { of: Box::new(self.clone()), about, rotation: *image, factor: 1.0 };
        let back = |point: Seed<D>| Seed { position: about + image.tr_mul(&(point.position - about)), ..point };
        let (points, fitted) = Self::from(solid).quadrature_in_order(&of, degree, per_axis)?;
        Some((points.into_iter().map(back).collect(), fitted))
    }

    fn quadrature_in_order(&self, of: &GridBox<D>, degree: u32, per_axis: u32) -> Option<(Vec<Seed<D>>, bool)> {
        let (pieces, gaps) = self.pieces_and_gaps(of);
        let flat: f64 = pieces.iter().map(|piece| piece.volume).sum();
        let volume = flat + gaps.iter().map(|gap| gap.volume).sum::<f64>();
        if volume < THIN_PART * of.edges.product() {
            // A thin part has one point, which the caller joins to a neighbour.
            let moment: Vector<f64, D> = pieces.iter().map(|piece| piece.centroid * piece.volume).sum();
            let has_volume = flat > 0.0 && volume > 0.0;
            let points = if has_volume { vec![Seed { position: moment / flat, volume }] } else { Vec::new() };
            return Some((points, false));
        }
        match whole_box(&pieces).filter(|_| gaps.is_empty()) {
            Some(part) => Some((part.in_box(&Layout::Gauss.points(per_axis.max(degree / 2 + 1))), false)),
            None => Some((few(&pieces, &gaps, degree)?, true)),
        }
    }

    /// The pieces of the solid in a box, and points of the gaps between their planes and the surface.
    fn pieces_and_gaps(&self, of: &GridBox<D>) -> (Vec<Piece<D>>, Vec<Seed<D>>) {
        let rule = Layout::Gauss.points(GAP_POINTS);
        let (mut pieces, mut gaps) = (Vec::new(), Vec::new());
        self.pieces(None, of, FLAT_FOR_PARTICLES, &mut |piece, cut| {
            for end in self.ends(&piece, cut, of.round_off()).iter().filter(|end| end.departure > of.round_off()) {
                self.add_gap(end, &rule, &mut gaps);
            }
            pieces.push(piece);
        });
        (pieces, gaps)
    }

    /// Points between a plane and the surface that it approximates. Volumes are negative where the surface lies below the plane.
    fn add_gap(&self, end: &End<D>, rule: &[(f64, f64)], points: &mut Vec<Seed<D>>) {
        mutant!("solids: the gap between planes and a curved surface is left out": { return; });
        for foot in in_simplex(&end.corners, end.area, rule) {
            let height = self.height(&foot.position, end);
            for (u, weight) in rule {
                let position = foot.position + end.outward * (u * height);
                points.push(Seed { position, volume: foot.volume * weight * height });
            }
        }
    }

    /// The distance of the surface from a point of a plane, along the normal of the plane, by Newton's method. The result is 0 if the
    /// surface makes more than 60° with the plane.
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

    /// Quadrature points on the surface in a box, and in `region` if given: 2^(D−1) points for each side of the solid there. The points match
    /// those of [`Fill::Cut`](super::Fill) in Gauss layout.
    ///
    /// ```
    /// use bfree::shape::{GridBox, HalfSpace, Shape};
    /// use bfree::tensor::Vector;
    ///
    /// // Gauss's two points of a diagonal.
    /// let below = Shape::from(HalfSpace { point: Vector::zeros(), normal: Vector::from([1.0, 1.0]) });
    /// let square = GridBox { lower: Vector::from([-1.0, -1.0]), edges: Vector::from([2.0, 2.0]), spacing: 1.0 };
    /// let points = below.surface_points(None, &square);
    /// let at = Vector::from([1.0, -1.0]) / 3.0_f64.sqrt();
    /// assert!(points.len() == 2 && points.iter().all(|point| (point.area - 2.0_f64.sqrt()).abs() < 1e-14));
    /// assert!((points[0].position - at).norm().min((points[0].position + at).norm()) < 1e-14);
    /// assert!((points[0].position + points[1].position).norm() < 1e-14);
    /// ```
    pub fn surface_points(&self, region: Option<&Self>, of: &GridBox<D>) -> Vec<Facet<D>> {
        let sides = self.sides(region, of, FLAT_FOR_LOADS[D.min(3) - 1]);
        sides.iter().flat_map(Facet::points).collect()
    }

    /// Whether the surface in a box is approximated by planes.
    fn has_planes(&self, of: &GridBox<D>) -> bool {
        let (center, radius) = of.around();
        match self.solid().alone(&center, radius) {
            Some((part, _)) => part.has_planes(of),
            None => self.solid().row(of, 0).is_none(),
        }
    }
}

/// All orders of the axes, in both directions each, as orthogonal tensors.
fn signed_permutations<const D: usize>() -> Vec<Tensor<f64, D>> {
    let all = indices([2 * D as u64; D]).map(|rows| {
        let entry = |i: usize, k: usize| if rows[i] / 2 == k as u64 { 1.0 - 2.0 * (rows[i] % 2) as f64 } else { 0.0 };
        Tensor::<f64, D>::from_fn(entry)
    });
    all.filter(|image| image * image.transpose() == identity::<f64, D>()).collect()
}

impl<const D: usize> Facet<D> {
    /// 2^(D−1) points with equal shares of the area, and with the centroid, spread and turn of the facet. On a flat facet the points are exact
    /// for polynomials of degree two. On a rectangle along the axes they are Gauss's points, exact for products of cubic polynomials. On a
    /// convex facet the points lie in it.
    fn points(&self) -> Vec<Self> {
        // q, the ends of a segment or the corners of a square: the mean of q is 0, and that of q qᵀ is I.
        let corners: &[[f64; 2]] = match D {
            1 => &[[0.0, 0.0]],
            2 => &[[1.0, 0.0], [-1.0, 0.0]],
            _ => &[[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]],
        };
        // The facet is a graph over the axes a and b, across the axis nearest to its normal. The spread along a and b is L Lᵀ: x = L q, and
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
                area: self.area / corners.len() as f64,
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
    use crate::shape::moments::Legendre;
    use crate::shape::{Ball, Block, Cone, Difference, Similar, rotation};

    /// In every cell with more than a sliver, volumes stay positive and no moment changes.
    fn has_moments_of_all<const D: usize>(shape: &Shape<D>, degree: u32, boxes: u64) {
        let edges = Vector::repeat((boxes as f64).recip());
        for i in indices([boxes; D]) {
            let lower = Vector::from_fn(|k, _| i[k] as f64 * edges[k]);
            let of = GridBox { lower, edges, spacing: edges[0] };
            let (all, gaps) = shape.pieces_and_gaps(&of);
            // The pieces of an image lie elsewhere on a curved surface, so the axes keep their order here.
            let (few, _) = shape.quadrature_in_order(&of, degree, 1).unwrap();
            let volume: f64 = few.iter().map(|point| point.volume).sum();
            if volume < THIN_PART * edges.product() {
                continue;
            }
            let legendre = Legendre::new(&all, degree);
            let before = legendre.moments(&all, &gaps);
            let missed = (legendre.moments(&[], &few) - &before).amax();
            let positive = few.iter().all(|point| point.volume > 0.0) && few.len() <= legendre.count();
            assert!(positive && missed <= 1e-12 * before[0], "{degree}, {boxes}, {i:?}: {missed} of {}", before[0]);
        }
    }

    /// The surface cuts cells in all ways, and some parts are thin.
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

    /// ∫ y³ z² dA and the like over every box of a face, part of which is cut off.
    #[test]
    fn points_of_a_face_integrate_products_of_cubics() {
        let block: Shape<3> = Block { min: Vector::repeat(0.0), max: Vector::from([1.0, 0.9, 0.7]) }.into();
        for i in indices([1, 2, 2]) {
            let lower = Vector::from([0.5, 0.5 * i[1] as f64, 0.5 * i[2] as f64]);
            let points = block.surface_points(None, &GridBox { lower, edges: Vector::repeat(0.5), spacing: 1.0 });
            let face: Vec<_> = points.iter().filter(|point| point.normal[0] > 0.5).collect();
            for powers in indices([4, 4]) {
                let sum: f64 = face
                    .iter()
                    .map(|at| at.area * (1..3).map(|k| at.position[k].powi(powers[k - 1] as i32)).product::<f64>())
                    .sum();
                let along = |k: usize| {
                    let (from, to) = (lower[k], (lower[k] + 0.5).min([1.0, 0.9, 0.7][k]));
                    let power = powers[k - 1] as i32 + 1;
                    (to.powi(power) - from.powi(power)) / f64::from(power)
                };
                let exact = along(1) * along(2);
                assert!((sum / exact - 1.0).abs() < 1e-12, "{i:?}, {powers:?}: {sum} {exact}");
            }
        }
    }

    /// Solids are mirrored in every direction: a symmetric problem stays symmetric under loads.
    #[test]
    fn mirrored_solids_have_mirrored_points() {
        let cube = GridBox { lower: Vector::zeros(), edges: Vector::repeat(1.0), spacing: 1.0 };
        let center = Vector::from([0.1, -0.2, 0.3]);
        let points = |mirror: [u64; 3]| {
            let seen = |x: &Vector<f64, 3>| Vector::from_fn(|k, _| if mirror[k] > 0 { 1.0 - x[k] } else { x[k] });
            let ball: Shape<3> = Ball { center: seen(&center), radius: 0.9 }.into();
            let points = ball.quadrature(&cube, 3, 1).unwrap();
            points.into_iter().map(|point| (seen(&point.position), point.volume)).collect::<Vec<_>>()
        };
        let first = points([0; 3]);
        assert!(first.len() > 32);
        for mirror in indices([2; 3]) {
            let mirrored = points(mirror);
            assert_eq!(mirrored.len(), first.len());
            for ((x, volume), (other, same)) in first.iter().zip(&mirrored) {
                assert!((x - other).norm() < 1e-12 && (volume - same).abs() < 1e-12, "{mirror:?}: {x} {other}");
            }
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
        let points =
            lowers.flat_map(|lower| shape.quadrature(&GridBox { lower, edges, spacing: edges[0] }, 3, 2).unwrap());
        points.map(|point| point.volume * f(&point.position)).sum()
    }

    /// ∫ (e·(x − c))² dV = V a²/12 along an edge e of length a, and ∫ x² y² dV = 4π R⁷/105 in a ball: nothing is lost between planes. Parts
    /// that `fill` joins to neighbours keep their own position here.
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

    /// Planes of one side of a thin shell are not mistaken for planes of the other side. The shells are a tenth and a thirtieth of a box
    /// thick.
    #[test]
    fn thin_shells_have_their_volume() {
        let ball = |radius| Shape::from(Ball { center: Vector::from([0.51, 0.48, 0.53]), radius });
        for thickness in [0.02, 0.006] {
            let shell = Difference { of: Box::new(ball(0.45)), minus: Box::new(ball(0.45 - thickness)) };
            let exact = 4.0 / 3.0 * std::f64::consts::PI * (0.45_f64.powi(3) - (0.45 - thickness).powi(3));
            let error = sums(&shell.into(), 5, |_| 1.0) / exact - 1.0;
            assert!(error.abs() < 1e-4, "{thickness}: {error:e}");
        }
    }
}
