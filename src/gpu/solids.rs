//! The particles with their laws on a device, where the laws are formulas (`kernels/recorded.h`): forces in the residual, and tangents.

use super::device::{Buffer, Gpu, arguments};
use super::product::{Inertia, InertiaArguments};
use super::transfer::{Gathers, Transfer};
use crate::lanes::LANES;
use crate::material::Formula;
use std::sync::Arc;

/// The states of the particles at the last grid reset, on a device.
#[derive(Debug)]
pub(crate) struct States {
    states: Buffer<f64>,
    bodies: Buffer<u32>,
}

impl States {
    /// Of each group, a row of lanes each: H_r by rows, then V₀; and a row of the bodies.
    pub(crate) fn new(gpu: &Gpu, states: &[[f64; LANES]], bodies: &[[u32; LANES]]) -> Self {
        Self { states: gpu.copy_of(states.as_flattened()), bodies: gpu.copy_of(bodies.as_flattened()) }
    }
}

/// The particles with the laws of their bodies, on a device.
#[derive(Debug)]
pub(crate) struct Solids {
    transfer: Arc<Transfer>,
    of_particles: Arc<States>,
    laws: Buffer<u32>,
    constants: Buffer<f64>,
}

/// `Solids` of `kernels/data.h`.
#[derive(Clone, Copy)]
#[repr(C)]
struct SolidsArguments {
    states: u64,
    bodies: u64,
    laws: u64,
    constants: u64,
    failed: u64,
}

/// The inertia of particles in the residual: their masses with α₁, and φ̂ at the particles, a row of lanes for each component of each group.
pub(crate) type InertiaOfParticles<'a> = (Inertia, &'a Buffer<f64>);

impl Solids {
    /// The particles with the law of each body.
    pub(crate) fn new(transfer: Arc<Transfer>, of_particles: Arc<States>, formulas: &[Formula]) -> Self {
        let gpu = transfer.gpu();
        let laws: Vec<u32> = formulas.iter().map(|formula| formula.law).collect();
        let constants: Vec<f64> = formulas.iter().flat_map(|formula| formula.constants).collect();
        let (laws, constants) = (gpu.copy_of(&laws), gpu.copy_of(&constants));
        Self { transfer, of_particles, laws, constants }
    }

    /// The device.
    pub(crate) fn gpu(&self) -> &Arc<Gpu> {
        self.transfer.gpu()
    }

    /// Runs `launch` with the particles. Returns whether all particles have det F > 0 and the device has not failed.
    fn succeed(&self, launch: impl FnOnce(SolidsArguments)) -> bool {
        let gpu = self.gpu();
        let failed = gpu.copy_of(&[0_u32]);
        launch(SolidsArguments {
            states: self.of_particles.states.address(),
            bodies: self.of_particles.bodies.address(),
            laws: self.laws.address(),
            constants: self.constants.address(),
            failed: failed.address(),
        });
        let mut has_failed = [1];
        gpu.read_at(&failed, 0, &mut has_failed);
        has_failed == [0] && gpu.check().is_ok()
    }

    /// `out +=` Σ_p q N_I + σ ∇_r N_I at φ, with σ = V₀ F S F_rᵀ and the inertia of the particles; or Σ_p |σ| |∇_r N_I| if `magnitudes`.
    /// Returns whether the forces were added. Otherwise `out` is unchanged.
    pub(crate) fn add_forces(
        &self,
        inertia: Option<&InertiaOfParticles<'_>>,
        magnitudes: bool,
        phi: &[f64],
        out: &mut [f64],
    ) -> bool {
        let (gpu, transfer) = (self.gpu(), &self.transfer);
        let _lock = gpu.lock();
        let (phi, start, mut sums) = (gpu.copy_of(phi), gpu.copy_of(out), gpu.memory_for(out.len()));
        let succeeded = self.succeed(|solids| {
            let gathers = Gathers { values: inertia.is_some(), gradients: true, magnitudes };
            // `Forces` of `kernels/data.h`.
            let arguments = arguments! {
                pass: transfer.pass(phi.address(), gathers),
                solids,
                inertia: InertiaArguments::of(inertia.map(|(inertia, _)| inertia)),
                predicted: inertia.map_or(0, |(_, predicted)| predicted.address()),
            };
            transfer.launch(["forces_1", "forces_2", "forces_3"], transfer.shared, &arguments);
            transfer.add_boxes(&start, &mut sums);
        });
        succeeded && gpu.read_all(&sums, out)
    }

    /// The tangents at φ in a closed form, with `count` rows a group; `None` if a particle has det F ≤ 0, or the device fails.
    pub(crate) fn linearized(&self, count: usize, phi: &[f64]) -> Option<Buffer<f64>> {
        let (gpu, transfer) = (self.gpu(), &self.transfer);
        let phi = gpu.copy_of(phi);
        let mut rows = gpu.memory_for(self.of_particles.bodies.len() * count);
        gpu.clear(&mut rows);
        let succeeded = self.succeed(|solids| {
            // `Linearize` of `kernels/data.h`.
            let arguments = arguments! {
                transfer: transfer.arguments(),
                u: phi.address(),
                solids,
                rows: rows.address(),
                count: count as i32,
            };
            transfer.launch(["linearize_1", "linearize_2", "linearize_3"], transfer.shared, &arguments);
        });
        succeeded.then_some(rows)
    }
}
