//! The kernels of one block of cells, each compiled once for a dimension, in this library.
//!
//! Generic code is compiled anew by every program that uses it and for every closure it is given, and a kernel stands for
//! three instruction sets and six widths of window. So the kernels meet the rest of the code here, in plain functions.

use super::closed::{ClosedTangents, DiagonalBlocks, Product};
use super::kernel::{Quadratic, Stored, Terms, Window, gather, scatter, scatter_blocks};
use super::lanes::{Lanes, WithLanes, widest};
use super::tiled::Block;
use std::any::Any;

/// u and L of every group of a block, or what takes their place: q and σ.
#[derive(Default)]
pub(super) struct Groups<const D: usize>(pub Vec<Stored<D>>);

/// What a scatter adds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sum {
    /// σ ∇N_I + q N_I
    All,
    /// σ |∇N_I| + q |N_I|
    Magnitudes,
    /// q N_I
    Values,
}

macro_rules! compiled {
    ($($dimension:literal in $module:ident),*) => { $(
        mod $module {
            use super::*;
            const D: usize = $dimension;

            pub(super) fn gathered(block: &Block<D>, nodal: &[f64], into: &mut Groups<D>) {
                widest(Gather { block, nodal, into });
            }

            pub(super) fn scattered(block: &Block<D>, from: &Groups<D>, sum: Sum, buffer: &mut [f64]) {
                match sum {
                    Sum::All => widest(Scatter { block, from, buffer, terms: All }),
                    Sum::Magnitudes => widest(Scatter { block, from, buffer, terms: Magnitudes }),
                    Sum::Values => widest(Scatter { block, from, buffer, terms: Values }),
                }
            }

            pub(super) fn product(block: &Block<D>, frozen: &ClosedTangents<D>, nodal: &[f64], buffer: &mut [f64]) {
                match (frozen.both, frozen.inertia) {
                    (false, false) => widest(Product::<D, false, false> { block, frozen, nodal, buffer }),
                    (false, true) => widest(Product::<D, false, true> { block, frozen, nodal, buffer }),
                    (true, false) => widest(Product::<D, true, false> { block, frozen, nodal, buffer }),
                    (true, true) => widest(Product::<D, true, true> { block, frozen, nodal, buffer }),
                }
            }

            pub(super) fn diagonal_blocks(block: &Block<D>, frozen: &ClosedTangents<D>, buffer: &mut [f64]) {
                widest(DiagonalBlocks { block, frozen, buffer });
            }

            pub(super) fn quadratic(window: &Window<'_>, from: &Quadratic<D>, buffer: &mut [f64]) {
                widest(Blocks { window, from, buffer });
            }
        }
    )* };
}

compiled!(1 in one, 2 in two, 3 in three);

/// Calls the function of the one dimension whose types the arguments have.
macro_rules! of_dimension {
    ($function:ident($($argument:expr),*)) => {
        (|| Some(one::$function($($argument),*)))()
            .or_else(|| Some(two::$function($($argument),*)))
            .or_else(|| Some(three::$function($($argument),*)))
            .unwrap_or(())
    };
}

/// `x`, if its type is that one.
fn same<A: 'static, B: 'static>(x: &A) -> Option<&B> {
    (x as &dyn Any).downcast_ref()
}

/// As [`same`].
fn same_mut<A: 'static, B: 'static>(x: &mut A) -> Option<&mut B> {
    (x as &mut dyn Any).downcast_mut()
}

/// u = Σ u_I N_I and L = Σ u_I ⊗ ∇N_I of every group; `nodal` holds the box, component after component of each node.
pub(super) fn gathered<const D: usize>(block: &Block<D>, nodal: &[f64], into: &mut Groups<D>) {
    of_dimension!(gathered(same(block)?, nodal, same_mut(into)?));
}

/// Adds q and σ of every group to the box `buffer`, eight numbers longer than its nodes.
pub(super) fn scattered<const D: usize>(block: &Block<D>, from: &Groups<D>, sum: Sum, buffer: &mut [f64]) {
    of_dimension!(scattered(same(block)?, same(from)?, sum, buffer));
}

/// Gathers L, and u if there is inertia, takes the product with the tangents, and adds the result to `buffer`.
pub(super) fn product<const D: usize>(block: &Block<D>, frozen: &ClosedTangents<D>, nodal: &[f64], buffer: &mut [f64]) {
    of_dimension!(product(same(block)?, same(frozen)?, nodal, buffer));
}

/// Adds the diagonal blocks of the tangents to a box of D×D blocks by rows, eight numbers longer than its nodes.
pub(super) fn diagonal_blocks<const D: usize>(block: &Block<D>, frozen: &ClosedTangents<D>, buffer: &mut [f64]) {
    of_dimension!(diagonal_blocks(same(block)?, same(frozen)?, buffer));
}

/// As [`diagonal_blocks`], of one group and from a quadratic form of ∇N_I.
pub(super) fn quadratic<const D: usize>(window: &Window<'_>, from: &Quadratic<D>, buffer: &mut [f64]) {
    of_dimension!(quadratic(window, same(from)?, buffer));
}

struct Gather<'a, const D: usize> {
    block: &'a Block<D>,
    nodal: &'a [f64],
    into: &'a mut Groups<D>,
}

impl<const D: usize> WithLanes for Gather<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        self.into.0.clear();
        for group in 0..self.block.groups() {
            self.into.0.push(Stored::of(s, &gather::<S, D, true>(s, &self.block.window(group), self.nodal)));
        }
    }
}

struct Scatter<'a, M, const D: usize> {
    block: &'a Block<D>,
    from: &'a Groups<D>,
    buffer: &'a mut [f64],
    #[allow(dead_code)] // only its type counts
    terms: M,
}

impl<M: Terms, const D: usize> WithLanes for Scatter<'_, M, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        for (group, from) in self.from.0.iter().enumerate() {
            scatter::<S, M, D>(s, &self.block.window(group), &from.load(s), self.buffer);
        }
    }
}

struct Blocks<'a, 'w, const D: usize> {
    window: &'a Window<'w>,
    from: &'a Quadratic<D>,
    buffer: &'a mut [f64],
}

impl<const D: usize> WithLanes for Blocks<'_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        scatter_blocks(s, self.window, self.from, self.buffer);
    }
}

struct All;
impl Terms for All {
    const VALUE: bool = true;
    const GRADIENT: bool = true;
    const MAGNITUDE: bool = false;
}

struct Magnitudes;
impl Terms for Magnitudes {
    const VALUE: bool = true;
    const GRADIENT: bool = true;
    const MAGNITUDE: bool = true;
}

struct Values;
impl Terms for Values {
    const VALUE: bool = true;
    const GRADIENT: bool = false;
    const MAGNITUDE: bool = false;
}
