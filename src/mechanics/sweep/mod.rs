//! The loop over particles: gather → point → scatter. With the vectors of the solver the only user of threads, and the only one of vector
//! instructions.
//!
//! Two ways with one answer: `plain` is the specification, and the way of shape functions that are no products;
//! `tiled` is for products, N = Π_k N_k. Both cut the particles into blocks that do not depend on the number of threads.
//! A block gathers from its own nodes, scatters into its own buffer, and the buffers are added in the order of the blocks:
//! the same bits for any number of threads.

mod block;
mod builder;
mod closed;
mod columns;
mod diagonal;
mod kernel;
mod lanes;
mod laws;
mod of_block;
mod order;
mod plain;
mod tally;
mod tiled;
mod waves;

pub use closed::{ClosedTangents, SingleTangents};
pub use laws::Laws;

use crate::approximation::{ApproximationError, ShapeFunction};
use crate::grid::Grid;
use crate::material::Law;
use crate::mechanics::point::Inadmissible;
use crate::nodes::Nodes;
use crate::parallel;
use crate::pooled::{Element, Pool, Pooled};
use crate::scalar::Real;
use crate::solver::Precision;
use crate::tensor::{Tensor, Vector};
use kernel::{Rows, of_lane};
use num_traits::Zero;
use plain::Plain;
use std::ops::AddAssign;
use tally::Tally;
use tiled::Tiled;

/// Particles per block of the plain sweep: large enough to pay for a task, small enough to keep a block's nodes in cache.
const BLOCK: usize = 256;

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
/// use bfree::shape::{Fill, Shape, fill};
/// use bfree::tensor::{Vector, identity};
///
/// let grid = Grid { origin: Vector::zeros(), spacing: 0.5, cells: [12, 12] };
/// let disc = Shape::Ball { center: Vector::from([3.0, 3.0]), radius: 2.0 };
/// let positions = fill(&grid, &disc, 2, Fill::Particles)?;
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
#[derive(Clone, Debug)]
pub struct Supports<const D: usize>(Way<D>, Tally, Pool);

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

/// q of the particle at a place in memory, from that and u.
pub type Inertia<'a, const D: usize> = &'a (dyn Fn(usize, &Vector<f64, D>) -> Vector<f64, D> + Sync);

/// Whether the weights of a scatter are taken as they are or by their magnitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Magnitude {
    No,
    Yes,
}

impl Magnitude {
    #[inline(always)]
    fn of<const D: usize>(self, n: f64, grad_n: Vector<f64, D>) -> (f64, Vector<f64, D>) {
        match self {
            Self::No => (n, grad_n),
            Self::Yes => (n.abs(), grad_n.abs()),
        }
    }
}

/// Calls the same method of the way taken.
macro_rules! either {
    ($self:expr, $way:ident => $call:expr) => {
        match &$self.0 {
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
    /// Example: [`Self::single_tangents`].
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
    /// sums are taken in the order of cells and ids. Their fields are lent from `pool`.
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
    /// let pool = Pool::default();
    /// let (renewed, nodes) = Supports::renewed(Some(last), shape, grid, &now, None, Precision::Double, &pool)?;
    /// let (anew, same_nodes) = Supports::new(shape, grid, &now)?;
    /// assert_eq!(nodes, same_nodes);
    /// let field = direction(nodes.len(), 1);
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
                let spare = spare.and_then(|spare| match spare.0 {
                    Way::Plain(_) => None,
                    Way::Tiled(tiled) => Some(tiled),
                });
                let (tiled, nodes) = Tiled::new(approximation, product, grid, positions, ids, single, spare)?;
                Ok((Self(Way::Tiled(tiled), Tally::of(nodes.len()), pool.clone()), nodes))
            }
            _ => {
                let by_id = |SupportError { particle, source }| SupportError {
                    particle: ids.map_or(particle, |ids| ids[particle] as usize),
                    source,
                };
                let (plain, nodes) = Plain::new(approximation, grid, positions).map_err(by_id)?;
                Ok((Self(Way::Plain(plain), Tally::of(nodes.len()), pool.clone()), nodes))
            }
        }
    }

    /// As [`Self::new`], by the plain sweep whatever the shape function: the specification of the fast one.
    ///
    /// ```
    /// use bfree::approximation::Lme;
    /// use bfree::grid::Grid;
    /// use bfree::mechanics::{check::direction, sweep::Supports};
    /// use bfree::shape::{Fill, Shape, fill};
    /// use bfree::tensor::Vector;
    ///
    /// let grid = Grid { origin: Vector::zeros(), spacing: 0.5, cells: [12, 12] };
    /// let disc = Shape::Ball { center: Vector::from([3.0, 3.0]), radius: 2.0 };
    /// let (lme, positions) = (Lme::new(3.0, 1e-6), fill(&grid, &disc, 2, Fill::Particles)?);
    /// let (fast, nodes) = Supports::new(&lme, &grid, &positions)?;
    /// let (plain, same_nodes) = Supports::plain(&lme, &grid, &positions)?;
    /// assert_eq!(nodes, same_nodes);
    /// let field = direction(nodes.len(), 1);
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
        Ok((Self(Way::Plain(plain), Tally::of(nodes.len()), Pool::default()), nodes))
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
        let Way::Tiled(tiled) = &self.0 else { return None };
        let mut next = 0;
        let leaps = tiled.order().filter(|&p| std::mem::replace(&mut next, p + 1) != p).count();
        (leaps > tiled.particles() / LEAPS).then(|| tiled.order().collect())
    }

    /// The same, the particles having been put in [`Self::leaping`]'s order.
    pub(crate) fn rearranged(mut self) -> Self {
        if let Way::Tiled(tiled) = &mut self.0 {
            tiled.rearrange();
        }
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
        self.1.nodes
    }

    /// Zero on every active node.
    pub(crate) fn field<T: Element + Zero>(&self) -> Pooled<T> {
        self.2.filled(self.nodes(), T::zero())
    }

    /// Where fields are lent from.
    pub(crate) fn pool(&self) -> &Pool {
        &self.2
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
    /// supports.values(&direction(nodes.len(), 1));
    /// assert_eq!(supports.passes(), before + 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn passes(&self) -> u64 {
        self.1.passes()
    }

    /// The groups of particles that share a window of nodes in vector lanes: nodes along each axis, and particles; none where the
    /// sweep has no vector lanes. For counting operations.
    ///
    /// Example: [`Self::plain`].
    pub fn windows(&self) -> Vec<([usize; 3], usize)> {
        match &self.0 {
            Way::Plain(_) => Vec::new(),
            Way::Tiled(tiled) => tiled.windows(),
        }
    }

    /// Bytes of all arrays.
    ///
    /// Example: [`Self::plain`].
    pub fn bytes(&self) -> usize {
        either!(self, way => way.bytes())
    }

    /// The entries (active node, N, ∇_n N) of one particle.
    pub fn of(&self, particle: usize) -> impl Iterator<Item = (usize, f64, Vector<f64, D>)> {
        let (plain, tiled) = match &self.0 {
            Way::Plain(plain) => (Some(plain.of(particle)), None),
            Way::Tiled(tiled) => (None, Some(tiled.of(particle))),
        };
        plain.into_iter().flatten().chain(tiled.into_iter().flatten())
    }

    /// Σ u_I ⊗ ∇_n N_I at one particle.
    pub fn gradient_at<T: Real>(&self, particle: usize, field: &[Vector<T, D>]) -> Tensor<T, D> {
        let mut gradient = Tensor::<T, D>::zeros();
        for (node, _, grad_n) in self.of(particle) {
            gradient += field[node] * grad_n.map(T::lit).transpose();
        }
        gradient
    }

    /// Σ u_I N_I at every particle.
    pub fn values(&self, field: &[Vector<f64, D>]) -> Vec<Vector<f64, D>> {
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
    /// let field = direction(nodes.len(), 1);
    /// let (values, mut visited) = (supports.values(&field), 0);
    /// supports.each_value(&field, |p, value| {
    ///     assert_eq!(value, values[p]);
    ///     visited += 1;
    /// });
    /// assert_eq!(visited, values.len());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn each_value(&self, field: &[Vector<f64, D>], mut take: impl FnMut(usize, Vector<f64, D>)) {
        match &self.0 {
            Way::Plain(_) => self.each_particle(field, |_, value, _| value, take),
            Way::Tiled(tiled) => {
                self.1.pass();
                let point = |_: usize, rows: &Rows, lane: usize| Vector::from_fn(|i, _| rows[i][lane]);
                waves::each_particle(tiled, field, of_block::gather_values, point, &mut take);
            }
        }
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
    pub fn each_particle<R: Send>(
        &self,
        field: &[Vector<f64, D>],
        point: impl Fn(usize, Vector<f64, D>, Tensor<f64, D>) -> R + Sync,
        mut take: impl FnMut(usize, R),
    ) {
        self.1.pass();
        match &self.0 {
            Way::Plain(plain) => {
                let results = infallible(plain.interpolate(field, |p, value, gradient| Ok(point(p, value, gradient))));
                results.into_iter().enumerate().for_each(|(p, result)| take(p, result));
            }
            Way::Tiled(tiled) => {
                let point = |p: usize, rows: &Rows, lane: usize| {
                    let (value, gradient) = of_lane(rows, lane);
                    point(p, value, gradient)
                };
                waves::each_particle(tiled, field, of_block::gather_all, point, take);
            }
        }
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
    pub fn assemble<T: Real, E: Send>(
        &self,
        field: &[Vector<T, D>],
        out: &mut [Vector<T, D>],
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<(Vector<T, D>, Tensor<T, D>), E> + Sync,
    ) -> Result<(), E> {
        self.1.pass();
        either!(self, way => way.assemble(field, out, Magnitude::No, point))
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
    pub fn assemble_magnitudes<T: Real, E: Send>(
        &self,
        field: &[Vector<T, D>],
        out: &mut [Vector<T, D>],
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<(Vector<T, D>, Tensor<T, D>), E> + Sync,
    ) -> Result<(), E> {
        self.1.pass();
        either!(self, way => way.assemble(field, out, Magnitude::Yes, point))
    }

    /// `out_I += Σ_p scatter(p, N_I, ∇_n N_I)`: nothing is gathered.
    ///
    /// Example: [`Self::spread`].
    pub fn scatter<O>(&self, out: &mut [O], scatter: impl Fn(usize, f64, &Vector<f64, D>) -> O + Sync)
    where
        O: Copy + Zero + AddAssign + Send + Sync,
    {
        self.1.pass();
        either!(self, way => way.scatter(out, scatter));
    }

    /// `out_I += Σ_p value(p) N_I`
    ///
    /// ```
    /// use bfree::mechanics::sweep::Supports;
    /// use bfree::tensor::{Tensor, Vector};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let particles = &simulation.particles;
    /// let (supports, nodes) = Supports::new(&simulation.approximation, &simulation.grid, &particles.position)?;
    /// // Σ_p m v N_I has the momentum of the particles.
    /// let mut momentum = vec![Vector::zeros(); nodes.len()];
    /// supports.spread(&mut momentum, |p| particles.velocity[p] * particles.mass[p]);
    /// assert!((momentum.iter().sum::<Vector<f64, 2>>() - particles.momentum()).norm() < 1e-13);
    /// // The diagonal of M, Σ_p m N_I², in two ways; as N ≤ 1 it is at most the lumped mass, Σ_p m N_I.
    /// let (mut lumped, mut diagonal) = (vec![0.0; nodes.len()], vec![0.0; nodes.len()]);
    /// supports.scatter(&mut lumped, |p, n, _| particles.mass[p] * n);
    /// supports.scatter(&mut diagonal, |p, n, _| particles.mass[p] * n * n);
    /// let mut blocks = vec![Tensor::zeros(); nodes.len()];
    /// supports.scatter_blocks(&mut blocks, |_, _, _| Tensor::zeros(), |p| particles.mass[p]);
    /// for ((block, diagonal), lumped) in blocks.iter().zip(diagonal).zip(lumped) {
    ///     assert!((block - Tensor::identity() * diagonal).norm() < 1e-14 && diagonal <= lumped);
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn spread(&self, out: &mut [Vector<f64, D>], value: impl Fn(usize) -> Vector<f64, D> + Sync) {
        self.1.pass();
        match &self.0 {
            Way::Plain(plain) => plain.scatter(out, |p, n, _| value(p) * n),
            Way::Tiled(tiled) => tiled.spread(out, value),
        }
    }

    /// `out_I += Σ_p B_p(∇_n N_I, ∇_n N_I) + m_p N_I² I`, with the bilinear form B_p = `bilinear`(p, ·, ·) and m_p = `mass`(p).
    ///
    /// Example: [`Self::spread`].
    pub fn scatter_blocks(
        &self,
        out: &mut [Tensor<f64, D>],
        bilinear: impl Fn(usize, &Vector<f64, D>, &Vector<f64, D>) -> Tensor<f64, D> + Sync,
        mass: impl Fn(usize) -> f64 + Sync,
    ) {
        self.1.pass();
        match &self.0 {
            Way::Plain(plain) => {
                plain.scatter(out, |p, n, grad_n| bilinear(p, grad_n, grad_n) + Tensor::identity() * (mass(p) * n * n))
            }
            Way::Tiled(tiled) => tiled.scatter_blocks(out, bilinear, mass),
        }
    }

    /// `out_I += Σ_p σ_p ∇_n N_I + q_p N_I` with σ_p = V₀ F S F_nᵀ of the particle's law at ∇u_p, and q_p = `inertia`(p, u_p) if there
    /// is one: the laws in vector lanes. `None` where the sweep has none, or `T` is not the number they hold.
    ///
    /// ```
    /// use bfree::mechanics::{check::direction, residual::Carry, sweep::{Laws, Supports}, transfer::Nodal};
    /// use bfree::tensor::Vector;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let particles = &simulation.particles;
    /// let (supports, nodes) = Supports::new(&simulation.approximation, &simulation.grid, &particles.position)?;
    /// let dphi: Vec<_> = direction::<2>(nodes.len(), 1).iter().map(|x| x * 0.01).collect();
    /// let laws = Laws { particles, bodies: &simulation.bodies };
    /// let (mut force, mut magnitude) = (vec![Vector::zeros(); nodes.len()], vec![Vector::zeros(); nodes.len()]);
    /// supports.forces(&laws, &dphi, None, &mut force).ok_or("LME has vector lanes")??;
    /// supports.force_magnitudes(&laws, &dphi, &mut magnitude).ok_or("LME has vector lanes")??;
    /// // A body pulls at all of its nodes with no force in all: Σ ∇N = 0.
    /// let sum: Vector<f64, 2> = force.iter().sum();
    /// assert!(sum.norm() < 1e-13 * magnitude.iter().map(|size| size.norm()).sum::<f64>());
    /// assert!(force.iter().zip(&magnitude).all(|(force, size)| force.norm() <= size.norm()));
    /// // And what the residual adds to inertia and loads is that.
    /// let nodal = Nodal::at_rest(particles, &supports, nodes.len());
    /// let equilibrium = simulation.equilibrium(&supports, &nodal, &[], bfree::mechanics::time::Alphas::START, 0.0);
    /// let residual = equilibrium.residual(&dphi, Carry::ALL)?;
    /// let inertia = dphi.iter().zip(&nodal.mass).map(|(dphi, &m)| dphi * m);
    /// let apart = residual.iter().zip(inertia).zip(&force).map(|((r, inertia), force)| (r - inertia - force).norm());
    /// assert!(apart.fold(0.0, f64::max) < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// A particle with det F ≤ 0, the same for any number of threads.
    pub fn forces<T: Real, L: Law>(
        &self,
        laws: &Laws<'_, D, L>,
        field: &[Vector<T, D>],
        inertia: Option<Inertia<'_, D>>,
        out: &mut [Vector<T, D>],
    ) -> Option<Result<(), Inadmissible>> {
        match &self.0 {
            Way::Plain(_) => None,
            Way::Tiled(tiled) => tiled.forces(laws, field, inertia, out).inspect(|_| self.1.pass()),
        }
    }

    /// As [`Self::forces`] without inertia, with |σ_p| and |∇_n N_I| in the sum.
    ///
    /// Example: [`Self::forces`].
    ///
    /// # Errors
    /// As [`Self::forces`].
    pub fn force_magnitudes<T: Real, L: Law>(
        &self,
        laws: &Laws<'_, D, L>,
        field: &[Vector<T, D>],
        out: &mut [Vector<T, D>],
    ) -> Option<Result<(), Inadmissible>> {
        match &self.0 {
            Way::Plain(_) => None,
            Way::Tiled(tiled) => tiled.force_magnitudes(laws, field, out).inspect(|_| self.1.pass()),
        }
    }

    /// The closed tangents of all particles at ∇u_p, `both` telling whether they have the term b L c, with the weights of
    /// a consistent inertia if there is one; `None` where the sweep has no vector lanes.
    ///
    /// ```
    /// use bfree::material::{FrozenTangent, Law, NonPositiveJacobian, admissible};
    /// use bfree::mechanics::{check::direction, sweep::{Laws, Supports}};
    /// use bfree::solver::Precision;
    /// use bfree::tensor::{Tensor, Vector, identity};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, law) = (&simulation.particles, &simulation.bodies[0].law);
    /// let (supports, nodes) = Supports::new(&simulation.approximation, &simulation.grid, &particles.position)?;
    /// let dphi: Vec<_> = direction::<2>(nodes.len(), 1).iter().map(|x| x * 0.01).collect();
    /// let freeze = |p: usize, g: Tensor<f64, 2>| {
    ///     Ok::<_, NonPositiveJacobian>(law.freeze(&identity(), &admissible(g)?, particles.volume[p]))
    /// };
    /// let laws = Laws { particles, bodies: &simulation.bodies };
    /// let tangents = supports.closed_tangents(&laws, &dphi, false, None).ok_or("LME has vector lanes")?;
    /// let tangents = tangents.map_err(|_| "deformed too far")?;
    /// assert_eq!(Some(tangents.bytes()), supports.closed_bytes(false, false, Precision::Double));
    /// // In vector lanes as particle by particle: K u = Σ_p (V₀ δP F_nᵀ) ∇N, and its diagonal blocks.
    /// let (u, mut fast, mut plain) = (direction(nodes.len(), 2), vec![Vector::zeros(); nodes.len()], vec![Vector::zeros(); nodes.len()]);
    /// supports.product(&tangents, &u, &mut fast);
    /// let frozen = supports.interpolate(&dphi, |p, _, g| freeze(p, g))?;
    /// supports.assemble(&u, &mut plain, |p, _, l| Ok::<_, NonPositiveJacobian>((Vector::zeros(), frozen[p].apply(&l))))?;
    /// assert!(fast.iter().zip(&plain).all(|(a, b)| (a - b).norm() < 1e-10));
    /// let (mut blocks, mut same) = (vec![Tensor::zeros(); nodes.len()], vec![Tensor::zeros(); nodes.len()]);
    /// supports.add_blocks(&tangents, &mut blocks);
    /// supports.scatter_blocks(&mut same, |p, a, b| frozen[p].block(a, b), |_| 0.0);
    /// assert!(blocks.iter().zip(&same).all(|(a, b)| (a - b).norm() < 1e-10));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// A particle with det F ≤ 0, the same for any number of threads; `None` in its place if a law has no closed tangent at its state.
    pub fn closed_tangents<L: Law>(
        &self,
        laws: &Laws<'_, D, L>,
        field: &[Vector<f64, D>],
        both: bool,
        inertia: Option<&(dyn Fn(usize) -> f64 + Sync)>,
    ) -> Option<Result<ClosedTangents<D>, Option<Inadmissible>>> {
        match &self.0 {
            Way::Plain(_) => None,
            Way::Tiled(tiled) => {
                self.1.pass();
                Some(tiled.closed(laws, field, both, inertia, &self.2))
            }
        }
    }

    /// `out_I += Σ_p σ_p ∇_n N_I + q_p N_I` with the stress of each tangent under ∇u_p, and q of its inertia under u_p. The
    /// tangents must be those of these supports.
    ///
    /// Example: [`Self::closed_tangents`].
    pub fn product(&self, tangents: &ClosedTangents<D>, field: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        if let Way::Tiled(tiled) = &self.0 {
            self.1.pass();
            tiled.product(tangents, field, out);
        }
    }

    /// `out_I += Σ_p K_II` of each tangent and its inertia. The tangents must be those of these supports.
    ///
    /// Example: [`Self::closed_tangents`].
    pub fn add_blocks(&self, tangents: &ClosedTangents<D>, out: &mut [Tensor<f64, D>]) {
        if let Way::Tiled(tiled) = &self.0 {
            self.1.pass();
            tiled.add_blocks(tangents, out);
        }
    }

    /// The spacing h, if the supports are prepared for products in single precision.
    ///
    /// Example: [`Self::single_tangents`].
    pub fn unit(&self) -> Option<f64> {
        match &self.0 {
            Way::Plain(_) => None,
            Way::Tiled(tiled) => tiled.unit,
        }
    }

    /// As [`Self::closed_tangents`], divided by `scale`, in single precision: for gradients in units of 1/h. `None` also where the
    /// supports are not prepared for it.
    ///
    /// ```
    /// use bfree::mechanics::{check::direction, sweep::{Laws, Supports}};
    /// use bfree::solver::Precision;
    /// use bfree::tensor::{Tensor, Vector};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, positions) = (&simulation.particles, &simulation.particles.position);
    /// let (approximation, grid) = (&simulation.approximation, &simulation.grid);
    /// let (supports, nodes) = Supports::with_precision(approximation, grid, positions, Precision::Mixed)?;
    /// let h = supports.unit().ok_or("prepared for single precision")?;
    /// assert_eq!(h, grid.spacing);
    /// // Gradients are in units of 1/h, and K comes divided by a number, h² to leave it as it is.
    /// let (laws, rest) = (Laws { particles, bodies: &simulation.bodies }, vec![Vector::zeros(); nodes.len()]);
    /// let tangents = supports.closed_tangents(&laws, &rest, false, None).ok_or("LME has vector lanes")?;
    /// let single = supports.single_tangents(&laws, &rest, false, None, 1.0).ok_or("and in single precision")?;
    /// let (tangents, single) = (tangents.map_err(|_| "at rest")?, single.map_err(|_| "at rest")?);
    /// assert!(single.bytes() < tangents.bytes());
    /// let u = direction::<2>(nodes.len(), 2);
    /// let rough_u: Vec<Vector<f32, 2>> = u.iter().map(|u| u.map(|x| x as f32)).collect();
    /// let (mut exact, mut rough) = (rest.clone(), vec![Vector::zeros(); nodes.len()]);
    /// supports.product(&tangents, &u, &mut exact);
    /// supports.single_product(&single, &rough_u, &mut rough);
    /// let size = exact.iter().map(|x| x.norm()).fold(0.0, f64::max);
    /// assert!(exact.iter().zip(&rough).all(|(a, b)| (a - b.map(f64::from)).norm() < 1e-5 * size));
    /// let mut blocks = vec![Tensor::zeros(); nodes.len()];
    /// supports.add_single_blocks(&single, &mut blocks);
    /// assert!(blocks.iter().all(|block| (block - block.transpose()).norm() <= 1e-6 * block.norm()));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`Self::closed_tangents`].
    #[allow(clippy::too_many_arguments)] // as above, with a scale
    pub fn single_tangents<L: Law>(
        &self,
        laws: &Laws<'_, D, L>,
        field: &[Vector<f64, D>],
        both: bool,
        inertia: Option<&(dyn Fn(usize) -> f64 + Sync)>,
        scale: f64,
    ) -> Option<Result<SingleTangents<D>, Option<Inadmissible>>> {
        match &self.0 {
            Way::Plain(_) => None,
            Way::Tiled(tiled) => {
                self.1.pass();
                tiled.closed_single(laws, field, both, inertia, scale, &self.2)
            }
        }
    }

    /// [`Self::product`] in single precision, gradients in units of 1/h.
    ///
    /// Example: [`Self::single_tangents`].
    pub fn single_product(&self, tangents: &SingleTangents<D>, field: &[Vector<f32, D>], out: &mut [Vector<f32, D>]) {
        if let Way::Tiled(tiled) = &self.0 {
            self.1.pass();
            tiled.product_single(tangents, field, out);
        }
    }

    /// [`Self::add_blocks`] in single precision, gradients in units of 1/h.
    ///
    /// Example: [`Self::single_tangents`].
    pub fn add_single_blocks(&self, tangents: &SingleTangents<D>, out: &mut [Tensor<f32, D>]) {
        if let Way::Tiled(tiled) = &self.0 {
            self.1.pass();
            tiled.add_blocks_single(tangents, out);
        }
    }

    /// Bytes of [`Self::closed_tangents`], or of [`Self::single_tangents`]; `None` where the sweep has no vector lanes.
    ///
    /// Example: [`Self::closed_tangents`].
    pub fn closed_bytes(&self, both: bool, inertia: bool, precision: Precision) -> Option<usize> {
        match &self.0 {
            Way::Plain(_) => None,
            Way::Tiled(tiled) => Some(tiled.closed_bytes(both, inertia, precision == Precision::Mixed)),
        }
    }

    /// `point(p, u_p, ∇u_p)` of every particle, in their order.
    ///
    /// Example: [`Self::assemble`].
    ///
    /// # Errors
    /// The error of the first particle in memory whose `point` fails.
    pub fn interpolate<T: Real, R: Send, E: Send>(
        &self,
        field: &[Vector<T, D>],
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<R, E> + Sync,
    ) -> Result<Vec<R>, E> {
        self.1.pass();
        either!(self, way => way.interpolate(field, point))
    }
}

/// `f(0), …, f(count − 1)`, on all cores; the error is that of the smallest index.
fn ordered<R: Send, E: Send>(count: usize, f: impl Fn(usize) -> Result<R, E> + Sync) -> Result<Vec<R>, E> {
    parallel::map(0..count, f).into_iter().collect()
}

fn infallible<R>(result: Result<R, std::convert::Infallible>) -> R {
    match result {
        Ok(value) => value,
        Err(never) => match never {},
    }
}
