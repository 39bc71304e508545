//! The points of surfaces that touch an obstacle or another body.

use super::law::{ContactLaw, Ends};
use crate::mechanics::loads::{BodyContact, Candidate, ContactConstants, Contacts, Pose, Share, SurfacePoint};
use crate::mechanics::sweep::{Connectivity, Number};
use crate::parallel;
use crate::scalar::Real;
use crate::shape::Feature;
use crate::tensor::{Tensor, Vector, identity};

/// Points in one part of the work of a thread.
const POINTS: usize = 128;

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
        /// The number of the candidate in [`BodyContact::candidates`].
        candidate: usize,
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
    /// The reference area that the point stands for. Both bodies of a pair have points, each for a part of its area.
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

/// The surroundings of the contacts: the time, the penalty stiffness of a particle's body (pressure per depth), and the position of a carrier.
pub(crate) struct Surroundings<'a, S, P, const D: usize> {
    pub t: f64,
    /// t_n and the positions of the particles there, where pressures are means over the step.
    pub start: Option<(f64, &'a [Vector<f64, D>])>,
    pub stiffness: S,
    pub position: P,
}

/// The poses of all obstacles at t_n and t_{n+1}, and the positions of the particles at t_n, where pressures are means over the step.
type StepEnds<'a, const D: usize> = Option<([Vec<Pose<D>>; 2], &'a [Vector<f64, D>])>;

/// All points that touch an obstacle, with the poses of all obstacles.
pub(crate) fn obstacle_points<T: Number, const D: usize>(
    contacts: &Contacts<D>,
    around: &Surroundings<'_, impl Fn(usize) -> f64 + Sync, impl Fn(&Carrier<D>) -> Vector<T, D> + Sync, D>,
    poses: &[Pose<D, T>],
) -> Vec<ContactPoint<T, D>> {
    let Contacts { points, obstacles, .. } = contacts;
    if obstacles.is_empty() {
        return Vec::new();
    }
    let poses_at = |t: f64| obstacles.iter().map(|obstacle| obstacle.pose(t)).collect::<Vec<Pose<D>>>();
    let ends = around.start.map(|(t_n, at)| ([poses_at(t_n), poses_at(2.0 * around.t - t_n)], at));
    parallel::list_by(POINTS, points.len(), |number, list| {
        let x = (around.position)(&Carrier::at(points[number].particle));
        let touched = |(index, pose)| obstacle_point(contacts, around, &ends, (number, &x), (index, pose));
        list.extend(poses.iter().enumerate().filter_map(touched));
    })
}

/// All points that touch a free obstacle in a pose.
pub(crate) fn points_on<T: Number, const D: usize>(
    contacts: &Contacts<D>,
    around: &Surroundings<'_, impl Fn(usize) -> f64 + Sync, impl Fn(&Carrier<D>) -> Vector<T, D> + Sync, D>,
    index: usize,
    pose: &Pose<D, T>,
) -> Vec<ContactPoint<T, D>> {
    parallel::list_by(POINTS, contacts.points.len(), |number, list| {
        let x = (around.position)(&Carrier::at(contacts.points[number].particle));
        list.extend(obstacle_point(contacts, around, &None, (number, &x), (index, pose)));
    })
}

/// The contact of a point with an obstacle; `None` without contact.
fn obstacle_point<T: Real, const D: usize>(
    Contacts { points, obstacles, .. }: &Contacts<D>,
    Surroundings { stiffness, .. }: &Surroundings<'_, impl Fn(usize) -> f64, impl Fn(&Carrier<D>) -> Vector<T, D>, D>,
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
    let ContactConstants { stiffness, friction } = obstacle.constants.scaled(stiffness(particle));
    let anchor = obstacle.anchors.get(number).copied().unwrap_or(at);
    let law = ContactLaw { feature: obstacle.shape.feature(&at), stiffness, friction, anchor, mean };
    let carriers = vec![Carrier::at(particle)];
    Some(ContactPoint { touching: Touching::Obstacle(index), number, area, carriers, pose: *pose, law, y })
}

/// The share of the area of a point in contact with another body, of whose stiffness and its own it is the part `of_stiffness`. A surface
/// acts on the normals of the stiffer body, and an edge on those of the surface that it meets. The shares of both bodies sum to 1.
fn share(of_stiffness: f64, [own, other]: [f64; 2]) -> f64 {
    of_stiffness + (1.0 - of_stiffness) * own * (1.0 - other) - of_stiffness * other * (1.0 - own)
}

/// All points that touch another body.
pub(crate) fn pair_points<T: Number, const D: usize>(
    contacts: &Contacts<D>,
    around: &Surroundings<'_, impl Fn(usize) -> f64 + Sync, impl Fn(&Carrier<D>) -> Vector<T, D> + Sync, D>,
) -> Vec<ContactPoint<T, D>> {
    let Some(between) = &contacts.between else { return Vec::new() };
    parallel::list_by(POINTS, between.candidates.len(), |number, list| {
        list.extend(pair_point(contacts, between, (number, &between.candidates[number]), around));
    })
}

/// The contact of a candidate; `None` without contact.
fn pair_point<T: Real, const D: usize>(
    contacts: &Contacts<D>,
    between: &BodyContact<D>,
    (candidate, one): (usize, &Candidate<D>),
    Surroundings { stiffness, position, .. }: &Surroundings<
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
    // NaN touches nothing.
    if gap.is_nan() || gap >= 0.0 {
        return None;
    }
    let [own, other] = [&carriers[0], &carriers[1]].map(|carrier| stiffness(carrier.particle));
    // The slip is y − a along the surface.
    let anchor = one.start - one.slip;
    mutant!("contact: bodies forget their slip": anchor = one.start);
    let ContactConstants { stiffness, friction } = between.constants.scaled(own.min(other));
    let law = ContactLaw { feature, stiffness, friction, anchor, mean: None };
    Some(ContactPoint {
        touching: Touching::Pair { pair: one.pair, is_first: one.is_first, candidate },
        number: one.number,
        area: contacts.points[one.number].area * one.part * share(other / (own + other), one.edges),
        carriers,
        pose: Pose { rotation: identity(), shift: Vector::zeros() }.lit(),
        law,
        y,
    })
}

impl<const D: usize> Carrier<D> {
    /// The particle itself.
    pub(crate) fn at(particle: usize) -> Self {
        Self { particle, share: 1.0, offset: Vector::zeros() }
    }

    /// The position after the nodal motion `phi` since the last grid reset.
    pub(crate) fn position<T: Real>(
        &self,
        reference: &[Vector<f64, D>],
        connectivity: &Connectivity<D>,
        phi: &[Vector<T, D>],
    ) -> Vector<T, D> {
        let start = (reference[self.particle] + self.offset).map(T::lit);
        self.weights(connectivity).fold(start, |x, (node, n)| x + phi[node] * T::lit(n))
    }

    /// The nodes that move the place, and their functions there: N + ∇N·offset.
    pub(crate) fn weights<'a>(&'a self, connectivity: &'a Connectivity<D>) -> impl Iterator<Item = (usize, f64)> + 'a {
        connectivity.of(self.particle).map(|(node, n, grad_n)| (node, n + grad_n.dot(&self.offset)))
    }
}

impl<const D: usize> Candidate<D> {
    /// The point, and the closest point with negative shares.
    pub(crate) fn carriers(&self, contacts: &Contacts<D>) -> Vec<Carrier<D>> {
        let particle = |number: usize| contacts.points[number].particle;
        let of = |&Share { number, share, offset }: &Share<D>| {
            mutant!("contact: the other body has no reaction": { return Carrier { particle: particle(number), share: 0.0, offset }; });
            mutant!("contact: the reaction acts beside the point": { return Carrier { particle: particle(number), share: -share, offset: Vector::zeros() }; });
            Carrier { particle: particle(number), share: -share, offset }
        };
        std::iter::once(Carrier::at(particle(self.number))).chain(self.closest.iter().map(of)).collect()
    }
}

impl<T: Real, const D: usize> ContactPoint<T, D> {
    /// The force on the body of the point.
    pub(crate) fn force(&self) -> Vector<T, D> {
        self.pose.rotation * self.law.traction(&self.y) * T::lit(self.area)
    }
}

impl<const D: usize> ContactPoint<f64, D> {
    /// The energy stored by pressure and elastic slip.
    pub(crate) fn stored(&self) -> f64 {
        (self.law.energy(&self.y) + self.law.slip_energy(&self.y)) * self.area
    }

    /// −∂f/∂x of the force, at a fixed pose.
    pub(crate) fn stiffness(&self) -> Tensor<f64, D> {
        let Pose { rotation, .. } = self.pose;
        rotation * self.law.tangent(&self.y) * rotation.transpose() * self.area
    }
}
