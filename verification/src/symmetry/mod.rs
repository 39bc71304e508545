//! Scenes that must agree: drawn at random, transformed, run, compared.
//!
//! The study `symmetry` and the tests of the library share this module.

mod compare;
mod draw;
mod scene;
mod transform;

pub use compare::{Disagreement, SymmetryError, compare};
pub use draw::{Devices, draw};
pub use transform::{TRANSFORMATIONS, Transformation};
