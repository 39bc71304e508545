//! The sweep of vector lanes over all blocks, on all cores.
//!
//! Blocks are taken in waves of fixed length: each block of a wave scatters into a buffer of its own, and then the buffers
//! are added to the nodes in the order of the blocks, every slab of nodes by one thread. Neither the waves nor the order
//! depend on the number of threads.

use super::compiled::{self, Groups, Sum};
use super::kernel::Stored;
use super::lanes::LANES;
use super::tiled::{Block, Tiled, keep_first};
use crate::scalar::Real;
use crate::tensor::Vector;
use rayon::prelude::*;

/// Blocks of a wave: their buffers stay in the second-level caches.
const WAVE: usize = 64;

/// Nodes of a slab.
const SLAB: usize = 1024;

/// Below this number of groups waking the threads costs more than the work.
const PARALLEL: usize = 256;

/// What the work on a block needs besides: the box of nodal numbers, and u and L of its groups.
#[derive(Default)]
pub(super) struct Scratch<const D: usize> {
    pub nodal: Vec<f64>,
    pub groups: Groups<D>,
}

impl<const D: usize> Scratch<D> {
    /// The box of a field on the active nodes.
    pub(super) fn fill<T: Real>(&mut self, block: &Block<D>, field: &[Vector<T, D>]) {
        self.nodal.resize(block.box_nodes() * D, 0.0);
        block.fill(field, &mut self.nodal);
    }
}

/// `out_I += Σ_p σ_p ∇_n N_I + q_p N_I` (or what `sum` says); `points(block, groups)` puts σ in the place of L and q in that of
/// u, and names the first particle that failed; `T` is `f64`. Without a field u and L are zero.
///
/// # Errors
/// That of the particle with the smallest number.
pub(super) fn run<T: Real, E: Send, const D: usize>(
    tiled: &Tiled<D>,
    field: Option<&[Vector<T, D>]>,
    out: &mut [Vector<T, D>],
    sum: Sum,
    points: impl Fn(&Block<D>, &mut [Stored<D>]) -> Option<(usize, E)> + Sync,
) -> Result<(), E> {
    let mut failure = None;
    let work = |block: &Block<D>, scratch: &mut Scratch<D>, buffer: &mut [f64]| {
        match field {
            Some(field) => {
                scratch.fill(block, field);
                compiled::gathered(block, &scratch.nodal, &mut scratch.groups);
            }
            None => {
                scratch.groups.0.clear();
                scratch.groups.0.resize_with(block.groups(), Stored::zero);
            }
        }
        let failed = points(block, &mut scratch.groups.0);
        compiled::scattered(block, &scratch.groups, sum, buffer);
        failed
    };
    each_block(tiled, D, out, work, add, |(p, error)| keep_first(&mut failure, p, error));
    failure.map_or(Ok(()), |(_, error)| Err(error))
}

/// Adds a box of vectors to the active nodes `first ..`.
pub(super) fn add<T: Real, const D: usize>(block: &Block<D>, buffer: &[f64], first: usize, out: &mut [Vector<T, D>]) {
    block.add(buffer, D, first, out, |sum, numbers| {
        for (sum, &x) in sum.iter_mut().zip(numbers) {
            *sum += T::lit(x);
        }
    });
}

/// The waves: `work(block, scratch, buffer)` fills the buffer of each block, a box of `numbers` numbers a node; then
/// `add(block, buffer, first, slab)` adds what lies on the active nodes `first ..` of the slab.
pub(super) fn each_block<O: Send, F: Send, const D: usize>(
    tiled: &Tiled<D>,
    numbers: usize,
    out: &mut [O],
    work: impl Fn(&Block<D>, &mut Scratch<D>, &mut [f64]) -> Option<F> + Sync,
    add: impl Fn(&Block<D>, &[f64], usize, &mut [O]) + Sync,
    mut failed: impl FnMut(F),
) {
    let length = tiled.blocks.iter().map(Block::box_nodes).max().unwrap_or(0) * numbers + LANES;
    let parallel = rayon::current_num_threads() > 1 && tiled.groups() >= PARALLEL;
    let one = |scratch: &mut Scratch<D>, buffer: &mut [f64], block: &Block<D>| {
        buffer[..block.box_nodes() * numbers + LANES].fill(0.0);
        work(block, scratch, buffer)
    };
    if !parallel {
        let (mut scratch, mut buffer) = (Scratch::default(), vec![0.0; length]);
        for block in &tiled.blocks {
            one(&mut scratch, &mut buffer, block).into_iter().for_each(&mut failed);
            add(block, &buffer, 0, out);
        }
        return;
    }
    let mut buffers = vec![0.0; WAVE.min(tiled.blocks.len()) * length];
    for blocks in tiled.blocks.chunks(WAVE) {
        let failures: Vec<F> = buffers
            .par_chunks_mut(length)
            .zip(blocks)
            .map_init(Scratch::default, |scratch, (buffer, block)| one(scratch, buffer, block))
            .filter_map(|failure| failure)
            .collect();
        failures.into_iter().for_each(&mut failed);
        let first = blocks.iter().filter_map(|block| block.nodes.first()).min().map_or(0, |&n| n as usize);
        let last = blocks.iter().filter_map(|block| block.nodes.last()).max().map_or(0, |&n| n as usize + 1);
        out[first..last].par_chunks_mut(SLAB).enumerate().for_each(|(slab, out)| {
            for (block, buffer) in blocks.iter().zip(buffers.chunks(length)) {
                add(block, buffer, first + slab * SLAB, out);
            }
        });
    }
}

/// `visit(group, particles, u and L)` of every group, block by block; `chunks` hands out a part of the result to each block.
pub(super) fn gathered<T: Real, C: Send, R: Send, const D: usize>(
    tiled: &Tiled<D>,
    field: &[Vector<T, D>],
    chunks: Vec<C>,
    visit: impl Fn(&Block<D>, C, &[Stored<D>]) -> R + Sync,
) -> Vec<R> {
    let one = |scratch: &mut Scratch<D>, (block, chunk): (&Block<D>, C)| {
        scratch.fill(block, field);
        compiled::gathered(block, &scratch.nodal, &mut scratch.groups);
        visit(block, chunk, &scratch.groups.0)
    };
    if rayon::current_num_threads() > 1 && tiled.groups() >= PARALLEL {
        tiled.blocks.par_iter().zip(chunks).map_init(Scratch::default, one).collect()
    } else {
        let mut scratch = Scratch::default();
        tiled.blocks.iter().zip(chunks).map(|both| one(&mut scratch, both)).collect()
    }
}
