//! The product in single precision.

use super::super::Single;
use super::{Product, ProductInertia, by_dimension};
use crate::mechanics::sweep::closed::Numbers;
use crate::mechanics::sweep::lanes::{Number, SINGLE_LANES};

/// As [`super::double::product`], in single precision.
pub(in crate::mechanics::sweep) fn product_single(
    groups: &Single,
    nodal: &[f32],
    buffer: &mut [f32],
    frozen: &Numbers<f32, SINGLE_LANES>,
) {
    match frozen.form.inertia {
        false => by_dimension!(f32, groups, Product::<f32, SINGLE_LANES> { groups, nodal, buffer, frozen }),
        true => by_dimension!(f32, groups, ProductInertia::<f32, SINGLE_LANES> { groups, nodal, buffer, frozen }),
    }
}
