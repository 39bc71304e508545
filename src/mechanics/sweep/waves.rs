//! The sweep of vector lanes over all blocks, on all cores.
//!
//! Blocks are taken in waves of fixed length: each block of a wave scatters into a buffer of its own, and then the buffers
//! are added to the nodes in the order of the blocks, every slab of nodes by one thread. Neither the waves nor the order
//! depend on the number of threads.

use super::kernel::{Gathered, Stored, Terms, gather, scatter};
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

/// What is done at the particles of a group between gather and scatter. Of its [`Terms`], those of the scatter; u and L are
/// gathered alike unless there is no field.
pub(super) trait Stage<const D: usize>: Terms + Sync {
    /// What can go wrong at a particle.
    type Error: Send;

    /// Puts σ in the place of L and q in that of u; on an error names the first particle of the group that failed.
    fn point<S: Lanes>(
        &self,
        s: S,
        group: usize,
        particles: &[u32],
        at: &mut Gathered<S::N, D>,
    ) -> Result<(), (usize, Self::Error)>;
}

/// `out_I += Σ_p σ_p ∇_n N_I + q_p N_I`; `T` is `f64`. Without a field nothing is gathered.
///
/// # Errors
/// That of the particle with the smallest number.
pub(super) fn run<T: Real, P: Stage<D>, const D: usize>(
    tiled: &Tiled<D>,
    field: Option<&[Vector<T, D>]>,
    out: &mut [Vector<T, D>],
    stage: &P,
) -> Result<(), P::Error> {
    let mut failure = None;
    let work = |block: &Block<D>, nodal: &mut Vec<f64>, buffer: &mut [f64]| {
        if let Some(field) = field {
            nodal.resize(block.box_nodes() * D, 0.0);
            block.fill(field, nodal);
        }
        widest(OfBlock { block, stage, nodal: field.map(|_| nodal.as_slice()), buffer }).err()
    };
    let add = |block: &Block<D>, buffer: &[f64], first: usize, out: &mut [Vector<T, D>]| {
        block.add(buffer, D, first, out, |sum, numbers| {
            for (sum, &x) in sum.iter_mut().zip(numbers) {
                *sum += T::lit(x);
            }
        });
    };
    each_block(tiled, D, out, work, add, |(p, error)| keep_first(&mut failure, p, error));
    failure.map_or(Ok(()), |(_, error)| Err(error))
}

/// The waves: `work(block, scratch, buffer)` fills the buffer of each block, a box of `numbers` numbers a node; then
/// `add(block, buffer, first, slab)` adds what lies on the active nodes `first ..` of the slab.
pub(super) fn each_block<O: Send, F: Send, const D: usize>(
    tiled: &Tiled<D>,
    numbers: usize,
    out: &mut [O],
    work: impl Fn(&Block<D>, &mut Vec<f64>, &mut [f64]) -> Option<F> + Sync,
    add: impl Fn(&Block<D>, &[f64], usize, &mut [O]) + Sync,
    mut failed: impl FnMut(F),
) {
    let length = tiled.blocks.iter().map(Block::box_nodes).max().unwrap_or(0) * numbers + LANES;
    let parallel = rayon::current_num_threads() > 1 && tiled.groups() >= PARALLEL;
    let one = |scratch: &mut Vec<f64>, buffer: &mut [f64], block: &Block<D>| {
        buffer[..block.box_nodes() * numbers + LANES].fill(0.0);
        work(block, scratch, buffer)
    };
    if !parallel {
        let (mut scratch, mut buffer) = (Vec::new(), vec![0.0; length]);
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
            .map_init(Vec::new, |scratch, (buffer, block)| one(scratch, buffer, block))
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
    let one = |scratch: &mut (Vec<f64>, Vec<Stored<D>>), (block, chunk): (&Block<D>, C)| {
        let (nodal, stored) = scratch;
        nodal.resize(block.box_nodes() * D, 0.0);
        block.fill(field, nodal);
        stored.clear();
        widest(OnlyGather { block, nodal, stored });
        visit(block, chunk, stored)
    };
    if rayon::current_num_threads() > 1 && tiled.groups() >= PARALLEL {
        tiled.blocks.par_iter().zip(chunks).map_init(Default::default, one).collect()
    } else {
        let mut scratch = Default::default();
        tiled.blocks.iter().zip(chunks).map(|both| one(&mut scratch, both)).collect()
    }
}

/// The gather of one block.
struct OnlyGather<'a, const D: usize> {
    block: &'a Block<D>,
    nodal: &'a [f64],
    stored: &'a mut Vec<Stored<D>>,
}

impl<const D: usize> WithLanes for OnlyGather<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        for group in 0..self.block.groups() {
            self.stored.push(Stored::of(s, &gather::<S, D, true>(s, &self.block.window(group), self.nodal)));
        }
    }
}

/// The sweep over one block.
struct OfBlock<'a, P, const D: usize> {
    block: &'a Block<D>,
    stage: &'a P,
    nodal: Option<&'a [f64]>,
    buffer: &'a mut [f64],
}

impl<P: Stage<D>, const D: usize> WithLanes for OfBlock<'_, P, D> {
    type Output = Result<(), (usize, P::Error)>;

    #[inline(always)]
    fn run<S: Lanes>(self, s: S) -> Self::Output {
        let mut failure = None;
        for group in 0..self.block.groups() {
            let window = self.block.window(group);
            let mut at = match self.nodal {
                Some(nodal) if P::VALUE => gather::<S, D, true>(s, &window, nodal),
                Some(nodal) => gather::<S, D, false>(s, &window, nodal),
                None => Gathered { value: [s.zero(); D], gradient: [[s.zero(); D]; D] },
            };
            let particles = self.block.particles(group);
            match self.stage.point(s, self.block.first_group + group, particles, &mut at) {
                Ok(()) => scatter::<S, P, D>(s, &window, &at, self.buffer),
                Err((p, error)) => keep_first(&mut failure, p, error),
            }
        }
        failure.map_or(Ok(()), Err)
    }
}
