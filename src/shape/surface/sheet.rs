//! Pieces of surface without an inside, as regions of loads and of nodes.

use super::mesh::foot;
use super::tree::Tree;
use super::{plane, same, space};
use crate::shape::bounds::Bounds;
use crate::shape::{Face, Solid, axis};
use crate::tensor::Vector;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A piece of surface without an inside: triangles in 3D, segments in 2D. The signed distance is nowhere negative. As a region, a sheet selects
/// the surface of a body that it covers.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet<const D: usize> {
    parts: Arc<Parts>,
}

#[derive(Debug, PartialEq)]
struct Parts {
    /// The corners of each triangle; a segment is a triangle with its last corner twice.
    corners: Vec<[Vector3<f64>; 3]>,
    /// The edges (points in 2D) that one triangle or segment has alone, as triangles, and the unit vectors that lead out of the sheet there.
    rim: Vec<([Vector3<f64>; 3], Vector3<f64>)>,
    tree: Tree,
}

impl<const D: usize> Sheet<D> {
    /// The sheet of these simplices of D corners, given by the numbers of their vertices. `None` without simplices, if a vertex does not exist, and
    /// in 1D.
    pub(crate) fn new(vertices: &[Vector<f64, D>], simplices: &[[u32; D]]) -> Option<Self> {
        if !(2..=3).contains(&D) || simplices.is_empty() {
            return None;
        }
        let (mut corners, mut rim) = (Vec::new(), BTreeMap::new());
        for simplex in simplices {
            let place = |&i: &u32| vertices.get(i as usize).map(space);
            let x = simplex.iter().map(place).collect::<Option<Vec<_>>>()?;
            corners.push([x[0], x[1], x[D - 1]]);
            for apex in 0..D {
                let [a, b] = [(apex + 1) % D, (apex + D - 1) % D];
                let mut edge = [simplex[a], simplex[b]];
                edge.sort_unstable();
                if rim.remove(&edge).is_none() {
                    let (along, away) = (x[b] - x[a], x[a] - x[apex]);
                    let across = away - along * (away.dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE));
                    rim.insert(edge, ([x[a], x[b], x[b]], across.try_normalize(0.0).unwrap_or_default()));
                }
            }
        }
        let tree = Tree::new(corners.iter().map(|corners| Bounds::of(corners.iter().copied())).collect());
        Some(Self { parts: Arc::new(Parts { corners, rim: rim.into_values().collect(), tree }) })
    }
}

impl<const D: usize> Solid<D> for Sheet<D> {
    fn nearest(&self, x: &Vector<f64, D>) -> Face<D> {
        let (x, parts) = (space(x), &self.parts);
        let from = |i: usize| {
            let away = x - foot(parts.corners[i], &x).0;
            (away.norm_squared(), away)
        };
        let nearest = parts.tree.nearest(&x, from);
        let (squared, away) = nearest.map_or((f64::INFINITY, Vector3::x()), |(squared, _, away)| (squared, away));
        (squared.sqrt(), away.try_normalize(0.0).map_or_else(|| axis(0, 1.0), plane))
    }

    /// The planes across the sheet at its rim.
    fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64 {
        let x = space(x);
        for (edge, out) in self.parts.rim.iter().filter(|(edge, _)| (foot(*edge, &x).0 - x).norm() < radius) {
            let face = (out.dot(&(x - edge[0])), plane(*out));
            if !planes.iter().any(|other| same(other, &face, radius)) {
                planes.push(face);
            }
        }
        0.0
    }

    fn reach(&self, n: &Vector<f64, D>) -> f64 {
        let n = space(n);
        self.parts.corners.iter().flatten().map(|x| n.dot(x)).fold(f64::NEG_INFINITY, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{Block, GridBox, Shape};

    #[test]
    fn a_sheet_selects_a_part_of_a_surface() {
        // A quarter of the lower side of a square.
        let quarter = Sheet::new(&[[0.0, 0.0], [0.25, 0.0]].map(Vector::from), &[[0, 1]]).unwrap().into();
        let square = Shape::from(Block { min: Vector::zeros(), max: Vector::from([1.0, 1.0]) });
        let cell = GridBox { lower: Vector::from([-0.5, -0.5]), edges: Vector::from([1.0, 1.0]), spacing: 1.0 };
        let facets = square.facets(Some(&quarter), &cell);
        assert!(facets.len() == 1 && (facets[0].area - 0.25).abs() < 1e-15);
    }
}
