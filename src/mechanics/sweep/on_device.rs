//! The shape functions of all particles as plain arrays, for a device.

use super::Connectivity;
use super::tiled::Tiled;
use crate::gpu::{Gpu, Masses, Transfer, TransferArrays};
use crate::lanes::LANES;
use std::sync::Arc;

impl<const D: usize> Connectivity<D> {
    /// This connectivity with a device, on which linear systems are solved.
    pub(crate) fn with_gpu(mut self, gpu: Option<Arc<Gpu>>) -> Self {
        self.gpu = gpu;
        self
    }

    /// The shape functions on the device, copied there at the first call; `None` without a device, or for the plain loop.
    pub(crate) fn on_device(&self) -> Option<&Arc<Transfer>> {
        let (gpu, tiled) = (self.gpu.as_ref()?, self.tiled()?);
        let copied = || {
            let weights = tiled.blocks.iter().map(|block| block.weights.as_slice());
            Arc::new(Transfer::new(gpu.clone(), &tiled.arrays(self.nodes.len()), weights))
        };
        Some(self.on_device.get_or_init(copied))
    }

    /// The masses of particles and nodes on the device, copied there at the first call.
    pub(crate) fn masses_on_device(&self, gpu: &Gpu, mass: impl Fn(usize) -> f64, lumped: &[f64]) -> Arc<Masses> {
        let by_lane = || self.tiled().map_or_else(Vec::new, |tiled| tiled.by_lane(mass));
        let copied = || Masses { consistent: gpu.copy_of(&by_lane()), lumped: gpu.copy_of(lumped) };
        self.masses_on_device.get_or_init(|| Arc::new(copied())).clone()
    }
}

impl<const D: usize> Connectivity<D> {
    /// Bytes of the shape functions on a device, with the boxes of all blocks, and bytes of the memory that the threads of a block share; 0 for
    /// the plain loop.
    pub(crate) fn device_bytes(&self) -> [usize; 2] {
        let Some(tiled) = self.tiled() else { return [0; 2] };
        let weights: usize = tiled.blocks.iter().map(|block| size_of_val(block.weights.as_slice())).sum();
        let arrays = tiled.arrays(self.nodes.len());
        [arrays.bytes() + weights, arrays.shared()]
    }
}

impl<const D: usize> Tiled<D> {
    fn arrays(&self, nodal: usize) -> TransferArrays {
        let mut arrays = TransferArrays { dimension: D, nodal, ..TransferArrays::default() };
        let (mut rows, mut places) = (0, 0);
        for block in &self.blocks {
            arrays.group_first.push(block.first as u32);
            arrays.node_first.push(arrays.nodes.len() as u32);
            arrays.box_first.push(places);
            arrays.size.extend(block.size.map(|nodes| nodes as u32));
            for window in &block.windows {
                arrays.weights_first.push(rows + window.weights);
                arrays.window_first.push(window.first);
                let [x, y, z] = window.width;
                arrays.window_shape.push(u32::from_le_bytes([x, y, z, window.lanes]));
            }
            arrays.nodes.extend(&block.nodes);
            arrays.places.extend(&block.places);
            rows += block.weights.len() as u32;
            places += block.box_nodes() as u32;
        }
        arrays.group_first.push(self.groups() as u32);
        arrays.node_first.push(arrays.nodes.len() as u32);
        arrays.box_first.push(places);
        arrays
    }

    fn by_lane(&self, of: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut numbers = vec![0.0; self.groups() * LANES];
        self.each_group(&mut |group| {
            for (lane, &p) in group.particles.iter().enumerate() {
                numbers[group.number * LANES + lane] = of(p as usize);
            }
        });
        numbers
    }
}
