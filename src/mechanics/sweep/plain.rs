//! The sweep written down plainly, one list of (node, N, ∇N) a particle: the specification, and the way of shape functions
//! that are no products.

use super::{BLOCK, Magnitude, SupportError, infallible, ordered};
use crate::approximation::{Scratch, ShapeFunction, Support};
use crate::grid::Grid;
use crate::nodes::Nodes;
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector};
use num_traits::Zero;
use std::ops::{AddAssign, Range};

/// Shape functions of all particles at the last converged positions, and the active nodes they name.
#[derive(Clone, Debug)]
pub(super) struct Plain<const D: usize> {
    blocks: Vec<Block<D>>,
    particles: usize,
}

/// Shape functions of a run of particles, numbered by the block's own list of nodes.
#[derive(Clone, Debug)]
struct Block<const D: usize> {
    /// The particles of the block.
    particles: Range<usize>,
    /// Active numbers of the nodes the block touches.
    nodes: Vec<u32>,
    /// Entries of the k-th particle: `offsets[k]..offsets[k + 1]`.
    offsets: Vec<u32>,
    /// Node of each entry, as a place in `nodes`.
    local: Vec<u32>,
    /// N of each entry.
    values: Vec<f64>,
    /// ∇_n N of each entry.
    gradients: Vec<Vector<f64, D>>,
}

impl<const D: usize> Plain<D> {
    /// Evaluates the shape functions at all positions and numbers the active nodes.
    ///
    /// # Errors
    /// The first particle, in their order, that lies outside the grid or whose shape functions do not exist.
    pub(super) fn new<A: ShapeFunction>(
        approximation: &A,
        grid: &Grid<D>,
        positions: &[Vector<f64, D>],
    ) -> Result<(Self, Nodes), SupportError> {
        let count = positions.len().div_ceil(BLOCK);
        let built = ordered(count, |b| {
            let particles = b * BLOCK..((b + 1) * BLOCK).min(positions.len());
            Block::new(approximation, grid, positions, particles)
        })?;
        let nodes = Nodes::new(built.iter().map(|(_, ids)| ids.as_slice()));
        let blocks = built
            .into_iter()
            .map(|(mut block, ids)| {
                block.nodes = ids.iter().filter_map(|&id| nodes.number(id)).map(|n| n as u32).collect();
                block
            })
            .collect();
        Ok((Self { blocks, particles: positions.len() }, nodes))
    }

    /// Number of particles.
    pub(super) fn particles(&self) -> usize {
        self.particles
    }

    /// Bytes of all arrays.
    pub(super) fn bytes(&self) -> usize {
        let entry = size_of::<u32>() + size_of::<f64>() + size_of::<Vector<f64, D>>();
        let of_block = |block: &Block<D>| {
            block.values.len() * entry + (block.nodes.len() + block.offsets.len()) * size_of::<u32>()
        };
        self.blocks.iter().map(of_block).sum()
    }

    /// The entries (active node, N, ∇_n N) of one particle.
    pub(super) fn of(&self, particle: usize) -> impl Iterator<Item = (usize, f64, Vector<f64, D>)> {
        let block = &self.blocks[particle / BLOCK];
        block
            .entries(particle)
            .map(move |e| (block.nodes[block.local[e] as usize] as usize, block.values[e], block.gradients[e]))
    }

    /// See [`super::Supports::assemble`] and [`super::Supports::assemble_magnitudes`].
    pub(super) fn assemble<T: Real, E: Send>(
        &self,
        field: &[Vector<T, D>],
        out: &mut [Vector<T, D>],
        magnitude: Magnitude,
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<(Vector<T, D>, Tensor<T, D>), E> + Sync,
    ) -> Result<(), E> {
        let buffers = ordered(self.blocks.len(), |b| {
            let block = &self.blocks[b];
            let nodal: Vec<Vector<T, D>> = block.nodes.iter().map(|&n| field[n as usize]).collect();
            let mut buffer = vec![Vector::zeros(); block.nodes.len()];
            for p in block.particles.clone() {
                let entries = block.entries(p);
                let (value, gradient) = block.gather(&nodal, entries.clone());
                let (force, stress) = point(p, value, gradient)?;
                for e in entries {
                    let (n, grad_n) = magnitude.of(block.values[e], block.gradients[e]);
                    buffer[block.local[e] as usize] += stress * grad_n.map(T::lit) + force * T::lit(n);
                }
            }
            Ok(buffer)
        })?;
        for (block, buffer) in self.blocks.iter().zip(buffers) {
            for (&node, contribution) in block.nodes.iter().zip(buffer) {
                out[node as usize] += contribution;
            }
        }
        Ok(())
    }

    /// `out_I += Σ_p scatter(p, N_I, ∇_n N_I)`: nothing is gathered.
    pub(super) fn scatter<O>(&self, out: &mut [O], scatter: impl Fn(usize, f64, &Vector<f64, D>) -> O + Sync)
    where
        O: Copy + Zero + AddAssign + Send,
    {
        let buffers = infallible(ordered(self.blocks.len(), |b| {
            let block = &self.blocks[b];
            let mut buffer = vec![O::zero(); block.nodes.len()];
            for p in block.particles.clone() {
                for e in block.entries(p) {
                    buffer[block.local[e] as usize] += scatter(p, block.values[e], &block.gradients[e]);
                }
            }
            Ok(buffer)
        }));
        for (block, buffer) in self.blocks.iter().zip(buffers) {
            for (&node, contribution) in block.nodes.iter().zip(buffer) {
                out[node as usize] += contribution;
            }
        }
    }

    /// `point(p, u_p, ∇u_p)` of every particle, in their order.
    ///
    /// # Errors
    /// The error of the first particle, in their order, whose `point` fails.
    pub(super) fn interpolate<T: Real, R: Send, E: Send>(
        &self,
        field: &[Vector<T, D>],
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<R, E> + Sync,
    ) -> Result<Vec<R>, E> {
        let parts = ordered(self.blocks.len(), |b| {
            let block = &self.blocks[b];
            let nodal: Vec<Vector<T, D>> = block.nodes.iter().map(|&n| field[n as usize]).collect();
            let mut part = Vec::with_capacity(block.particles.len());
            for p in block.particles.clone() {
                let (value, gradient) = block.gather(&nodal, block.entries(p));
                part.push(point(p, value, gradient)?);
            }
            Ok(part)
        })?;
        let mut results = Vec::with_capacity(self.particles);
        for part in parts {
            results.extend(part);
        }
        Ok(results)
    }
}

impl<const D: usize> Block<D> {
    /// The block with its nodes numbered by the sorted list of grid numbers returned beside it.
    fn new<A: ShapeFunction>(
        approximation: &A,
        grid: &Grid<D>,
        positions: &[Vector<f64, D>],
        particles: Range<usize>,
    ) -> Result<(Self, Vec<u64>), SupportError> {
        let mut scratch = Scratch::default();
        let mut support = Support::default();
        let (mut offsets, mut ids) = (vec![0], Vec::new());
        let (mut values, mut gradients) = (Vec::new(), Vec::new());
        for particle in particles.clone() {
            approximation
                .evaluate(grid, &positions[particle], &mut scratch, &mut support)
                .map_err(|source| SupportError { particle, source })?;
            ids.extend(support.nodes.iter().map(|&index| grid.id(index)));
            values.extend_from_slice(&support.values);
            gradients.extend(support.gradients.iter().map(|&gradient| Vector::from(gradient)));
            offsets.push(ids.len() as u32);
        }
        let mut unique = ids.clone();
        unique.sort_unstable();
        unique.dedup();
        let local = ids.iter().filter_map(|id| unique.binary_search(id).ok()).map(|place| place as u32).collect();
        Ok((Self { particles, nodes: Vec::new(), offsets, local, values, gradients }, unique))
    }

    #[inline(always)]
    fn entries(&self, particle: usize) -> Range<usize> {
        let k = particle - self.particles.start;
        self.offsets[k] as usize..self.offsets[k + 1] as usize
    }

    /// (Σ u_I N_I, Σ u_I ⊗ ∇_n N_I)
    #[inline(always)]
    fn gather<T: Real>(&self, nodal: &[Vector<T, D>], entries: Range<usize>) -> (Vector<T, D>, Tensor<T, D>) {
        let mut value = Vector::<T, D>::zeros();
        let mut gradient = Tensor::<T, D>::zeros();
        for e in entries {
            let u = &nodal[self.local[e] as usize];
            let (n, grad_n) = (T::lit(self.values[e]), &self.gradients[e]);
            for i in 0..D {
                value[i] += u[i] * n;
                for k in 0..D {
                    gradient[(i, k)] += u[i] * T::lit(grad_n[k]);
                }
            }
        }
        (value, gradient)
    }
}
