//! The passes over all blocks, on all cores.
//!
//! A scatter is two shared regions. In the first, each block scatters into a box of its own. In the second, each range of nodes adds the boxes
//! of its blocks, in the order of the blocks. So no sum depends on the number of threads. A gather is one region: each block writes the
//! results of its own groups.

use super::block::Block;
use super::blocks::{Quadratic, ScatterBlocks, scatter_blocks};
use super::group::{At, Group, Window};
use super::kernel::{self, Gather, Scatter};
use super::shares::Shares;
use super::tiled::{RANGE, Tiled};
use super::{Each, Evaluate, Mode, Point};
use crate::lanes::LANES;
use crate::parallel::{self, Message};
use crate::tensor::Tensor;

/// Below this number of groups, waking the threads costs more than the work.
const PARALLEL: usize = 256;

/// `(block, scratch, buffer)`: fills the buffer of a block.
type Work<'a, S> = dyn Fn(&Block, &mut S, &mut [f64]) + Sync + 'a;

/// `(block, buffer, first, range)`: adds the buffer's entries at the active nodes of the range, which begins at the node `first`.
type Add<'a> = dyn Fn(&Block, &[f64], usize, &mut [f64]) + Sync + 'a;

impl<const D: usize> Tiled<D> {
    pub(super) fn in_parallel(&self) -> bool {
        parallel::several() && self.groups() >= PARALLEL
    }

    /// Bytes of the boxes of all own blocks in the pass with most numbers a node: diagonal blocks of the tangent, or dual numbers.
    pub(super) fn box_bytes(&self) -> usize {
        let numbers = |block: &Block| block.box_nodes() * (D * D).max(2 * D) + 2 * LANES;
        self.own().iter().map(numbers).sum::<usize>() * size_of::<f64>()
    }

    /// [`super::Connectivity::sweep`] for `fields` fields of C components side by side. Without a field nothing is gathered.
    pub(super) fn sweep<const C: usize>(
        &self,
        fields: usize,
        field: Option<&[f64]>,
        mode: Mode,
        out: &mut [f64],
        point: &Point<'_, C, D>,
    ) {
        let (numbers, modes) = (fields * C, vec![mode; fields]);
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
                    gather(window, nodal, &modes, at);
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

    /// Runs `work` for all blocks, and `add` for all nodes. A buffer has `numbers` numbers a node and `more` numbers behind them.
    fn each_block<S: Default + Send>(
        &self,
        numbers: usize,
        more: usize,
        out: &mut [f64],
        work: &Work<'_, S>,
        add: &Add<'_>,
    ) {
        let (own, length) = (self.own(), |block: &Block| block.box_nodes() * numbers + more);
        let shared = self.shared();
        if shared.is_none() && !self.in_parallel() {
            return self.add_in_turn(length, out, work, add);
        }
        let mut boxes = self.pool.unspecified(own.iter().map(length).sum());
        let mut left = &mut boxes[..];
        let parts = own.iter().filter_map(|block| Some((block, left.split_off_mut(..length(block))?)));
        parallel::for_each_with(parts, &|scratch, (block, buffer): (&Block, &mut [f64])| {
            buffer.fill(0.0);
            work(block, scratch, buffer);
        });
        let boxes = boxed(own, length, &boxes);
        let Some((first, shares)) = shared else { return self.add_boxes(numbers, out, &boxes, 0, add) };
        let before = shares.at_interface(numbers, out);
        self.add_boxes(numbers, out, &boxes, first, add);
        shares.complete(numbers, (out, &before), &self.pool, &|block, node, entry| {
            add(&self.blocks[block], boxes[block - first], node, entry);
        });
    }

    /// The first block of this process and the shares, if several processes share the blocks.
    fn shared(&self) -> Option<(usize, &Shares)> {
        self.shares.as_deref().map(|(shares, _)| (shares.own().start, shares))
    }

    /// Fills the boxes of all own blocks in turn, and adds each at once.
    fn add_in_turn<S: Default + Send>(
        &self,
        length: impl Fn(&Block) -> usize,
        out: &mut [f64],
        work: &Work<'_, S>,
        add: &Add<'_>,
    ) {
        let longest = self.own().iter().map(&length).max().unwrap_or(0);
        let (mut scratch, mut buffer) = (S::default(), vec![0.0; longest]);
        for block in self.own() {
            let buffer = &mut buffer[..length(block)];
            buffer.fill(0.0);
            work(block, &mut scratch, buffer);
            add(block, buffer, 0, out);
        }
    }

    /// Adds the boxes of all own blocks, the first of which has the number `first`.
    fn add_boxes(&self, numbers: usize, out: &mut [f64], boxes: &[&[f64]], first: usize, add: &Add<'_>) {
        let ranges = out.chunks_mut(RANGE * numbers).zip(&self.ranges).enumerate();
        parallel::for_each(ranges, &|(range, (out, blocks)): (usize, (&mut [f64], &Vec<u32>))| {
            let blocks = blocks.as_slice();
            mutant!("sweep: several threads leave out the first block of a range": blocks = &blocks[1..]);
            blocks.iter().for_each(|&b| add(&self.blocks[b as usize], boxes[b as usize - first], range * RANGE, out));
        });
    }

    /// Calls `evaluate(group, u and L, results)` for every own group, with the results of the group. They lie in the order of the groups.
    pub(super) fn results<R: Send, const C: usize>(
        &self,
        each: Each,
        modes: &[Mode],
        field: Option<&[f64]>,
        evaluate: &Evaluate<'_, R, C, D>,
        mut results: &mut [R],
    ) {
        let work = |scratch: &mut Scratch<C, D>, (block, mut results): (&Block, &mut [R])| {
            let Scratch { nodal, at, .. } = scratch;
            at.resize(modes.len(), At::zero());
            if let Some(field) = field {
                gather_boxes::<C>(block, field, modes.len(), nodal);
            }
            for number in 0..block.len() {
                let group = block.group(number);
                if field.is_some() {
                    gather(block.window::<D>(number), nodal, modes, at);
                }
                let own = results.split_off_mut(..each.of_group(group.particles.len()));
                own.into_iter().for_each(|own| evaluate(group, at, own));
            }
        };
        let part = |block| Some((block, results.split_off_mut(..each.of_block(block))?));
        let parts = self.own().iter().filter_map(part);
        if self.in_parallel() {
            parallel::for_each_with(parts, &work);
        } else {
            let mut scratch = Scratch::default();
            parts.for_each(|part| work(&mut scratch, part));
        }
    }

    /// Takes the results of other processes.
    pub(super) fn share_results<R: Message>(&self, each: Each, results: &mut [R]) {
        if let Some((_, shares)) = self.shared() {
            shares.share_results(&self.blocks, |block| each.of_block(block), results);
        }
    }

    /// [`Self::share_results`] for plain numbers, in place.
    pub(super) fn share_numbers(&self, each: Each, numbers: &mut [f64]) {
        if let Some((_, shares)) = self.shared() {
            shares.share_numbers(&self.blocks, |block| each.of_block(block), numbers);
        }
    }
}

/// The box of each block.
fn boxed<'b>(blocks: &[Block], length: impl Fn(&Block) -> usize, mut left: &'b [f64]) -> Vec<&'b [f64]> {
    blocks.iter().filter_map(|block| left.split_off(..length(block))).collect()
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
fn gather<const C: usize, const D: usize>(window: Window<'_>, nodal: &[f64], modes: &[Mode], at: &mut [At<f64, C, D>]) {
    let boxes = nodal.chunks(nodal.len() / at.len());
    for ((nodal, &mode), At { value, gradient }) in boxes.zip(modes).zip(at) {
        kernel::gather(C, Gather { window, nodal, mode, value, gradient: gradient.as_flattened_mut() });
    }
}
