//! Cut cells: the volume and the centroid of the part of a box in a solid, and the surface in the box. A box is halved until the surface in
//! it is nearly flat. Planes then cut the box into simplices, exactly.

use super::{Face, GridBox, Shape, axis};
use crate::tensor::{Tensor, Vector, determinant};

/// The largest distance between a surface and the planes that approximate it, relative to the spacing. A ball two spacings in radius is
/// then filled to about 1e-4. Solids with flat faces are cut exactly.
const FLAT: f64 = 1e-3;

/// Largest number of planes in one box: each plane may double the number of simplices.
const MAX_PLANES: usize = 6;

/// Two pieces of surface in a box count as one side if the cosine of the angle between their normals exceeds this.
const SAME_SIDE: f64 = 0.9;

/// The smallest distance between two sides of a thin part, relative to the departure of the surface from its planes.
const SIDES_APART: f64 = 8.0;

/// A piece of surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet<const D: usize> {
    /// The centroid of the piece.
    pub position: Vector<f64, D>,
    /// The mean of the outward unit normals, so that area times normal is ∫ n dA. On a curved piece the mean is shorter than 1.
    pub normal: Vector<f64, D>,
    /// The area of the piece (a length in 2D, 1 in 1D).
    pub area: f64,
    /// The mean of (x − position) ⊗ (x − position) over the piece.
    pub spread: Tensor<f64, D>,
    /// The mean of (x − position) ⊗ n over the piece; not zero if the piece is curved.
    pub turn: Tensor<f64, D>,
}

impl<const D: usize> Facet<D> {
    /// The facet on the simplex with these D corners.
    pub(super) fn flat(corners: &[Vector<f64, D>], normal: Vector<f64, D>, area: f64) -> Self {
        let position = corners.iter().sum::<Vector<f64, D>>() / D as f64;
        let squares = corners.iter().map(|x| (x - position) * (x - position).transpose()).sum::<Tensor<f64, D>>();
        Self { position, normal, area, spread: squares / (D * (D + 1)) as f64, turn: Tensor::zeros() }
    }

    /// Adds the corners of simplices of the same area in the plane of the facet: a point, a segment, or the two triangles of a square.
    fn add_square(&self, corners: &mut Vec<Vector<f64, D>>) {
        let normal = self.normal.normalize();
        let half = if D == 3 { 0.5 * self.area.sqrt() } else { 0.5 * self.area };
        // Tangents: the axes without their part along the normal, the one nearest to the normal left out.
        let others = (0..D).filter(|&k| k != normal.iamax());
        let axes: Vec<Vector<f64, D>> = others.map(|k| axis(k, 1.0) - normal * normal[k]).collect();
        let at = |shares: &[f64]| {
            axes.iter().zip(shares).fold(self.position, |x, (axis, share)| x + axis.normalize() * (half * share))
        };
        let of_square: &[[f64; 2]] = match D {
            1 => &[[0.0, 0.0]],
            2 => &[[-1.0, 0.0], [1.0, 0.0]],
            _ => &[[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]],
        };
        corners.extend(of_square.iter().map(|shares| at(shares)));
    }

    /// The union of two facets.
    fn and(&self, other: &Self) -> Self {
        let area = self.area + other.area;
        let share = other.area / area;
        let (by, turned) = (other.position - self.position, other.normal - self.normal);
        let mean = |a: Tensor<f64, D>, b: Tensor<f64, D>, apart: Vector<f64, D>| {
            a * (1.0 - share) + b * share + by * apart.transpose() * (share * (1.0 - share))
        };
        Self {
            position: self.position + by * share,
            normal: self.normal + turned * share,
            area,
            spread: mean(self.spread, other.spread, by),
            turn: mean(self.turn, other.turn, turned),
        }
    }
}

/// A convex piece of a box that lies in the solid.
pub(super) struct Piece<const D: usize> {
    pub volume: f64,
    pub centroid: Vector<f64, D>,
    pub extent: Extent<D>,
}

/// The geometry of a piece.
pub(super) enum Extent<const D: usize> {
    /// A box with these edges, which may be negative.
    Box(Vector<f64, D>),
    /// A simplex that the surface may bound.
    Simplex(Simplex<D>),
}

/// A simplex of D corners in a plane that approximates the surface of the solid.
pub(super) struct End<const D: usize> {
    pub corners: Vec<Vector<f64, D>>,
    pub outward: Vector<f64, D>,
    pub area: f64,
    /// The largest distance of the surface from the simplex.
    pub departure: f64,
}

/// A simplex with corners 0 … D; further entries are unused.
pub(super) type Simplex<const D: usize> = [Vector<f64, D>; 4];

/// The planes that cut a box, relative to the centre of the box, and the largest distance of the surface from the planes.
pub(super) struct Cut<const D: usize> {
    center: Vector<f64, D>,
    planes: Vec<Face<D>>,
    departure: f64,
}

impl<const D: usize> Cut<D> {
    /// The signed distance of a point from one of the planes.
    fn distance(&self, plane: &Face<D>, x: &Vector<f64, D>) -> f64 {
        plane.0 + plane.1.dot(&(x - self.center))
    }

    /// The simplices of a box, cut by all planes.
    fn simplices(&self, of: &GridBox<D>) -> Vec<Simplex<D>> {
        let mut simplices = simplices_of_box(of);
        for plane in &self.planes {
            let mut parts = Vec::new();
            for simplex in simplices {
                split(simplex, &|x| self.distance(plane, x), of.round_off(), &mut parts);
            }
            simplices = parts;
        }
        simplices
    }
}

impl<const D: usize> Shape<D> {
    /// The volume and the centroid of the part of the solid in a box. If all faces are flat, the result is exact up to round-off. Otherwise
    /// the error across the surface is about 1e-3 spacings.
    ///
    /// ```
    /// use bfree::shape::{GridBox, HalfSpace, Shape};
    /// use bfree::tensor::Vector;
    ///
    /// // Half of a square, a triangle.
    /// let below = Shape::from(HalfSpace { point: Vector::zeros(), normal: Vector::from([1.0, 1.0]) });
    /// let square = GridBox { lower: Vector::from([-3.0, 0.0]), edges: Vector::from([3.0, 3.0]), spacing: 1.0 };
    /// let (volume, centroid) = below.part(&square);
    /// assert!((volume - 4.5).abs() < 1e-14 && (centroid - Vector::from([-2.0, 1.0])).norm() < 1e-14);
    /// ```
    pub fn part(&self, of: &GridBox<D>) -> (f64, Vector<f64, D>) {
        if let Some([part]) = self.solid().row(of, 1).as_deref() {
            return *part;
        }
        let (center, radius) = of.around();
        if let Some((part, outside)) = self.solid().alone(&center, radius) {
            let (volume, centroid) = part.part(of);
            if !outside {
                return (volume, centroid);
            }
            let rest = of.edges.product() - volume;
            return (rest.max(0.0), if rest > 0.0 { center + (center - centroid) * (volume / rest) } else { center });
        }
        let (mut volume, mut moment) = (0.0, Vector::zeros());
        self.pieces(None, of, FLAT, &mut |piece, _| {
            volume += piece.volume;
            moment += piece.centroid * piece.volume;
        });
        (volume, if volume > 0.0 { moment / volume } else { center })
    }

    /// The surface in a box, and in `region` if given: one facet for each side of the solid there. Errors are those of [`Self::part`].
    ///
    /// ```
    /// use bfree::shape::{Ball, GridBox, Shape};
    /// use bfree::tensor::Vector;
    ///
    /// // Half of a circle. Its normals sum up to that of its diameter.
    /// let disc = Shape::from(Ball { center: Vector::zeros(), radius: 1.0 });
    /// let right = GridBox { lower: Vector::from([0.0, -2.0]), edges: Vector::from([2.0, 4.0]), spacing: 0.5 };
    /// let facets = disc.facets(None, &right);
    /// let arc: f64 = facets.iter().map(|facet| facet.area).sum();
    /// assert!((arc / std::f64::consts::PI - 1.0).abs() < 1e-3);
    /// let normal: Vector<f64, 2> = facets.iter().map(|facet| facet.normal * facet.area).sum();
    /// assert!((normal - Vector::from([2.0, 0.0])).norm() < 2e-3);
    /// ```
    pub fn facets(&self, region: Option<&Self>, of: &GridBox<D>) -> Vec<Facet<D>> {
        self.sides(region, of, FLAT)
    }

    /// The facets of [`Self::facets`], with the tolerance `flat` in place of 1e-3.
    pub(super) fn sides(&self, region: Option<&Self>, of: &GridBox<D>, flat: f64) -> Vec<Facet<D>> {
        let (center, radius) = of.around();
        if let Some((part, outside)) = self.solid().alone(&center, radius) {
            let mut facets = part.sides(region, of, flat);
            for facet in facets.iter_mut().filter(|_| outside) {
                (facet.normal, facet.turn) = (-facet.normal, -facet.turn);
            }
            return facets;
        }
        let mut sides: Vec<Facet<D>> = Vec::new();
        let mut add = |facet: Facet<D>, departure: f64| {
            let slack = departure + of.round_off();
            if region.is_some_and(|region| region.signed_distance(&facet.position) > slack) {
                return;
            }
            let side = |side: &&mut Facet<D>| side.normal.dot(&facet.normal) > SAME_SIDE * side.normal.norm();
            match sides.iter_mut().find(side) {
                Some(side) => *side = side.and(&facet),
                None => sides.push(facet),
            }
        };
        let mut planes = Vec::new();
        region.inspect(|region| _ = region.solid().add_planes(&center, radius, &mut planes));
        if let Some(facets) = self.solid().facets(of, &planes) {
            facets.into_iter().for_each(|facet| add(facet, 0.0));
            return sides;
        }
        self.pieces(region, of, flat, &mut |piece, cut| {
            for end in self.ends(&piece, cut, of.round_off()) {
                add(Facet::flat(&end.corners, end.outward, end.area), end.departure);
            }
        });
        sides
    }

    /// Adds the corners of simplices that approximate the surface in a box, D corners each. A surface of triangles or pixels has squares or
    /// segments of the size and direction of its facets.
    pub(crate) fn add_surface(&self, of: &GridBox<D>, flat: f64, corners: &mut Vec<Vector<f64, D>>) {
        let (center, radius) = of.around();
        if let Some((part, _)) = self.solid().alone(&center, radius) {
            part.add_surface(of, flat, corners);
        } else if let Some(facets) = self.solid().facets(of, &[]) {
            facets.iter().for_each(|facet| facet.add_square(corners));
        } else {
            self.pieces(None, of, flat, &mut |piece, cut| {
                corners.extend(self.ends(&piece, cut, of.round_off()).into_iter().flat_map(|end| end.corners));
            });
        }
    }

    /// The sides of a piece that lie on the surface of the solid.
    pub(super) fn ends(&self, piece: &Piece<D>, cut: Option<&Cut<D>>, round_off: f64) -> Vec<End<D>> {
        let (Extent::Simplex(simplex), Some(cut)) = (&piece.extent, cut) else { return Vec::new() };
        (0..=D).filter_map(|apex| self.end(simplex, apex, piece.volume, cut, round_off)).collect()
    }

    /// The side of a simplex opposite the corner `apex`, if this side lies on the surface of the solid.
    fn end(&self, simplex: &Simplex<D>, apex: usize, volume: f64, cut: &Cut<D>, round_off: f64) -> Option<End<D>> {
        let mut corners = simplex[..=D].to_vec();
        corners.swap_remove(apex);
        let height = |plane: &Face<D>| cut.distance(plane, &simplex[apex]);
        let lies_in = |plane: &&Face<D>| {
            height(plane).abs() > round_off && corners.iter().all(|x| cut.distance(plane, x).abs() <= round_off)
        };
        let plane = cut.planes.iter().find(lies_in)?;
        let outward = plane.1 * -height(plane).signum();
        // V = A height / D
        let area = D as f64 * volume / height(plane).abs();
        let middle = corners.iter().sum::<Vector<f64, D>>() / D as f64;
        // A point past the plane, and past planes that count as equal to it, but not past the next plane.
        let beyond = middle + outward * (2.0 * cut.departure + 8.0 * round_off);
        (!self.contains(&beyond)).then_some(End { corners, outward, area, departure: cut.departure })
    }

    /// Whether a piece with the centroid `x` lies in the solid. Near a curved surface, the plane that approximates the surface decides.
    fn holds_by(&self, cut: &Cut<D>, x: &Vector<f64, D>) -> bool {
        let (distance, normal) = self.distance_and_normal(x);
        let along = |plane: &&Face<D>| plane.1.dot(&normal);
        // A plane is near if its distance from `x` is at most twice the departure of the surface.
        let near = |plane: &&Face<D>| cut.distance(plane, x).abs() <= 2.0 * cut.departure;
        let nearest = cut.planes.iter().filter(near).max_by(|a, b| along(a).abs().total_cmp(&along(b).abs()));
        match nearest {
            Some(plane) if distance.abs() <= cut.departure => cut.distance(plane, x) * along(&plane) <= 0.0,
            _ => distance <= 0.0,
        }
    }

    /// Visits the convex pieces of the intersection of a box and the solid, with the planes that cut them. The planes of `region` cut the
    /// pieces once more. Edges may be negative; the box then lies below its corner `lower`.
    pub(super) fn pieces(
        &self,
        region: Option<&Self>,
        of: &GridBox<D>,
        flat: f64,
        visit: &mut dyn FnMut(Piece<D>, Option<&Cut<D>>),
    ) {
        let (center, radius) = of.around();
        let distance = self.signed_distance(&center);
        if distance >= radius {
            return;
        }
        if distance <= -radius {
            visit(Piece { volume: of.edges.product().abs(), centroid: center, extent: Extent::Box(of.edges) }, None);
            return;
        }
        let mut planes = Vec::new();
        let mut departure: f64 = 0.0;
        for shape in std::iter::once(self).chain(region) {
            departure = departure.max(shape.solid().add_planes(&center, radius, &mut planes));
        }
        let mut planes = distinct(planes, radius, of.round_off());
        // Images of a solid may give their planes in another order.
        planes.sort_by(|(one, _), (other, _)| one.total_cmp(other));
        let is_flat =
            departure <= flat * of.spacing && !may_be_confused(&planes, departure) && planes.len() <= MAX_PLANES;
        mutant!("solids: a curved surface by one plane a box": is_flat = planes.len() <= MAX_PLANES);
        if !is_flat && radius > flat * of.spacing {
            return of.halves().for_each(|half| self.pieces(region, &half, flat, visit));
        }
        let cut = Cut { center, planes, departure: departure.min(2.0 * radius) };
        for simplex in cut.simplices(of) {
            let volume = volume(&simplex);
            let centroid = simplex[..=D].iter().sum::<Vector<f64, D>>() / (D + 1) as f64;
            if volume > 0.0 && self.holds_by(&cut, &centroid) {
                visit(Piece { volume, centroid, extent: Extent::Simplex(simplex) }, Some(&cut));
            }
        }
    }
}

/// The planes without repetitions. Two planes are equal if their distance is at most `round_off` everywhere within `radius`.
fn distinct<const D: usize>(planes: Vec<Face<D>>, radius: f64, round_off: f64) -> Vec<Face<D>> {
    let equal = |a: &Face<D>, b: &Face<D>| {
        let along = a.1.dot(&b.1).signum();
        (a.1 - b.1 * along).norm() * radius + (a.0 - b.0 * along).abs() <= round_off
    };
    let mut distinct: Vec<Face<D>> = Vec::new();
    for plane in planes {
        if !distinct.iter().any(|other| equal(other, &plane)) {
            distinct.push(plane);
        }
    }
    distinct
}

/// Whether two planes may be mistaken for each other: the two sides of a thin part, whose distance is not much larger than the departure of
/// the surface.
fn may_be_confused<const D: usize>(planes: &[Face<D>], departure: f64) -> bool {
    let close = |a: &Face<D>, b: &Face<D>| {
        let along = a.1.dot(&b.1);
        along.abs() > SAME_SIDE && (a.0 - b.0 * along.signum()).abs() < SIDES_APART * departure
    };
    planes.iter().enumerate().any(|(i, a)| planes[..i].iter().any(|b| close(a, b)))
}

/// The D! simplices of a box (Kuhn). Each simplex leads from the lower corner to the upper corner, one axis at a time.
fn simplices_of_box<const D: usize>(of: &GridBox<D>) -> Vec<Simplex<D>> {
    let orders: &[[usize; 3]] = match D {
        1 => &[[0, 0, 0]],
        2 => &[[0, 1, 0], [1, 0, 0]],
        _ => &[[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]],
    };
    let walk = |order: &[usize; 3]| {
        let mut simplex = [of.lower; 4];
        for i in 0..D {
            simplex[i + 1] = simplex[i];
            simplex[i + 1][order[i]] += of.edges[order[i]];
        }
        simplex
    };
    orders.iter().map(walk).collect()
}

/// Cuts a simplex at the zeros of an affine function, edge after edge.
fn split<const D: usize>(
    simplex: Simplex<D>,
    f: &impl Fn(&Vector<f64, D>) -> f64,
    round_off: f64,
    parts: &mut Vec<Simplex<D>>,
) {
    let corners = &simplex[..=D];
    let values: Vec<f64> = corners.iter().map(f).collect();
    let of_sign = |sign: f64| values.iter().position(|value| value * sign > round_off);
    let (Some(i), Some(k)) = (of_sign(-1.0), of_sign(1.0)) else {
        parts.push(simplex);
        return;
    };
    let zero = corners[i] + (corners[k] - corners[i]) * (values[i] / (values[i] - values[k]));
    for replaced in [i, k] {
        let mut part = simplex;
        part[replaced] = zero;
        split(part, f, round_off, parts);
    }
}

/// |det (x₁ − x₀, …)| / D!
fn volume<const D: usize>(simplex: &Simplex<D>) -> f64 {
    let edges = Tensor::<f64, D>::from_fn(|i, k| simplex[k + 1][i] - simplex[0][i]);
    determinant(&edges).abs() / [1.0, 1.0, 2.0, 6.0][D.min(3)]
}
