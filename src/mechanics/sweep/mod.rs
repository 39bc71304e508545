//! The loop over particles: gather nodal values (grid to particle), evaluate at the particle, scatter (particle to grid).
//! Threads are used here and in the vectors of the solver. Vector instructions are used here alone.
//!
//! The loop knows components, not their physical meaning. A field has C numbers a node. The gather gives a particle C values
//! u = Σ u_I N_I and C gradients L = Σ u_I ⊗ ∇_n N_I. A point function turns u and L into q and σ. The scatter is
//! f_I += q N_I + σ ∇_n N_I. A mass has one component, a motion has D.
//!
//! Gather and scatter are linear, so a dual number travels as two fields. Derivatives therefore go through the production kernels.
//!
//! - A *pass* is one run of gather, point function and scatter over all particles. Gather or scatter may be missing.
//! - A *lane* is one slot of a vector of eight numbers, and holds one particle.
//! - A *group* is a batch of up to eight particles that share a window of nodes. They lie in one cell, or in neighbours along x.
//! - A *block* is a cube of cells with a box of nodes. It gathers from its own nodes and scatters into its own buffer.
//!   Blocks do not depend on the number of threads, and their buffers are added in the order of the blocks.
//!   So the result has the same bits for any number of threads.
//!
//! Two implementations give one answer. `plain` is the specification, and serves shape functions that are not products.
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
pub(crate) use laned::{add_quadratic, product};
pub use lanes::LANES;
pub use laws::Laws;
pub use number::Number;
pub use supports::{Points, SupportError, Supports};
pub(crate) use tangents::{AddTo, Form, Product};

/// `(group, u and L, q and σ)` of every field: adds to q and σ, which begin with zero. A pass makes this function once.
type Point<'a, const C: usize, const D: usize> = dyn Fn(Group<'_>, &[At<f64, C, D>], &mut [At<f64, C, D>]) + Sync + 'a;

/// `(particle, u and L of every field, lane)`: the result at the particle in this lane.
type Visit<'a, R, const C: usize, const D: usize> = dyn Fn(usize, &[At<f64, C, D>], usize) -> R + Sync + 'a;

/// `(group, u and L, rows)`: fills the rows of a group.
pub(crate) type Fill<'a, const D: usize> = dyn Fn(Group<'_>, &At<f64, D, D>, &mut [[f64; LANES]]) + Sync + 'a;

/// A [`Point`] function of one field.
pub(crate) type Linear<'a, const D: usize> = dyn Fn(Group<'_>, &At<f64, D, D>, &mut At<f64, D, D>) + Sync + 'a;
