//! The sweep of vector lanes over all blocks, on all cores.
//!
//! Blocks are taken in waves of fixed length: each block of a wave scatters into a buffer of its own, and then the buffers
//! are added to the nodes in the order of the blocks, every slab of nodes by one thread. Neither the waves nor the order
//! depend on the number of threads.

use super::block::{Block, Groups};
use super::kernel::Rows;
use super::lanes::{LANES, SINGLE_LANES};
use super::of_block;
use super::tiled::Tiled;
use crate::parallel;
use crate::scalar::Real;
use crate::tensor::Vector;

/// Blocks of a wave: their buffers stay in the second-level caches.
const WAVE: usize = 64;

/// Nodes of a slab.
const SLAB: usize = 1024;

/// Below this number of groups waking the threads costs more than the work.
const PARALLEL: usize = 256;

/// `(block, nodal, buffer)`: adds the sums of a block to its buffer, from the field in its box.
type Sums<'a, X> = dyn Fn(&Block, &[X], &mut [X]) + Sync + 'a;

/// `(block, scratch, buffer)`: fills the buffer of a block.
type Work<'a, X> = dyn Fn(&Block, &mut Vec<X>, &mut [X]) + Sync + 'a;

/// `(block, buffer, first, slab)`: adds what lies on the active nodes `first ..` of the slab.
type Add<'a, X, O> = dyn Fn(&Block, &[X], usize, &mut [O]) + Sync + 'a;

/// `out_I += Σ_p σ_p ∇_n N_I + q_p N_I` with boxes of the number `X`, which is `T`; without a field the box is empty.
pub(super) fn run<X: Real + Send + Sync, T: Real, const D: usize>(
    tiled: &Tiled<D>,
    field: Option<&[Vector<T, D>]>,
    out: &mut [Vector<T, D>],
    sums: &Sums<'_, X>,
) {
    let work = |block: &Block, nodal: &mut Vec<X>, buffer: &mut [X]| {
        if let Some(field) = field {
            nodal.resize(block.box_nodes() * D, X::zero());
            block.fill(field, nodal);
        }
        sums(block, nodal, buffer);
    };
    let add = |block: &Block, buffer: &[X], first: usize, out: &mut [Vector<T, D>]| {
        block.add(buffer, D, first, out, |sum, numbers| {
            for (sum, &x) in sum.iter_mut().zip(numbers) {
                *sum += T::lit(x.value());
            }
        });
    };
    each_block(tiled, D, out, &work, &add);
}

/// The waves, with `numbers` numbers a node in the buffers.
pub(super) fn each_block<X: Real + Send + Sync, O: Send, const D: usize>(
    tiled: &Tiled<D>,
    numbers: usize,
    out: &mut [O],
    work: &Work<'_, X>,
    add: &Add<'_, X, O>,
) {
    let length = tiled.blocks.iter().map(Block::box_nodes).max().unwrap_or(0) * numbers + SINGLE_LANES;
    let parallel = parallel::several() && tiled.groups() >= PARALLEL;
    let one = |scratch: &mut Vec<X>, buffer: &mut [X], block: &Block| {
        buffer[..block.box_nodes() * numbers + SINGLE_LANES].fill(X::zero());
        work(block, scratch, buffer);
    };
    if !parallel {
        let (mut scratch, mut buffer) = (Vec::new(), vec![X::zero(); length]);
        for block in &tiled.blocks {
            one(&mut scratch, &mut buffer, block);
            add(block, &buffer, 0, out);
        }
        return;
    }
    let mut buffers = vec![X::zero(); WAVE.min(tiled.blocks.len()) * length];
    for blocks in tiled.blocks.chunks(WAVE) {
        let parts = buffers.chunks_mut(length).zip(blocks);
        parallel::for_each_with(parts, |scratch, (buffer, block)| one(scratch, buffer, block));
        let first = blocks.iter().filter_map(|block| block.nodes.first()).min().map_or(0, |&n| n as usize);
        let last = blocks.iter().filter_map(|block| block.nodes.last()).max().map_or(0, |&n| n as usize + 1);
        parallel::for_each(out[first..last].chunks_mut(SLAB).enumerate(), |(slab, out)| {
            for (block, buffer) in blocks.iter().zip(buffers.chunks(length)) {
                add(block, buffer, first + slab * SLAB, out);
            }
        });
    }
}

/// What is gathered of each group.
pub(super) type GatherKernel = fn(&Groups<f64, LANES>, &[f64], &mut [Rows]);

/// `take(p, point(p, rows, lane))` of every particle with what `kernel` gathered in the rows of its group, in
/// the order of the blocks; no more results wait to be taken than those of a wave.
pub(super) fn each_particle<T: Real, R: Send, const D: usize>(
    tiled: &Tiled<D>,
    field: &[Vector<T, D>],
    kernel: GatherKernel,
    point: impl Fn(usize, &Rows, usize) -> R + Sync,
    mut take: impl FnMut(usize, R),
) {
    let gather = |scratch: &mut (Vec<f64>, Vec<Rows>), block: &Block, take: &mut dyn FnMut(usize, R)| {
        let (nodal, rows) = scratch;
        gather_block(block, field, kernel, nodal, rows);
        block.groups.each(|group, lane, p| take(p, point(p, &rows[group], lane)));
    };
    if !parallel::several() || tiled.groups() < PARALLEL {
        let mut scratch = Default::default();
        for block in &tiled.blocks {
            gather(&mut scratch, block, &mut take);
        }
        return;
    }
    let mut parts: Vec<Vec<(usize, R)>> = tiled.blocks.iter().take(WAVE).map(|_| Vec::new()).collect();
    for blocks in tiled.blocks.chunks(WAVE) {
        parallel::for_each_with(blocks.iter().zip(&mut parts), |scratch, (block, part)| {
            gather(scratch, block, &mut |p, result| part.push((p, result)));
        });
        for (p, result) in parts.iter_mut().flat_map(|part| part.drain(..)) {
            take(p, result);
        }
    }
}

/// What `kernel` gathers of each group of a block.
fn gather_block<T: Real, const D: usize>(
    block: &Block,
    field: &[Vector<T, D>],
    kernel: GatherKernel,
    nodal: &mut Vec<f64>,
    rows: &mut Vec<Rows>,
) {
    nodal.resize(block.box_nodes() * D, 0.0);
    block.fill(field, nodal);
    // What is left of another block is written over.
    rows.resize(block.groups.len(), [[0.0; LANES]; 12]);
    kernel(&block.groups, nodal, rows);
}

/// `visit(block, chunk, u and L of each group)` of every block; `chunks` hands out a part of the result to each.
pub(super) fn gathered<T: Real, C: Send, R: Send, const D: usize>(
    tiled: &Tiled<D>,
    field: &[Vector<T, D>],
    chunks: Vec<C>,
    visit: impl Fn(&Block, C, &[Rows]) -> R + Sync,
) -> Vec<R> {
    let one = |scratch: &mut (Vec<f64>, Vec<Rows>), (block, chunk): (&Block, C)| {
        let (nodal, rows) = scratch;
        gather_block(block, field, of_block::gather_all, nodal, rows);
        visit(block, chunk, rows)
    };
    if parallel::several() && tiled.groups() >= PARALLEL {
        parallel::map_with(tiled.blocks.iter().zip(chunks), one)
    } else {
        let mut scratch = Default::default();
        tiled.blocks.iter().zip(chunks).map(|both| one(&mut scratch, both)).collect()
    }
}
