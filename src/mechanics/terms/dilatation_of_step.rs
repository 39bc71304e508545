//! The mean dilatation of cells in the energy–momentum scheme. The mean stress of the law lacks U(J)
//! ([`constitutive`](crate::mechanics::constitutive)), and this term adds a discrete gradient of the energy Π = Σ V₀ U(θ) of each cell:
//!
//! ```text
//! π̄ = (Π_{n+1} − Π_n)/(v_{n+1} − v_n)                 v = Σ V₀ J, the volume of the cell
//! σ = π̄ a,  a = V₀ F_½ G F_rᵀ
//! G = 2/(J_n + J_{n+1}) · (cof C_n + 4 cof C_m + cof C_{n+1})/6,  C_m = ½ (C_n + C_{n+1})
//! ```
//!
//! G is the discrete gradient of J: with the Green–Lagrange strain E, G : ΔE = J_{n+1} − J_n. Simpson's rule is exact here, because cof C is at most
//! quadratic along the step (Betsch, Janz and Hesch, Comput. Methods Appl. Mech. Eng. 335, 2018). The work of σ in the step is therefore Π_{n+1} −
//! Π_n, and no angular momentum is lost, because G is symmetric. The code has π̄ as the mean of π at three Gauss points, and corrects it to the
//! quotient where the two differ by more than round-off.
//!
//! With b = ∂v_{n+1}/∂(∇u) = 2 V₀ cof(F_{n+1}) F_rᵀ and k̄ = ∂π̄/∂v_{n+1}:
//!
//! ```text
//! δσ = k̄ (Σ_{q∈c} b_q : L_q) a + V₀ π̄ (δF_½ G + F_½ δG) F_rᵀ
//! k̄ = (π_{n+1} − π̄)/(v_{n+1} − v_n), or Σ w s k(s)
//! ```
//!
//! a and b differ, so the tangent is not symmetric.

use super::mean_dilatation::State;
use super::term::{AtPoints, Step, Sum, Term};
use crate::lanes::LANES;
use crate::material::{Law, NonPositiveJacobian};
use crate::mechanics::constitutive::{GAUSS, Part, ROUND_OFF, general};
use crate::mechanics::dilatation::{Cells, Member};
use crate::mechanics::kinematics::{Inadmissible, Kinematics};
use crate::mechanics::linearized::{CellLayout, CellRows, Linearized};
use crate::mechanics::sweep::{Mode, Number};
use crate::mechanics::trial::Trial;
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor, Vector, cofactor, cofactor_derivative, identity, scaled, symmetric};
use std::sync::Arc;

/// The mean pressures of a step; absent without mean dilatation, and in other schemes.
pub(crate) struct DilatationOfStep<'a, const D: usize, L> {
    step: Step<'a, D, L>,
    cells: Arc<Cells>,
    /// Θ − 1 of every cell at t_n.
    before: Vec<f64>,
}

/// The mean pressure of a cell in the step, and its derivative.
struct Mean<T> {
    /// π̄
    pressure: T,
    /// k̄
    stiffness: T,
}

/// The deformations of a particle in a step, from n to n + 1.
struct Ends<T: Real, const D: usize> {
    /// At t_n and t_{n+1}.
    ends: [Deformation<T, D>; 2],
    /// F_½
    middle: Tensor<T, D>,
}

impl<T: Real, const D: usize> Ends<T, D> {
    /// Σ w cof C of Simpson's rule.
    fn cofactors(&self) -> Tensor<T, D> {
        let [before, after] = self.ends.map(|at| at.f.transpose() * at.f);
        let middle = scaled(&(before + after), T::lit(0.5));
        mutant!("mean dilatation of a step: the gradient of J is that at the middle": { return cofactor(&middle); });
        scaled(&(cofactor(&before) + scaled(&cofactor(&middle), T::lit(4.0)) + cofactor(&after)), T::lit(1.0 / 6.0))
    }

    /// 2/(J_n + J_{n+1})
    fn factor(&self) -> T {
        T::lit(2.0) / (self.ends[0].jacobian + self.ends[1].jacobian)
    }

    /// F_½ G
    fn force(&self) -> Tensor<T, D> {
        scaled(&(self.middle * self.cofactors()), self.factor())
    }
}

impl<const D: usize> Ends<f64, D> {
    /// δF_½ G + F_½ δG
    fn change(&self, of_middle: &Tensor<f64, D>) -> Tensor<f64, D> {
        let (sum, factor) = (self.cofactors(), self.factor());
        let [before, after] = self.ends.map(|at| at.f.transpose() * at.f);
        let of_end = of_middle * 2.0;
        let of_strain = symmetric(&(self.ends[1].f.transpose() * of_end)) * 2.0;
        // The middle moves by half of the end: 4 · ½ = 2.
        let of_sum = (cofactor_derivative(&((before + after) * 0.5), &of_strain) * 2.0
            + cofactor_derivative(&after, &of_strain))
            / 6.0;
        let of_factor = -0.5 * factor * factor * cofactor(&self.ends[1].f).dot(&of_end);
        of_middle * sum * factor + self.middle * (of_sum * factor + sum * of_factor)
    }
}

impl<'a, const D: usize, L: Law> DilatationOfStep<'a, D, L> {
    pub(super) fn of(step: &Step<'a, D, L>) -> Option<Self> {
        if !step.alphas.discrete_gradient {
            return None;
        }
        let cells = Arc::new(Cells::of(step.particles, step.bodies, step.connectivity)?);
        let before = cells.changes_now(step.particles);
        Some(Self { step: *step, cells, before })
    }

    /// The deformations of a particle for F_½ = (I + `g`) F_r.
    fn ends<T: Number>(&self, p: usize, g: &Tensor<T, D>) -> Ends<T, D> {
        let particles = self.step.particles;
        let middle = Kinematics(particles).displacement_gradient(p, g);
        let before = particles.displacement_gradient[particles.local_index(p)].map(T::lit);
        let after = scaled(&middle, T::lit(2.0)) - before;
        Ends { ends: [before, after].map(Deformation::new), middle: identity::<T, D>() + middle }
    }

    fn means<T: Number>(&self, phi: &[Vector<T, D>]) -> Vec<Mean<T>> {
        let Step { particles, connectivity, .. } = self.step;
        let grown = connectivity.evaluate(phi, |p, _, g| {
            let [before, after] = self.ends(p, &g).ends.map(|at| at.j);
            (after - before) * T::lit(particles.volume[p])
        });
        let mean = |((members, volume), &before): ((&[Member], f64), &f64)| {
            let growth = members.iter().fold(T::zero(), |sum, member| sum + grown[member.particle as usize]);
            self.mean(members, volume, before, growth)
        };
        self.cells.iter().zip(&self.before).map(mean).collect()
    }

    /// The mean of a cell that grows from (1 + `before`) V_c by `growth`.
    fn mean<T: Number>(&self, members: &[Member], volume: f64, before: f64, growth: T) -> Mean<T> {
        let change = relative(growth, volume, before);
        let at = |s: f64| State::of(&self.step, members, volume, T::lit(before) + change * T::lit(s));
        let mut mean = Mean { pressure: T::zero(), stiffness: T::zero() };
        for (s, weight) in GAUSS {
            let state = at(s);
            mean.pressure += state.pressure * T::lit(weight);
            mean.stiffness += state.stiffness * T::lit(weight * s);
        }
        let [start, end] = [at(0.0), at(1.0)];
        let work = mean.pressure * growth;
        let missing = end.energy - start.energy - work;
        let size = start.size + end.size + work.value().abs();
        mutant!("mean dilatation of a step: Gauss's formula is not corrected": { return mean; });
        if missing.value().abs() > ROUND_OFF * size {
            mean.pressure += missing / growth;
            mean.stiffness = (end.pressure - mean.pressure) / growth;
        }
        mean
    }
}

/// The change of Θ by `growth`. In a cell that is turned inside out it is zero; one of its particles then has det F ≤ 0, and the step fails there.
fn relative<T: Number>(growth: T, volume: f64, before: f64) -> T {
    let change = growth * T::lit(1.0 / volume);
    if change.value() + before > -1.0 { change } else { T::zero() }
}

impl<const D: usize, L: Law> Term<D> for DilatationOfStep<'_, D, L> {
    fn name(&self) -> &'static str {
        "mean dilatation"
    }

    fn at_points<T: Number>(&self, _: Part, at: Trial<'_, T, D>) -> Option<(Mode, AtPoints<'_, T, D>)> {
        let means = self.means(at.phi);
        Some((
            Mode::GRADIENT,
            Box::new(move |group, at, sums| {
                for (lane, &p) in group.particles.iter().enumerate() {
                    let Some(cell) = self.cells.cell(p) else { continue };
                    let ends = self.ends(p as usize, &at.lane(lane).1);
                    NonPositiveJacobian::check(ends.ends[1].jacobian.value()).map_err(|source| Inadmissible {
                        particle: self.step.particles.id[p as usize] as usize,
                        source,
                    })?;
                    let a = Kinematics(self.step.particles).to_nodes(p as usize, &ends.force());
                    for i in 0..D {
                        for k in 0..D {
                            sums.gradient[i][k][lane] += means[cell].pressure * a[(i, k)];
                        }
                    }
                }
                Ok(())
            }),
        ))
    }

    fn energy<T: Number>(&self, _: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
        None
    }

    fn linearize(&self, at: Trial<'_, f64, D>, _: Part, into: &mut Linearized<D>) -> Result<(), Inadmissible> {
        let means = self.means(at.phi);
        let stiffness: Vec<f64> = means.iter().map(|mean| mean.stiffness).collect();
        mutant!("mean dilatation of a step: the product lacks the coupling within a cell": stiffness = vec![0.0; stiffness.len()]);
        let (cells, layout, connectivity) = (self.cells.clone(), CellLayout::of_step(D), self.step.connectivity);
        into.cells.push(CellRows::new(cells, layout, stiffness, connectivity, at.phi, |cell, p, g, lane, rows| {
            self.linearize_at(p, g, means[cell].pressure, lane, rows);
        }));
        Ok(())
    }
}

impl<const D: usize, L: Law> DilatationOfStep<'_, D, L> {
    /// Writes the local part, a and b of a particle to its lane.
    fn linearize_at(&self, p: usize, g: &Tensor<f64, D>, pressure: f64, lane: usize, rows: &mut [[f64; LANES]]) {
        let (ends, kinematics) = (self.ends(p, g), Kinematics(self.step.particles));
        let f_r = kinematics.reference(p);
        for l in 0..D {
            for j in 0..D {
                // δF_½ for L = e_j ⊗ e_l
                let mut of_middle = Tensor::<f64, D>::zeros();
                of_middle.set_row(j, &f_r.row(l));
                let change = kinematics.to_nodes(p, &ends.change(&of_middle)) * pressure;
                for k in 0..D {
                    for i in 0..D {
                        rows[general::<D>(k, l, i, j)][lane] = change[(i, k)];
                    }
                }
            }
        }
        let [a, b] = [ends.force(), cofactor(&ends.ends[1].f) * 2.0].map(|one| kinematics.to_nodes(p, &one));
        let (of_a, of_b) = rows[CellLayout::of_step(D).a..].split_at_mut(D * D);
        for i in 0..D {
            for k in 0..D {
                of_a[i * D + k][lane] = a[(i, k)];
                of_b[i * D + k][lane] = b[(i, k)];
            }
        }
    }
}
