//! Polygons: signed distances from their edges, and the check of outlines.

use super::{Face, Feature, Solid};
use crate::tensor::Vector;

/// Vertices and edges nearer to each other, relative to the size of the polygon, are taken to meet.
const MEETING_DISTANCE: f64 = 1e-9;

/// The inside of closed outlines of straight edges in 2D: mostly one, which need not be convex. Outlines must not meet themselves or each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon<const D: usize> {
    /// The vertices of all outlines, with the inside at the left.
    vertices: Vec<Vector<f64, D>>,
    /// The vertices before and after each vertex.
    beside: Vec<[usize; 2]>,
}

/// An outline that bounds no polygon. Vertices are counted from 0; edge i leads from vertex i to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PolygonError {
    /// The dimension is not 2.
    #[error("a polygon in {0} dimension(s)")]
    Dimension(usize),
    /// Fewer than three vertices.
    #[error("a polygon of {0} vertices")]
    TooFew(usize),
    /// Two vertices at one position, the later one first.
    #[error("vertex {0} at the place of vertex {1}")]
    Repeated(usize, usize),
    /// All vertices on a line.
    #[error("a polygon without area")]
    Flat,
    /// Two edges that cross or touch, the later one first, each by the vertices at its ends.
    #[error("the edge between vertices {} and {} that meets the one between {} and {}", .0[0], .0[1], .1[0], .1[1])]
    Meeting([usize; 2], [usize; 2]),
}

impl PolygonError {
    /// The rules for an outline.
    pub(crate) const ALLOWED: &str = "a polygon of the plane has at least 3 vertices, no two at one place and not all on a line, and \
                               edges that meet at the vertex they share and nowhere else (vertices are counted from 0)";

    /// The vertex to name for this error, if there is one.
    pub(crate) fn vertex(&self) -> Option<usize> {
        match self {
            Self::Dimension(_) | Self::TooFew(_) | Self::Flat => None,
            Self::Repeated(vertex, _) | Self::Meeting([vertex, _], _) => Some(*vertex),
        }
    }
}

/// The part of an outline nearest to a point.
enum OutlinePart {
    Edge(usize),
    Vertex(usize),
}

impl<const D: usize> Polygon<D> {
    /// The polygon of these vertices, in either order; `D` must be 2.
    ///
    /// ```
    /// use bfree::shape::{Polygon, PolygonError, Shape};
    /// use bfree::tensor::Vector;
    ///
    /// // Cook's membrane
    /// let vertices = [[0.0, 0.0], [48.0, 44.0], [48.0, 60.0], [0.0, 44.0]].map(Vector::from);
    /// let membrane = Shape::from(Polygon::new(vertices.to_vec())?);
    /// assert_eq!(membrane.signed_distance(&Vector::from([47.0, 52.0])), -1.0);
    /// // With two vertices exchanged its edges cross.
    /// let [a, b, c, d] = vertices;
    /// assert_eq!(Polygon::new(vec![a, b, d, c]), Err(PolygonError::Meeting([3, 0], [1, 2])));
    /// # Ok::<(), PolygonError>(())
    /// ```
    ///
    /// # Errors
    /// The outline meets itself or bounds nothing. The error names the first such place.
    pub fn new(vertices: Vec<Vector<f64, D>>) -> Result<Self, PolygonError> {
        Self::of_outlines(&[vertices])
    }

    /// The polygon inside several outlines: the inside at the left of all, or at the right of all. Vertices are counted through.
    ///
    /// # Errors
    /// The errors of [`Self::new`].
    pub(crate) fn of_outlines(outlines: &[Vec<Vector<f64, D>>]) -> Result<Self, PolygonError> {
        if D != 2 {
            return Err(PolygonError::Dimension(D));
        }
        if let Some(few) = outlines.iter().find(|outline| outline.len() < 3) {
            return Err(PolygonError::TooFew(few.len()));
        }
        let polygon = Self::joined(outlines);
        let (vertices, n) = (&polygon.vertices, polygon.vertices.len());
        if n == 0 {
            return Err(PolygonError::TooFew(0));
        }
        let from_first = || vertices.iter().map(|x| x - vertices[0]);
        let further =
            |far: Vector<f64, D>, x: Vector<f64, D>| if x.norm_squared() > far.norm_squared() { x } else { far };
        let diameter = from_first().fold(Vector::zeros(), further);
        let tolerance = MEETING_DISTANCE * diameter.norm();
        let pairs = || (0..n).flat_map(|i| (0..i).map(move |k| (i, k)));
        if let Some((i, k)) = pairs().find(|&(i, k)| (vertices[i] - vertices[k]).norm() <= tolerance) {
            return Err(PolygonError::Repeated(i, k));
        }
        if !from_first().any(|x| cross(&diameter, &x).abs() > tolerance * diameter.norm()) {
            return Err(PolygonError::Flat);
        }
        let edge = |i: usize| [i, polygon.beside[i][1]];
        if let Some((i, k)) = pairs().find(|&(i, k)| meet(vertices, edge(i), edge(k), tolerance)) {
            return Err(PolygonError::Meeting(edge(i), edge(k)));
        }
        Ok(polygon.oriented())
    }

    /// The polygon of these outlines, as they are. Nothing is checked.
    pub(super) fn joined(outlines: &[Vec<Vector<f64, D>>]) -> Self {
        let mut beside = Vec::new();
        for n in outlines.iter().map(Vec::len) {
            let first = beside.len();
            beside.extend((0..n).map(|i| [first + (i + n - 1) % n, first + (i + 1) % n]));
        }
        Self { vertices: outlines.concat(), beside }
    }

    /// The polygon, with all outlines reversed if its area is negative.
    pub(super) fn oriented(mut self) -> Self {
        // 2 A = Σ (xᵢ − x₀) × (xᵢ₊₁ − x₀)
        let edges = (0..self.vertices.len()).map(|i| self.edge(i).map(|x| x - self.vertices[0]));
        if edges.map(|[a, b]| cross(&a, &b)).sum::<f64>() < 0.0 {
            let last = self.vertices.len() - 1;
            self.vertices.reverse();
            self.beside = self.beside.iter().rev().map(|[before, after]| [last - after, last - before]).collect();
        }
        self
    }

    /// The ends of edge i.
    fn edge(&self, i: usize) -> [&Vector<f64, D>; 2] {
        [&self.vertices[i], &self.vertices[self.beside[i][1]]]
    }

    /// The outward normal of edge i.
    fn normal(&self, i: usize) -> Vector<f64, D> {
        let [a, b] = self.edge(i);
        let along = (b - a) / (b - a).norm();
        Vector::from_fn(|k, _| if k == 0 { along[1] } else { -along[0] })
    }

    fn nearest_part(&self, x: &Vector<f64, D>) -> OutlinePart {
        let (mut squared, mut nearest) = (f64::INFINITY, (0, 0.0));
        for i in 0..self.vertices.len() {
            let (t, foot) = foot(x, self.edge(i));
            let s = (x - foot).norm_squared();
            if s < squared {
                (squared, nearest) = (s, (i, t));
            }
        }
        match nearest {
            (i, t) if t > 0.0 && t < 1.0 => OutlinePart::Edge(i),
            (i, t) => OutlinePart::Vertex(if t > 0.0 { self.beside[i][1] } else { i }),
        }
    }
}

impl<const D: usize> Solid<D> for Polygon<D> {
    /// The nearest edge decides the side. If the nearest point is a vertex v, the two edges at v decide: d has the sign of
    /// (x − v)·(n₁ + n₂).
    fn nearest(&self, x: &Vector<f64, D>) -> Face<D> {
        let vertex = match self.nearest_part(x) {
            OutlinePart::Edge(i) => {
                let normal = self.normal(i);
                return ((x - self.vertices[i]).dot(&normal), normal);
            }
            OutlinePart::Vertex(vertex) => vertex,
        };
        let between = self.normal(self.beside[vertex][0]) + self.normal(vertex);
        let away = x - self.vertices[vertex];
        let distance = if away.dot(&between) < 0.0 { -away.norm() } else { away.norm() };
        (distance, if distance == 0.0 { between / between.norm() } else { away / distance })
    }

    fn feature(&self, x: &Vector<f64, D>) -> Feature<D> {
        let face = self.nearest(x);
        match self.nearest_part(x) {
            OutlinePart::Edge(_) => Feature::plane(x, face),
            OutlinePart::Vertex(vertex) => Feature::corner(self.vertices[vertex], face.0.signum()),
        }
    }

    /// The lines of the edges within `radius` of `x`.
    fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64 {
        for i in 0..self.vertices.len() {
            if (x - foot(x, self.edge(i)).1).norm_squared() < radius * radius {
                let normal = self.normal(i);
                planes.push(((x - self.vertices[i]).dot(&normal), normal));
            }
        }
        0.0
    }

    fn reach(&self, n: &Vector<f64, D>) -> f64 {
        self.vertices.iter().map(|v| n.dot(v)).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// a × b
fn cross<const D: usize>(a: &Vector<f64, D>, b: &Vector<f64, D>) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// The point a + t (b − a), 0 ≤ t ≤ 1, nearest to `x`, and t.
fn foot<const D: usize>(x: &Vector<f64, D>, [a, b]: [&Vector<f64, D>; 2]) -> (f64, Vector<f64, D>) {
    let t = (x - a).dot(&(b - a)) / (b - a).norm_squared();
    if t >= 1.0 {
        (1.0, *b)
    } else if t > 0.0 {
        (t, a + (b - a) * t)
    } else {
        (0.0, *a)
    }
}

/// Whether two edges cross, or come within `tolerance` of each other away from a shared vertex. Edges are given by the numbers of their
/// vertices.
fn meet<const D: usize>(vertices: &[Vector<f64, D>], one: [usize; 2], other: [usize; 2], tolerance: f64) -> bool {
    let ends = |edge: [usize; 2]| edge.map(|i| &vertices[i]);
    let ([a, b], [c, d]) = (ends(one), ends(other));
    // Most edges are far apart.
    if (0..D).any(|k| a[k].min(b[k]) > c[k].max(d[k]) + tolerance || c[k].min(d[k]) > a[k].max(b[k]) + tolerance) {
        return false;
    }
    let parts = |[a, b]: [&Vector<f64, D>; 2], ends: [&Vector<f64, D>; 2]| {
        let [left, right] = ends.map(|x| cross(&(b - a), &(x - a)));
        (left < 0.0 && right > 0.0) || (left > 0.0 && right < 0.0)
    };
    let touches = |edge: [usize; 2], end: usize| {
        !edge.contains(&end) && (vertices[end] - foot(&vertices[end], ends(edge)).1).norm() <= tolerance
    };
    (parts([a, b], [c, d]) && parts([c, d], [a, b]))
        || one.into_iter().any(|end| touches(other, end))
        || other.into_iter().any(|end| touches(one, end))
}
