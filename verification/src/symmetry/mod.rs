//! Scenes that must agree: drawn at random, transformed, run, compared.

mod compare;
mod draw;
mod scene;
mod transform;

pub use compare::{Disagreement, SymmetryError, compare};
pub use draw::draw;
pub use transform::{TRANSFORMATIONS, Transformation};
