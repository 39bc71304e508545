//! The transfer between particles and grid. This is the loop, for a field u_I at the nodes:
//!
//! ```text
//! for p in particles {
//!     u = Σ_I u_I N_I(x_p)                            gather, grid to particle
//!     L = Σ_I u_I ⊗ ∇N_I(x_p)
//!     (q, σ) = point(p, u, L)                         evaluate, for example the stress of a law
//!     for I in nodes(p) {
//!         f_I += q N_I(x_p) + σ ∇N_I(x_p)             scatter, particle to grid
//!     }
//! }
//! ```
//!
//! One run of the loop over all particles is a *pass*. Gather or scatter may be missing. The loop knows components, not their physical
//! meaning: a mass has one component a node, a motion has D. Gather and scatter are linear, so a dual number travels as two fields.
//! Derivatives therefore go through the production kernels.
//!
//! `plain.rs` is this loop, and serves shape functions that are not products. For products N = Π_k N_k, `tiled.rs` has the shape functions
//! of each axis, and `regions.rs` runs the loop over them on all cores. Both agree to round-off. The words:
//!
//! - A *lane* is one slot of a vector of eight numbers, and holds one particle.
//! - A *group* is a batch of up to eight particles that share a window of nodes. They lie in one cell, or in neighbours along x.
//! - A *block* is a cube of cells with a box of nodes. It gathers from its own nodes and scatters into its own buffer.
//!   Blocks do not depend on the number of threads, and their buffers are added in the order of the blocks.
//!   So the result has the same bits for any number of threads.
//!
//! Passes share blocks between the threads. Other loops over nodes or particles share parts of fixed length.

mod block;
mod blocks;
mod builder;
mod columns;
mod connectivity;
mod fields;
mod foreign;
mod group;
mod kernel;
mod lattice;
mod mode;
mod number;
mod numbering;
mod on_device;
mod order;
mod passes;
mod plain;
mod points;
mod regions;
mod shares;
mod tiled;

pub(crate) use blocks::{Quadratic, pair};
pub(crate) use columns::WIDEST;
pub use connectivity::Connectivity;
pub use fields::Fields;
pub use group::{At, Group};
pub(crate) use lattice::stride;
pub use mode::{Mode, Weights};
pub use number::Number;
pub use points::{Points, ShapeFunctionError};

use block::Block;

/// `(group, u and L, q and σ)` of every field: adds to q and σ, which begin with zero. A pass makes this function once.
type Point<'a, const C: usize, const D: usize> = dyn Fn(Group<'_>, &[At<f64, C, D>], &mut [At<f64, C, D>]) + Sync + 'a;

/// `(group, u and L of every field, results)`: writes the results of the group.
type Evaluate<'a, R, const C: usize, const D: usize> = dyn Fn(Group<'_>, &[At<f64, C, D>], &mut [R]) + Sync + 'a;

/// The results of a pass: so many for each particle, or for each group.
#[derive(Clone, Copy)]
enum Each {
    Particle(usize),
    Group(usize),
}

impl Each {
    /// The number of results of a group with so many particles.
    fn of_group(self, particles: usize) -> usize {
        match self {
            Self::Particle(count) => particles * count,
            Self::Group(count) => count,
        }
    }

    /// The number of results of a block.
    fn of_block(self, block: &Block) -> usize {
        match self {
            Self::Particle(count) => block.count() * count,
            Self::Group(count) => block.len() * count,
        }
    }
}
