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

impl<const D: usize> Solid<D> for Union<D> {
    /// d = min dᵢ
    fn nearest(&self, x: &Vector<f64, D>) -> Face<D> {
        let nowhere = (f64::INFINITY, axis(0, 1.0));
        self.0.iter().map(|part| part.solid().nearest(x)).fold(nowhere, |a, b| if b.0 < a.0 { b } else { a })
    }

    fn feature(&self, x: &Vector<f64, D>) -> Feature<D> {
        first_part(&self.0, x, 1.0).map_or_else(|| Feature::plane(x, self.nearest(x)), |part| part.feature(x))
    }

    fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64 {
        self.0.iter().map(|part| part.solid().add_planes(x, radius, planes)).fold(0.0, f64::max)
    }

    fn reach(&self, n: &Vector<f64, D>) -> f64 {
        self.0.iter().map(|part| part.solid().reach(n)).fold(f64::NEG_INFINITY, f64::max)
    }

    fn alone(&self, x: &Vector<f64, D>, radius: f64) -> Option<(&Shape<D>, bool)> {
        Some((only(&self.0, x, radius, 1.0)?, false))
    }
}

impl<const D: usize> Solid<D> for Intersection<D> {
    /// d = max dᵢ
    fn nearest(&self, x: &Vector<f64, D>) -> Face<D> {
        let everywhere = (f64::NEG_INFINITY, axis(0, 1.0));
        self.0.iter().map(|part| part.solid().nearest(x)).fold(everywhere, |a, b| if b.0 > a.0 { b } else { a })
    }

    fn feature(&self, x: &Vector<f64, D>) -> Feature<D> {
        first_part(&self.0, x, -1.0).map_or_else(|| Feature::plane(x, self.nearest(x)), |part| part.feature(x))
    }

    fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64 {
        self.0.iter().map(|part| part.solid().add_planes(x, radius, planes)).fold(0.0, f64::max)
    }

    /// An upper bound.
    fn reach(&self, n: &Vector<f64, D>) -> f64 {
        self.0.iter().map(|part| part.solid().reach(n)).fold(f64::INFINITY, f64::min)
    }

    fn alone(&self, x: &Vector<f64, D>, radius: f64) -> Option<(&Shape<D>, bool)> {
        Some((only(&self.0, x, radius, -1.0)?, false))
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
