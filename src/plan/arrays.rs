//! The large arrays of a run, and the bytes of each.

use crate::approximation::ShapeFunction;
use crate::lanes::LANES;
use crate::material::Law;
use crate::mechanics::dilatation::Cells;
use crate::mechanics::loads::SurfacePoint;
use crate::mechanics::reference::GridReset;
use crate::mechanics::sweep::Supports;
use crate::mechanics::tangent::tangent_bytes;
use crate::mechanics::terms::dilatation_rows;
use crate::mechanics::transfer::Projection;
use crate::particles::{Body, Particles};
use crate::simulation::Simulation;
use crate::solver::{Krylov, Preconditioning, multigrid_bytes, saddle_bytes};
use crate::tensor::{Tensor, Vector};
use std::mem::size_of;

/// An array and its bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct ArrayUse {
    /// The contents of the array.
    pub name: &'static str,
    /// Bytes.
    pub bytes: u64,
    /// Whether each of several processes has a part of the array. It has all others whole.
    pub is_shared: bool,
}

/// The arrays that a run of a simulation has.
pub(super) fn arrays<const D: usize, L: Law, A: ShapeFunction>(
    simulation: &Simulation<D, L, A>,
    supports: &Supports<D>,
    cells: usize,
) -> Vec<ArrayUse> {
    let inventory = Inventory {
        simulation,
        supports,
        particles: simulation.particles.len(),
        nodes: supports.active().len(),
        cells,
        has_inertia: simulation.settings.scheme.has_inertia(),
        keeps_grid: simulation.settings.grid_reset != GridReset::EveryStep,
    };
    let whole = [inventory.particle_data(), inventory.nodal_data(), inventory.linear_systems()].concat();
    let shared = inventory.passes().into_iter().map(|row| (row, supports.is_tiled()));
    let used = shared.chain(whole.into_iter().map(|row| (row, false))).filter(|((used, ..), _)| *used);
    used.map(|((_, name, bytes), is_shared)| ArrayUse { name, bytes: bytes as u64, is_shared }).collect()
}

/// Whether a run has the array, the name of the array, and its bytes.
type Row = (bool, &'static str, usize);

/// Bytes of a number.
pub(super) const NUMBER: usize = size_of::<f64>();

/// The counts and choices of a run on which its arrays depend.
struct Inventory<'a, const D: usize, L, A> {
    simulation: &'a Simulation<D, L, A>,
    supports: &'a Supports<D>,
    particles: usize,
    /// Active nodes.
    nodes: usize,
    /// Averaged cells whose dilatations are unknowns.
    cells: usize,
    has_inertia: bool,
    /// Whether the grid is kept over steps.
    keeps_grid: bool,
}

impl<const D: usize, L: Law, A: ShapeFunction> Inventory<'_, D, L, A> {
    const VECTOR: usize = size_of::<Vector<f64, D>>();
    const TENSOR: usize = size_of::<Tensor<f64, D>>();

    /// The arrays of the passes over the particles.
    fn passes(&self) -> Vec<Row> {
        let (simulation, supports) = (self.simulation, self.supports);
        let linearized =
            tangent_bytes(&simulation.particles, &simulation.bodies, supports, simulation.has_mean_stress());
        let boxes = supports.box_bytes(1);
        vec![
            (true, "shape functions: N, dN/dx by axis", supports.bytes()),
            (true, "linearized tangent", linearized),
            (boxes > 0, "boxes of nodes, one for each block of cells", boxes),
        ]
    }

    fn particle_data(&self) -> Vec<Row> {
        let (settings, count) = (&self.simulation.settings, self.particles);
        let variable_count = self.simulation.particles.variable_count;
        let consistent = self.has_inertia && settings.lumping < 1.0;
        let smooths = self.has_inertia && settings.smoothing.is_some();
        let fits = self.has_inertia && settings.projection == Projection::Affine;
        let fit_bytes = count * Self::TENSOR + self.nodes * (4 * Self::TENSOR + 4 * Self::VECTOR);
        vec![
            (true, "particles: x, H, volume, mass, body, id", count * Particles::<D>::BYTES),
            (self.has_inertia, "particles: v, a", count * 2 * Self::VECTOR),
            (variable_count > 0, "particles: memory of laws", count * variable_count * NUMBER),
            // The prediction at the start and at the end of the step.
            (consistent, "particles: prediction for the consistent inertia", count * 2 * Self::VECTOR),
            // The part of the field that nodes cannot represent, its change, and the change of the other field.
            (smooths, "particles: smoothing", count * 3 * Self::VECTOR),
            (fits, "affine fits of v, a", fit_bytes),
            (self.supports.is_tiled(), "particles: the order of the sweep", count * 2 * size_of::<u64>()),
        ]
    }

    /// The arrays of the nodes, of the reference configuration and of the loads.
    fn nodal_data(&self) -> Vec<Row> {
        let (loads, nodes, particles) = (&self.simulation.loads, self.nodes, self.particles);
        let weighs = self.has_inertia || loads.gravity.is_some();
        let motion = nodes * Self::VECTOR * if self.has_inertia { 4 } else { 2 };
        let asks = loads.field.is_some() && !self.has_inertia;
        let carries_over = !self.has_inertia && self.simulation.may_reset();
        let out_of_balance = nodes * Self::VECTOR * if self.keeps_grid { 3 } else { 2 };
        let loaded: usize = loads.surface.iter().map(|load| load.points.len()).sum();
        let points = loaded + loads.contacts.points.len();
        let anchors: usize = loads.contacts.obstacles.iter().map(|obstacle| obstacle.anchors.len()).sum();
        let slips: usize = loads.contacts.between.iter().map(|between| between.slips.len()).sum();
        // In load steps, the points of the last equilibrium are stored, too.
        let copies = if self.has_inertia { 1 } else { 2 };
        vec![
            // The load; Δφ, residual and trial of Newton's method, right-hand side, update and product of the linear solver.
            (true, "nodal fields: loads, Δφ, residuals", nodes * 8 * Self::VECTOR),
            (weighs, "nodal mass", nodes * 2 * NUMBER),
            // v and a, as projected and with prescribed values in place.
            (self.has_inertia, "nodal fields: v, a", nodes * 4 * Self::VECTOR),
            (self.keeps_grid, "particles: x, H at the last grid reset", particles * (Self::VECTOR + Self::TENSOR)),
            (self.keeps_grid, "nodal fields: motion since the grid reset, its rate", motion),
            // The positions of the last load step.
            (asks, "particles: x for a field of forces", particles * Self::VECTOR),
            // The out-of-balance force, as computed and with prescribed values in place; a copy with a kept grid. None on the first grid.
            (carries_over, "nodal fields: out-of-balance force", out_of_balance),
            (
                points > 0,
                "loaded surfaces, and surfaces that may touch something",
                points * copies * size_of::<SurfacePoint<D>>(),
            ),
            (anchors + slips > 0, "state of friction", (anchors + slips) * 2 * copies * Self::VECTOR),
        ]
    }

    fn linear_systems(&self) -> Vec<Row> {
        let (nodes, simulation, supports) = (self.nodes, self.simulation, self.supports);
        let averages = simulation.bodies.iter().any(Body::averages);
        // θ, and on a kept grid θ at the last reset; the cell, and the result of a loop over particles there.
        let dilatation_bytes = Cells::BYTES + NUMBER * if self.keeps_grid { 4 } else { 3 };
        let linearized_dilatation =
            supports.groups() * LANES * (dilatation_rows(D, simulation.has_mean_stress()) + 1) * NUMBER;
        let preconditioner = simulation.preconditioner().0;
        let multigrid = preconditioner == Preconditioning::Multigrid;
        let followers = supports.extension().map_or(0, |extension| extension.bytes());
        let krylov_vectors = match simulation.krylov().0 {
            // The basis; residual, correction, trial and product.
            Krylov::Gmres { restart } => restart as usize + 5,
            Krylov::Automatic | Krylov::ConjugateGradient => 7,
        };
        vec![
            (averages, "particles: mean dilatation", self.particles * dilatation_bytes),
            (averages, "linearized tangent: mean dilatation", linearized_dilatation),
            (true, "preconditioner: diagonal blocks", nodes * Self::TENSOR),
            (followers > 0, "nodes that follow others, and their weights", followers),
            (multigrid, "preconditioner: multigrid levels", multigrid_bytes(nodes, D)),
            (self.cells > 0, "preconditioner: Schur complement of cells", saddle_bytes(self.cells, D)),
            (true, "Krylov vectors", (nodes * D + self.cells) * krylov_vectors * NUMBER),
        ]
    }
}
