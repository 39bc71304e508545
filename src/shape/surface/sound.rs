//! The check that a surface bounds a solid: it is closed, faces one way and does not cross itself.

use super::tree::Tree;
use crate::shape::bounds::Bounds;
use nalgebra::Vector3;
use std::collections::HashMap;

/// Round-off in the volume of four points, relative to the product of its edges.
const ROUND_OFF: f64 = 1e-12;

/// A surface of triangles that bounds no solid. The error names a place where the fault is seen.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// The dimension is not 3.
    #[error("a surface of triangles in {0} dimension(s); it bounds a solid in 3")]
    Dimension(usize),
    /// The surface has no triangles.
    #[error("a surface without triangles")]
    Empty,
    /// More vertices or triangles than their numbers allow.
    #[error("a surface of {0} triangles; at most {most} are allowed", most = u32::MAX)]
    TooMany(usize),
    /// A vertex that is not finite.
    #[error("a vertex at {0:?}, which is no place")]
    NotFinite([f64; 3]),
    /// A triangle with a vertex that does not exist.
    #[error("a triangle with vertex {vertex}, of {vertices} (triangle {triangle}, both counted from 0)")]
    NoVertex {
        /// The number of the triangle, from 0.
        triangle: usize,
        /// The number of the vertex, from 0.
        vertex: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// An edge of one triangle only.
    #[error("an open surface: only one triangle has the edge from {0:?} to {1:?}; close it")]
    Open([f64; 3], [f64; 3]),
    /// An edge that two triangles run along in the same direction, or an edge of more than two.
    #[error(
        "a surface without an inside: the edge from {0:?} to {1:?} has more than two triangles, or two that face different ways"
    )]
    Unorientable([f64; 3], [f64; 3]),
    /// Two triangles that cross.
    #[error("a surface that crosses itself at {0:?}")]
    Crossing([f64; 3]),
    /// A part of the surface that lies in another part, or a cavity that does not.
    #[error(
        "a surface whose parts are not inside and outside by turns: the part at {0:?} should face the other way, or is in the way"
    )]
    Nested([f64; 3]),
    /// The surface encloses no volume.
    #[error("a surface that encloses nothing")]
    Flat,
}

/// The edges of a triangle, each in the direction around the triangle.
fn edges([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// The triangle beyond each edge of each triangle. Each edge of a triangle must belong to exactly one other triangle, in the opposite
/// direction.
///
/// # Errors
/// The first edge that breaks this rule.
pub(crate) fn neighbours(vertices: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Result<Vec<[u32; 3]>, SurfaceError> {
    let place = |vertex: u32| vertices[vertex as usize].into();
    let mut along = HashMap::with_capacity(3 * triangles.len());
    for (i, &triangle) in (0..).zip(triangles) {
        for [a, b] in edges(triangle) {
            if along.insert([a, b], i).is_some() {
                return Err(SurfaceError::Unorientable(place(a), place(b)));
            }
        }
    }
    let beyond = |[a, b]: [u32; 2]| along.get(&[b, a]).copied().ok_or_else(|| SurfaceError::Open(place(a), place(b)));
    let around = |&triangle: &[u32; 3]| {
        let [one, other, last] = edges(triangle);
        Ok([beyond(one)?, beyond(other)?, beyond(last)?])
    };
    triangles.iter().map(around).collect()
}

/// A point where two triangles cross, for the crossing triangles with the smallest numbers. Triangles that only touch do not cross.
pub(crate) fn crossing(vertices: &[Vector3<f64>], triangles: &[[u32; 3]], tree: &Tree) -> Option<Vector3<f64>> {
    triangles.iter().enumerate().find_map(|(i, &one)| {
        let mut found: Option<(usize, Vector3<f64>)> = None;
        tree.meeting(tree.of(i), |k| {
            if k > i && found.is_none_or(|(first, _)| k < first) {
                let other = triangles[k];
                let at = pierced(vertices, one, other).or_else(|| pierced(vertices, other, one));
                found = at.map(|at| (k, at)).or(found);
            }
        });
        found.map(|(_, at)| at)
    })
}

/// The largest error allowed in the winding number of the other parts around a part. Where parts touch, the error is ½.
const TOUCHING: f64 = 0.75;

/// A point on a part of the surface that bounds no solid together with the other parts. A part that faces outwards must lie in none of the
/// others, or in as many parts as cavities. A cavity must lie in one more part than cavities.
pub(crate) fn nested(
    vertices: &[Vector3<f64>],
    triangles: &[[u32; 3]],
    neighbours: &[[u32; 3]],
) -> Option<Vector3<f64>> {
    let mut parts: Vec<Vec<usize>> = Vec::new();
    let mut seen = vec![false; triangles.len()];
    for first in 0..triangles.len() {
        let (mut part, mut next) = (Vec::new(), vec![first]);
        while let Some(i) = next.pop() {
            if !std::mem::replace(&mut seen[i], true) {
                part.push(i);
                next.extend(neighbours[i].iter().map(|&k| k as usize));
            }
        }
        parts.extend((!part.is_empty()).then_some(part));
    }
    if parts.len() == 1 {
        return None;
    }
    let corners = |i: usize| triangles[i].map(|corner| vertices[corner as usize]);
    let bounds: Vec<Bounds<3>> = parts.iter().map(|part| Bounds::of(part.iter().flat_map(|&i| corners(i)))).collect();
    parts.iter().enumerate().find_map(|(own, part)| {
        let x = corners(part[0])[0];
        let volume: f64 =
            part.iter().map(|&i| corners(i).map(|corner| corner - x)).map(|[a, b, c]| a.dot(&b.cross(&c))).sum();
        let others = (0..parts.len()).filter(|&other| other != own && bounds[other].squared_distance(&x) == 0.0);
        let winding: f64 = others.flat_map(|other| &parts[other]).map(|&i| solid_angle(corners(i), &x)).sum();
        let around = winding / (4.0 * std::f64::consts::PI);
        let expected = if volume < 0.0 { 1.0 } else { 0.0 };
        ((around - expected).abs() > TOUCHING).then_some(x)
    })
}

/// The solid angle of a triangle seen from `x`, > 0 from inside (Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30, 1983).
fn solid_angle(corners: [Vector3<f64>; 3], x: &Vector3<f64>) -> f64 {
    let [a, b, c] = corners.map(|corner| corner - x);
    let [p, q, r] = [a.norm(), b.norm(), c.norm()];
    let below = p * q * r + a.dot(&b) * r + b.dot(&c) * p + c.dot(&a) * q;
    2.0 * a.dot(&b.cross(&c)).atan2(below)
}

/// The point where an edge of `one` goes through `other`. Edges that share a vertex with `other` do not count.
fn pierced(vertices: &[Vector3<f64>], one: [u32; 3], other: [u32; 3]) -> Option<Vector3<f64>> {
    let [a, b, c] = other.map(|i| vertices[i as usize]);
    edges(one).into_iter().find_map(|edge| {
        if edge.iter().any(|end| other.contains(end)) {
            return None;
        }
        let [p, q] = edge.map(|i| vertices[i as usize]);
        let (below, above) = (side(&a, &b, &c, &p), side(&a, &b, &c, &q));
        if below * above >= 0.0 {
            return None;
        }
        let around = [side(&p, &q, &a, &b), side(&p, &q, &b, &c), side(&p, &q, &c, &a)];
        // Points on the boundary count, too: round-off may make the triangle beyond miss the edge.
        let through = around.iter().all(|&x| x >= 0.0) || around.iter().all(|&x| x <= 0.0);
        through.then(|| p + (q - p) * (below / (below - above)))
    })
}

/// The side of the plane through `a`, `b` and `c` on which `x` lies: six times a volume, 0 if that volume is round-off.
fn side(a: &Vector3<f64>, b: &Vector3<f64>, c: &Vector3<f64>, x: &Vector3<f64>) -> f64 {
    let (u, v, w) = (b - a, c - a, x - a);
    let volume = u.cross(&v).dot(&w);
    if volume.abs() > ROUND_OFF * u.norm() * v.norm() * w.norm() { volume } else { 0.0 }
}
