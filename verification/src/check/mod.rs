//! The checks, one file each.

mod approximation;
mod material;
// The studies use items of this module that the checks do not use.
#[cfg_attr(not(feature = "studies"), allow(dead_code))]
pub(crate) mod regime;
pub(crate) mod tangent;

pub use approximation::check_approximation;
pub use material::{check_material, check_material_from};
pub use tangent::check_tangent;
