//! Implicit finite-strain material point method with a matrix-free, Voigt-free tangent.

pub mod approximation;
pub mod grid;
pub mod material;
pub mod scalar;
pub mod scene;
pub mod shape;
pub mod solver;
pub mod tensor;
