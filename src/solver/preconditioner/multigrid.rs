//! Multigrid on the background grid: one V-cycle as preconditioner.
//!
//! The finest level is the tangent itself, known by its product. Coarser ones are hat functions on grids of twice the spacing each, with the
//! material of a cell of the finer grid at one point of it (its volume, centroid and tangent are summed up), stored as stencils; second
//! differences that something holds are held on each of them. Motions go down by linear interpolation of nodal values, forces go up by its
//! transpose. Smoothing: Chebyshev polynomials over the diagonal blocks, the same before and after, so that the whole is symmetric where the
//! tangent is.

use super::{BlockJacobi, Preconditioner};
use crate::solver::vector::{Entry, dot};
use crate::solver::{LinearOperator, Linearization};
use crate::tensor::{Tensor, Vector, identity, inverse, scaled};
use nalgebra::{DMatrix, DVector, Dyn, LU};
use std::collections::HashMap;

/// Degree of the smoothing polynomials, and the part of the spectrum they see: [λ/PART, λ].
const DEGREE: usize = 5;
const PART: f64 = 30.0;

/// Products that estimate the largest eigenvalue λ of D⁻¹K, and what is added to the estimate, which is from below.
const ESTIMATE: usize = 10;
const MARGIN: f64 = 1.15;

/// Unknowns that are solved for directly, and the most that ever are.
const BOTTOM: usize = 400;
const MOST: usize = 2000;

/// The middle of a stencil, and a neighbour that is not there.
const MIDDLE: usize = 13;
const NONE: u32 = u32::MAX;

/// An operator as a form on the cells of a grid: Σ_cells ∇w:A∇u + m w·u at their points, Σ_nodes w·B u, and bends. Lengths are in cells.
#[derive(Clone, Debug, Default)]
pub struct LocalForm {
    /// Cells along each axis; 0 along axes that do not exist.
    pub grid: [u32; 3],
    /// Index of each node.
    pub nodes: Vec<[u32; 3]>,
    /// Which unknowns are prescribed, node after node.
    pub prescribed: Vec<bool>,
    /// B of each node, D×D, column by column.
    pub blocks: Vec<f64>,
    /// Index of each cell with something in it.
    pub cells: Vec<[u32; 3]>,
    /// Where in the grid its centroid is.
    pub centres: Vec<[f64; 3]>,
    /// Its share that is filled.
    pub filled: Vec<f64>,
    /// m
    pub masses: Vec<f64>,
    /// Second differences that are held.
    pub bends: Vec<Bend>,
    /// `A[i][k][j][l]` of ∂w_i/∂x_k and ∂u_j/∂x_l.
    pub tangents: Vec<f64>,
}

/// The energy ½ k |u_a − 2 u_b + u_c|² of three neighbours along an axis.
#[derive(Clone, Copy, Debug)]
pub struct Bend {
    /// a, b, c
    pub nodes: [u32; 3],
    /// k
    pub stiffness: f64,
}

impl Bend {
    /// The weights of a, b and c.
    pub const WEIGHTS: [f64; 3] = [1.0, -2.0, 1.0];
}

/// One V-cycle, of levels made from the first tangent that is shown; smoothed by the present one.
#[derive(Clone, Debug, Default)]
pub struct Multigrid<const D: usize> {
    blocks: BlockJacobi<D>,
    /// What the tangent was divided by that the levels are made from.
    scale: f64,
    largest: f64,
    levels: Vec<Level<D>>,
    bottom: Option<LU<f64, Dyn, Dyn>>,
}

/// A coarse level: a stencil of 3^D blocks a node.
#[derive(Clone, Debug, Default)]
struct Level<const D: usize> {
    /// Of each node of the finer level, where it lies on this one: nodes and weights.
    above: Vec<Vec<(u32, f64)>>,
    /// Unknowns of the finer level that take no part.
    held_above: Vec<bool>,
    held: Vec<bool>,
    /// The neighbours of each node, and the entries.
    neighbours: Vec<[u32; 27]>,
    entries: Vec<[Tensor<f64, D>; 27]>,
    /// What a stencil does not reach: the outer two unknowns of bends, and their entry.
    far: Vec<(usize, usize, f64)>,
    inverse: Vec<Tensor<f64, D>>,
    largest: f64,
}

impl<const D: usize> LinearOperator for Level<D> {
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        for ((entries, neighbours), y) in self.entries.iter().zip(&self.neighbours).zip(y.chunks_exact_mut(D)) {
            let mut sum = Vector::<f64, D>::zeros();
            for (entry, &node) in entries.iter().zip(neighbours) {
                if node != NONE {
                    let u = Vector::<f64, D>::from_fn(|i, _| x[node as usize * D + i]);
                    sum += entry * u;
                }
            }
            y.copy_from_slice(sum.as_slice());
        }
        for &(a, c, entry) in &self.far {
            y[a] += entry * x[c];
            y[c] += entry * x[a];
        }
    }
}

impl LocalForm {
    /// Room for one more cell.
    pub(crate) fn push_cell(&mut self, index: [u32; 3], tiles: usize) {
        self.cells.push(index);
        self.centres.push([0.0; 3]);
        self.filled.push(0.0);
        self.masses.push(0.0);
        self.tangents.extend(std::iter::repeat_n(0.0, tiles));
    }

    /// Divides the sums of places by what they were weighted with.
    pub(crate) fn finish_centres(&mut self) {
        for (centre, &filled) in self.centres.iter_mut().zip(&self.filled) {
            centre.iter_mut().for_each(|x| *x /= filled);
        }
    }

    /// The cells of the next grid; of each of these, which it lies in.
    fn add_cells_to<const D: usize>(&self, next: &mut Self) -> Vec<usize> {
        let (tiles, mut places) = (D.pow(4), HashMap::new());
        let mut of_coarse = Vec::with_capacity(self.cells.len());
        for (cell, index) in self.cells.iter().enumerate() {
            let coarse = index.map(|i| i / 2);
            let at = *places.entry(coarse).or_insert_with(|| {
                next.push_cell(coarse, tiles);
                next.cells.len() - 1
            });
            of_coarse.push(at);
            // Lengths are in cells: volumes are smaller numbers by 2^D, gradients larger ones by 2.
            let share = self.filled[cell] / f64::from(1 << D);
            next.filled[at] += share;
            next.masses[at] += self.masses[cell];
            (0..D).for_each(|k| next.centres[at][k] += share * 0.5 * self.centres[cell][k]);
            (0..tiles).for_each(|t| next.tangents[at * tiles + t] += 0.25 * self.tangents[cell * tiles + t]);
        }
        next.finish_centres();
        of_coarse
    }
}

/// The nodes of the grid of twice the spacing between which an index lies, with weights.
fn between<const D: usize>(index: [u32; 3]) -> Vec<([u32; 3], f64)> {
    let mut all = vec![([0; 3], 1.0)];
    for k in 0..D {
        let (half, odd) = (index[k] / 2, index[k] % 2 == 1);
        let upper = all.clone().into_iter().filter(|_| odd).map(|(mut node, weight)| {
            node[k] = half + 1;
            (node, 0.5 * weight)
        });
        let upper: Vec<_> = upper.collect();
        all.iter_mut()
            .for_each(|(node, weight)| (node[k], *weight) = (half, if odd { 0.5 * *weight } else { *weight }));
        all.extend(upper);
    }
    all
}

/// Where in the stencil of a node another one is.
fn place(from: [u32; 3], to: [u32; 3]) -> usize {
    let [x, y, z] = [0, 1, 2].map(|k| (to[k] + 1 - from[k]) as usize);
    x + 3 * y + 9 * z
}

impl<const D: usize> Level<D> {
    /// The next coarser level of a form, and its form.
    fn of(form: &LocalForm) -> (Self, LocalForm) {
        let mut next = LocalForm { grid: form.grid.map(|cells| cells.div_ceil(2)), ..LocalForm::default() };
        let mut numbers: HashMap<[u32; 3], u32> = HashMap::new();
        let mut above = Vec::with_capacity(form.nodes.len());
        for &index in &form.nodes {
            let list = between::<D>(index).into_iter().map(|(coarse, weight)| {
                let number = *numbers.entry(coarse).or_insert_with(|| {
                    next.nodes.push(coarse);
                    next.nodes.len() as u32 - 1
                });
                (number, weight)
            });
            above.push(list.collect());
        }
        let neighbour = |index: [u32; 3], place: usize| {
            let steps = [place % 3, place / 3 % 3, place / 9];
            let to = [0, 1, 2].map(|k| (index[k] + steps[k] as u32).checked_sub(1).unwrap_or(NONE));
            numbers.get(&to).copied().unwrap_or(NONE)
        };
        let neighbours = next.nodes.iter().map(|&index| std::array::from_fn(|place| neighbour(index, place)));
        let mut level = Self {
            held: Self::held(form, &above, next.nodes.len()),
            neighbours: neighbours.collect(),
            entries: vec![[Tensor::zeros(); 27]; next.nodes.len()],
            held_above: form.prescribed.clone(),
            above,
            ..Self::default()
        };
        let of_coarse = form.add_cells_to::<D>(&mut next);
        for (cell, &at) in of_coarse.iter().enumerate() {
            level.add_cell(form, cell, &next, at, &numbers);
        }
        level.add_bends(form, &mut next, &numbers);
        level.hold_empty();
        level.add_nodes(form, &mut next);
        level.hold(&next.bends);
        next.prescribed.clone_from(&level.held);
        level.largest = largest(&level, &|r, z| level.precondition(r, z), D * next.nodes.len());
        (level, next)
    }

    /// What is held where both grids have a node; elsewhere, what any node is that lies between.
    fn held(form: &LocalForm, above: &[Vec<(u32, f64)>], count: usize) -> Vec<bool> {
        let (mut held, mut same) = (vec![false; D * count], vec![false; count]);
        for (fine, list) in above.iter().enumerate() {
            if let [(coarse, _)] = list[..] {
                same[coarse as usize] = true;
                (0..D).for_each(|i| held[coarse as usize * D + i] = form.prescribed[fine * D + i]);
            }
        }
        for (fine, list) in above.iter().enumerate() {
            for &(coarse, _) in list.iter().filter(|(coarse, _)| !same[*coarse as usize]) {
                (0..D).for_each(|i| held[coarse as usize * D + i] |= form.prescribed[fine * D + i]);
            }
        }
        held
    }

    /// Adds what nodes have: Pᵀ B P, and for the next level its row sums.
    fn add_nodes(&mut self, form: &LocalForm, next: &mut LocalForm) {
        let mut lumped = vec![Tensor::<f64, D>::zeros(); next.nodes.len()];
        for (fine, list) in self.above.iter().enumerate() {
            let own = Tensor::<f64, D>::from_column_slice(&form.blocks[fine * D * D..(fine + 1) * D * D]);
            for &(a, of_a) in list {
                lumped[a as usize] += own * of_a;
                for &(b, of_b) in list {
                    let at = place(next.nodes[a as usize], next.nodes[b as usize]);
                    self.entries[a as usize][at] += own * (of_a * of_b);
                }
            }
        }
        next.blocks = lumped.iter().flat_map(|block| block.iter().copied()).collect();
    }

    /// Adds a cell of the finer grid, one point in the coarse cell `at`.
    fn add_cell(
        &mut self,
        form: &LocalForm,
        cell: usize,
        next: &LocalForm,
        at: usize,
        numbers: &HashMap<[u32; 3], u32>,
    ) {
        let (index, tiles) = (next.cells[at], D.pow(4));
        let local = |k: usize| (0.5 * form.centres[cell][k] - f64::from(index[k])).clamp(0.0, 1.0);
        let corner = |corner: usize| {
            let upper = |k: usize| corner >> k & 1 == 1;
            let hat = |k: usize| if upper(k) { local(k) } else { 1.0 - local(k) };
            let slope = |k: usize| {
                let others: f64 = (0..D).filter(|&other| other != k).map(hat).product();
                if upper(k) { others } else { -others }
            };
            let node = numbers.get(&std::array::from_fn(|k| index[k] + u32::from(k < D && upper(k))))?;
            Some((*node as usize, (0..D).map(hat).product::<f64>(), std::array::from_fn::<f64, D, _>(slope)))
        };
        let corners: Vec<_> = (0..1_usize << D).filter_map(corner).collect();
        let tangent = &form.tangents[cell * tiles..(cell + 1) * tiles];
        for &(b, n_b, slope_b) in &corners {
            for &(a, n_a, slope_a) in &corners {
                let entry = &mut self.entries[a][place(next.nodes[a], next.nodes[b])];
                for (i, j) in (0..D).flat_map(|i| (0..D).map(move |j| (i, j))) {
                    for (k, l) in (0..D).flat_map(|k| (0..D).map(move |l| (k, l))) {
                        let a_ikjl = tangent[((i * D + k) * D + j) * D + l];
                        entry[(i, j)] += 0.25 * slope_a[k] * a_ikjl * slope_b[l];
                    }
                }
                (0..D).for_each(|i| entry[(i, i)] += form.masses[cell] * n_a * n_b);
            }
        }
    }

    /// Adds what holds second differences, as much as it would on this grid: none between coarse nodes, a half at them; k is as h^{D−2}.
    fn add_bends(&mut self, form: &LocalForm, next: &mut LocalForm, numbers: &HashMap<[u32; 3], u32>) {
        let mut places = HashMap::new();
        for bend in &form.bends {
            let [before, centre, _] = bend.nodes.map(|node| form.nodes[node as usize]);
            let Some(axis) = (0..D).find(|&k| before[k] != centre[k] && centre[k] % 2 == 0) else { continue };
            for &(centre, weight) in &self.above[bend.nodes[1] as usize] {
                let mut ends = [next.nodes[centre as usize]; 2];
                (ends[0][axis], ends[1][axis]) = (ends[0][axis] - 1, ends[1][axis] + 1);
                let [Some(&before), Some(&after)] = ends.map(|end| numbers.get(&end)) else { continue };
                let at = *places.entry((centre, axis)).or_insert_with(|| {
                    next.bends.push(Bend { nodes: [before, centre, after], stiffness: 0.0 });
                    next.bends.len() - 1
                });
                next.bends[at].stiffness += 0.5 * weight * bend.stiffness;
            }
        }
        for bend in &next.bends {
            let nodes = bend.nodes.map(|node| node as usize);
            for (k, l) in [(0, 0), (0, 1), (1, 0), (1, 1), (1, 2), (2, 1), (2, 2)] {
                let entry = &mut self.entries[nodes[k]][place(next.nodes[nodes[k]], next.nodes[nodes[l]])];
                *entry += scaled(&identity(), bend.stiffness * Bend::WEIGHTS[k] * Bend::WEIGHTS[l]);
            }
        }
    }

    /// Holds the nodes of no cell: what finer nodes have of one there has hardly mass and no stiffness.
    fn hold_empty(&mut self) {
        for (held, row) in self.held.chunks_exact_mut(D).zip(&self.entries) {
            held.iter_mut().enumerate().for_each(|(i, held)| *held |= row[MIDDLE][(i, i)] == 0.0);
        }
    }

    /// The identity's row and column where nothing moves; inverts the blocks.
    fn hold(&mut self, bends: &[Bend]) {
        let Self { entries, neighbours, held, inverse: inverses, far, .. } = self;
        let outer = bends.iter().flat_map(|bend| {
            let [a, _, c] = bend.nodes.map(|node| node as usize * D);
            (0..D).map(move |i| (a + i, c + i, bend.stiffness))
        });
        far.extend(outer.filter(|&(a, c, _)| !held[a] && !held[c]));
        for (node, (row, neighbours)) in entries.iter_mut().zip(neighbours).enumerate() {
            for (entry, &mut other) in row.iter_mut().zip(neighbours) {
                for (i, j) in (0..D).flat_map(|i| (0..D).map(move |j| (i, j))) {
                    if held[node * D + i] || (other != NONE && held[other as usize * D + j]) {
                        entry[(i, j)] = f64::from(other as usize == node && i == j);
                    }
                }
            }
            let inverse = inverse(&row[MIDDLE]);
            let usable = inverse.iter().all(|x| x.is_finite());
            inverses.push(if usable { inverse } else { Tensor::identity() });
        }
    }

    /// The whole matrix, column by column.
    fn assembled(&self) -> DMatrix<f64> {
        let size = D * self.entries.len();
        let mut matrix = DMatrix::zeros(size, size);
        let mut unit = vec![0.0; size];
        for (k, mut column) in matrix.column_iter_mut().enumerate() {
            unit[k] = 1.0;
            self.apply(&unit, column.as_mut_slice());
            unit[k] = 0.0;
        }
        matrix
    }

    /// z = D⁻¹ r
    fn precondition(&self, r: &[f64], z: &mut [f64]) {
        for ((inverse, r), z) in self.inverse.iter().zip(r.chunks_exact(D)).zip(z.chunks_exact_mut(D)) {
            let product = inverse * Vector::<f64, D>::from_column_slice(r);
            z.copy_from_slice(product.as_slice());
        }
    }

    /// Pᵀ r
    fn up(&self, r: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; D * self.neighbours.len()];
        for (fine, list) in self.above.iter().enumerate() {
            for &(coarse, weight) in list {
                for i in (0..D).filter(|i| !self.held_above[fine * D + i]) {
                    out[coarse as usize * D + i] += weight * r[fine * D + i];
                }
            }
        }
        out.iter_mut().zip(&self.held).filter(|(_, held)| **held).for_each(|(out, _)| *out = 0.0);
        out
    }

    /// x += P y
    fn down(&self, y: &[f64], x: &mut [f64]) {
        for (fine, list) in self.above.iter().enumerate() {
            for &(coarse, weight) in list {
                for i in (0..D).filter(|i| !self.held_above[fine * D + i]) {
                    x[fine * D + i] += weight * y[coarse as usize * D + i];
                }
            }
        }
    }
}

/// The largest eigenvalue of D⁻¹K, by the method of Lanczos in the inner product of D.
fn largest(operator: &dyn LinearOperator, jacobi: &dyn Fn(&[f64], &mut [f64]), n: usize) -> f64 {
    let mut r: Vec<f64> = (1..=n).map(|i| 2.0 * (i as f64 * 0.618_033_988_749_894_9).fract() - 1.0).collect();
    let (mut before, mut z, mut w) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let mut matrix = DMatrix::<f64>::zeros(ESTIMATE, ESTIMATE);
    // Nothing of prescribed unknowns.
    jacobi(&r, &mut z);
    operator.apply(&z, &mut w);
    jacobi(&w, &mut z);
    operator.apply(&z, &mut r);
    jacobi(&r, &mut z);
    let mut beta = dot(&r, &z).max(0.0).sqrt();
    for step in 0..ESTIMATE {
        if beta.is_nan() || beta <= 0.0 {
            break;
        }
        // r = D v, z = v
        r.iter_mut().for_each(|x| *x /= beta);
        z.iter_mut().for_each(|x| *x /= beta);
        operator.apply(&z, &mut w);
        let alpha = dot(&w, &z);
        matrix[(step, step)] = alpha;
        for i in 0..n {
            let next = w[i] - alpha * r[i] - if step > 0 { beta * before[i] } else { 0.0 };
            (before[i], r[i]) = (r[i], next);
        }
        jacobi(&r, &mut z);
        beta = dot(&r, &z).max(0.0).sqrt();
        if step + 1 < ESTIMATE {
            (matrix[(step, step + 1)], matrix[(step + 1, step)]) = (beta, beta);
        }
    }
    let finite = matrix.iter().all(|x| x.is_finite());
    let largest = if finite { MARGIN * matrix.symmetric_eigenvalues().max() } else { 0.0 };
    if largest > 0.0 { largest } else { 1.0 }
}

/// x ← x + p(D⁻¹K) D⁻¹ (b − K x), p a Chebyshev polynomial; from x = 0 if `zero`.
fn chebyshev(
    operator: &dyn LinearOperator,
    jacobi: &dyn Fn(&[f64], &mut [f64]),
    largest: f64,
    b: &[f64],
    x: &mut [f64],
    zero: bool,
) {
    let n = b.len();
    let (upper, lower) = (largest, largest / PART);
    let (theta, delta) = (0.5 * (upper + lower), 0.5 * (upper - lower));
    let sigma = theta / delta;
    let (mut r, mut z, mut p) = (b.to_vec(), vec![0.0; n], vec![0.0; n]);
    if !zero {
        operator.apply(x, &mut z);
        r.iter_mut().zip(&z).for_each(|(r, z)| *r -= z);
    }
    jacobi(&r, &mut z);
    p.iter_mut().zip(&z).for_each(|(p, z)| *p = z / theta);
    let mut rho = 1.0 / sigma;
    for step in 0..DEGREE {
        x.iter_mut().zip(&p).for_each(|(x, p)| *x += p);
        if step + 1 == DEGREE {
            break;
        }
        operator.apply(&p, &mut z);
        r.iter_mut().zip(&z).for_each(|(r, z)| *r -= z);
        jacobi(&r, &mut z);
        let next = 1.0 / (2.0 * sigma - rho);
        p.iter_mut().zip(&z).for_each(|(p, z)| *p = next * rho * *p + 2.0 * next / delta * z);
        rho = next;
    }
}

/// Bytes of the levels below so many nodes in `dimension` dimensions, and of the form that they are made from.
pub(crate) fn bytes(nodes: usize, dimension: usize) -> usize {
    let (block, tangent) = (dimension.pow(2) * size_of::<f64>(), dimension.pow(4) * size_of::<f64>());
    let transfer = 1.5_f64.powi(dimension as i32).ceil() as usize * size_of::<(u32, f64)>();
    // Coarse grids have a half more nodes than their share, along surfaces.
    let coarse = 2 * nodes.div_ceil(1 << dimension);
    nodes * (tangent + transfer + size_of::<Vec<u32>>()) + coarse * (28 * block + 27 * size_of::<u32>())
}

impl<const D: usize> Multigrid<D> {
    /// The levels of a tangent.
    fn build(&mut self, form: Option<LocalForm>, fine: &dyn LinearOperator) {
        self.largest = largest(fine, &|r, z| self.blocks.apply(r, z), self.blocks.len());
        let Some(mut form) = form else { return };
        loop {
            let (level, next) = Level::<D>::of(&form);
            let size = D * next.nodes.len();
            let last = size <= BOTTOM || next.grid.iter().all(|&cells| cells <= 1);
            if last && size <= MOST {
                self.bottom = Some(level.assembled().lu());
            }
            self.levels.push(level);
            form = next;
            if last {
                return;
            }
        }
    }

    /// x = M⁻¹ b below level `from`.
    fn coarse(&self, from: usize, b: &[f64]) -> Vec<f64> {
        let level = &self.levels[from];
        let mut x = vec![0.0; b.len()];
        if from + 1 == self.levels.len() {
            match self.bottom.as_ref().and_then(|lu| lu.solve(&DVector::from_column_slice(b))) {
                Some(solved) => x.copy_from_slice(solved.as_slice()),
                None => level.precondition(b, &mut x),
            }
            return x;
        }
        let jacobi = |r: &[f64], z: &mut [f64]| level.precondition(r, z);
        chebyshev(level, &jacobi, level.largest, b, &mut x, true);
        self.correct(from + 1, level, b, &mut x);
        chebyshev(level, &jacobi, level.largest, b, &mut x, false);
        x
    }

    /// Adds to x what level `to` makes of the residual.
    fn correct(&self, to: usize, operator: &dyn LinearOperator, b: &[f64], x: &mut [f64]) {
        let Some(level) = self.levels.get(to) else { return };
        let mut r = vec![0.0; b.len()];
        operator.apply(x, &mut r);
        r.iter_mut().zip(b).for_each(|(r, b)| *r = b - *r);
        level.down(&self.coarse(to, &level.up(&r)), x);
    }
}

/// A V-cycle with the present tangent.
struct Cycle<'a, const D: usize, S> {
    levels: &'a Multigrid<D>,
    tangent: Doubled<'a, S>,
}

/// The tangent in double precision, whatever its own, and times what brings it to the levels' scale.
struct Doubled<'a, S>(&'a dyn Linearization<S>, f64);

impl<S: Entry> LinearOperator for Doubled<'_, S> {
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        let (x, mut out) = (x.iter().map(|&x| S::lit(x)).collect::<Vec<_>>(), vec![S::zero(); y.len()]);
        self.0.apply(&x, &mut out);
        y.iter_mut().zip(&out).for_each(|(y, out)| *y = self.1 * out.value());
    }
}

impl<S: Entry, const D: usize> LinearOperator<S> for Cycle<'_, D, S> {
    fn apply(&self, r: &[S], z: &mut [S]) {
        let b: Vec<f64> = r.iter().map(|r| r.value()).collect();
        let mut x = vec![0.0; b.len()];
        let (fine, levels) = (&self.tangent, self.levels);
        let jacobi = |r: &[f64], z: &mut [f64]| levels.blocks.apply(r, z);
        chebyshev(fine, &jacobi, levels.largest, &b, &mut x, true);
        levels.correct(0, fine, &b, &mut x);
        chebyshev(fine, &jacobi, levels.largest, &b, &mut x, false);
        z.iter_mut().zip(&x).for_each(|(z, x)| *z = S::lit(*x));
    }
}

impl<const D: usize> Multigrid<D> {
    fn prepared<'a, S: Entry>(&'a mut self, tangent: &'a dyn Linearization<S>) -> Box<dyn LinearOperator<S> + 'a> {
        if self.levels.is_empty() {
            self.blocks.take(tangent);
            self.scale = tangent.scale();
            self.build(tangent.local_form(), &Doubled(tangent, 1.0));
        }
        // Systems that single precision could not solve come again in double.
        let tangent = Doubled(tangent, tangent.scale() / self.scale);
        Box::new(Cycle { levels: self, tangent })
    }
}

impl<const D: usize> Preconditioner for Multigrid<D> {
    fn prepare<'a>(&'a mut self, tangent: &'a dyn Linearization) -> Box<dyn LinearOperator + 'a> {
        self.prepared(tangent)
    }

    fn prepare_single<'a>(&'a mut self, tangent: &'a dyn Linearization<f32>) -> Box<dyn LinearOperator<f32> + 'a> {
        self.prepared(tangent)
    }
}
