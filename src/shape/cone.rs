//! Cylinders and cones, truncated or not: a polygon that turns about an axis.

use super::{EDGE, Face, Polygon, Solid, axis};
use crate::tensor::Vector;

/// A cone between two discs, one of which may be a point; between equal ones a cylinder. In 2D a trapezium or a triangle.
#[derive(Clone, Debug, PartialEq)]
pub struct Cone<const D: usize> {
    /// The centres of the discs.
    ends: [Vector<f64, D>; 2],
    /// Their radii.
    radii: [f64; 2],
    /// The unit vector e from the first to the second.
    along: Vector<f64, D>,
    /// A unit vector across.
    across: Vector<f64, D>,
    /// The cut along the axis, in distances (s, ρ) along it and from it, ρ of either sign. A point nearest to `x` lies in the same cut.
    profile: Polygon<2>,
}

impl<const D: usize> Cone<D> {
    /// The cone between the discs around `ends` with these `radii`; `None` in 1D, where the ends coincide (as far as
    /// 1e-9 of the radius tells), and unless the radii are ≥ 0 and one of them > 0.
    ///
    /// ```
    /// use bfree::shape::{Cone, Shape};
    /// use bfree::tensor::Vector;
    ///
    /// // A cone with its tip at z = 4, which its side meets at a slope of 3 : 4.
    /// let ends = [Vector::from([0.0, 0.0, 0.0]), Vector::from([0.0, 0.0, 4.0])];
    /// let cone = Shape::from(Cone::new(ends, [3.0, 0.0]).ok_or("none")?);
    /// assert_eq!(cone.signed_distance(&Vector::from([0.0, 0.0, 6.0])), 2.0);
    /// assert!((cone.signed_distance(&Vector::from([3.0, 0.0, 4.0])) - 2.4).abs() < 1e-15);
    /// assert!(Cone::new(ends, [0.0, 0.0]).is_none());
    /// # Ok::<(), &str>(())
    /// ```
    pub fn new(ends: [Vector<f64, D>; 2], radii: [f64; 2]) -> Option<Self> {
        let axis_vector = ends[1] - ends[0];
        let length = axis_vector.norm();
        let largest = radii[0].max(radii[1]);
        let sound = D > 1 && radii.iter().all(|&r| r >= 0.0) && largest > 0.0 && length > EDGE * largest;
        if !sound {
            return None;
        }
        let along = axis_vector / length;
        // Across is what an axis of space far from e has beside it.
        let far: Vector<f64, D> = axis(along.iamin(), 1.0);
        let across = far - along * far.dot(&along);
        let mut outline = Vec::new();
        for (s, r) in [(0.0, radii[0]), (length, -radii[1])] {
            if r.abs() > EDGE * largest {
                outline.extend([[s, r], [s, -r]].map(Vector::from));
            } else {
                outline.push(Vector::from([s, 0.0]));
            }
        }
        Some(Self { ends, radii, along, across: across / across.norm(), profile: Polygon::oriented(outline) })
    }

    /// (s, ρ), and the unit vector away from the axis.
    fn in_profile(&self, x: &Vector<f64, D>) -> (Vector<f64, 2>, Vector<f64, D>) {
        let from_end = x - self.ends[0];
        let s = from_end.dot(&self.along);
        let off_axis = from_end - self.along * s;
        // What round-off leaves near the axis may point along it: once more; and if little is left then, that is round-off too.
        let radial = off_axis - self.along * off_axis.dot(&self.along);
        let rho = radial.norm();
        (Vector::from([s, rho]), if rho > 0.01 * off_axis.norm() { radial / rho } else { self.across })
    }
}

impl<const D: usize> Solid<D> for Cone<D> {
    fn nearest(&self, x: &Vector<f64, D>) -> Face<D> {
        let (place, outward) = self.in_profile(x);
        let (d, n) = self.profile.nearest(&place);
        (d, self.along * n[0] + outward * n[1])
    }

    /// Those of the cut through `x`, which a side leaves by r²/2ρ in 3D, ρ its distance from the axis.
    fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64 {
        let (place, outward) = self.in_profile(x);
        let mut of_profile = Vec::new();
        self.profile.add_planes(&place, radius, &mut of_profile);
        let turned = D == 3 && of_profile.iter().any(|(_, n)| n[1] != 0.0);
        planes.extend(of_profile.into_iter().map(|(d, n)| (d, self.along * n[0] + outward * n[1])));
        if turned { 0.5 * radius * radius / (place[1] - radius).max(0.25 * radius) } else { 0.0 }
    }

    /// max of n·c + r |n − (n·e) e| over the discs
    fn reach(&self, n: &Vector<f64, D>) -> f64 {
        let across = (n - self.along * n.dot(&self.along)).norm();
        let disc = |i: usize| n.dot(&self.ends[i]) + self.radii[i] * across;
        disc(0).max(disc(1))
    }
}
