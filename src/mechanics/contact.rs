//! The law of contact between a point of a surface and a rigid obstacle: a one-sided penalty, and Coulomb friction with an elastic slip.
//!
//! All vectors are in the frame of the obstacle, where the obstacle rests. With the gap g < 0, the normal n = ∇g, the position y of the
//! point and its anchor a, the traction on the body per reference area is
//!
//! - pressure: p n with p = −k g
//! - friction: −μ p s/ε while |s| ≤ ε (stick), else −μ p s/|s| (slip), with the slip s = (1 − n ⊗ n)(y − a)
//!
//! Under large pressures ε grows to μ p/k. Friction in stick is then −k s, and has a potential.
//!
//! The smallest elastic slip is a small part of the grid spacing. This slip does not depend on the pressure, so Newton's method also finds
//! the points that stick under small pressures.

use crate::mechanics::loads::{Obstacles, Pose, SurfacePoint};
use crate::scalar::Real;
use crate::shape::{Distance, Feature};
use crate::tensor::{Tensor, Vector, identity, outer};

/// The smallest elastic slip ε in grid spacings.
const ELASTIC_SLIP: f64 = 0.005;

/// The state of friction.
enum State {
    /// Stick under a large pressure: −k s.
    Spring,
    /// Stick: −μ p s/ε.
    Stick,
    /// Slip: −μ p s/|s|.
    Slip,
}

/// The law of contact at one point that touches an obstacle.
#[derive(Clone, Debug)]
pub(crate) struct ContactLaw<const D: usize> {
    /// The surface of the obstacle at the point.
    feature: Feature<D>,
    /// k
    stiffness: f64,
    /// μ
    friction: f64,
    /// ε
    elastic_slip: f64,
    /// a
    anchor: Vector<f64, D>,
}

/// A point that touches an obstacle.
pub(crate) struct ContactPoint<'a, T, const D: usize> {
    /// The number of the obstacle.
    pub obstacle: usize,
    /// The number of the point in [`Obstacles::points`].
    pub number: usize,
    /// The point.
    pub point: &'a SurfacePoint<D>,
    /// The pose of the obstacle.
    pub pose: Pose<D>,
    /// The law there.
    pub law: ContactLaw<D>,
    /// The position of the point in the frame of the obstacle.
    pub y: Vector<T, D>,
}

/// All points that touch an obstacle at time `t`. `position` and `stiffness` (pressure per depth) are functions of the particle. `spacing` is
/// that of the grid.
pub(crate) fn contact_points<'a, T: Real, const D: usize>(
    Obstacles { points, list }: &'a Obstacles<D>,
    t: f64,
    spacing: f64,
    stiffness: impl Fn(usize) -> f64,
    position: impl Fn(usize) -> Vector<T, D>,
) -> Vec<ContactPoint<'a, T, D>> {
    let poses: Vec<Pose<D>> = list.iter().map(|obstacle| obstacle.pose(t)).collect();
    let mut found = Vec::new();
    for (number, point) in points.iter().enumerate() {
        let x = position(point.particle);
        for (index, (obstacle, pose)) in list.iter().zip(&poses).enumerate() {
            let y = pose.rotation.map(T::lit).tr_mul(&(x - pose.shift.map(T::lit)));
            let at = y.map(T::value);
            // NaN touches nothing.
            if obstacle.shape.signed_distance(&at) < 0.0 {
                let law = ContactLaw {
                    feature: obstacle.shape.feature(&at),
                    stiffness: obstacle.stiffness * stiffness(point.particle),
                    friction: obstacle.friction,
                    elastic_slip: ELASTIC_SLIP * spacing,
                    anchor: obstacle.anchors.get(number).copied().unwrap_or(at),
                };
                found.push(ContactPoint { obstacle: index, number, point, pose: *pose, law, y });
            }
        }
    }
    found
}

impl<const D: usize> ContactPoint<'_, f64, D> {
    /// The force on the body.
    pub fn force(&self) -> Vector<f64, D> {
        let traction = self.law.traction(Response::Pressure, &self.y) + self.law.traction(Response::Friction, &self.y);
        self.pose.rotation * traction * self.point.area
    }
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
        let Distance { distance, normal } = self.feature.at(y);
        let pressure = -distance * T::lit(self.stiffness);
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
        let Distance { distance, normal: n } = self.feature.at(y);
        let (k, mu) = (self.stiffness, self.friction);
        let curvature = self.feature.curvature(y);
        if response == Response::Pressure {
            mutant!("contact: the tangent lacks the curvature of the obstacle": curvature = Tensor::zeros());
            // k (n ⊗ n + g ∇²g)
            return (outer(&n, &n) + curvature * distance) * k;
        }
        let r = y - self.anchor;
        let slip = self.slip(y, &n);
        let pressure = -k * distance;
        // ∂s/∂y = 1 − n ⊗ n − (n·r) ∇²g − n ⊗ ∇²g r
        let of_slip = identity::<f64, D>() - outer(&n, &n) - curvature * n.dot(&r) - outer(&n, &(curvature * r));
        let length = slip.norm();
        // −∂t/∂y = μ (q ⊗ ∂p/∂y + p ∂q/∂y), with t = −μ p q and ∂p/∂y = −k n
        let (q, of_q) = match self.state(length, pressure) {
            State::Spring => return of_slip * k,
            State::Stick => (slip / self.elastic_slip, of_slip / self.elastic_slip),
            State::Slip => {
                let m = slip / length;
                (m, (identity::<f64, D>() - outer(&m, &m)) * of_slip / length)
            }
        };
        let of_pressure = outer(&q, &n) * -k;
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

    /// −g, the depth of the point in the obstacle.
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
