//! The shape functions of all particles for products N = Π_k N_k. Only the weights of each axis are stored, and the particles of a cell lie
//! side by side in vector lanes.
//!
//! Particles are taken in the order (cell, id). [Groups and blocks](super) are defined on the page of the module.

use super::block::{Block, NONE};
use super::builder::Builder;
use super::columns::Family;
use super::foreign::Foreign;
use super::group::Group;
use super::numbering::number;
use super::order::{self, Key};
use super::points::{Points, ShapeFunctionError};
use super::shares::Shares;
use crate::approximation::{ApproximationError, Scratch, Separable, ShapeFunction, Support};
use crate::grid::Grid;
use crate::lanes::LANES;
use crate::parallel::{self, First, Processes};
use crate::pooled::Pool;
use crate::space::Nodes;
use crate::tensor::Vector;
use std::ops::Range;

/// Number of nodes in a range, over which one task adds the boxes of the blocks.
pub(super) const RANGE: usize = 256;

/// The shape functions of all particles, by axis.
#[derive(Debug, Default)]
pub(super) struct Tiled<const D: usize> {
    pub(super) blocks: Vec<Block>,
    /// For each range of nodes, the blocks with a node in it, ascending.
    pub(super) ranges: Vec<Vec<u32>>,
    /// Memory pool of the blocks' boxes.
    pub(super) pool: Pool,
    /// Slot of each particle: group · 8 + lane.
    slots: Vec<u32>,
    /// The particles in their order.
    keys: Vec<Key>,
    /// Whether the particles lie in memory in this order.
    pub(super) is_memory_order: bool,
    nodes: Nodes,
    /// The processes that share the blocks, and the blocks of the others; `None` if there is one process.
    pub(super) shares: Option<Box<(Shares, Foreign)>>,
}

impl<const D: usize> Tiled<D> {
    /// [`super::Connectivity::new`] for a shape function that is a product. The arrays lie in the memory of `reused`, and sorting begins with the order of its particles.
    pub(super) fn new<A: ShapeFunction>(
        approximation: &A,
        product: &dyn Separable,
        grid: &Grid<D>,
        points: &Points<'_, D>,
        reused: Option<Self>,
        pool: &Pool,
    ) -> Result<(Self, Nodes), ShapeFunctionError> {
        let positions = &*points.positions;
        let outside = || ApproximationError::Outside { position: Vec::new(), lower: Vec::new(), upper: Vec::new() };
        // Threads meet errors in any order. So the particle with the smallest id is searched, with the error for its whole position.
        let failure = |particle: usize, source: ApproximationError| {
            let (mut scratch, mut support) = (Scratch::default(), Support::default());
            let mut error = |x: &Vector<f64, D>| approximation.evaluate(grid, x, &mut scratch, &mut support).err();
            let failing = positions.iter().enumerate().filter_map(|(p, x)| Some((points.id(p), error(x)?)));
            let (particle, source) = failing.min_by_key(|&(id, _)| id).unwrap_or((points.id(particle), source));
            ShapeFunctionError { particle, source }
        };
        let Self { mut blocks, mut ranges, slots, keys, .. } = reused.unwrap_or_default();
        let keys = order::sorted(grid, points, keys).map_err(|particle| failure(particle, outside()))?;
        let runs: Vec<&[Key]> = keys.chunk_by(|a, b| order::block::<D>(a) == order::block::<D>(b)).collect();
        blocks.resize_with(runs.len(), Block::default);
        let processes = &points.processes;
        let mut shares = processes.are_several().then(|| {
            let counts: Vec<usize> = runs.iter().map(|run| run.len()).collect();
            let foreign = Foreign::new(approximation, grid, points, &keys, runs.len());
            Box::new((Shares::new(processes, &counts), foreign))
        });
        let own = own(&shares, runs.len());
        let (builder, failed) = (Builder { family: Family::new(product), grid, points }, First::none());
        let parts = blocks[own.clone()].iter_mut().zip(&runs[own.clone()]);
        parallel::for_each_with(parts, &|scratch, (block, keys): (&mut Block, &&[Key])| {
            if let Err(error) = builder.build(keys, block, scratch) {
                failed.keep(keys[0].particle as usize, error);
            }
        });
        let failed = failed.here();
        if processes.any(failed.is_some()) {
            let (particle, error) = failed.unwrap_or((0, outside()));
            return Err(failure(particle, error));
        }
        if let Some((shares, _)) = shares.as_deref() {
            shares.tell_groups(&mut blocks, |block, number, lanes| {
                let particles = runs[number].iter().map(|key| key.particle);
                block.set_foreign(points.fields.field(runs[number][0].particle as usize), particles, lanes);
            });
        }
        let (mut first, mut start) = (0, 0);
        for block in &mut blocks {
            (block.first, block.start) = (first, start);
            first += block.len();
            start += block.count() as u32;
        }
        let nodes = number(grid, &mut blocks[own.clone()], processes);
        list_blocks(&blocks[own.clone()], own.start, nodes.len(), &mut ranges);
        if let Some((shares, _)) = shares.as_deref_mut() {
            shares.find_nodes(&blocks, nodes.len());
        }
        let is_memory_order = keys.iter().zip(0..).all(|(key, place)| key.particle == place);
        let (pool, numbered) = (pool.clone(), nodes.clone());
        let mut tiled = Self { blocks, ranges, pool, slots, keys, is_memory_order, nodes: numbered, shares };
        tiled.find_slots();
        Ok((tiled, nodes))
    }

    pub(super) fn particles(&self) -> usize {
        self.slots.len()
    }

    /// The processes that share the blocks.
    pub(super) fn processes(&self) -> &Processes {
        self.shares.as_ref().map_or(const { &Processes::ALONE }, |both| &both.0.processes)
    }

    /// The blocks of this process.
    pub(super) fn own(&self) -> &[Block] {
        &self.blocks[own(&self.shares, self.blocks.len())]
    }

    /// The groups of this process.
    pub(super) fn own_groups(&self) -> Range<usize> {
        let own = self.own();
        own.first().map_or(0, |first| first.first)..own.last().map_or(0, |last| last.first + last.len())
    }

    /// The places of this process's particles in [`Self::order`].
    pub(super) fn own_places(&self) -> Range<usize> {
        let own = own(&self.shares, self.blocks.len());
        self.start(own.start)..self.start(own.end)
    }

    /// The first particle of a block, or of no block behind the last one, in [`Self::order`].
    fn start(&self, block: usize) -> usize {
        self.blocks.get(block).map_or(self.particles(), |block| block.start as usize)
    }

    /// See [`super::Connectivity::bounds`].
    pub(super) fn bounds(&self) -> Vec<usize> {
        self.shares.iter().flat_map(|both| both.0.bounds().iter().map(|block| self.start(*block))).collect()
    }

    /// See [`super::Connectivity::own_particles`].
    pub(super) fn own_particles(&self) -> Range<usize> {
        if self.is_memory_order { self.own_places() } else { 0..self.particles() }
    }

    /// The particles, block by block and group by group.
    pub(super) fn order(&self) -> impl Iterator<Item = u32> {
        self.keys.iter().map(|key| key.particle)
    }

    /// Moves results, so many for each particle, from [`Self::order`] to the order of the particles in memory.
    pub(super) fn to_memory_order<R: Copy>(&self, count: usize, results: &mut [R]) {
        if !self.is_memory_order {
            let unsorted = results.to_vec();
            for (p, own) in self.order().zip(unsorted.chunks(count)) {
                results[p as usize * count..][..count].copy_from_slice(own);
            }
        }
    }

    /// Renumbers the particles after they have been put into [`Self::order`].
    pub(super) fn rearrange(&mut self) {
        parallel::each(&mut self.keys, |place, key| key.particle = place as u32);
        self.is_memory_order = true;
        parallel::for_each(self.blocks.iter_mut(), &|block: &mut Block| {
            let mut next = block.start;
            for (particles, window) in block.particles.iter_mut().zip(&block.windows) {
                let lanes = u32::from(window.lanes);
                particles.iter_mut().zip(next..next + lanes).for_each(|(particle, place)| *particle = place);
                next += lanes;
            }
        });
        self.find_slots();
    }

    /// Finds the slot of each particle.
    fn find_slots(&mut self) {
        let Self { slots, blocks, is_memory_order, .. } = self;
        slots.resize(self.keys.len(), 0);
        let of_block = |block: &Block, first: usize, slots: &mut [u32]| {
            for group in (0..block.len()).map(|group| block.group(group)) {
                for (lane, &p) in group.particles.iter().enumerate() {
                    slots[p as usize - first] = (group.number * LANES + lane) as u32;
                }
            }
        };
        if *is_memory_order {
            let mut left = slots.as_mut_slice();
            let part = |block: &'_ Block| left.split_off_mut(..block.count());
            let parts = blocks.iter().zip(blocks.iter().filter_map(part));
            parallel::for_each(parts, &|(block, slots)| of_block(block, block.start as usize, slots));
        } else {
            blocks.iter().for_each(|block| of_block(block, 0, slots));
        }
    }

    pub(super) fn each_group<'s>(&'s self, visit: &mut dyn FnMut(Group<'s>)) {
        for block in &self.blocks {
            (0..block.len()).for_each(|group| visit(block.group(group)));
        }
    }

    pub(super) fn groups(&self) -> usize {
        self.blocks.last().map_or(0, |last| last.first + last.len())
    }

    pub(super) fn windows(&self) -> Vec<([usize; 3], usize)> {
        let groups = self.own().iter().flat_map(|block| &block.windows);
        groups.map(|group| (group.width.map(usize::from), usize::from(group.lanes))).collect()
    }

    pub(super) fn bytes(&self) -> usize {
        let ranges = self.ranges.iter().map(|blocks| size_of_val(blocks.as_slice())).sum::<usize>();
        size_of_val(self.slots.as_slice()) + ranges + self.blocks.iter().map(Block::bytes).sum::<usize>()
    }

    pub(super) fn of(&self, grid: &Grid<D>, particle: usize) -> Vec<(usize, f64, Vector<f64, D>)> {
        let slot = self.slots[particle] as usize;
        let (group, lane) = (slot / LANES, slot % LANES);
        let number = self.blocks.partition_point(|block| block.first <= group) - 1;
        let mut block = &self.blocks[number];
        if let Some((shares, foreign)) = self.shares.as_deref()
            && !shares.own().contains(&number)
        {
            let start = block.start as usize;
            block = foreign.block(number, &self.keys[start..start + block.count()], block);
        }
        let number = |place: usize| match block.numbers.get(place) {
            Some(&number) => (number != NONE).then_some(number as usize),
            None => self.nodes.number(grid.id_in(block.field, block.index(place))),
        };
        let active = |(place, n, grad_n): (usize, f64, _)| Some((number(place)?, n, grad_n));
        block.entries::<D>(group - block.first, lane).filter_map(active).collect()
    }
}

/// The blocks of this process, of so many blocks in all.
fn own(shares: &Option<Box<(Shares, Foreign)>>, count: usize) -> Range<usize> {
    shares.as_ref().map_or(0..count, |both| both.0.own())
}

/// Lists the blocks of each range of nodes. The memory of `ranges` is reused. `first` is the number of the first block.
fn list_blocks(blocks: &[Block], first: usize, nodes: usize, ranges: &mut Vec<Vec<u32>>) {
    ranges.resize_with(nodes.div_ceil(RANGE), Vec::new);
    ranges.iter_mut().for_each(Vec::clear);
    for (block, number) in blocks.iter().zip(first as u32..) {
        for same in block.nodes.chunk_by(|&a, &b| a as usize / RANGE == b as usize / RANGE) {
            ranges[same[0] as usize / RANGE].push(number);
        }
    }
}
