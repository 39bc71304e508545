//! A step linearised at one φ, as data, and the product that reads it. A term writes its arrays; nothing else of the term is needed afterwards.
//!
//! | array | entries | its part of K u |
//! |---|---|---|
//! | α M̃ | nodes, particles | α (ε m_I u_I + Σ_p (1 − ε) m_p u_p N_I) |
//! | [`TangentRows`] | particles | Σ_p (𝔸 : L) ∇_r N_I |
//! | [`CellRows`] | particles, averaged cells | Σ_p (𝔸 : L + δp a) ∇_r N_I with δp = k Σ_{q∈c} b_q : L_q |
//! | [`PressureRows`] | points of loaded surfaces | Σ δ(p A cof(F) N) N_I |
//! | [`ContactRows`] | points in contact | −Σ (∂f/∂x δx + ∂f/∂q δq) N_I |

mod cells;
mod contact;
mod pressure;
mod rows;

pub(crate) use cells::{CellLayout, CellRows, MixedCell};
pub(crate) use contact::{ContactRow, ContactRows};
pub(crate) use pressure::{PressureRow, PressureRows};
pub(crate) use rows::TangentRows;

use crate::gpu::{self, Gpu};
use crate::mechanics::effective::Function;
use crate::mechanics::mass::Mass;
use crate::mechanics::sweep::{At, Connectivity, Group, Mode, Quadratic};
use crate::tensor::{Tensor, Vector, identity, scaled};

/// A linearised step. By default it is that of no term.
#[derive(Debug, Default)]
pub(crate) struct Linearized<const D: usize> {
    /// α, the factor of M̃.
    pub mass: f64,
    /// The tangents of the laws.
    pub stresses: Vec<TangentRows>,
    /// The tangents of averaged cells.
    pub cells: Vec<CellRows<D>>,
    /// Follower pressures.
    pub pressures: PressureRows<D>,
    /// Contact.
    pub contacts: ContactRows<D>,
}

/// The direction of a product.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Along<'x, const D: usize> {
    /// A nodal field. If given, changes of the pressures of averaged cells replace those that the field causes.
    Field(&'x [Vector<f64, D>], Option<&'x [f64]>),
    /// The same gradient at all particles.
    Gradient(&'x Tensor<f64, D>),
}

/// δp of every averaged cell, an array for each entry of [`Linearized::cells`].
pub(crate) type PressureChanges = Vec<Vec<f64>>;

/// The effective shape functions of all unknowns at a particle, by node.
pub(crate) type FunctionsAt<'a, const D: usize> = dyn Fn(usize) -> Vec<(usize, Function<D>)> + 'a;

impl<const D: usize> Linearized<D> {
    /// `out += K u`
    pub(crate) fn add_product(
        &self,
        mass: &Mass<'_, D>,
        u: &[Vector<f64, D>],
        pressures: Option<&[f64]>,
        out: &mut [Vector<f64, D>],
    ) {
        self.add_product_at_nodes(mass, u, out);
        let Some(mode) = self.mode(mass) else { return };
        let changes = self.pressure_changes(mass.connectivity, Along::Field(u, pressures));
        mass.connectivity.sweep(Some(u), mode, out, |group, at, sums| {
            self.add_product_of_group(mass, &changes, group, at, sums);
        });
    }

    /// The part of the product that needs no pass over the particles.
    pub(crate) fn add_product_at_nodes(&self, mass: &Mass<'_, D>, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        if self.mass != 0.0 {
            mass.add_lumped(self.mass, u, out);
        }
        self.pressures.add_product(mass.connectivity, u, out);
        self.contacts.add_product(u, out);
    }

    /// The kind of pass over the particles that a product needs; `None` for no pass.
    fn mode(&self, mass: &Mass<'_, D>) -> Option<Mode> {
        let gradient = !(self.stresses.is_empty() && self.cells.is_empty());
        let value = self.mass != 0.0 && mass.lumping < 1.0;
        (value || gradient).then_some(Mode { value, gradient, ..Mode::BOTH })
    }

    /// δp of all averaged cells.
    pub(crate) fn pressure_changes(&self, connectivity: &Connectivity<D>, along: Along<'_, D>) -> PressureChanges {
        self.cells.iter().map(|cells| cells.pressure_changes(connectivity, along)).collect()
    }

    /// Adds q and σ of a group of particles to `sums`.
    #[inline(always)]
    pub(crate) fn add_product_of_group(
        &self,
        mass: &Mass<'_, D>,
        changes: &PressureChanges,
        group: Group<'_>,
        at: &At<f64, D, D>,
        sums: &mut At<f64, D, D>,
    ) {
        if self.mass != 0.0 && mass.lumping < 1.0 {
            mass.add_consistent(self.mass, group, at, sums);
        }
        for rows in &self.stresses {
            rows.add_product(group, at, sums);
        }
        for (rows, changes) in self.cells.iter().zip(changes) {
            rows.add_product(changes, group, at, sums);
        }
    }

    /// The rows of laws and averaged cells on a device.
    pub(crate) fn rows_on_device(&self, gpu: &Gpu, connectivity: &Connectivity<D>) -> Vec<gpu::Rows> {
        let stresses = self.stresses.iter().map(|rows| rows.on_device(gpu));
        stresses.chain(self.cells.iter().map(|cells| cells.on_device(gpu, connectivity))).collect()
    }

    /// The rows of laws and averaged cells on a device, without the coupling of the cells.
    pub(crate) fn rows_without_cells_on_device(&self, gpu: &Gpu) -> Vec<gpu::Rows> {
        let rows = self.stresses.iter().chain(self.cells.iter().map(|cells| &cells.rows));
        rows.map(|rows| rows.on_device(gpu)).collect()
    }

    /// Adds the diagonal blocks of the lumped mass.
    pub(crate) fn add_blocks_at_nodes(&self, mass: &Mass<'_, D>, blocks: &mut [Tensor<f64, D>]) {
        if self.mass != 0.0 {
            for (block, m) in blocks.iter_mut().zip(mass.lumped) {
                *block += scaled(&identity(), self.mass * mass.lumping * m);
            }
        }
    }

    /// Adds the diagonal blocks that need the effective shape functions of single particles.
    pub(crate) fn add_blocks_of_functions(&self, functions: &FunctionsAt<'_, D>, blocks: &mut [Tensor<f64, D>]) {
        self.cells.iter().for_each(|cells| cells.add_blocks(functions, blocks));
        self.pressures.add_blocks(functions, blocks);
        self.contacts.add_blocks(functions, blocks);
    }

    /// Whether particles have a quadratic form.
    pub(crate) fn has_quadratic(&self, mass: &Mass<'_, D>) -> bool {
        self.mode(mass).is_some()
    }

    /// Adds the quadratic form of a group of particles, without the coupling of averaged cells.
    pub(crate) fn add_quadratic(&self, mass: &Mass<'_, D>, group: Group<'_>, form: &mut Quadratic) {
        if mass.lumping < 1.0 {
            for (lane, &p) in group.particles.iter().enumerate() {
                form.mass[lane] += self.mass * mass.consistent(p as usize);
            }
        }
        let rows = self.stresses.iter().chain(self.cells.iter().map(|cells| &cells.rows));
        rows.for_each(|rows| rows.add_quadratic(D, group, form));
    }

    /// The averaged cells whose dilatation is an unknown of its own.
    pub(crate) fn mixed(&self) -> Option<&CellRows<D>> {
        self.cells.iter().find(|cells| cells.mixed.is_some())
    }

    /// Adds `factor` times another linearisation that has masses and rows of particles alone, and shares its rows.
    pub(crate) fn add_scaled(&mut self, other: &Self, factor: f64) {
        self.mass += factor * other.mass;
        self.stresses.extend(other.stresses.iter().map(|rows| rows.clone().times(factor)));
        self.cells.extend(other.cells.iter().map(|rows| rows.clone().times(factor)));
    }
}
