//! The shape functions of all particles for products N = Π_k N_k. Only the weights of each axis are stored, and the particles of a cell lie
//! side by side in vector lanes.
//!
//! Particles are taken in the order (cell, id). [Groups and blocks](super) are defined on the page of the module.

use super::block::{Block, Group};
use super::builder::{Builder, Row, number};
use super::columns::Family;
use super::order::{self, Key};
use super::points::{Points, SupportError};
use crate::approximation::{ApproximationError, Scratch, Separable, ShapeFunction, Support};
use crate::grid::Grid;
use crate::lanes::LANES;
use crate::nodes::Nodes;
use crate::parallel;
use crate::parallel::First;
use crate::tensor::Vector;

/// The shape functions of all particles, by axis.
#[derive(Debug, Default)]
pub(super) struct Tiled<const D: usize> {
    pub(super) blocks: Vec<Block>,
    /// Slot of each particle: group · 8 + lane.
    slots: Vec<u32>,
    /// The particles in their order.
    keys: Vec<Key>,
    /// Rows and nodes of the last numbering, whose memory the next step reuses.
    rows: Vec<Row>,
    nodes: Nodes,
}

impl<const D: usize> Tiled<D> {
    /// [`super::Supports::new`] for a shape function that is a product. The arrays and the particle order of `spare` are reused.
    pub(super) fn new<A: ShapeFunction>(
        approximation: &A,
        product: &dyn Separable,
        grid: &Grid<D>,
        points: &Points<'_, D>,
        spare: Option<Self>,
    ) -> Result<(Self, Nodes), SupportError> {
        let positions = &*points.positions;
        // Threads meet errors in any order. So the particle with the smallest id is searched, with the error for its whole position.
        let failure = |particle: usize, source: ApproximationError| {
            let (mut scratch, mut support) = (Scratch::default(), Support::default());
            let mut error = |x: &Vector<f64, D>| approximation.evaluate(grid, x, &mut scratch, &mut support).err();
            let failing = positions.iter().enumerate().filter_map(|(p, x)| Some((points.id(p), error(x)?)));
            let (particle, source) = failing.min_by_key(|&(id, _)| id).unwrap_or((points.id(particle), source));
            SupportError { particle, source }
        };
        let Self { mut blocks, mut slots, keys, mut rows, nodes } = spare.unwrap_or_default();
        let keys = order::sorted(grid, points, keys).map_err(|particle| {
            let outside = ApproximationError::Outside { position: Vec::new(), lower: Vec::new(), upper: Vec::new() };
            failure(particle, outside)
        })?;
        let runs = || keys.chunk_by(|a, b| order::block::<D>(a) == order::block::<D>(b));
        blocks.resize_with(runs().count(), Block::default);
        let (builder, failed) = (Builder { family: Family::new(product), grid, points }, First::none());
        parallel::for_each_with(blocks.iter_mut().zip(runs()), &|scratch, (block, keys)| {
            if let Err(error) = builder.build(keys, block, scratch) {
                failed.keep(keys[0].particle as usize, (keys[0].particle as usize, error));
            }
        });
        failed.check().map_err(|(particle, error)| failure(particle, error))?;
        let mut first = 0;
        for block in &mut blocks {
            block.first = first;
            first += block.len();
        }
        let nodes = number(grid, &mut blocks, &mut rows, nodes.into_spare());
        slots.resize(positions.len(), 0);
        for block in &blocks {
            for group in (0..block.len()).map(|group| block.group(group)) {
                for (lane, &p) in group.particles.iter().enumerate() {
                    slots[p as usize] = (group.number * LANES + lane) as u32;
                }
            }
        }
        Ok((Self { blocks, slots, keys, rows, nodes: nodes.clone() }, nodes))
    }

    pub(super) fn particles(&self) -> usize {
        self.slots.len()
    }

    /// The particles, block by block and group by group.
    pub(super) fn order(&self) -> impl Iterator<Item = u32> {
        self.keys.iter().map(|key| key.particle)
    }

    /// Renumbers the particles as if they lay in memory in [`Self::order`]. The next step sorts from there.
    pub(super) fn rearrange(&mut self) {
        self.keys.iter_mut().zip(0..).for_each(|(key, place)| key.particle = place);
    }

    pub(super) fn each_group(&self, visit: &mut dyn FnMut(Group<'_>)) {
        for block in &self.blocks {
            (0..block.len()).for_each(|group| visit(block.group(group)));
        }
    }

    pub(super) fn groups(&self) -> usize {
        self.blocks.last().map_or(0, |last| last.first + last.len())
    }

    pub(super) fn windows(&self) -> Vec<([usize; 3], usize)> {
        let groups = self.blocks.iter().flat_map(|block| &block.windows);
        groups.map(|group| (group.width.map(usize::from), usize::from(group.lanes))).collect()
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.slots.as_slice()) + self.blocks.iter().map(Block::bytes).sum::<usize>()
    }

    pub(super) fn of(&self, particle: usize) -> Vec<(usize, f64, Vector<f64, D>)> {
        let slot = self.slots[particle] as usize;
        let (group, lane) = (slot / LANES, slot % LANES);
        let block = &self.blocks[self.blocks.partition_point(|block| block.first <= group) - 1];
        let active = |(place, n, grad_n): (usize, f64, _)| {
            let at = block.places.binary_search(&(place as u32)).ok()?;
            Some((block.nodes[at] as usize, n, grad_n))
        };
        block.entries::<D>(group - block.first, lane).filter_map(active).collect()
    }
}
