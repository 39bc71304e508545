//! Contact with obstacles and between bodies, −Σ_Γ t A N_I with the traction t of [`contact`](crate::mechanics::contact). Without friction it has a
//! potential. Points that slide have none, and their tangent is not symmetric.

use super::term::{Step, Sum, Term, summed};
use crate::material::Law;
use crate::mechanics::constitutive::Part;
use crate::mechanics::contact::{
    Carrier, ContactPoint, FreeBalance, FreeMotion, Surroundings, Touching, contact_modulus, obstacle_points,
    pair_points, points_on,
};
use crate::mechanics::kinematics::Inadmissible;
use crate::mechanics::linearized::{ContactRow, ContactRows, Linearized};
use crate::mechanics::loads::{Obstacle, Pose, RigidBody};
use crate::mechanics::sweep::Number;
use crate::mechanics::trial::Trial;
use crate::particles::Body;
use crate::tensor::Vector;

/// The forces of all contacts.
pub(crate) struct ContactForce<'a, const D: usize, L> {
    step: Step<'a, D, L>,
    /// The pressure per depth of every body, for a penalty stiffness of 1.
    stiffness: Vec<f64>,
}

impl<'a, const D: usize, L: Law> ContactForce<'a, D, L> {
    pub(crate) fn of(step: &Step<'a, D, L>) -> Option<Self> {
        let acts = step.loads.contacts.exist();
        acts.then(|| Self { step: *step, stiffness: penalties(step.bodies, step.connectivity.grid().spacing) })
    }

    /// All points in contact at φ.
    pub(crate) fn contact_points<T: Number>(&self, phi: &[Vector<T, D>]) -> Vec<ContactPoint<T, D>> {
        self.contact_points_with(&self.free_motions(phi), phi)
    }

    /// All points in contact at φ, with the motions of free obstacles there.
    fn contact_points_with<T: Number>(
        &self,
        motions: &[Option<FreeMotion>],
        phi: &[Vector<T, D>],
    ) -> Vec<ContactPoint<T, D>> {
        let (contacts, around) = (&self.step.loads.contacts, self.around(phi));
        let mut found = obstacle_points(contacts, &around, &self.poses(motions, phi));
        found.extend(pair_points(contacts, &around));
        found
    }

    /// The surroundings of the contacts at φ.
    fn around<'x, T: Number>(
        &'x self,
        phi: &'x [Vector<T, D>],
    ) -> Surroundings<'x, impl Fn(usize) -> f64 + Sync, impl Fn(&Carrier<D>) -> Vector<T, D> + Sync, D> {
        let Step { particles, connectivity, time, alphas, .. } = self.step;
        let reference = particles.reference().position;
        Surroundings {
            t: time,
            start: alphas.discrete_gradient.then_some((time - alphas.dt, &*particles.position)),
            stiffness: |p: usize| self.stiffness[particles.body[p] as usize],
            position: move |carrier: &Carrier<D>| carrier.position(reference, connectivity, phi),
        }
    }

    /// The poses of all obstacles at φ, with the motions of free obstacles there.
    fn poses<T: Number>(&self, motions: &[Option<FreeMotion>], phi: &[Vector<T, D>]) -> Vec<Pose<D, T>> {
        if let Some(poses) = self.step.poses {
            return poses.iter().map(Pose::lit).collect();
        }
        let (contacts, around) = (&self.step.loads.contacts, self.around(phi));
        let pose = |(index, motion): (usize, &Option<FreeMotion>)| {
            let obstacle = &contacts.obstacles[index];
            let (Some(motion), Some(body)) = (motion, &obstacle.free) else {
                return obstacle.pose(self.step.time).lit();
            };
            let points_at = |q: &Vector<T, 6>| points_on(contacts, &around, index, &body.pose(q));
            body.pose(&self.free_balance(body).implicit(*motion, points_at))
        };
        motions.iter().enumerate().map(pose).collect()
    }

    /// The motion of each obstacle at φ; `None` for an obstacle that does not move freely, or whose pose is known.
    pub(crate) fn free_motions<T: Number>(&self, phi: &[Vector<T, D>]) -> Vec<Option<FreeMotion>> {
        let contacts = &self.step.loads.contacts;
        if self.step.poses.is_some() || !contacts.has_free_obstacle() {
            return vec![None; contacts.obstacles.len()];
        }
        let values: Vec<Vector<f64, D>> = phi.iter().map(|x| x.map(T::value)).collect();
        let around = self.around(&values);
        let motion = |(index, obstacle): (usize, &Obstacle<D>)| {
            let body = obstacle.free.as_ref()?;
            Some(self.free_balance(body).solve(|q| points_on(contacts, &around, index, &body.pose(q))))
        };
        contacts.obstacles.iter().enumerate().map(motion).collect()
    }

    fn free_balance<'x>(&self, body: &'x RigidBody<D>) -> FreeBalance<'x, D> {
        let Step { alphas, loads, time, connectivity, .. } = self.step;
        let gravity = loads.gravity.as_ref().map_or_else(Vector::zeros, |gravity| gravity.at(time));
        FreeBalance { body, alphas, gravity, spacing: connectivity.grid().spacing }
    }
}

/// The pressure per depth of every body, for a penalty stiffness of 1.
pub(crate) fn penalties<L: Law>(bodies: &[Body<L>], spacing: f64) -> Vec<f64> {
    bodies.iter().map(|body| contact_modulus(&body.law) / spacing).collect()
}

impl<const D: usize, L: Law> Term<D> for ContactForce<'_, D, L> {
    fn name(&self) -> &'static str {
        "contact"
    }

    fn add_at_nodes<T: Number>(&self, phi: &[Vector<T, D>], out: &mut [Vector<T, D>]) {
        for one in self.contact_points(phi) {
            let force = one.force();
            mutant!("contact: the force does not turn with the obstacle": force = one.law.traction(&one.y) * T::lit(one.area));
            for carrier in &one.carriers {
                carrier
                    .weights(self.step.connectivity)
                    .for_each(|(node, n)| out[node] -= force * T::lit(carrier.share * n));
            }
        }
    }

    /// Σ ½ k g² A without friction. Free obstacles bring their inertia into the balance, which in space has no potential.
    fn energy<T: Number>(&self, phi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
        let energy = |one: ContactPoint<T, D>| one.law.energy(&one.y) * T::lit(one.area);
        let contacts = &self.step.loads.contacts;
        let has_potential = !contacts.have_friction() && !contacts.has_free_obstacle();
        has_potential.then(|| Ok(summed(self.contact_points(phi).into_iter().map(energy))))
    }

    fn add_magnitudes_at_nodes(&self, phi: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        for one in self.contact_points(phi) {
            let force = one.force();
            for carrier in &one.carriers {
                let share = carrier.share.abs();
                carrier
                    .weights(self.step.connectivity)
                    .for_each(|(node, n)| out[node] += force.abs() * (share * n.abs()));
            }
        }
    }

    /// The gap changes by the rounding of positions.
    fn add_sensitivity(&self, phi: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) -> Result<(), Inadmissible> {
        let (connectivity, reference) = (self.step.connectivity, self.step.particles.reference().position);
        for ContactRow { carriers, tangent, .. } in self.linearized(phi) {
            let size = |one: &Carrier<D>| {
                let x = reference[one.particle].abs() + connectivity.value_at(one.particle, phi).abs();
                x * one.share.abs()
            };
            let change = tangent.abs() * carriers.iter().map(size).sum::<Vector<f64, D>>();
            for carrier in &carriers {
                let share = carrier.share.abs();
                carrier.weights(connectivity).for_each(|(node, n)| out[node] += change * (share * n.abs()));
            }
        }
        Ok(())
    }

    fn linearize(&self, at: Trial<'_, f64, D>, _: Part, into: &mut Linearized<D>) -> Result<(), Inadmissible> {
        let Step { loads, connectivity, .. } = self.step;
        into.contacts = ContactRows::new(self.linearized(at.phi), loads.contacts.obstacles.len(), connectivity);
        Ok(())
    }
}

impl<const D: usize, L: Law> ContactForce<'_, D, L> {
    fn linearized(&self, phi: &[Vector<f64, D>]) -> Vec<ContactRow<D>> {
        let contacts = &self.step.loads.contacts;
        let motions = self.free_motions(phi);
        let points = self.contact_points_with(&motions, phi);
        let on_free = |one: &ContactPoint<f64, D>| {
            let Touching::Obstacle(index) = one.touching else { return None };
            let balance = self.free_balance(contacts.obstacles[index].free.as_ref()?);
            Some((index, balance.linearized(motions[index].as_ref()?, one)))
        };
        let linearize = |one: &ContactPoint<f64, D>| {
            let tangent = one.stiffness();
            mutant!("contact: the tangent does not turn with the obstacle": tangent = one.law.tangent(&one.y) * one.area);
            let on_free = on_free(one);
            mutant!("free obstacles: the tangent holds them": on_free = None);
            ContactRow { carriers: one.carriers.clone(), tangent, on_free }
        };
        points.iter().map(linearize).collect()
    }
}
