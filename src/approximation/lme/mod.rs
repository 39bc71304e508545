//! Local maximum-entropy functions (LME), N_I = exp(−β̂|D|² + λ·D)/Z with D = x − x_I (eqs. 22–28).
//!
//! Arroyo & Ortiz, Int. J. Numer. Meth. Engng 65 (2006). Lengths are in units of the spacing here, β̂ = γ̂/h².

mod circle;
mod separable;
mod starts;

pub use circle::LmeCircle;
pub use separable::Lme;

use super::ApproximationError;

/// The smallest TOL₀ a family accepts: next to 1 such a weight is far below rounding, and the arithmetic has room.
pub const SMALLEST_TOLERANCE: f64 = 1e-100;

/// R_a/h = sqrt(−ln TOL₀ / γ̂)
fn radius(gamma: f64, tolerance: f64) -> f64 {
    (-tolerance.ln() / gamma).sqrt()
}

/// γ̂ and TOL₀ in range.
fn validate(gamma: f64, tolerance: f64) -> Result<(), ApproximationError> {
    if !(gamma > 0.0 && gamma.is_finite()) {
        return Err(ApproximationError::Gamma { gamma });
    }
    if !(SMALLEST_TOLERANCE..1.0).contains(&tolerance) {
        return Err(ApproximationError::Tolerance { tolerance });
    }
    Ok(())
}
