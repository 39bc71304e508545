//! Bounding boxes.

use crate::tensor::Vector;

/// An axis-parallel box, by its lower and its upper corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds<const D: usize>(pub Vector<f64, D>, pub Vector<f64, D>);

impl<const D: usize> Bounds<D> {
    /// The bounds of some points.
    pub(crate) fn of(points: impl Iterator<Item = Vector<f64, D>>) -> Self {
        Self::around(points.map(|x| Self(x, x)))
    }

    /// The bounds of some boxes.
    pub(crate) fn around(boxes: impl Iterator<Item = Self>) -> Self {
        let nothing = Self(Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY));
        boxes.fold(nothing, |all, one| Self(all.0.inf(&one.0), all.1.sup(&one.1)))
    }

    /// Whether two boxes have a point in common.
    pub(crate) fn meets(&self, other: &Self) -> bool {
        (0..D).all(|k| self.0[k] <= other.1[k] && other.0[k] <= self.1[k])
    }

    /// The squared distance of a point from the box, 0 inside.
    pub(crate) fn squared_distance(&self, x: &Vector<f64, D>) -> f64 {
        (x - x.sup(&self.0).inf(&self.1)).norm_squared()
    }
}
