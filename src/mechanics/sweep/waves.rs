//! The sweep of vector lanes over all blocks, on all cores.
//!
//! Blocks are taken in waves of fixed length: each block of a wave scatters into a buffer of its own, and then the buffers
//! are added to the nodes in the order of the blocks, every slab of nodes by one thread. Neither the waves nor the order
//! depend on the number of threads.

use super::kernel::{Gathered, gather, scatter};
use super::lanes::{LANES, Lanes, WithLanes, widest};
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

/// What is done at the particles of a group between gather and scatter.
pub(super) trait Stage<const D: usize>: Sync {
    /// What can go wrong at a particle.
    type Error: Send;
    /// Whether u is gathered and q scattered.
    const VALUE: bool;

    /// Puts σ in the place of L and q in that of u; on an error names the first particle of the group that failed.
    fn point<S: Lanes>(
        &self,
        s: S,
        group: usize,
        particles: &[u32],
        at: &mut Gathered<S::V, D>,
    ) -> Result<(), (usize, Self::Error)>;
}

/// `out_I += Σ_p σ_p ∇_n N_I + q_p N_I`; `T` is `f64`.
///
/// # Errors
/// That of the particle with the smallest number.
pub(super) fn run<T: Real, P: Stage<D>, const D: usize>(
    tiled: &Tiled<D>,
    field: &[Vector<T, D>],
    out: &mut [Vector<T, D>],
    stage: &P,
) -> Result<(), P::Error> {
    let length = tiled.blocks.iter().map(Block::box_nodes).max().unwrap_or(0) * D + LANES;
    let wave = WAVE.min(tiled.blocks.len());
    let parallel = rayon::current_num_threads() > 1 && tiled.groups() >= PARALLEL;
    let mut buffers = vec![0.0; wave * length];
    let mut failure = None;
    let one = |nodal: &mut Vec<f64>, buffer: &mut [f64], block: &Block<D>| {
        nodal.resize(length, 0.0);
        block.fill(field, nodal);
        buffer.fill(0.0);
        widest(OfBlock { block, stage, nodal, buffer }).err()
    };
    let mut nodal = Vec::new();
    for blocks in tiled.blocks.chunks(WAVE) {
        let mut keep = |failed: Option<(usize, P::Error)>| {
            if let Some((p, error)) = failed {
                keep_first(&mut failure, p, error);
            }
        };
        if parallel {
            let failures: Vec<_> = buffers
                .par_chunks_mut(length)
                .zip(blocks)
                .map_init(Vec::new, |nodal, (buffer, block)| one(nodal, buffer, block))
                .filter_map(|failed| failed)
                .collect();
            failures.into_iter().for_each(|failed| keep(Some(failed)));
            let first = blocks.iter().filter_map(|block| block.nodes.first()).min().map_or(0, |&n| n as usize);
            let last = blocks.iter().filter_map(|block| block.nodes.last()).max().map_or(0, |&n| n as usize + 1);
            out[first..last].par_chunks_mut(SLAB).enumerate().for_each(|(slab, out)| {
                for (block, buffer) in blocks.iter().zip(buffers.chunks(length)) {
                    block.add(buffer, first + slab * SLAB, out);
                }
            });
        } else {
            for (buffer, block) in buffers.chunks_mut(length).zip(blocks) {
                keep(one(&mut nodal, buffer, block));
                block.add(buffer, 0, out);
            }
        }
    }
    failure.map_or(Ok(()), |(_, error)| Err(error))
}

/// The sweep over one block.
struct OfBlock<'a, P, const D: usize> {
    block: &'a Block<D>,
    stage: &'a P,
    nodal: &'a [f64],
    buffer: &'a mut [f64],
}

impl<P: Stage<D>, const D: usize> WithLanes for OfBlock<'_, P, D> {
    type Output = Result<(), (usize, P::Error)>;

    #[inline(always)]
    fn run<S: Lanes>(self, s: S) -> Self::Output {
        let mut failure = None;
        for group in 0..self.block.groups() {
            let window = self.block.window(group);
            let mut at = if P::VALUE {
                gather::<S, D, true>(s, &window, self.nodal)
            } else {
                gather::<S, D, false>(s, &window, self.nodal)
            };
            let particles = self.block.particles(group);
            match self.stage.point(s, self.block.first_group + group, particles, &mut at) {
                Ok(()) if P::VALUE => scatter::<S, D, true>(s, &window, &at, self.buffer),
                Ok(()) => scatter::<S, D, false>(s, &window, &at, self.buffer),
                Err((p, error)) => keep_first(&mut failure, p, error),
            }
        }
        failure.map_or(Ok(()), Err)
    }
}
