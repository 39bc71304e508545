//! The loop over particles: gather → point → scatter. The only place that knows threads and vector instructions.
//!
//! Two ways with one answer: `plain` is the specification, and the way of shape functions that are no products;
//! `tiled` is for products, N = Π_k N_k. Both cut the particles into blocks that do not depend on the number of threads.
//! A block gathers from its own nodes, scatters into its own buffer, and the buffers are added in the order of the blocks:
//! the same bits for any number of threads.

mod block;
mod builder;
mod closed;
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
use crate::scalar::Real;
use crate::solver::Precision;
use crate::tensor::{Tensor, Vector};
use num_traits::Zero;
use plain::Plain;
use rayon::prelude::*;
use std::ops::AddAssign;
use tally::Tally;
use tiled::Tiled;

/// Particles per block of the plain sweep: large enough to pay for a task, small enough to keep a block's nodes in cache.
const BLOCK: usize = 256;

/// Products with more nodes than this along an axis take the plain sweep: the box of a block would leave the cache.
const WIDEST: usize = 16;

/// Shape functions of all particles at the last converged positions, and the active nodes they name.
#[derive(Clone, Debug)]
pub struct Supports<const D: usize>(Way<D>, Tally);

#[derive(Clone, Debug)]
enum Way<const D: usize> {
    Plain(Plain<D>),
    Tiled(Tiled<D>),
}

/// The shape functions of a particle could not be evaluated.
#[derive(Clone, Debug, thiserror::Error)]
#[error("particle {particle} has no shape functions")]
pub struct SupportError {
    /// Number of the particle.
    pub particle: usize,
    /// What went wrong.
    pub source: ApproximationError,
}

/// q of a particle from its number and u.
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
    /// The first particle, in their order, that lies outside the grid or whose shape functions do not exist.
    pub fn new<A: ShapeFunction>(
        approximation: &A,
        grid: &Grid<D>,
        positions: &[Vector<f64, D>],
    ) -> Result<(Self, Nodes), SupportError> {
        Self::with_precision(approximation, grid, positions, Precision::Double)
    }

    /// As [`Self::new`], prepared for products in single precision if they are asked for and shape functions are products.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_precision<A: ShapeFunction>(
        approximation: &A,
        grid: &Grid<D>,
        positions: &[Vector<f64, D>],
        precision: Precision,
    ) -> Result<(Self, Nodes), SupportError> {
        match approximation.separable() {
            Some(product) if product.width() <= WIDEST => {
                let single = precision == Precision::Mixed;
                let (tiled, nodes) = Tiled::new(approximation, product, grid, positions, single)?;
                Ok((Self(Way::Tiled(tiled), Tally::of(nodes.len())), nodes))
            }
            _ => Self::plain(approximation, grid, positions),
        }
    }

    /// As [`Self::new`], by the plain sweep whatever the shape function: the specification of the fast one.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn plain<A: ShapeFunction>(
        approximation: &A,
        grid: &Grid<D>,
        positions: &[Vector<f64, D>],
    ) -> Result<(Self, Nodes), SupportError> {
        let (plain, nodes) = Plain::new(approximation, grid, positions)?;
        Ok((Self(Way::Plain(plain), Tally::of(nodes.len())), nodes))
    }

    /// Number of particles.
    pub fn particles(&self) -> usize {
        either!(self, way => way.particles())
    }

    /// Number of active nodes.
    pub fn nodes(&self) -> usize {
        self.1.nodes
    }

    /// How often the methods below have gone through all particles so far.
    pub fn passes(&self) -> u64 {
        self.1.passes()
    }

    /// The groups of particles that share a window of nodes in vector lanes: nodes along each axis, and particles; none where the
    /// sweep has no vector lanes. For counting operations.
    pub fn windows(&self) -> Vec<([usize; 3], usize)> {
        match &self.0 {
            Way::Plain(_) => Vec::new(),
            Way::Tiled(tiled) => tiled.windows(),
        }
    }

    /// Bytes of all arrays.
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
        self.each_particle(field, |_, value, _| value, |p, value| values[p] = value);
        values
    }

    /// `take(p, point(p, u_p, ∇u_p))` of every particle, in an order that does not depend on the number of threads.
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
            Way::Tiled(tiled) => waves::each_particle(tiled, field, point, take),
        }
    }

    /// `out_I += Σ_p σ_p ∇_n N_I + q_p N_I` with `(q_p, σ_p) = point(p, u_p, ∇u_p)`, u_p = Σ u_I N_I and
    /// ∇u_p = Σ u_I ⊗ ∇_n N_I.
    ///
    /// # Errors
    /// The error of the first particle, in their order, whose `point` fails.
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
    pub fn scatter<O>(&self, out: &mut [O], scatter: impl Fn(usize, f64, &Vector<f64, D>) -> O + Sync)
    where
        O: Copy + Zero + AddAssign + Send + Sync,
    {
        self.1.pass();
        either!(self, way => way.scatter(out, scatter));
    }

    /// `out_I += Σ_p value(p) N_I`
    pub fn spread(&self, out: &mut [Vector<f64, D>], value: impl Fn(usize) -> Vector<f64, D> + Sync) {
        self.1.pass();
        match &self.0 {
            Way::Plain(plain) => plain.scatter(out, |p, n, _| value(p) * n),
            Way::Tiled(tiled) => tiled.spread(out, value),
        }
    }

    /// `out_I += Σ_p B_p(∇_n N_I, ∇_n N_I) + m_p N_I² I`, with the bilinear form B_p = `bilinear`(p, ·, ·) and m_p = `mass`(p).
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
    /// # Errors
    /// The first particle, in their order, with det F ≤ 0.
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
    /// # Errors
    /// The first particle, in their order, with det F ≤ 0; `None` in its place if a law has no closed tangent at its state.
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
                Some(tiled.closed(laws, field, both, inertia))
            }
        }
    }

    /// `out_I += Σ_p σ_p ∇_n N_I + q_p N_I` with the stress of each tangent under ∇u_p, and q of its inertia under u_p. The
    /// tangents must be those of these supports.
    pub fn product(&self, tangents: &ClosedTangents<D>, field: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        if let Way::Tiled(tiled) = &self.0 {
            self.1.pass();
            tiled.product(tangents, field, out);
        }
    }

    /// `out_I += Σ_p K_II` of each tangent and its inertia. The tangents must be those of these supports.
    pub fn add_blocks(&self, tangents: &ClosedTangents<D>, out: &mut [Tensor<f64, D>]) {
        if let Way::Tiled(tiled) = &self.0 {
            self.1.pass();
            tiled.add_blocks(tangents, out);
        }
    }

    /// The spacing h, if the supports are prepared for products in single precision.
    pub fn unit(&self) -> Option<f64> {
        match &self.0 {
            Way::Plain(_) => None,
            Way::Tiled(tiled) => tiled.unit,
        }
    }

    /// As [`Self::closed_tangents`], divided by `scale`, in single precision: for gradients in units of 1/h. `None` also where the
    /// supports are not prepared for it.
    ///
    /// # Errors
    /// As [`Self::closed_tangents`].
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
                tiled.closed_single(laws, field, both, inertia, scale)
            }
        }
    }

    /// [`Self::product`] in single precision, gradients in units of 1/h.
    pub fn single_product(&self, tangents: &SingleTangents<D>, field: &[Vector<f32, D>], out: &mut [Vector<f32, D>]) {
        if let Way::Tiled(tiled) = &self.0 {
            self.1.pass();
            tiled.product_single(tangents, field, out);
        }
    }

    /// [`Self::add_blocks`] in single precision, gradients in units of 1/h.
    pub fn add_single_blocks(&self, tangents: &SingleTangents<D>, out: &mut [Tensor<f32, D>]) {
        if let Way::Tiled(tiled) = &self.0 {
            self.1.pass();
            tiled.add_blocks_single(tangents, out);
        }
    }

    /// Bytes of [`Self::closed_tangents`], or of [`Self::single_tangents`]; `None` where the sweep has no vector lanes.
    pub fn closed_bytes(&self, both: bool, inertia: bool, precision: Precision) -> Option<usize> {
        match &self.0 {
            Way::Plain(_) => None,
            Way::Tiled(tiled) => Some(tiled.closed_bytes(both, inertia, precision == Precision::Mixed)),
        }
    }

    /// `point(p, u_p, ∇u_p)` of every particle, in their order.
    ///
    /// # Errors
    /// The error of the first particle, in their order, whose `point` fails.
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
    if count <= 1 || rayon::current_num_threads() == 1 {
        return (0..count).map(f).collect();
    }
    // Collect first: rayon's own short-circuit would return whichever error came first in time.
    let results: Vec<Result<R, E>> = (0..count).into_par_iter().map(&f).collect();
    results.into_iter().collect()
}

fn infallible<R>(result: Result<R, std::convert::Infallible>) -> R {
    match result {
        Ok(value) => value,
        Err(never) => match never {},
    }
}
