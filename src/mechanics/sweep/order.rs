//! The order of particles in the tiled sweep: by block of cells, by cell, by number.

use crate::grid::Grid;
use crate::parallel;
use crate::tensor::Vector;

/// Edge of a block in cells: in 3D its box of nodes, gathered and scattered, stays in the first-level cache.
const fn edge(dimension: usize) -> u64 {
    match dimension {
        1 => 32,
        2 => 16,
        _ => 4,
    }
}

/// Particles whose cells are found in one go.
const RUN: usize = 4096;

/// A particle and its place: (block · cells of a block + cell in the block, particle).
pub(super) type Key = (u64, u32);

/// All particles by block, cell and number; the particle of the smallest number that lies in no cell, if there is one.
pub(super) fn sorted<const D: usize>(grid: &Grid<D>, positions: &[Vector<f64, D>]) -> Result<Vec<Key>, usize> {
    let edge = edge(D);
    let blocks: [u64; D] = std::array::from_fn(|k| u64::from(grid.cells[k]).div_ceil(edge));
    let key = |p: usize| {
        let cell = grid.cell(&positions[p])?;
        let (mut block, mut local) = (0, 0);
        for k in (0..D).rev() {
            let at = u64::from(cell[k]);
            block = block * blocks[k] + at / edge;
            local = local * edge + at % edge;
        }
        Some((block * cells::<D>() + local, p as u32))
    };
    let mut keys: Vec<Key> = vec![(0, 0); positions.len()];
    parallel::for_each(keys.chunks_mut(RUN).enumerate(), |(run, keys)| {
        for (p, slot) in (run * RUN..).zip(keys) {
            *slot = key(p).unwrap_or((u64::MAX, p as u32));
        }
    });
    if keys.windows(2).any(|pair| pair[0] > pair[1]) {
        parallel::sort(&mut keys);
    }
    // Particles in no cell come last, by number.
    let outside = keys.partition_point(|key| key.0 < u64::MAX);
    match keys.get(outside) {
        Some(&(_, p)) => Err(p as usize),
        None => Ok(keys),
    }
}

/// Cells of a block.
const fn cells<const D: usize>() -> u64 {
    edge(D).pow(D as u32)
}

/// The block of a key.
pub(super) fn block<const D: usize>(key: &Key) -> u64 {
    key.0 / cells::<D>()
}

/// Whether `next` is the cell after `cell` along x in the same row of a block.
pub(super) fn follows<const D: usize>(cell: &Key, next: &Key) -> bool {
    next.0 == cell.0 + 1 && !next.0.is_multiple_of(edge(D))
}
