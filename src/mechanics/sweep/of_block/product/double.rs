//! The product in double precision.

use super::super::Double;
use super::{Product, ProductInertia, by_dimension};
use crate::mechanics::sweep::closed::Numbers;
use crate::mechanics::sweep::lanes::{LANES, Number};

/// The product with tangents in closed form.
pub(in crate::mechanics::sweep) fn product(
    groups: &Double,
    nodal: &[f64],
    buffer: &mut [f64],
    frozen: &Numbers<f64, LANES>,
) {
    match frozen.form.inertia {
        false => by_dimension!(f64, groups, Product::<f64, LANES> { groups, nodal, buffer, frozen }),
        true => by_dimension!(f64, groups, ProductInertia::<f64, LANES> { groups, nodal, buffer, frozen }),
    }
}
