//! Half-spaces.

use super::{Face, Solid};
use crate::tensor::Vector;

/// Two directions are parallel if the sine of the angle between them is below this: rotations leave such round-off.
const PARALLEL: f64 = 1e-14;

/// All points behind a plane.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfSpace<const D: usize> {
    /// A point of the plane.
    pub point: Vector<f64, D>,
    /// The outward normal, of any length but zero.
    pub normal: Vector<f64, D>,
}

impl<const D: usize> Solid<D> for HalfSpace<D> {
    /// d = (x − p)·n
    fn nearest(&self, x: &Vector<f64, D>) -> Face<D> {
        let n = self.normal / self.normal.norm();
        ((x - self.point).dot(&n), n)
    }

    fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64 {
        planes.extend(Some(self.nearest(x)).filter(|face| face.0.abs() < radius));
        0.0
    }

    /// n·p along the normal, infinite in all other directions.
    fn reach(&self, n: &Vector<f64, D>) -> f64 {
        let normal = self.normal / self.normal.norm();
        let along = n.dot(&normal);
        let parallel = along > 0.0 && (n - normal * along).norm() <= PARALLEL * along;
        if parallel { n.dot(&self.point) } else { f64::INFINITY }
    }
}
