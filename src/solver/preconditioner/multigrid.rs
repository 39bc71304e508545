//! Multigrid on the background grid: one V-cycle as preconditioner.
//!
//! The finest level is the tangent itself, known by its product. Coarser ones are hat functions on grids of twice the spacing each, with the
//! material of a cell of the finer grid at one point of it (its volume, centroid and tangent are summed up), stored as stencils. Motions go
//! down by linear interpolation of nodal values, forces go up by its transpose. Smoothing: Chebyshev polynomials over the diagonal blocks, the
//! same before and after, so that the whole is symmetric where the tangent is.

use super::{BlockJacobi, Preconditioner};
use crate::solver::vector::{Entry, dot};
use crate::solver::{LinearOperator, Linearization};
use crate::tensor::{Tensor, Vector, inverse};
use nalgebra::{DMatrix, DVector, Dyn, LU};
use std::collections::HashMap;

/// Degree of the smoothing polynomials, and the part of the spectrum they see: [λ/PART, λ].
fn env(name: &str, default: f64) -> f64 { std::env::var(name).ok().and_then(|x| x.parse().ok()).unwrap_or(default) }

/// Products that estimate the largest eigenvalue, and what is added to it.
const ESTIMATE: usize = 10;
const MARGIN: f64 = 1.15;

/// Unknowns that are solved for directly.
const BOTTOM: usize = 400;

/// The least share of a coarse cell that is counted as filled: a body that has less of it holds its nodes as if it had that.
const LEAST: f64 = 0.25;

/// An operator as a form on the cells of a grid: Σ_cells ∇w:A∇u + m w·u at their points, and Σ_nodes w·B u. Lengths are in cells.
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
    /// A[i][k][j][l] of ∂w_i/∂x_k and ∂u_j/∂x_l.
    pub tangents: Vec<f64>,
}

/// One V-cycle, of levels made from the first tangent that is shown; smoothed by the present one.
#[derive(Clone, Debug, Default)]
pub struct Multigrid<const D: usize> {
    blocks: BlockJacobi<D>,
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
    inverse: Vec<Tensor<f64, D>>,
    largest: f64,
}

const NONE: u32 = u32::MAX;

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
    }
}

/// Where an index lies on the grid of twice the spacing, along one axis.
fn coarse_axis(index: u32) -> impl Iterator<Item = (u32, f64)> {
    let half = index / 2;
    let odd = index % 2 == 1;
    [(half, if odd { 0.5 } else { 1.0 }), (half + 1, if odd { 0.5 } else { 0.0 })].into_iter().filter(|(_, weight)| *weight > 0.0)
}

impl<const D: usize> Level<D> {
    /// The next coarser level of a form, and its form.
    fn of(form: &LocalForm) -> (Self, LocalForm) {
        let mut next = LocalForm { grid: form.grid.map(|cells| cells.div_ceil(2)), ..LocalForm::default() };
        let mut numbers: HashMap<[u32; 3], u32> = HashMap::new();
        let axis = |k: usize, index: u32| if k < D { coarse_axis(index).collect::<Vec<_>>() } else { vec![(0, 1.0)] };
        let corners = |index: [u32; 3]| {
            let [x, y, z] = [0, 1, 2].map(|k| axis(k, index[k]));
            let mut all = Vec::with_capacity(8);
            for &(k, c) in &z {
                for &(j, b) in &y {
                    for &(i, a) in &x {
                        all.push(([i, j, k], a * b * c));
                    }
                }
            }
            all
        };
        let mut above = Vec::with_capacity(form.nodes.len());
        for &index in &form.nodes {
            let list = corners(index).into_iter().map(|(coarse, weight)| {
                let number = *numbers.entry(coarse).or_insert_with(|| {
                    next.nodes.push(coarse);
                    next.nodes.len() as u32 - 1
                });
                (number, weight)
            });
            above.push(list.collect::<Vec<_>>());
        }
        let count = next.nodes.len();
        // Held is what is held where both grids have a node; elsewhere, what any neighbour is.
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
        // Neighbours
        let offset = |from: [u32; 3], to: [u32; 3]| {
            let [x, y, z] = [0, 1, 2].map(|k| (i64::from(to[k]) - i64::from(from[k]) + 1) as usize);
            x + 3 * y + 9 * z
        };
        let neighbours: Vec<[u32; 27]> = next.nodes.iter().map(|&index| {
            std::array::from_fn(|place| {
                let [dx, dy, dz] = [place % 3, place / 3 % 3, place / 9].map(|d| d as i64 - 1);
                let to = [dx, dy, dz].into_iter().zip(index).map(|(d, i)| u32::try_from(i64::from(i) + d).unwrap_or(NONE));
                let to: Vec<u32> = to.collect();
                numbers.get(&[to[0], to[1], to[2]]).copied().unwrap_or(NONE)
            })
        }).collect();
        let mut entries = vec![[Tensor::<f64, D>::zeros(); 27]; count];
        // What nodes have.
        let block = |n: usize| Tensor::<f64, D>::from_column_slice(&form.blocks[n * D * D..(n + 1) * D * D]);
        let mut lumped = vec![Tensor::<f64, D>::zeros(); count];
        for (fine, list) in above.iter().enumerate() {
            let own = block(fine);
            for &(a, wa) in list {
                lumped[a as usize] += own * wa;
                for &(b, wb) in list {
                    entries[a as usize][offset(next.nodes[a as usize], next.nodes[b as usize])] += own * (wa * wb);
                }
            }
        }
        next.blocks = lumped.iter().flat_map(|block| block.iter().copied()).collect();
        // What cells have.
        let tiles = D * D * D * D;
        let mut places: HashMap<[u32; 3], usize> = HashMap::new();
        let mut of_coarse: Vec<usize> = Vec::with_capacity(form.cells.len());
        for (cell, &index) in form.cells.iter().enumerate() {
            let coarse = index.map(|i| i / 2);
            let at = *places.entry(coarse).or_insert_with(|| {
                next.cells.push(coarse);
                next.centres.push([0.0; 3]);
                next.filled.push(0.0);
                next.masses.push(0.0);
                next.tangents.extend(std::iter::repeat_n(0.0, tiles));
                next.cells.len() - 1
            });
            of_coarse.push(at);
            // ∇ in coarse cells is twice as large a number; volumes are shares of a coarse cell.
            let share = form.filled[cell] / f64::from(1 << D);
            next.filled[at] += share;
            next.masses[at] += form.masses[cell];
            (0..D).for_each(|k| next.centres[at][k] += share * 0.5 * form.centres[cell][k]);
            for t in 0..tiles {
                next.tangents[at * tiles + t] += 0.25 * form.tangents[cell * tiles + t];
            }
        }
        for (centre, &filled) in next.centres.iter_mut().zip(&next.filled) {
            centre.iter_mut().for_each(|x| *x /= filled);
        }
        for (cell, &at) in of_coarse.iter().enumerate() {
            let index = next.cells[at];
            let local: [f64; 3] = std::array::from_fn(|k| (0.5 * form.centres[cell][k] - f64::from(index[k])).clamp(0.0, 1.0));
            let held_up = (env("LEAST", 0.25) / next.filled[at]).max(1.0);
            let mut list: Vec<(u32, f64, [f64; D])> = Vec::with_capacity(8);
            for corner in 0..1_usize << D {
                let side = |k: usize| corner >> k & 1 == 1;
                let to: [u32; 3] = std::array::from_fn(|k| index[k] + u32::from(k < D && side(k)));
                let Some(&node) = numbers.get(&to) else { continue };
                let hat = |k: usize| if side(k) { local[k] } else { 1.0 - local[k] };
                let n: f64 = (0..D).map(hat).product();
                let grad = std::array::from_fn(|k| {
                    let others: f64 = (0..D).filter(|&l| l != k).map(hat).product();
                    if side(k) { others } else { -others }
                });
                list.push((node, n, grad));
            }
            let tangent = &form.tangents[cell * tiles..(cell + 1) * tiles];
            for &(b, nb, gb) in &list {
                // A ∇N_b: three indices left.
                let mut with = [[[0.0; D]; D]; D];
                for i in 0..D {
                    for k in 0..D {
                        for j in 0..D {
                            let row = ((i * D + k) * D + j) * D;
                            with[i][k][j] = (0..D).map(|l| tangent[row + l] * gb[l]).sum::<f64>() * 0.25 * held_up;
                        }
                    }
                }
                let mass = form.masses[cell] * nb * held_up;
                for &(a, na, ga) in &list {
                    let entry = &mut entries[a as usize][offset(next.nodes[a as usize], next.nodes[b as usize])];
                    for i in 0..D {
                        for j in 0..D {
                            entry[(i, j)] += (0..D).map(|k| ga[k] * with[i][k][j]).sum::<f64>();
                        }
                        entry[(i, i)] += mass * na;
                    }
                }
            }
        }
        // Held unknowns.
        for (node, row) in entries.iter_mut().enumerate() {
            for (entry, &other) in row.iter_mut().zip(&neighbours[node]) {
                for i in 0..D {
                    for j in 0..D {
                        if held[node * D + i] || (other != NONE && held[other as usize * D + j]) {
                            entry[(i, j)] = if other as usize == node && i == j { 1.0 } else { 0.0 };
                        }
                    }
                }
            }
        }
        for row in &mut entries {
            for i in 0..D {
                if row[13][(i, i)] <= 0.0 {
                    row[13][(i, i)] = 1.0;
                }
            }
        }
        let identity = Tensor::<f64, D>::identity();
        let usable = |block: Tensor<f64, D>| if block.iter().all(|x| x.is_finite()) { block } else { identity };
        let inverses = entries.iter().map(|row| usable(inverse(&row[13]))).collect();
        next.prescribed = held.clone();
        let mut level = Self { above, held_above: form.prescribed.clone(), held, neighbours, entries, inverse: inverses, largest: 0.0 };
        level.largest = largest(&level, &|r, z| level.smooth_once(r, z), D * count);
        (level, next)
    }

    /// z = D⁻¹ r
    fn smooth_once(&self, r: &[f64], z: &mut [f64]) {
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
        if !(beta > 0.0) {
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
    if std::env::var("SHOW").is_ok() { eprintln!("lambda {:?} n {n}", matrix.symmetric_eigenvalues().max()); }
    MARGIN * matrix.symmetric_eigenvalues().max()
}

/// x ← x + p(D⁻¹K) D⁻¹ (b − K x), p a Chebyshev polynomial; from x = 0 if `zero`.
fn chebyshev(operator: &dyn LinearOperator, jacobi: &dyn Fn(&[f64], &mut [f64]), largest: f64, b: &[f64], x: &mut [f64], zero: bool) {
    let n = b.len();
    let (upper, lower) = (largest, largest / env("PART", 12.0));
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
    let degree = env("DEG", 3.0) as usize;
    for step in 0..degree {
        x.iter_mut().zip(&p).for_each(|(x, p)| *x += p);
        if step + 1 == degree {
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

impl<const D: usize> Multigrid<D> {
    /// Levels, from the first tangent.
    fn build(&mut self, form: Option<LocalForm>, fine: &dyn LinearOperator, n: usize) {
        let blocks = &self.blocks;
        self.largest = largest(fine, &|r, z| blocks.apply(r, z), n);
        let Some(mut form) = form else { return };
        loop {
            let (level, next) = Level::<D>::of(&form);
            let size = D * next.nodes.len();
            let last = size <= BOTTOM || next.grid.iter().all(|&cells| cells <= 1);
            if last && size <= 4 * BOTTOM {
                let mut matrix = DMatrix::<f64>::zeros(size, size);
                for (node, row) in level.entries.iter().enumerate() {
                    for (entry, &other) in row.iter().zip(&level.neighbours[node]).filter(|(_, other)| **other != NONE) {
                        for i in 0..D {
                            for j in 0..D {
                                matrix[(node * D + i, other as usize * D + j)] = entry[(i, j)];
                            }
                        }
                    }
                }
                self.bottom = Some(matrix.lu());
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
                None => level.smooth_once(b, &mut x),
            }
            return x;
        }
        let jacobi = |r: &[f64], z: &mut [f64]| level.smooth_once(r, z);
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
    tangent: &'a dyn LinearOperator<S>,
}

/// The tangent in double precision, whatever its own.
struct Doubled<'a, S>(&'a dyn LinearOperator<S>);

impl<S: Entry> LinearOperator for Doubled<'_, S> {
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        let (x, mut out) = (x.iter().map(|&x| S::lit(x)).collect::<Vec<_>>(), vec![S::zero(); y.len()]);
        self.0.apply(&x, &mut out);
        y.iter_mut().zip(&out).for_each(|(y, out)| *y = out.value());
    }
}

impl<S: Entry, const D: usize> LinearOperator<S> for Cycle<'_, D, S> {
    fn apply(&self, r: &[S], z: &mut [S]) {
        let b: Vec<f64> = r.iter().map(|r| r.value()).collect();
        let mut x = vec![0.0; b.len()];
        let (fine, levels) = (Doubled(self.tangent), self.levels);
        let jacobi = |r: &[f64], z: &mut [f64]| (&levels.blocks).apply(r, z);
        chebyshev(&fine, &jacobi, levels.largest, &b, &mut x, true);
        levels.correct(0, &fine, &b, &mut x);
        chebyshev(&fine, &jacobi, levels.largest, &b, &mut x, false);
        z.iter_mut().zip(&x).for_each(|(z, x)| *z = S::lit(*x));
    }
}

impl<const D: usize> Multigrid<D> {
    fn prepared<'a, S: Entry>(&'a mut self, tangent: &'a dyn Linearization<S>) -> Box<dyn LinearOperator<S> + 'a> {
        if self.levels.is_empty() {
            self.blocks.take(tangent);
            let n = self.blocks.len();
            self.build(tangent.local_form(), &Doubled(tangent), n);
        }
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
