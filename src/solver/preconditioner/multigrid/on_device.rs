//! Blocks, filter and levels of multigrid on a device.

use super::Multigrid;
use super::cycle::Coarse;
use crate::gpu::{self, Buffer, Gpu, GpuVector};
use crate::solver::LinearOperator;
use std::sync::Arc;

/// Blocks, filter and levels on a device.
#[derive(Debug)]
pub(super) struct DeviceLevels {
    dimension: usize,
    blocks: Buffer<f64>,
    filter: Option<gpu::Filter>,
    levels: Vec<DeviceLevel>,
}

/// A coarse level on a device.
#[derive(Debug)]
struct DeviceLevel {
    gpu: Arc<Gpu>,
    level: gpu::Level,
    /// λ, the largest eigenvalue of D⁻¹K.
    largest: f64,
}

impl DeviceLevels {
    pub(super) fn of<const D: usize>(gpu: &Arc<Gpu>, multigrid: &Multigrid<D>) -> Self {
        let level = |level: &super::Level<D>| {
            let largest = level.largest;
            DeviceLevel { gpu: gpu.clone(), level: level.on_device(gpu), largest }
        };
        Self {
            dimension: D,
            blocks: gpu.copy_of(bytemuck::cast_slice(multigrid.blocks.inverses())),
            filter: multigrid.filter.as_ref().map(|filter| filter.on_device(gpu, D)),
            levels: multigrid.levels.iter().map(level).collect(),
        }
    }

    pub(super) fn coarse(&self) -> Vec<&dyn Coarse<Gpu>> {
        self.levels.iter().map(|level| level as &dyn Coarse<Gpu>).collect()
    }

    /// z = M r, with the M of the finest smoother.
    pub(super) fn smooth(&self, gpu: &Gpu, r: &GpuVector, z: &mut GpuVector) {
        gpu.multiply_blocks(&self.blocks, self.dimension, r, z);
        if let Some(filter) = &self.filter {
            filter.add(gpu, r, z);
        }
    }
}

impl LinearOperator<GpuVector> for DeviceLevel {
    fn apply(&self, x: &GpuVector, y: &mut GpuVector) {
        self.level.apply(&self.gpu, x, y);
    }
}

impl Coarse<Gpu> for DeviceLevel {
    fn precondition(&self, r: &GpuVector, z: &mut GpuVector) {
        self.level.precondition(&self.gpu, r, z);
    }

    fn restrict(&self, r: &GpuVector) -> Box<GpuVector> {
        self.level.restrict(&self.gpu, r)
    }

    fn prolong(&self, y: Box<GpuVector>, x: &mut GpuVector) {
        self.level.prolong(&self.gpu, y, x);
    }

    fn largest(&self) -> f64 {
        self.largest
    }
}
