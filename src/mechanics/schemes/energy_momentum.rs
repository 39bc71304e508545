//! The energy–momentum scheme, which the paper names as future work.

use super::{Alphas, GeneralizedAlpha, Scheme};

/// The midpoint rule, M (v_{n+1} − v_n)/Δt + Σ V₀ P̄ ∇N = f(t_{n+½}) and Δφ = ½ Δt (v_n + v_{n+1}), with the mean stress P̄ of the step
/// (`constitutive/discrete_gradient.rs`) in place of the stress at the middle.
///
/// The work of P̄ along Δφ is the change of the strain energy, so that without loads the sum of kinetic and strain energy does not change,
/// nor do momentum and angular momentum. This holds on a kept grid, up to the accuracy to which Newton's method ends; a grid reset has a
/// loss of its own.
///
/// ```
/// use bfree::mechanics::schemes::{EnergyMomentum, GeneralizedAlpha, Scheme};
///
/// // Velocities and accelerations are those of the midpoint rule; the stress in the balance of forces is another.
/// let (scheme, midpoint) = (EnergyMomentum, GeneralizedAlpha { spectral_radius: 1.0 });
/// assert_eq!((scheme.instant(), scheme.balance(0.1).a1), (midpoint.instant(), midpoint.balance(0.1).a1));
/// assert!(scheme.balance(0.1).discrete_gradient && scheme.end(0.1) == midpoint.end(0.1));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EnergyMomentum;

/// The midpoint rule.
const MIDPOINT: GeneralizedAlpha = GeneralizedAlpha { spectral_radius: 1.0 };

impl Scheme for EnergyMomentum {
    fn name(&self) -> String {
        "energy–momentum".into()
    }

    fn instant(&self) -> f64 {
        MIDPOINT.instant()
    }

    fn balance(&self, dt: f64) -> Alphas {
        Alphas { discrete_gradient: true, ..MIDPOINT.balance(dt) }
    }

    fn end(&self, dt: f64) -> Alphas {
        MIDPOINT.end(dt)
    }

    fn error_constant(&self) -> f64 {
        MIDPOINT.error_constant()
    }
}
