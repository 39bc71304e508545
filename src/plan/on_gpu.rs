//! The memory that a run takes on a GPU.

use super::arrays::NUMBER;
use crate::approximation::ShapeFunction;
use crate::gpu::{Gpu, GpuError};
use crate::lanes::LANES;
use crate::material::{Formula, Law};
use crate::mechanics::sweep::ShapeFunctionError;
use crate::mechanics::tangent::tangent_bytes;
use crate::mechanics::terms::dilatation_rows;
use crate::particles::Body;
use crate::simulation::Simulation;
use crate::solver::{Krylov, Preconditioning, multigrid_bytes};

/// The memory that a run takes on a GPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeviceUse {
    /// Bytes of the device's memory.
    pub bytes: usize,
    /// Bytes that the threads of a block share.
    pub shared: usize,
    /// Bytes of the linearised laws that are sent to the device in each Newton iteration; 0 if the device evaluates the laws, where averaged
    /// cells alone are sent.
    pub sent: usize,
}

impl DeviceUse {
    /// The memory for a simulation, from its shape functions at the present positions.
    ///
    /// # Errors
    /// A particle has no shape functions.
    pub fn of<const D: usize, L: Law, A: ShapeFunction>(
        simulation: &Simulation<D, L, A>,
    ) -> Result<Self, ShapeFunctionError> {
        let connectivity = simulation.new_connectivity(None)?;
        let (settings, nodes) = (&simulation.settings, connectivity.active().len());
        let by_lane = connectivity.groups() * LANES * NUMBER;
        let mean_stress = simulation.has_mean_stress();
        let laws = tangent_bytes(&simulation.particles, &simulation.bodies, &connectivity, mean_stress);
        let averages = simulation.bodies.iter().any(Body::averages);
        let cells = if averages { by_lane * (dilatation_rows(D, mean_stress) + 1) + by_lane / 2 } else { 0 };
        let has_inertia = settings.scheme.has_inertia();
        let damps = has_inertia && simulation.loads.damping.is_some_and(|damping| damping.stiffness > 0.0);
        let sets = if damps { 2 } else { 1 };
        let are_formulas = !mean_stress && simulation.bodies.iter().all(|body| Formula::of(&body.law).is_some());
        // The changes of a step at the particles take the memory of the linearised laws.
        let changes = simulation.particles.len() * (D * D + if has_inertia { 3 * D } else { D }) * NUMBER;
        let rows = (sets * (laws + cells)).max(changes);
        // H_r, V₀ and the body of each particle, and φ̂ for a consistent mass.
        let predicted = if has_inertia && settings.lumping < 1.0 { by_lane * D } else { 0 };
        let solids = if are_formulas { by_lane * (D * D + 1) + by_lane / 2 + predicted } else { 0 };
        let sent = if are_formulas { 0 } else { laws + cells };
        let masses = if has_inertia { by_lane + nodes * NUMBER } else { 0 };
        let multigrid = simulation.preconditioner().0 == Preconditioning::Multigrid;
        let vectors = match simulation.krylov().0 {
            // Right-hand side, solution, residual, trial, correction, and the basis.
            Krylov::Gmres { restart } => restart as usize + 7,
            // Right-hand side, solution, residual; three iterates, and z, p and q.
            Krylov::Automatic | Krylov::ConjugateGradient => 9,
        } + if multigrid { 10 } else { 0 };
        // The form from which the levels are made stays on the processor.
        let levels = if multigrid { multigrid_bytes(nodes, D) - nodes * D.pow(4) * NUMBER } else { 0 };
        // The filter of cubic functions: neighbours along each axis, scales, and three vectors.
        let is_cubic = connectivity.extension().is_some_and(|extension| extension.degree() == 3);
        let filter = if multigrid && is_cubic { nodes * D * (2 * size_of::<u32>() + 4 * NUMBER) } else { 0 };
        let followers = connectivity.extension().map_or(0, |extension| extension.bytes() + nodes * D * NUMBER);
        // The mask of prescribed values, diagonal blocks, and vectors.
        let nodal = nodes * D * (1 + D * NUMBER + NUMBER * vectors);
        let [functions, shared] = connectivity.device_bytes();
        let bytes = functions + rows + solids + masses + levels + filter + followers + nodal;
        Ok(Self { bytes, shared, sent })
    }

    /// Whether the run fits on a device. Returns the free bytes of its memory.
    ///
    /// # Errors
    /// They do not fit.
    pub(crate) fn check_fits(self, gpu: &Gpu) -> Result<usize, GpuError> {
        let Self { bytes, shared, .. } = self;
        gpu.check_shared(shared)?;
        let (free, total) = gpu.memory().ok_or_else(|| GpuError::NoDevice("its memory is unknown".to_owned()))?;
        if bytes <= free { Ok(free) } else { Err(GpuError::Memory { bytes, free, total }) }
    }
}
