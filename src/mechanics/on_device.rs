//! A step on a device. The product of the tangent runs there. If the laws are formulas, the residual and the linearisation run there, too.

use super::constitutive::Laws;
use super::sweep::Connectivity;
use super::tangent::Tangent;
use crate::gpu::{self, Gpu, GpuVector, Inertia, OfParticles, Product, Solids, Transfer};
use crate::material::{Formula, Law};
use crate::solver::{LinearOperator, OnDevice};
use crate::space::vector::Vectors;
use crate::tensor::Vector;
use std::sync::{Arc, Mutex};

/// The tangent on a device.
pub(super) struct DeviceTangent(Product);

impl LinearOperator<GpuVector> for DeviceTangent {
    fn apply(&self, x: &GpuVector, y: &mut GpuVector) {
        self.0.apply(x, y);
    }
}

impl OnDevice for DeviceTangent {
    fn gpu(&self) -> &Arc<Gpu> {
        self.0.of_particles.transfer.gpu()
    }
}

impl<const D: usize> Tangent<'_, D> {
    /// K u on the free degrees of freedom, as the solver computes it: on the device, if the tangent has one. NaN where the device fails.
    pub fn solver_product(&self, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        let Some(device) = self.device_tangent() else { return self.product(u, out) };
        let gpu = device.gpu();
        let (x, mut y) = (gpu.vector(bytemuck::cast_slice(u)), gpu.zeros(D * u.len()));
        device.apply(&x, &mut y);
        out.copy_from_slice(bytemuck::cast_slice(&gpu.numbers(&y)));
    }

    /// The tangents and masses of the particles on the device, if the shape functions lie on one. `rows` copies the tangents.
    pub(super) fn particles_on_device(&self, rows: impl FnOnce(&Gpu) -> Vec<gpu::Rows>) -> Option<OfParticles> {
        let transfer: Arc<Transfer> = self.connectivity().on_device()?.clone();
        if self.data.stresses.len() + self.data.cells.len() > gpu::SETS {
            return None;
        }
        let (gpu, mass, factor) = (transfer.gpu().clone(), &self.mass, self.data.mass);
        let inertia = (factor != 0.0).then(|| {
            let masses = self.connectivity().masses_on_device(&gpu, |p| mass.particles.mass[p], mass.lumped);
            Inertia { masses, factor, lumping: mass.lumping }
        });
        Some(OfParticles { inertia, rows: rows(&gpu), transfer })
    }

    /// The tangent on the device, if the shape functions lie on one.
    pub(super) fn device_tangent(&self) -> Option<DeviceTangent> {
        let of_particles = self.particles_on_device(|gpu| self.data.rows_on_device(gpu, self.connectivity()))?;
        let gpu = of_particles.transfer.gpu().clone();
        let prescribed: Vec<u8> = self.space.prescribed_mask().into_iter().map(u8::from).collect();
        let followers = self.space.followers().on_device(&gpu);
        let extended = if followers.is_some() { prescribed.len() } else { 0 };
        Some(DeviceTangent(Product {
            of_particles,
            points: [
                self.data.pressures.on_device(&gpu, self.connectivity()),
                self.data.contacts.on_device(&gpu, self.connectivity().nodes()),
            ],
            prescribed: gpu.copy_of(&prescribed),
            followers,
            extended: Mutex::new(GpuVector(gpu.memory_for(extended))),
        }))
    }
}

impl<const D: usize, L: Law> Laws<'_, D, L> {
    /// The laws as formulas; `None` if the stress of a body is not a formula.
    pub(crate) fn formulas(&self) -> Option<Vec<Formula>> {
        if self.discrete_gradient {
            return None;
        }
        self.bodies.iter().map(|body| Formula::of(&body.law)).collect()
    }

    /// The particles with their laws on the device, if the shape functions lie on one and all laws are formulas.
    pub(super) fn on_device(&self, connectivity: &Connectivity<D>) -> Option<Solids> {
        let (transfer, formulas) = (connectivity.on_device()?, self.formulas()?);
        let (particles, reference) = (self.particles, self.particles.reference());
        let state = |p: usize, k: usize| {
            let h_r = reference.displacement_gradient(p);
            if k < D * D { h_r[(k / D, k % D)] } else { particles.volume[p] }
        };
        let states = connectivity.states_on_device(transfer.gpu(), state, |p| particles.body[p]);
        Some(Solids::new(transfer.clone(), states, &formulas))
    }
}
