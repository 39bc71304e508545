//! Inertia, M̃ a with a = α₁ (φ − φ̂): eq. 33 with the sign corrected.

use super::term::{AtPoints, Step, Sum, Term, summed};
use crate::gpu::{self, Buffer, Gpu, InertiaOfParticles};
use crate::mechanics::constitutive::Part;
use crate::mechanics::kinematics::Inadmissible;
use crate::mechanics::linearized::Linearized;
use crate::mechanics::mass::Mass;
use crate::mechanics::schemes::Alphas;
use crate::mechanics::sweep::{Mode, Number};
use crate::mechanics::transfer::Nodal;
use crate::mechanics::trial::Trial;
use crate::parallel;
use crate::pooled::Pooled;
use crate::tensor::{Tensor, Vector};
use std::sync::OnceLock;

/// M̃ a; absent without inertia.
pub(crate) struct Inertia<'a, const D: usize> {
    mass: Mass<'a, D>,
    nodal: &'a Nodal<D>,
    alphas: Alphas,
    /// φ̂ at this process's particles, from the one at the place `first` in memory; empty for a lumped mass.
    predicted: Pooled<Vector<f64, D>>,
    first: usize,
    predicted_on_device: OnceLock<Buffer<f64>>,
}

impl<'a, const D: usize> Inertia<'a, D> {
    pub(super) fn of<L>(step: &Step<'a, D, L>) -> Option<Self> {
        let (mass, nodal, alphas) = (step.mass(), step.nodal, step.alphas);
        if nodal.is_static() {
            return None;
        }
        let mut predicted = Pooled::default();
        if mass.lumping < 1.0 {
            let of_nodes = mass.connectivity.pool().made(mass.lumped.len(), |node| nodal.predicted(&alphas, node));
            predicted = mass.connectivity.own_values(&of_nodes);
        }
        let first = mass.connectivity.own_particles().start;
        Some(Self { mass, nodal, alphas, predicted, first, predicted_on_device: OnceLock::new() })
    }

    /// The consistent part on a device; `None` if the mass is lumped.
    pub(super) fn on_device(&self, gpu: &Gpu) -> Option<InertiaOfParticles<'_>> {
        let Self { mass, predicted, .. } = self;
        if predicted.is_empty() {
            return None;
        }
        let connectivity = mass.connectivity;
        let masses = connectivity.masses_on_device(gpu, |p| mass.particles.mass[p], mass.lumped);
        let inertia = gpu::Inertia { masses, factor: self.alphas.a1, lumping: mass.lumping };
        let copied = || connectivity.copied_by_lane(gpu, D, |p, c| predicted[p][c]);
        Some((inertia, self.predicted_on_device.get_or_init(copied)))
    }

    /// ε m_I and a_I of a node.
    fn motion<T: Number>(&self, node: usize, phi: &Vector<T, D>) -> (T, Vector<T, D>) {
        let predicted = self.nodal.predicted(&self.alphas, node);
        let a = Vector::from_fn(|i, _| T::lit(self.alphas.a1) * (phi[i] - T::lit(predicted[i])));
        (T::lit(self.mass.lumping * self.mass.lumped[node]), a)
    }
}

impl<const D: usize> Term<D> for Inertia<'_, D> {
    fn name(&self) -> &'static str {
        "inertia"
    }

    fn add_at_nodes<T: Number>(&self, phi: &[Vector<T, D>], out: &mut [Vector<T, D>]) {
        parallel::each(out, |node, out| {
            let (m, a) = self.motion(node, &phi[node]);
            *out += a * m;
        });
    }

    /// q = (1−ε) m a
    fn at_points<T: Number>(&self, _: Part, _: Trial<'_, T, D>) -> Option<(Mode, AtPoints<'_, T, D>)> {
        let (predicted, first): (&[Vector<f64, D>], _) = (&self.predicted, self.first);
        let add: AtPoints<'_, T, D> = Box::new(move |group, at, sums| {
            for (lane, &p) in group.particles.iter().enumerate() {
                let weight = T::lit(self.alphas.a1 * self.mass.consistent(p as usize));
                mutant!("inertia: the residual lacks the consistent part": weight = T::zero());
                for c in 0..D {
                    sums.value[c][lane] += weight * (at.value[c][lane] - T::lit(predicted[p as usize - first][c]));
                }
            }
            Ok(())
        });
        (self.mass.lumping < 1.0).then_some((Mode::VALUE, add))
    }

    /// ½ a·M̃ a/α₁
    fn energy<T: Number>(&self, phi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
        let half_over_a1 = T::lit(0.5 / self.alphas.a1);
        let of_nodes = phi.iter().enumerate().map(|(node, phi)| {
            let (m, a) = self.motion(node, phi);
            half_over_a1 * m * a.dot(&a)
        });
        let (mut sum, mut magnitude) = summed(of_nodes);
        if self.mass.lumping < 1.0 {
            let half_a1 = T::lit(0.5 * self.alphas.a1);
            let energy = |p: usize, u: Vector<T, D>, _: Tensor<T, D>| {
                let u = u - self.predicted[p - self.first].map(T::lit);
                half_a1 * T::lit(self.mass.consistent(p)) * u.dot(&u)
            };
            let of_particles = summed(self.mass.connectivity.evaluate(phi, energy));
            sum += of_particles.0;
            magnitude += of_particles.1;
        }
        Some(Ok((sum, magnitude)))
    }

    /// The lumped mass stands for the whole mass, also for ε < 1: the consistent part is of the same size.
    fn add_magnitudes_at_nodes(&self, phi: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        let Alphas { a1, a2, a3, .. } = self.alphas;
        parallel::each(out, |node, out| {
            let (v, a) = (self.nodal.velocity[node].abs(), self.nodal.acceleration[node].abs());
            *out += (phi[node].abs() * a1 + v * a2 + a * a3.abs()) * self.mass.lumped[node];
        });
    }

    fn linearize(&self, _: Trial<'_, f64, D>, _: Part, into: &mut Linearized<D>) -> Result<(), Inadmissible> {
        into.mass += self.alphas.a1;
        Ok(())
    }
}
