//! The share of each process in a pass: a contiguous range of blocks.
//!
//! Every process has all nodal fields. A node that the blocks of one process alone reach is an *interior* node of this process: it adds the boxes
//! there, and tells the others the sum. At an *interface* node, which blocks of several processes reach, each of them tells the entries of its
//! boxes one by one. All processes then add these entries in the order of the blocks. So no sum depends on the number of processes.

use super::block::Block;
use crate::parallel::{self, Message, Processes};
use crate::pooled::Pool;
use std::iter;
use std::ops::Range;

/// The blocks of each process, and the nodes whose sums or entries it tells the others after a scatter.
#[derive(Debug)]
pub(super) struct Shares {
    pub(super) processes: Processes,
    /// The first block of each process; at the end, the number of blocks.
    bounds: Vec<usize>,
    /// The interior nodes of all processes, one process after the other, and how many each process has.
    interior: (Vec<u32>, Vec<usize>),
    /// The interface nodes of all blocks, one block after the other, and how many each process has.
    interface: (Vec<u32>, Vec<usize>),
    /// Every interface node, once.
    distinct: Vec<u32>,
    /// The number of interface nodes of each own block.
    of_own: Vec<usize>,
}

impl Shares {
    /// The shares of all processes. `counts` has the particles of each block.
    pub(super) fn new(processes: &Processes, counts: &[usize]) -> Self {
        let bounds = bounds(processes.count(), counts);
        let [interior, interface] = [(); 2].map(|()| (Vec::new(), Vec::new()));
        Self { processes: processes.clone(), bounds, interior, interface, distinct: Vec::new(), of_own: Vec::new() }
    }

    /// The first block of each process; at the end, the number of blocks.
    pub(super) fn bounds(&self) -> &[usize] {
        &self.bounds
    }

    /// The blocks of this process.
    pub(super) fn own(&self) -> Range<usize> {
        self.of(self.processes.rank())
    }

    fn of(&self, process: usize) -> Range<usize> {
        self.bounds[process]..self.bounds[process + 1]
    }

    /// For each process, the sum of `count` over its blocks.
    fn by_process(&self, blocks: &[Block], count: impl Fn(&Block) -> usize) -> Vec<usize> {
        (0..self.processes.count()).map(|process| blocks[self.of(process)].iter().map(&count).sum()).collect()
    }

    /// Tells every process the groups of all blocks. `set(block, number, lanes)` makes a block that of another process.
    pub(super) fn tell_groups(&self, blocks: &mut [Block], set: impl Fn(&mut Block, usize, &[u8])) {
        let own = &blocks[self.own()];
        let (groups, _) = self.processes.joined::<u32>(own.iter().map(|block| block.len() as u32).collect());
        let (lanes, _) = self.processes.joined::<u8>(own.iter().flat_map(Block::lanes).collect());
        let (own, mut left) = (self.own(), lanes.as_slice());
        for (number, (block, groups)) in iter::zip(blocks, groups).enumerate() {
            let (lanes, rest) = left.split_at(groups as usize);
            left = rest;
            if !own.contains(&number) {
                set(block, number, lanes);
            }
        }
    }

    /// Finds the interior and the interface nodes.
    pub(super) fn find_nodes(&mut self, blocks: &[Block], nodes: usize) {
        let mut touched = vec![false; nodes];
        let own = &blocks[self.own()];
        own.iter().flat_map(|block| &block.nodes).for_each(|&node| touched[node as usize] = true);
        let touched = (0..nodes as u32).filter(|&node| touched[node as usize]).collect();
        let (touched, lengths) = self.processes.joined::<u32>(touched);
        let mut several = vec![0_u8; nodes];
        touched.iter().for_each(|&node| several[node as usize] = several[node as usize].saturating_add(1));
        let is_interface = |node: &u32| several[*node as usize] > 1;
        self.distinct = (0..nodes as u32).filter(is_interface).collect();
        let (mut interior, mut counts, mut left) = (Vec::new(), Vec::new(), touched.as_slice());
        for length in lengths {
            let (of_process, rest) = left.split_at(length);
            left = rest;
            let before = interior.len();
            interior.extend(of_process.iter().copied().filter(|node| !is_interface(node)));
            counts.push(interior.len() - before);
        }
        self.interior = (interior, counts);
        let of_block = |block: &Block| block.nodes.iter().copied().filter(is_interface).collect::<Vec<u32>>();
        let of_blocks: Vec<Vec<u32>> = own.iter().map(of_block).collect();
        self.of_own = of_blocks.iter().map(Vec::len).collect();
        self.interface = self.processes.joined(of_blocks.concat());
    }

    /// The numbers of this process's blocks, each with its interface nodes.
    fn own_interfaces(&self) -> impl Iterator<Item = (usize, &[u32])> {
        let start: usize = self.interface.1[..self.processes.rank()].iter().sum();
        let mut left = &self.interface.0[start..];
        self.own().zip(&self.of_own).map(move |(block, &count)| {
            let (nodes, rest) = left.split_at(count);
            left = rest;
            (block, nodes)
        })
    }

    /// The values of a nodal field at the interface nodes, before a scatter.
    pub(super) fn at_interface(&self, numbers: usize, field: &[f64]) -> Vec<f64> {
        self.distinct.iter().flat_map(|&node| &field[node as usize * numbers..][..numbers]).copied().collect()
    }

    /// Completes the sums of a scatter, to which this process has added its own boxes. `before` has the values at the interface nodes before
    /// the scatter, and `add(block, node, out)` adds the entry of an own block at a node.
    pub(super) fn complete(
        &self,
        numbers: usize,
        (out, before): (&mut [f64], &[f64]),
        pool: &Pool,
        add: &(dyn Fn(usize, usize, &mut [f64]) + Sync),
    ) {
        let rank = self.processes.rank();
        let lengths = iter::zip(&self.interior.1, &self.interface.1).map(|(inner, at)| (inner + at) * numbers);
        let lengths: Vec<usize> = lengths.collect();
        let mut all = pool.unspecified(lengths.iter().sum());
        let at = |node: u32| node as usize * numbers..(node as usize + 1) * numbers;
        let interior = |process: usize| {
            let start: usize = self.interior.1[..process].iter().sum();
            &self.interior.0[start..start + self.interior.1[process]]
        };
        // This process tells its sums at interior nodes, then its entries at interface nodes.
        let start: usize = lengths[..rank].iter().sum();
        let own = &mut all[start..start + lengths[rank]];
        let (sums, entries) = own.split_at_mut(self.interior.1[rank] * numbers);
        iter::zip(sums.chunks_mut(numbers), interior(rank)).for_each(|(to, &node)| to.copy_from_slice(&out[at(node)]));
        let mut left = entries;
        let parts = self.own_interfaces().filter_map(|(block, nodes)| {
            let entries = left.split_off_mut(..nodes.len() * numbers)?;
            Some((block, nodes, entries))
        });
        parallel::for_each(parts, &|(block, nodes, entries): (usize, &[u32], &mut [f64])| {
            // −0 + x is x, also for x = −0.
            entries.fill(-0.0);
            iter::zip(entries.chunks_mut(numbers), nodes).for_each(|(entry, &node)| add(block, node as usize, entry));
        });
        self.processes.share(&lengths, &mut all);
        iter::zip(&self.distinct, before.chunks(numbers)).for_each(|(&node, from)| out[at(node)].copy_from_slice(from));
        let (mut told, mut interface) = (&all[..], self.interface.0.iter());
        for (process, (&inner, &entries)) in iter::zip(&self.interior.1, &self.interface.1).enumerate() {
            let (sums, rest) = told.split_at(inner * numbers);
            let (entries, rest) = rest.split_at(entries * numbers);
            told = rest;
            if process != rank {
                let sums = iter::zip(sums.chunks(numbers), interior(process));
                sums.for_each(|(from, &node)| out[at(node)].copy_from_slice(from));
            }
            for (entry, &node) in iter::zip(entries.chunks(numbers), interface.by_ref()) {
                iter::zip(&mut out[at(node)], entry).for_each(|(sum, one)| *sum += one);
            }
        }
    }

    /// Each process has written the numbers of its own blocks, `count(block)` of each. Fills in the numbers of all others.
    pub(super) fn share_numbers(&self, blocks: &[Block], count: impl Fn(&Block) -> usize, numbers: &mut [f64]) {
        self.processes.share(&self.by_process(blocks, count), numbers);
    }

    /// [`Self::share_numbers`] for results of any type.
    pub(super) fn share_results<R: Message>(
        &self,
        blocks: &[Block],
        count: impl Fn(&Block) -> usize,
        results: &mut [R],
    ) {
        let (counts, rank) = (self.by_process(blocks, count), self.processes.rank());
        let start: usize = counts[..rank].iter().sum();
        let mut numbers = Vec::new();
        results[start..start + counts[rank]].iter().for_each(|result| result.put(&mut numbers));
        let (numbers, _) = self.processes.joined(numbers);
        let mut numbers = numbers.iter();
        results.iter_mut().for_each(|result| *result = R::take(&mut numbers));
    }
}

/// Contiguous ranges of blocks with nearly the same number of particles: the first block of each, and at the end the number of blocks.
fn bounds(processes: usize, counts: &[usize]) -> Vec<usize> {
    let total: usize = counts.iter().sum();
    let (mut bounds, mut before) = (vec![0], 0);
    for (block, count) in counts.iter().enumerate() {
        // A block belongs to the process in whose part of the particles its middle lies.
        while bounds.len() < processes && (2 * before + count) * processes >= 2 * bounds.len() * total {
            bounds.push(block);
        }
        before += count;
    }
    bounds.resize(processes + 1, counts.len());
    bounds
}

/// The largest number of particles of a process, and the most entries of nodes that a process tells after a scatter, if so many processes share
/// these blocks.
pub(super) fn largest(processes: usize, blocks: &[Block], nodes: usize) -> [usize; 2] {
    let counts: Vec<usize> = blocks.iter().map(Block::count).collect();
    let bounds = bounds(processes, &counts);
    let ranges = || bounds.windows(2).map(|ends| ends[0]..ends[1]);
    // The first and the last process that reach each node.
    let mut reached = vec![[u32::MAX, 0]; nodes];
    for (process, range) in (0..).zip(ranges()) {
        for &node in blocks[range].iter().flat_map(|block| &block.nodes) {
            let [first, last] = &mut reached[node as usize];
            (*first, *last) = (process.min(*first), process.max(*last));
        }
    }
    let interface = |node: &&u32| reached[**node as usize][0] < reached[**node as usize][1];
    let mut told = vec![0; processes];
    reached.iter().filter(|[first, last]| first == last).for_each(|[first, _]| told[*first as usize] += 1);
    for (told, range) in iter::zip(&mut told, ranges()) {
        *told += blocks[range].iter().flat_map(|block| &block.nodes).filter(interface).count();
    }
    let particles = ranges().map(|range| counts[range].iter().sum());
    [particles.max().unwrap_or(0), told.into_iter().max().unwrap_or(0)]
}
