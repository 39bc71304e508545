//! The kernels of one group, compiled here once for each dimension and instruction set.
//!
//! No function here is generic for its caller. So neither another crate nor a point function compiles a kernel again.

use super::blocks::ScatterBlocks;
use super::kernel::{Gather, In, Scatter};
use super::lanes::widest;
use super::tangents::{AddTo, Product};

/// Runs a kernel with the widest lanes, for one component or for as many as there are axes.
macro_rules! in_dimension {
    ($dimension:expr, $work:expr) => {
        match $dimension {
            1 => widest(In::<_, 1, 1>($work)),
            2 => widest(In::<_, 2, 2>($work)),
            _ => widest(In::<_, 3, 3>($work)),
        }
    };
    ($dimension:expr, $components:expr, $work:expr) => {
        match ($dimension, $components) {
            (2, 1) => widest(In::<_, 1, 2>($work)),
            (3, 1) => widest(In::<_, 1, 3>($work)),
            _ => in_dimension!($dimension, $work),
        }
    };
}

/// Gathers values and gradients from a box with `components` numbers a node: 1, or as many as there are axes.
pub(super) fn gather(components: usize, work: Gather<'_>) {
    in_dimension!(work.window.dimension, components, work);
}

/// Scatters values and gradients into a box.
pub(super) fn scatter(components: usize, work: Scatter<'_>) {
    in_dimension!(work.window.dimension, components, work);
}

/// Adds the product 𝔸 : L of a group's tangents with its gradients.
pub(crate) fn product(dimension: usize, work: Product<'_>) {
    in_dimension!(dimension, work);
}

/// Adds the diagonal blocks of a group's quadratic form to a box of D×D blocks.
pub(super) fn blocks(work: ScatterBlocks<'_>) {
    in_dimension!(work.window.dimension, work);
}

/// Adds the quadratic form of the tangents of a group.
pub(crate) fn add_quadratic(dimension: usize, work: AddTo<'_>) {
    in_dimension!(dimension, work);
}
