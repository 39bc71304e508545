//! The numbers of the active nodes in the boxes of the blocks.

use super::block::{Block, NONE};
use crate::grid::{BRICK, Grid, brick_edge};
use crate::parallel::{self, Processes};
use crate::space::{Nodes, bits};
use std::ops::Range;

/// The part of a row of a box, along x, that lies in one brick of nodes.
struct Part {
    /// The number of the brick.
    brick: u64,
    /// The first node of the part in the brick, and its place in the box.
    node: u64,
    place: usize,
    /// The active nodes, as bits from the first node on.
    active: u64,
}

/// The parts of all rows of a box, brick by brick.
fn parts<const D: usize>(grid: &Grid<D>, block: &Block) -> impl Iterator<Item = Part> {
    let (edge, low) = (brick_edge(D) as usize, block.origin.map(|k| k as usize));
    let high: [usize; 3] = std::array::from_fn(|k| low[k] + block.size[k]);
    let bricks = move |k: usize| low[k] / edge..high[k].div_ceil(edge);
    let within = move |k: usize, brick: usize| low[k].max(brick * edge)..high[k].min((brick + 1) * edge);
    let rows = move |[bx, by, bz]: [usize; 3]| {
        within(2, bz).flat_map(move |z| within(1, by).map(move |y| (within(0, bx), y, z)))
    };
    let part = move |(x, y, z): (Range<usize>, usize, usize)| {
        let row = (z - low[2]) * block.size[1] + y - low[1];
        let active = block.active[row] >> (x.start - low[0]) & (u64::MAX >> (u64::BITS as usize - x.len()));
        let at = [x.start, y, z];
        let id = grid.id_in(block.field, std::array::from_fn(|k| at[k] as u32));
        let place = row * block.size[0] + x.start - low[0];
        (active != 0).then_some(Part { brick: id / BRICK, node: id % BRICK, place, active })
    };
    let bricks = bricks(2).flat_map(move |z| bricks(1).flat_map(move |y| bricks(0).map(move |x| [x, y, z])));
    bricks.flat_map(rows).filter_map(part)
}

/// The bricks of a block, each with bits for its active nodes.
fn bricks<const D: usize>(grid: &Grid<D>, block: &Block) -> Vec<[u64; 2]> {
    let mut bricks: Vec<[u64; 2]> = Vec::new();
    for Part { brick, node, active, .. } in parts(grid, block) {
        match bricks.last_mut() {
            Some([last, all]) if *last == brick => *all |= active << node,
            _ => bricks.push([brick, active << node]),
        }
    }
    bricks
}

/// Numbers the active nodes of all processes in the order of the grid, and tells each block of this process the numbers in its box.
pub(super) fn number<const D: usize>(grid: &Grid<D>, blocks: &mut [Block], processes: &Processes) -> Nodes {
    let own = parallel::map(blocks.len(), &|b| bricks(grid, &blocks[b])).concat();
    let (all, _) = processes.joined(own);
    let nodes = Nodes::of_bricks(all);
    parallel::for_each(blocks.iter_mut(), &|block: &mut Block| {
        let [mut numbers, mut places, mut table] =
            [&mut block.nodes, &mut block.places, &mut block.numbers].map(std::mem::take);
        [&mut numbers, &mut places, &mut table].into_iter().for_each(Vec::clear);
        table.resize(block.box_nodes(), NONE);
        for Part { brick, node, place, active } in parts(grid, block) {
            let number = nodes.numbers_in(brick);
            for k in bits(active) {
                let (number, place) = (number(node + k), place + k as usize);
                numbers.push(number);
                places.push(place as u32);
                table[place] = number;
            }
        }
        (block.nodes, block.places, block.numbers) = (numbers, places, table);
    });
    nodes
}
