//! Balls.

use super::{Face, Feature, Solid, axis};
use crate::tensor::Vector;

/// An interval, a disc or a ball.
#[derive(Clone, Debug, PartialEq)]
pub struct Ball<const D: usize> {
    /// The centre.
    pub center: Vector<f64, D>,
    /// The radius, > 0.
    pub radius: f64,
}

impl<const D: usize> Solid<D> for Ball<D> {
    /// d = |x − c| − r,  ∇d = (x − c)/|x − c|
    fn nearest(&self, x: &Vector<f64, D>) -> Face<D> {
        let from_center = x - self.center;
        let length = from_center.norm();
        let normal = if length > 0.0 { from_center / length } else { axis(0, 1.0) };
        (length - self.radius, normal)
    }

    fn feature(&self, _: &Vector<f64, D>) -> Feature<D> {
        Feature::Sphere { center: self.center, radius: self.radius, sign: 1.0 }
    }

    /// The tangent plane. Within a radius r the sphere, of radius R, departs from the plane by r²/2R.
    fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64 {
        planes.extend(Some(self.nearest(x)).filter(|face| face.0.abs() < radius));
        0.5 * radius * radius / self.radius
    }

    /// n·c + r |n|
    fn reach(&self, n: &Vector<f64, D>) -> f64 {
        n.dot(&self.center) + self.radius * n.norm()
    }
}
