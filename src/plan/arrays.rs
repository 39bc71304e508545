//! The large arrays of a run, and the bytes of each.

use crate::approximation::ShapeFunction;
use crate::lanes::LANES;
use crate::material::Law;
use crate::mechanics::dilatation::Cells;
use crate::mechanics::loads::SurfacePoint;
use crate::mechanics::reference::GridReset;
use crate::mechanics::sweep::Supports;
use crate::mechanics::tangent::tangent_bytes;
use crate::mechanics::terms::linearized_rows;
use crate::mechanics::transfer::Projection;
use crate::particles::{Body, Particles};
use crate::simulation::Simulation;
use crate::solver::{Krylov, Preconditioning, direct_bytes, multigrid_bytes};
use crate::tensor::{Tensor, Vector};
use std::mem::size_of;

/// An array and its bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct ArrayUse {
    /// The contents of the array.
    pub name: &'static str,
    /// Bytes.
    pub bytes: u64,
}

/// The arrays that a run of a simulation has.
pub(super) fn arrays<const D: usize, L: Law, A: ShapeFunction>(
    simulation: &Simulation<D, L, A>,
    supports: &Supports<D>,
) -> Vec<ArrayUse> {
    let inventory = Inventory {
        simulation,
        supports,
        particles: simulation.particles.len(),
        nodes: supports.active().len(),
        has_inertia: simulation.settings.scheme.has_inertia(),
        keeps_grid: simulation.settings.grid_reset != GridReset::EveryStep,
        averages: simulation.bodies.iter().any(Body::averages),
    };
    let all = [
        inventory.particle_data(),
        inventory.shape_functions(),
        inventory.nodal_fields(),
        inventory.reference_configuration(),
        inventory.loads(),
        inventory.tangent(),
        inventory.linear_solver(),
    ];
    let used = all.into_iter().flatten().filter(|array| array.used);
    used.map(|array| ArrayUse { name: array.name, bytes: (array.entries * array.entry_bytes) as u64 }).collect()
}

/// An array that some runs have.
struct PlannedArray {
    /// Whether this run has the array.
    used: bool,
    name: &'static str,
    /// The number of particles, nodes or points with an entry.
    entries: usize,
    entry_bytes: usize,
}

impl PlannedArray {
    /// An array whose bytes are known as a whole.
    fn whole(used: bool, name: &'static str, bytes: usize) -> Self {
        Self { used, name, entries: 1, entry_bytes: bytes }
    }
}

/// Bytes of `count` numbers.
const fn numbers(count: usize) -> usize {
    count * size_of::<f64>()
}

/// Bytes of `count` vectors.
const fn vectors<const D: usize>(count: usize) -> usize {
    count * size_of::<Vector<f64, D>>()
}

/// Bytes of `count` tensors.
const fn tensors<const D: usize>(count: usize) -> usize {
    count * size_of::<Tensor<f64, D>>()
}

/// The counts and choices of a run on which its arrays depend.
struct Inventory<'a, const D: usize, L, A> {
    simulation: &'a Simulation<D, L, A>,
    supports: &'a Supports<D>,
    particles: usize,
    /// Active nodes.
    nodes: usize,
    has_inertia: bool,
    /// Whether the grid is kept over steps.
    keeps_grid: bool,
    /// Whether the particles of a cell share one change of volume.
    averages: bool,
}

impl<const D: usize, L: Law, A: ShapeFunction> Inventory<'_, D, L, A> {
    fn particle_data(&self) -> Vec<PlannedArray> {
        let settings = &self.simulation.settings;
        let remembered = self.simulation.particles.remembered;
        let consistent = self.has_inertia && settings.lumping < 1.0;
        let smooths = self.has_inertia && settings.smoothing.is_some();
        let fits = self.has_inertia && settings.projection == Projection::Affine;
        let particles = |used, name, entry_bytes| PlannedArray { used, name, entries: self.particles, entry_bytes };
        let fit_bytes = self.particles * tensors::<D>(1) + self.nodes * (tensors::<D>(4) + vectors::<D>(4));
        vec![
            particles(true, "particles: x, H, volume, mass, body, id", Particles::<D>::BYTES),
            particles(self.has_inertia, "particles: v, a", vectors::<D>(2)),
            particles(remembered > 0, "particles: memory of laws", numbers(remembered)),
            // The prediction at the start and at the end of the step.
            particles(consistent, "particles: prediction for the consistent inertia", vectors::<D>(2)),
            // The part of the field that nodes cannot represent, its change, and the change of the other field.
            particles(smooths, "particles: smoothing", vectors::<D>(3)),
            PlannedArray::whole(fits, "affine fits of v, a", fit_bytes),
        ]
    }

    fn shape_functions(&self) -> Vec<PlannedArray> {
        vec![
            PlannedArray::whole(true, "shape functions: N, dN/dx by axis", self.supports.bytes()),
            PlannedArray {
                used: self.supports.is_tiled(),
                name: "particles: the order of the sweep",
                entries: self.particles,
                entry_bytes: 2 * size_of::<u64>(),
            },
        ]
    }

    fn nodal_fields(&self) -> Vec<PlannedArray> {
        let weighs = self.has_inertia || self.simulation.loads.gravity.is_some();
        let nodes = |used, name, entry_bytes| PlannedArray { used, name, entries: self.nodes, entry_bytes };
        vec![
            // The load; Δφ, residual and trial of Newton's method, right-hand side, update and product of the linear solver.
            nodes(true, "nodal fields: loads, Δφ, residuals", vectors::<D>(8)),
            nodes(weighs, "nodal mass", numbers(2)),
            // v and a, as projected and with prescribed values in place.
            nodes(self.has_inertia, "nodal fields: v, a", vectors::<D>(4)),
        ]
    }

    /// The arrays of a grid that is kept over steps, or whose out-of-balance force is carried over.
    fn reference_configuration(&self) -> Vec<PlannedArray> {
        let particles = |used, name, entry_bytes| PlannedArray { used, name, entries: self.particles, entry_bytes };
        let nodes = |used, name, entry_bytes| PlannedArray { used, name, entries: self.nodes, entry_bytes };
        let motion = vectors::<D>(if self.has_inertia { 4 } else { 2 });
        let carries_over = !self.has_inertia && self.simulation.may_reset();
        let asks = self.simulation.loads.field.is_some() && !self.has_inertia;
        vec![
            particles(self.keeps_grid, "particles: x, H at the last grid reset", vectors::<D>(1) + tensors::<D>(1)),
            nodes(self.keeps_grid, "nodal fields: motion since the grid reset, its rate", motion),
            // The positions of the last load step.
            particles(asks, "particles: x for a field of forces", vectors::<D>(1)),
            // The out-of-balance force, as computed and with prescribed values in place; a copy with a kept grid. None on the first grid.
            nodes(
                carries_over,
                "nodal fields: out-of-balance force",
                vectors::<D>(if self.keeps_grid { 3 } else { 2 }),
            ),
        ]
    }

    fn loads(&self) -> Vec<PlannedArray> {
        let points = self.simulation.loads.surface.iter().map(|load| load.points.len()).sum();
        // In load steps, the points of the last equilibrium are stored, too.
        let copies = if self.has_inertia { 1 } else { 2 };
        vec![PlannedArray {
            used: points > 0,
            name: "loaded surfaces",
            entries: points,
            entry_bytes: copies * size_of::<SurfacePoint<D>>(),
        }]
    }

    fn tangent(&self) -> Vec<PlannedArray> {
        let linearized = tangent_bytes(&self.simulation.particles, &self.simulation.bodies, self.supports);
        // θ, and on a kept grid θ at the last reset; the cell, and the result of a loop over particles there.
        let mean_dilatation = Cells::BYTES + numbers(if self.keeps_grid { 4 } else { 3 });
        vec![
            PlannedArray::whole(true, "linearized tangent", linearized),
            PlannedArray {
                used: self.averages,
                name: "particles: mean dilatation",
                entries: self.particles,
                entry_bytes: mean_dilatation,
            },
            PlannedArray {
                used: self.averages,
                name: "linearized tangent: mean dilatation",
                entries: self.supports.groups() * LANES,
                entry_bytes: numbers(linearized_rows(D) + 1),
            },
        ]
    }

    fn linear_solver(&self) -> Vec<PlannedArray> {
        let (nodes, simulation, supports) = (self.nodes, self.simulation, self.supports);
        let preconditioner = simulation.preconditioner().0;
        let multigrid = preconditioner == Preconditioning::Multigrid;
        let direct = preconditioner == Preconditioning::Direct;
        let followers = supports.extension().map_or(0, |extension| extension.bytes());
        let krylov_vectors = match simulation.krylov().0 {
            // The basis; residual, correction, trial and product.
            Krylov::Gmres { restart } => restart as usize + 5,
            Krylov::Automatic | Krylov::ConjugateGradient => 5,
        };
        let per_node = |used, name, entry_bytes| PlannedArray { used, name, entries: nodes, entry_bytes };
        vec![
            per_node(!direct, "preconditioner: diagonal blocks", tensors::<D>(1)),
            PlannedArray::whole(followers > 0, "nodes that follow others, and their weights", followers),
            PlannedArray::whole(multigrid, "preconditioner: multigrid levels", multigrid_bytes(nodes, D)),
            PlannedArray::whole(
                direct,
                "preconditioner: assembled tangent and its factor",
                direct_bytes(nodes, D, supports.reach() as usize),
            ),
            per_node(true, "Krylov vectors", vectors::<D>(krylov_vectors)),
        ]
    }
}
