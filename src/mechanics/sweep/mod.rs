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
mod flow;
mod kernel;
mod laned;
mod lanes;
mod laws;
mod number;
mod order;
mod passes;
mod plain;
mod supports;
mod tangents;
mod tiled;
mod waves;

pub use block::Group;
pub use blocks::Quadratic;
pub use flow::{Flow, Weights};
pub use kernel::At;
pub use laned::Laned;
pub(crate) use laned::add_quadratic;
pub use lanes::LANES;
pub use laws::Laws;
pub use number::Number;
pub use supports::{Points, SupportError, Supports};
pub use tangents::{Form, Product};

/// `(group, u and L, q and σ)` of every field: adds to the last, which begin with zero. It is found once a pass.
type Point<'a, X, const C: usize, const D: usize> = dyn Fn(Group<'_>, &[At<X, C, D>], &mut [At<X, C, D>]) + Sync + 'a;

/// `(particle, what was gathered of every field, lane)`: what becomes of it there.
type Visit<'a, R, const C: usize, const D: usize> = dyn Fn(usize, &[At<f64, C, D>], usize) -> R + Sync + 'a;

/// `(group, what was gathered, rows)`: fills the rows of a group.
pub(crate) type Fill<'a, Y, const D: usize> = dyn Fn(Group<'_>, &At<f64, D, D>, &mut [Y]) + Sync + 'a;

/// As [`Point`], of one field.
pub(crate) type Linear<'a, X, const D: usize> = dyn Fn(Group<'_>, &At<X, D, D>, &mut At<X, D, D>) + Sync + 'a;
