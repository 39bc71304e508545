//! The levels and the filter of multigrid on a device (`kernels/multigrid.h`).

use super::device::{Buffer, Gpu, arguments};
use super::followers::{Followers, clear_fixed};
use super::vectors::GpuVector;
use crate::lists::Lists;
use crate::space::vector::Vectors;

/// Places of a stencil.
const PLACES: usize = 27;

/// A coarse level as plain arrays, with an entry for every node where nothing else is said.
pub(crate) struct LevelArrays<'a> {
    pub dimension: usize,
    /// The neighbours of each node, by their place in the stencil.
    pub neighbours: &'a [[u32; PLACES]],
    /// The blocks of K for the neighbours, column by column.
    pub entries: &'a [f64],
    /// D⁻¹, column by column.
    pub inverse: &'a [f64],
    /// Whether a value is zero.
    pub held: &'a [bool],
    /// Whether a value of the finer level is no unknown.
    pub fixed_finer: &'a [bool],
    /// The coarse nodes around each finer node, and the finer nodes that are interpolated from each coarse node.
    pub interpolation: [&'a Lists<u32>; 2],
    /// E, by which outer nodes follow others.
    pub followers: Option<Followers>,
}

/// A coarse level on a device.
#[derive(Debug)]
pub(crate) struct Level {
    dimension: usize,
    neighbours: Buffer<u32>,
    entries: Buffer<f64>,
    inverse: Buffer<f64>,
    held: Buffer<u8>,
    fixed_finer: Buffer<u8>,
    lists: [[Buffer<u32>; 2]; 2],
    followers: Option<Followers>,
}

/// `[node][number]` as `[number][node]`, so that neighbouring threads read neighbouring numbers.
fn by_number<T: Copy + Default>(of_nodes: &[T], numbers: usize) -> Vec<T> {
    let nodes = of_nodes.len() / numbers;
    let mut transposed = vec![T::default(); of_nodes.len()];
    for (node, own) in of_nodes.chunks(numbers).enumerate() {
        own.iter().enumerate().for_each(|(k, &number)| transposed[k * nodes + node] = number);
    }
    transposed
}

fn bytes(of: &[bool]) -> Vec<u8> {
    of.iter().map(|&one| u8::from(one)).collect()
}

impl Level {
    pub(crate) fn new(gpu: &Gpu, arrays: LevelArrays<'_>) -> Self {
        let LevelArrays { dimension, neighbours, entries, inverse, held, fixed_finer, interpolation, followers } =
            arrays;
        Self {
            dimension,
            neighbours: gpu.copy_of(&by_number(neighbours.as_flattened(), PLACES)),
            entries: gpu.copy_of(&by_number(entries, PLACES * dimension * dimension)),
            inverse: gpu.copy_of(inverse),
            held: gpu.copy_of(&bytes(held)),
            fixed_finer: gpu.copy_of(&bytes(fixed_finer)),
            lists: interpolation.map(|lists| lists.arrays().map(|list| gpu.copy_of(list))),
            followers,
        }
    }

    /// The mask of held values for a kernel that no restriction follows.
    fn held_at_once(&self) -> u64 {
        if self.followers.is_some() { 0 } else { self.held.address() }
    }

    /// Moves forces from outer nodes to those that they follow, and clears those of held values.
    fn restrict_followers(&self, gpu: &Gpu, forces: &mut GpuVector) {
        if let Some(followers) = &self.followers {
            followers.restrict(gpu, forces);
            clear_fixed(gpu, &self.held, forces);
        }
    }

    /// y = Eᵀ K E x
    pub(crate) fn apply(&self, gpu: &Gpu, x: &GpuVector, y: &mut GpuVector) {
        let mut extended = None;
        if let Some(followers) = &self.followers {
            let mut copy = gpu.copied(x);
            followers.extend(gpu, &mut copy);
            extended = Some(copy);
        }
        let x = extended.as_deref().unwrap_or(x);
        let nodes = self.held.len() / self.dimension;
        // `Stencil` of `kernels/multigrid.h`.
        let arguments = arguments! {
            neighbours: self.neighbours.address(),
            entries: self.entries.address(),
            held: self.held_at_once(),
            x: x.address(),
            y: y.address(),
            nodes: nodes as i64,
            dimension: self.dimension as i32,
        };
        gpu.launch_for("stencil", nodes, &arguments);
        self.restrict_followers(gpu, y);
    }

    /// z = D⁻¹ r
    pub(crate) fn precondition(&self, gpu: &Gpu, r: &GpuVector, z: &mut GpuVector) {
        gpu.multiply_blocks(&self.inverse, self.dimension, r, z);
    }

    fn interpolate(&self, gpu: &Gpu, kernel: &'static str, held: u64, x: &GpuVector, y: &mut GpuVector) {
        let n = y.0.len();
        // `Interpolation` of `kernels/multigrid.h`.
        let arguments = arguments! {
            lists: self.lists.each_ref().map(|lists| lists.each_ref().map(Buffer::address)),
            fixed: self.fixed_finer.address(),
            held,
            x: x.address(),
            y: y.address(),
            n: n as i64,
            dimension: self.dimension as i32,
        };
        gpu.launch_for(kernel, n, &arguments);
    }

    /// Eᵀ Pᵀ r
    pub(crate) fn restrict(&self, gpu: &Gpu, r: &GpuVector) -> Box<GpuVector> {
        let mut out = gpu.unspecified(self.held.len());
        self.interpolate(gpu, "restrict_to_coarse", self.held_at_once(), r, &mut out);
        self.restrict_followers(gpu, &mut out);
        out
    }

    /// x += P E y
    pub(crate) fn prolong(&self, gpu: &Gpu, mut y: Box<GpuVector>, x: &mut GpuVector) {
        if let Some(followers) = &self.followers {
            followers.extend(gpu, &mut y);
        }
        self.interpolate(gpu, "prolong_to_fine", 0, &y, x);
    }
}

/// The filter of cubic B-splines on a device.
#[derive(Debug)]
pub(crate) struct Filter {
    dimension: usize,
    /// For each axis, the neighbours of each node before and behind it.
    neighbours: Vec<[Buffer<u32>; 2]>,
    scale: Buffer<f64>,
    unit: f64,
    /// θ, and the coefficients of each step of the iteration for B⁻¹.
    coefficients: (f64, Vec<[f64; 2]>),
    /// x, r and p of the iteration.
    memory: [Buffer<f64>; 3],
}

/// `Filter` of `kernels/multigrid.h`.
#[derive(Clone, Copy)]
#[repr(C)]
struct FilterArguments {
    before: u64,
    behind: u64,
    scale: u64,
    given: u64,
    x: u64,
    r: u64,
    p: u64,
    out: u64,
    a: f64,
    b: f64,
    n: i64,
    dimension: i32,
}

impl Filter {
    /// The filter of nodes with the neighbours before and behind them along each axis.
    pub(crate) fn new(
        gpu: &Gpu,
        neighbours: &[[Vec<u32>; 2]],
        scale: &[f64],
        unit: f64,
        coefficients: (f64, Vec<[f64; 2]>),
    ) -> Self {
        Self {
            dimension: neighbours.len(),
            neighbours: neighbours.iter().map(|both| both.each_ref().map(|list| gpu.copy_of(list))).collect(),
            scale: gpu.copy_of(scale),
            unit,
            coefficients,
            memory: [(); 3].map(|()| gpu.memory_for(scale.len())),
        }
    }

    /// z += D^{−½} Q Qᵀ D^{−½} r
    pub(crate) fn add(&self, gpu: &Gpu, r: &GpuVector, z: &mut GpuVector) {
        let _lock = gpu.lock();
        let [x, residual, p] = self.memory.each_ref().map(Buffer::address);
        let n = self.scale.len();
        let whole = FilterArguments {
            before: 0,
            behind: 0,
            scale: self.scale.address(),
            given: r.address(),
            x,
            r: residual,
            p,
            out: z.address(),
            a: self.unit,
            b: 0.0,
            n: n as i64,
            dimension: self.dimension as i32,
        };
        gpu.launch_for("filter_begin", n, &whole);
        // The last axis first for Qᵀ, and back for Q.
        let axes = self.neighbours.iter();
        for [before, behind] in axes.clone().rev().chain(axes) {
            let along = FilterArguments { before: before.address(), behind: behind.address(), ..whole };
            gpu.launch_for("filter_start", n, &FilterArguments { a: self.coefficients.0, ..along });
            for &[a, b] in &self.coefficients.1 {
                gpu.launch_for("filter_residual", n, &along);
                gpu.launch_for("filter_update", n, &FilterArguments { a, b, ..along });
            }
        }
        gpu.launch_for("filter_end", n, &whole);
    }
}
