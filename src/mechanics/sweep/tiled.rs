//! The sweep for products N = Π_k N_k: weights of each axis only, particles of a cell side by side in vector lanes.
//!
//! Particles are taken in the order (cell, id). A *group* is up to eight of them, of one cell or of a few neighbours
//! along x, with one window of nodes around them; a *block* is a cube of cells with one box of nodes.

use super::block::{Block, Groups};
use super::builder::{Row, block, number};
use super::columns::Family;
use super::diagonal::{Quadratic, pair};
use super::kernel::{Rows, of_lane, set_lane};
use super::lanes::LANES;
use super::laws::Laws;
use super::of_block;
use super::order::{self, Key};
use super::waves;
use super::{Inertia, Magnitude, SupportError, infallible, ordered};
use crate::approximation::{ApproximationError, Scratch, Separable, ShapeFunction, Support};
use crate::grid::Grid;
use crate::material::Law;
use crate::mechanics::point::Inadmissible;
use crate::nodes::Nodes;
use crate::parallel::{self, held};
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector};
use num_traits::Zero;
use std::any::TypeId;
use std::ops::AddAssign;
use std::sync::{Mutex, PoisonError};

/// The sums of a block from the field in its box and a point function.
type Kernel = fn(&Groups<f64, LANES>, &[f64], &mut [f64], &of_block::Point<'_>);

/// Shape functions of all particles, by axis.
#[derive(Clone, Debug, Default)]
pub(super) struct Tiled<const D: usize> {
    pub(super) blocks: Vec<Block>,
    /// Slot of each particle, eight for each group: group · 8 + lane.
    slots: Vec<u32>,
    /// The particles in their order.
    keys: Vec<Key>,
    /// What the nodes were numbered by, and what came out: memory for the next step.
    rows: Vec<Row>,
    nodes: Nodes,
    /// h, if the blocks are prepared for single precision.
    pub(super) unit: Option<f64>,
}

impl<const D: usize> Tiled<D> {
    /// As [`super::Supports::new`], for a shape function that is a product. The arrays of `spare` are used again, and its order.
    pub(super) fn new<A: ShapeFunction>(
        approximation: &A,
        product: &dyn Separable,
        grid: &Grid<D>,
        positions: &[Vector<f64, D>],
        ids: Option<&[u32]>,
        single: bool,
        spare: Option<Self>,
    ) -> Result<(Self, Nodes), SupportError> {
        // Whichever came first in time: the first particle without functions, and what they say of its whole position.
        let failure = |particle: usize, source: ApproximationError| {
            let (mut scratch, mut support) = (Scratch::default(), Support::default());
            let mut error = |x: &Vector<f64, D>| approximation.evaluate(grid, x, &mut scratch, &mut support).err();
            let id = |p: usize| ids.map_or(p, |ids| ids[p] as usize);
            let failing = positions.iter().enumerate().filter_map(|(p, x)| Some((id(p), error(x)?)));
            let (particle, source) = failing.min_by_key(|&(id, _)| id).unwrap_or((id(particle), source));
            SupportError { particle, source }
        };
        let Self { mut blocks, mut slots, keys, mut rows, nodes, .. } = spare.unwrap_or_default();
        let keys = order::sorted(grid, positions, ids, keys).map_err(|particle| {
            let outside = ApproximationError::Outside { position: Vec::new(), lower: Vec::new(), upper: Vec::new() };
            failure(particle, outside)
        })?;
        let runs = || keys.chunk_by(|a, b| order::block::<D>(a) == order::block::<D>(b));
        blocks.resize_with(runs().count(), Block::default);
        let (family, failed) = (Family::new(product), Mutex::new(None));
        parallel::for_each_with(blocks.iter_mut().zip(runs()), |scratch, (place, keys)| {
            match block(family, grid, positions, keys, single, std::mem::take(place), scratch) {
                Ok(built) => *place = built,
                Err(error) => keep_first(&mut held(&failed), keys[0].particle as usize, error),
            }
        });
        if let Some((particle, error)) = failed.into_inner().unwrap_or_else(PoisonError::into_inner) {
            return Err(failure(particle, error));
        }
        let (mut first, mut first_single) = (0, 0);
        for block in &mut blocks {
            block.groups.first = first;
            first += block.groups.len();
            if let Some(groups) = &mut block.single {
                groups.first = first_single;
                first_single += groups.len();
            }
        }
        let nodes = number(grid, &mut blocks, &mut rows, nodes.into_spare());
        slots.resize(positions.len(), 0);
        for block in &blocks {
            block.groups.each(|group, lane, p| slots[p] = ((block.groups.first + group) * LANES + lane) as u32);
        }
        let unit = single.then_some(grid.spacing);
        Ok((Self { blocks, slots, keys, rows, nodes: nodes.clone(), unit }, nodes))
    }

    pub(super) fn particles(&self) -> usize {
        self.slots.len()
    }

    /// The particles, block by block and group by group.
    pub(super) fn order(&self) -> impl Iterator<Item = u32> {
        self.keys.iter().map(|key| key.particle)
    }

    /// As if particles had been put in [`Self::order`], for the next step to start from.
    pub(super) fn rearrange(&mut self) {
        self.keys.iter_mut().zip(0..).for_each(|(key, place)| key.particle = place);
    }

    /// Number of groups.
    pub(super) fn groups(&self) -> usize {
        self.blocks.last().map_or(0, |last| last.groups.first + last.groups.len())
    }

    pub(super) fn windows(&self) -> Vec<([usize; 3], usize)> {
        let groups = self.blocks.iter().flat_map(|block| &block.groups.windows);
        groups.map(|group| (group.width.map(usize::from), usize::from(group.lanes))).collect()
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.slots.as_slice()) + self.blocks.iter().map(Block::bytes).sum::<usize>()
    }

    /// The group and the lane of a particle: (block, group in the block, lane).
    fn place(&self, particle: usize) -> (&Block, usize, usize) {
        let slot = self.slots[particle] as usize;
        let (group, lane) = (slot / LANES, slot % LANES);
        let block = &self.blocks[self.blocks.partition_point(|block| block.groups.first <= group) - 1];
        (block, group - block.groups.first, lane)
    }

    pub(super) fn of(&self, particle: usize) -> impl Iterator<Item = (usize, f64, Vector<f64, D>)> {
        let (block, group, lane) = self.place(particle);
        let mut entries = Vec::new();
        block.entries::<D>(group, lane, |place, n, grad_n| {
            if let Ok(at) = block.places.binary_search(&(place as u32)) {
                entries.push((block.nodes[at] as usize, n, grad_n));
            }
        });
        entries.into_iter()
    }

    pub(super) fn assemble<T: Real, E: Send>(
        &self,
        field: &[Vector<T, D>],
        out: &mut [Vector<T, D>],
        magnitude: Magnitude,
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<(Vector<T, D>, Tensor<T, D>), E> + Sync,
    ) -> Result<(), E> {
        if is_f64::<T>() {
            return self.assemble_lanes(field, out, magnitude, point);
        }
        let buffers = self.in_order(|block| {
            let nodal = block.boxed(field);
            let mut buffer = vec![Vector::zeros(); block.box_nodes()];
            let mut failure = None;
            block.groups.each(|group, lane, p| {
                let (value, gradient) = block.gather(group, lane, &nodal);
                match point(p, value, gradient) {
                    Ok((force, stress)) => block.entries::<D>(group, lane, |place, n, grad_n| {
                        let (n, grad_n) = magnitude.of(n, grad_n);
                        buffer[place] += stress * grad_n.map(T::lit) + force * T::lit(n);
                    }),
                    Err(error) => keep_first(&mut failure, p, error),
                }
            });
            failure.map_or(Ok(buffer), Err)
        })?;
        self.add(&buffers, out);
        Ok(())
    }

    fn assemble_lanes<T: Real, E: Send>(
        &self,
        field: &[Vector<T, D>],
        out: &mut [Vector<T, D>],
        magnitude: Magnitude,
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<(Vector<T, D>, Tensor<T, D>), E> + Sync,
    ) -> Result<(), E> {
        let one_by_one = |particles: &[u32], rows: &mut Rows| {
            let mut failure = None;
            for (lane, &p) in particles.iter().enumerate() {
                let (value, gradient) = of_lane(rows, lane);
                match point(p as usize, value, gradient) {
                    Ok((force, stress)) => set_lane(rows, lane, &force, &stress),
                    Err(error) => keep_first(&mut failure, p as usize, error),
                }
            }
            failure.map_or(Ok(()), Err)
        };
        let kernel = match magnitude {
            Magnitude::No => of_block::each,
            Magnitude::Yes => of_block::magnitudes,
        };
        self.by_group(field, out, kernel, one_by_one)
    }

    /// The sums of `kernel` with what `point` puts in the rows of each group.
    fn by_group<T: Real, E: Send>(
        &self,
        field: &[Vector<T, D>],
        out: &mut [Vector<T, D>],
        kernel: Kernel,
        point: impl Fn(&[u32], &mut Rows) -> Result<(), (usize, E)> + Sync,
    ) -> Result<(), E> {
        let failure = Mutex::new(None);
        let point = |particles: &[u32], rows: &mut Rows| {
            if let Err((p, error)) = point(particles, rows) {
                keep_first(&mut held(&failure), p, error);
            }
        };
        waves::run(self, Some(field), out, &|block, nodal, buffer| kernel(&block.groups, nodal, buffer, &point));
        let failure = failure.into_inner().unwrap_or_else(PoisonError::into_inner);
        failure.map_or(Ok(()), |(_, error)| Err(error))
    }

    /// As [`super::Supports::forces`].
    pub(super) fn forces<T: Real, L: Law>(
        &self,
        laws: &Laws<'_, D, L>,
        field: &[Vector<T, D>],
        inertia: Option<Inertia<'_, D>>,
        out: &mut [Vector<T, D>],
    ) -> Option<Result<(), Inadmissible>> {
        is_f64::<T>().then(|| {
            let evaluate = laws.stresses();
            let stresses =
                |particles: &[u32], rows: &mut Rows| evaluate(particles, rows).map_err(|error| (error.particle, error));
            let Some(inertia) = inertia else {
                return self.by_group(field, out, of_block::stresses, stresses);
            };
            self.by_group(field, out, of_block::each, |particles, rows| {
                for (lane, &p) in particles.iter().enumerate() {
                    let q = inertia(p as usize, &Vector::from_fn(|i, _| rows[i][lane]));
                    for i in 0..D {
                        rows[i][lane] = q[i];
                    }
                }
                stresses(particles, rows)
            })
        })
    }

    /// As [`super::Supports::force_magnitudes`].
    pub(super) fn force_magnitudes<T: Real, L: Law>(
        &self,
        laws: &Laws<'_, D, L>,
        field: &[Vector<T, D>],
        out: &mut [Vector<T, D>],
    ) -> Option<Result<(), Inadmissible>> {
        is_f64::<T>().then(|| {
            let evaluate = laws.stresses();
            self.by_group(field, out, of_block::magnitudes, |particles, rows| {
                evaluate(particles, rows).map_err(|error| (error.particle, error))?;
                rows[..D].fill([0.0; LANES]);
                rows[D..D + D * D].as_flattened_mut().iter_mut().for_each(|x| *x = x.abs());
                Ok(())
            })
        })
    }

    pub(super) fn scatter<O>(&self, out: &mut [O], scatter: impl Fn(usize, f64, &Vector<f64, D>) -> O + Sync)
    where
        O: Copy + Zero + AddAssign + Send + Sync,
    {
        let buffers = infallible(self.in_order(|block| {
            let mut buffer = vec![O::zero(); block.box_nodes()];
            block.groups.each(|group, lane, p| {
                block.entries::<D>(group, lane, |place, n, grad_n| buffer[place] += scatter(p, n, &grad_n));
            });
            Ok(buffer)
        }));
        self.add(&buffers, out);
    }

    pub(super) fn interpolate<T: Real, R: Send, E: Send>(
        &self,
        field: &[Vector<T, D>],
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<R, E> + Sync,
    ) -> Result<Vec<R>, E> {
        if is_f64::<T>() {
            return self.interpolate_lanes(field, point);
        }
        let parts = self.in_order(|block| {
            let nodal = block.boxed(field);
            let mut part = Vec::with_capacity(block.groups.len() * LANES);
            let mut failure = None;
            block.groups.each(|group, lane, p| {
                let (value, gradient) = block.gather(group, lane, &nodal);
                match point(p, value, gradient) {
                    Ok(result) => part.push((p, result)),
                    Err(error) => keep_first(&mut failure, p, error),
                }
            });
            failure.map_or(Ok(part), Err)
        })?;
        Ok(self.by_particle(parts))
    }

    fn interpolate_lanes<T: Real, R: Send, E: Send>(
        &self,
        field: &[Vector<T, D>],
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<R, E> + Sync,
    ) -> Result<Vec<R>, E> {
        let results = waves::gathered(self, field, vec![(); self.blocks.len()], |block, (), gathered| {
            let mut part = Vec::with_capacity(block.groups.len() * LANES);
            let mut failure = None;
            block.groups.each(|group, lane, p| {
                let (value, gradient) = of_lane(&gathered[group], lane);
                match point(p, value, gradient) {
                    Ok(result) => part.push((p, result)),
                    Err(error) => keep_first(&mut failure, p, error),
                }
            });
            failure.map_or(Ok(part), Err)
        });
        Ok(self.by_particle(first_error(results)?))
    }

    /// Results of the blocks in the order of the particles.
    fn by_particle<R>(&self, parts: Vec<Vec<(usize, R)>>) -> Vec<R> {
        let mut results: Vec<Option<R>> = (0..self.particles()).map(|_| None).collect();
        for (p, result) in parts.into_iter().flatten() {
            results[p] = Some(result);
        }
        // Every particle is in one group.
        results.into_iter().flatten().collect()
    }

    /// `out_I += Σ_p value(p) N_I`
    pub(super) fn spread(&self, out: &mut [Vector<f64, D>], value: impl Fn(usize) -> Vector<f64, D> + Sync) {
        let point = |particles: &[u32], rows: &mut Rows| {
            for (lane, &p) in particles.iter().enumerate() {
                let value = value(p as usize);
                for i in 0..D {
                    rows[i][lane] = value[i];
                }
            }
        };
        waves::run(self, None, out, &|block, _, buffer| of_block::spread(&block.groups, buffer, &point));
    }

    /// `out_I += Σ_p B_p(∇_n N_I, ∇_n N_I) + m_p N_I² I` with B_p = `bilinear`(p, ·, ·) and m_p = `mass`(p).
    pub(super) fn scatter_blocks(
        &self,
        out: &mut [Tensor<f64, D>],
        bilinear: impl Fn(usize, &Vector<f64, D>, &Vector<f64, D>) -> Tensor<f64, D> + Sync,
        mass: impl Fn(usize) -> f64 + Sync,
    ) {
        let unit = |k: usize| Vector::<f64, D>::from_fn(|i, _| if i == k { 1.0 } else { 0.0 });
        let quadratic = |particles: &[u32]| {
            let mut quadratic = Quadratic::zero();
            for (lane, &p) in particles.iter().enumerate() {
                let p = p as usize;
                quadratic.mass[lane] = mass(p);
                for l in 0..D {
                    for k in 0..=l {
                        let mut block = bilinear(p, &unit(k), &unit(l));
                        if k < l {
                            block += bilinear(p, &unit(l), &unit(k));
                        }
                        for i in 0..D {
                            for j in 0..D {
                                quadratic.bilinear[pair(k, l)][i][j][lane] = block[(i, j)];
                            }
                        }
                    }
                }
            }
            quadratic
        };
        self.blocks_by(out, &|block, buffer| of_block::quadratics(&block.groups, buffer, &quadratic));
    }

    /// `f` of every block, in their order; the error is that of the particle with the smallest id or place.
    fn in_order<R: Send, E: Send>(&self, f: impl Fn(&Block) -> Result<R, (usize, E)> + Sync) -> Result<Vec<R>, E> {
        first_error(infallible(ordered(self.blocks.len(), |b| Ok(f(&self.blocks[b])))))
    }

    /// Adds the boxes to the nodes, in the order of the blocks.
    fn add<O: Copy + AddAssign>(&self, buffers: &[Vec<O>], out: &mut [O]) {
        for (block, buffer) in self.blocks.iter().zip(buffers) {
            for (&node, &place) in block.nodes.iter().zip(&block.places) {
                out[node as usize] += buffer[place as usize];
            }
        }
    }
}

/// The results, or the error with the smallest number before it.
pub(super) fn first_error<R, E>(all: Vec<Result<R, (usize, E)>>) -> Result<Vec<R>, E> {
    let mut failure = None;
    let mut results = Vec::with_capacity(all.len());
    for result in all {
        match result {
            Ok(result) => results.push(result),
            Err((p, error)) => keep_first(&mut failure, p, error),
        }
    }
    failure.map_or(Ok(results), |(_, error)| Err(error))
}

/// Whether `T` is the number the lanes hold.
fn is_f64<T: Real>() -> bool {
    TypeId::of::<T>() == TypeId::of::<f64>()
}

/// Keeps the failure with the smallest number.
pub(super) fn keep_first<E>(first: &mut Option<(usize, E)>, p: usize, error: E) {
    if first.as_ref().is_none_or(|(q, _)| p < *q) {
        *first = Some((p, error));
    }
}
