//! The passes over all blocks, on all cores.
//!
//! Blocks are taken in batches of fixed length, called *waves*. Each block of a wave scatters into a buffer of its own. Then the buffers
//! are added to the nodes in the order of the blocks. One thread adds to each slab of nodes.
//! Neither the waves nor the order depend on the number of threads.

use super::block::{Block, Group};
use super::blocks::{Quadratic, ScatterBlocks, scatter_blocks};
use super::kernel::{self, At, Gather, Scatter, Window};
use super::tiled::Tiled;
use super::{Evaluate, Fill, Mode, Point};
use crate::lanes::LANES;
use crate::parallel;
use crate::tensor::Tensor;

/// Number of blocks in a wave: their buffers stay in the second-level caches.
const WAVE: usize = 64;

/// Number of nodes in a slab.
const SLAB: usize = 1024;

/// Below this number of groups, waking the threads costs more than the work.
const PARALLEL: usize = 256;

/// `(block, scratch, buffer)`: fills the buffer of a block.
type Work<'a, S> = dyn Fn(&Block, &mut S, &mut [f64]) + Sync + 'a;

/// `(block, buffer, first, slab)`: adds the buffer's entries at the active nodes of the slab, which begins at the node `first`.
type Add<'a> = dyn Fn(&Block, &[f64], usize, &mut [f64]) + Sync + 'a;

/// `(scratch, block, take)`: takes each group of a block with its result.
type Evaluated<'a, S, R> = dyn Fn(&mut S, &Block, &mut dyn FnMut(Group<'_>, R)) + Sync + 'a;

impl<const D: usize> Tiled<D> {
    fn in_parallel(&self) -> bool {
        parallel::several() && self.groups() >= PARALLEL
    }

    /// [`super::Supports::sweep`] for `fields` fields of C components side by side. Without a field nothing is gathered.
    pub(super) fn sweep<const C: usize>(
        &self,
        fields: usize,
        field: Option<&[f64]>,
        mode: Mode,
        out: &mut [f64],
        point: &Point<'_, C, D>,
    ) {
        let numbers = fields * C;
        // The buffer of a field is one vector longer than its nodes, since scatters write whole vectors.
        let length = |block: &Block| block.box_nodes() * C + LANES;
        let work = |block: &Block, scratch: &mut Scratch<C, D>, buffer: &mut [f64]| {
            let Scratch { nodal, at, sums, weights } = scratch;
            at.resize(fields, At::zero());
            sums.resize(fields, At::zero());
            if let Some(field) = field {
                gather_boxes::<C>(block, field, fields, nodal);
            }
            for group in 0..block.len() {
                let mut window = block.window::<D>(group);
                if field.is_some() {
                    gather(window, nodal, mode, at);
                }
                sums.fill(At::zero());
                point(block.group(group), at, sums);
                if let Some(changed) = mode.weights.changed() {
                    weights.clear();
                    weights.extend(window.weights.iter().map(|row| row.map(changed)));
                    window = Window { weights, ..window };
                }
                for (sums, buffer) in sums.iter().zip(buffer.chunks_mut(length(block))) {
                    let (value, gradient) = (&sums.value, sums.gradient.as_flattened());
                    kernel::scatter(C, Scatter { window, mode, value, gradient, out: buffer });
                }
            }
        };
        let add = |block: &Block, buffer: &[f64], first: usize, out: &mut [f64]| {
            for (f, buffer) in buffer.chunks(length(block)).take(fields).enumerate() {
                block.each_node(first, first + out.len() / numbers, |place, node| {
                    let to = node * numbers + f * C;
                    for (out, &sum) in out[to..to + C].iter_mut().zip(&buffer[place * C..(place + 1) * C]) {
                        *out += sum;
                    }
                });
            }
        };
        self.each_block(numbers, fields * LANES, out, &work, &add);
    }

    /// Adds to `out` the nodal diagonal blocks of the quadratic forms. `quadratic` fills in the form of each group.
    pub(super) fn blocks(&self, out: &mut [Tensor<f64, D>], quadratic: &(dyn Fn(Group<'_>, &mut Quadratic) + Sync)) {
        let numbers = D * D;
        let work = |block: &Block, (): &mut (), buffer: &mut [f64]| {
            for group in 0..block.len() {
                let mut form = Quadratic::zero();
                quadratic(block.group(group), &mut form);
                let window = block.window::<D>(group);
                scatter_blocks(ScatterBlocks { window, from: &form, out: buffer });
            }
        };
        let add = |block: &Block, buffer: &[f64], first: usize, out: &mut [f64]| {
            block.each_node(first, first + out.len() / numbers, |place, node| {
                // The kernel stores blocks by rows, nalgebra by columns.
                for i in 0..D {
                    for k in 0..D {
                        out[node * numbers + k * D + i] += buffer[place * numbers + i * D + k];
                    }
                }
            });
        };
        self.each_block(numbers, LANES, bytemuck::cast_slice_mut(out), &work, &add);
    }

    /// Runs `work` and `add` for all blocks, wave by wave. A buffer has `numbers` numbers a node and `more` numbers behind them.
    fn each_block<S: Default + Send>(
        &self,
        numbers: usize,
        more: usize,
        out: &mut [f64],
        work: &Work<'_, S>,
        add: &Add<'_>,
    ) {
        let length = self.blocks.iter().map(Block::box_nodes).max().unwrap_or(0) * numbers + more;
        let one = |scratch: &mut S, buffer: &mut [f64], block: &Block| {
            buffer[..block.box_nodes() * numbers + more].fill(0.0);
            work(block, scratch, buffer);
        };
        if !self.in_parallel() {
            let (mut scratch, mut buffer) = (S::default(), vec![0.0; length]);
            for block in &self.blocks {
                one(&mut scratch, &mut buffer, block);
                add(block, &buffer, 0, out);
            }
            return;
        }
        let mut buffers = vec![0.0; WAVE.min(self.blocks.len()) * length];
        for blocks in self.blocks.chunks(WAVE) {
            let parts = buffers.chunks_mut(length).zip(blocks);
            parallel::for_each_with(parts, &|scratch, (buffer, block)| one(scratch, buffer, block));
            let first = blocks.iter().filter_map(|block| block.nodes.first()).min().map_or(0, |&n| n as usize);
            let last = blocks.iter().filter_map(|block| block.nodes.last()).max().map_or(0, |&n| n as usize + 1);
            let slabs = out[first * numbers..last * numbers].chunks_mut(SLAB * numbers).enumerate();
            parallel::for_each(slabs, &|(slab, out)| {
                for (block, buffer) in blocks.iter().zip(buffers.chunks(length)) {
                    mutant!("sweep: several threads leave out the first block of a wave": { if std::ptr::eq(block, &blocks[0]) { continue; } });
                    add(block, buffer, first + slab * SLAB, out);
                }
            });
        }
    }

    /// Calls `take(group, evaluate(group, u and L))` for every group in order.
    pub(super) fn gather<R: Send, const C: usize>(
        &self,
        fields: usize,
        field: &[f64],
        mode: Mode,
        evaluate: &Evaluate<'_, R, C, D>,
        take: &mut dyn FnMut(Group<'_>, R),
    ) {
        let one = |scratch: &mut Scratch<C, D>, block: &Block, take: &mut dyn FnMut(Group<'_>, R)| {
            gathered(block, field, fields, mode, scratch, |group, at| take(group, evaluate(group, at)));
        };
        self.in_order(&one, take);
    }

    /// Calls `take(group, evaluate(group))` for every group in order.
    pub(super) fn map_groups<R: Send>(
        &self,
        evaluate: &(dyn Fn(Group<'_>) -> R + Sync),
        take: &mut dyn FnMut(Group<'_>, R),
    ) {
        let one = |(): &mut (), block: &Block, take: &mut dyn FnMut(Group<'_>, R)| {
            (0..block.len()).for_each(|group| take(block.group(group), evaluate(block.group(group))));
        };
        self.in_order(&one, take);
    }

    /// Evaluates all blocks by `one`, and takes the results of their groups in order. At most the results of one wave wait in memory.
    fn in_order<S: Default + Send, R: Send>(&self, one: &Evaluated<'_, S, R>, take: &mut dyn FnMut(Group<'_>, R)) {
        if !self.in_parallel() {
            let mut scratch = S::default();
            self.blocks.iter().for_each(|block| one(&mut scratch, block, take));
            return;
        }
        let mut waiting: Vec<Vec<R>> = self.blocks.iter().take(WAVE).map(|_| Vec::new()).collect();
        for blocks in self.blocks.chunks(WAVE) {
            parallel::for_each_with(blocks.iter().zip(&mut waiting), &|scratch, (block, results)| {
                one(scratch, block, &mut |_, result| results.push(result));
            });
            for (block, results) in blocks.iter().zip(&mut waiting) {
                results.drain(..).enumerate().for_each(|(group, result)| take(block.group(group), result));
            }
        }
    }

    /// Calls `fill(group, L, rows)` for every group. Each group has `count` rows of its own.
    pub(super) fn fill_rows(&self, field: &[f64], count: usize, mut rows: &mut [[f64; LANES]], fill: &Fill<'_, D>) {
        let of_block = |block| Some((block, rows.split_off_mut(..Block::len(block) * count)?));
        let one = |scratch: &mut Scratch<D, D>, (block, rows): (&Block, &mut [[f64; LANES]])| {
            let mut rows = rows.chunks_mut(count);
            gathered(block, field, 1, Mode::GRADIENT, scratch, |group, at| {
                rows.next().into_iter().for_each(|rows| fill(group, &at[0], rows));
            });
        };
        let parts = self.blocks.iter().filter_map(of_block);
        if self.in_parallel() {
            parallel::for_each_with(parts, &one);
        } else {
            let mut scratch = Scratch::default();
            parts.for_each(|part| one(&mut scratch, part));
        }
    }
}

/// Working memory of one thread.
#[derive(Default)]
struct Scratch<const C: usize, const D: usize> {
    /// The boxes of the fields.
    nodal: Vec<f64>,
    /// u and L of each field.
    at: Vec<At<f64, C, D>>,
    /// q and σ of each field.
    sums: Vec<At<f64, C, D>>,
    /// The weights of a group: magnitudes or squares of its shape-function values.
    weights: Vec<[f64; LANES]>,
}

/// Copies nodal values into the boxes of the fields, one after the other. Nodes that are not active get zero.
fn gather_boxes<const C: usize>(block: &Block, field: &[f64], fields: usize, nodal: &mut Vec<f64>) {
    let boxed = block.box_nodes() * C;
    nodal.clear();
    nodal.resize(fields * boxed, 0.0);
    for (f, nodal) in nodal.chunks_mut(boxed).enumerate() {
        for (&node, &place) in block.nodes.iter().zip(&block.places) {
            let (to, from) = (place as usize * C, (node as usize * fields + f) * C);
            mutant!("sweep: components beside each other are read from the first field": from = node as usize * fields * C);
            nodal[to..to + C].copy_from_slice(&field[from..from + C]);
        }
    }
}

/// Gathers u and L of a group from the boxes of the fields.
fn gather<const C: usize, const D: usize>(window: Window<'_>, nodal: &[f64], mode: Mode, at: &mut [At<f64, C, D>]) {
    for (nodal, At { value, gradient }) in nodal.chunks(nodal.len() / at.len()).zip(at) {
        kernel::gather(C, Gather { window, nodal, mode, value, gradient: gradient.as_flattened_mut() });
    }
}

/// Calls `visit(group, u and L)` for every group of a block.
fn gathered<const C: usize, const D: usize>(
    block: &Block,
    field: &[f64],
    fields: usize,
    mode: Mode,
    Scratch { nodal, at, .. }: &mut Scratch<C, D>,
    mut visit: impl FnMut(Group<'_>, &[At<f64, C, D>]),
) {
    gather_boxes::<C>(block, field, fields, nodal);
    at.resize(fields, At::zero());
    for group in 0..block.len() {
        gather(block.window::<D>(group), nodal, mode, at);
        visit(block.group(group), at);
    }
}
