//! Solid geometry by signed distances, and its filling with particles.

use crate::grid::{Grid, indices};
use crate::tensor::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The largest number of particle positions that [`fill`] looks at for one body.
pub const MAX_CANDIDATES: f64 = 134_217_728.0; // 2²⁷

/// A solid of `D` dimensions. All lengths are in the user's unit.
///
/// The signed distance d is negative inside. It is the Euclidean distance for the three primitives; for combinations the
/// min or max of the parts', which has the right sign and the right zero set, and never exceeds the distance in size
/// where it is positive.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape<const D: usize> {
    /// An axis-parallel box.
    Box {
        /// The lower corner.
        min: Vector<f64, D>,
        /// The upper corner, above `min` in every component.
        max: Vector<f64, D>,
    },
    /// An interval, a disc or a ball.
    Ball {
        /// The centre.
        center: Vector<f64, D>,
        /// The radius, > 0.
        radius: f64,
    },
    /// Everything behind a plane.
    HalfSpace {
        /// A point of the plane.
        point: Vector<f64, D>,
        /// The outward normal, of any length but zero.
        normal: Vector<f64, D>,
    },
    /// What lies in any of the parts.
    Union(Vec<Shape<D>>),
    /// What lies in `of` and not in `minus`.
    Difference {
        /// The solid.
        of: Box<Shape<D>>,
        /// The hole.
        minus: Box<Shape<D>>,
    },
    /// What lies in all of the parts.
    Intersection(Vec<Shape<D>>),
}

impl<const D: usize> Shape<D> {
    /// Whether `x` lies in the solid, its surface included.
    ///
    /// ```
    /// use bfree::shape::Shape;
    /// use bfree::tensor::Vector;
    ///
    /// // A ring: its inner circle is part of its surface, its centre is not part of it.
    /// let disc = |radius| Box::new(Shape::Ball { center: Vector::from([0.0, 0.0]), radius });
    /// let ring = Shape::Difference { of: disc(2.0), minus: disc(1.0) };
    /// assert!(ring.contains(&Vector::from([1.5, 0.0])) && ring.contains(&Vector::from([0.0, 1.0])));
    /// assert!(!ring.contains(&Vector::from([0.0, 0.0])));
    /// ```
    pub fn contains(&self, x: &Vector<f64, D>) -> bool {
        self.signed_distance(x) <= 0.0
    }

    /// The signed distance d of `x` from the surface, negative inside; +∞ for an empty union, −∞ for an empty intersection.
    ///
    /// ```
    /// use bfree::shape::Shape;
    /// use bfree::tensor::Vector;
    ///
    /// let disc = Shape::Ball { center: Vector::from([0.0, 0.0]), radius: 5.0 };
    /// assert_eq!(disc.signed_distance(&Vector::from([3.0, 4.0])), 0.0);
    /// assert_eq!(disc.signed_distance(&Vector::from([6.0, 8.0])), 5.0);
    /// assert_eq!(disc.normal(&Vector::from([6.0, 8.0])), Vector::from([0.6, 0.8]));
    /// ```
    pub fn signed_distance(&self, x: &Vector<f64, D>) -> f64 {
        self.distance_and_normal(x).0
    }

    /// The outward unit normal ∇d of the surface nearest to `x`; at a hole it points into the hole.
    ///
    /// Where ∇d does not exist (the centre of a ball, points equally near to two faces) it is the normal of one of the
    /// nearest surfaces.
    ///
    /// ```
    /// use bfree::shape::Shape;
    /// use bfree::tensor::Vector;
    ///
    /// let hole = Box::new(Shape::Ball { center: Vector::from([0.0, 0.0]), radius: 1.0 });
    /// let plate = Box::new(Shape::Box { min: Vector::from([-2.0, -2.0]), max: Vector::from([2.0, 2.0]) });
    /// let plate = Shape::Difference { of: plate, minus: hole };
    /// assert_eq!(plate.normal(&Vector::from([0.0, 1.9])), Vector::from([0.0, 1.0]));
    /// assert_eq!(plate.normal(&Vector::from([0.0, 1.1])), Vector::from([0.0, -1.0]));
    /// ```
    pub fn normal(&self, x: &Vector<f64, D>) -> Vector<f64, D> {
        self.distance_and_normal(x).1
    }

    /// d and ∇d together.
    ///
    /// ```
    /// use bfree::shape::Shape;
    /// use bfree::tensor::Vector;
    ///
    /// // x − d ∇d is the nearest point of the surface.
    /// let disc = Shape::Ball { center: Vector::from([1.0, 0.0]), radius: 5.0 };
    /// let x = Vector::from([4.0, 4.0]);
    /// let (d, n) = disc.distance_and_normal(&(x + Vector::from([3.0, 4.0])));
    /// assert_eq!((d, n), (5.0, Vector::from([0.6, 0.8])));
    /// assert_eq!(disc.signed_distance(&x), 0.0);
    /// ```
    pub fn distance_and_normal(&self, x: &Vector<f64, D>) -> (f64, Vector<f64, D>) {
        match self {
            Self::Box { min, max } => box_distance(x, min, max),
            // d = |x − c| − r,  ∇d = (x − c)/|x − c|
            Self::Ball { center, radius } => {
                let from_center = x - center;
                let length = from_center.norm();
                let normal = if length > 0.0 { from_center / length } else { axis(0, 1.0) };
                (length - radius, normal)
            }
            // d = (x − p)·n
            Self::HalfSpace { point, normal } => {
                let n = normal / normal.norm();
                ((x - point).dot(&n), n)
            }
            Self::Union(parts) => parts
                .iter()
                .map(|part| part.distance_and_normal(x))
                .fold((f64::INFINITY, axis(0, 1.0)), |a, b| if b.0 < a.0 { b } else { a }),
            Self::Intersection(parts) => parts
                .iter()
                .map(|part| part.distance_and_normal(x))
                .fold((f64::NEG_INFINITY, axis(0, 1.0)), |a, b| if b.0 > a.0 { b } else { a }),
            // d = max(d_of, −d_minus)
            Self::Difference { of, minus } => {
                let solid = of.distance_and_normal(x);
                let hole = minus.distance_and_normal(x);
                if solid.0 >= -hole.0 { solid } else { (-hole.0, -hole.1) }
            }
        }
    }

    /// The pieces of surface that a point `x` of the solid lies less than `depth` below: none deep inside, one below a face,
    /// several in an edge or a corner. Each with its signed distance −`depth` < d ≤ 0 and its outward unit normal n; the foot
    /// x − d n lies on the surface.
    ///
    /// ```
    /// use bfree::shape::Shape;
    /// use bfree::tensor::Vector;
    ///
    /// let square = Shape::Box { min: Vector::from([0.0, 0.0]), max: Vector::from([1.0, 1.0]) };
    /// assert_eq!(square.faces(&Vector::from([0.5, 0.5]), 0.25), []);
    /// assert_eq!(square.faces(&Vector::from([0.5, 0.875]), 0.25), [(-0.125, Vector::from([0.0, 1.0]))]);
    /// // A particle in a corner stands for a piece of both faces.
    /// assert_eq!(square.faces(&Vector::from([0.875, 0.875]), 0.25).len(), 2);
    /// ```
    pub fn faces(&self, x: &Vector<f64, D>, depth: f64) -> Vec<(f64, Vector<f64, D>)> {
        let mut candidates = Vec::new();
        self.primitive_faces(x, 1.0, &mut candidates);
        let hair = 1e-6 * depth;
        let mut faces: Vec<(f64, Vector<f64, D>)> = Vec::new();
        for (d, n) in candidates {
            if d > hair || d <= -depth * (1.0 - 1e-9) {
                continue;
            }
            let foot = x - n * d;
            // A face of a part counts where the whole ends: not inside another part, nor where two parts touch.
            let ends = !self.contains(&(foot + n * hair)) && self.contains(&(foot - n * hair));
            // Parts may share a face.
            let known = faces.iter().any(|(e, m)| (e - d).abs() <= hair && (m - n).norm() <= 1e-6);
            if ends && !known {
                faces.push((d.min(0.0), n));
            }
        }
        faces
    }

    /// Signed distance and outward normal of every face of every primitive, as if each face were unbounded; `sign` is −1 in a hole.
    fn primitive_faces(&self, x: &Vector<f64, D>, sign: f64, faces: &mut Vec<(f64, Vector<f64, D>)>) {
        match self {
            Self::Box { min, max } => {
                for k in 0..D {
                    faces.push((sign * (min[k] - x[k]), axis(k, -sign)));
                    faces.push((sign * (x[k] - max[k]), axis(k, sign)));
                }
            }
            Self::Ball { .. } | Self::HalfSpace { .. } => {
                let (d, n) = self.distance_and_normal(x);
                faces.push((sign * d, n * sign));
            }
            Self::Union(parts) | Self::Intersection(parts) => {
                parts.iter().for_each(|part| part.primitive_faces(x, sign, faces));
            }
            Self::Difference { of, minus } => {
                of.primitive_faces(x, sign, faces);
                minus.primitive_faces(x, -sign, faces);
            }
        }
    }

    /// A box `(min, max)` that holds the solid: infinite for half-spaces, with `min > max` where nothing is left.
    ///
    /// Tight for the primitives (for a half-space if its plane is axis-parallel), for unions of them, and an upper bound for
    /// differences and intersections.
    ///
    /// ```
    /// use bfree::shape::Shape;
    /// use bfree::tensor::Vector;
    ///
    /// // The lower half of a disc; for an intersection the bound is that of the planes and balls in it.
    /// let disc = Shape::Ball { center: Vector::from([0.0, 0.0]), radius: 1.0 };
    /// let below = Shape::HalfSpace { point: Vector::from([0.0, 0.0]), normal: Vector::from([0.0, 3.0]) };
    /// let half = Shape::Intersection(vec![disc, below]);
    /// assert_eq!(half.bounding_box(), (Vector::from([-1.0, -1.0]), Vector::from([1.0, 0.0])));
    /// ```
    pub fn bounding_box(&self) -> (Vector<f64, D>, Vector<f64, D>) {
        let everywhere = (Vector::repeat(f64::NEG_INFINITY), Vector::repeat(f64::INFINITY));
        let nowhere = (Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY));
        match self {
            Self::Box { min, max } => (*min, *max),
            Self::Ball { center, radius } => (center.add_scalar(-radius), center.add_scalar(*radius)),
            Self::HalfSpace { point, normal } => {
                let (mut min, mut max) = everywhere;
                for k in 0..D {
                    let parallel = (0..D).all(|i| i == k || normal[i] == 0.0);
                    if parallel && normal[k] > 0.0 {
                        max[k] = point[k];
                    } else if parallel && normal[k] < 0.0 {
                        min[k] = point[k];
                    }
                }
                (min, max)
            }
            Self::Union(parts) => parts
                .iter()
                .map(Self::bounding_box)
                .fold(nowhere, |(a_min, a_max), (b_min, b_max)| (a_min.inf(&b_min), a_max.sup(&b_max))),
            Self::Intersection(parts) => parts
                .iter()
                .map(Self::bounding_box)
                .fold(everywhere, |(a_min, a_max), (b_min, b_max)| (a_min.sup(&b_min), a_max.inf(&b_max))),
            Self::Difference { of, .. } => of.bounding_box(),
        }
    }
}

/// ± e_k
fn axis<const D: usize>(k: usize, sign: f64) -> Vector<f64, D> {
    Vector::from_fn(|i, _| if i == k { sign } else { 0.0 })
}

/// With q_k the signed distance from the slab of axis k: d = |max(q, 0)| outside, max_k q_k inside.
fn box_distance<const D: usize>(
    x: &Vector<f64, D>,
    min: &Vector<f64, D>,
    max: &Vector<f64, D>,
) -> (f64, Vector<f64, D>) {
    let (mut outside, mut nearest) = (Vector::<f64, D>::zeros(), (f64::NEG_INFINITY, axis(0, 1.0)));
    for k in 0..D {
        let (below, above) = (min[k] - x[k], x[k] - max[k]);
        let (q, sign) = if below > above { (below, -1.0) } else { (above, 1.0) };
        if q > 0.0 {
            outside[k] = sign * q;
        }
        if q > nearest.0 {
            nearest = (q, axis(k, sign));
        }
    }
    let distance = outside.norm();
    if distance > 0.0 { (distance, outside / distance) } else { nearest }
}

/// Which of the regular positions become particles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fill {
    /// Those that lie in the shape.
    #[default]
    Particles,
    /// Those of all cells whose centre lies in the shape.
    Cells,
}

/// A shape that cannot be filled.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FillError {
    /// The box around the shape holds more positions than [`MAX_CANDIDATES`].
    #[error(
        "the box around the shape holds {candidates:e} particle positions; at most {MAX_CANDIDATES:e} are allowed: \
         use a coarser grid or fewer particles per cell"
    )]
    TooMany {
        /// Cells of the box times particles per cell.
        candidates: f64,
    },
    /// No position lies in the shape.
    #[error(
        "none of the {candidates} particle positions of the cells around the shape lies in it: \
         it is smaller than a cell, or outside the grid"
    )]
    Empty {
        /// Positions that were looked at.
        candidates: u64,
    },
}

/// Fills `shape` with particles at the regular sub-cell centres, (i + ½) h / `per_axis` from the lower corner of each cell.
///
/// Shapes are clipped to the grid. Only cells that overlap the shape's bounding box are visited; cell by cell and within a
/// cell, the first axis runs fastest. Every particle stands for the volume (h / `per_axis`)^D.
///
/// ```
/// use bfree::grid::Grid;
/// use bfree::shape::{Fill, Shape, fill};
/// use bfree::tensor::Vector;
///
/// let grid = Grid { origin: Vector::from([0.0, 0.0]), spacing: 0.5, cells: [4, 4] };
/// let square = Shape::Box { min: Vector::from([0.5, 0.5]), max: Vector::from([1.5, 1.5]) };
/// let particles = fill(&grid, &square, 2, Fill::Particles)?;
/// assert_eq!((particles.len(), particles[0]), (16, Vector::from([0.625, 0.625])));
/// # Ok::<(), bfree::shape::FillError>(())
/// ```
///
/// # Errors
/// More than [`MAX_CANDIDATES`] positions to look at (found before anything is allocated), or no particle.
pub fn fill<const D: usize>(
    grid: &Grid<D>,
    shape: &Shape<D>,
    per_axis: u32,
    rule: Fill,
) -> Result<Vec<Vector<f64, D>>, FillError> {
    let h = grid.spacing;
    let (min, max) = shape.bounding_box();
    let (mut first, mut count) = ([0_u64; D], [0_u64; D]);
    for k in 0..D {
        // One cell of margin, so that rounding at a cell face loses nothing; `as` saturates at 0 and at infinity.
        let lower = ((min[k] - grid.origin[k]) / h).floor() - 1.0;
        let upper = ((max[k] - grid.origin[k]) / h).ceil() + 1.0;
        first[k] = lower.max(0.0) as u64;
        count[k] = (upper.min(f64::from(grid.cells[k])) as u64).saturating_sub(first[k]);
    }
    let candidates = count.iter().map(|&n| n as f64 * f64::from(per_axis)).product::<f64>();
    if candidates > MAX_CANDIDATES {
        return Err(FillError::TooMany { candidates });
    }

    let offset = |i: u64| (i as f64 + 0.5) / f64::from(per_axis);
    let mut particles = Vec::new();
    for cell in indices(count) {
        let corner: [f64; D] = std::array::from_fn(|k| (first[k] + cell[k]) as f64);
        let position = |within: Vector<f64, D>| Vector::from_fn(|k, _| grid.origin[k] + (corner[k] + within[k]) * h);
        if rule == Fill::Cells && !shape.contains(&position(Vector::repeat(0.5))) {
            continue;
        }
        for i in indices([u64::from(per_axis); D]) {
            let x = position(Vector::from_fn(|k, _| offset(i[k])));
            if rule == Fill::Cells || shape.contains(&x) {
                particles.push(x);
            }
        }
    }
    if particles.is_empty() { Err(FillError::Empty { candidates: candidates as u64 }) } else { Ok(particles) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vector<const D: usize>(x: [f64; D]) -> Vector<f64, D> {
        Vector::from_column_slice(&x)
    }

    fn ball<const D: usize>(center: [f64; D], radius: f64) -> Shape<D> {
        Shape::Ball { center: vector(center), radius }
    }

    fn block<const D: usize>(min: [f64; D], max: [f64; D]) -> Shape<D> {
        Shape::Box { min: vector(min), max: vector(max) }
    }

    fn solids() -> Vec<Shape<3>> {
        let (a, b) = (block([-1.0, -0.5, -0.25], [1.0, 0.75, 0.5]), ball([0.8, 0.1, 0.2], 0.45));
        let plane = Shape::HalfSpace { point: vector([0.1, 0.2, 0.0]), normal: vector([2.0, -1.0, 0.5]) };
        vec![
            a.clone(),
            b.clone(),
            plane.clone(),
            Shape::Union(vec![a.clone(), b.clone()]),
            Shape::Difference { of: Box::new(a.clone()), minus: Box::new(b) },
            Shape::Intersection(vec![a, plane]),
        ]
    }

    /// Points without any symmetry, in [−1.5, 1.5]³.
    fn points() -> impl Iterator<Item = Vector<f64, 3>> {
        (1..400).map(|i| Vector::from_fn(|k, _| 3.0 * (f64::from(i) * [0.618034, 0.414214, 0.732051][k]).fract() - 1.5))
    }

    #[test]
    fn the_paper_s_disc_has_112_particles() {
        let grid = Grid { origin: vector([0.0, 0.0]), spacing: 0.5, cells: [30, 10] };
        let disc = ball([2.5, 2.5], 1.5);
        // ½ ρ v² V₀ n = 3.5, the energy of the reference, with ρ = 4, v = ½, V₀ = h²/4
        assert_eq!(fill(&grid, &disc, 2, Fill::Particles).unwrap().len(), 112);
        // whole cells: centres at (¼, ¾, 5/4)², all but the four corners of the 6×6 square
        let particles = fill(&grid, &disc, 2, Fill::Cells).unwrap();
        assert_eq!(particles.len(), (36 - 4) * 4);
        // quarter points, the first axis fastest
        assert_eq!(particles[1] - particles[0], vector([0.25, 0.0]));
        assert_eq!(((particles[0][0] / 0.5).fract(), (particles[0][1] / 0.5).fract()), (0.25, 0.25));
    }

    #[test]
    fn a_filled_box_has_its_volume_and_its_center() {
        let grid = Grid { origin: vector([-0.3, 0.2, 0.0]), spacing: 0.1, cells: [10, 12, 9] };
        let shape = block([-0.1, 0.4, 0.2], [0.5, 0.8, 0.5]);
        for rule in [Fill::Particles, Fill::Cells] {
            let particles = fill(&grid, &shape, 3, rule).unwrap();
            assert_eq!(particles.len(), 6 * 4 * 3 * 27, "{rule:?}");
            let center = particles.iter().sum::<Vector<f64, 3>>() / particles.len() as f64;
            assert!((center - vector([0.2, 0.6, 0.35])).norm() < 1e-12);
        }
    }

    #[test]
    fn the_volume_of_a_filled_ball_converges() {
        let shape = ball([0.5, 0.5, 0.5], 0.4);
        let exact = 4.0 / 3.0 * std::f64::consts::PI * 0.4_f64.powi(3);
        for (cells, bound) in [(8, 0.03), (32, 0.003)] {
            let h = 1.0 / f64::from(cells);
            let grid = Grid { origin: vector([0.0; 3]), spacing: h, cells: [cells; 3] };
            let volume = fill(&grid, &shape, 2, Fill::Particles).unwrap().len() as f64 * (h / 2.0).powi(3);
            assert!((volume / exact - 1.0).abs() < bound, "{cells} cells: {volume} against {exact}");
        }
    }

    #[test]
    fn an_unbounded_shape_is_clipped_to_the_grid() {
        let grid = Grid { origin: vector([0.0, 0.0]), spacing: 1.0, cells: [4, 3] };
        let tilted = Shape::HalfSpace { point: vector([0.0, 3.0]), normal: vector([1.0, 1.0]) };
        let particles = fill(&grid, &tilted, 1, Fill::Particles).unwrap();
        // x + y ≤ 3 over the centres (½, ½), (1½, ½), …
        assert_eq!(particles.len(), 6);
    }

    #[test]
    fn too_many_or_no_particles_are_refused() {
        let grid = Grid { origin: vector([0.0; 3]), spacing: 1e-3, cells: [1000; 3] };
        let all = Shape::HalfSpace { point: vector([1.0; 3]), normal: vector([1.0; 3]) };
        assert!(
            matches!(fill(&grid, &all, 2, Fill::Particles), Err(FillError::TooMany { candidates }) if candidates == 8e9)
        );
        for lost in [ball([7.0; 3], 0.1), ball([0.5; 3], 1e-5), Shape::Union(vec![])] {
            assert!(matches!(fill(&grid, &lost, 2, Fill::Particles), Err(FillError::Empty { .. })), "{lost:?}");
        }
    }

    #[test]
    fn the_normal_is_the_unit_gradient_of_the_distance() {
        for shape in solids() {
            for x in points() {
                let (_, n) = shape.distance_and_normal(&x);
                assert!((n.norm() - 1.0).abs() < 1e-14);
                let step = 1e-6;
                let gradient: Vector<f64, 3> = Vector::from_fn(|k, _| {
                    (shape.signed_distance(&(x + axis(k, step))) - shape.signed_distance(&(x - axis(k, step))))
                        / (2.0 * step)
                });
                assert!((gradient - n).norm() < 1e-5, "{shape:?} at {x}: {gradient} against {n}");
            }
        }
    }

    #[test]
    fn the_foot_point_lies_on_the_surface_of_a_primitive() {
        for shape in &solids()[..3] {
            for x in points() {
                let (d, n) = shape.distance_and_normal(&x);
                assert!(shape.signed_distance(&(x - n * d)).abs() < 1e-14, "{shape:?} at {x}");
            }
        }
    }

    #[test]
    fn combinations_are_the_set_operations_and_lie_in_their_bounding_box() {
        let solids = solids();
        let (a, b, plane) = (&solids[0], &solids[1], &solids[2]);
        for x in points() {
            assert_eq!(solids[3].contains(&x), a.contains(&x) || b.contains(&x));
            assert_eq!(solids[4].contains(&x), a.contains(&x) && !b.contains(&x));
            assert_eq!(solids[5].contains(&x), a.contains(&x) && plane.contains(&x));
            for shape in &solids {
                let (min, max) = shape.bounding_box();
                assert!(!shape.contains(&x) || (0..3).all(|k| min[k] <= x[k] && x[k] <= max[k]), "{shape:?} at {x}");
            }
        }
    }

    #[test]
    fn at_a_hole_the_normal_points_into_the_hole() {
        let ring = Shape::Difference { of: Box::new(ball([0.0, 0.0], 2.0)), minus: Box::new(ball([0.0, 0.0], 1.0)) };
        assert!((ring.normal(&vector([1.2, 0.0])) - vector([-1.0, 0.0])).norm() < 1e-15);
        assert!((ring.normal(&vector([0.0, 1.9])) - vector([0.0, 1.0])).norm() < 1e-15);
        assert!((ring.signed_distance(&vector([1.2, 0.0])) + 0.2).abs() < 1e-15);
    }

    #[test]
    fn a_corner_lies_below_all_its_faces_and_an_inner_face_below_none() {
        let unit = block([0.0; 3], [1.0; 3]);
        assert!(unit.faces(&vector([0.5; 3]), 0.1).is_empty());
        assert_eq!(unit.faces(&vector([0.5, 0.98, 0.5]), 0.1), [(0.98 - 1.0, vector([0.0, 1.0, 0.0]))]);
        let edge: Vec<_> = unit.faces(&vector([0.98, 0.02, 0.5]), 0.1).iter().map(|face| face.1).collect();
        assert_eq!(edge, [vector([1.0, 0.0, 0.0]), vector([0.0, -1.0, 0.0])]);
        assert_eq!(unit.faces(&vector([0.02; 3]), 0.1).len(), 3);
        // two blocks that touch at x = 1, and two that overlap: their common bottom counts once, what lies inside not at all
        for other in [block([1.0, 0.0], [2.0, 1.0]), block([0.5, 0.0], [2.0, 1.0])] {
            let long = Shape::Union(vec![block([0.0, 0.0], [1.0, 1.0]), other]);
            assert!(long.faces(&vector([0.99, 0.5]), 0.1).is_empty());
            assert_eq!(long.faces(&vector([0.99, 0.01]), 0.1), [(-0.01, vector([0.0, -1.0]))]);
            assert_eq!(long.faces(&vector([1.99, 0.01]), 0.1).len(), 2);
        }
        // beside a square hole: its faces point into it, and off its corner there is none
        let hole = block([0.4, 0.4], [0.6, 0.6]);
        let frame = Shape::Difference { of: Box::new(block([0.0, 0.0], [1.0, 1.0])), minus: Box::new(hole) };
        assert_eq!(frame.faces(&vector([0.39, 0.5]), 0.1), [(0.39 - 0.4, vector([1.0, 0.0]))]);
        assert!(frame.faces(&vector([0.39, 0.39]), 0.1).is_empty());
    }

    #[test]
    fn an_axis_parallel_half_space_is_bounded_on_its_side() {
        let left: Shape<2> = Shape::HalfSpace { point: vector([0.5, 9.0]), normal: vector([3.0, 0.0]) };
        let (min, max) = left.bounding_box();
        assert_eq!((min[0], max[0], min[1], max[1]), (f64::NEG_INFINITY, 0.5, f64::NEG_INFINITY, f64::INFINITY));
    }
}
