//! The kernels of one group, compiled here once for each number type, dimension and instruction set.
//!
//! No function here is generic for its caller. So neither another crate nor a point function compiles a kernel again.

use super::block::Groups;
use super::blocks::{Quadratic, ScatterBlocks};
use super::kernel::{Gather, In, Scatter};
use super::lanes::{LANES, Widest};
use super::tangents::{AddTo, Form, Product};
use crate::pooled;
use bytemuck::Pod;

/// A plain number in double or single precision, with its compiled kernels.
pub trait Laned: Widest + Pod + Default + Send + Sync + pooled::Number {
    /// The weights of all groups of a block.
    fn weights(groups: &Groups) -> &[[Self; LANES]];

    /// Gathers values and gradients from a box with `components` numbers a node: 1, or as many as there are axes.
    fn gather(components: usize, work: Gather<'_, Self>);

    /// Scatters values and gradients into a box.
    fn scatter(components: usize, work: Scatter<'_, Self>);

    /// Adds the product 𝔸 : L of a group's tangents with its gradients.
    fn product(dimension: usize, work: Product<'_, Self>);
}

/// Runs a kernel with the widest lanes of a number type, for one component or for as many as there are axes.
macro_rules! widest {
    ($number:ty, $dimension:expr, $work:expr) => {
        match $dimension {
            1 => <$number>::widest(In::<_, 1, 1>($work)),
            2 => <$number>::widest(In::<_, 2, 2>($work)),
            _ => <$number>::widest(In::<_, 3, 3>($work)),
        }
    };
    ($number:ty, $dimension:expr, $components:expr, $work:expr) => {
        match ($dimension, $components) {
            (2, 1) => <$number>::widest(In::<_, 1, 2>($work)),
            (3, 1) => <$number>::widest(In::<_, 1, 3>($work)),
            _ => widest!($number, $dimension, $work),
        }
    };
}

macro_rules! laned {
    ($number:ident, $weights:ident) => {
        impl Laned for $number {
            fn weights(groups: &Groups) -> &[[Self; LANES]] {
                &groups.$weights
            }

            fn gather(components: usize, work: Gather<'_, Self>) {
                widest!(Self, work.window.dimension, components, work);
            }

            fn scatter(components: usize, work: Scatter<'_, Self>) {
                widest!(Self, work.window.dimension, components, work);
            }

            fn product(dimension: usize, work: Product<'_, Self>) {
                widest!(Self, dimension, work);
            }
        }
    };
}

laned!(f64, weights);
laned!(f32, single);

/// Adds the diagonal blocks of a group's quadratic form to a box of D×D blocks.
pub(super) fn blocks(work: ScatterBlocks<'_>) {
    widest!(f64, work.window.dimension, work);
}

/// Adds `factor` times the quadratic form of the tangents of a group; see [`AddTo`].
pub(crate) fn add_quadratic<X: Laned>(
    form: Form,
    dimension: usize,
    rows: &[[X; LANES]],
    factor: f64,
    into: &mut Quadratic,
) {
    let mut plain = [[0.0; LANES]; Form::General.rows(3)];
    plain.iter_mut().zip(rows).for_each(|(to, from)| *to = from.map(X::value));
    widest!(f64, dimension, AddTo { form, rows: &plain[..rows.len()], factor, into });
}
