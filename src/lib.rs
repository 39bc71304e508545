//! Implicit finite-strain material point method with a matrix-free, Voigt-free tangent.

pub mod approximation;
pub mod causes;
pub mod clock;
pub mod field;
pub mod grid;
pub mod material;
pub mod mechanics;
pub mod nodes;
pub mod output;
pub mod particles;
pub mod phases;
pub mod plan;
pub mod scalar;
pub mod scene;
pub mod shape;
pub mod simulation;
pub mod solver;
pub mod tensor;
