//! The order of particles in [`Tiled`](super::tiled::Tiled): by nodal field, then by block of cells, then by cell, then by id.

use super::points::Points;
use crate::grid::Grid;
use crate::parallel::{self, PART};

/// Edge of a block in cells. In 3D the nodal values that a block gathers and scatters then stay in the first-level cache.
const fn edge(dimension: usize) -> u64 {
    match dimension {
        1 => 32,
        2 => 16,
        _ => 4,
    }
}

/// A particle and its cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Key {
    /// (field · blocks + block) · cells of a block + cell in the block
    pub(super) cell: u64,
    pub(super) id: u32,
    /// Its index in memory.
    pub(super) particle: u32,
}

/// All particles, sorted by field, block, cell and id. Without ids the index in memory is the id. `keys` may come from the last step: the
/// nearer they are to the new order, the less work the sorting is.
///
/// # Errors
/// The index of the particle with the smallest id that lies in no cell.
pub(super) fn sorted<const D: usize>(
    grid: &Grid<D>,
    Points { positions, ids, fields, .. }: &Points<'_, D>,
    mut keys: Vec<Key>,
) -> Result<Vec<Key>, usize> {
    let edge = edge(D);
    let blocks: [u64; D] = std::array::from_fn(|k| u64::from(grid.cells[k]).div_ceil(edge));
    let place = |p: u32| {
        let cell = grid.cell(&positions[p as usize])?;
        let (mut block, mut local) = (u64::from(fields.field(p as usize)), 0);
        for k in (0..D).rev() {
            let at = u64::from(cell[k]);
            block = block * blocks[k] + at / edge;
            local = local * edge + at % edge;
        }
        Some(block * cells::<D>() + local)
    };
    let key_of = |particle: u32| {
        let (cell, id) = (place(particle).unwrap_or(u64::MAX), ids.map_or(particle, |ids| ids[particle as usize]));
        Key { cell, id, particle }
    };
    match keys.len() == positions.len() {
        true => parallel::each_by(PART, &mut keys, |_, key| *key = key_of(key.particle)),
        false => keys = parallel::values_by(PART, positions.len(), |p| key_of(p as u32)),
    }
    sort(&mut keys);
    // Particles in no cell come last, by id.
    let outside = keys.partition_point(|key| key.cell < u64::MAX);
    match keys.get(outside) {
        Some(key) => Err(key.particle as usize),
        None => Ok(keys),
    }
}

/// After this many dropped keys in a row, keys kept before them are taken to be out of order instead.
const RECENT: usize = 8;

/// Sorts keys most of which may be in order already. Keys out of order are taken out, sorted, and merged into the rest
/// ("drop-merge sort").
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
            // Take the dropped keys back, and drop the kept keys that are larger than all of them.
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
    // From the back, so that a kept key is read before it is written over.
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

/// Number of cells in a block.
const fn cells<const D: usize>() -> u64 {
    edge(D).pow(D as u32)
}

/// The block of a key.
pub(super) fn block<const D: usize>(key: &Key) -> u64 {
    key.cell / cells::<D>()
}

/// Whether the cell of `next` follows that of `cell` along x, in the same row of a block.
pub(super) fn follows<const D: usize>(cell: &Key, next: &Key) -> bool {
    next.cell == cell.cell + 1 && !next.cell.is_multiple_of(edge(D))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sorting_needs_no_order_and_uses_any() {
        let number = |i: u64| i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
        let orders: [&dyn Fn(u64) -> u64; 7] = [
            &|i| i,
            &|i| 1000 - i,
            &number,
            // One key far too large at the beginning, then every tenth key out of place.
            &|i| if i == 0 { 5000 } else { i },
            &|i| if i % 10 == 3 { number(i) % 1000 } else { i },
            &|i| if i == 2 || i == 3 { 2000 + i } else { i },
            &|i| (i * 7) % 1001,
        ];
        for order in orders {
            for count in [0, 1, 2, 3, 1000] {
                let key = |i: u64| Key { cell: order(i), id: i as u32, particle: 0 };
                let mut keys: Vec<Key> = (0..count).map(key).collect();
                let mut expected = keys.clone();
                expected.sort_unstable();
                sort(&mut keys);
                assert_eq!(keys, expected);
            }
        }
    }
}
