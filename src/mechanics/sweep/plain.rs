//! The plain loop over the particles, with one list of (node, N, ∇N) for each particle. It is the specification, and serves shape
//! functions that are not products.

use super::blocks::Quadratic;
use super::group::{At, Group};
use super::points::{Points, ShapeFunctionError};
use super::{Each, Evaluate, Mode, Point};
use crate::approximation::{Scratch, ShapeFunction, Support};
use crate::grid::Grid;
use crate::lanes::LANES;
use crate::parallel;
use crate::space::Nodes;
use crate::tensor::{Tensor, Vector};

/// Number of groups that one task evaluates: enough to pay for a task.
const TASK: usize = 32;

/// Number of groups whose results wait in memory at a time.
const BATCH: usize = 1024;

/// The shape functions of all particles, node by node.
#[derive(Debug)]
pub(super) struct Plain<const D: usize> {
    /// All particles in order, so that a [`Group`] can borrow its part.
    particles: Vec<u32>,
    /// Start of each particle's entries, and at last the end of all entries.
    offsets: Vec<usize>,
    /// Active node of each entry.
    nodes: Vec<u32>,
    /// N and ∇_r N of each entry.
    weights: Vec<(f64, Vector<f64, D>)>,
}

/// A node, N and ∇_r N.
type Entry<N, const D: usize> = (N, f64, Vector<f64, D>);

impl<const D: usize> Plain<D> {
    pub(super) fn new<A: ShapeFunction>(
        approximation: &A,
        grid: &Grid<D>,
        points: &Points<'_, D>,
    ) -> Result<(Self, Nodes), ShapeFunctionError> {
        let particles: Vec<u32> = (0..points.positions.len() as u32).collect();
        let tasks: Vec<_> = particles.chunks(TASK * LANES).collect();
        let lists = parallel::map(tasks.len(), &|task| lists(approximation, grid, points, tasks[task]));
        let lists = lists.into_iter().collect::<Result<Vec<_>, _>>()?;
        let nodes = Nodes::new(lists.iter().flat_map(|(_, ids)| ids).copied().collect());
        let mut offsets = vec![0];
        let mut numbers = Vec::new();
        let mut weights = Vec::new();
        for list in lists.into_iter().flat_map(|(lists, _)| lists) {
            numbers.extend(list.iter().filter_map(|(id, ..)| nodes.number(*id)).map(|node| node as u32));
            weights.extend(list.into_iter().map(|(_, n, grad_n)| (n, grad_n)));
            offsets.push(weights.len());
        }
        Ok((Self { particles, offsets, nodes: numbers, weights }, nodes))
    }

    pub(super) fn particles(&self) -> usize {
        self.particles.len()
    }

    pub(super) fn groups(&self) -> usize {
        self.particles.len().div_ceil(LANES)
    }

    fn group(&self, number: usize) -> Group<'_> {
        let end = ((number + 1) * LANES).min(self.particles.len());
        Group { number, particles: &self.particles[number * LANES..end] }
    }

    pub(super) fn each_group<'s>(&'s self, visit: &mut dyn FnMut(Group<'s>)) {
        (0..self.groups()).for_each(|group| visit(self.group(group)));
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.weights.as_slice())
            + size_of_val(self.nodes.as_slice())
            + size_of_val(self.offsets.as_slice())
            + size_of_val(self.particles.as_slice())
    }

    pub(super) fn of(&self, _: &Grid<D>, particle: usize) -> Vec<Entry<usize, D>> {
        self.entries(particle).collect()
    }

    fn entries(&self, particle: usize) -> impl Iterator<Item = Entry<usize, D>> {
        let range = self.offsets[particle]..self.offsets[particle + 1];
        let both = self.nodes[range.clone()].iter().zip(&self.weights[range]);
        both.map(|(&node, &(n, grad_n))| (node as usize, n, grad_n))
    }

    /// The pairs (lane, entry) of the particles of a group.
    fn entries_of(&self, group: Group<'_>) -> impl Iterator<Item = (usize, Entry<usize, D>)> {
        let lanes = group.particles.iter().enumerate();
        lanes.flat_map(|(lane, &p)| self.entries(p as usize).map(move |entry| (lane, entry)))
    }

    pub(super) fn sweep<const C: usize>(
        &self,
        fields: usize,
        field: Option<&[f64]>,
        mode: Mode,
        out: &mut [f64],
        point: &Point<'_, C, D>,
    ) {
        let evaluate = |group: Group<'_>| {
            let at = self.gathered(group, fields, field);
            let mut sums = vec![At::<f64, C, D>::zero(); fields];
            point(group, &at, &mut sums);
            sums
        };
        self.in_order(evaluate, |group, sums| {
            for (lane, (node, n, grad_n)) in self.entries_of(group) {
                let changed = mode.weights.changed().unwrap_or(|n| n);
                let (n, grad_n) = (changed(n), grad_n.map(changed));
                mutant!("sweep: the plain loop scatters stresses by one slope": grad_n = Vector::<f64, D>::repeat(grad_n[0]));
                for (f, sums) in sums.iter().enumerate() {
                    for c in 0..C {
                        let to = &mut out[(node * fields + f) * C + c];
                        if mode.value {
                            *to += sums.value[c][lane] * n;
                        }
                        for k in (0..D).filter(|_| mode.gradient) {
                            *to += sums.gradient[c][k][lane] * grad_n[k];
                        }
                    }
                }
            }
        });
    }

    pub(super) fn blocks(&self, out: &mut [Tensor<f64, D>], quadratic: &(dyn Fn(Group<'_>, &mut Quadratic) + Sync)) {
        let evaluate = |group: Group<'_>| {
            let mut form = Quadratic::zero();
            quadratic(group, &mut form);
            form
        };
        self.in_order(evaluate, |group, form| {
            for (lane, (node, n, grad_n)) in self.entries_of(group) {
                out[node] += form.block(lane, n, &grad_n);
            }
        });
    }

    /// Calls `evaluate(group, u and L, results)` for every group, with the results of the group.
    pub(super) fn results<R: Send, const C: usize>(
        &self,
        each: Each,
        modes: &[Mode],
        field: Option<&[f64]>,
        evaluate: &Evaluate<'_, R, C, D>,
        results: &mut [R],
    ) {
        let count = each.of_group(LANES);
        let tasks = results.chunks_mut(TASK * count).enumerate();
        parallel::for_each(tasks, &|(task, results): (usize, &mut [R])| {
            for (number, results) in results.chunks_mut(count).enumerate() {
                let group = self.group(task * TASK + number);
                evaluate(group, &self.gathered(group, modes.len(), field), results);
            }
        });
    }

    /// u = Σ u_I N_I and L = Σ u_I ⊗ ∇_r N_I of every field at the particles of a group; zero without a field.
    fn gathered<const C: usize>(&self, group: Group<'_>, fields: usize, field: Option<&[f64]>) -> Vec<At<f64, C, D>> {
        let mut at = vec![At::<f64, C, D>::zero(); fields];
        let Some(field) = field else { return at };
        for (lane, (node, n, grad_n)) in self.entries_of(group) {
            for (f, at) in at.iter_mut().enumerate() {
                for c in 0..C {
                    let u = field[(node * fields + f) * C + c];
                    at.value[c][lane] += u * n;
                    for k in 0..D {
                        at.gradient[c][k][lane] += u * grad_n[k];
                    }
                }
            }
        }
        at
    }

    /// Evaluates all groups on all cores, and takes their results in the order of the groups.
    fn in_order<R: Send>(&self, evaluate: impl Fn(Group<'_>) -> R + Sync, mut take: impl FnMut(Group<'_>, R)) {
        for first in (0..self.groups()).step_by(BATCH) {
            let end = (first + BATCH).min(self.groups());
            let tasks = parallel::map((end - first).div_ceil(TASK), &|task| {
                let start = first + task * TASK;
                let groups = start..(start + TASK).min(end);
                groups.map(|group| evaluate(self.group(group))).collect::<Vec<_>>()
            });
            tasks.into_iter().flatten().zip(first..).for_each(|(result, group)| take(self.group(group), result));
        }
    }
}

/// The shape functions of particles by the grid numbers of the nodes, and the numbers of all nodes in these lists.
type ListsOfParticles<const D: usize> = (Vec<Vec<Entry<u64, D>>>, Vec<u64>);

/// The shape functions of `particles`.
///
/// # Errors
/// The first particle without shape functions.
fn lists<A: ShapeFunction, const D: usize>(
    approximation: &A,
    grid: &Grid<D>,
    points: &Points<'_, D>,
    particles: &[u32],
) -> Result<ListsOfParticles<D>, ShapeFunctionError> {
    let mut scratch = Scratch::default();
    let mut support = Support::default();
    let mut lists: Vec<Vec<Entry<u64, D>>> = Vec::with_capacity(particles.len());
    for &p in particles {
        approximation
            .evaluate(grid, &points.positions[p as usize], &mut scratch, &mut support)
            .map_err(|source| ShapeFunctionError { particle: points.id(p as usize), source })?;
        let (extrapolation, field) = (points.extrapolation.get(&p), points.fields.field(p as usize));
        let nodes = support.nodes.iter().zip(&support.values).zip(&support.gradients);
        let entry = |((&index, &n), &gradient): ((_, &f64), &[f64; D])| {
            let grad_n = Vector::from(gradient);
            let rise = extrapolation.map_or(0.0, |by| grad_n.dot(by));
            (grid.id_in(field, index), n + rise, grad_n)
        };
        lists.push(nodes.map(entry).collect());
    }
    let mut ids: Vec<u64> = lists.iter().flatten().map(|(id, ..)| *id).collect();
    ids.sort_unstable();
    ids.dedup();
    Ok((lists, ids))
}
