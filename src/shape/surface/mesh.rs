//! Triangles that bound a solid, and the point of them nearest to another.

use super::sound::{SurfaceError, crossing, neighbours, nested};
use super::tree::Tree;
use crate::shape::bounds::Bounds;
use nalgebra::Vector3;

/// The triangles, counter-clockwise as seen from outside, with their neighbours and normals.
#[derive(Debug, PartialEq)]
pub(crate) struct Mesh {
    pub vertices: Vec<Vector3<f64>>,
    pub triangles: Vec<[u32; 3]>,
    /// The triangle beyond each edge.
    pub neighbours: Vec<[u32; 3]>,
    /// Outward unit normals of the triangles; 0 for triangles that are lines.
    pub normals: Vec<Vector3<f64>>,
    /// Σ angle × normal of the triangles around each vertex.
    pub at_vertices: Vec<Vector3<f64>>,
    pub tree: Tree,
}

/// The part of a triangle on which the nearest point lies.
pub(crate) enum Foot {
    Inside,
    Edge(usize),
    Vertex(usize),
}

impl Mesh {
    pub(crate) fn new(vertices: Vec<Vector3<f64>>, mut triangles: Vec<[u32; 3]>) -> Result<Self, SurfaceError> {
        // A triangle with two equal corners is a line. Its neighbours meet at this line.
        triangles.retain(|[a, b, c]| a != b && b != c && c != a);
        if triangles.is_empty() {
            return Err(SurfaceError::Empty);
        }
        if triangles.len().max(vertices.len()) > u32::MAX as usize {
            return Err(SurfaceError::TooMany(triangles.len()));
        }
        if let Some(&x) = vertices.iter().find(|x| !x.iter().all(|x| x.is_finite())) {
            return Err(SurfaceError::NotFinite(x.into()));
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&vertex| vertex as usize >= vertices.len()) {
                return Err(SurfaceError::NoVertex { triangle, vertex, vertices: vertices.len() });
            }
        }
        // 6 V = Σ a·(b × c), about a point near the surface
        let origin = vertices[triangles[0][0] as usize];
        let corner = |i: u32| vertices[i as usize] - origin;
        let volume: f64 = triangles.iter().map(|&[a, b, c]| corner(a).dot(&corner(b).cross(&corner(c)))).sum();
        if volume < 0.0 {
            triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        let neighbours = neighbours(&vertices, &triangles)?;
        if volume == 0.0 || !volume.is_finite() {
            return Err(SurfaceError::Flat);
        }
        let tree = Self::tree(&vertices, &triangles);
        if let Some(x) = crossing(&vertices, &triangles, &tree) {
            return Err(SurfaceError::Crossing(x.into()));
        }
        if let Some(x) = nested(&vertices, &triangles, &neighbours) {
            return Err(SurfaceError::Nested(x.into()));
        }
        let (mut normals, mut at_vertices) = (Vec::new(), vec![Vector3::zeros(); vertices.len()]);
        for triangle in &triangles {
            let [a, b, c] = triangle.map(|i| vertices[i as usize]);
            let normal = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default();
            normals.push(normal);
            let angles = [(b - a).angle(&(c - a)), (c - b).angle(&(a - b)), (a - c).angle(&(b - c))];
            triangle.iter().zip(angles).for_each(|(&i, angle)| at_vertices[i as usize] += normal * angle);
        }
        Ok(Self { vertices, triangles, neighbours, normals, at_vertices, tree })
    }

    pub(crate) fn tree(vertices: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Tree {
        let bounds = |triangle: &[u32; 3]| Bounds::of(triangle.iter().map(|&i| vertices[i as usize]));
        Tree::new(triangles.iter().map(bounds).collect())
    }

    /// The triangles whose bounds meet a box, in order.
    pub(crate) fn meeting(&self, bounds: &Bounds<3>) -> Vec<usize> {
        let mut found = Vec::new();
        self.tree.meeting(bounds, |triangle| found.push(triangle));
        found.sort_unstable();
        found
    }

    pub(crate) fn corners(&self, triangle: usize) -> [Vector3<f64>; 3] {
        self.triangles[triangle].map(|i| self.vertices[i as usize])
    }

    /// d and ∇d, and the nearest triangle with the part of it that is nearest. The normals of the triangles that meet at the nearest point
    /// decide the sign of d, each weighted by its angle (Bærentzen and Aanæs, 2005).
    pub(crate) fn nearest(&self, x: &Vector3<f64>) -> (f64, Vector3<f64>, Option<(usize, Foot)>) {
        let distance = |triangle: usize| {
            let (at, part) = foot(self.corners(triangle), x);
            ((x - at).norm_squared(), (x - at, part))
        };
        let Some((squared, triangle, (away, foot))) = self.tree.nearest(x, distance) else {
            return (f64::INFINITY, Vector3::x(), None);
        };
        let outward = match foot {
            Foot::Inside => self.normals[triangle],
            Foot::Edge(i) => self.normals[triangle] + self.normals[self.neighbours[triangle][i] as usize],
            Foot::Vertex(i) => self.at_vertices[self.triangles[triangle][i] as usize],
        };
        let side = if away.dot(&outward) < 0.0 { -1.0 } else { 1.0 };
        let distance = side * squared.sqrt();
        // On the surface, or so near that the direction is round-off, the normal is that of the surface.
        let direction = match foot {
            Foot::Inside => self.normals[triangle],
            _ if squared > 0.0 => away / distance,
            _ => outward.try_normalize(0.0).unwrap_or_else(Vector3::x),
        };
        (distance, direction, Some((triangle, foot)))
    }
}

/// The nearest point of a triangle (Ericson, Real-Time Collision Detection, 5.1.5). A segment is a triangle with its last corner twice.
pub(crate) fn foot([a, b, c]: [Vector3<f64>; 3], x: &Vector3<f64>) -> (Vector3<f64>, Foot) {
    let (ab, ac) = (b - a, c - a);
    let along = |from: Vector3<f64>| (ab.dot(&(x - from)), ac.dot(&(x - from)));
    let ((d1, d2), (d3, d4), (d5, d6)) = (along(a), along(b), along(c));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (a, Foot::Vertex(0));
    }
    if d3 >= 0.0 && d4 <= d3 {
        return (b, Foot::Vertex(1));
    }
    if d6 >= 0.0 && d5 <= d6 {
        return (c, Foot::Vertex(2));
    }
    let (vc, vb, va) = (d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4);
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (a + ab * (d1 / (d1 - d3)), Foot::Edge(0));
    }
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (a + ac * (d2 / (d2 - d6)), Foot::Edge(2));
    }
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return (b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6))), Foot::Edge(1));
    }
    let sum = va + vb + vc;
    (a + ab * (vb / sum) + ac * (vc / sum), Foot::Inside)
}
