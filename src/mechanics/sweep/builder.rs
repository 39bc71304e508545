//! The set-up of [`Tiled`](super::tiled::Tiled): the shape functions and groups of each block.

use super::block::{Block, Span};
use super::columns::{Along, Columns, Family};
use super::kernel::WIDEST_TILE;
use super::order::{Key, follows};
use super::points::Points;
use crate::approximation::ApproximationError;
use crate::grid::Grid;
use crate::lanes::LANES;

/// Working memory of one thread.
#[derive(Default)]
pub(super) struct Scratch {
    /// The particles of a block along each axis.
    along: [Along; 3],
    /// The shape functions of a group along each axis.
    columns: [Columns; 3],
}

/// The smallest interval that holds all `spans`.
#[inline(always)]
fn union(spans: &[[u32; 2]]) -> [u32; 2] {
    spans.iter().fold([u32::MAX, 0], |[low, high], span| [low.min(span[0]), high.max(span[1])])
}

/// The data from which blocks are built.
pub(super) struct Builder<'a, const D: usize> {
    pub(super) family: Family<'a>,
    pub(super) grid: &'a Grid<D>,
    pub(super) points: &'a Points<'a, D>,
}

impl<const D: usize> Builder<'_, D> {
    /// Makes `block` the block of the particles `keys`, in the arrays that it has. The number of its first group and its node numbers are
    /// filled in later.
    ///
    /// # Errors
    /// The error of the shape functions of one of the particles.
    pub(super) fn build(
        &self,
        keys: &[Key],
        block: &mut Block,
        scratch: &mut Scratch,
    ) -> Result<(), ApproximationError> {
        (block.origin, block.size) = ([0; 3], [1; 3]);
        block.field = keys.first().map_or(0, |key| self.points.fields.field(key.particle as usize));
        for (k, along) in scratch.along.iter_mut().enumerate().take(D) {
            along.x.clear();
            along.x.extend(keys.iter().map(|key| self.points.positions[key.particle as usize][k]));
            along.set_extrapolation(k, keys, self.points);
            self.family.spans(&self.grid.axis(k), along)?;
            let [low, high] = union(&along.spans);
            block.size[k] = (high - low) as usize;
            block.origin[k] = low;
        }
        self.group(keys, block, &scratch.along);
        block.active.clear();
        block.active.resize(block.size[1] * block.size[2], 0);
        let mut start = 0;
        for group in 0..block.len() {
            let end = start + usize::from(block.windows[group].lanes);
            for k in 0..D {
                self.family.columns(&self.grid.axis(k), &mut scratch.along[k], start..end, &mut scratch.columns[k])?;
            }
            write(block, group, &scratch.columns[..D]);
            mark::<D>(block, group, &scratch.columns);
            start = end;
        }
        Ok(())
    }

    /// Groups the particles, and makes room for their weights, which are zero.
    fn group(&self, keys: &[Key], block: &mut Block, along: &[Along; 3]) {
        block.windows.clear();
        block.particles.clear();
        let (mut start, mut rows) = (0, 0);
        while start < keys.len() {
            let end = group_end::<D>(keys, &along[0].spans, start);
            let (mut width, mut first, weights) = ([1; 3], 0, rows as u32);
            for k in (0..D).rev() {
                let [low, high] = union(&along[k].spans[start..end]);
                width[k] = (high - low) as u8;
                first = first * block.size[k] + (low - block.origin[k]) as usize;
                rows += 2 * usize::from(width[k]);
            }
            let keys = &keys[start..end];
            block.windows.push(Span { weights, first: first as u32, width, lanes: keys.len() as u8 });
            block.particles.push(std::array::from_fn(|lane| keys.get(lane).map_or(u32::MAX, |key| key.particle)));
            start = end;
        }
        block.weights.clear();
        block.weights.reserve_exact(rows);
        block.weights.resize(rows, [0.0; LANES]);
        // The arrays may come from a much denser block.
        block.windows.shrink_to(2 * block.windows.len());
        block.particles.shrink_to(2 * block.particles.len());
        block.weights.shrink_to(2 * rows);
    }
}

/// Writes the weights of a group.
fn write(block: &mut Block, group: usize, columns: &[Columns]) {
    let Span { weights, first, width, lanes } = block.windows[group];
    let (mut start, mut place) = (weights as usize, first as usize);
    for (k, columns) in columns.iter().enumerate() {
        let low = block.origin[k] + (place % block.size[k]) as u32;
        place /= block.size[k];
        let nodes = usize::from(width[k]);
        let (values, derivatives) = block.weights[start..start + 2 * nodes].split_at_mut(nodes);
        columns.write(usize::from(lanes), low, values, derivatives);
        start += 2 * nodes;
    }
}

/// Marks the nodes with N ≠ 0 or ∇N ≠ 0 at a particle of a group as active.
fn mark<const D: usize>(block: &mut Block, group: usize, columns: &[Columns; 3]) {
    let [nx, ny, _] = block.size;
    for lane in 0..usize::from(block.windows[group].lanes) {
        // No N vanishes or underflows, so all nodes of the particle's own window are active.
        let whole = columns[..D].iter().map(|columns| columns.smallest[lane]).product::<f64>() > 0.0;
        if !whole {
            let mut active = std::mem::take(&mut block.active);
            block.entries::<D>(group, lane).for_each(|(place, ..)| active[place / nx] |= 1 << (place % nx));
            block.active = active;
            continue;
        }
        let (mut begin, mut end) = ([0; 3], [1; 3]);
        for k in 0..D {
            [begin[k], end[k]] = columns[k].spans[lane].map(|node| (node - block.origin[k]) as usize);
        }
        let row = ((1 << (end[0] - begin[0])) - 1) << begin[0];
        for z in begin[2]..end[2] {
            for y in begin[1]..end[1] {
                block.active[z * ny + y] |= row;
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
