//! Contact with obstacles and between bodies, −Σ_Γ t A N_I with the traction t of [`contact`](crate::mechanics::contact). The pressure has a potential.
//! Friction has none, and its tangent is not symmetric.

use super::term::{FunctionsAt, Linearized, LinearizedTerm, Step, Sum, Term, summed};
use crate::material::{Law, p_wave_modulus, poissons_ratio};
use crate::mechanics::constitutive::{Inadmissible, Part};
use crate::mechanics::contact::{Carrier, ContactPoint, Response, Surroundings, obstacle_points, pair_points};
use crate::mechanics::loads::Pose;
use crate::mechanics::sweep::{Number, Supports};
use crate::mechanics::trial::Trial;
use crate::particles::Body;
use crate::tensor::{Tensor, Vector};
use std::collections::BTreeMap;

/// The pressure of all contacts, or their friction.
pub(crate) struct ContactForce<'a, const D: usize, L> {
    step: Step<'a, D, L>,
    response: Response,
    /// The pressure per depth of every body, for a penalty stiffness of 1.
    stiffness: Vec<f64>,
}

impl<'a, const D: usize, L: Law> ContactForce<'a, D, L> {
    pub(crate) fn pressure(step: &Step<'a, D, L>) -> Option<Self> {
        Self::of(step, Response::Pressure, step.loads.contacts.exist())
    }

    pub(super) fn friction(step: &Step<'a, D, L>) -> Option<Self> {
        Self::of(step, Response::Friction, step.loads.contacts.have_friction())
    }

    fn of(step: &Step<'a, D, L>, response: Response, acts: bool) -> Option<Self> {
        acts.then(|| Self { step: *step, response, stiffness: penalties(step.bodies, step.supports.grid().spacing) })
    }

    /// All points in contact at Δφ.
    pub(crate) fn contact_points<T: Number>(&self, dphi: &[Vector<T, D>]) -> Vec<ContactPoint<T, D>> {
        let Step { particles, supports, loads, time, alphas, .. } = self.step;
        let reference = particles.reference().position;
        let around = Surroundings {
            t: time,
            start: alphas.discrete_gradient.then_some((time - alphas.dt, &*particles.position)),
            spacing: supports.grid().spacing,
            stiffness: |p: usize| self.stiffness[particles.body[p] as usize],
            position: |carrier: &Carrier<D>| carrier.position(reference, supports, dphi),
        };
        let mut found = obstacle_points(&loads.contacts, &around);
        found.extend(pair_points(&loads.contacts, &around));
        found
    }
}

/// The largest penalty stiffness in units of G/h. It is that of ν = 1/3, and bounds the stiffness of nearly incompressible bodies.
const MOST_SHEAR: f64 = 4.0;

/// The pressure per depth of every body: (Λ + 2G)/h, but at most 4 G/h.
pub(crate) fn penalties<L: Law>(bodies: &[Body<L>], spacing: f64) -> Vec<f64> {
    let modulus = |body: &Body<L>| {
        let (uniaxial, nu) = (p_wave_modulus(&body.law), poissons_ratio(&body.law));
        // G = (Λ + 2G) (1 − 2ν)/(2 (1 − ν))
        let shear = uniaxial * (1.0 - 2.0 * nu) / (2.0 * (1.0 - nu));
        if shear > 0.0 { uniaxial.min(MOST_SHEAR * shear) } else { uniaxial }
    };
    bodies.iter().map(|body| modulus(body) / spacing).collect()
}

impl<const D: usize, L: Law> Term<D> for ContactForce<'_, D, L> {
    fn name(&self) -> &'static str {
        match self.response {
            Response::Pressure => "contact",
            Response::Friction => "friction",
        }
    }

    fn add_at_nodes<T: Number>(&self, dphi: &[Vector<T, D>], out: &mut [Vector<T, D>]) {
        for ContactPoint { area, pose, law, y, carriers, .. } in self.contact_points(dphi) {
            let force = pose.rotation.map(T::lit) * law.traction(self.response, &y) * T::lit(area);
            mutant!("contact: the force does not turn with the obstacle": force = law.traction(self.response, &y) * T::lit(area));
            for carrier in &carriers {
                carrier
                    .weights(self.step.supports)
                    .for_each(|(node, n)| out[node] -= force * T::lit(carrier.share * n));
            }
        }
    }

    /// Σ ½ k g² A
    fn energy<T: Number>(&self, dphi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
        let energy = |one: ContactPoint<T, D>| one.law.energy(&one.y) * T::lit(one.area);
        (self.response == Response::Pressure).then(|| Ok(summed(self.contact_points(dphi).into_iter().map(energy))))
    }

    fn add_magnitudes_at_nodes(&self, dphi: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        for ContactPoint { area, pose, law, y, carriers, .. } in self.contact_points(dphi) {
            let force = pose.rotation * law.traction(self.response, &y) * area;
            for carrier in &carriers {
                let share = carrier.share.abs();
                carrier.weights(self.step.supports).for_each(|(node, n)| out[node] += force.abs() * (share * n.abs()));
            }
        }
    }

    /// The gap changes by the rounding of positions.
    fn add_sensitivity(&self, dphi: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) -> Result<(), Inadmissible> {
        let (supports, reference) = (self.step.supports, self.step.particles.reference().position);
        for LinearizedPoint { carriers, tangent } in self.linearized(dphi) {
            for Carrier { particle, share, .. } in &carriers {
                let x = reference[*particle].abs() + supports.value_at(*particle, dphi).abs();
                let change = tangent.abs() * x * share.powi(2);
                supports.of(*particle).for_each(|(node, n, _)| out[node] += change * n.abs());
            }
        }
        Ok(())
    }

    fn linearize(&self, Trial { dphi, .. }: Trial<'_, f64, D>, _: Part) -> LinearizedTerm<'_, D> {
        Ok(vec![Box::new(LinearizedContact::new(self.linearized(dphi), self.step.supports))])
    }
}

impl<const D: usize, L: Law> ContactForce<'_, D, L> {
    fn linearized(&self, dphi: &[Vector<f64, D>]) -> Vec<LinearizedPoint<D>> {
        let linearize = |ContactPoint { area, pose: Pose { rotation, .. }, law, y, carriers, .. }: ContactPoint<
            f64,
            D,
        >| {
            let tangent = rotation * law.tangent(self.response, &y) * rotation.transpose() * area;
            mutant!("contact: the tangent does not turn with the obstacle": tangent = law.tangent(self.response, &y) * area);
            LinearizedPoint { carriers, tangent }
        };
        self.contact_points(dphi).into_iter().map(linearize).collect()
    }
}

struct LinearizedContact<const D: usize> {
    points: Vec<LinearizedPoint<D>>,
    /// For each point, the nodes that move it and their weights.
    weights: Vec<Vec<(usize, f64)>>,
}

/// −∂(t A)/∂x of a point in contact.
struct LinearizedPoint<const D: usize> {
    carriers: Vec<Carrier<D>>,
    tangent: Tensor<f64, D>,
}

impl<const D: usize> LinearizedContact<D> {
    fn new(points: Vec<LinearizedPoint<D>>, supports: &Supports<D>) -> Self {
        let of = |carrier: &Carrier<D>| {
            carrier.weights(supports).map(|(node, n)| (node, carrier.share * n)).collect::<Vec<_>>()
        };
        let weights = points.iter().map(|point| point.carriers.iter().flat_map(of).collect()).collect();
        Self { points, weights }
    }
}

impl<const D: usize> Linearized<D> for LinearizedContact<D> {
    fn add_product_at_nodes(&self, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        for (LinearizedPoint { tangent, .. }, weights) in self.points.iter().zip(&self.weights) {
            let force = tangent * weights.iter().fold(Vector::zeros(), |sum, &(node, n)| sum + u[node] * n);
            weights.iter().for_each(|&(node, n)| out[node] += force * n);
        }
    }

    /// W_I² K, with the sum W_I over all places that the node moves
    fn add_blocks_of_functions(&self, functions: &FunctionsAt<'_, D>, blocks: &mut [Tensor<f64, D>]) {
        for LinearizedPoint { carriers, tangent } in &self.points {
            let mut of_node: BTreeMap<usize, [f64; D]> = BTreeMap::new();
            for Carrier { particle, share, offset } in carriers {
                for (node, function) in functions(*particle) {
                    let sum = of_node.entry(node).or_insert([0.0; D]);
                    (0..D).for_each(|i| sum[i] += share * (function.value[i] + function.gradient[i].dot(offset)));
                }
            }
            for (node, w) in of_node {
                blocks[node] += Tensor::from_fn(|i, k| w[i] * tangent[(i, k)] * w[k]);
            }
        }
    }
}
