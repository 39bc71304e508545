//! Unions, intersections and differences: the min or max of signed distances.

use super::{Face, Feature, Shape, Solid, axis};
use crate::tensor::Vector;

/// The union of the parts, or their intersection.
#[derive(Clone, Debug, PartialEq)]
pub struct Combination<const D: usize> {
    /// 1 for the union, −1 for the intersection: the part with the smallest `sign` · d counts.
    sign: f64,
    parts: Vec<Shape<D>>,
}

/// The points that lie in `of` and not in `minus`.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference<const D: usize> {
    /// The solid.
    pub of: Box<Shape<D>>,
    /// The hole.
    pub minus: Box<Shape<D>>,
}

impl<const D: usize> Shape<D> {
    /// The union of the parts.
    pub fn union(parts: Vec<Self>) -> Self {
        Combination { sign: 1.0, parts }.into()
    }

    /// The intersection of the parts.
    pub fn intersection(parts: Vec<Self>) -> Self {
        Combination { sign: -1.0, parts }.into()
    }

    /// The parts of a union; of another solid, the solid itself.
    pub(crate) fn united(&self) -> &[Self] {
        match self {
            Self::Combination(union) if union.sign > 0.0 => &union.parts,
            _ => std::slice::from_ref(self),
        }
    }
}

impl<const D: usize> Solid<D> for Combination<D> {
    /// d = min dᵢ or d = max dᵢ
    fn nearest(&self, x: &Vector<f64, D>) -> Face<D> {
        let (sign, none) = (self.sign, (self.sign * f64::INFINITY, axis(0, 1.0)));
        let faces = self.parts.iter().map(|part| part.solid().nearest(x));
        faces.fold(none, |a, b| if sign * b.0 < sign * a.0 { b } else { a })
    }

    fn feature(&self, x: &Vector<f64, D>) -> Feature<D> {
        let distance = |part: &Shape<D>| self.sign * part.signed_distance(x);
        let first = self.parts.iter().reduce(|a, b| if distance(b) < distance(a) { b } else { a });
        first.map_or_else(|| Feature::plane(x, self.nearest(x)), |part| part.feature(x))
    }

    fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64 {
        self.parts.iter().map(|part| part.solid().add_planes(x, radius, planes)).fold(0.0, f64::max)
    }

    /// For an intersection, an upper bound.
    fn reach(&self, n: &Vector<f64, D>) -> f64 {
        let farther = if self.sign > 0.0 { f64::max } else { f64::min };
        self.parts.iter().map(|part| part.solid().reach(n)).fold(-self.sign * f64::INFINITY, farther)
    }

    fn alone(&self, x: &Vector<f64, D>, radius: f64) -> Option<(&Shape<D>, bool)> {
        let mut near = self.parts.iter().filter(|part| self.sign * part.signed_distance(x) < radius);
        near.next().filter(|_| near.next().is_none()).map(|part| (part, false))
    }
}

impl<const D: usize> Solid<D> for Difference<D> {
    /// d = max(d_of, −d_minus)
    fn nearest(&self, x: &Vector<f64, D>) -> Face<D> {
        let (solid, hole) = (self.of.solid().nearest(x), self.minus.solid().nearest(x));
        if solid.0 >= -hole.0 { solid } else { (-hole.0, -hole.1) }
    }

    fn feature(&self, x: &Vector<f64, D>) -> Feature<D> {
        let is_solid = self.of.signed_distance(x) >= -self.minus.signed_distance(x);
        if is_solid { self.of.feature(x) } else { self.minus.feature(x).flipped() }
    }

    fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64 {
        let departure = self.of.solid().add_planes(x, radius, planes);
        departure.max(self.minus.solid().add_planes(x, radius, planes))
    }

    /// An upper bound.
    fn reach(&self, n: &Vector<f64, D>) -> f64 {
        self.of.solid().reach(n)
    }

    fn alone(&self, x: &Vector<f64, D>, radius: f64) -> Option<(&Shape<D>, bool)> {
        if self.minus.signed_distance(x) >= radius {
            Some((&self.of, false))
        } else if self.of.signed_distance(x) <= -radius {
            Some((&self.minus, true))
        } else {
            None
        }
    }
}
