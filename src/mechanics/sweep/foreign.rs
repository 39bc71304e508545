//! The blocks of other processes. A process knows which particles they hold. Their shape functions are evaluated only where they are asked for,
//! such as at a point in contact.

use super::block::Block;
use super::builder::{Builder, Scratch};
use super::columns::Family;
use super::order::Key;
use super::points::Points;
use crate::approximation::ShapeFunction;
use crate::grid::Grid;
use std::fmt::{self, Debug};
use std::sync::OnceLock;

/// `(particles, block)`: makes the block.
type Build = dyn Fn(&[Key], &mut Block) + Send + Sync;

/// The blocks of other processes, made when they are asked for.
pub(super) struct Foreign {
    build: Box<Build>,
    blocks: Vec<OnceLock<Block>>,
}

impl Debug for Foreign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Foreign").finish_non_exhaustive()
    }
}

impl Foreign {
    /// Keeps the positions of the particles `keys`, on which shape functions depend. The positions lie in the order of the keys, because the step may
    /// move particles in memory.
    pub(super) fn new<A: ShapeFunction, const D: usize>(
        approximation: &A,
        grid: &Grid<D>,
        points: &Points<'_, D>,
        keys: &[Key],
        blocks: usize,
    ) -> Self {
        let (approximation, grid) = (approximation.clone(), *grid);
        let positions: Vec<_> = keys.iter().map(|key| points.positions[key.particle as usize]).collect();
        let of = |(key, place): (&Key, u32)| Some((place, *points.extrapolation.get(&key.particle)?));
        let surface = keys.iter().zip(0..).filter(|_| !points.extrapolation.is_empty());
        let points = Points::<'static, D> {
            positions: positions.into(),
            extrapolation: surface.filter_map(of).collect(),
            ..Points::default()
        };
        let build = move |keys: &[Key], block: &mut Block| {
            let Some(product) = approximation.separable() else { return };
            let builder = Builder { family: Family::new(product), grid: &grid, points: &points };
            // The process of the block has evaluated these functions before, without an error.
            let _ = builder.build(keys, block, &mut Scratch::default());
        };
        Self { build: Box::new(build), blocks: (0..blocks).map(|_| OnceLock::new()).collect() }
    }

    /// The block with this number and these particles. `known` is the same block without shape functions.
    pub(super) fn block(&self, number: usize, keys: &[Key], known: &Block) -> &Block {
        self.blocks[number].get_or_init(|| {
            let mut block = Block::default();
            let place = |(key, place): (&Key, u32)| Key { particle: place, ..*key };
            let keys: Vec<Key> = keys.iter().zip(known.start..).map(place).collect();
            (self.build)(&keys, &mut block);
            Block { field: known.field, first: known.first, ..block }
        })
    }
}
