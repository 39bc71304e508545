//! Nodes that follow others, and values that are fixed, on a device (`kernels/data.h`).

use super::device::{Buffer, Gpu, arguments};
use super::vectors::GpuVector;
use crate::aggregation::SparseRows;

/// E, by which outer nodes follow inner ones, on a device.
#[derive(Debug)]
pub(crate) struct Followers {
    /// The nodes of the rows, the starts of the rows, and their entries.
    outer: [Buffer<u32>; 3],
    follows: Buffer<u8>,
    leader_weights: Buffer<f64>,
    inner: [Buffer<u32>; 3],
    follower_weights: Buffer<f64>,
    moved: Buffer<f64>,
    dimension: usize,
}

impl Followers {
    /// The outer nodes with their inner ones, the inner nodes with the places of their outer ones, and whether each component of an outer node
    /// follows.
    pub(crate) fn new(gpu: &Gpu, [outer, inner]: [&SparseRows; 2], follows: &[bool]) -> Self {
        let numbers = |of: &SparseRows| {
            let [starts, entries] = of.entries.arrays();
            [&of.nodes, starts, entries].map(|list| gpu.copy_of(list))
        };
        let follows: Vec<u8> = follows.iter().map(|&one| u8::from(one)).collect();
        Self {
            dimension: follows.len() / outer.nodes.len().max(1),
            outer: numbers(outer),
            leader_weights: gpu.copy_of(&outer.weights),
            inner: numbers(inner),
            follower_weights: gpu.copy_of(&inner.weights),
            moved: gpu.memory_for(follows.len()),
            follows: gpu.copy_of(&follows),
        }
    }

    fn launch(&self, gpu: &Gpu, kernel: &'static str, count: usize, field: &GpuVector) {
        let ([outer, leader_first, leaders], [inner, follower_first, followers]) =
            (self.outer.each_ref().map(Buffer::address), self.inner.each_ref().map(Buffer::address));
        // `Followers` of `kernels/data.h`.
        let arguments = arguments! {
            outer,
            follows: self.follows.address(),
            leader_first,
            leaders,
            leader_weights: self.leader_weights.address(),
            outer_count: self.outer[0].len() as i64,
            inner,
            follower_first,
            followers,
            follower_weights: self.follower_weights.address(),
            inner_count: self.inner[0].len() as i64,
            field: field.address(),
            moved: self.moved.address(),
            dimension: self.dimension as i32,
        };
        gpu.launch_for(kernel, count * self.dimension, &arguments);
    }

    /// u = E û, in place.
    pub(crate) fn extend(&self, gpu: &Gpu, field: &mut GpuVector) {
        self.launch(gpu, "extend", self.outer[0].len(), field);
    }

    /// R̂ = Eᵀ R, in place.
    pub(crate) fn restrict(&self, gpu: &Gpu, forces: &mut GpuVector) {
        self.launch(gpu, "take_followers", self.outer[0].len(), forces);
        self.launch(gpu, "give_leaders", self.inner[0].len(), forces);
    }
}

/// Sets the fixed values of a field to zero.
pub(crate) fn clear_fixed(gpu: &Gpu, fixed: &Buffer<u8>, field: &mut GpuVector) {
    let n = fixed.len();
    // `Fixed` of `kernels/data.h`.
    gpu.launch_for("clear_fixed", n, &arguments! { fixed: fixed.address(), field: field.address(), n: n as i64 });
}
