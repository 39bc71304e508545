//! The shape functions of all particles, evaluated once, and their storage for the passes over the particles.

use super::columns::WIDEST;
use super::group::Group;
use super::plain::Plain;
use super::points::{Points, ShapeFunctionError};
use super::tiled::Tiled;
use super::{Each, shares};
use crate::aggregation::Extension;
use crate::approximation::ShapeFunction;
use crate::gpu::{Copies, Gpu};
use crate::grid::Grid;
use crate::parallel::Processes;
use crate::pooled::{Element, Pool, Pooled};
use crate::scalar::Real;
use crate::space::{Nodes, Space};
use crate::tensor::{Tensor, Vector};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// The shape-function values and the connectivity of all particles at the last grid reset, and the active nodes.
///
/// ```
/// use bfree::approximation::Lme;
/// use bfree::grid::Grid;
/// use bfree::mechanics::sweep::Connectivity;
/// use bfree::shape::{Ball, Filling, fill};
/// use bfree::tensor::{Vector, identity};
///
/// let grid = Grid { origin: Vector::zeros(), spacing: 0.5, cells: [12, 12] };
/// let disc = Ball { center: Vector::from([3.0, 3.0]), radius: 2.0 }.into();
/// let seeds = fill(&grid, &disc, Filling { per_axis: 2, ..Filling::default() })?;
/// let positions: Vec<_> = seeds.iter().map(|seed| seed.position).collect();
/// let (connectivity, nodes) = Connectivity::new(&Lme::new(3.0, 1e-6), &grid, &positions)?;
/// assert_eq!(connectivity.particles(), positions.len());
/// // The field x_I is reproduced at the particles: Σ N x_I = x, Σ x_I ⊗ ∇N = I.
/// let x: Vec<_> = nodes.positions(&grid).map(|(_, x)| x).collect();
/// let apart = connectivity.values(&x).iter().zip(&positions).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
/// assert!(apart < 1e-13);
/// assert!((connectivity.gradient_at(7, &x) - identity()).norm() < 1e-12);
/// let sum: f64 = connectivity.of(7).map(|(_, n, _)| n).sum();
/// assert!((sum - 1.0).abs() < 1e-14);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Connectivity<const D: usize> {
    pub(super) implementation: Implementation<D>,
    pub(super) grid: Grid<D>,
    /// Active nodes.
    pub(super) nodes: Nodes,
    /// The nodal field of each body; empty if there is one field.
    pub(super) fields: Vec<u32>,
    /// Number of passes over all particles so far.
    passes: AtomicU64,
    /// Memory pool of the nodal fields.
    pool: Pool,
    /// The extension u = E û by which outer nodes follow inner ones; `None` where every node is an unknown.
    extension: Option<Arc<Extension>>,
    /// The device on which Newton's method and the transfers run.
    pub(super) gpu: Option<Arc<Gpu>>,
    /// Copies in its memory.
    pub(super) copies: Copies,
}

/// An implementation of the loop over the particles.
#[derive(Debug)]
pub(super) enum Implementation<const D: usize> {
    Plain(Plain<D>),
    Tiled(Tiled<D>),
}

/// Calls one method of whichever [`Implementation`] is stored.
macro_rules! dispatch {
    ($self:expr, $one:ident => $call:expr) => {
        match &$self.implementation {
            Implementation::Plain($one) => $call,
            Implementation::Tiled($one) => $call,
        }
    };
}

pub(super) use dispatch;

impl<const D: usize> Connectivity<D> {
    /// Evaluates the shape functions at all positions and numbers the active nodes.
    ///
    /// # Errors
    /// The first particle lies outside the grid, or has no shape functions.
    pub fn new<A: ShapeFunction>(
        approximation: &A,
        grid: &Grid<D>,
        positions: &[Vector<f64, D>],
    ) -> Result<(Self, Nodes), ShapeFunctionError> {
        Self::rebuilt(None, approximation, grid, &Points::at(positions), &Pool::default())
    }

    /// [`Self::new`] in the memory of `reused`, such as the connectivity of the last step. Sorting begins with the order of particles
    /// in `reused`. The result does not depend on `reused`. If the points have ids, the result does not depend on the order of particles
    /// in memory either, because sums run over cells and ids.
    ///
    /// ```
    /// use bfree::mechanics::{check::direction, sweep::{Points, Connectivity}};
    /// use bfree::pooled::Pool;
    /// use bfree::tensor::Vector;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (shape, grid) = (&simulation.approximation, &simulation.grid);
    /// let before = &simulation.particles.position;
    /// let now: Vec<_> = before.iter().map(|x| x + Vector::from([0.3, 0.1])).collect();
    /// let (last, _) = Connectivity::new(shape, grid, before)?;
    /// let (rebuilt, nodes) = Connectivity::rebuilt(Some(last), shape, grid, &Points::at(&now), &Pool::default())?;
    /// let (anew, same_nodes) = Connectivity::new(shape, grid, &now)?;
    /// assert_eq!(nodes, same_nodes);
    /// let field = direction::<2>(nodes.len(), 1);
    /// assert_eq!(rebuilt.values(&field), anew.values(&field));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The errors of [`Self::new`].
    pub fn rebuilt<A: ShapeFunction>(
        reused: Option<Self>,
        approximation: &A,
        grid: &Grid<D>,
        points: &Points<'_, D>,
        pool: &Pool,
    ) -> Result<(Self, Nodes), ShapeFunctionError> {
        let (implementation, nodes) = match approximation.separable() {
            Some(product) if product.width() <= WIDEST => {
                let reused = reused.and_then(|reused| match reused.implementation {
                    Implementation::Plain(_) => None,
                    Implementation::Tiled(tiled) => Some(tiled),
                });
                let (tiled, nodes) = Tiled::new(approximation, product, grid, points, reused, pool)?;
                (Implementation::Tiled(tiled), nodes)
            }
            _ => {
                let (plain, nodes) = Plain::new(approximation, grid, points)?;
                (Implementation::Plain(plain), nodes)
            }
        };
        Ok((Self::of_implementation(implementation, grid, &nodes, points, pool), nodes))
    }

    /// [`Self::new`] with the plain loop for every shape function. The plain loop is the specification of the fast one.
    ///
    /// ```
    /// use bfree::approximation::Lme;
    /// use bfree::grid::Grid;
    /// use bfree::mechanics::{check::direction, sweep::Connectivity};
    /// use bfree::shape::{Ball, Filling, fill};
    /// use bfree::tensor::Vector;
    ///
    /// let grid = Grid { origin: Vector::zeros(), spacing: 0.5, cells: [12, 12] };
    /// let disc = Ball { center: Vector::from([3.0, 3.0]), radius: 2.0 }.into();
    /// let seeds = fill(&grid, &disc, Filling { per_axis: 2, ..Filling::default() })?;
    /// let (lme, positions) = (Lme::new(3.0, 1e-6), seeds.iter().map(|seed| seed.position).collect::<Vec<_>>());
    /// let (fast, nodes) = Connectivity::new(&lme, &grid, &positions)?;
    /// let (plain, same_nodes) = Connectivity::plain(&lme, &grid, &positions)?;
    /// assert_eq!(nodes, same_nodes);
    /// let field = direction::<2>(nodes.len(), 1);
    /// let (of_fast, of_plain) = (fast.values(&field), plain.values(&field));
    /// let apart = of_fast.iter().zip(&of_plain).map(|(a, b)| (a - b).norm());
    /// assert!(apart.fold(0.0, f64::max) < 1e-14);
    /// // The fast loop stores functions of one coordinate, not N and ∇N of every node. Particles that share their nodes form groups.
    /// assert!(fast.bytes() < plain.bytes());
    /// assert_eq!(fast.windows().iter().map(|(_, particles)| particles).sum::<usize>(), positions.len());
    /// assert!(plain.windows().is_empty());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The errors of [`Self::new`].
    pub fn plain<A: ShapeFunction>(
        approximation: &A,
        grid: &Grid<D>,
        positions: &[Vector<f64, D>],
    ) -> Result<(Self, Nodes), ShapeFunctionError> {
        let points = Points::at(positions);
        let (plain, nodes) = Plain::new(approximation, grid, &points)?;
        Ok((Self::of_implementation(Implementation::Plain(plain), grid, &nodes, &points, &Pool::default()), nodes))
    }

    fn of_implementation(
        implementation: Implementation<D>,
        grid: &Grid<D>,
        nodes: &Nodes,
        points: &Points<'_, D>,
        pool: &Pool,
    ) -> Self {
        let (nodes, fields, pool) = (nodes.clone(), points.fields.of_body.clone(), pool.clone());
        let (passes, copies, extension, gpu) = (AtomicU64::new(0), Copies::default(), None, None);
        Self { implementation, grid: *grid, nodes, fields, passes, pool, extension, gpu, copies }
    }

    /// The fast loop, if the shape functions are products.
    pub(super) fn tiled(&self) -> Option<&Tiled<D>> {
        match &self.implementation {
            Implementation::Plain(_) => None,
            Implementation::Tiled(tiled) => Some(tiled),
        }
    }

    /// This connectivity with an extension u = E û: outer nodes follow inner ones, and equilibria are solved for the inner nodes alone.
    pub(crate) fn with_extension(self, extension: Extension) -> Self {
        Self { extension: Some(Arc::new(extension)), ..self }
    }

    /// The extension by which outer nodes follow inner ones; `None` where every active node is an unknown.
    pub fn extension(&self) -> Option<&Arc<Extension>> {
        self.extension.as_ref()
    }

    /// A nodal field of zeros, one entry for each active node, from the memory pool.
    pub(crate) fn field<T: Element + num_traits::Zero>(&self) -> Pooled<T> {
        self.pool.filled(self.nodes.len(), T::zero())
    }

    /// The space of nodal fields with these prescribed values: (node, component).
    pub(crate) fn space(&self, prescribed: impl IntoIterator<Item = (usize, usize)>) -> Space<D> {
        let extension = self.extension.clone().unwrap_or_default();
        Space::new(self.nodes.len(), extension, prescribed.into_iter().collect(), &self.pool)
    }

    /// The memory pool of the nodal fields.
    pub(crate) fn pool(&self) -> &Pool {
        &self.pool
    }

    /// The order in which passes take the particles: by block, cell and id. `None` if the particles lie in memory in this order.
    ///
    /// ```
    /// use bfree::mechanics::sweep::Connectivity;
    ///
    /// // A disc with its last particle first: passes go backwards through memory, cell by cell.
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// let particles = &mut simulation.particles;
    /// let backwards: Vec<u32> = (0..particles.len() as u32).rev().collect();
    /// particles.rearrange(&backwards);
    /// let (connectivity, _) = Connectivity::new(&simulation.approximation, &simulation.grid, &particles.position)?;
    /// particles.rearrange(&connectivity.block_order().ok_or("backwards")?);
    /// let (connectivity, _) = Connectivity::new(&simulation.approximation, &simulation.grid, &particles.position)?;
    /// assert_eq!(connectivity.block_order(), None);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn block_order(&self) -> Option<Vec<u32>> {
        let tiled = self.tiled().filter(|tiled| !tiled.is_memory_order)?;
        Some(tiled.order().collect())
    }

    /// Renumbers the particles after they have been put into [`Self::block_order`].
    pub(crate) fn rearrange(&mut self) {
        if let Implementation::Tiled(tiled) = &mut self.implementation {
            tiled.rearrange();
        }
    }

    /// This connectivity with the number of passes set to zero.
    pub(crate) fn with_no_pass(self) -> Self {
        self.passes.store(0, Ordering::Relaxed);
        self
    }

    /// Number of particles.
    pub fn particles(&self) -> usize {
        dispatch!(self, one => one.particles())
    }

    /// Number of active nodes.
    ///
    /// Example: [`Self::passes`].
    pub fn nodes(&self) -> usize {
        self.nodes.len()
    }

    /// The active nodes.
    pub(crate) fn active(&self) -> &Nodes {
        &self.nodes
    }

    /// The grid of the active nodes.
    pub(crate) fn grid(&self) -> &Grid<D> {
        &self.grid
    }

    /// Number of passes over all particles so far.
    ///
    /// ```
    /// use bfree::mechanics::{check::direction, sweep::Connectivity};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (connectivity, nodes) = Connectivity::new(&simulation.approximation, &simulation.grid, &simulation.particles.position)?;
    /// assert_eq!(connectivity.nodes(), nodes.len());
    /// let before = connectivity.passes();
    /// connectivity.values(&direction::<2>(nodes.len(), 1));
    /// assert_eq!(connectivity.passes(), before + 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn passes(&self) -> u64 {
        self.passes.load(Ordering::Relaxed)
    }

    /// Counts a pass over the particles.
    pub(crate) fn pass(&self) {
        self.passes.fetch_add(1, Ordering::Relaxed);
    }

    /// Whether shape functions are stored by axis, as products are.
    pub fn is_tiled(&self) -> bool {
        self.tiled().is_some()
    }

    /// Calls `visit` for all groups, in the order of their numbers.
    pub(crate) fn each_group<'s>(&'s self, mut visit: impl FnMut(Group<'s>)) {
        dispatch!(self, one => one.each_group(&mut visit));
    }

    /// The processes that share the passes.
    pub(crate) fn processes(&self) -> &Processes {
        // The plain loop is not shared: every process runs the whole loop.
        self.tiled().map_or(const { &Processes::ALONE }, Tiled::processes)
    }

    /// The particles of this process by their index in memory, if particles lie in the order of the blocks; otherwise all particles.
    pub(crate) fn own_particles(&self) -> Range<usize> {
        self.tiled().map_or(0..self.particles(), Tiled::own_particles)
    }

    /// The first particle of each process in the order of the passes; at the end, the number of particles. The list is empty with one process.
    pub(crate) fn bounds(&self) -> Vec<usize> {
        self.tiled().map_or_else(Vec::new, Tiled::bounds)
    }

    /// The places of this process's particles in the order of the passes.
    pub(super) fn own_places(&self) -> Range<usize> {
        self.tiled().map_or(0..self.particles(), Tiled::own_places)
    }

    /// Whether the particles lie in memory in the order of the passes.
    pub(super) fn is_memory_order(&self) -> bool {
        self.tiled().is_none_or(|tiled| tiled.is_memory_order)
    }

    /// The groups of this process.
    pub(crate) fn own_groups(&self) -> Range<usize> {
        self.tiled().map_or(0..self.groups(), Tiled::own_groups)
    }

    /// Each process has written `count` numbers for each of its [own particles](Self::own_particles). Fills in the numbers of the others.
    pub(crate) fn share_particles(&self, count: usize, numbers: &mut [f64]) {
        if let Some(tiled) = self.tiled().filter(|tiled| tiled.is_memory_order) {
            tiled.share_numbers(Each::Particle(count), numbers);
        }
    }

    /// The largest number of particles of a process, and the most entries of nodes that a process tells after a scatter, if so many processes
    /// share the passes. The plain loop is not shared.
    pub(crate) fn largest_shares(&self, processes: usize) -> [usize; 2] {
        let of_tiled = |tiled: &Tiled<D>| shares::largest(processes, &tiled.blocks, self.nodes.len());
        self.tiled().map_or([self.particles(), 0], of_tiled)
    }

    /// Number of groups.
    pub(crate) fn groups(&self) -> usize {
        dispatch!(self, one => one.groups())
    }

    /// The groups in vector lanes: the nodes of a group's window along each axis, and its number of particles. The list is empty where
    /// the loop has no vector lanes. It serves for counting operations.
    ///
    /// Example: [`Self::plain`].
    pub fn windows(&self) -> Vec<([usize; 3], usize)> {
        self.tiled().map_or_else(Vec::new, Tiled::windows)
    }

    /// Bytes of all arrays.
    ///
    /// Example: [`Self::plain`].
    pub fn bytes(&self) -> usize {
        dispatch!(self, one => one.bytes())
    }

    /// Bytes of the boxes into which all blocks scatter at the same time. With one thread in one process, the blocks share a box.
    pub(crate) fn box_bytes(&self, processes: usize) -> usize {
        let tiled = self.tiled().filter(|tiled| processes > 1 || tiled.in_parallel());
        tiled.map_or(0, Tiled::box_bytes)
    }

    /// The entries (active node, N, ∇_r N) of one particle.
    pub fn of(&self, particle: usize) -> impl Iterator<Item = (usize, f64, Vector<f64, D>)> {
        dispatch!(self, one => one.of(&self.grid, particle)).into_iter()
    }

    /// Σ N_I u_I at one particle.
    pub(crate) fn value_at<T: Real>(&self, particle: usize, field: &[Vector<T, D>]) -> Vector<T, D> {
        let mut value = Vector::<T, D>::zeros();
        for (node, n, _) in self.of(particle) {
            value += field[node] * T::lit(n);
        }
        value
    }

    /// Σ u_I ⊗ ∇_r N_I at one particle.
    pub fn gradient_at<T: Real>(&self, particle: usize, field: &[Vector<T, D>]) -> Tensor<T, D> {
        let mut gradient = Tensor::<T, D>::zeros();
        for (node, _, grad_n) in self.of(particle) {
            gradient += field[node] * grad_n.map(T::lit).transpose();
        }
        gradient
    }
}
