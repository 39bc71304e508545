//! The set-up of [`Tiled`](super::tiled::Tiled): the shape functions and groups of each block, and the numbers of the active nodes.

use super::block::{Block, Groups, Span};
use super::columns::{Along, Columns, Family};
use super::kernel::WIDEST_TILE;
use super::order::{Key, follows};
use super::points::Points;
use crate::approximation::ApproximationError;
use crate::grid::Grid;
use crate::lanes::LANES;
use crate::nodes::Nodes;
use std::ops::Range;

/// Working memory of one thread.
#[derive(Default)]
pub(super) struct Scratch {
    /// The particles of a block along each axis.
    along: [Along; 3],
    /// The shape functions of a group along each axis.
    columns: [Columns; 3],
    /// Groups and their windows.
    groups: Vec<(Range<usize>, [[u32; 2]; 3])>,
}

/// The block of the particles `keys`. The number of its first group and its node numbers are filled in later. The arrays of `spare` are
/// reused.
///
/// # Errors
/// The error of the shape functions of one of the particles.
pub(super) fn block<const D: usize>(
    family: Family<'_>,
    grid: &Grid<D>,
    points: &Points<'_, D>,
    keys: &[Key],
    spare: Block,
    scratch: &mut Scratch,
) -> Result<Block, ApproximationError> {
    let (mut size, mut origin) = ([1; 3], [0; 3]);
    for (k, along) in scratch.along.iter_mut().enumerate().take(D) {
        along.x.clear();
        along.x.extend(keys.iter().map(|key| points.positions[key.particle as usize][k]));
        along.continue_by(k, keys, points);
        family.spans(&grid.axis(k), along)?;
        let [low, high] = union(&along.spans);
        size[k] = (high - low) as usize;
        origin[k] = low;
    }
    let Block { groups, mut nodes, mut places, mut active, .. } = spare;
    active.clear();
    active.resize(size[1] * size[2], 0);
    let building = Building { family, grid, keys, origin, size };
    let groups = building.groups(groups, scratch, &mut active)?;
    nodes.clear();
    places.clear();
    Ok(Block { groups, origin, size, nodes, places, active })
}

/// The smallest interval that holds all `spans`.
#[inline(always)]
fn union(spans: &[[u32; 2]]) -> [u32; 2] {
    spans.iter().fold([u32::MAX, 0], |[low, high], span| [low.min(span[0]), high.max(span[1])])
}

/// A block under construction.
struct Building<'a, const D: usize> {
    family: Family<'a>,
    grid: &'a Grid<D>,
    keys: &'a [Key],
    origin: [u32; 3],
    size: [usize; 3],
}

impl<const D: usize> Building<'_, D> {
    /// The groups of the particles, in the arrays of `spare`. Marks the nodes with nonzero shape functions in `active`.
    fn groups(&self, spare: Groups, scratch: &mut Scratch, active: &mut [u64]) -> Result<Groups, ApproximationError> {
        let mut built = spare.emptied(D, self.size);
        let mut groups = std::mem::take(&mut scratch.groups);
        groups.clear();
        let (mut start, mut rows) = (0, 0);
        while start < self.keys.len() {
            let end = group_end::<D>(self.keys, &scratch.along[0].spans, start);
            let mut windows = [[0; 2]; 3];
            for (window, along) in windows.iter_mut().zip(&scratch.along).take(D) {
                *window = union(&along.spans[start..end]);
                rows += 2 * (window[1] - window[0]) as usize;
            }
            groups.push((start..end, windows));
            start = end;
        }
        built.windows.reserve_exact(groups.len());
        built.particles.reserve_exact(groups.len());
        built.weights.reserve_exact(rows);
        // `spare` may have been a much denser block.
        built.windows.shrink_to(2 * groups.len());
        built.particles.shrink_to(2 * groups.len());
        built.weights.shrink_to(2 * rows);
        for (particles, windows) in &groups {
            self.push(&mut built, particles.clone(), windows, scratch, active)?;
        }
        scratch.groups = groups;
        Ok(built)
    }

    /// Appends a group.
    fn push(
        &self,
        groups: &mut Groups,
        particles: Range<usize>,
        windows: &[[u32; 2]; 3],
        scratch: &mut Scratch,
        active: &mut [u64],
    ) -> Result<(), ApproximationError> {
        let (keys, Scratch { along, columns, .. }) = (&self.keys[particles.clone()], scratch);
        for k in 0..D {
            self.family.columns(&self.grid.axis(k), &mut along[k], particles.clone(), &mut columns[k])?;
        }
        let mut width = [1; 3];
        let mut first = 0;
        for k in (0..D).rev() {
            width[k] = (windows[k][1] - windows[k][0]) as u8;
            first = first * self.size[k] + (windows[k][0] - self.origin[k]) as usize;
        }
        let group = Span { weights: groups.weights.len() as u32, first: first as u32, width, lanes: keys.len() as u8 };
        for k in 0..D {
            let (start, nodes) = (groups.weights.len(), usize::from(width[k]));
            groups.weights.resize(start + 2 * nodes, [0.0; LANES]);
            let (values, derivatives) = groups.weights[start..].split_at_mut(nodes);
            columns[k].write(keys.len(), windows[k][0], values, derivatives);
        }
        groups.particles.push(std::array::from_fn(|lane| keys.get(lane).map_or(u32::MAX, |key| key.particle)));
        groups.windows.push(group);
        self.mark(groups, &columns[..D], keys.len(), active);
        Ok(())
    }

    /// Marks the nodes with N ≠ 0 or ∇N ≠ 0 of the first `count` lanes of the last group.
    fn mark(&self, groups: &Groups, columns: &[Columns], count: usize, active: &mut [u64]) {
        let nx = self.size[0];
        for lane in 0..count {
            let (mut begin, mut end) = ([0; 3], [1; 3]);
            for k in 0..D {
                [begin[k], end[k]] = columns[k].spans[lane].map(|node| (node - self.origin[k]) as usize);
            }
            // No N vanishes or underflows, so all nodes of the particle's own window are active.
            let whole = columns.iter().map(|columns| columns.smallest[lane]).product::<f64>() > 0.0;
            if !whole {
                groups.entries::<D>(groups.len() - 1, lane, |place, _, _| active[place / nx] |= 1 << (place % nx));
                continue;
            }
            let row = ((1 << (end[0] - begin[0])) - 1) << begin[0];
            for z in begin[2]..end[2] {
                for y in begin[1]..end[1] {
                    active[z * self.size[1] + y] |= row;
                }
            }
        }
    }
}

/// The end of the group that begins at `start`. A group takes as many particles of one cell as there are lanes. Or it takes whole
/// neighbouring cells along x, while their particles fit into the lanes and their window is not too wide.
fn group_end<const D: usize>(keys: &[Key], along_x: &[[u32; 2]], start: usize) -> usize {
    // Counting stops behind the last lane, since a cell may hold very many particles.
    let cell_end =
        |from: usize| from + keys[from..].iter().take(LANES + 1).take_while(|key| key.cell == keys[from].cell).count();
    let mut end = cell_end(start);
    if end - start > LANES {
        return start + LANES;
    }
    while end < keys.len() && follows::<D>(&keys[end - 1], &keys[end]) {
        let next = cell_end(end);
        if next - start > LANES {
            break;
        }
        let [low, high] = union(&along_x[start..next]);
        if (high - low) as usize > WIDEST_TILE {
            break;
        }
        end = next;
    }
    end
}

/// A row of a box along x.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// Grid number of the node with index 0 along x in its line.
    start: u64,
    /// Index along x of its first node.
    x: usize,
    block: usize,
    /// The place of its first node in the box.
    place: usize,
    /// Its active nodes, as a bit set.
    active: u64,
}

impl Row {
    /// The active nodes, counted from the first node of the row.
    fn nodes(&self) -> impl Iterator<Item = usize> + use<> {
        let mut left = self.active;
        std::iter::from_fn(move || {
            let next = (left != 0).then(|| left.trailing_zeros() as usize);
            left &= left.wrapping_sub(1);
            next
        })
    }

    /// Index along x of the node behind the last active one.
    fn end(&self) -> usize {
        self.x + (u64::BITS - self.active.leading_zeros()) as usize
    }
}

/// Numbers the active nodes in the order of the grid, and tells each block the numbers in its box. The arrays `rows` and `ids` are reused.
pub(super) fn number<const D: usize>(
    grid: &Grid<D>,
    blocks: &mut [Block],
    rows: &mut Vec<Row>,
    mut ids: Vec<u64>,
) -> Nodes {
    rows.clear();
    rows.reserve(blocks.iter().map(|block| block.active.len()).sum());
    for (b, block) in blocks.iter().enumerate() {
        let [nx, ny, nz] = block.size;
        for z in 0..nz {
            for y in 0..ny {
                let mut index: [u32; D] = std::array::from_fn(|k| block.origin[k] + [0, y, z][k] as u32);
                let x = index[0] as usize;
                index[0] = 0;
                let place = (z * ny + y) * nx;
                rows.push(Row { start: grid.id(index), x, block: b, place, active: block.active[z * ny + y] });
            }
        }
    }
    rows.sort_unstable_by_key(|row| (row.start, row.x, row.block));
    ids.clear();
    let mut numbers: Vec<u32> = Vec::new();
    // Overlapping or adjacent rows of one line are numbered together. A gap between two bodies splits a line, so empty space costs nothing.
    let mut reach = 0;
    let together = |row: &Row, next: &Row| {
        reach = row.end().max(reach);
        let together = next.start == row.start && next.x <= reach;
        reach = if together { reach } else { 0 };
        together
    };
    for same in rows.chunk_by(together) {
        let low = same[0].x;
        numbers.clear();
        for row in same {
            numbers.resize(numbers.len().max(row.end() - low), u32::MAX);
            row.nodes().for_each(|node| numbers[row.x - low + node] = 0);
        }
        for (x, number) in numbers.iter_mut().enumerate().filter(|(_, number)| **number == 0) {
            *number = ids.len() as u32;
            ids.push(same[0].start + (low + x) as u64);
        }
        for row in same {
            let block = &mut blocks[row.block];
            for node in row.nodes() {
                block.nodes.push(numbers[row.x - low + node]);
                block.places.push((row.place + node) as u32);
            }
        }
    }
    Nodes::ascending(ids)
}
