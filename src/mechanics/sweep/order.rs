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

/// All particles by block, cell and number; the particle of the smallest number that lies in no cell, if there is one. Particles
/// come in the order `before`, if there is one for as many, such as that of the last step: the nearer it is, the sooner they are sorted.
pub(super) fn sorted<const D: usize>(
    grid: &Grid<D>,
    positions: &[Vector<f64, D>],
    before: Option<impl Iterator<Item = u32>>,
) -> Result<Vec<Key>, usize> {
    let edge = edge(D);
    let blocks: [u64; D] = std::array::from_fn(|k| u64::from(grid.cells[k]).div_ceil(edge));
    let key = |p: u32| {
        let cell = grid.cell(&positions[p as usize])?;
        let (mut block, mut local) = (0, 0);
        for k in (0..D).rev() {
            let at = u64::from(cell[k]);
            block = block * blocks[k] + at / edge;
            local = local * edge + at % edge;
        }
        Some(block * cells::<D>() + local)
    };
    let mut keys: Vec<Key> = match before {
        Some(order) => order.map(|p| (0, p)).collect(),
        None => (0..positions.len() as u32).map(|p| (0, p)).collect(),
    };
    parallel::for_each(keys.chunks_mut(RUN), |keys| {
        for (cell, p) in keys {
            *cell = key(*p).unwrap_or(u64::MAX);
        }
    });
    sort(&mut keys);
    // Particles in no cell come last, by number.
    let outside = keys.partition_point(|key| key.0 < u64::MAX);
    match keys.get(outside) {
        Some(&(_, p)) => Err(p as usize),
        None => Ok(keys),
    }
}

/// Keys dropped one after the other that tell that not they are out of order, but some that were kept.
const RECENT: usize = 8;

/// Sorts keys most of which may be in order: those that are not are taken out, sorted, and merged into the rest ("drop-merge sort").
fn sort(keys: &mut [Key]) {
    let (mut kept, mut dropped, mut in_row) = (0, Vec::new(), 0);
    let mut i = 0;
    while i < keys.len() {
        let key = keys[i];
        i += 1;
        if kept == 0 || keys[kept - 1] < key {
            keys[kept] = key;
            kept += 1;
            in_row = 0;
            continue;
        }
        dropped.push(key);
        in_row += 1;
        if in_row == RECENT {
            // Take them back, and drop what is larger than all of them.
            let last = dropped.split_off(dropped.len() - RECENT);
            let largest = last.into_iter().fold(key, Key::max);
            while kept > 0 && keys[kept - 1] > largest {
                kept -= 1;
                dropped.push(keys[kept]);
            }
            i -= RECENT;
            in_row = 0;
        }
    }
    parallel::sort(&mut dropped);
    // From the back, so that what was kept is read before it is written over.
    for to in (0..keys.len()).rev() {
        let Some(&last) = dropped.last() else { break };
        keys[to] = if kept > 0 && keys[kept - 1] > last {
            kept -= 1;
            keys[kept]
        } else {
            dropped.pop();
            last
        };
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sorting_needs_no_order_and_uses_any() {
        let number = |i: u64| (i * 0x9e37_79b9_7f4a_7c15) >> 40;
        let orders: [&dyn Fn(u64) -> u64; 7] = [
            &|i| i,
            &|i| 1000 - i,
            &number,
            // One far too large at the beginning, and every tenth out of its place.
            &|i| if i == 0 { 5000 } else { i },
            &|i| if i % 10 == 3 { number(i) % 1000 } else { i },
            &|i| if i == 2 || i == 3 { 2000 + i } else { i },
            &|i| (i * 7) % 1001,
        ];
        for order in orders {
            for count in [0, 1, 2, 3, 1000] {
                let mut keys: Vec<Key> = (0..count).map(|i| (order(i), i as u32)).collect();
                let mut expected = keys.clone();
                expected.sort_unstable();
                sort(&mut keys);
                assert_eq!(keys, expected);
            }
        }
    }
}
