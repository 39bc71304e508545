//! The large arrays of a run, and the bytes of each.

use crate::approximation::ShapeFunction;
use crate::lanes::LANES;
use crate::material::Law;
use crate::mechanics::dilatation::Cells;
use crate::mechanics::loads::SurfacePoint;
use crate::mechanics::reference::GridReset;
use crate::mechanics::sweep::Connectivity;
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
    connectivity: &Connectivity<D>,
    cells: usize,
) -> Vec<ArrayUse> {
    let (is_tiled, whole) = (connectivity.is_tiled(), simulation.needs_all_particles());
    let groups = [
        (simulation.pass_arrays(connectivity), is_tiled),
        (simulation.own_arrays(), is_tiled && !whole),
        (simulation.particle_arrays(connectivity), false),
        (simulation.nodal_arrays(connectivity.nodes()), false),
        (simulation.solver_arrays(connectivity, cells), false),
    ];
    let rows = groups.into_iter().flat_map(|(rows, is_shared)| rows.into_iter().map(move |row| (row, is_shared)));
    let used = rows.filter(|((used, ..), _)| *used);
    used.map(|((_, name, bytes), is_shared)| ArrayUse { name, bytes: bytes as u64, is_shared }).collect()
}

/// Whether a run has the array, the name of the array, and its bytes.
type Row = (bool, &'static str, usize);

/// Bytes of a number.
pub(super) const NUMBER: usize = size_of::<f64>();

/// A row for each array of a run.
impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    const VECTOR: usize = size_of::<Vector<f64, D>>();
    const TENSOR: usize = size_of::<Tensor<f64, D>>();

    fn has_inertia(&self) -> bool {
        self.settings.scheme.has_inertia()
    }

    /// Whether the grid is kept over steps.
    fn keeps_grid(&self) -> bool {
        self.settings.grid_reset != GridReset::EveryStep
    }

    /// The arrays of the passes over the particles.
    fn pass_arrays(&self, connectivity: &Connectivity<D>) -> Vec<Row> {
        let linearized = tangent_bytes(&self.particles, &self.bodies, connectivity, self.has_mean_stress());
        let boxes = connectivity.box_bytes(1);
        let consistent = self.has_inertia() && self.settings.lumping < 1.0;
        vec![
            (true, "shape functions: N, dN/dx by axis", connectivity.bytes()),
            (true, "linearized tangent", linearized),
            (boxes > 0, "boxes of nodes, one for each block of cells", boxes),
            // The prediction at the start and at the end of the step.
            (consistent, "particles: prediction for the consistent inertia", self.particles.len() * 2 * Self::VECTOR),
        ]
    }

    /// The arrays that a process may have of its own particles alone.
    fn own_arrays(&self) -> Vec<Row> {
        let (count, variable_count) = (self.particles.len(), self.particles.variable_count);
        vec![
            (true, "particles: H", count * Self::TENSOR),
            (self.has_inertia(), "particles: v, a", count * 2 * Self::VECTOR),
            (self.keeps_grid(), "particles: H at the last grid reset", count * Self::TENSOR),
            (variable_count > 0, "particles: memory of laws", count * variable_count * NUMBER),
        ]
    }

    fn particle_arrays(&self, connectivity: &Connectivity<D>) -> Vec<Row> {
        let (settings, count, nodes) = (&self.settings, self.particles.len(), connectivity.nodes());
        let smooths = self.has_inertia() && settings.smoothing.is_some();
        let fits = self.has_inertia() && settings.projection == Projection::Affine;
        let fit_bytes = count * Self::TENSOR + nodes * (4 * Self::TENSOR + 4 * Self::VECTOR);
        vec![
            (true, "particles: x, volume, mass, body, id", count * (Particles::<D>::BYTES - Self::TENSOR)),
            (self.keeps_grid(), "particles: x at the last grid reset", count * Self::VECTOR),
            // The part of the field that nodes cannot represent, its change, and the change of the other field.
            (smooths, "particles: smoothing", count * 3 * Self::VECTOR),
            (fits, "affine fits of v, a", fit_bytes),
            (connectivity.is_tiled(), "particles: the order of the sweep", count * 2 * size_of::<u64>()),
        ]
    }

    /// The arrays of the nodes, of the reference configuration and of the loads.
    fn nodal_arrays(&self, nodes: usize) -> Vec<Row> {
        let (loads, particles) = (&self.loads, self.particles.len());
        let weighs = self.has_inertia() || loads.gravity.is_some();
        let motion = nodes * Self::VECTOR * if self.has_inertia() { 4 } else { 2 };
        let asks = loads.field.is_some() && !self.has_inertia();
        let carries_over = !self.has_inertia() && self.may_reset();
        let out_of_balance = nodes * Self::VECTOR * if self.keeps_grid() { 3 } else { 2 };
        let loaded: usize = loads.surface.iter().map(|load| load.points.len()).sum();
        let points = loaded + loads.contacts.points.len();
        let anchors: usize = loads.contacts.obstacles.iter().map(|obstacle| obstacle.anchors.len()).sum();
        let slips: usize = loads.contacts.between.iter().map(|between| between.slips.len()).sum();
        // In load steps, the points of the last equilibrium are stored, too.
        let copies = if self.has_inertia() { 1 } else { 2 };
        vec![
            // The load; Δφ, residual and trial of Newton's method, right-hand side, update and product of the linear solver.
            (true, "nodal fields: loads, Δφ, residuals", nodes * 8 * Self::VECTOR),
            (weighs, "nodal mass", nodes * 2 * NUMBER),
            // v and a, as projected and with prescribed values in place.
            (self.has_inertia(), "nodal fields: v, a", nodes * 4 * Self::VECTOR),
            (self.keeps_grid(), "nodal fields: motion since the grid reset, its rate", motion),
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

    fn solver_arrays(&self, connectivity: &Connectivity<D>, cells: usize) -> Vec<Row> {
        let nodes = connectivity.nodes();
        let averages = self.bodies.iter().any(Body::averages);
        // θ, and on a kept grid θ at the last reset; the cell, and the result of a loop over particles there.
        let dilatation_bytes = Cells::BYTES + NUMBER * if self.keeps_grid() { 4 } else { 3 };
        let linearized_dilatation =
            connectivity.groups() * LANES * (dilatation_rows(D, self.has_mean_stress()) + 1) * NUMBER;
        let preconditioner = self.preconditioner().0;
        let multigrid = preconditioner == Preconditioning::Multigrid;
        let followers = connectivity.extension().map_or(0, |extension| extension.bytes());
        let krylov_vectors = match self.krylov().0 {
            // The basis; residual, correction, trial and product.
            Krylov::Gmres { restart } => restart as usize + 5,
            Krylov::Automatic | Krylov::ConjugateGradient => 7,
        };
        vec![
            (averages, "particles: mean dilatation", self.particles.len() * dilatation_bytes),
            (averages, "linearized tangent: mean dilatation", linearized_dilatation),
            (true, "preconditioner: diagonal blocks", nodes * Self::TENSOR),
            (followers > 0, "nodes that follow others, and their weights", followers),
            (multigrid, "preconditioner: multigrid levels", multigrid_bytes(nodes, D)),
            (cells > 0, "preconditioner: Schur complement of cells", saddle_bytes(cells, D)),
            (true, "Krylov vectors", (nodes * D + cells) * krylov_vectors * NUMBER),
        ]
    }
}
