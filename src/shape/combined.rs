//! Unions, intersections and differences: the min or max of signed distances.

use super::{Face, Feature, Shape, Solid, axis};
use crate::tensor::Vector;

/// The union of the parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Union<const D: usize>(pub Vec<Shape<D>>);

/// The intersection of the parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Intersection<const D: usize>(pub Vec<Shape<D>>);

/// The points that lie in `of` and not in `minus`.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference<const D: usize> {
    /// The solid.
    pub of: Box<Shape<D>>,
    /// The hole.
    pub minus: Box<Shape<D>>,
}

/// The only part with `sign` · d < `radius` at `x`; `None` if several parts or none are so near.
fn only<'a, const D: usize>(parts: &'a [Shape<D>], x: &Vector<f64, D>, radius: f64, sign: f64) -> Option<&'a Shape<D>> {
    let mut near = parts.iter().filter(|part| sign * part.signed_distance(x) < radius);
    near.next().filter(|_| near.next().is_none())
}

/// The part with the smallest `sign` · d at `x`, the first of several; `None` without parts.
fn first_part<'a, const D: usize>(parts: &'a [Shape<D>], x: &Vector<f64, D>, sign: f64) -> Option<&'a Shape<D>> {
    let distance = |part: &Shape<D>| sign * part.signed_distance(x);
    parts.iter().reduce(|a, b| if distance(b) < distance(a) { b } else { a })
}

/// The geometry of a union or an intersection: d is the least or the largest of the parts' distances. Given are the sign that makes it the
/// least, the comparison, d without parts, and the extreme of the parts' reaches.
macro_rules! extreme_of_parts {
    ($combination:ident, $sign:literal, $nearer:tt, $without_parts:expr, $reach:path) => {
        impl<const D: usize> Solid<D> for $combination<D> {
            fn nearest(&self, x: &Vector<f64, D>) -> Face<D> {
                let nearer = |a: Face<D>, b: Face<D>| if b.0 $nearer a.0 { b } else { a };
                self.0.iter().map(|part| part.solid().nearest(x)).fold(($without_parts, axis(0, 1.0)), nearer)
            }

            fn feature(&self, x: &Vector<f64, D>) -> Feature<D> {
                let part = first_part(&self.0, x, $sign);
                part.map_or_else(|| Feature::plane(x, self.nearest(x)), |part| part.feature(x))
            }

            fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64 {
                self.0.iter().map(|part| part.solid().add_planes(x, radius, planes)).fold(0.0, f64::max)
            }

            /// An upper bound for an intersection.
            fn reach(&self, n: &Vector<f64, D>) -> f64 {
                self.0.iter().map(|part| part.solid().reach(n)).fold(-$without_parts, $reach)
            }

            fn alone(&self, x: &Vector<f64, D>, radius: f64) -> Option<(&Shape<D>, bool)> {
                Some((only(&self.0, x, radius, $sign)?, false))
            }
        }
    };
}

extreme_of_parts!(Union, 1.0, <, f64::INFINITY, f64::max);
extreme_of_parts!(Intersection, -1.0, >, f64::NEG_INFINITY, f64::min);

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
