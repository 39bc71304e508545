//! Which surfaces bound a solid: closed ones, turned one way, that do not cross themselves.

use super::tree::{Bounds, Tree};
use nalgebra::Vector3;
use std::collections::HashMap;

/// Round-off in a volume of four points, relative to the product of its edges.
const ROUND_OFF: f64 = 1e-12;

/// Triangles that bound no solid; each with a place where that is seen.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// Not in space.
    #[error("a surface of triangles in {0} dimension(s); it bounds a solid in 3")]
    Dimension(usize),
    /// Nothing.
    #[error("a surface without triangles")]
    Empty,
    /// More vertices or triangles than are numbered.
    #[error("a surface of {0} triangles; at most {most} are allowed", most = u32::MAX)]
    TooMany(usize),
    /// A vertex at infinity.
    #[error("a vertex at {0:?}, which is no place")]
    NotFinite([f64; 3]),
    /// A triangle of vertices that are not there.
    #[error("a triangle with vertex {vertex}, of {vertices} (triangle {triangle}, both counted from 0)")]
    NoVertex {
        /// Its number, from 0.
        triangle: usize,
        /// The vertex.
        vertex: u32,
        /// How many there are.
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
    /// A part of the surface that lies in another one, or a cavity that does not.
    #[error(
        "a surface whose parts are not inside and outside by turns: the part at {0:?} should face the other way, or is in the way"
    )]
    Nested([f64; 3]),
    /// No volume.
    #[error("a surface that encloses nothing")]
    Flat,
}

fn place(x: &Vector3<f64>) -> [f64; 3] {
    [x[0], x[1], x[2]]
}

/// The edges of a triangle, each in the direction in which it runs around.
fn edges([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// The triangle beyond each edge of each triangle: an edge that one runs along, one other runs along backwards.
///
/// # Errors
/// The first edge of which that is not true.
pub fn neighbours(vertices: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Result<Vec<[u32; 3]>, SurfaceError> {
    let ends = |[a, b]: [u32; 2]| (place(&vertices[a as usize]), place(&vertices[b as usize]));
    let mut along = HashMap::with_capacity(3 * triangles.len());
    for (i, &triangle) in (0..).zip(triangles) {
        for edge in edges(triangle) {
            if along.insert(edge, i).is_some() {
                let (a, b) = ends(edge);
                return Err(SurfaceError::Unorientable(a, b));
            }
        }
    }
    let mut beyond = Vec::with_capacity(triangles.len());
    for &triangle in triangles {
        let mut list = [0; 3];
        for (beyond, [a, b]) in list.iter_mut().zip(edges(triangle)) {
            let Some(&other) = along.get(&[b, a]) else {
                let (a, b) = ends([a, b]);
                return Err(SurfaceError::Open(a, b));
            };
            *beyond = other;
        }
        beyond.push(list);
    }
    Ok(beyond)
}

/// Where two triangles cross, of those whose numbers are the smallest; triangles that touch do not.
pub fn crossing(vertices: &[Vector3<f64>], triangles: &[[u32; 3]], tree: &Tree) -> Option<Vector3<f64>> {
    for (i, &one) in triangles.iter().enumerate() {
        let mut found: Option<(usize, Vector3<f64>)> = None;
        tree.meeting(tree.of(i), |k| {
            let before = found.as_ref().is_none_or(|(other, _)| k < *other);
            if k > i && before {
                let other = triangles[k];
                let at = pierced(vertices, one, other).or_else(|| pierced(vertices, other, one));
                found = at.map(|at| (k, at)).or(found);
            }
        });
        if let Some((_, at)) = found {
            return Some(at);
        }
    }
    None
}

/// How far the windings of the other parts around a part may be from what they should be: ½ where parts touch.
const TOUCHING: f64 = 0.75;

/// A place on a part of the surface that bounds no solid together with the others. One that faces outwards lies in none of them, or in as
/// many as there are cavities around it; a cavity lies in one more.
pub fn nested(vertices: &[Vector3<f64>], triangles: &[[u32; 3]], neighbours: &[[u32; 3]]) -> Option<Vector3<f64>> {
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
    let bounds: Vec<Bounds> = parts.iter().map(|part| Bounds::of(part.iter().flat_map(|&i| corners(i)))).collect();
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

/// The solid angle of a triangle, > 0 from inside (Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30, 1983).
fn solid_angle(corners: [Vector3<f64>; 3], x: &Vector3<f64>) -> f64 {
    let [a, b, c] = corners.map(|corner| corner - x);
    let [p, q, r] = [a.norm(), b.norm(), c.norm()];
    let below = p * q * r + a.dot(&b) * r + b.dot(&c) * p + c.dot(&a) * q;
    2.0 * a.dot(&b.cross(&c)).atan2(below)
}

/// Where an edge of `one` goes through `other`, neither having a vertex of the other's.
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
        // Through its boundary, too: the triangle beyond may miss it by round-off.
        let through = around.iter().all(|&x| x >= 0.0) || around.iter().all(|&x| x <= 0.0);
        through.then(|| p + (q - p) * (below / (below - above)))
    })
}

/// On which side of the plane through `a`, `b` and `c` the point `x` lies: six times a volume, 0 where that is round-off.
fn side(a: &Vector3<f64>, b: &Vector3<f64>, c: &Vector3<f64>, x: &Vector3<f64>) -> f64 {
    let (u, v, w) = (b - a, c - a, x - a);
    let volume = u.cross(&v).dot(&w);
    if volume.abs() > ROUND_OFF * u.norm() * v.norm() * w.norm() { volume } else { 0.0 }
}
