//! Nodes that follow others, and values that are fixed, on a device (`kernels/data.h`).

use super::device::{Buffer, Gpu, arguments};
use super::vectors::GpuVector;

/// E, by which outer nodes follow inner ones, on a device.
#[derive(Debug)]
pub(crate) struct Followers {
    outer: [Buffer<u32>; 3],
    follows: Buffer<u8>,
    leader_weights: Buffer<f64>,
    inner: [Buffer<u32>; 3],
    follower_weights: Buffer<f64>,
    moved: Buffer<f64>,
    dimension: usize,
}

/// Sparse rows: the number of each row, and its entries with weights.
pub(crate) type SparseRows<'a> = &'a mut dyn Iterator<Item = (u32, Vec<(u32, f64)>)>;

/// Numbers of rows, starts of rows, entries, weights.
fn flat(rows: SparseRows<'_>) -> ([Vec<u32>; 3], Vec<f64>) {
    let (mut numbers, mut starts, mut entries, mut weights) = (Vec::new(), vec![0], Vec::new(), Vec::new());
    for (number, row) in rows {
        numbers.push(number);
        entries.extend(row.iter().map(|&(entry, _)| entry));
        weights.extend(row.iter().map(|&(_, weight)| weight));
        starts.push(entries.len() as u32);
    }
    ([numbers, starts, entries], weights)
}

impl Followers {
    /// The outer nodes with their inner ones, the inner nodes with the places of their outer ones, and whether each component of an outer node
    /// follows.
    pub(crate) fn new(gpu: &Gpu, outer: SparseRows<'_>, inner: SparseRows<'_>, follows: &[bool]) -> Self {
        let ((outer, leader_weights), (inner, follower_weights)) = (flat(outer), flat(inner));
        let follows: Vec<u8> = follows.iter().map(|&one| u8::from(one)).collect();
        Self {
            dimension: follows.len() / outer[0].len().max(1),
            outer: outer.map(|list| gpu.copy_of(&list)),
            leader_weights: gpu.copy_of(&leader_weights),
            inner: inner.map(|list| gpu.copy_of(&list)),
            follower_weights: gpu.copy_of(&follower_weights),
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
