//! The law of contact between a point of a surface and an obstacle or another body: a one-sided penalty, and Coulomb friction by a return map
//! (Simo and Laursen, Comput. Struct. 42, 1992).
//!
//! All vectors are in the frame of the obstacle, where the obstacle rests. The surface of another body counts as a plane through the
//! projection of the point, and all vectors are relative to the material there. With the gap g < 0, the normal n = ∇g, the position y of the
//! point and its anchor a, the traction on the body per reference area is
//!
//! ```text
//! pressure   p n          p = −k g                     potential ½ k g²
//! trial      t* = −k s    s = (1 − n ⊗ n)(y − a)
//! stick      t = t*       if |t*| ≤ μ p                potential ½ k |s|², a stays
//! slip       t = μ p t*/|t*|                           a follows at the distance μ p/k at the end of the step
//! ```
//!
//! The stiffness of stick does not grow with the pressure. A stiffness that did would make the tangent unsymmetric in stick, too, and bodies
//! at rest would flutter.
//!
//! In the energy–momentum scheme, p is the mean over the step from the gap g_n to g_{n+1}, with the potential ψ = ½ k ⟨−g⟩²:
//!
//! p = −(ψ(g_{n+1}) − ψ(g_n))/(g_{n+1} − g_n)
//!
//! It acts along the normal at the middle of the step. Its work on a plane that does not turn is the change of ψ, also in steps in which
//! contact begins or ends.

use crate::material::{Law, p_wave_modulus, poissons_ratio};
use crate::scalar::Real;
use crate::shape::Feature;
use crate::tensor::{Tensor, Vector, identity, outer};

/// The largest modulus of contact in units of G. It is that of ν = 1/3, and bounds the stiffness of nearly incompressible bodies.
const MOST_SHEAR: f64 = 4.0;

/// The pressure at a depth of one spacing, for a penalty stiffness of 1: Λ + 2G of a law, but at most 4G.
pub(crate) fn contact_modulus<L: Law>(law: &L) -> f64 {
    let (uniaxial, nu) = (p_wave_modulus(law), poissons_ratio(law));
    // G = (Λ + 2G) (1 − 2ν)/(2 (1 − ν))
    let shear = uniaxial * (1.0 - 2.0 * nu) / (2.0 * (1.0 - nu));
    if shear > 0.0 { uniaxial.min(MOST_SHEAR * shear) } else { uniaxial }
}

/// The law of contact at one point.
#[derive(Clone, Debug)]
pub(crate) struct ContactLaw<const D: usize> {
    /// The surface of the obstacle or of the other body at the point.
    pub(super) feature: Feature<D>,
    /// k
    pub(super) stiffness: f64,
    /// μ
    pub(super) friction: f64,
    /// a
    pub(super) anchor: Vector<f64, D>,
    /// The ends of the step, where the pressure is the mean between them.
    pub(super) mean: Option<Ends<D>>,
}

/// Both ends of a step whose middle is the point y.
#[derive(Clone, Debug)]
pub(super) struct Ends<const D: usize> {
    /// g_n
    pub(super) gap: f64,
    /// The surface at y_{n+1}.
    pub(super) feature: Feature<D>,
    /// y_{n+1} = A y + b, in the frame that the obstacle has there.
    pub(super) map: Tensor<f64, D>,
    pub(super) shift: Vector<f64, D>,
}

impl<const D: usize> ContactLaw<D> {
    /// The traction on the body, per reference area.
    pub(crate) fn traction<T: Real>(&self, y: &Vector<T, D>) -> Vector<T, D> {
        let (normal, pressure) = (self.feature.at(y).normal, self.pressure(y));
        mutant!("contact: an obstacle pulls": pressure = -pressure);
        normal * pressure + self.friction_under(pressure, y, &normal)
    }

    /// The part of the traction by friction.
    pub(crate) fn friction<T: Real>(&self, y: &Vector<T, D>) -> Vector<T, D> {
        self.friction_under(self.pressure(y), y, &self.feature.at(y).normal)
    }

    fn friction_under<T: Real>(&self, pressure: T, y: &Vector<T, D>, normal: &Vector<T, D>) -> Vector<T, D> {
        if !self.has_friction() {
            return Vector::zeros();
        }
        let trial = self.slip(y, normal) * T::lit(-self.stiffness);
        mutant!("contact: friction pushes forwards": trial = -trial);
        let (size, limit) = (trial.dot(&trial), pressure * T::lit(self.friction));
        if size.value() <= limit.value().powi(2) { trial } else { trial * (limit * size.sqrt().recip()) }
    }

    /// p
    pub(crate) fn pressure<T: Real>(&self, y: &Vector<T, D>) -> T {
        let Some((before, after)) = self.gaps(y) else { return self.feature.at(y).distance * T::lit(-self.stiffness) };
        let half = T::lit(0.5 * self.stiffness);
        match (before.value() < 0.0, after.value() < 0.0) {
            (true, true) => -(before + after) * half,
            (false, true) => after * after / (before - after) * half,
            (true, false) => before * before / (after - before) * half,
            (false, false) => T::zero(),
        }
    }

    /// −∂p/∂y
    fn pressure_slope(&self, y: &Vector<f64, D>) -> Vector<f64, D> {
        let (Some((before, after)), Some(mean)) = (self.gaps(y), &self.mean) else {
            return self.feature.at(y).normal * self.stiffness;
        };
        let change = (after - before).powi(2);
        let share = match (before < 0.0, after < 0.0) {
            (true, true) => 1.0,
            (false, true) => after * (after - 2.0 * before) / change,
            (true, false) => before * before / change,
            (false, false) => 0.0,
        };
        mutant!("contact: the mean pressure has the tangent of full contact": share = 1.0);
        // ∂g_{n+1}/∂y = Aᵀ n, which is twice the normal of an obstacle at rest.
        mean.map.tr_mul(&mean.feature.at(&(mean.map * y + mean.shift)).normal) * (0.5 * share * self.stiffness)
    }

    /// g_n and g_{n+1}, where the pressure is the mean over the step.
    fn gaps<T: Real>(&self, y: &Vector<T, D>) -> Option<(T, T)> {
        let mean = self.mean.as_ref()?;
        let end = mean.map.map(T::lit) * y + mean.shift.map(T::lit);
        Some((T::lit(mean.gap), mean.feature.at(&end).distance))
    }

    /// −∂t/∂y of the traction t.
    pub(crate) fn tangent(&self, y: &Vector<f64, D>) -> Tensor<f64, D> {
        let (n, pressure) = (self.feature.at(y).normal, self.pressure(y));
        let (slope, mu) = (self.pressure_slope(y), self.friction);
        let curvature = self.feature.curvature(y);
        mutant!("contact: the tangent lacks the curvature of the obstacle": curvature = Tensor::zeros());
        // −n ⊗ ∂p/∂y − p ∇²g, which is k (n ⊗ n + g ∇²g) at one instant
        let of_pressure = outer(&n, &slope) - curvature * pressure;
        if !self.has_friction() {
            return of_pressure;
        }
        let (r, slip) = (y - self.anchor, self.slip(y, &n));
        // ∂s/∂y = 1 − n ⊗ n − (n·r) ∇²g − n ⊗ ∇²g r
        let of_slip = identity::<f64, D>() - outer(&n, &n) - curvature * n.dot(&r) - outer(&n, &(curvature * r));
        let (length, longest) = (slip.norm(), mu * pressure / self.stiffness);
        if length <= longest {
            return of_pressure + of_slip * self.stiffness;
        }
        // With m = s/|s| and t = −μ p m: −∂t/∂y = μ (m ⊗ ∂p/∂y + p (1 − m ⊗ m) ∂s/∂y/|s|)
        let m = slip / length;
        let of_limit = -outer(&m, &slope);
        mutant!("contact: friction does not feel the change of pressure": of_limit = Tensor::zeros());
        of_pressure + (of_limit + (identity::<f64, D>() - outer(&m, &m)) * of_slip * (pressure / length)) * mu
    }

    /// ½ k g², the potential of the pressure per reference area.
    pub(crate) fn energy<T: Real>(&self, y: &Vector<T, D>) -> T {
        let gap = self.feature.at(y).distance;
        gap * gap * T::lit(0.5 * self.stiffness)
    }

    /// ½ k |s|², the energy stored by the elastic slip per reference area. The anchor is that of an end of a step.
    pub(crate) fn slip_energy(&self, y: &Vector<f64, D>) -> f64 {
        let slip = self.elastic_slip(y);
        mutant!("contact: the elastic slip stores nothing": slip = Vector::zeros());
        if self.has_friction() { 0.5 * self.stiffness * slip.norm_squared() } else { 0.0 }
    }

    /// Whether μ > 0.
    pub(crate) fn has_friction(&self) -> bool {
        self.friction > 0.0
    }

    /// The elastic slip at the end of a step, at most μ p/k long.
    pub(crate) fn elastic_slip(&self, y: &Vector<f64, D>) -> Vector<f64, D> {
        let slip = self.slip(y, &self.feature.at(y).normal);
        let (length, longest) = (slip.norm(), self.friction * self.depth(y));
        mutant!("contact: a slip does not move the anchor": longest = f64::INFINITY);
        if length <= longest { slip } else { slip * (longest / length) }
    }

    /// The anchor after a step that ends at `y`: it follows a slip at the distance of the elastic slip.
    pub(crate) fn new_anchor(&self, y: &Vector<f64, D>) -> Vector<f64, D> {
        y - self.elastic_slip(y)
    }

    /// −g, the depth of the point in the obstacle or in the other body.
    pub(crate) fn depth(&self, y: &Vector<f64, D>) -> f64 {
        -self.feature.at(y).distance
    }

    /// s = (1 − n ⊗ n)(y − a)
    fn slip<T: Real>(&self, y: &Vector<T, D>, normal: &Vector<T, D>) -> Vector<T, D> {
        let from_anchor = y - self.anchor.map(T::lit);
        mutant!("contact: the slip is not along the surface": { return from_anchor; });
        from_anchor - normal * normal.dot(&from_anchor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::Dual64;

    /// The surface in a frame that is turned.
    fn turned(feature: &Feature<3>, turn: &Tensor<f64, 3>) -> Feature<3> {
        match feature {
            Feature::Plane { point, normal } => Feature::Plane { point: turn * point, normal: turn * normal },
            Feature::Sphere { center, radius, sign } => {
                Feature::Sphere { center: turn * center, radius: *radius, sign: *sign }
            }
            other => other.clone(),
        }
    }

    /// The tangent against dual numbers, for gaps at both ends of a step, or at one instant.
    #[test]
    fn tangents_are_those_of_the_traction() {
        let vector = |a: [f64; 3]| Vector::<f64, 3>::from(a);
        let plane = Feature::Plane { point: Vector::zeros(), normal: vector([0.6, 0.0, 0.8]) };
        let ball = Feature::Sphere { center: vector([-0.6, 0.0, -0.8]), radius: 1.0, sign: 1.0 };
        // The distances from the surface at the start and in the middle, in which contact lasts, begins, ends and is passed.
        for (before, middle) in [(-0.02, -0.03), (0.02, -0.03), (0.04, 0.01), (-0.05, -0.01), (-0.02, 0.03)] {
            for (slip, friction) in [(0.0, 0.0), (1e-3, 0.3), (0.2, 0.3)] {
                for feature in [plane.clone(), ball.clone()] {
                    for start in [None, Some(vector([0.6, 0.0, 0.8]) * before + vector([0.01, 0.02, 0.0]))] {
                        let turn = Tensor::<f64, 3>::new(0.8, -0.6, 0.0, 0.6, 0.8, 0.0, 0.0, 0.0, 1.0);
                        let y = vector([0.6, 0.0, 0.8]) * middle + vector([-0.01, 0.03, 0.02]);
                        let anchor = y + vector([0.8, 0.3, -0.6]) * slip;
                        // The frame turns, so that y_{n+1} is not 2y − y_n there.
                        let mean = start.map(|start| Ends {
                            gap: feature.at(&start).distance,
                            feature: turned(&feature, &turn),
                            map: turn * 2.0,
                            shift: -(turn * start),
                        });
                        let (feature, stiffness) = (feature.clone(), 50.0);
                        let law = ContactLaw { feature, stiffness, friction, anchor, mean };
                        if start.is_none() && middle > 0.0 {
                            continue;
                        }
                        let tangent = law.tangent(&y);
                        for k in 0..3 {
                            let seeded = Vector::from_fn(|i, _| Dual64::new(y[i], f64::from(i == k)));
                            let dual = law.traction(&seeded).map(|t| -t.eps);
                            let error = (tangent.column(k) - dual).norm();
                            assert!(error < 1e-12 * 50.0, "{before}, {middle}, slip {slip}: {error:e}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_point_that_sticks_stores_the_work_of_its_friction() {
        let normal = Vector::from([0.6, 0.8]);
        let feature = Feature::Plane { point: Vector::zeros(), normal };
        let anchor = normal * -0.05;
        let law = ContactLaw { feature, stiffness: 50.0, friction: 0.4, anchor, mean: None };
        // Up to the limit of 0.02, the traction is the gradient of the energy. A mean of both ends is exact for a square.
        let [start, end] = [0.003, 0.017].map(|slip| anchor + Vector::from([0.8, -0.6]) * slip);
        let work = (law.friction(&start) + law.friction(&end)).dot(&(end - start)) * 0.5;
        let stored = law.slip_energy(&end) - law.slip_energy(&start);
        assert!((work + stored).abs() < 1e-15 && stored > 0.0, "{work} {stored}");
    }

    #[test]
    fn the_work_of_the_mean_pressure_on_a_plane_is_the_change_of_the_potential() {
        let normal = Vector::from([0.6, 0.8]);
        for (before, after) in [(-0.02, -0.05), (0.02, -0.05), (-0.02, 0.05), (0.01, 0.02)] {
            let (start, end) = (normal * before, normal * after + Vector::from([0.8, -0.6]) * 0.1);
            let feature = Feature::Plane { point: Vector::zeros(), normal };
            let map = identity::<f64, 2>() * 2.0;
            let mean = Some(Ends { gap: before, feature: feature.clone(), map, shift: -start });
            let law = ContactLaw { feature, stiffness: 3.0, friction: 0.0, anchor: start, mean };
            let work = law.traction(&((start + end) * 0.5)).dot(&(end - start));
            let energy = |gap: f64| 1.5 * gap.min(0.0).powi(2);
            assert!((work + energy(after) - energy(before)).abs() < 1e-16, "{before}, {after}: {work}");
        }
    }
}
