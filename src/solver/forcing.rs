//! The accuracy to which each linear system of Newton's method is solved.

use super::InvalidSetting;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The factor γ of Eisenstat and Walker's choice 2.
const GAMMA: f64 = 0.9;

/// A forcing term is never looser than this.
pub(super) const LOOSEST: f64 = 0.9;

/// The first forcing term of Eisenstat and Walker's choice, and its upper bound. Looser terms take more iterations of Newton's method, and a
/// slender beam then does not converge in 30.
const FIRST: f64 = 0.01;

/// The last forcing term, relative to the reduction of the residual that remains.
const LAST: f64 = 0.01;

/// The forcing term η: each linear system is solved to ‖R + K d‖ ≤ η ‖R‖.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Forcing {
    /// This η at every iteration, from 1e-15 to 0.9. Small values keep Newton's convergence quadratic.
    Fixed(#[schemars(range(min = 1e-15, max = 0.9))] f64),
    /// An η that follows the progress of Newton's method (Eisenstat and Walker, SIAM J. Sci. Comput. 17, 1996, choice 2 with γ = 0.9,
    /// α = 2): 0.01 at first, then 0.9 times the square of the last factor by which the residual fell, and at most 0.01. So convergence stays
    /// quadratic. The last η is at most a hundred times tighter than the end of the iteration needs.
    EisenstatWalker,
}

impl Default for Forcing {
    fn default() -> Self {
        Self::Fixed(1e-8)
    }
}

impl Forcing {
    pub(super) fn check(self) -> Result<(), InvalidSetting> {
        match self {
            Self::Fixed(η) => {
                InvalidSetting::check(η > 0.0 && η <= LOOSEST, "forcing", η, "more than 0 and at most 0.9")
            }
            Self::EisenstatWalker => Ok(()),
        }
    }

    /// The next forcing term. `last` is the last ‖R_k‖ / ‖R_k₋₁‖. `wanted` is the residual norm that ends
    /// Newton's iteration, divided by the present one.
    pub(super) fn next(self, last: Option<f64>, wanted: f64) -> f64 {
        match self {
            Self::Fixed(η) => η,
            Self::EisenstatWalker => {
                // η = γ (‖R_k‖ / ‖R_k₋₁‖)²
                let choice = last.map_or(FIRST, |ratio| {
                    let η = GAMMA * ratio * ratio;
                    mutant!("solver: forcing by the ratio of residuals, not its square": η = GAMMA * ratio);
                    η.min(FIRST)
                });
                // The last solve is not much tighter than needed (Kelley 1995, eq. 6.20). Kelley takes half of the remaining reduction, which
                // hides the order of convergence.
                choice.max(LAST * wanted)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choice_two_tightens_with_the_square_of_the_last_fall() {
        let next = |ratio, wanted| Forcing::EisenstatWalker.next(Some(ratio), wanted);
        assert_eq!(Forcing::EisenstatWalker.next(None, 0.0), 0.01);
        assert_eq!(next(1e-2, 0.0), 0.9 * 1e-2 * 1e-2);
        // After a poor step it is no looser than at first.
        assert_eq!((next(0.5, 0.0), next(7.0, 0.0)), (0.01, 0.01));
        // Near the end the term is no tighter than needed.
        assert_eq!(next(1e-4, 0.02), 0.02 * 0.01);
        assert_eq!(Forcing::Fixed(1e-8).next(Some(0.5), 0.5), 1e-8);
    }

    #[test]
    fn range_of_the_fixed_term() {
        for bad in [0.0, -1.0, 0.901, 2.0, f64::NAN] {
            assert!(Forcing::Fixed(bad).check().is_err(), "{bad}");
        }
        assert!(Forcing::Fixed(1e-8).check().is_ok());
    }
}
