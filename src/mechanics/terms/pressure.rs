//! Follower pressure, +p cof(F) N A on the particles of a surface. The tangent is exact, and not symmetric on an open surface.

use super::term::{FunctionsAt, Linearized, LinearizedTerm, Role, Step, Sum, Term};
use crate::mechanics::constitutive::{Inadmissible, Part, compose};
use crate::mechanics::loads::PressurePoint;
use crate::mechanics::sweep::{Number, Supports};
use crate::mechanics::trial::Trial;
use crate::particles::Particles;
use crate::tensor::{Tensor, Vector, cofactor, cofactor_derivative, identity};

/// Σ_Γ p cof(F) N A N_I, which has no potential.
pub(crate) struct Pressure<'a, const D: usize> {
    particles: &'a Particles<D>,
    supports: &'a Supports<D>,
    points: Vec<PressurePoint<D>>,
}

impl<'a, const D: usize> Pressure<'a, D> {
    pub(super) fn of<L>(step: &Step<'a, D, L>) -> Option<Self> {
        let points = step.loads.pressures(step.time);
        (!points.is_empty()).then_some(Self { particles: step.particles, supports: step.supports, points })
    }
}

impl<const D: usize> Term<D> for Pressure<'_, D> {
    fn name(&self) -> &'static str {
        "follower pressure"
    }

    fn role(&self) -> Role {
        Role::Loads
    }

    fn add_at_nodes<T: Number>(&self, dphi: &[Vector<T, D>], out: &mut [Vector<T, D>]) {
        for point in &self.points {
            let g = self.supports.gradient_at(point.particle, dphi);
            let f = identity::<T, D>() + compose(&g, &self.particles.reference().displacement_gradient[point.particle]);
            let force = cofactor(&f) * point.force.map(T::lit);
            for (node, n, _) in self.supports.of(point.particle) {
                out[node] += force * T::lit(n);
            }
        }
    }

    fn energy<T: Number>(&self, _: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
        None
    }

    fn add_magnitudes_at_nodes(&self, _: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        for point in &self.points {
            for (node, n, _) in self.supports.of(point.particle) {
                out[node] += point.force.abs() * n.abs();
            }
        }
    }

    fn linearize(&self, Trial { dphi, .. }: Trial<'_, f64, D>, _: Part) -> LinearizedTerm<'_, D> {
        let linearize = |point: &PressurePoint<D>| {
            let p = point.particle;
            let f_r = identity::<f64, D>() + self.particles.reference().displacement_gradient[p];
            LinearizedPoint {
                particle: p,
                delta_f: identity::<f64, D>() + self.supports.gradient_at(p, dphi),
                force: cofactor(&f_r) * point.force,
            }
        };
        let points = self.points.iter().map(linearize).collect();
        Ok(vec![Box::new(LinearizedPressure { supports: self.supports, points })])
    }
}

struct LinearizedPressure<'a, const D: usize> {
    supports: &'a Supports<D>,
    points: Vec<LinearizedPoint<D>>,
}

/// cof F = cof ΔF cof F_r, so δ(p A cof(F) N) is the derivative of cof ΔF along L = ∇_r u, applied to p A cof(F_r) N.
struct LinearizedPoint<const D: usize> {
    particle: usize,
    /// ΔF
    delta_f: Tensor<f64, D>,
    /// p A cof(F_r) N
    force: Vector<f64, D>,
}

impl<const D: usize> Linearized<D> for LinearizedPressure<'_, D> {
    fn add_product_at_nodes(&self, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        for LinearizedPoint { particle, delta_f, force } in &self.points {
            let delta = cofactor_derivative(delta_f, &self.supports.gradient_at(*particle, u)) * force;
            mutant!("loads: the tangent of a pressure has a wrong sign": delta = -delta);
            for (node, n, _) in self.supports.of(*particle) {
                out[node] += delta * n;
            }
        }
    }

    /// Column k of a block is N_I times the derivative along L = e_k ⊗ ∇_r N_I.
    fn add_blocks_of_functions(&self, functions: &FunctionsAt<'_, D>, blocks: &mut [Tensor<f64, D>]) {
        for LinearizedPoint { particle, delta_f, force } in &self.points {
            for (node, function) in functions(*particle) {
                for k in 0..D {
                    let mut l = Tensor::<f64, D>::zeros();
                    l.set_row(k, &function.gradient[k].transpose());
                    let column = cofactor_derivative(delta_f, &l) * force;
                    (0..D).for_each(|i| blocks[node][(i, k)] += function.value[i] * column[i]);
                }
            }
        }
    }
}
