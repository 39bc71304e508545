//! The law of contact between a point of a surface and an obstacle or another body: a one-sided penalty, and Coulomb friction with an
//! elastic slip.
//!
//! All vectors are in the frame of the obstacle, where the obstacle rests. The surface of another body counts as a plane through the
//! projection of the point, and all vectors are relative to the material there. With the gap g < 0, the normal n = ∇g, the position y of the
//! point and its anchor a, the traction on the body per reference area is
//!
//! - pressure: p n with p = −k g
//! - friction: −μ p s/ε while |s| ≤ ε (stick), else −μ p s/|s| (slip), with the slip s = (1 − n ⊗ n)(y − a)
//!
//! In the energy–momentum scheme, p is the mean over the step from the gap g_n to g_{n+1}, with the potential ψ = ½ k ⟨−g⟩²:
//!
//! p = −(ψ(g_{n+1}) − ψ(g_n))/(g_{n+1} − g_n)
//!
//! It acts along the normal at the middle of the step. Its work on a plane that does not turn is the change of ψ, also in steps in which
//! contact begins or ends.
//!
//! Under large pressures ε grows to μ p/k. Friction in stick is then −k s, and has a potential.
//!
//! The smallest elastic slip is a small part of the grid spacing. This slip does not depend on the pressure, so Newton's method also finds
//! the points that stick under small pressures.

use crate::scalar::Real;
use crate::shape::Feature;
use crate::tensor::{Tensor, Vector, identity, outer};

/// The state of friction.
enum State {
    /// Stick under a large pressure: −k s.
    Spring,
    /// Stick: −μ p s/ε.
    Stick,
    /// Slip: −μ p s/|s|.
    Slip,
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
    /// ε
    pub(super) elastic_slip: f64,
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

/// The parts of the traction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Response {
    /// The pressure p n.
    Pressure,
    /// Friction.
    Friction,
}

impl<const D: usize> ContactLaw<D> {
    /// The traction on the body, per reference area.
    pub fn traction<T: Real>(&self, response: Response, y: &Vector<T, D>) -> Vector<T, D> {
        let (normal, pressure) = (self.feature.at(y).normal, self.pressure(y));
        if response == Response::Pressure {
            mutant!("contact: an obstacle pulls": { return normal * -pressure; });
            return normal * pressure;
        }
        let slip = self.slip(y, &normal);
        mutant!("contact: friction pushes forwards": slip = -slip);
        let length = slip.dot(&slip);
        match self.state(length.value().sqrt(), pressure.value()) {
            State::Spring => slip * T::lit(-self.stiffness),
            State::Stick => slip * (-pressure * T::lit(self.friction / self.elastic_slip)),
            State::Slip => slip * (-pressure * T::lit(self.friction) * length.sqrt().recip()),
        }
    }

    /// p
    fn pressure<T: Real>(&self, y: &Vector<T, D>) -> T {
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

    /// The state of friction at a slip of this length.
    fn state(&self, length: f64, pressure: f64) -> State {
        let limit = self.friction * pressure / self.stiffness;
        if length > limit.max(self.elastic_slip) {
            State::Slip
        } else if limit > self.elastic_slip {
            State::Spring
        } else {
            State::Stick
        }
    }

    /// −∂t/∂y of the traction t.
    pub fn tangent(&self, response: Response, y: &Vector<f64, D>) -> Tensor<f64, D> {
        let (n, pressure) = (self.feature.at(y).normal, self.pressure(y));
        let (slope, mu) = (self.pressure_slope(y), self.friction);
        let curvature = self.feature.curvature(y);
        if response == Response::Pressure {
            mutant!("contact: the tangent lacks the curvature of the obstacle": curvature = Tensor::zeros());
            // −n ⊗ ∂p/∂y − p ∇²g, which is k (n ⊗ n + g ∇²g) at one instant
            return outer(&n, &slope) - curvature * pressure;
        }
        let r = y - self.anchor;
        let slip = self.slip(y, &n);
        // ∂s/∂y = 1 − n ⊗ n − (n·r) ∇²g − n ⊗ ∇²g r
        let of_slip = identity::<f64, D>() - outer(&n, &n) - curvature * n.dot(&r) - outer(&n, &(curvature * r));
        let length = slip.norm();
        // −∂t/∂y = μ (q ⊗ ∂p/∂y + p ∂q/∂y), with t = −μ p q
        let (q, of_q) = match self.state(length, pressure) {
            State::Spring => return of_slip * self.stiffness,
            State::Stick => (slip / self.elastic_slip, of_slip / self.elastic_slip),
            State::Slip => {
                let m = slip / length;
                (m, (identity::<f64, D>() - outer(&m, &m)) * of_slip / length)
            }
        };
        let of_pressure = -outer(&q, &slope);
        mutant!("contact: friction does not feel the change of pressure": of_pressure = Tensor::zeros());
        (of_pressure + of_q * pressure) * mu
    }

    /// ½ k g², the potential of the pressure per reference area.
    pub fn energy<T: Real>(&self, y: &Vector<T, D>) -> T {
        let gap = self.feature.at(y).distance;
        gap * gap * T::lit(0.5 * self.stiffness)
    }

    /// The anchor after a step that ends at `y`: it follows a slip at the distance of the elastic slip.
    pub fn new_anchor(&self, y: &Vector<f64, D>) -> Vector<f64, D> {
        let slip = self.slip(y, &self.feature.at(y).normal);
        let length = slip.norm();
        mutant!("contact: a slip does not move the anchor": length = 0.0);
        let elastic = self.elastic_slip.max(self.friction * self.depth(y));
        if length <= elastic { self.anchor } else { y - slip * (elastic / length) }
    }

    /// The part of a vector along the surface, which is a plane between bodies.
    pub fn along(&self, v: &Vector<f64, D>) -> Vector<f64, D> {
        let normal = self.feature.at(v).normal;
        v - normal * normal.dot(v)
    }

    /// −g, the depth of the point in the obstacle or in the other body.
    pub fn depth(&self, y: &Vector<f64, D>) -> f64 {
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
                        let law = ContactLaw { feature, stiffness, friction, elastic_slip: 0.01, anchor, mean };
                        if start.is_none() && middle > 0.0 {
                            continue;
                        }
                        for response in [Response::Pressure, Response::Friction] {
                            let tangent = law.tangent(response, &y);
                            for k in 0..3 {
                                let seeded = Vector::from_fn(|i, _| Dual64::new(y[i], f64::from(i == k)));
                                let dual = law.traction(response, &seeded).map(|t| -t.eps);
                                let error = (tangent.column(k) - dual).norm();
                                assert!(
                                    error < 1e-12 * 50.0,
                                    "{before}, {middle}, slip {slip}, {response:?}: {error:e}"
                                );
                            }
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn the_work_of_the_mean_pressure_on_a_plane_is_the_change_of_the_potential() {
        let normal = Vector::from([0.6, 0.8]);
        for (before, after) in [(-0.02, -0.05), (0.02, -0.05), (-0.02, 0.05), (0.01, 0.02)] {
            let (start, end) = (normal * before, normal * after + Vector::from([0.8, -0.6]) * 0.1);
            let feature = Feature::Plane { point: Vector::zeros(), normal };
            let map = identity::<f64, 2>() * 2.0;
            let mean = Some(Ends { gap: before, feature: feature.clone(), map, shift: -start });
            let law = ContactLaw { feature, stiffness: 3.0, friction: 0.0, elastic_slip: 0.01, anchor: start, mean };
            let work = law.traction(Response::Pressure, &((start + end) * 0.5)).dot(&(end - start));
            let energy = |gap: f64| 1.5 * gap.min(0.0).powi(2);
            assert!((work + energy(after) - energy(before)).abs() < 1e-16, "{before}, {after}: {work}");
        }
    }
}
