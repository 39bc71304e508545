//! The part of a surface nearest to a point, as a smooth function of the point: signed distance, normal and curvature.

use super::{Face, axis};
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector, identity, outer};

/// A plane, a sphere or a surface of revolution that has the same signed distance as a solid around a point. Edges and corners are
/// circles and spheres of radius 0.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Feature<const D: usize> {
    /// A plane.
    Plane {
        /// A point of the plane.
        point: Vector<f64, D>,
        /// The outward unit normal.
        normal: Vector<f64, D>,
    },
    /// A sphere (a circle in 2D). The solid is inside the sphere.
    Sphere {
        /// The centre.
        center: Vector<f64, D>,
        /// The radius, ≥ 0.
        radius: f64,
        /// 1, or −1 where the solid is outside the sphere.
        sign: f64,
    },
    /// A surface of revolution, by its profile in distances (s, ρ) along an axis and from the axis, ρ ≥ 0.
    Revolved {
        /// The point of the axis at s = 0.
        end: Vector<f64, D>,
        /// The unit vector along the axis.
        along: Vector<f64, D>,
        /// The profile.
        profile: Box<Feature<2>>,
    },
}

/// The signed distance of a point and its first derivative.
pub(crate) struct Distance<T, const D: usize> {
    /// The signed distance d, negative inside.
    pub distance: T,
    /// ∇d, the outward unit normal.
    pub normal: Vector<T, D>,
}

impl<const D: usize> Feature<D> {
    /// The tangent plane of a surface at distance d from `x` with the normal ∇d.
    pub(super) fn plane(x: &Vector<f64, D>, (d, normal): Face<D>) -> Self {
        Self::Plane { point: x - normal * d, normal }
    }

    /// A corner of a solid, seen from outside, or from inside where `sign` is −1.
    pub(super) fn corner(center: Vector<f64, D>, sign: f64) -> Self {
        Self::Sphere { center, radius: 0.0, sign }
    }

    /// A straight edge of a solid through `end`, seen from outside, or from inside where `sign` is −1.
    pub(super) fn edge(end: Vector<f64, D>, along: Vector<f64, D>, sign: f64) -> Self {
        let profile = Feature::Plane { point: Vector::zeros(), normal: Vector::from([0.0, sign]) };
        Self::Revolved { end, along, profile: Box::new(profile) }
    }

    /// d and ∇d at `x`.
    pub(crate) fn at<T: Real>(&self, x: &Vector<T, D>) -> Distance<T, D> {
        match self {
            Self::Plane { point, normal } => {
                let normal = normal.map(T::lit);
                Distance { distance: (x - point.map(T::lit)).dot(&normal), normal }
            }
            Self::Sphere { center, radius, sign } => {
                let (length, direction) = length_and_direction(&(x - center.map(T::lit)));
                let sign = T::lit(*sign);
                Distance { distance: sign * (length - T::lit(*radius)), normal: direction * sign }
            }
            Self::Revolved { end, along, profile } => {
                let (place, outward) = in_profile(end, along, x);
                let Distance { distance, normal } = profile.at(&place);
                Distance { distance, normal: along.map(T::lit) * normal[0] + outward * normal[1] }
            }
        }
    }

    /// ∇²d at `x`, the curvature of the surfaces of equal distance.
    pub(crate) fn curvature(&self, x: &Vector<f64, D>) -> Tensor<f64, D> {
        match self {
            Self::Plane { .. } => Tensor::zeros(),
            // ∇²|x − c| = (1 − m ⊗ m)/|x − c|
            Self::Sphere { center, sign, .. } => {
                let (length, m) = length_and_direction(&(x - center));
                let at_center = length == 0.0;
                (identity::<f64, D>() - outer(&m, &m)) * if at_center { 0.0 } else { sign / length }
            }
            // With q = (s, ρ): ∇²d = Σ ∂²d/∂q_a∂q_b ∇q_a ⊗ ∇q_b + ∂d/∂ρ ∇²ρ, and ∇²ρ = (1 − e ⊗ e − m ⊗ m)/ρ
            Self::Revolved { end, along, profile } => {
                let (place, outward) = in_profile(end, along, x);
                let (normal, second) = (profile.at(&place).normal, profile.curvature(&place));
                let around = identity::<f64, D>() - outer(along, along) - outer(&outward, &outward);
                // On the axis, under a flat end, ∂d/∂ρ is zero.
                let flat = D == 2 || normal[1] == 0.0 || place[1] == 0.0;
                let mut curvature = around * if flat { 0.0 } else { normal[1] / place[1] };
                for (a, of_a) in [along, &outward].into_iter().enumerate() {
                    for (b, of_b) in [along, &outward].into_iter().enumerate() {
                        curvature += outer(of_a, of_b) * second[(a, b)];
                    }
                }
                curvature
            }
        }
    }

    /// The feature of the solid's complement.
    pub(super) fn flipped(self) -> Self {
        match self {
            Self::Plane { point, normal } => Self::Plane { point, normal: -normal },
            Self::Sphere { center, radius, sign } => Self::Sphere { center, radius, sign: -sign },
            Self::Revolved { end, along, profile } => {
                Self::Revolved { end, along, profile: Box::new(profile.flipped()) }
            }
        }
    }

    /// The feature turned and scaled about a point, x ↦ c + s R (x − c).
    pub(super) fn moved(self, about: &Vector<f64, D>, rotation: &Tensor<f64, D>, factor: f64) -> Self {
        let to = |x: Vector<f64, D>| about + rotation * (x - about) * factor;
        match self {
            Self::Plane { point, normal } => Self::Plane { point: to(point), normal: rotation * normal },
            Self::Sphere { center, radius, sign } => Self::Sphere { center: to(center), radius: radius * factor, sign },
            Self::Revolved { end, along, profile } => {
                let profile = Box::new(profile.moved(&Vector::zeros(), &identity(), factor));
                Self::Revolved { end: to(end), along: rotation * along, profile }
            }
        }
    }
}

/// |r| and r/|r|; any unit vector where r = 0.
fn length_and_direction<T: Real, const D: usize>(r: &Vector<T, D>) -> (T, Vector<T, D>) {
    let squared = r.dot(r);
    if squared.value() == 0.0 {
        return (T::zero(), axis::<D>(0, 1.0).map(T::lit));
    }
    let length = squared.sqrt();
    (length, r * length.recip())
}

/// The position (s, ρ) of `x` in the profile, and the unit vector away from the axis.
fn in_profile<T: Real, const D: usize>(
    end: &Vector<f64, D>,
    along: &Vector<f64, D>,
    x: &Vector<T, D>,
) -> (Vector<T, 2>, Vector<T, D>) {
    let (from_end, along) = (x - end.map(T::lit), along.map(T::lit));
    let s = from_end.dot(&along);
    let (rho, outward) = length_and_direction(&(from_end - along * s));
    (Vector::from([s, rho]), outward)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{Ball, Block, Cone, Difference, HalfSpace, Polygon, Shape, Similar, Surface, rotation};
    use num_dual::Dual64;

    /// The distance and the normal of the feature are those of the shape, and the curvature is the derivative of the normal.
    fn check<const D: usize>(shape: &Shape<D>, points: &[[f64; D]]) {
        for &at in points {
            let x = Vector::from(at);
            let (feature, (d, n)) = (shape.feature(&x), shape.distance_and_normal(&x));
            let Distance { distance, normal } = feature.at(&x);
            assert!((distance - d).abs() < 1e-13 && (normal - n).norm() < 1e-12, "{shape:?} at {at:?}: {feature:?}");
            let curvature = feature.curvature(&x);
            for k in 0..D {
                let seeded = Vector::from_fn(|i, _| Dual64::new(x[i], if i == k { 1.0 } else { 0.0 }));
                let along = feature.at(&seeded);
                assert!((along.distance.eps - n[k]).abs() < 1e-12);
                let change = along.normal.map(|n| n.eps);
                assert!((change - curvature.column(k)).norm() < 1e-12, "{shape:?} at {at:?}: {curvature}");
                // Beside the point, the shape has the same distance.
                let near = x + axis::<D>(k, 1e-7);
                assert!(
                    (feature.at(&near).distance - shape.signed_distance(&near)).abs() < 1e-13,
                    "{shape:?} near {at:?}"
                );
            }
        }
    }

    #[test]
    fn features_are_the_surfaces_around_a_point_in_2d() -> Result<(), Box<dyn std::error::Error>> {
        let points = [[0.3, 0.2], [2.4, 0.7], [2.3, 1.6], [-0.4, -0.3], [0.9, 0.4], [1.7, 1.1]];
        let block = Block { min: Vector::from([0.0, 0.0]), max: Vector::from([2.0, 1.0]) };
        let ball = Ball { center: Vector::from([1.0, 0.5]), radius: 0.4 };
        let corners = [[0.0, 0.0], [2.0, 0.0], [1.0, 0.4], [0.2, 1.0]].map(Vector::from);
        check(&block.clone().into(), &points);
        check(&ball.clone().into(), &points);
        check(&Difference { of: Box::new(block.clone().into()), minus: Box::new(ball.clone().into()) }.into(), &points);
        check(
            &Shape::union(vec![block.into(), Ball { center: Vector::from([2.5, 1.5]), radius: 0.3 }.into()]),
            &points,
        );
        check(&Polygon::new(corners.to_vec())?.into(), &points);
        let turned = rotation::<2>(30.0, None).ok_or("plane")?;
        let about = Vector::from([0.5, 0.0]);
        check(&Similar { of: Box::new(ball.into()), about, rotation: turned, factor: 1.5 }.into(), &points);
        check(&HalfSpace { point: about, normal: Vector::from([1.0, 2.0]) }.into(), &points);
        Ok(())
    }

    #[test]
    fn features_are_the_surfaces_around_a_point_in_3d() -> Result<(), Box<dyn std::error::Error>> {
        let points =
            [[0.3, 0.2, 0.1], [1.4, 1.7, 0.5], [1.3, 1.6, 1.2], [-0.4, 0.3, 0.6], [0.9, 0.4, 1.5], [2.7, 0.1, 0.3]];
        check(&Block { min: Vector::zeros(), max: Vector::from([1.0, 1.0, 1.0]) }.into(), &points);
        let ends = [Vector::from([0.0, 0.5, 0.5]), Vector::from([2.0, 0.6, 0.5])];
        let cone = Shape::from(Cone::new(ends, [0.6, 0.2]).ok_or("cone")?);
        check(&cone, &points);
        // Under a flat end, on the axis.
        let straight = Shape::from(Cone::new([Vector::zeros(), axis(2, 2.0)], [1.0, 1.0]).ok_or("cylinder")?);
        let x = Vector::from([0.0, 0.0, 1.9]);
        assert_eq!(straight.feature(&x).curvature(&x), Tensor::<f64, 3>::zeros());
        let turned = rotation::<3>(50.0, Some(&Vector::from([1.0, 2.0, 0.5]))).ok_or("space")?;
        check(&Similar { of: Box::new(cone), about: Vector::zeros(), rotation: turned, factor: 0.7 }.into(), &points);
        let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vector::from).to_vec();
        let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        check(&Surface::new(vertices, triangles)?.into(), &points);
        Ok(())
    }
}
