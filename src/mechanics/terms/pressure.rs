//! Follower pressure, +p cof(F) N A on the particles of a surface. The tangent is exact, and not symmetric on an open surface.

use super::term::{Role, Step, Sum, Term};
use crate::mechanics::constitutive::Part;
use crate::mechanics::kinematics::{Inadmissible, Kinematics};
use crate::mechanics::linearized::{Linearized, PressureRow};
use crate::mechanics::loads::PressurePoint;
use crate::mechanics::sweep::{Connectivity, Number};
use crate::mechanics::trial::Trial;
use crate::particles::Particles;
use crate::tensor::{Vector, cofactor, identity};

/// Σ_Γ p cof(F) N A N_I, which has no potential.
pub(crate) struct Pressure<'a, const D: usize> {
    particles: &'a Particles<D>,
    connectivity: &'a Connectivity<D>,
    points: Vec<PressurePoint<D>>,
}

impl<'a, const D: usize> Pressure<'a, D> {
    pub(super) fn of<L>(step: &Step<'a, D, L>) -> Option<Self> {
        let points = step.loads.pressures(step.time);
        (!points.is_empty()).then_some(Self { particles: step.particles, connectivity: step.connectivity, points })
    }
}

impl<const D: usize> Term<D> for Pressure<'_, D> {
    fn name(&self) -> &'static str {
        "follower pressure"
    }

    fn role(&self) -> Role {
        Role::Loads
    }

    fn add_at_nodes<T: Number>(&self, phi: &[Vector<T, D>], out: &mut [Vector<T, D>]) {
        for point in &self.points {
            let g = self.connectivity.gradient_at(point.particle, phi);
            let f = identity::<T, D>() + Kinematics(self.particles).displacement_gradient(point.particle, &g);
            let force = cofactor(&f) * point.force.map(T::lit);
            for (node, n, _) in self.connectivity.of(point.particle) {
                out[node] += force * T::lit(n);
            }
        }
    }

    fn energy<T: Number>(&self, _: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
        None
    }

    fn add_magnitudes_at_nodes(&self, _: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        for point in &self.points {
            for (node, n, _) in self.connectivity.of(point.particle) {
                out[node] += point.force.abs() * n.abs();
            }
        }
    }

    fn linearize(&self, at: Trial<'_, f64, D>, _: Part, into: &mut Linearized<D>) -> Result<(), Inadmissible> {
        let linearize = |point: &PressurePoint<D>| {
            let p = point.particle;
            PressureRow {
                particle: p,
                delta_f: identity::<f64, D>() + self.connectivity.gradient_at(p, at.phi),
                force: cofactor(&Kinematics(self.particles).reference(p)) * point.force,
            }
        };
        into.pressures.0.extend(self.points.iter().map(linearize));
        Ok(())
    }
}
