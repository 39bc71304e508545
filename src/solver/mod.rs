//! Krylov and Newton methods on plain vectors: operators and vectors, no mechanics.
//!
//! A nodal field of `D` components per node is one flat `&[f64]`, node after node.
