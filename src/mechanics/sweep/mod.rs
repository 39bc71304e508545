//! The loop over particles: gather (N, ∇N) → at the point → scatter (N, ∇N). With the vectors of the solver the only user of threads,
//! and the only one of vector instructions.
//!
//! The sweep knows components, not meanings. A field has C numbers a node; gathered, C values u = Σ u_I N_I and C gradients
//! L = Σ u_I ⊗ ∇_n N_I a particle; a point function turns them into q and σ, and f_I += q N_I + σ ∇_n N_I is scattered. A mass is one
//! component, a motion D; a dual number is two fields, since both ways are linear: derivatives go through the kernels of production.
//!
//! - A *lane* is one particle of eight, side by side in a vector of the processor.
//! - A *group* is up to eight particles of one cell, or of neighbours along x, that share a window of nodes.
//! - A *block* is a cube of cells with a box of nodes. Blocks do not depend on the number of threads; each gathers from its own nodes and
//!   scatters into a buffer of its own, and buffers are added in the order of the blocks: the same bits for any number of threads.
//!
//! Two ways with one answer: `plain` is the specification, and the way of shape functions that are no products;
//! `tiled` is for products, N = Π_k N_k.

mod block;
mod blocks;
mod builder;
mod columns;
mod kernel;
mod laned;
mod lanes;
mod laws;
mod number;
mod order;
mod plain;
mod tangents;
mod tiled;
mod waves;

pub use block::Group;
pub use blocks::Quadratic;
pub use kernel::At;
pub use laned::Laned;
pub(crate) use laned::add_quadratic;
pub use lanes::LANES;
pub use laws::Laws;
pub use number::Number;
pub use tangents::{Form, Product};

use crate::approximation::{ApproximationError, ShapeFunction};
use crate::grid::Grid;
use crate::nodes::Nodes;
use crate::parallel::held;
use crate::pooled::{Element, Pool, Pooled};
use crate::scalar::Real;
use crate::solver::Precision;
use crate::tensor::{Tensor, Vector};
use plain::Plain;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use tiled::Tiled;

/// Particles lie well in memory if at most one in so many lies elsewhere than behind the one before it in the sweep.
const LEAPS: usize = 8;

/// Products with more nodes than this along an axis take the plain sweep: the box of a block would leave the cache.
const WIDEST: usize = 16;

/// Shape functions of all particles at the last converged positions, and the active nodes they name.
///
/// ```
/// use bfree::approximation::Lme;
/// use bfree::grid::Grid;
/// use bfree::mechanics::sweep::Supports;
/// use bfree::shape::{Ball, Filling, fill};
/// use bfree::tensor::{Vector, identity};
///
/// let grid = Grid { origin: Vector::zeros(), spacing: 0.5, cells: [12, 12] };
/// let disc = Ball { center: Vector::from([3.0, 3.0]), radius: 2.0 }.into();
/// let seeds = fill(&grid, &disc, Filling { per_axis: 2, ..Filling::default() })?;
/// let positions: Vec<_> = seeds.iter().map(|seed| seed.position).collect();
/// let (supports, nodes) = Supports::new(&Lme::new(3.0, 1e-6), &grid, &positions)?;
/// assert_eq!(supports.particles(), positions.len());
/// // What particles see of the field x_I is x and I: Σ N x_I = x, Σ x_I ⊗ ∇N = I.
/// let x: Vec<_> = nodes.positions(&grid).map(|(_, x)| x).collect();
/// let apart = supports.values(&x).iter().zip(&positions).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
/// assert!(apart < 1e-13);
/// assert!((supports.gradient_at(7, &x) - identity()).norm() < 1e-12);
/// let sum: f64 = supports.of(7).map(|(_, n, _)| n).sum();
/// assert!((sum - 1.0).abs() < 1e-14);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Supports<const D: usize> {
    way: Way<D>,
    grid: Grid<D>,
    /// Active nodes.
    nodes: Nodes,
    /// h, if weights in single precision are there.
    unit: Option<f64>,
    /// How often the sweeps have gone through all particles.
    passes: AtomicU64,
    /// Where fields take their memory from.
    pool: Pool,
}

impl<const D: usize> Clone for Supports<D> {
    fn clone(&self) -> Self {
        let Self { way, grid, nodes, unit, pool, .. } = self;
        let passes = AtomicU64::new(self.passes());
        Self { way: way.clone(), grid: *grid, nodes: nodes.clone(), unit: *unit, passes, pool: pool.clone() }
    }
}

#[derive(Clone, Debug)]
enum Way<const D: usize> {
    Plain(Plain<D>),
    Tiled(Tiled<D>),
}

/// The shape functions of a particle could not be evaluated.
#[derive(Clone, Debug, thiserror::Error)]
#[error("particle {particle} has no shape functions")]
pub struct SupportError {
    /// Id of the particle; where none are given, its place.
    pub particle: usize,
    /// What went wrong.
    pub source: ApproximationError,
}

/// Of several failures, of any threads, the one with the smallest number.
pub(crate) struct First<E>(Mutex<Option<(usize, E)>>);

impl<E> First<E> {
    pub(crate) fn none() -> Self {
        Self(Mutex::new(None))
    }

    pub(crate) fn keep(&self, number: usize, error: E) {
        let mut first = held(&self.0);
        if first.as_ref().is_none_or(|(before, _)| number < *before) {
            *first = Some((number, error));
        }
    }

    pub(crate) fn check(self) -> Result<(), E> {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), |(_, error)| Err(error))
    }
}

/// What a pass gathers, and scatters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flow {
    /// Σ u_I N_I, and q N_I
    pub value: bool,
    /// Σ u_I ⊗ ∇N_I, and σ ∇N_I
    pub gradient: bool,
    /// The weights of the scatter.
    pub weights: Weights,
}

impl Flow {
    /// Values and gradients.
    pub const BOTH: Self = Self { value: true, gradient: true, weights: Weights::Signed };
    /// Gradients alone.
    pub const GRADIENT: Self = Self { value: false, ..Self::BOTH };
    /// Values alone.
    pub const VALUE: Self = Self { gradient: false, ..Self::BOTH };

    /// What one or the other needs.
    pub fn and(self, other: Self) -> Self {
        Self { value: self.value || other.value, gradient: self.gradient || other.gradient, ..self }
    }
}

/// How N and ∇N enter a scatter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weights {
    /// As they are.
    Signed,
    /// By their magnitude.
    Magnitude,
    /// N²: the diagonal of a mass matrix, since N is a product.
    Square,
}

impl Weights {
    /// What is done to every weight.
    fn changed<X: Real>(self) -> Option<fn(X) -> X> {
        match self {
            Self::Signed => None,
            Self::Magnitude => Some(|n| n.abs()),
            Self::Square => Some(|n| n * n),
        }
    }
}

/// `(group, u and L, q and σ)` of every field: adds to the last, which begin with zero. It is found once a pass.
type Point<'a, X, const C: usize, const D: usize> = dyn Fn(Group<'_>, &[At<X, C, D>], &mut [At<X, C, D>]) + Sync + 'a;

/// `(particle, what was gathered of every field, lane)`: what becomes of it there.
type Visit<'a, R, const C: usize, const D: usize> = dyn Fn(usize, &[At<f64, C, D>], usize) -> R + Sync + 'a;

/// `(group, what was gathered, rows)`: fills the rows of a group.
pub(crate) type Fill<'a, Y, const D: usize> = dyn Fn(Group<'_>, &At<f64, D, D>, &mut [Y]) + Sync + 'a;

/// As [`Point`], of one field.
pub(crate) type Linear<'a, X, const D: usize> = dyn Fn(Group<'_>, &At<X, D, D>, &mut At<X, D, D>) + Sync + 'a;

impl<X: Real, const C: usize, const D: usize> At<X, C, D> {
    /// u and L of one particle.
    #[inline(always)]
    pub fn lane(&self, lane: usize) -> (Vector<X, C>, nalgebra::SMatrix<X, C, D>) {
        let value = Vector::from_fn(|c, _| self.value[c][lane]);
        (value, nalgebra::SMatrix::from_fn(|c, k| self.gradient[c][k][lane]))
    }
}

/// Calls the same method of the way taken.
macro_rules! either {
    ($self:expr, $way:ident => $call:expr) => {
        match &$self.way {
            Way::Plain($way) => $call,
            Way::Tiled($way) => $call,
        }
    };
}

impl<const D: usize> Supports<D> {
    /// Evaluates the shape functions at all positions and numbers the active nodes.
    ///
    /// # Errors
    /// The first particle that lies outside the grid or whose shape functions do not exist.
    pub fn new<A: ShapeFunction>(
        approximation: &A,
        grid: &Grid<D>,
        positions: &[Vector<f64, D>],
    ) -> Result<(Self, Nodes), SupportError> {
        Self::with_precision(approximation, grid, positions, Precision::Double)
    }

    /// As [`Self::new`], prepared for products in single precision if they are asked for and shape functions are products.
    ///
    /// Example: [`single_tangent`](crate::mechanics::residual::Equilibrium::single_tangent).
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_precision<A: ShapeFunction>(
        approximation: &A,
        grid: &Grid<D>,
        positions: &[Vector<f64, D>],
        precision: Precision,
    ) -> Result<(Self, Nodes), SupportError> {
        Self::renewed(None, approximation, grid, positions, None, precision, &Pool::default())
    }

    /// As [`Self::with_precision`], in the memory of supports no longer needed, such as the last step's, and from their order of
    /// particles. What comes out does not depend on them. Nor does it on the places of particles in memory, if `ids` tells them apart:
    /// sums are taken in the order of cells and ids.
    ///
    /// ```
    /// use bfree::mechanics::{check::direction, sweep::Supports};
    /// use bfree::pooled::Pool;
    /// use bfree::solver::Precision;
    /// use bfree::tensor::Vector;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (shape, grid) = (&simulation.approximation, &simulation.grid);
    /// let before = &simulation.particles.position;
    /// let now: Vec<_> = before.iter().map(|x| x + Vector::from([0.3, 0.1])).collect();
    /// let (last, _) = Supports::new(shape, grid, before)?;
    /// let (renewed, nodes) = Supports::renewed(Some(last), shape, grid, &now, None, Precision::Double, &Pool::default())?;
    /// let (anew, same_nodes) = Supports::new(shape, grid, &now)?;
    /// assert_eq!(nodes, same_nodes);
    /// let field = direction::<2>(nodes.len(), 1);
    /// assert_eq!(renewed.values(&field), anew.values(&field));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn renewed<A: ShapeFunction>(
        spare: Option<Self>,
        approximation: &A,
        grid: &Grid<D>,
        positions: &[Vector<f64, D>],
        ids: Option<&[u32]>,
        precision: Precision,
        pool: &Pool,
    ) -> Result<(Self, Nodes), SupportError> {
        match approximation.separable() {
            Some(product) if product.width() <= WIDEST => {
                let single = precision == Precision::Mixed;
                let spare = spare.and_then(|spare| match spare.way {
                    Way::Plain(_) => None,
                    Way::Tiled(tiled) => Some(tiled),
                });
                let (tiled, nodes) = Tiled::new(approximation, product, grid, positions, ids, single, spare)?;
                Ok((Self::of_way(Way::Tiled(tiled), grid, &nodes, single.then_some(grid.spacing), pool), nodes))
            }
            _ => {
                let id = |particle: usize| ids.map_or(particle, |ids| ids[particle] as usize);
                let by_id = |error: SupportError| SupportError { particle: id(error.particle), ..error };
                let (plain, nodes) = Plain::new(approximation, grid, positions).map_err(by_id)?;
                Ok((Self::of_way(Way::Plain(plain), grid, &nodes, None, pool), nodes))
            }
        }
    }

    /// As [`Self::new`], by the plain sweep whatever the shape function: the specification of the fast one.
    ///
    /// ```
    /// use bfree::approximation::Lme;
    /// use bfree::grid::Grid;
    /// use bfree::mechanics::{check::direction, sweep::Supports};
    /// use bfree::shape::{Ball, Filling, fill};
    /// use bfree::tensor::Vector;
    ///
    /// let grid = Grid { origin: Vector::zeros(), spacing: 0.5, cells: [12, 12] };
    /// let disc = Ball { center: Vector::from([3.0, 3.0]), radius: 2.0 }.into();
    /// let seeds = fill(&grid, &disc, Filling { per_axis: 2, ..Filling::default() })?;
    /// let (lme, positions) = (Lme::new(3.0, 1e-6), seeds.iter().map(|seed| seed.position).collect::<Vec<_>>());
    /// let (fast, nodes) = Supports::new(&lme, &grid, &positions)?;
    /// let (plain, same_nodes) = Supports::plain(&lme, &grid, &positions)?;
    /// assert_eq!(nodes, same_nodes);
    /// let field = direction::<2>(nodes.len(), 1);
    /// let apart = fast.values(&field).into_iter().zip(plain.values(&field)).map(|(a, b)| (a - b).norm());
    /// assert!(apart.fold(0.0, f64::max) < 1e-14);
    /// // The fast one keeps functions of one coordinate, not N and ∇N of every node; and particles that share their nodes together.
    /// assert!(fast.bytes() < plain.bytes());
    /// assert_eq!(fast.windows().iter().map(|(_, particles)| particles).sum::<usize>(), positions.len());
    /// assert!(plain.windows().is_empty());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn plain<A: ShapeFunction>(
        approximation: &A,
        grid: &Grid<D>,
        positions: &[Vector<f64, D>],
    ) -> Result<(Self, Nodes), SupportError> {
        let (plain, nodes) = Plain::new(approximation, grid, positions)?;
        Ok((Self::of_way(Way::Plain(plain), grid, &nodes, None, &Pool::default()), nodes))
    }

    fn of_way(way: Way<D>, grid: &Grid<D>, nodes: &Nodes, unit: Option<f64>, pool: &Pool) -> Self {
        Self { way, grid: *grid, nodes: nodes.clone(), unit, passes: AtomicU64::new(0), pool: pool.clone() }
    }

    /// A nodal field of zeros, one entry for each active node.
    pub(crate) fn field<T: Element + num_traits::Zero>(&self) -> Pooled<T> {
        self.pool.filled(self.nodes.len(), T::zero())
    }

    /// Where fields take their memory from.
    pub(crate) fn pool(&self) -> &Pool {
        &self.pool
    }

    /// The order in which the particles are taken, if that leaps too often in memory: if the next one lies elsewhere for more than one in
    /// eight.
    ///
    /// ```
    /// use bfree::mechanics::sweep::Supports;
    ///
    /// // A disc with its last particle first: the sweep goes backwards through memory, cell by cell.
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// let particles = &mut simulation.particles;
    /// let backwards: Vec<u32> = (0..particles.len() as u32).rev().collect();
    /// particles.rearrange(&backwards);
    /// let (supports, _) = Supports::new(&simulation.approximation, &simulation.grid, &particles.position)?;
    /// particles.rearrange(&supports.leaping().ok_or("backwards")?);
    /// let (supports, _) = Supports::new(&simulation.approximation, &simulation.grid, &particles.position)?;
    /// assert_eq!(supports.leaping(), None);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn leaping(&self) -> Option<Vec<u32>> {
        let Way::Tiled(tiled) = &self.way else { return None };
        let mut next = 0;
        let leaps = tiled.order().filter(|&p| std::mem::replace(&mut next, p + 1) != p).count();
        (leaps > tiled.particles() / LEAPS).then(|| tiled.order().collect())
    }

    /// The same, the particles having been put in [`Self::leaping`]'s order.
    pub(crate) fn rearranged(mut self) -> Self {
        if let Way::Tiled(tiled) = &mut self.way {
            tiled.rearrange();
        }
        self
    }

    /// The same, to count passes anew.
    pub(crate) fn again(self) -> Self {
        self.passes.store(0, Ordering::Relaxed);
        self
    }

    /// Number of particles.
    pub fn particles(&self) -> usize {
        either!(self, way => way.particles())
    }

    /// Number of active nodes.
    ///
    /// Example: [`Self::passes`].
    pub fn nodes(&self) -> usize {
        self.nodes.len()
    }

    /// The active nodes.
    pub fn active(&self) -> &Nodes {
        &self.nodes
    }

    /// The grid they are of.
    pub fn grid(&self) -> &Grid<D> {
        &self.grid
    }

    /// How often the methods below have gone through all particles so far.
    ///
    /// ```
    /// use bfree::mechanics::{check::direction, sweep::Supports};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (supports, nodes) = Supports::new(&simulation.approximation, &simulation.grid, &simulation.particles.position)?;
    /// assert_eq!(supports.nodes(), nodes.len());
    /// let before = supports.passes();
    /// supports.values(&direction::<2>(nodes.len(), 1));
    /// assert_eq!(supports.passes(), before + 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn passes(&self) -> u64 {
        self.passes.load(Ordering::Relaxed)
    }

    /// Another pass through the particles begins.
    fn pass(&self) {
        self.passes.fetch_add(1, Ordering::Relaxed);
    }

    /// The spacing in which weights in single precision are measured; `None` where there are none.
    pub fn unit(&self) -> Option<f64> {
        self.unit
    }

    /// Whether functions are products, so that particles are summed in vector lanes.
    pub fn is_tiled(&self) -> bool {
        matches!(self.way, Way::Tiled(_))
    }

    /// Visits all groups, in the order of their numbers.
    pub(crate) fn each_group(&self, mut visit: impl FnMut(Group<'_>)) {
        either!(self, way => way.each_group(&mut visit));
    }

    /// Number of groups.
    pub(crate) fn groups(&self) -> usize {
        either!(self, way => way.groups())
    }

    /// The groups of particles that share a window of nodes in vector lanes: nodes along each axis, and particles; none where the
    /// sweep has no vector lanes. For counting operations.
    ///
    /// Example: [`Self::plain`].
    pub fn windows(&self) -> Vec<([usize; 3], usize)> {
        match &self.way {
            Way::Plain(_) => Vec::new(),
            Way::Tiled(tiled) => tiled.windows(),
        }
    }

    /// Along any axis, the largest difference of the indices of two nodes that share a particle, or a little more.
    pub(crate) fn reach(&self) -> u32 {
        if let Way::Tiled(tiled) = &self.way {
            let widths = tiled.windows().into_iter().flat_map(|(window, _)| window);
            return widths.max().map_or(0, |width| width.saturating_sub(1) as u32);
        }
        let across = |p: usize| {
            let (mut least, mut most) = ([u32::MAX; D], [0; D]);
            for (node, ..) in self.of(p) {
                let index = self.grid.index(self.nodes.ids()[node]);
                (0..D).for_each(|k| (least[k], most[k]) = (least[k].min(index[k]), most[k].max(index[k])));
            }
            (0..D).map(|k| most[k].saturating_sub(least[k])).max().unwrap_or(0)
        };
        (0..self.particles()).map(across).max().unwrap_or(0)
    }

    /// Bytes of all arrays.
    ///
    /// Example: [`Self::plain`].
    pub fn bytes(&self) -> usize {
        either!(self, way => way.bytes())
    }

    /// The entries (active node, N, ∇_n N) of one particle.
    pub fn of(&self, particle: usize) -> impl Iterator<Item = (usize, f64, Vector<f64, D>)> {
        either!(self, way => way.of(particle)).into_iter()
    }

    /// Σ u_I ⊗ ∇_n N_I at one particle.
    pub fn gradient_at<T: Real>(&self, particle: usize, field: &[Vector<T, D>]) -> Tensor<T, D> {
        let mut gradient = Tensor::<T, D>::zeros();
        for (node, _, grad_n) in self.of(particle) {
            gradient += field[node] * grad_n.map(T::lit).transpose();
        }
        gradient
    }

    /// `f_I += Σ_p q N_I + σ ∇_n N_I` with q and σ that `point(group, u and L, q and σ)` adds to zero, for C components: 1 or D. Without
    /// a field u and L are not specified.
    ///
    /// # Errors
    /// Of the errors of `point`, each with a number, the one with the smallest; what was added is then unspecified.
    pub fn sweep<T: Number, const C: usize, E: Send>(
        &self,
        field: Option<&[Vector<T, C>]>,
        flow: Flow,
        out: &mut [Vector<T, C>],
        point: impl Fn(Group<'_>, &At<T, C, D>, &mut At<T, C, D>) -> Result<(), (usize, E)> + Sync,
    ) -> Result<(), E> {
        const { assert!(C == 1 || C == D) };
        self.pass();
        let failure = First::none();
        let point = |group: Group<'_>, fields: &[At<f64, C, D>], sums: &mut [At<f64, C, D>]| {
            if let Err((number, error)) = T::at(fields, sums, |at, sums| point(group, at, sums)) {
                failure.keep(number, error);
            }
        };
        let field = field.map(T::flat);
        T::add_flat(out, |out| {
            either!(self, way => way.sweep::<f64, C>(T::FIELDS, field.as_deref(), flow, out, &point));
        });
        failure.check()
    }

    /// As [`Self::sweep`], for D plain numbers a node in either precision: what a product with a tangent is.
    pub(crate) fn product<X: Laned>(&self, field: &[X], flow: Flow, out: &mut [X], point: &Linear<'_, X, D>) {
        self.pass();
        let point = |group: Group<'_>, at: &[At<X, D, D>], sums: &mut [At<X, D, D>]| point(group, &at[0], &mut sums[0]);
        either!(self, way => way.sweep::<X, D>(1, Some(field), flow, out, &point));
    }

    /// `fill(group, L, rows)` of every group, each with `count` rows of its own.
    pub(crate) fn fill_rows<Y: Send>(
        &self,
        field: &[Vector<f64, D>],
        count: usize,
        rows: &mut [Y],
        fill: &Fill<'_, Y, D>,
    ) {
        self.pass();
        either!(self, way => way.fill_rows(bytemuck::cast_slice(field), count, rows, fill));
    }

    /// `out_I +=` the diagonal blocks Σ_p B_p(∇_n N_I, ∇_n N_I) + m_p N_I² I of the quadratic forms that `quadratic` adds up, group by group.
    pub(crate) fn blocks(&self, out: &mut [Tensor<f64, D>], quadratic: &(dyn Fn(Group<'_>, &mut Quadratic) + Sync)) {
        self.pass();
        either!(self, way => way.blocks(out, quadratic));
    }

    /// `out_I += Σ_p σ_p ∇_n N_I + q_p N_I` with `(q_p, σ_p) = point(p, u_p, ∇u_p)`, u_p = Σ u_I N_I and
    /// ∇u_p = Σ u_I ⊗ ∇_n N_I.
    ///
    /// ```
    /// use bfree::mechanics::{check::direction, sweep::Supports};
    /// use bfree::tensor::{Tensor, Vector, contract};
    /// use std::convert::Infallible;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, grid) = (&simulation.particles, &simulation.grid);
    /// let (supports, nodes) = Supports::new(&simulation.approximation, grid, &particles.position)?;
    /// // Virtual work: Σ_I f_I·w_I = Σ_p (σ_p : ∇w_p + q_p·w_p), for forces f and any w.
    /// let (u, w) = (direction::<2>(nodes.len(), 1), direction::<2>(nodes.len(), 2));
    /// let state = |u: Vector<f64, 2>, gradient: Tensor<f64, 2>| (u * 3.0, gradient * 2.0);
    /// let mut force = vec![Vector::zeros(); nodes.len()];
    /// supports.assemble(&u, &mut force, |_, u, gradient| Ok::<_, Infallible>(state(u, gradient)))?;
    /// let at_nodes: f64 = force.iter().zip(&w).map(|(f, w)| f.dot(w)).sum();
    /// let states = supports.interpolate(&u, |_, u, gradient| Ok::<_, Infallible>(state(u, gradient)))?;
    /// let work = supports.interpolate(&w, |p, w, gradient| {
    ///     let (q, sigma) = states[p];
    ///     Ok::<_, Infallible>(contract(&sigma, &gradient) + q.dot(&w))
    /// })?;
    /// assert!((at_nodes - work.iter().sum::<f64>()).abs() < 1e-10);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The error of the first particle in memory whose `point` fails.
    pub fn assemble<T: Number, E: Send>(
        &self,
        field: &[Vector<T, D>],
        out: &mut [Vector<T, D>],
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<(Vector<T, D>, Tensor<T, D>), E> + Sync,
    ) -> Result<(), E> {
        self.sweep(Some(field), Flow::BOTH, out, each_lane(point))
    }

    /// As [`Self::assemble`] with |N_I| and |∇_n N_I| in the sum.
    ///
    /// ```
    /// use bfree::mechanics::{check::direction, sweep::Supports};
    /// use bfree::tensor::{Tensor, Vector};
    /// use std::convert::Infallible;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (supports, nodes) = Supports::new(&simulation.approximation, &simulation.grid, &simulation.particles.position)?;
    /// // A uniform pressure acts on the rim of a body: within, the forces of the particles around a node cancel, and their sizes do not.
    /// let pressure = |_: usize, _: Vector<f64, 2>, _: Tensor<f64, 2>| Ok::<_, Infallible>((Vector::zeros(), Tensor::identity()));
    /// let (field, mut force) = (direction(nodes.len(), 1), vec![Vector::zeros(); nodes.len()]);
    /// let mut magnitude = force.clone();
    /// supports.assemble(&field, &mut force, pressure)?;
    /// supports.assemble_magnitudes(&field, &mut magnitude, pressure)?;
    /// assert!(force.iter().zip(&magnitude).all(|(f, size)| f.abs().norm() <= size.norm() * (1.0 + 1e-15)));
    /// let inside = nodes.number(simulation.grid.id([5, 5])).ok_or("in the middle of the disc")?;
    /// assert!(force[inside].norm() < 1e-3 * magnitude[inside].norm());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`Self::assemble`].
    pub fn assemble_magnitudes<T: Number, E: Send>(
        &self,
        field: &[Vector<T, D>],
        out: &mut [Vector<T, D>],
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<(Vector<T, D>, Tensor<T, D>), E> + Sync,
    ) -> Result<(), E> {
        self.sweep(Some(field), Flow { weights: Weights::Magnitude, ..Flow::BOTH }, out, each_lane(point))
    }

    /// `out_I += Σ_p value(p) N_I`, for C components: 1 or D.
    pub fn spread<const C: usize>(&self, out: &mut [Vector<f64, C>], value: impl Fn(usize) -> Vector<f64, C> + Sync) {
        self.spread_with(Weights::Signed, out, value);
    }

    /// As [`Self::spread`], with other weights than N.
    pub(crate) fn spread_with<const C: usize>(
        &self,
        weights: Weights,
        out: &mut [Vector<f64, C>],
        value: impl Fn(usize) -> Vector<f64, C> + Sync,
    ) {
        const { assert!(C == 1 || C == D) };
        self.pass();
        let point = |group: Group<'_>, _: &[At<f64, C, D>], sums: &mut [At<f64, C, D>]| {
            for (lane, &p) in group.particles.iter().enumerate() {
                let value = value(p as usize);
                (0..C).for_each(|c| sums[0].value[c][lane] = value[c]);
            }
        };
        let flow = Flow { weights, ..Flow::VALUE };
        either!(self, way => way.sweep::<f64, C>(1, None, flow, bytemuck::cast_slice_mut(out), &point));
    }

    /// Σ u_I N_I at every particle.
    pub fn values<const C: usize>(&self, field: &[Vector<f64, C>]) -> Vec<Vector<f64, C>> {
        let mut values = vec![Vector::zeros(); self.particles()];
        self.each_value(field, |p, value| values[p] = value);
        values
    }

    /// `take(p, Σ u_I N_I)` of every particle, in an order that does not depend on the number of threads.
    ///
    /// ```
    /// use bfree::mechanics::{check::direction, sweep::Supports};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (supports, nodes) = Supports::new(&simulation.approximation, &simulation.grid, &simulation.particles.position)?;
    /// let field = direction::<2>(nodes.len(), 1);
    /// let (values, mut visited) = (supports.values(&field), 0);
    /// supports.each_value(&field, |p, value| {
    ///     assert_eq!(value, values[p]);
    ///     visited += 1;
    /// });
    /// assert_eq!(visited, values.len());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn each_value<const C: usize>(&self, field: &[Vector<f64, C>], mut take: impl FnMut(usize, Vector<f64, C>)) {
        const { assert!(C == 1 || C == D) };
        self.pass();
        let point = |_: usize, at: &[At<f64, C, D>], lane: usize| Vector::from_fn(|c, _| at[0].value[c][lane]);
        let field = bytemuck::cast_slice(field);
        either!(self, way => way.each::<_, C>(1, field, Flow::VALUE, &point, &mut take));
    }

    /// `take(p, point(p, u_p, ∇u_p))` of every particle, in an order that does not depend on the number of threads.
    ///
    /// ```
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, grid) = (&simulation.particles, &simulation.grid);
    /// let (supports, nodes) = bfree::mechanics::sweep::Supports::new(&simulation.approximation, grid, &particles.position)?;
    /// // A rotation about the origin, u = ω × x, has no divergence.
    /// let rotation: Vec<_> = nodes.positions(grid).map(|(_, x)| bfree::tensor::Vector::from([-x[1], x[0]])).collect();
    /// let mut visited = vec![false; particles.len()];
    /// supports.each_particle(&rotation, |_, _, gradient| gradient.trace(), |p, divergence| {
    ///     assert!(divergence.abs() < 1e-12);
    ///     visited[p] = true;
    /// });
    /// assert!(visited.iter().all(|&once| once));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn each_particle<T: Number, R: Send>(
        &self,
        field: &[Vector<T, D>],
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> R + Sync,
        mut take: impl FnMut(usize, R),
    ) {
        self.pass();
        let point = |p: usize, fields: &[At<f64, D, D>], lane: usize| {
            let value = Vector::from_fn(|c, _| T::from_fields(|i| fields[i].value[c][lane]));
            let gradient = Tensor::from_fn(|c, k| T::from_fields(|i| fields[i].gradient[c][k][lane]));
            point(p, value, gradient)
        };
        either!(self, way => way.each::<_, D>(T::FIELDS, &T::flat(field), Flow::BOTH, &point, &mut take));
    }

    /// `point(p, u_p, ∇u_p)` of every particle, in their order.
    ///
    /// Example: [`Self::assemble`].
    ///
    /// # Errors
    /// The error of the first particle in memory whose `point` fails.
    pub fn interpolate<T: Number, R: Send, E: Send>(
        &self,
        field: &[Vector<T, D>],
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<R, E> + Sync,
    ) -> Result<Vec<R>, E> {
        let mut results: Vec<Option<R>> = (0..self.particles()).map(|_| None).collect();
        let failure = First::none();
        self.each_particle(field, point, |p, result| match result {
            Ok(result) => results[p] = Some(result),
            Err(error) => failure.keep(p, error),
        });
        failure.check()?;
        Ok(results.into_iter().flatten().collect())
    }
}

/// A point function of the particles, one after the other.
fn each_lane<T: Real, E, const D: usize>(
    point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<(Vector<T, D>, Tensor<T, D>), E> + Sync,
) -> impl Fn(Group<'_>, &At<T, D, D>, &mut At<T, D, D>) -> Result<(), (usize, E)> + Sync {
    move |group, at, sums| {
        let failure = First::none();
        for (lane, &p) in group.particles.iter().enumerate() {
            let (value, gradient) = at.lane(lane);
            match point(p as usize, value, gradient) {
                Ok((q, sigma)) => {
                    for c in 0..D {
                        sums.value[c][lane] += q[c];
                        (0..D).for_each(|k| sums.gradient[c][k][lane] += sigma[(c, k)]);
                    }
                }
                Err(error) => failure.keep(p as usize, (p as usize, error)),
            }
        }
        failure.check()
    }
}
