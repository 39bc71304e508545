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

use crate::mechanics::loads::{BodyContact, Contacts, Facing, Partner, Pose, SurfacePoint};
use crate::mechanics::sweep::Supports;
use crate::scalar::Real;
use crate::shape::Feature;
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

/// The law of contact at one point.
#[derive(Clone, Debug)]
pub(crate) struct ContactLaw<const D: usize> {
    /// The surface of the obstacle or of the other body at the point.
    feature: Feature<D>,
    /// k
    stiffness: f64,
    /// μ
    friction: f64,
    /// ε
    elastic_slip: f64,
    /// a
    anchor: Vector<f64, D>,
    /// The ends of the step, where the pressure is the mean between them.
    mean: Option<Ends<D>>,
}

/// Both ends of a step whose middle is the point y.
#[derive(Clone, Debug)]
struct Ends<const D: usize> {
    /// g_n
    gap: f64,
    /// The surface at y_{n+1}.
    feature: Feature<D>,
    /// y_{n+1} = A y + b, in the frame that the obstacle has there.
    map: Tensor<f64, D>,
    shift: Vector<f64, D>,
}

/// The partner of a point in contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Touching {
    /// An obstacle, by its number.
    Obstacle(usize),
    /// Another body.
    Pair {
        /// The number of the pair.
        pair: usize,
        /// Whether the point belongs to the first body of the pair.
        is_first: bool,
    },
}

/// A place at a fixed offset from a particle, in the configuration of the last grid reset, and its share of a relative position.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Carrier<const D: usize> {
    pub particle: usize,
    pub share: f64,
    pub offset: Vector<f64, D>,
}

/// A point of a surface that touches an obstacle or another body.
pub(crate) struct ContactPoint<T, const D: usize> {
    pub touching: Touching,
    /// The number of the point in [`Contacts::points`].
    pub number: usize,
    /// The reference area that the point stands for. Both bodies of a pair have points, each for half its area.
    pub area: f64,
    /// The places whose positions, times their shares, sum to the position of the point; relative to the other body, where it touches one.
    pub carriers: Vec<Carrier<D>>,
    /// The pose of the obstacle. A pair has the frame of space.
    pub pose: Pose<D, T>,
    /// The law there.
    pub law: ContactLaw<D>,
    /// The position of the point in the frame of the obstacle, or relative to the place on the other body.
    pub y: Vector<T, D>,
}

/// The surroundings of the contacts: the time, the grid spacing, the penalty stiffness of a particle's body (pressure per depth), and the
/// position of a carrier.
pub(crate) struct Surroundings<'a, S, P, const D: usize> {
    pub t: f64,
    /// t_n and the positions of the particles there, where pressures are means over the step.
    pub start: Option<(f64, &'a [Vector<f64, D>])>,
    pub spacing: f64,
    pub stiffness: S,
    pub position: P,
}

/// The poses of all obstacles at t_n and t_{n+1}, and the positions of the particles at t_n, where pressures are means over the step.
type StepEnds<'a, const D: usize> = Option<([Vec<Pose<D>>; 2], &'a [Vector<f64, D>])>;

/// All points that touch an obstacle, with the poses of all obstacles.
pub(crate) fn obstacle_points<T: Real, const D: usize>(
    contacts: &Contacts<D>,
    around: &Surroundings<'_, impl Fn(usize) -> f64, impl Fn(&Carrier<D>) -> Vector<T, D>, D>,
    poses: &[Pose<D, T>],
) -> Vec<ContactPoint<T, D>> {
    let Contacts { points, obstacles, .. } = contacts;
    let poses_at = |t: f64| obstacles.iter().map(|obstacle| obstacle.pose(t)).collect::<Vec<Pose<D>>>();
    let ends = around.start.map(|(t_n, at)| ([poses_at(t_n), poses_at(2.0 * around.t - t_n)], at));
    let mut found = Vec::new();
    for number in (0..points.len()).filter(|_| !obstacles.is_empty()) {
        let x = (around.position)(&Carrier::at(points[number].particle));
        let touched = |(index, pose)| obstacle_point(contacts, around, &ends, (number, &x), (index, pose));
        found.extend(poses.iter().enumerate().filter_map(touched));
    }
    found
}

/// All points that touch a free obstacle in a pose.
pub(crate) fn points_on<T: Real, const D: usize>(
    contacts: &Contacts<D>,
    around: &Surroundings<'_, impl Fn(usize) -> f64, impl Fn(&Carrier<D>) -> Vector<T, D>, D>,
    index: usize,
    pose: &Pose<D, T>,
) -> Vec<ContactPoint<T, D>> {
    let point = |(number, point): (usize, &SurfacePoint<D>)| {
        let x = (around.position)(&Carrier::at(point.particle));
        obstacle_point(contacts, around, &None, (number, &x), (index, pose))
    };
    contacts.points.iter().enumerate().filter_map(point).collect()
}

/// The contact of a point with an obstacle; `None` without contact.
fn obstacle_point<T: Real, const D: usize>(
    Contacts { points, obstacles, .. }: &Contacts<D>,
    Surroundings { spacing, stiffness, .. }: &Surroundings<
        '_,
        impl Fn(usize) -> f64,
        impl Fn(&Carrier<D>) -> Vector<T, D>,
        D,
    >,
    ends: &StepEnds<'_, D>,
    (number, x): (usize, &Vector<T, D>),
    (index, pose): (usize, &Pose<D, T>),
) -> Option<ContactPoint<T, D>> {
    let (SurfacePoint { particle, area, .. }, obstacle) = (points[number], &obstacles[index]);
    let y = pose.to_frame(x);
    let at = y.map(T::value);
    let distance = |y: &Vector<f64, D>| obstacle.shape.signed_distance(y);
    let mean = ends.as_ref().map(|([first, last], start)| {
        // x_{n+1} = 2 x − x_n
        let (x_n, last) = (&start[particle], last[index]);
        let map = last.rotation.tr_mul(&pose.rotation.map(T::value)) * 2.0;
        let shift = last.rotation.tr_mul(&(pose.shift.map(T::value) * 2.0 - x_n - last.shift));
        let feature = obstacle.shape.feature(&(map * at + shift));
        Ends { gap: distance(&first[index].to_frame(x_n)), feature, map, shift }
    });
    let deepest = mean.as_ref().map_or(f64::INFINITY, |mean| mean.gap.min(distance(&(mean.map * at + mean.shift))));
    // NaN touches nothing.
    let here = distance(&at);
    if here.is_nan() || here.min(deepest) >= 0.0 {
        return None;
    }
    let law = ContactLaw {
        feature: obstacle.shape.feature(&at),
        stiffness: obstacle.stiffness * stiffness(particle),
        friction: obstacle.friction,
        elastic_slip: ELASTIC_SLIP * spacing,
        anchor: obstacle.anchors.get(number).copied().unwrap_or(at),
        mean,
    };
    let carriers = vec![Carrier::at(particle)];
    Some(ContactPoint { touching: Touching::Obstacle(index), number, area, carriers, pose: *pose, law, y })
}

/// All points that touch another body.
pub(crate) fn pair_points<T: Real, const D: usize>(
    contacts: &Contacts<D>,
    around: &Surroundings<'_, impl Fn(usize) -> f64, impl Fn(&Carrier<D>) -> Vector<T, D>, D>,
) -> Vec<ContactPoint<T, D>> {
    let facing = contacts.between.iter().flat_map(|between| between.facing.iter().map(move |one| (between, one)));
    facing.filter_map(|(between, one)| pair_point(contacts, between, one, around)).collect()
}

/// The contact of a point that faces another body; `None` without contact.
fn pair_point<T: Real, const D: usize>(
    contacts: &Contacts<D>,
    between: &BodyContact<D>,
    one: &Facing<D>,
    Surroundings { start, spacing, stiffness, position, .. }: &Surroundings<
        '_,
        impl Fn(usize) -> f64,
        impl Fn(&Carrier<D>) -> Vector<T, D>,
        D,
    >,
) -> Option<ContactPoint<T, D>> {
    let carriers = one.carriers(contacts);
    let y: Vector<T, D> =
        carriers.iter().fold(Vector::zeros(), |y, carrier| y + position(carrier) * T::lit(carrier.share));
    let feature = Feature::Plane { point: Vector::zeros(), normal: one.normal };
    let gap = one.normal.dot(&y.map(T::value));
    let mean = start.map(|_| Ends {
        gap: one.normal.dot(&one.start),
        feature: feature.clone(),
        map: identity::<f64, D>() * 2.0,
        shift: -one.start,
    });
    let deepest = mean.as_ref().map_or(gap, |mean| gap.min(mean.gap).min(2.0 * gap - mean.gap));
    // NaN touches nothing.
    if gap.is_nan() || deepest >= 0.0 {
        return None;
    }
    let softer = carriers.iter().map(|carrier| stiffness(carrier.particle)).fold(f64::INFINITY, f64::min);
    let slip = between.slips.get(one.number).copied().unwrap_or_else(Vector::zeros);
    // The slip is y − a along the surface.
    let anchor = one.start - slip;
    mutant!("contact: bodies forget their slip": anchor = one.start);
    let law = ContactLaw {
        feature,
        stiffness: between.stiffness * softer,
        friction: between.friction,
        elastic_slip: ELASTIC_SLIP * spacing,
        anchor,
        mean,
    };
    Some(ContactPoint {
        touching: Touching::Pair { pair: one.pair, is_first: one.is_first },
        number: one.number,
        area: 0.5 * contacts.points[one.number].area,
        carriers,
        pose: Pose { rotation: identity(), shift: Vector::zeros() }.lit(),
        law,
        y,
    })
}

impl<const D: usize> Carrier<D> {
    /// The particle itself.
    pub fn at(particle: usize) -> Self {
        Self { particle, share: 1.0, offset: Vector::zeros() }
    }

    /// The position after the nodal motion `phi` since the last grid reset.
    pub fn position<T: Real>(
        &self,
        reference: &[Vector<f64, D>],
        supports: &Supports<D>,
        phi: &[Vector<T, D>],
    ) -> Vector<T, D> {
        let start = (reference[self.particle] + self.offset).map(T::lit);
        self.weights(supports).fold(start, |x, (node, n)| x + phi[node] * T::lit(n))
    }

    /// The nodes that move the place, and their functions there: N + ∇N·offset.
    pub fn weights<'a>(&'a self, supports: &'a Supports<D>) -> impl Iterator<Item = (usize, f64)> + 'a {
        supports.of(self.particle).map(|(node, n, grad_n)| (node, n + grad_n.dot(&self.offset)))
    }
}

impl<const D: usize> Facing<D> {
    /// The point, and its projection with negative shares.
    pub(crate) fn carriers(&self, contacts: &Contacts<D>) -> Vec<Carrier<D>> {
        let particle = |number: usize| contacts.points[number].particle;
        let of = |&Partner { number, share, offset }: &Partner<D>| {
            mutant!("contact: the other body has no reaction": { return Carrier { particle: particle(number), share: 0.0, offset }; });
            mutant!("contact: the reaction acts beside the point": { return Carrier { particle: particle(number), share: -share, offset: Vector::zeros() }; });
            Carrier { particle: particle(number), share: -share, offset }
        };
        std::iter::once(Carrier::at(particle(self.number))).chain(self.partners.iter().map(of)).collect()
    }
}

impl<T: Real, const D: usize> ContactPoint<T, D> {
    /// The force on the body of the point.
    pub fn force(&self) -> Vector<T, D> {
        let traction = self.law.traction(Response::Pressure, &self.y) + self.law.traction(Response::Friction, &self.y);
        self.pose.rotation * traction * T::lit(self.area)
    }

    /// A part of this force.
    pub fn force_of(&self, response: Response) -> Vector<T, D> {
        self.pose.rotation * self.law.traction(response, &self.y) * T::lit(self.area)
    }
}

impl<const D: usize> ContactPoint<f64, D> {
    /// −∂f/∂x of a part of the force, at a fixed pose.
    pub fn stiffness_of(&self, response: Response) -> Tensor<f64, D> {
        let Pose { rotation, .. } = self.pose;
        rotation * self.law.tangent(response, &self.y) * rotation.transpose() * self.area
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
