//! What can go wrong with a shape function, and what is allowed instead.

use crate::problems::Number;

/// A particle no shape function can serve, or parameters of a family that mean nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ApproximationError {
    /// The particle left the box of the grid, or its position is not a number.
    #[error("position {position:?} is outside the box from {lower:?} to {upper:?}")]
    Outside {
        /// The position asked for.
        position: Vec<f64>,
        /// Lower corner of the box.
        lower: Vec<f64>,
        /// Upper corner of the box.
        upper: Vec<f64>,
    },
    /// An axis without cells, or without a length.
    #[error("an axis has {cells} cells of {spacing:e}; it needs at least one, of finite and positive length")]
    Grid {
        /// The spacing h.
        spacing: f64,
        /// Cells along the axis.
        cells: u32,
    },
    /// A parameter of a family that means nothing.
    #[error("{parameter} is {}; it must be {allowed}", Number(*value))]
    Parameter {
        /// What it is.
        parameter: &'static str,
        /// Its value.
        value: f64,
        /// Its range.
        allowed: &'static str,
    },
    /// A family lists more nodes along an axis than its [`Separable::width`](super::Separable::width).
    #[error("{listed} nodes are listed along an axis by functions that say they reach {allowed} at most")]
    TooManyNodes {
        /// Nodes listed.
        listed: usize,
        /// The width.
        allowed: usize,
    },
    /// The circle of max-ent holds too few nodes to have every particle in their convex hull.
    #[error(
        "max-ent on a circle with γ = {gamma} and tolerance {tolerance:e} leaves particles outside the hull of their \
         nodes in {dimension} dimensions; γ must be < {limit}, or take the separable family, which has no limit"
    )]
    SupportTooSmall {
        /// γ̂
        gamma: f64,
        /// TOL₀
        tolerance: f64,
        /// D
        dimension: usize,
        /// γ̂ must stay below this.
        limit: f64,
    },
    /// Neither Newton nor the derivative-free search found the multipliers of max-ent.
    #[error("max-ent with γ = {gamma} found no multipliers at {position:?}: Σ N (x - x_I) = {residual:e} h is left")]
    NoMultipliers {
        /// γ̂
        gamma: f64,
        /// The position of the particle.
        position: Vec<f64>,
        /// The largest component of Σ N (x − x_I)/h reached.
        residual: f64,
    },
}
