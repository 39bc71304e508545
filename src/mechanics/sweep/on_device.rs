//! The shape functions and the particles as plain arrays, for a device.

use super::group::{At, Group};
use super::tiled::Tiled;
use super::{Connectivity, Each};
use crate::gpu::{Buffer, Copies, Gpu, Masses, States, Transfer, TransferArrays};
use crate::lanes::LANES;
use crate::parallel;
use crate::pooled::Pooled;
use crate::tensor::Vector;
use bytemuck::Pod;
use std::sync::Arc;

impl<const D: usize> Connectivity<D> {
    /// This connectivity with a device, on which Newton's method and the transfers run.
    pub(crate) fn with_gpu(mut self, gpu: Option<Arc<Gpu>>) -> Self {
        let is_same = self.gpu.as_ref().zip(gpu.as_ref()).is_some_and(|(before, gpu)| Arc::ptr_eq(before, gpu));
        if !is_same {
            self.copies = Copies::default();
        }
        self.gpu = gpu;
        self
    }

    /// The shape functions on the device; `None` without a device, for the plain loop, and if several processes share the passes.
    pub(crate) fn on_device(&self) -> Option<&Arc<Transfer>> {
        let (gpu, tiled) = (self.gpu.as_ref()?, self.tiled().filter(|tiled| tiled.shares.is_none())?);
        let copied = || {
            let weights = tiled.blocks.iter().map(|block| block.weights.as_slice());
            Arc::new(Transfer::new(gpu.clone(), &tiled.arrays(self.nodes.len()), weights))
        };
        Some(self.copies.transfer.get_or_init(copied))
    }

    /// Writes the values of nodal fields at all particles, in the order of the passes; behind those of the first field its gradient by columns, if
    /// `gradient`. Returns whether a device has done so.
    pub(super) fn gather_on_device<const C: usize>(
        &self,
        fields: &[&[Vector<f64, C>]],
        gradient: bool,
        results: &mut [f64],
    ) -> bool {
        let Some(transfer) = self.on_device().filter(|_| C == D) else { return false };
        let fields: Vec<&[f64]> = fields.iter().map(|field| bytemuck::cast_slice(field)).collect();
        transfer.gather(&fields, gradient, results)
    }

    /// `out += Σ_p value(p) N_I`. Returns whether a device has done so.
    pub(super) fn spread_on_device<const C: usize>(
        &self,
        out: &mut [Vector<f64, C>],
        value: &(dyn Fn(usize) -> Vector<f64, C> + Sync),
    ) -> bool {
        let Some((transfer, tiled)) = self.on_device().zip(self.tiled()) else { return false };
        let mut forces: Pooled<Vector<f64, C>> = self.pool().unspecified(self.particles());
        let evaluate = |group: Group<'_>, _: &[At<f64, D, D>], forces: &mut [Vector<f64, C>]| {
            group.particles.iter().zip(forces).for_each(|(&p, force)| *force = value(p as usize));
        };
        tiled.results(Each::Particle(1), &[], None, &evaluate, &mut forces);
        let mut sums: Pooled<Vector<f64, D>> =
            self.pool().made(out.len(), |node| Vector::from_fn(|c, _| out[node].get(c).copied().unwrap_or(0.0)));
        let is_done = transfer.spread(C, bytemuck::cast_slice(&forces), bytemuck::cast_slice_mut(&mut sums));
        if is_done {
            parallel::zip(out, &sums, |out, sum| (0..C).for_each(|c| out[c] = sum[c]));
        }
        is_done
    }

    /// The masses of particles and nodes on the device.
    pub(crate) fn masses_on_device(
        &self,
        gpu: &Gpu,
        mass: impl Fn(usize) -> f64 + Sync,
        lumped: &[f64],
    ) -> Arc<Masses> {
        let copied = || Masses { consistent: self.copied_by_lane(gpu, 1, |p, _| mass(p)), lumped: gpu.copy_of(lumped) };
        self.copies.masses.get_or_init(|| Arc::new(copied())).clone()
    }

    /// The particles at the last grid reset on the device. `state(p, k)` has H_r by rows, then V₀.
    pub(crate) fn states_on_device(
        &self,
        gpu: &Gpu,
        state: impl Fn(usize, usize) -> f64 + Sync,
        body: impl Fn(usize) -> u32 + Sync,
    ) -> Arc<States> {
        let copied = || States::new(gpu, &self.by_lane(D * D + 1, state), &self.by_lane(1, |p, _| body(p)));
        self.copies.states.get_or_init(|| Arc::new(copied())).clone()
    }

    /// `of(p, row)` of all particles, `count` rows of lanes for each group, on the device.
    pub(crate) fn copied_by_lane(
        &self,
        gpu: &Gpu,
        count: usize,
        of: impl Fn(usize, usize) -> f64 + Sync,
    ) -> Buffer<f64> {
        gpu.copy_of(self.by_lane(count, of).as_flattened())
    }

    /// `of(p, row)` of all particles, `count` rows of lanes for each group; zero in empty lanes.
    fn by_lane<T: Pod + Send>(&self, count: usize, of: impl Fn(usize, usize) -> T + Sync) -> Vec<[T; LANES]> {
        let mut rows = vec![[T::zeroed(); LANES]; self.groups() * count];
        let evaluate = |group: Group<'_>, _: &[At<f64, D, D>], rows: &mut [[T; LANES]]| {
            for (k, row) in rows.iter_mut().enumerate() {
                row.iter_mut().zip(group.particles).for_each(|(lane, &p)| *lane = of(p as usize, k));
            }
        };
        if let Some(tiled) = self.tiled() {
            tiled.results(Each::Group(count), &[], None, &evaluate, &mut rows);
        }
        rows
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
            let mut particle = block.start;
            for window in &block.windows {
                arrays.particle_first.push(particle);
                particle += u32::from(window.lanes);
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
}
