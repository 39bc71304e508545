//! How the tiled sweep is set up: the shape functions and groups of each block, and the numbers of the active nodes.

use super::block::{Block, Group, Groups};
use super::kernel::widest_window;
use super::order::{Key, follows};
use crate::approximation::{ApproximationError, AxisWeights, Separable};
use crate::grid::Grid;
use crate::nodes::Nodes;
use crate::scalar::Real;
use crate::tensor::Vector;

/// The weights of one particle along one axis: its nodes, and where N and dN/dx of each are.
#[derive(Clone, Copy, Default)]
struct Along {
    first: u32,
    width: u32,
    start: usize,
}

impl Along {
    fn end(&self) -> u32 {
        self.first + self.width
    }
}

/// The block of the particles `keys`, without its number of groups before it and its node numbers; and which nodes of its
/// box are active. With `single` it has groups for single precision too.
///
/// # Errors
/// The smallest particle whose functions do not exist.
pub(super) fn block<const D: usize>(
    product: &dyn Separable,
    grid: &Grid<D>,
    positions: &[Vector<f64, D>],
    keys: &[Key],
    single: bool,
) -> Result<(Block, Vec<bool>), (usize, ApproximationError)> {
    let mut scratch = AxisWeights::default();
    let mut weights: Vec<[f64; 2]> = Vec::new();
    let mut along: Vec<[Along; D]> = Vec::with_capacity(keys.len());
    let mut failure = None;
    for &(_, p) in keys {
        let mut axes = [Along::default(); D];
        for k in 0..D {
            if let Err(error) = product.axis(&grid.axis(k), positions[p as usize][k], &mut scratch) {
                super::tiled::keep_first(&mut failure, p as usize, error);
                break;
            }
            axes[k] = Along { first: scratch.first, width: scratch.values.len() as u32, start: weights.len() };
            weights.extend(scratch.values.iter().zip(&scratch.derivatives).map(|(&n, &dn)| [n, dn]));
        }
        along.push(axes);
    }
    if let Some(failure) = failure {
        return Err(failure);
    }

    let mut low = [u32::MAX; D];
    let mut high = [0; D];
    for axes in &along {
        for k in 0..D {
            low[k] = low[k].min(axes[k].first);
            high[k] = high[k].max(axes[k].end());
        }
    }
    let (mut size, mut origin) = ([1; 3], [0; 3]);
    for k in 0..D {
        size[k] = (high[k] - low[k]) as usize;
        origin[k] = low[k];
    }
    let block = Block {
        groups: groups(keys, &along, &weights, origin, size, 1.0),
        single: single.then(|| groups(keys, &along, &weights, origin, size, grid.spacing)),
        origin,
        size,
        nodes: Vec::new(),
        places: Vec::new(),
    };
    let active = active(&block, &along, &weights);
    Ok((block, active))
}

/// The particles by groups, dN/dx times `unit`.
fn groups<X: Real, const L: usize, const D: usize>(
    keys: &[Key],
    along: &[[Along; D]],
    weights: &[[f64; 2]],
    origin: [u32; 3],
    size: [usize; 3],
    unit: f64,
) -> Groups<X, L> {
    let mut built = Groups::new(D, size);
    let mut start = 0;
    while start < keys.len() {
        let end = group_end::<L, D>(keys, along, start);
        push(&mut built, &keys[start..end], &along[start..end], weights, origin, size, unit);
        start = end;
    }
    built.shrink_to_fit();
    built
}

/// Where the group that begins at `start` ends: as many particles of a cell as there are lanes, or whole neighbouring cells
/// along x while all fit into the lanes and their window is not too wide.
fn group_end<const L: usize, const D: usize>(keys: &[Key], along: &[[Along; D]], start: usize) -> usize {
    let cell_end = |from: usize| from + keys[from..].partition_point(|key| key.0 == keys[from].0);
    let mut end = cell_end(start);
    if end - start > L {
        return start + L;
    }
    while end < keys.len() && follows::<D>(&keys[end - 1], &keys[end]) {
        let next = cell_end(end);
        let [low, high] = window(&along[start..next], 0);
        if next - start > L || (high - low) as usize > widest_window(L) {
            break;
        }
        end = next;
    }
    end
}

/// First node and end of the common window along axis `k`.
fn window<const D: usize>(along: &[[Along; D]], k: usize) -> [u32; 2] {
    along.iter().fold([u32::MAX, 0], |[low, high], axes| [low.min(axes[k].first), high.max(axes[k].end())])
}

/// Appends a group.
fn push<X: Real, const L: usize, const D: usize>(
    groups: &mut Groups<X, L>,
    keys: &[Key],
    along: &[[Along; D]],
    weights: &[[f64; 2]],
    origin: [u32; 3],
    size: [usize; 3],
    unit: f64,
) {
    let windows: [[u32; 2]; D] = std::array::from_fn(|k| window(along, k));
    let mut width = [1; 3];
    let mut first = 0;
    for k in (0..D).rev() {
        width[k] = (windows[k][1] - windows[k][0]) as u8;
        first = first * size[k] + (windows[k][0] - origin[k]) as usize;
    }
    let group = Group { weights: groups.weights.len() as u32, first: first as u32, width, lanes: keys.len() as u8 };
    for k in 0..D {
        let start = groups.weights.len();
        let nodes = usize::from(width[k]);
        groups.weights.resize(start + 2 * nodes, [X::zero(); L]);
        for (lane, axes) in along.iter().enumerate() {
            let at = start + (axes[k].first - windows[k][0]) as usize;
            for (i, [n, dn]) in weights[axes[k].start..axes[k].start + axes[k].width as usize].iter().enumerate() {
                groups.weights[at + i][lane] = X::lit(*n);
                groups.weights[at + nodes + i][lane] = X::lit(dn * unit);
            }
        }
    }
    groups.particles.push(std::array::from_fn(|lane| keys.get(lane).map_or(u32::MAX, |key| key.1)));
    groups.windows.push(group);
}

/// Which nodes of the box have N ≠ 0 or ∇N ≠ 0 for some particle.
fn active<const D: usize>(block: &Block, along: &[[Along; D]], weights: &[[f64; 2]]) -> Vec<bool> {
    let mut active = vec![false; block.box_nodes()];
    let mut last = None;
    for ((group, lane), axes) in block.groups.slots().zip(along) {
        let list = |k: usize| &weights[axes[k].start..axes[k].start + axes[k].width as usize];
        let smallest: f64 = (0..D).map(|k| list(k).iter().fold(f64::INFINITY, |low, w| low.min(w[0].abs()))).product();
        if smallest > 0.0 {
            // No N vanishes, nor underflows: the whole of the particle's window, often that of the particle before it.
            let mut begin = [0; 3];
            let mut width = [1; 3];
            for k in 0..D {
                begin[k] = (axes[k].first - block.origin[k]) as usize;
                width[k] = axes[k].width as usize;
            }
            if last == Some((begin, width)) {
                continue;
            }
            last = Some((begin, width));
            for z in begin[2]..begin[2] + width[2] {
                for y in begin[1]..begin[1] + width[1] {
                    let row = (z * block.size[1] + y) * block.size[0] + begin[0];
                    active[row..row + width[0]].fill(true);
                }
            }
        } else {
            block.entries::<D>(group, lane, |place, _, _| active[place] = true);
        }
    }
    active
}

/// Numbers the active nodes in the order of the grid, and gives each block those of its box. `active` marks them in the
/// boxes.
pub(super) fn number<const D: usize>(grid: &Grid<D>, blocks: &mut [Block], active: &[Vec<bool>]) -> Nodes {
    /// A row of a box along x, by the grid number of the row's node at x = 0.
    struct Row {
        start: u64,
        x: usize,
        block: usize,
        /// Its first node in the box, and the end of the row.
        place: usize,
        end: usize,
    }
    /// The rows along one line, apart where no box reaches: what lies between two bodies costs nothing.
    fn apart(mut line: &[Row]) -> Vec<&[Row]> {
        let mut parts = Vec::new();
        while let Some(first) = line.first() {
            let mut reach = first.x;
            let gap = line.iter().position(|row| {
                let beyond = row.x > reach;
                reach = reach.max(row.x + row.end - row.place);
                beyond
            });
            let (part, rest) = line.split_at(gap.unwrap_or(line.len()));
            parts.push(part);
            line = rest;
        }
        parts
    }
    let mut rows = Vec::new();
    for (b, block) in blocks.iter().enumerate() {
        let [nx, ny, nz] = block.size;
        for z in 0..nz {
            for y in 0..ny {
                let mut index: [u32; D] = std::array::from_fn(|k| block.origin[k] + [0, y, z][k] as u32);
                let x = index[0] as usize;
                index[0] = 0;
                let place = (z * ny + y) * nx;
                rows.push(Row { start: grid.id(index), x, block: b, place, end: place + nx });
            }
        }
    }
    rows.sort_unstable_by_key(|row| (row.start, row.x, row.block));
    let mut ids = Vec::new();
    let mut numbers: Vec<u32> = Vec::new();
    for same in rows.chunk_by(|a, b| a.start == b.start).flat_map(apart) {
        let low = same[0].x;
        numbers.clear();
        for row in same {
            let active = &active[row.block][row.place..row.end];
            numbers.resize(numbers.len().max(row.x - low + active.len()), u32::MAX);
            for (number, _) in numbers[row.x - low..].iter_mut().zip(active).filter(|(_, active)| **active) {
                *number = 0;
            }
        }
        for (x, number) in numbers.iter_mut().enumerate().filter(|(_, number)| **number == 0) {
            *number = ids.len() as u32;
            ids.push(same[0].start + (low + x) as u64);
        }
        for row in same {
            let block = &mut blocks[row.block];
            for place in (row.place..row.end).filter(|&place| active[row.block][place]) {
                block.nodes.push(numbers[row.x - low + place - row.place]);
                block.places.push(place as u32);
            }
        }
    }
    Nodes::ascending(ids)
}
