//! The kernels over one block of cells.
//!
//! What other files call is not generic, so that the kernels are compiled once, here, for every number, dimension and instruction
//! set, and not again by every crate and for every point function: what a particle does comes in by reference. rustc compiles on one
//! core what one module calls, and these kernels are half of the library: hence a module for every two or three of them.

mod blocks;
mod each;
mod one_way;
mod product;
mod stresses;

pub(super) use blocks::{diagonal, diagonal_single, quadratics};
pub(super) use each::{each, magnitudes};
pub(super) use one_way::{gather_all, gather_values, spread};
pub(super) use product::double::product;
pub(super) use product::single::product_single;
pub(super) use stresses::stresses;

use super::block::Groups;
use super::kernel::Rows;
use super::lanes::{LANES, SINGLE_LANES};

/// The groups of a block in double precision.
type Double = Groups<f64, LANES>;

/// The same in single precision.
type Single = Groups<f32, SINGLE_LANES>;

/// What is done at the particles of a group: puts q in the place of u and σ in that of L.
pub(super) type Point<'a> = dyn Fn(&[u32], &mut Rows) + Sync + 'a;

/// Calls a function of the dimension.
macro_rules! by_dimension {
    ($number:ty, $groups:expr, $work:ident $(::<$($generic:ty),*>)? { $($field:ident),* }) => {
        match $groups.dimension {
            1 => <$number>::widest($work::<1 $($(, $generic)*)?> { $($field),* }),
            2 => <$number>::widest($work::<2 $($(, $generic)*)?> { $($field),* }),
            _ => <$number>::widest($work::<3 $($(, $generic)*)?> { $($field),* }),
        }
    };
}

use by_dimension;
