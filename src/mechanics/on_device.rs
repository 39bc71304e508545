//! The linearised step on a device: its arrays are copied there, and its product runs there.

use super::tangent::Tangent;
use crate::gpu::{self, Gpu, GpuVector, Inertia, Product, Transfer};
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
        self.0.transfer.gpu()
    }
}

impl<const D: usize> Tangent<'_, D> {
    /// K u on the free degrees of freedom, as the solver computes it: on the device, if the tangent has one. NaN where the device fails.
    pub(super) fn solver_product(&self, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        let Some(device) = self.device_tangent() else { return self.product(u, out) };
        let gpu = device.gpu();
        let (x, mut y) = (gpu.vector(bytemuck::cast_slice(u)), gpu.zeros(D * u.len()));
        device.apply(&x, &mut y);
        out.copy_from_slice(bytemuck::cast_slice(&gpu.numbers(&y)));
    }

    /// The tangent on the device of its shape functions, if they have one.
    pub(super) fn device_tangent(&self) -> Option<DeviceTangent> {
        let transfer: Arc<Transfer> = self.connectivity().on_device()?.clone();
        if self.data.stresses.len() + self.data.cells.len() > gpu::SETS {
            return None;
        }
        let (gpu, mass, factor) = (transfer.gpu().clone(), &self.mass, self.data.mass);
        let inertia = (factor != 0.0).then(|| {
            let masses = self.connectivity().masses_on_device(&gpu, |p| mass.particles.mass[p], mass.lumped);
            Inertia { masses, factor, lumping: mass.lumping }
        });
        let prescribed: Vec<u8> = self.space.prescribed_mask().into_iter().map(u8::from).collect();
        let followers = self.space.followers().on_device(&gpu);
        let extended = if followers.is_some() { prescribed.len() } else { 0 };
        Some(DeviceTangent(Product {
            inertia,
            rows: self.data.rows_on_device(&gpu, self.connectivity()),
            points: [
                self.data.pressures.on_device(&gpu, self.connectivity()),
                self.data.contacts.on_device(&gpu, self.connectivity().nodes()),
            ],
            prescribed: gpu.copy_of(&prescribed),
            followers,
            extended: Mutex::new(GpuVector(gpu.memory_for(extended))),
            transfer,
        }))
    }
}
