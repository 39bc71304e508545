//! The plain loop over the particles, with one list of (node, N, ∇N) for each particle. It is the specification, and serves shape
//! functions that are not products.

use super::block::Group;
use super::blocks::Quadratic;
use super::kernel::At;
use super::lanes::LANES;
use super::{Fill, Flow, Point, Points, SupportError, Visit};
use crate::approximation::{Scratch, ShapeFunction, Support};
use crate::grid::Grid;
use crate::nodes::Nodes;
use crate::parallel;
use crate::tensor::{Tensor, Vector};
use num_traits::Zero;
use std::ops::{AddAssign, Range};

/// Particles of a block: enough to pay for a task, few enough to keep the nodes of a block in cache.
const BLOCK: usize = 256;

/// Number of groups in a block.
const GROUPS: usize = BLOCK / LANES;

/// The shape functions of all particles, node by node.
#[derive(Clone, Debug)]
pub(super) struct Plain<const D: usize> {
    blocks: Vec<Block<D>>,
    /// All particles in order, so that a [`Group`] can borrow its part.
    particles: Vec<u32>,
}

/// The entries (node, N, ∇_n N) of consecutive particles. A node is stored as its place in the block's own list of nodes.
#[derive(Clone, Debug)]
struct Block<const D: usize> {
    particles: Range<usize>,
    /// Active numbers of the block's nodes, ascending.
    nodes: Vec<u32>,
    /// Start of each particle's entries, and at last the end of all entries.
    offsets: Vec<u32>,
    places: Vec<u32>,
    weights: Vec<(f64, Vector<f64, D>)>,
}

impl<const D: usize> Plain<D> {
    pub(super) fn new<A: ShapeFunction>(
        approximation: &A,
        grid: &Grid<D>,
        points: &Points<'_, D>,
    ) -> Result<(Self, Nodes), SupportError> {
        let positions = &points.positions;
        let count = positions.len().div_ceil(BLOCK);
        let built = parallel::map(count, &|b| {
            let particles = b * BLOCK..((b + 1) * BLOCK).min(positions.len());
            Block::new(approximation, grid, points, particles)
        })
        .into_iter()
        .collect::<Result<Vec<_>, _>>()?;
        let nodes = Nodes::new(built.iter().map(|(_, ids)| ids.as_slice()));
        let blocks = built
            .into_iter()
            .map(|(mut block, ids)| {
                block.nodes = ids.iter().filter_map(|&id| nodes.number(id)).map(|n| n as u32).collect();
                block
            })
            .collect();
        Ok((Self { blocks, particles: (0..positions.len() as u32).collect() }, nodes))
    }

    pub(super) fn particles(&self) -> usize {
        self.particles.len()
    }

    pub(super) fn each_group(&self, visit: &mut dyn FnMut(Group<'_>)) {
        (0..self.blocks.len()).for_each(|b| self.groups_of(b).for_each(&mut *visit));
    }

    pub(super) fn groups(&self) -> usize {
        self.particles.len().div_ceil(LANES)
    }

    pub(super) fn bytes(&self) -> usize {
        let of_block = |block: &Block<D>| {
            let numbers = block.places.len() + block.nodes.len() + block.offsets.len();
            size_of_val(block.weights.as_slice()) + numbers * size_of::<u32>()
        };
        self.blocks.iter().map(of_block).sum::<usize>() + size_of_val(self.particles.as_slice())
    }

    pub(super) fn of(&self, particle: usize) -> Vec<(usize, f64, Vector<f64, D>)> {
        let block = &self.blocks[particle / BLOCK];
        block.entries(particle).map(|(place, n, grad_n)| (block.nodes[place] as usize, n, grad_n)).collect()
    }

    fn groups_of<'a>(&'a self, b: usize) -> impl Iterator<Item = Group<'a>> {
        let groups = self.particles[self.blocks[b].particles.clone()].chunks(LANES).enumerate();
        groups.map(move |(group, particles)| Group { number: b * GROUPS + group, particles })
    }

    pub(super) fn sweep<const C: usize>(
        &self,
        fields: usize,
        field: Option<&[f64]>,
        flow: Flow,
        out: &mut [f64],
        point: &Point<'_, C, D>,
    ) {
        let numbers = fields * C;
        self.scatter(numbers, out, |block, group, buffer: &mut [f64]| {
            let mut at = vec![At::<f64, C, D>::zero(); fields];
            let mut sums = at.clone();
            if let Some(field) = field {
                block.gather(group, field, &mut at);
            }
            point(group, &at, &mut sums);
            for (lane, (place, n, grad_n)) in block.entries_of(group) {
                let changed = flow.weights.changed().unwrap_or(|n| n);
                let (n, grad_n) = (changed(n), grad_n.map(changed));
                mutant!("sweep: the plain loop scatters stresses by one slope": grad_n = Vector::<f64, D>::repeat(grad_n[0]));
                for (f, sums) in sums.iter().enumerate() {
                    for c in 0..C {
                        let to = &mut buffer[place * numbers + f * C + c];
                        if flow.value {
                            *to += sums.value[c][lane] * n;
                        }
                        for k in (0..D).filter(|_| flow.gradient) {
                            *to += sums.gradient[c][k][lane] * grad_n[k];
                        }
                    }
                }
            }
        });
    }

    pub(super) fn blocks(&self, out: &mut [Tensor<f64, D>], quadratic: &(dyn Fn(Group<'_>, &mut Quadratic) + Sync)) {
        self.scatter(1, out, |block, group, buffer: &mut [Tensor<f64, D>]| {
            let mut form = Quadratic::zero();
            quadratic(group, &mut form);
            for (lane, (place, n, grad_n)) in block.entries_of(group) {
                buffer[place] += form.block(lane, n, &grad_n);
            }
        });
    }

    pub(super) fn each<R: Send, const C: usize>(
        &self,
        fields: usize,
        field: &[f64],
        _: Flow,
        point: &Visit<'_, R, C, D>,
        take: &mut dyn FnMut(usize, R),
    ) {
        let parts = parallel::map(self.blocks.len(), &|b| {
            let mut part = Vec::with_capacity(BLOCK);
            for group in self.groups_of(b) {
                let mut at = vec![At::<f64, C, D>::zero(); fields];
                self.blocks[b].gather(group, field, &mut at);
                let results = group.particles.iter().enumerate();
                part.extend(results.map(|(lane, &p)| point(p as usize, &at, lane)));
            }
            part
        });
        parts.into_iter().flatten().enumerate().for_each(|(p, result)| take(p, result));
    }

    pub(super) fn fill_rows(&self, field: &[f64], count: usize, rows: &mut [[f64; LANES]], fill: &Fill<'_, D>) {
        parallel::for_each(rows.chunks_mut(GROUPS * count).enumerate(), &|(b, rows)| {
            for (group, rows) in self.groups_of(b).zip(rows.chunks_mut(count)) {
                let mut at = [At::zero()];
                self.blocks[b].gather(group, field, &mut at);
                fill(group, &at[0], rows);
            }
        });
    }

    /// Calls `scatter(block, group, buffer)` for all groups. Each block has a buffer with `numbers` numbers a node. The buffers are added
    /// to `out` in the order of the blocks.
    fn scatter<Y: Copy + Zero + AddAssign + Send>(
        &self,
        numbers: usize,
        out: &mut [Y],
        scatter: impl Fn(&Block<D>, Group<'_>, &mut [Y]) + Sync,
    ) {
        let buffers = parallel::map(self.blocks.len(), &|b: usize| {
            let mut buffer = vec![Y::zero(); self.blocks[b].nodes.len() * numbers];
            self.groups_of(b).for_each(|group| scatter(&self.blocks[b], group, &mut buffer));
            buffer
        });
        for (block, buffer) in self.blocks.iter().zip(buffers) {
            for (&node, sums) in block.nodes.iter().zip(buffer.chunks(numbers)) {
                for (out, &sum) in out[node as usize * numbers..].iter_mut().zip(sums) {
                    *out += sum;
                }
            }
        }
    }
}

impl<const D: usize> Block<D> {
    /// The block with an empty node list, and the grid numbers of its nodes.
    ///
    /// # Errors
    /// The first particle without shape functions.
    fn new<A: ShapeFunction>(
        approximation: &A,
        grid: &Grid<D>,
        points: &Points<'_, D>,
        particles: Range<usize>,
    ) -> Result<(Self, Vec<u64>), SupportError> {
        let mut scratch = Scratch::default();
        let mut support = Support::default();
        let (mut offsets, mut found) = (vec![0], Vec::new());
        for particle in particles.clone() {
            approximation
                .evaluate(grid, &points.positions[particle], &mut scratch, &mut support)
                .map_err(|source| SupportError { particle, source })?;
            if let Some(by) = points.continued.get(&(particle as u32)) {
                let rises = support.gradients.iter().map(|&gradient| Vector::from(gradient).dot(by));
                support.values.iter_mut().zip(rises).for_each(|(n, rise)| *n += rise);
            }
            let slopes = support.gradients.iter().map(|&gradient| Vector::from(gradient));
            let entries = support.nodes.iter().zip(&support.values).zip(slopes);
            found.extend(entries.map(|((&index, &n), grad_n)| (grid.id(index), n, grad_n)));
            offsets.push(found.len() as u32);
        }
        let mut ids: Vec<u64> = found.iter().map(|entry| entry.0).collect();
        ids.sort_unstable();
        ids.dedup();
        let place = |id: u64| ids.partition_point(|&before| before < id) as u32;
        let (places, weights) = found.into_iter().map(|(id, n, grad_n)| (place(id), (n, grad_n))).unzip();
        Ok((Self { particles, nodes: Vec::new(), offsets, places, weights }, ids))
    }

    /// The entries (place, N, ∇_n N) of a particle.
    fn entries(&self, particle: usize) -> impl Iterator<Item = (usize, f64, Vector<f64, D>)> {
        let k = particle - self.particles.start;
        let range = self.offsets[k] as usize..self.offsets[k + 1] as usize;
        let both = self.places[range.clone()].iter().zip(&self.weights[range]);
        both.map(|(&place, &(n, grad_n))| (place as usize, n, grad_n))
    }

    /// The pairs (lane, entry) of the particles of a group.
    fn entries_of(&self, group: Group<'_>) -> impl Iterator<Item = (usize, (usize, f64, Vector<f64, D>))> {
        let lanes = group.particles.iter().enumerate();
        lanes.flat_map(|(lane, &p)| self.entries(p as usize).map(move |entry| (lane, entry)))
    }

    /// Adds Σ u_I N_I and Σ u_I ⊗ ∇_n N_I of the particles of a group to `at`.
    fn gather<const C: usize>(&self, group: Group<'_>, field: &[f64], at: &mut [At<f64, C, D>]) {
        let numbers = at.len() * C;
        for (lane, (place, n, grad_n)) in self.entries_of(group) {
            let node = self.nodes[place] as usize;
            for (f, at) in at.iter_mut().enumerate() {
                for c in 0..C {
                    let u = field[node * numbers + f * C + c];
                    at.value[c][lane] += u * n;
                    for k in 0..D {
                        at.gradient[c][k][lane] += u * grad_n[k];
                    }
                }
            }
        }
    }
}
