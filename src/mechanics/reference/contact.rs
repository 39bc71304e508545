//! Contact detection between two grid resets: particles that reach a prescribed condition or another body.

use crate::grid::{Grid, indices};
use crate::mechanics::loads::Prescribed;
use crate::mechanics::sweep::Connectivity;
use crate::parallel;
use crate::particles::Particles;
use crate::tensor::Vector;
use std::cell::LazyCell;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::ops::Range;

/// Number of cells in one part of the work of a thread.
const CELLS: usize = 256;

/// A node belongs to one body if the variance of the body index at that node, relative to its mean square, is below this tolerance.
const ALONE: f64 = 1e-9;

/// The prescribed conditions that a particle has reached since the last grid reset. A condition is reached if the particle's cell has a node
/// of it now, and had none at the reset. The node must not be active yet, or at the reset no cell of the particle's nodal field had a node
/// of the condition: wide functions make nodes active from afar, and such nodes hold nearly nothing of the body.
pub(crate) fn reached_conditions<const D: usize>(
    particles: &Particles<D>,
    prescribed: &[Prescribed<D>],
    connectivity: &Connectivity<D>,
) -> BTreeSet<usize> {
    let (grid, nodes) = (connectivity.grid(), connectivity.active());
    let (present, at_reset) = (&particles.position, particles.reference().position);
    let field = |p: usize| connectivity.field_of(particles.body[p]);
    let holders = |index: [u32; D]| {
        let position = grid.position(index);
        prescribed.iter().enumerate().filter(move |(_, one)| one.on.holds(grid, index, &position)).map(|(one, _)| one)
    };
    let of_cell = |cell: [u32; D]| -> BTreeSet<usize> { corners(cell).flat_map(holders).collect() };
    // The conditions that held a node of a cell at the last grid reset, with the nodal field.
    let held = LazyCell::new(|| -> HashSet<(u32, usize)> {
        let of_part = |part: &[(u64, u32)]| -> HashSet<(u32, usize)> {
            let conditions =
                |&(cell, field): &(u64, u32)| corners(grid.index(cell)).flat_map(holders).map(move |one| (field, one));
            part.iter().flat_map(conditions).collect()
        };
        let cells = cells(at_reset, &|p| Some(field(p)), grid);
        parallel::collect(cells.chunks(CELLS), &of_part).into_iter().flatten().collect()
    });
    // The conditions of a cell, by condition and field, and whether a node there is not active yet.
    let conditions = |&(cell, field): &(u64, u32)| -> Vec<((u32, usize), bool)> {
        mutant!("reference: nodes of the first field hold all bodies": field = 0);
        let of_node = |index| {
            let is_free = nodes.number(grid.id_in(field, index)).is_none();
            holders(index).map(move |one| ((field, one), is_free))
        };
        corners(grid.index(cell)).flat_map(of_node).collect()
    };
    // A particle that is still in its cell has reached nothing.
    let moved = |p: usize| (grid.cell(&present[p]) != grid.cell(&at_reset[p])).then(|| field(p));
    let keys = cells(present, &moved, grid);
    let of_part = |part: &[(u64, u32)]| -> Vec<_> {
        part.iter().map(|key| (*key, conditions(key))).filter(|(_, all)| !all.is_empty()).collect()
    };
    let all = parallel::collect(keys.chunks(CELLS), &of_part).into_iter().flatten();
    // The conditions that are new to a cell, by cell and field.
    let new = all.map(|(key, conditions)| -> ((u64, u32), BTreeSet<usize>) {
        let is_new = |&(one, is_free): &((u32, usize), bool)| is_free || !held.contains(&one);
        (key, conditions.into_iter().filter(is_new).map(|((_, one), _)| one).collect())
    });
    let new: HashMap<(u64, u32), _> = new.filter(|(_, met)| !met.is_empty()).collect();
    mutant!("reference: no wall that is met resets the grid": { return BTreeSet::new(); });
    let mut reached = BTreeSet::new();
    if new.is_empty() {
        return reached;
    }
    for (p, (x, before)) in present.iter().zip(at_reset).enumerate() {
        let Some(met) = grid.cell(x).and_then(|cell| new.get(&(grid.id(cell), field(p)))) else { continue };
        let were_there = grid.cell(before).map_or_else(BTreeSet::new, of_cell);
        reached.extend(met.difference(&were_there));
    }
    reached
}

/// Whether a particle has reached a body to which its own body is not bonded. Its cell has a node of that body. At the last grid reset, its
/// cell had no such node.
pub(crate) fn reached_body<const D: usize>(
    particles: &Particles<D>,
    bonded: &BTreeSet<[u32; 2]>,
    connectivity: &Connectivity<D>,
) -> bool {
    mutant!("reference: no body that is met resets the grid": { return false; });
    let (grid, body) = (connectivity.grid(), &particles.body);
    let at_reset = particles.reference().position;
    let [now, before] = [&particles.position[..], at_reset].map(|position| seen(position, body, grid));
    let beside = |x: &Vector<f64, D>, own: u32, seen: &HashMap<u64, BTreeSet<u32>>| {
        let others = |index| seen.get(&grid.id(index)).into_iter().flatten();
        let is_contact =
            |&other: &u32| other != own && stick(connectivity, pair(own, other)) && !bonded.contains(&pair(own, other));
        grid.cell(x).is_some_and(|cell| corners(cell).flat_map(others).any(is_contact))
    };
    let mut all = particles.position.iter().zip(at_reset).zip(body);
    all.any(|((x, was), &own)| beside(x, own, &now) && !beside(was, own, &before))
}

/// Whether two bodies stick to each other where they share nodes.
fn stick<const D: usize>(connectivity: &Connectivity<D>, bodies: [u32; 2]) -> bool {
    connectivity.field_of(bodies[0]) == connectivity.field_of(bodies[1])
}

fn pair(one: u32, other: u32) -> [u32; 2] {
    [one.min(other), one.max(other)]
}

/// The bodies in the cells around each node.
fn seen<const D: usize>(position: &[Vector<f64, D>], body: &[u32], grid: &Grid<D>) -> HashMap<u64, BTreeSet<u32>> {
    let mut seen: HashMap<u64, BTreeSet<u32>> = HashMap::new();
    for (cell, body) in cells(position, &|p| Some(body[p]), grid) {
        for index in corners(grid.index(cell)) {
            seen.entry(grid.id(index)).or_default().insert(body);
        }
    }
    seen
}

/// The pairs of bodies of one nodal field that lie in cells with a common corner.
pub(crate) fn pairs<const D: usize>(
    position: &[Vector<f64, D>],
    body: &[u32],
    connectivity: &Connectivity<D>,
) -> BTreeSet<[u32; 2]> {
    let mut pairs = BTreeSet::new();
    for bodies in seen(position, body, connectivity.grid()).values() {
        for &one in bodies {
            pairs.extend(bodies.range(one + 1..).map(|&other| [one, other]).filter(|&pair| stick(connectivity, pair)));
        }
    }
    pairs
}

/// Whether two bodies of one nodal field lie in cells with a common corner now, or shared a node when the shape functions were evaluated.
pub(crate) fn touch<const D: usize>(particles: &Particles<D>, connectivity: &Connectivity<D>) -> bool {
    if !pairs(&particles.position, &particles.body, connectivity).is_empty() {
        return true;
    }
    // The variance of the body index, weighted with N.
    let sum = |power: i32| {
        let mut sum: Vec<Vector<f64, 1>> = vec![Vector::zeros(); connectivity.active().len()];
        connectivity.spread(&mut sum, |p| Vector::from([f64::from(particles.body[p]).powi(power)]));
        sum
    };
    let [weights, means, squares] = [0, 1, 2].map(sum);
    let mut of_nodes = weights.iter().zip(&means).zip(&squares).map(|((w, m), s)| (w[0], m[0], s[0]));
    of_nodes.any(|(weight, mean, square)| weight * square - mean * mean > ALONE * weight * square)
}

/// The pairs of a cell's id and the item of a particle in that cell, sorted, each pair once. Particles without an item are left out.
fn cells<const D: usize, T: Ord + Copy + Send>(
    position: &[Vector<f64, D>],
    item: &(dyn Fn(usize) -> Option<T> + Sync),
    grid: &Grid<D>,
) -> Vec<(u64, T)> {
    let of_part = |part: Range<usize>| {
        let own = |p: usize| {
            let item = item(p)?;
            Some((grid.id(grid.cell(&position[p])?), item))
        };
        let mut cells: Vec<_> = part.filter_map(own).collect();
        // Particles of a cell follow each other.
        cells.dedup();
        cells
    };
    let mut cells = parallel::collect(parallel::parts(position.len()), &of_part).concat();
    parallel::sort(&mut cells);
    cells.dedup();
    cells
}

/// The nodes of a cell.
fn corners<const D: usize>(cell: [u32; D]) -> impl Iterator<Item = [u32; D]> {
    indices([2; D]).map(move |by| std::array::from_fn(|k| cell[k] + by[k] as u32))
}
