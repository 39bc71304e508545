//! Contact with rigid obstacles, −Σ_Γ t A N_I with the traction t of [`contact`](crate::mechanics::contact). The pressure has a potential.
//! Friction has none, and its tangent is not symmetric.

use super::term::{FunctionsAt, Linearized, LinearizedTerm, Step, Sum, Term, summed};
use crate::material::{Law, p_wave_modulus, poissons_ratio};
use crate::mechanics::constitutive::{Inadmissible, Part};
use crate::mechanics::contact::{ContactPoint, Response, contact_points};
use crate::mechanics::loads::Pose;
use crate::mechanics::sweep::{Number, Supports};
use crate::mechanics::trial::Trial;
use crate::particles::Body;
use crate::tensor::{Tensor, Vector};

/// The pressure of all obstacles, or their friction.
pub(crate) struct ObstacleForce<'a, const D: usize, L> {
    step: Step<'a, D, L>,
    response: Response,
    /// The pressure per depth of every body, for a penalty stiffness of 1.
    stiffness: Vec<f64>,
}

impl<'a, const D: usize, L: Law> ObstacleForce<'a, D, L> {
    pub(crate) fn pressure(step: &Step<'a, D, L>) -> Option<Self> {
        Self::of(step, Response::Pressure, !step.loads.obstacles.list.is_empty())
    }

    pub(super) fn friction(step: &Step<'a, D, L>) -> Option<Self> {
        Self::of(step, Response::Friction, step.loads.obstacles.have_friction())
    }

    fn of(step: &Step<'a, D, L>, response: Response, acts: bool) -> Option<Self> {
        acts.then(|| Self { step: *step, response, stiffness: penalties(step.bodies, step.supports.grid().spacing) })
    }

    /// All points that touch an obstacle at Δφ.
    pub(crate) fn contact_points<T: Number>(&self, dphi: &[Vector<T, D>]) -> Vec<ContactPoint<'a, T, D>> {
        let Step { particles, supports, loads, time, .. } = self.step;
        let reference = particles.reference().position;
        let stiffness = |p: usize| self.stiffness[particles.body[p] as usize];
        contact_points(&loads.obstacles, time, supports.grid().spacing, stiffness, |p| {
            supports.value_at(p, dphi) + reference[p].map(T::lit)
        })
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

impl<const D: usize, L: Law> Term<D> for ObstacleForce<'_, D, L> {
    fn name(&self) -> &'static str {
        match self.response {
            Response::Pressure => "contact",
            Response::Friction => "friction",
        }
    }

    fn add_at_nodes<T: Number>(&self, dphi: &[Vector<T, D>], out: &mut [Vector<T, D>]) {
        for ContactPoint { point, pose, law, y, .. } in self.contact_points(dphi) {
            let force = pose.rotation.map(T::lit) * law.traction(self.response, &y) * T::lit(point.area);
            mutant!("contact: the force does not turn with the obstacle": force = law.traction(self.response, &y) * T::lit(point.area));
            for (node, n, _) in self.step.supports.of(point.particle) {
                out[node] -= force * T::lit(n);
            }
        }
    }

    /// Σ ½ k g² A
    fn energy<T: Number>(&self, dphi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
        let energy = |one: ContactPoint<'_, T, D>| one.law.energy(&one.y) * T::lit(one.point.area);
        (self.response == Response::Pressure).then(|| Ok(summed(self.contact_points(dphi).into_iter().map(energy))))
    }

    fn add_magnitudes_at_nodes(&self, dphi: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        for ContactPoint { point, pose, law, y, .. } in self.contact_points(dphi) {
            let force = pose.rotation * law.traction(self.response, &y) * point.area;
            for (node, n, _) in self.step.supports.of(point.particle) {
                out[node] += force.abs() * n.abs();
            }
        }
    }

    /// The gap changes by the rounding of positions.
    fn add_sensitivity(&self, dphi: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) -> Result<(), Inadmissible> {
        for LinearizedPoint { particle, tangent } in self.linearized(dphi) {
            let x = self.step.particles.reference().position[particle].abs()
                + self.step.supports.value_at(particle, dphi).abs();
            let change = tangent.abs() * x;
            for (node, n, _) in self.step.supports.of(particle) {
                out[node] += change * n.abs();
            }
        }
        Ok(())
    }

    fn linearize(&self, Trial { dphi, .. }: Trial<'_, f64, D>, _: Part) -> LinearizedTerm<'_, D> {
        Ok(vec![Box::new(LinearizedContact { supports: self.step.supports, points: self.linearized(dphi) })])
    }
}

impl<const D: usize, L: Law> ObstacleForce<'_, D, L> {
    fn linearized(&self, dphi: &[Vector<f64, D>]) -> Vec<LinearizedPoint<D>> {
        let linearize = |ContactPoint { point, pose: Pose { rotation, .. }, law, y, .. }: ContactPoint<'_, f64, D>| {
            let tangent = rotation * law.tangent(self.response, &y) * rotation.transpose() * point.area;
            mutant!("contact: the tangent does not turn with the obstacle": tangent = law.tangent(self.response, &y) * point.area);
            LinearizedPoint { particle: point.particle, tangent }
        };
        self.contact_points(dphi).into_iter().map(linearize).collect()
    }
}

struct LinearizedContact<'a, const D: usize> {
    supports: &'a Supports<D>,
    points: Vec<LinearizedPoint<D>>,
}

/// −∂(t A)/∂x of a point that touches an obstacle.
struct LinearizedPoint<const D: usize> {
    particle: usize,
    tangent: Tensor<f64, D>,
}

impl<const D: usize> Linearized<D> for LinearizedContact<'_, D> {
    fn add_product_at_nodes(&self, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        for LinearizedPoint { particle, tangent } in &self.points {
            let force = tangent * self.supports.value_at(*particle, u);
            for (node, n, _) in self.supports.of(*particle) {
                out[node] += force * n;
            }
        }
    }

    /// N_I² K
    fn add_blocks_of_functions(&self, functions: &FunctionsAt<'_, D>, blocks: &mut [Tensor<f64, D>]) {
        for LinearizedPoint { particle, tangent } in &self.points {
            for (node, function) in functions(*particle) {
                for k in 0..D {
                    (0..D)
                        .for_each(|i| blocks[node][(i, k)] += function.value[i] * tangent[(i, k)] * function.value[k]);
                }
            }
        }
    }
}
