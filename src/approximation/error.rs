//! Errors of shape functions: positions outside the grid, and parameters out of range.

use crate::problems::Number;

/// An error in the evaluation of shape functions or in the parameters of a family.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ApproximationError {
    /// The particle left the box of the grid, or its position is not a number.
    #[error("position {position:?} is outside the box from {lower:?} to {upper:?}")]
    Outside {
        /// The position of the particle.
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
    /// A parameter of a family is out of range.
    #[error("{parameter} is {}; it must be {allowed}", Number(*value))]
    Parameter {
        /// The name of the parameter.
        parameter: &'static str,
        /// The value of the parameter.
        value: f64,
        /// The allowed range.
        allowed: &'static str,
    },
    /// A family lists more nodes along an axis than its [`Separable::width`](super::Separable::width).
    #[error("{listed} nodes are listed along an axis by functions that say they reach {allowed} at most")]
    TooManyNodes {
        /// Number of nodes listed.
        listed: usize,
        /// The width of the family.
        allowed: usize,
    },
    /// The circle of max-ent holds too few nodes: some particles lie outside the convex hull of their nodes.
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
        /// The limit: γ̂ must be smaller.
        limit: f64,
    },
    /// Newton's method did not find the Lagrange multipliers of max-ent.
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

/// Validation of a family's parameters before any particle exists.
///
/// ```
/// use bfree::approximation::{Gimp, Lme, Validate};
///
/// assert_eq!(Lme::new(3.0, 1e-6).validate(3), Ok(()));
/// // A particle wider than its cell.
/// let refused = Gimp { half_width: 0.6 }.validate(2).unwrap_err();
/// assert!(refused.to_string().contains("0.6"), "{refused}");
/// ```
pub trait Validate {
    /// Checks the parameters of the family in `dimension` = 1, 2 or 3 dimensions.
    ///
    /// # Errors
    /// A parameter is out of range. The error names the parameter and its range.
    fn validate(&self, _dimension: usize) -> Result<(), ApproximationError> {
        Ok(())
    }
}
