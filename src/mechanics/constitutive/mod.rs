//! The laws at the particles: stress, linearised tangent and its storage.
//!
//! `point.rs` has one particle, in formulas. `laws.rs` calls these formulas for the particles of a group side by side. `tangents.rs` stores
//! their linearised tangents, and applies them. `discrete_gradient.rs` is the mean stress of a step, in the form of a law.
//!
//! H_r, F_r and ∇_r N are those of the reference configuration, at the last grid reset. With a reset in every step that is t_n. Internal
//! variables are always those at t_n.

mod discrete_gradient;
mod laws;
mod point;
mod tangents;

pub(super) use discrete_gradient::{GAUSS, ROUND_OFF};
pub(crate) use laws::Laws;
pub use point::Part;
pub(crate) use tangents::{AddTo, Form, Product, add_quadratic, general, product};
