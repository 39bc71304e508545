//! The sweep for products N = Π_k N_k: weights of each axis only, particles of a cell side by side in vector lanes.
//!
//! Particles are taken in the order (cell, number). A *group* is up to eight of them, of one cell or of a few neighbours
//! along x, with one window of nodes around them; a *block* is a cube of cells with one box of nodes.

use super::builder::block;
use super::kernel::{Gathered, Quadratic, Stored, Terms, Window, pair, scatter_blocks};
use super::lanes::{LANES, Lanes, WithLanes, widest};
use super::order::{self, Key};
use super::waves::{self, Stage};
use super::{Magnitude, SupportError, infallible, ordered};
use crate::approximation::{ApproximationError, Scratch, Separable, ShapeFunction, Support};
use crate::grid::Grid;
use crate::nodes::Nodes;
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector};
use num_traits::Zero;
use std::any::TypeId;
use std::marker::PhantomData;
use std::ops::AddAssign;

/// Shape functions of all particles, by axis.
#[derive(Clone, Debug)]
pub(super) struct Tiled<const D: usize> {
    pub(super) blocks: Vec<Block<D>>,
    /// Slot of each particle, eight for each group: group · 8 + lane.
    slots: Vec<u32>,
}

/// A cube of cells: its groups, its box of nodes, and which of them are active.
#[derive(Clone, Debug)]
pub(super) struct Block<const D: usize> {
    /// Number of the first group, over all blocks.
    pub(super) first_group: usize,
    pub(super) groups: Vec<Group>,
    /// Weights of the groups, one after the other, as in [`Window`].
    pub(super) weights: Vec<[f64; LANES]>,
    /// Particles of each group; the lanes behind them hold zeros.
    pub(super) particles: Vec<[u32; LANES]>,
    /// Index of the first node of the box along each axis.
    pub(super) origin: [u32; D],
    /// Nodes of the box along each axis; 1 along axes that do not exist.
    pub(super) size: [usize; 3],
    /// Active numbers of the block's nodes, ascending.
    pub(super) nodes: Vec<u32>,
    /// Their places in the box.
    pub(super) places: Vec<u32>,
}

/// Up to eight particles and their common window.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    /// Where its weights begin.
    pub(super) weights: u32,
    /// The first node of the window, as a place in the box.
    pub(super) first: u32,
    /// Nodes along each axis; 1 along axes that do not exist.
    pub(super) width: [u8; 3],
    /// Number of particles.
    pub(super) lanes: u8,
}

impl<const D: usize> Tiled<D> {
    /// As [`super::Supports::new`], for a shape function that is a product.
    pub(super) fn new<A: ShapeFunction>(
        approximation: &A,
        product: &dyn Separable,
        grid: &Grid<D>,
        positions: &[Vector<f64, D>],
    ) -> Result<(Self, Nodes), SupportError> {
        // The product names the axis that fails; the shape function names the whole position.
        let failure = |particle: usize, source: Option<ApproximationError>| {
            let whole =
                approximation.evaluate(grid, &positions[particle], &mut Scratch::default(), &mut Support::default());
            let outside = || ApproximationError::Outside { position: Vec::new(), lower: Vec::new(), upper: Vec::new() };
            SupportError { particle, source: whole.err().or(source).unwrap_or_else(outside) }
        };
        let keys = order::sorted(grid, positions).map_err(|particle| failure(particle, None))?;
        let mut runs: Vec<&[Key]> = Vec::new();
        for run in keys.chunk_by(|a, b| order::block::<D>(a) == order::block::<D>(b)) {
            runs.push(run);
        }
        let built = infallible(ordered(runs.len(), |b| Ok(block(product, grid, positions, runs[b]))));
        let mut first_failure: Option<(usize, ApproximationError)> = None;
        let (mut blocks, mut active) = (Vec::with_capacity(built.len()), Vec::with_capacity(built.len()));
        let mut first_group = 0;
        for result in built {
            match result {
                Ok((mut block, mask)) => {
                    block.first_group = first_group;
                    first_group += block.groups.len();
                    blocks.push(block);
                    active.push(mask);
                }
                Err((p, source)) => {
                    if first_failure.as_ref().is_none_or(|(first, _)| p < *first) {
                        first_failure = Some((p, source));
                    }
                }
            }
        }
        if let Some((p, source)) = first_failure {
            return Err(failure(p, Some(source)));
        }
        let nodes = number(grid, &mut blocks, &active);
        let mut slots = vec![0; positions.len()];
        for block in &blocks {
            for (g, (group, particles)) in block.groups.iter().zip(&block.particles).enumerate() {
                for (lane, &p) in particles[..usize::from(group.lanes)].iter().enumerate() {
                    slots[p as usize] = ((block.first_group + g) * LANES + lane) as u32;
                }
            }
        }
        Ok((Self { blocks, slots }, nodes))
    }

    pub(super) fn particles(&self) -> usize {
        self.slots.len()
    }

    /// Number of groups.
    pub(super) fn groups(&self) -> usize {
        self.blocks.last().map_or(0, |last| last.first_group + last.groups.len())
    }

    pub(super) fn windows(&self) -> Vec<([usize; 3], usize)> {
        let groups = self.blocks.iter().flat_map(|block| &block.groups);
        groups.map(|group| (group.width.map(usize::from), usize::from(group.lanes))).collect()
    }

    pub(super) fn bytes(&self) -> usize {
        let of_block = |block: &Block<D>| {
            size_of_val(block)
                + size_of_val(block.groups.as_slice())
                + size_of_val(block.weights.as_slice())
                + size_of_val(block.particles.as_slice())
                + size_of_val(block.nodes.as_slice())
                + size_of_val(block.places.as_slice())
        };
        size_of_val(self.slots.as_slice()) + self.blocks.iter().map(of_block).sum::<usize>()
    }

    /// The group and the lane of a particle: (block, group in the block, lane).
    fn place(&self, particle: usize) -> (&Block<D>, usize, usize) {
        let slot = self.slots[particle] as usize;
        let (group, lane) = (slot / LANES, slot % LANES);
        let block = &self.blocks[self.blocks.partition_point(|block| block.first_group <= group) - 1];
        (block, group - block.first_group, lane)
    }

    pub(super) fn of(&self, particle: usize) -> impl Iterator<Item = (usize, f64, Vector<f64, D>)> {
        let (block, group, lane) = self.place(particle);
        let mut entries = Vec::new();
        block.entries(group, lane, |place, n, grad_n| {
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
            let (point, number) = (&point, PhantomData::<fn() -> T>);
            return match magnitude {
                Magnitude::No => waves::run(self, Some(field), out, &EachParticle::<_, _, false> { point, number }),
                Magnitude::Yes => waves::run(self, Some(field), out, &EachParticle::<_, _, true> { point, number }),
            };
        }
        let buffers = self.in_order(|block| {
            let nodal = block.boxed(field);
            let mut buffer = vec![Vector::zeros(); block.box_nodes()];
            let mut failure = None;
            block.each(|group, lane, p| {
                let (value, gradient) = block.gather(group, lane, &nodal);
                match point(p, value, gradient) {
                    Ok((force, stress)) => block.entries(group, lane, |place, n, grad_n| {
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

    pub(super) fn scatter<O>(&self, out: &mut [O], scatter: impl Fn(usize, f64, &Vector<f64, D>) -> O + Sync)
    where
        O: Copy + Zero + AddAssign + Send + Sync,
    {
        let buffers = infallible(self.in_order(|block| {
            let mut buffer = vec![O::zero(); block.box_nodes()];
            block.each(|group, lane, p| {
                block.entries(group, lane, |place, n, grad_n| buffer[place] += scatter(p, n, &grad_n));
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
            block.each(|group, lane, p| {
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
        let results = waves::gathered(self, field, vec![(); self.blocks.len()], |block, (), stored| {
            let mut part = Vec::with_capacity(block.groups.len() * LANES);
            let mut failure = None;
            block.each(|group, lane, p| {
                let (value, gradient) = stored[group].of_lane(lane);
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
        infallible(waves::run(self, None, out, &Spread { value }));
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
            let mut quadratic = Quadratic::<D>::zero();
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
        let work = |block: &Block<D>, _: &mut Vec<f64>, buffer: &mut [f64]| {
            for group in 0..block.groups() {
                let from = quadratic(block.particles(group));
                widest(Blocks { window: block.window(group), from: &from, buffer });
            }
            None::<std::convert::Infallible>
        };
        let add = |block: &Block<D>, buffer: &[f64], first: usize, out: &mut [Tensor<f64, D>]| {
            block.add(buffer, D * D, first, out, |sum, rows| {
                *sum += Tensor::from_fn(|i, k| rows[i * D + k]);
            });
        };
        waves::each_block(self, D * D, out, work, add, |never| match never {});
    }

    /// `f` of every block, in their order; the error is that of the particle with the smallest number.
    fn in_order<R: Send, E: Send>(&self, f: impl Fn(&Block<D>) -> Result<R, (usize, E)> + Sync) -> Result<Vec<R>, E> {
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

/// The results, or the error of the particle with the smallest number.
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

/// Keeps the failure of the smallest particle.
pub(super) fn keep_first<E>(first: &mut Option<(usize, E)>, p: usize, error: E) {
    if first.as_ref().is_none_or(|(q, _)| p < *q) {
        *first = Some((p, error));
    }
}

impl<const D: usize> Block<D> {
    pub(super) fn groups(&self) -> usize {
        self.groups.len()
    }

    /// Nodes of the box.
    pub(super) fn box_nodes(&self) -> usize {
        self.size.iter().product()
    }

    /// The particles of a group.
    #[inline(always)]
    pub(super) fn particles(&self, group: usize) -> &[u32] {
        &self.particles[group][..usize::from(self.groups[group].lanes)]
    }

    /// Window and weights of a group.
    #[inline(always)]
    pub(super) fn window(&self, group: usize) -> Window<'_> {
        let Group { weights, first, width, lanes } = self.groups[group];
        let width = width.map(usize::from);
        let rows = 2 * width[..D].iter().sum::<usize>();
        Window {
            width,
            weights: &self.weights[weights as usize..weights as usize + rows],
            lanes: usize::from(lanes),
            first: first as usize,
            stride: [self.size[0], self.size[0] * self.size[1]],
        }
    }

    /// Fills the box from a field on the active nodes; zero at the others.
    pub(super) fn fill<T: Real>(&self, field: &[Vector<T, D>], nodal: &mut [f64]) {
        nodal.fill(0.0);
        for (&node, &place) in self.nodes.iter().zip(&self.places) {
            for c in 0..D {
                nodal[place as usize * D + c] = field[node as usize][c].value();
            }
        }
    }

    /// Adds the part of the box, `numbers` numbers a node, that lies on the active nodes `first ..` of which `out` holds the sums.
    pub(super) fn add<O>(
        &self,
        buffer: &[f64],
        numbers: usize,
        first: usize,
        out: &mut [O],
        add: impl Fn(&mut O, &[f64]),
    ) {
        let start = self.nodes.partition_point(|&node| (node as usize) < first);
        let end = self.nodes.partition_point(|&node| (node as usize) < first + out.len());
        for (&node, &place) in self.nodes[start..end].iter().zip(&self.places[start..end]) {
            let place = place as usize * numbers;
            add(&mut out[node as usize - first], &buffer[place..place + numbers]);
        }
    }

    fn boxed<T: Real>(&self, field: &[Vector<T, D>]) -> Vec<Vector<T, D>> {
        let mut nodal = vec![Vector::zeros(); self.box_nodes()];
        for (&node, &place) in self.nodes.iter().zip(&self.places) {
            nodal[place as usize] = field[node as usize];
        }
        nodal
    }

    /// Calls `visit(group, lane, particle)`.
    pub(super) fn each(&self, mut visit: impl FnMut(usize, usize, usize)) {
        for group in 0..self.groups.len() {
            for (lane, &p) in self.particles(group).iter().enumerate() {
                visit(group, lane, p as usize);
            }
        }
    }

    /// Calls `visit(place in the box, N, ∇N)` for the nodes a particle sees: those with N ≠ 0 or ∇N ≠ 0.
    #[inline(always)]
    pub(super) fn entries(&self, group: usize, lane: usize, mut visit: impl FnMut(usize, f64, Vector<f64, D>)) {
        let window = self.window(group);
        let weights = |k: usize, at: usize| {
            let (n, dn) = window.axis(k);
            [n[at][lane], dn[at][lane]]
        };
        // Along an axis that does not exist N = 1.
        let mut w = [[1.0, 0.0]; 3];
        for z in 0..window.width[2] {
            if D > 2 {
                w[2] = weights(2, z);
            }
            for y in 0..window.width[1] {
                if D > 1 {
                    w[1] = weights(1, y);
                }
                let row = window.first + y * window.stride[0] + z * window.stride[1];
                for x in 0..window.width[0] {
                    w[0] = weights(0, x);
                    let n: f64 = (0..D).map(|k| w[k][0]).product();
                    let grad_n: Vector<f64, D> =
                        Vector::from_fn(|k, _| (0..D).map(|m| w[m][usize::from(m == k)]).product());
                    if n != 0.0 || grad_n.iter().any(|&g| g != 0.0) {
                        visit(row + x, n, grad_n);
                    }
                }
            }
        }
    }

    /// (Σ u_I N_I, Σ u_I ⊗ ∇_n N_I)
    #[inline(always)]
    fn gather<T: Real>(&self, group: usize, lane: usize, nodal: &[Vector<T, D>]) -> (Vector<T, D>, Tensor<T, D>) {
        let (mut value, mut gradient) = (Vector::<T, D>::zeros(), Tensor::<T, D>::zeros());
        self.entries(group, lane, |place, n, grad_n| {
            let (u, n) = (&nodal[place], T::lit(n));
            for i in 0..D {
                value[i] += u[i] * n;
                for k in 0..D {
                    gradient[(i, k)] += u[i] * T::lit(grad_n[k]);
                }
            }
        });
        (value, gradient)
    }
}

/// A point function that knows one particle at a time, for numbers that are `f64`.
struct EachParticle<'a, T, F, const MAGNITUDE: bool> {
    point: &'a F,
    number: PhantomData<fn() -> T>,
}

impl<T, F, const MAGNITUDE: bool> Terms for EachParticle<'_, T, F, MAGNITUDE> {
    const VALUE: bool = true;
    const GRADIENT: bool = true;
    const MAGNITUDE: bool = MAGNITUDE;
}

impl<T, E, F, const MAGNITUDE: bool, const D: usize> Stage<D> for EachParticle<'_, T, F, MAGNITUDE>
where
    T: Real,
    E: Send,
    F: Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<(Vector<T, D>, Tensor<T, D>), E> + Sync,
{
    type Error = E;

    #[inline(always)]
    fn point<S: Lanes>(
        &self,
        s: S,
        _group: usize,
        particles: &[u32],
        at: &mut Gathered<S::N, D>,
    ) -> Result<(), (usize, E)> {
        let mut stored = Stored::<D>::of(s, at);
        one_by_one(self.point, particles, &mut stored)?;
        *at = stored.load(s);
        Ok(())
    }
}

/// Not inlined: it is better off without the wide instructions of the code around it.
#[inline(never)]
fn one_by_one<T: Real, E, const D: usize>(
    point: &impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<(Vector<T, D>, Tensor<T, D>), E>,
    particles: &[u32],
    stored: &mut Stored<D>,
) -> Result<(), (usize, E)> {
    let mut failure = None;
    for (lane, &p) in particles.iter().enumerate() {
        let (value, gradient) = stored.of_lane(lane);
        match point(p as usize, value, gradient) {
            Ok((force, stress)) => stored.set_lane(lane, &force, &stress),
            Err(error) => keep_first(&mut failure, p as usize, error),
        }
    }
    failure.map_or(Ok(()), Err)
}

/// q = `value`(p), whatever the field.
struct Spread<F> {
    value: F,
}

impl<F> Terms for Spread<F> {
    const VALUE: bool = true;
    const GRADIENT: bool = false;
    const MAGNITUDE: bool = false;
}

impl<F: Fn(usize) -> Vector<f64, D> + Sync, const D: usize> Stage<D> for Spread<F> {
    type Error = std::convert::Infallible;

    #[inline(always)]
    fn point<S: Lanes>(
        &self,
        s: S,
        _group: usize,
        particles: &[u32],
        at: &mut Gathered<S::N, D>,
    ) -> Result<(), (usize, Self::Error)> {
        let mut values = [[0.0; LANES]; D];
        for (lane, &p) in particles.iter().enumerate() {
            let value = (self.value)(p as usize);
            for i in 0..D {
                values[i][lane] = value[i];
            }
        }
        for i in 0..D {
            at.value[i] = s.load(&values[i]);
        }
        Ok(())
    }
}

/// The diagonal blocks of one group.
struct Blocks<'a, const D: usize> {
    window: Window<'a>,
    from: &'a Quadratic<D>,
    buffer: &'a mut [f64],
}

impl<const D: usize> WithLanes for Blocks<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        scatter_blocks(s, &self.window, self.from, self.buffer);
    }
}

/// Numbers the active nodes in the order of the grid, and gives each block those of its box. `active` marks them in the
/// boxes.
fn number<const D: usize>(grid: &Grid<D>, blocks: &mut [Block<D>], active: &[Vec<bool>]) -> Nodes {
    /// A row of a box along x, by the grid number of the row's node at x = 0.
    struct Row {
        start: u64,
        x: usize,
        block: usize,
        /// Its first node in the box, and the end of the row.
        place: usize,
        end: usize,
    }
    let mut rows = Vec::new();
    for (b, block) in blocks.iter().enumerate() {
        let [nx, ny, nz] = block.size;
        for z in 0..nz {
            for y in 0..ny {
                let mut index = block.origin;
                for (k, offset) in [(1, y), (2, z)] {
                    if k < D {
                        index[k] += offset as u32;
                    }
                }
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
    for same in rows.chunk_by(|a, b| a.start == b.start) {
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
