//! The locality γ̂ and the support tolerance TOL₀: the radius that follows from them, and their ranges.

use crate::approximation::ApproximationError;

/// The smallest TOL₀ that a family accepts. Such a weight is far below round-off next to 1, and still far from underflow.
pub const SMALLEST_TOLERANCE: f64 = 1e-100;

/// R_a/h = sqrt(−ln TOL₀ / γ̂)
pub(super) fn radius(gamma: f64, tolerance: f64) -> f64 {
    (-tolerance.ln() / gamma).sqrt()
}

/// Checks that γ̂ and TOL₀ are in range.
pub(super) fn validate(gamma: f64, tolerance: f64) -> Result<(), ApproximationError> {
    if !(gamma > 0.0 && gamma.is_finite()) {
        let parameter = "the locality γ of max-ent";
        return Err(ApproximationError::Parameter { parameter, value: gamma, allowed: "finite and > 0" });
    }
    if !(SMALLEST_TOLERANCE..1.0).contains(&tolerance) {
        let parameter = "the support tolerance of max-ent";
        return Err(ApproximationError::Parameter { parameter, value: tolerance, allowed: ">= 1e-100 and < 1" });
    }
    Ok(())
}
