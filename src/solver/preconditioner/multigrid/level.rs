//! A coarse grid: hat functions, the tangent on them as stencils, restriction to the grid and interpolation from it.

use super::cycle::Coarse;
use super::form::LocalForm;
use super::interpolation::Interpolation;
use crate::gpu::{self, Gpu};
use crate::lists::Lists;
use crate::parallel;
use crate::pooled::{Pool, Pooled};
use crate::solver::LinearOperator;
use crate::solver::preconditioner::block_jacobi::multiply_blocks;
use crate::solver::preconditioner::chebyshev::largest;
use crate::solver::preconditioner::hats::{corners, nodes_of};
use crate::space::Followers;
use crate::tensor::{Tensor, Vector, identity, inverse};
use nalgebra::DMatrix;
use rustc_hash::FxHashMap;
use std::borrow::Cow;

/// The middle of a stencil.
const MIDDLE: usize = 13;
/// Rows in one part of the work of a thread.
const ROWS: usize = 128;
/// The cells are taken in so many batches. The matrices of one batch are in memory at a time.
const BATCHES: usize = 16;
/// The least and the most cells in a batch.
const CELLS: [usize; 2] = [512, 1 << 14];
/// The distance of a point of Gauss from the middle of an interval of length ½: 1/(4 √3).
const GAUSS: f64 = 0.144_337_567_297_406_43;
/// The number of a neighbour that does not exist.
const NONE: u32 = u32::MAX;

/// A coarse level, stored as a stencil of 3^D blocks for each node.
#[derive(Clone, Debug, Default)]
pub(super) struct Level<const D: usize> {
    /// P, from this level to the finer one.
    interpolation: Interpolation,
    /// Whether a value of the finer level is no unknown.
    fixed_finer: Vec<bool>,
    /// Whether a value of this level is zero, because it is prescribed or no cell reaches it.
    held: Vec<bool>,
    /// E: outer nodes, which follow others.
    followers: Followers<D>,
    /// The neighbours of each node, by their place in the stencil.
    neighbours: Vec<[u32; 27]>,
    /// The blocks of K for these neighbours.
    entries: Vec<[Tensor<f64, D>; 27]>,
    /// D⁻¹, the inverse diagonal blocks of Eᵀ K E.
    inverse: Vec<Tensor<f64, D>>,
    pub largest: f64,
}

impl<const D: usize> LinearOperator for Level<D> {
    /// Eᵀ K E x
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        let mut extended = Cow::Borrowed(x);
        if !self.followers.is_empty() {
            self.followers.extend::<f64>(bytemuck::cast_slice_mut(extended.to_mut()));
        }
        self.multiply(bytemuck::cast_slice(&extended), bytemuck::cast_slice_mut(y));
        self.followers.restrict::<f64>(bytemuck::cast_slice_mut(y));
        self.clear_held(y);
    }
}

/// The place of the node `to` in the stencil of the node `from`.
fn place(from: [u32; 3], to: [u32; 3]) -> usize {
    let [x, y, z] = [0, 1, 2].map(|k| (to[k] + 1 - from[k]) as usize);
    x + 3 * y + 9 * z
}

/// The quadrature points of a finer cell in a coarse cell, in units of the coarse grid. In a coarse cell that is full of finer cells, their
/// centroids are enough. In any other cell, motions that are not rigid could have no energy: two points do not hold eight corners. There each
/// finer cell, whose edge is ½, has the points of Gauss about its centroid.
fn points<const D: usize>(centre: [f64; 3], is_full: bool) -> Vec<[f64; 3]> {
    let middle = centre.map(|x| 0.5 * x);
    mutant!("multigrid: one point holds a coarse cell that is not full": is_full = true);
    if is_full {
        return vec![middle];
    }
    let moved = |k: usize, upper: bool| middle[k] + if upper { GAUSS } else { -GAUSS };
    (0..1 << D).map(|at| std::array::from_fn(|k| if k < D { moved(k, at >> k & 1 == 1) } else { middle[k] })).collect()
}

/// The matrix of a coarse cell: the block of each pair (a, b) of the cell's corners, at a 2^D + b.
fn cell_matrix<const D: usize>(form: &LocalForm, coarse: [u32; 3], finer: &[usize]) -> Vec<Tensor<f64, D>> {
    let mut blocks = vec![Tensor::zeros(); 1 << (2 * D)];
    let is_full = finer.len() == 1 << D;
    let with_points = finer.iter().flat_map(|&cell| {
        let points = points::<D>(form.centres[cell], is_full);
        let share = (points.len() as f64).recip();
        points.into_iter().map(move |point| (cell, point, share))
    });
    for (cell, point, share) in with_points {
        let hats: Vec<(f64, Vector<f64, D>)> = corners::<D>(coarse, point).map(|(_, n, slope)| (n, slope)).collect();
        let tangent = &form.tangents[cell * D.pow(4)..(cell + 1) * D.pow(4)];
        // Gradients of the coarse hats are half as steep, so their products have the factor ¼.
        let flux = |k: usize, slope: &Vector<f64, D>| {
            let along =
                |i: usize, j: usize| (0..D).map(|l| tangent[((i * D + k) * D + j) * D + l] * slope[l]).sum::<f64>();
            Tensor::<f64, D>::from_fn(|i, j| 0.25 * share * along(i, j))
        };
        for (b, (n_b, slope_b)) in hats.iter().enumerate() {
            let flux: [Tensor<f64, D>; D] = std::array::from_fn(|k| flux(k, slope_b));
            for (a, (n_a, slope_a)) in hats.iter().enumerate() {
                let block = &mut blocks[a << D | b];
                (0..D).for_each(|k| *block += flux[k] * slope_a[k]);
                (0..D).for_each(|i| block[(i, i)] += share * form.masses[cell] * n_a * n_b);
            }
        }
    }
    blocks
}

impl<const D: usize> Level<D> {
    /// The next coarser level of a form, and the form of that level.
    pub(crate) fn of(form: &LocalForm) -> (Self, LocalForm) {
        let (interpolation, nodes, numbers) = Interpolation::to::<D>(&form.nodes);
        let mut next = LocalForm { grid: form.grid.map(|cells| cells.div_ceil(2)), nodes, ..LocalForm::default() };
        let neighbour = |index: [u32; 3], place: usize| {
            let steps = [place % 3, place / 3 % 3, place / 9];
            let to = [0, 1, 2].map(|k| (index[k] + steps[k] as u32).checked_sub(1).unwrap_or(NONE));
            numbers.get(&to).copied().unwrap_or(NONE)
        };
        let count = next.nodes.len();
        let neighbours = |node: usize| std::array::from_fn(|place| neighbour(next.nodes[node], place));
        let mut level = Self {
            held: Self::held(form, &interpolation, count),
            neighbours: parallel::values_by(ROWS, count, neighbours),
            entries: bytemuck::zeroed_vec(count),
            fixed_finer: form.fixed(),
            interpolation,
            ..Self::default()
        };
        let finer = form.add_cells_to::<D>(&mut next);
        level.add_cells(form, &next, &finer, &numbers);
        level.add_nodes(form, &mut next);
        level.follow(form, &mut next);
        level.hold_empty(&next);
        level.hold();
        next.prescribed.clone_from(&level.held);
        level.invert_blocks(&next);
        level.largest = largest(&level, &|r: &[f64], z: &mut [f64]| level.precondition(r, z), D * next.nodes.len());
        (level, next)
    }

    /// The held values of the coarse level. A coarse node that coincides with a finer node is held where that node is prescribed. Any other
    /// coarse node is held where one of the finer nodes interpolated from it is prescribed.
    fn held(form: &LocalForm, interpolation: &Interpolation, count: usize) -> Vec<bool> {
        let (mut held, mut same) = (vec![false; D * count], vec![false; count]);
        for (fine, (list, _)) in interpolation.rows().enumerate() {
            if let &[coarse] = list {
                same[coarse as usize] = true;
                (0..D).for_each(|i| held[coarse as usize * D + i] = form.prescribed[fine * D + i]);
                mutant!("multigrid: coarse nodes that are held move": { (0..D).for_each(|i| held[coarse as usize * D + i] = false); });
            }
        }
        for (fine, (list, _)) in interpolation.rows().enumerate() {
            for &coarse in list.iter().filter(|coarse| !same[**coarse as usize]) {
                (0..D).for_each(|i| held[coarse as usize * D + i] |= form.prescribed[fine * D + i]);
            }
        }
        held
    }

    /// Adds the nodal terms Pᵀ B P. The next form gets their row sums.
    fn add_nodes(&mut self, form: &LocalForm, next: &mut LocalForm) {
        let blocks: &[Tensor<f64, D>] = bytemuck::cast_slice(&form.blocks);
        if blocks.is_empty() {
            return;
        }
        let (interpolation, nodes) = (&self.interpolation, &next.nodes);
        let finer = |node: usize| {
            let of = |&fine: &u32| (interpolation.row(fine as usize), &blocks[fine as usize]);
            interpolation.finer(node).iter().map(of)
        };
        parallel::each_by(ROWS, &mut self.entries, |a, row| {
            for ((list, weight), own) in finer(a) {
                list.iter().for_each(|&b| row[place(nodes[a], nodes[b as usize])] += own * (weight * weight));
            }
        });
        let lumped = |node: usize| finer(node).fold(Tensor::zeros(), |sum, ((_, weight), own)| sum + own * weight);
        let lumped: Vec<Tensor<f64, D>> = parallel::values_by(ROWS, nodes.len(), lumped);
        next.blocks = bytemuck::cast_slice(&lumped).to_vec();
    }

    /// Adds the matrices of the coarse cells to the stencils. `finer[c]` lists the finer cells in the coarse cell c.
    fn add_cells(
        &mut self,
        form: &LocalForm,
        next: &LocalForm,
        finer: &[Vec<usize>],
        numbers: &FxHashMap<[u32; 3], u32>,
    ) {
        let nodes = |cell: usize| -> Vec<u32> {
            nodes_of::<D>(next.cells[cell]).filter_map(|node| numbers.get(&node).copied()).collect()
        };
        let mut corners = Lists::default();
        parallel::values_by(ROWS, finer.len(), nodes).into_iter().for_each(|nodes| corners.push(nodes));
        let cells_of_nodes = corners.transposed(next.nodes.len());
        let Self { entries, neighbours, .. } = self;
        let batch = finer.len().div_ceil(BATCHES).clamp(CELLS[0], CELLS[1]);
        for first in (0..finer.len()).step_by(batch) {
            let count = batch.min(finer.len() - first);
            let matrices = parallel::map(count, &|k| cell_matrix::<D>(form, next.cells[first + k], &finer[first + k]));
            // Every node takes the matrices of its cells in the order of the cells.
            parallel::each_by(ROWS, entries, |node, row| {
                for &cell in cells_of_nodes.row(node) {
                    let Some(matrix) = (cell as usize).checked_sub(first).and_then(|k| matrices.get(k)) else {
                        continue;
                    };
                    let corner = |k: usize| (next.nodes[node][k] - next.cells[cell as usize][k]) as usize;
                    let a: usize = (0..D).map(|k| corner(k) << k).sum();
                    for (other, block) in nodes_of::<D>(next.cells[cell as usize]).zip(&matrix[a << D..]) {
                        let place = place(next.nodes[node], other);
                        if neighbours[node][place] != NONE {
                            row[place] += block;
                        }
                    }
                }
            });
        }
    }

    /// Sets held values to zero.
    fn clear_held(&self, x: &mut [f64]) {
        parallel::zip(x, &self.held, |x, held| *x = if *held { 0.0 } else { *x });
    }

    /// Lets outer nodes follow others, except at held values.
    fn follow(&mut self, form: &LocalForm, next: &mut LocalForm) {
        (next.aggregated, next.follows) = (form.aggregated, vec![false; D * next.nodes.len()]);
        self.followers = next.followers(&self.held);
        for (outer, follows, _) in self.followers.rows() {
            next.follows[outer * D..(outer + 1) * D].copy_from_slice(&follows);
        }
    }

    /// Holds unknowns that no cell reaches. Finer nodes interpolated from them have hardly any mass and no stiffness.
    fn hold_empty(&mut self, next: &LocalForm) {
        let Self { held, entries, .. } = self;
        parallel::each(held, |k, held| {
            *held |= !next.follows[k] && entries[k / D][MIDDLE][(k % D, k % D)] == 0.0;
        });
    }

    /// Clears the rows and columns of held values.
    fn hold(&mut self) {
        let Self { entries, neighbours, held, .. } = self;
        parallel::each_by(ROWS, entries, |node, row| {
            for (entry, &other) in row.iter_mut().zip(&neighbours[node]).filter(|(_, other)| **other != NONE) {
                for (i, j) in (0..D).flat_map(|i| (0..D).map(move |j| (i, j))) {
                    if held[node * D + i] || held[other as usize * D + j] {
                        entry[(i, j)] = 0.0;
                    }
                }
            }
        });
    }

    /// The inverse diagonal blocks of Eᵀ K E, with the identity at values that are no unknowns.
    fn invert_blocks(&mut self, next: &LocalForm) {
        let mut blocks: Vec<Tensor<f64, D>> = self.entries.iter().map(|row| row[MIDDLE]).collect();
        // The nodes that follow each node.
        let mut of_leader: Vec<Vec<(usize, [bool; D], f64)>> = vec![Vec::new(); blocks.len()];
        for (outer, follows, leaders) in self.followers.rows() {
            leaders.for_each(|(leader, weight)| of_leader[leader].push((outer, follows, weight)));
        }
        parallel::each_by(ROWS, &mut blocks, |leader, block| {
            if of_leader[leader].is_empty() {
                return;
            }
            let all: Vec<_> = of_leader[leader].iter().copied().chain([(leader, [true; D], 1.0)]).collect();
            *block = Tensor::zeros();
            for &(a, of_a, weight_a) in &all {
                for &(b, of_b, weight_b) in &all {
                    let entry = self.entry(&next.nodes, a, b) * (weight_a * weight_b);
                    *block += Tensor::from_fn(|i, j| if of_a[i] && of_b[j] { entry[(i, j)] } else { 0.0 });
                }
            }
        });
        for (k, _) in next.fixed().iter().enumerate().filter(|(_, fixed)| **fixed) {
            let (block, i) = (&mut blocks[k / D], k % D);
            block.row_mut(i).fill(0.0);
            block.column_mut(i).fill(0.0);
            block[(i, i)] = 1.0;
        }
        let finite = |inverse: &Tensor<f64, D>| inverse.iter().all(|x| x.is_finite());
        self.inverse = parallel::values_by(ROWS, blocks.len(), |node| {
            Some(inverse(&blocks[node])).filter(finite).unwrap_or(identity())
        });
    }

    /// K x
    fn multiply(&self, x: &[Vector<f64, D>], y: &mut [Vector<f64, D>]) {
        let rows = self.entries.chunks(ROWS).zip(self.neighbours.chunks(ROWS)).zip(y.chunks_mut(ROWS));
        parallel::for_each(rows, &|((entries, neighbours), y): ((&[[_; 27]], &[[u32; 27]]), &mut [_])| {
            for ((entries, neighbours), y) in entries.iter().zip(neighbours).zip(y) {
                let existing = entries.iter().zip(neighbours).filter(|(_, node)| **node != NONE);
                *y = existing.fold(Vector::zeros(), |sum, (entry, &node)| sum + entry * x[node as usize]);
            }
        });
    }

    /// The block of K for two nodes; zero where they are not neighbours.
    fn entry(&self, nodes: &[[u32; 3]], from: usize, to: usize) -> Tensor<f64, D> {
        let beside = (0..3).all(|k| nodes[from][k].abs_diff(nodes[to][k]) <= 1);
        if beside { self.entries[from][place(nodes[from], nodes[to])] } else { Tensor::zeros() }
    }

    /// The whole matrix, column by column.
    pub(crate) fn assembled(&self) -> DMatrix<f64> {
        let size = D * self.entries.len();
        let mut matrix = DMatrix::zeros(size, size);
        let mut unit = vec![0.0; size];
        for (k, mut column) in matrix.column_iter_mut().enumerate() {
            // A held value is no unknown, so the nodes that follow it must not put entries into its column.
            mutant!("multigrid: held values lead others in the matrix of the bottom level": { unit[k] = 1.0; self.apply(&unit, column.as_mut_slice()); unit[k] = 0.0; });
            if !self.held[k] {
                unit[k] = 1.0;
                self.apply(&unit, column.as_mut_slice());
                unit[k] = 0.0;
            }
            // Values that are no unknowns have the identity's rows.
            if column.iter().all(|entry| *entry == 0.0) {
                column[k] = 1.0;
            }
        }
        matrix
    }

    /// A copy on a device.
    pub(crate) fn on_device(&self, gpu: &Gpu) -> gpu::Level {
        let arrays = gpu::LevelArrays {
            dimension: D,
            neighbours: &self.neighbours,
            entries: bytemuck::cast_slice(&self.entries),
            inverse: bytemuck::cast_slice(&self.inverse),
            held: &self.held,
            fixed_finer: &self.fixed_finer,
            interpolation: self.interpolation.lists(),
            followers: self.followers.on_device(gpu),
        };
        gpu::Level::new(gpu, arrays)
    }
}

impl<const D: usize> Coarse<Pool> for Level<D> {
    fn precondition(&self, r: &[f64], z: &mut [f64]) {
        multiply_blocks(&self.inverse, r, z);
    }

    fn restrict(&self, r: &[f64]) -> Pooled<f64> {
        let mut out = self.interpolation.restrict::<D>(&self.fixed_finer, bytemuck::cast_slice(r));
        self.followers.restrict::<f64>(&mut out);
        let mut out: Vec<f64> = bytemuck::allocation::cast_vec(out);
        self.clear_held(&mut out);
        out.into()
    }

    fn prolong(&self, mut y: Pooled<f64>, x: &mut [f64]) {
        self.followers.extend::<f64>(bytemuck::cast_slice_mut(&mut y));
        let (y, x) = (bytemuck::cast_slice(&y), bytemuck::cast_slice_mut(x));
        self.interpolation.prolong::<D>(&self.fixed_finer, y, x);
    }

    fn largest(&self) -> f64 {
        self.largest
    }
}
