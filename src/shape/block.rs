//! Boxes.

use super::{Face, Feature, Solid, axis};
use crate::tensor::Vector;

/// An axis-parallel box: an interval, a rectangle, a cuboid.
#[derive(Clone, Debug, PartialEq)]
pub struct Block<const D: usize> {
    /// The lower corner.
    pub min: Vector<f64, D>,
    /// The upper corner, above `min` in every component.
    pub max: Vector<f64, D>,
}

impl<const D: usize> Solid<D> for Block<D> {
    /// With q_k the signed distance from the slab of axis k: d = |max(q, 0)| outside, max_k q_k inside.
    fn nearest(&self, x: &Vector<f64, D>) -> Face<D> {
        let (mut outside, mut nearest) = (Vector::<f64, D>::zeros(), (f64::NEG_INFINITY, axis(0, 1.0)));
        for k in 0..D {
            let (below, above) = (self.min[k] - x[k], x[k] - self.max[k]);
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

    /// Outside several slabs, an edge or a corner is nearest.
    fn feature(&self, x: &Vector<f64, D>) -> Feature<D> {
        let corner = Vector::from_fn(|k, _| x[k].clamp(self.min[k], self.max[k]));
        let inside: Vec<usize> = (0..D).filter(|&k| corner[k] == x[k]).collect();
        match (D - inside.len(), inside.as_slice()) {
            (0 | 1, _) => Feature::plane(x, self.nearest(x)),
            (_, [along]) => Feature::edge(corner, axis(*along, 1.0), 1.0),
            _ => Feature::corner(corner, 1.0),
        }
    }

    fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64 {
        let faces = (0..D).flat_map(|k| [(self.min[k] - x[k], axis(k, -1.0)), (x[k] - self.max[k], axis(k, 1.0))]);
        planes.extend(faces.filter(|face| face.0.abs() < radius));
        0.0
    }

    /// Σ_k n_k max_k, or n_k min_k where n_k < 0
    fn reach(&self, n: &Vector<f64, D>) -> f64 {
        (0..D).map(|k| n[k] * if n[k] < 0.0 { self.min[k] } else { self.max[k] }).sum()
    }
}
