//! The numbers of the active nodes in the boxes of the blocks.

use super::block::Block;
use crate::grid::{Grid, TILE, tile_edge};
use crate::nodes::{Nodes, bits};
use crate::parallel;

/// The part of a row of a box, along x, that lies in one tile of nodes.
struct Part {
    /// The number of the tile.
    tile: u64,
    /// The first node of the part in the tile, and its place in the box.
    node: u64,
    place: usize,
    /// The active nodes, as bits from the first node on.
    active: u64,
}

/// The parts of all rows of a box, tile by tile.
fn parts<const D: usize>(grid: &Grid<D>, block: &Block) -> Vec<Part> {
    let (edge, low) = (tile_edge(D) as usize, block.origin.map(|k| k as usize));
    let high: [usize; 3] = std::array::from_fn(|k| low[k] + block.size[k]);
    let tiles = |k: usize| low[k] / edge..high[k].div_ceil(edge);
    let within = |k: usize, tile: usize| low[k].max(tile * edge)..high[k].min((tile + 1) * edge);
    let mut parts = Vec::new();
    for tile in tiles(2).flat_map(|z| tiles(1).flat_map(move |y| tiles(0).map(move |x| [x, y, z]))) {
        let x = within(0, tile[0]);
        for (z, y) in within(2, tile[2]).flat_map(|z| within(1, tile[1]).map(move |y| (z, y))) {
            let row = (z - low[2]) * block.size[1] + y - low[1];
            let in_tile = u64::MAX >> (u64::BITS as usize - x.len());
            let active = block.active[row] >> (x.start - low[0]) & in_tile;
            if active != 0 {
                let at = [x.start, y, z];
                let id = grid.id_in(block.field, std::array::from_fn(|k| at[k] as u32));
                let place = row * block.size[0] + x.start - low[0];
                parts.push(Part { tile: id / TILE, node: id % TILE, place, active });
            }
        }
    }
    parts
}

/// Numbers the active nodes in the order of the grid, and tells each block the numbers in its box.
pub(super) fn number<const D: usize>(grid: &Grid<D>, blocks: &mut [Block]) -> Nodes {
    let tiles = parallel::map(blocks.len(), &|b| {
        let parts = parts(grid, &blocks[b]);
        let tile = |same: &[Part]| (same[0].tile, same.iter().fold(0, |all, part| all | part.active << part.node));
        parts.chunk_by(|one, next| one.tile == next.tile).map(tile).collect::<Vec<_>>()
    });
    let nodes = Nodes::of_tiles(tiles.concat());
    parallel::for_each(blocks.iter_mut(), &|block: &mut Block| {
        let parts = parts(grid, block);
        block.nodes.clear();
        block.places.clear();
        for same in parts.chunk_by(|one, next| one.tile == next.tile) {
            let number = nodes.numbers_in(same[0].tile);
            for Part { node, place, active, .. } in same {
                block.nodes.extend(bits(*active).map(|k| number(node + k)));
                block.places.extend(bits(*active).map(|k| (place + k as usize) as u32));
            }
        }
    });
    nodes
}
