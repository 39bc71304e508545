//! The mean dilatation of cells. The volumetric part U of the energy depends on θ, the mean of a cell, in place of J. This adds the energy
//!
//! Π = Σ_p V₀ [U(θ_p) − U(J_p)],  θ_p = Θ_c θ_n,  Θ_c = v/V_c,  v = Σ_{p∈c} V₀ J_p,
//!
//! to W(F) of the law, which contains U(J). A cell then has one pressure, like finite elements with linear motion and constant pressure
//! (Simo, Taylor and Pister, Comput. Methods Appl. Mech. Eng. 51, 1985). Π is a potential, so the tangent is symmetric.
//!
//! With T(θ) = θ U' and ∂v/∂φ_I = Σ a ∇_r N_I, a = V₀ J A, A = ΔF⁻ᵀ:
//!
//! ```text
//! π = ∂Π/∂v of the first sum = Σ V₀ T(θ) / v          σ = (π − T(J)/J) a
//! k = ∂π/∂v = Σ V₀ (θ T' − T) / v²                     δσ = k (Σ_{q∈c} a_q : L_q) a + V₀ [(J π − J T') (A:L) A − (J π − T) A Lᵀ A]
//! ```
//!
//! The first part of δσ couples the particles of a cell; the second has the form of a [`ClosedTangent`](crate::material::ClosedTangent).
//!
//! In the mixed form, Θ_c is an unknown of its own, with the residual v − Θ_c V_c ([`mixed`](crate::mechanics::mixed)). In π and k, Θ_c V_c then
//! stands for v.

use super::term::{AtPoints, Step, Sum, Term, summed};
use crate::material::{Law, MaterialState, VolumeResponse};
use crate::mechanics::constitutive::{Form, Part};
use crate::mechanics::dilatation::{Cells, Member, Scale, total};
use crate::mechanics::kinematics::{Inadmissible, Kinematics};
use crate::mechanics::linearized::{CellLayout, CellRows, Linearized, MixedCell};
use crate::mechanics::sweep::{Mode, Number};
use crate::mechanics::trial::Trial;
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector, cofactor};
use std::sync::Arc;

/// The smallest bulk modulus in the choice of γ, relative to G.
const SOFTEST: f64 = 1e-3;

/// Σ_p V₀ [U(θ_p) − U(J_p)]; absent if no body has mean dilatation.
pub(crate) struct MeanDilatation<'a, const D: usize, L> {
    step: Step<'a, D, L>,
    cells: Arc<Cells>,
}

/// The state of a cell at one φ.
pub(super) struct State<T> {
    /// Θ − 1
    pub change: T,
    /// Σ V₀ U(θ)
    pub energy: T,
    /// The magnitude to which the round-off of `energy` is relative: θ = Θ θ_r cancels where a compressed cell is compressed no more.
    pub size: f64,
    /// π
    pub pressure: T,
    /// k
    pub stiffness: T,
}

impl<T: Real> State<T> {
    /// The state of the cell with the particles `members` and the volume V_c at Θ = 1 + `change`.
    pub(crate) fn of<const D: usize, L: Law>(
        step: &Step<'_, D, L>,
        members: &[Member],
        volume: f64,
        change: T,
    ) -> Self {
        let (particles, per_volume) = (step.particles, ((change + T::one()) * T::lit(volume)).recip());
        let ([mut energy, mut stress, mut stiffness], mut size) = ([T::zero(); 3], 0.0);
        for p in members.iter().map(|member| member.particle as usize) {
            let (of, volume) = (at_mean(step, p, change), T::lit(particles.volume[p]));
            energy += of.energy * volume;
            stress += of.stress * volume;
            stiffness += (of.stiffness - of.stress) * volume;
            let parts = change.value().abs() + particles.reference().dilatation(p).abs();
            size += (of.energy.value().abs() + of.stress.value().abs() * parts) * volume.value();
        }
        Self { change, energy, size, pressure: stress * per_volume, stiffness: stiffness * per_volume * per_volume }
    }
}

/// U of a particle's body at 1 + `change`; zero for a body without U, whose particles are in no cell.
fn response<T: Real, const D: usize, L: Law>(step: &Step<'_, D, L>, p: usize, change: T) -> VolumeResponse<T> {
    let nothing = VolumeResponse { energy: T::zero(), stress: T::zero(), stiffness: T::zero() };
    step.bodies[step.particles.body[p] as usize].response(change).unwrap_or(nothing)
}

/// U at θ = Θ θ_n of a particle, with Θ − 1 = `change` of its cell.
fn at_mean<T: Real, const D: usize, L: Law>(step: &Step<'_, D, L>, p: usize, change: T) -> VolumeResponse<T> {
    response(step, p, total(change, step.particles.reference().dilatation(p)))
}

/// The state of a particle at one φ.
struct Local<T: Real, const D: usize> {
    jacobian: T,
    response: VolumeResponse<T>,
    /// V₀ J A
    a: Tensor<T, D>,
}

impl<'a, const D: usize, L: Law> MeanDilatation<'a, D, L> {
    pub(super) fn of(step: &Step<'a, D, L>) -> Option<Self> {
        // The mean stress of a step has a term of its own.
        if step.alphas.discrete_gradient {
            return None;
        }
        let cells = Cells::of(step.particles, step.bodies, step.connectivity)?;
        Some(Self { step: *step, cells: Arc::new(cells) })
    }

    /// U at J, which the law contains already.
    fn local<T: Number>(&self, p: usize, g: &Tensor<T, D>) -> Local<T, D> {
        let kinematics = Kinematics(self.step.particles);
        let (at, _) = MaterialState::new(kinematics.displacement_gradient(p, g)).admissible_or_rest();
        let a = kinematics.to_nodes(p, &cofactor(&at.f));
        Local { jacobian: at.jacobian, response: response(&self.step, p, at.j), a }
    }

    fn states<T: Number>(&self, at: Trial<'_, T, D>) -> Vec<State<T>> {
        let changes = self.cells.changes_at(self.step.particles, self.step.connectivity, at);
        let state = |((members, volume), change)| State::of(&self.step, members, volume, change);
        self.cells.iter().zip(changes).map(state).collect()
    }
}

impl<const D: usize, L: Law> MeanDilatation<'_, D, L> {
    /// The rows of all particles, where `local` gives κ = V₀ (J π − J T') and q = V₀ (J π − T) from the cell, V₀ J, V₀ and U at J. With a = V₀ J A
    /// in place of A, κ and q are those over (V₀ J)².
    fn rows(
        &self,
        phi: &[Vector<f64, D>],
        stiffness: Vec<f64>,
        local: impl Fn(usize, f64, f64, VolumeResponse<f64>) -> [f64; 2] + Sync,
    ) -> CellRows<D> {
        let closed = Form::Closed.rows(D);
        let (cells, layout) = (self.cells.clone(), CellLayout::of_potential(D));
        CellRows::new(cells, layout, stiffness, self.step.connectivity, phi, |cell, p, g, lane, rows| {
            let Local { jacobian, response, a } = self.local(p, g);
            for i in 0..D {
                for k in 0..D {
                    rows[i * D + k][lane] = a[(i, k)];
                }
            }
            let volume = self.step.particles.volume[p];
            let weight = volume * jacobian;
            let per_weight = (weight * weight).recip();
            let [bulk, q] = local(cell, weight, volume, response);
            rows[closed - 2][lane] = bulk * per_weight;
            rows[closed - 1][lane] = q * per_weight;
        })
    }

    /// The stiffness of all cells against a change of their volume, for damping: k̂ (Σ a_q : L_q) a with k̂ = Σ V₀ θ T' / v². It is symmetric and
    /// positive semidefinite.
    pub(super) fn volumetric_stiffness(&self, phi: &[Vector<f64, D>]) -> CellRows<D> {
        let states = self.states(Trial::motion(phi));
        let volumes = self.cells.iter().map(|(_, volume)| volume);
        let stiffness =
            |(state, volume): (&State<f64>, f64)| state.stiffness + state.pressure / ((1.0 + state.change) * volume);
        self.rows(phi, states.iter().zip(volumes).map(stiffness).collect(), |_, _, _, _| [0.0; 2])
    }

    /// The cells of the mixed form, with γ = k₀/v and k₀ = κ G/(κ + G).
    fn mixed_cells(&self, states: &[State<f64>], rows: &CellRows<D>) -> Vec<MixedCell<D>> {
        let Step { particles, connectivity, .. } = self.step;
        let (grid, reference) = (connectivity.grid(), particles.reference());
        let cell = |(members, reference_volume): (&[Member], f64), state: &State<f64>, scale: &Scale, id: u64| {
            let volume = (1.0 + state.change) * reference_volume;
            let (mut volume_gradient, mut centroid) = (Tensor::zeros(), Vector::zeros());
            for member in members {
                let p = member.particle as usize;
                volume_gradient += rows.volume_gradient(member);
                centroid += reference.position[p] * (reference.volume(p) / reference_volume);
            }
            let bulk = (state.stiffness * volume).max(SOFTEST * scale.shear);
            MixedCell {
                field: connectivity.field_of(particles.body[members[0].particle as usize]),
                index: grid.index(id),
                centroid,
                volume,
                volume_gradient,
                stiffness: state.stiffness,
                augmentation: bulk * scale.shear / (bulk + scale.shear) / volume,
                scale: *scale,
                reference_volume,
            }
        };
        let cells = &self.cells;
        let all = cells.iter().zip(states).zip(cells.scales.iter().zip(&cells.ids));
        all.map(|((members, state), (scale, &id))| cell(members, state, scale, id)).collect()
    }

    /// G/h (v − Θ V_c) of every cell in the mixed form, with Θ from its own unknown; empty in the displacement form.
    pub(super) fn residuals<T: Number>(&self, at: Trial<'_, T, D>) -> Vec<T> {
        if at.dilatation.is_empty() {
            return Vec::new();
        }
        let Step { particles, connectivity, .. } = self.step;
        let of_motion = self.cells.changes(particles, connectivity, at.phi);
        let own = self.cells.changes_at(particles, connectivity, at);
        let cells = self.cells.iter().zip(&self.cells.scales).zip(of_motion.into_iter().zip(own));
        mutant!("mixed: the residual of a cell is that of half its volume": { return cells.map(|(((_, volume), scale), (motion, own))| (motion - own) * T::lit(0.5 * scale.force * volume)).collect(); });
        cells.map(|(((_, volume), scale), (motion, own))| (motion - own) * T::lit(scale.force * volume)).collect()
    }

    /// The magnitude of the contributions to [`Self::residuals`].
    pub(super) fn magnitudes(&self) -> impl Iterator<Item = f64> {
        self.cells.iter().zip(&self.cells.scales).map(|((_, volume), scale)| 2.0 * scale.force * volume)
    }

    /// The cells, for the unknowns of the mixed form.
    pub(super) fn cells(&self) -> &Cells {
        &self.cells
    }
}

impl<const D: usize, L: Law> Term<D> for MeanDilatation<'_, D, L> {
    fn name(&self) -> &'static str {
        "mean dilatation"
    }

    fn at_points<T: Number>(&self, _: Part, at: Trial<'_, T, D>) -> Option<(Mode, AtPoints<'_, T, D>)> {
        let states = self.states(at);
        Some((
            Mode::GRADIENT,
            Box::new(move |group, at, sums| {
                for (lane, &p) in group.particles.iter().enumerate() {
                    let Some(cell) = self.cells.cell(p) else { continue };
                    let Local { jacobian, response, a } = self.local(p as usize, &at.lane(lane).1);
                    let pressure = states[cell].pressure - response.stress / jacobian;
                    for i in 0..D {
                        for k in 0..D {
                            sums.gradient[i][k][lane] += pressure * a[(i, k)];
                        }
                    }
                }
                Ok(())
            }),
        ))
    }

    fn energy<T: Number>(&self, phi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
        let Step { particles, connectivity, .. } = self.step;
        let states = self.states(Trial::motion(phi));
        let energies = connectivity.evaluate(phi, |p, _, g| {
            let Some(cell) = self.cells.cell(p as u32) else { return [T::zero(); 2] };
            let volume = T::lit(particles.volume[p]);
            let (mean, own) = (at_mean(&self.step, p, states[cell].change), self.local(p, &g).response);
            [mean.energy * volume, -own.energy * volume]
        });
        Some(Ok(summed(energies.into_iter().flatten())))
    }

    fn linearize(&self, at: Trial<'_, f64, D>, _: Part, into: &mut Linearized<D>) -> Result<(), Inadmissible> {
        let states = self.states(at);
        let stiffness = states.iter().map(|state| state.stiffness).collect();
        let mut rows = self.rows(at.phi, stiffness, |cell, weight, volume, response| {
            let of_mean = weight * states[cell].pressure;
            [of_mean - volume * response.stiffness, of_mean - volume * response.stress]
        });
        if !at.dilatation.is_empty() {
            let cells = self.mixed_cells(&states, &rows);
            rows.stiffness = cells.iter().map(|cell| cell.augmentation).collect();
            rows.mixed = Some(cells);
        }
        into.cells.push(rows);
        Ok(())
    }
}
