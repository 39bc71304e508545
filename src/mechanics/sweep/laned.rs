//! The kernels of one group, compiled here once for each number, dimension and instruction set.
//!
//! Nothing here is generic for those who call it, so that no other crate and no point function compiles a kernel again.

use super::block::Groups;
use super::blocks::{Quadratic, ScatterBlocks};
use super::kernel::{Gather, Parts, Scatter, Window};
use super::lanes::{LANES, Widest};
use super::tangents::{AddTo, Form, Product};
use crate::pooled;
use bytemuck::Pod;

/// A number of which fields are gathered and scattered, in double or in single precision.
pub trait Laned: Widest + Pod + Send + Sync + pooled::Number {
    /// The weights of all groups of a block.
    fn weights(groups: &Groups) -> &[[Self; LANES]];

    /// Values and gradients of `components` numbers a node, 1 or as many as axes, from a box.
    fn gather(
        components: usize,
        window: Window<'_, Self>,
        nodal: &[Self],
        parts: Parts,
        value: &mut [[Self; LANES]],
        gradient: &mut [[Self; LANES]],
    );

    /// Adds values and gradients to a box.
    fn scatter(
        components: usize,
        window: Window<'_, Self>,
        parts: Parts,
        value: &[[Self; LANES]],
        gradient: &[[Self; LANES]],
        out: &mut [Self],
    );

    /// Adds the product of a group's tangents with its gradients.
    fn product(form: Form, dimension: usize, rows: &[[Self; LANES]], l: &[[Self; LANES]], out: &mut [[Self; LANES]]);
}

macro_rules! laned {
    ($number:ident, $weights:ident) => {
        impl Laned for $number {
            fn weights(groups: &Groups) -> &[[Self; LANES]] {
                &groups.$weights
            }

            fn gather(
                components: usize,
                window: Window<'_, Self>,
                nodal: &[Self],
                parts: Parts,
                value: &mut [[Self; LANES]],
                gradient: &mut [[Self; LANES]],
            ) {
                match (window.dimension, components) {
                    (1, _) => Self::widest(Gather::<_, 1, 1> { window, nodal, parts, value, gradient }),
                    (2, 1) => Self::widest(Gather::<_, 1, 2> { window, nodal, parts, value, gradient }),
                    (2, _) => Self::widest(Gather::<_, 2, 2> { window, nodal, parts, value, gradient }),
                    (_, 1) => Self::widest(Gather::<_, 1, 3> { window, nodal, parts, value, gradient }),
                    (_, _) => Self::widest(Gather::<_, 3, 3> { window, nodal, parts, value, gradient }),
                }
            }

            fn scatter(
                components: usize,
                window: Window<'_, Self>,
                parts: Parts,
                value: &[[Self; LANES]],
                gradient: &[[Self; LANES]],
                out: &mut [Self],
            ) {
                match (window.dimension, components) {
                    (1, _) => Self::widest(Scatter::<_, 1, 1> { window, parts, value, gradient, out }),
                    (2, 1) => Self::widest(Scatter::<_, 1, 2> { window, parts, value, gradient, out }),
                    (2, _) => Self::widest(Scatter::<_, 2, 2> { window, parts, value, gradient, out }),
                    (_, 1) => Self::widest(Scatter::<_, 1, 3> { window, parts, value, gradient, out }),
                    (_, _) => Self::widest(Scatter::<_, 3, 3> { window, parts, value, gradient, out }),
                }
            }

            fn product(
                form: Form,
                dimension: usize,
                rows: &[[Self; LANES]],
                l: &[[Self; LANES]],
                out: &mut [[Self; LANES]],
            ) {
                match dimension {
                    1 => Self::widest(Product::<_, 1> { form, rows, l, out }),
                    2 => Self::widest(Product::<_, 2> { form, rows, l, out }),
                    _ => Self::widest(Product::<_, 3> { form, rows, l, out }),
                }
            }
        }
    };
}

laned!(f64, weights);
laned!(f32, single);

/// Adds the diagonal blocks of a group's quadratic form to a box of D×D blocks.
pub(super) fn blocks(window: Window<'_, f64>, from: &Quadratic, out: &mut [f64]) {
    match window.dimension {
        1 => f64::widest(ScatterBlocks::<1> { window, from, out }),
        2 => f64::widest(ScatterBlocks::<2> { window, from, out }),
        _ => f64::widest(ScatterBlocks::<3> { window, from, out }),
    }
}

/// Adds `factor` times the quadratic form of the tangents of a group, see [`AddTo`].
pub(crate) fn add_quadratic<X: Laned>(
    form: Form,
    dimension: usize,
    rows: &[[X; LANES]],
    factor: f64,
    into: &mut Quadratic,
) {
    let mut plain = [[0.0; LANES]; Form::General.rows(3)];
    plain.iter_mut().zip(rows).for_each(|(to, from)| *to = from.map(X::value));
    let rows = &plain[..rows.len()];
    match dimension {
        1 => f64::widest(AddTo::<1> { form, rows, factor, into }),
        2 => f64::widest(AddTo::<2> { form, rows, factor, into }),
        _ => f64::widest(AddTo::<3> { form, rows, factor, into }),
    }
}
