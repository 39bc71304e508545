//! Cylinders and cones, truncated or not: a polygon that revolves about an axis.

use super::{EDGE, Face, Feature, Polygon, Solid, axis};
use crate::tensor::Vector;

/// A cone between two discs, one of which may be a point. Equal discs make a cylinder. In 2D the solid is a trapezium or a triangle.
#[derive(Clone, Debug, PartialEq)]
pub struct Cone<const D: usize> {
    /// The centres of the discs.
    ends: [Vector<f64, D>; 2],
    /// The radii of the discs.
    radii: [f64; 2],
    /// The unit vector e from the first centre to the second.
    along: Vector<f64, D>,
    /// A unit vector perpendicular to e.
    across: Vector<f64, D>,
    /// The section along the axis, in distances (s, ρ) along the axis and from the axis. ρ has either sign. The point of the surface
    /// nearest to `x` lies in the section through `x`.
    profile: Polygon<2>,
}

impl<const D: usize> Cone<D> {
    /// The cone between the discs around `ends` with these `radii`. `None` in 1D, if the ends coincide (within 1e-9 of the larger radius),
    /// and unless both radii are ≥ 0 and one of them > 0.
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
        // `across` is the part perpendicular to e of a coordinate axis far from e.
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
        let profile = Polygon::joined(&[outline]).oriented();
        Some(Self { ends, radii, along, across: across / across.norm(), profile })
    }

    /// The position (s, ρ) of `x` in the section, and the unit vector away from the axis.
    fn in_profile(&self, x: &Vector<f64, D>) -> (Vector<f64, 2>, Vector<f64, D>) {
        let from_end = x - self.ends[0];
        let s = from_end.dot(&self.along);
        let off_axis = from_end - self.along * s;
        // Near the axis, round-off may leave a component along the axis, so project once more. If little is left then, the rest is
        // round-off, too.
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

    fn feature(&self, x: &Vector<f64, D>) -> Feature<D> {
        let profile = Box::new(self.profile.feature(&self.in_profile(x).0));
        Feature::Revolved { end: self.ends[0], along: self.along, profile }
    }

    /// The planes of the section through `x`. In 3D a side departs from its plane by r²/2ρ, where ρ is the distance from the axis.
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
