//! Local maximum-entropy functions (LME), N_I = exp(−β̂|D|² + λ·D)/Z with D = x − x_I (eqs. 22–28).
//!
//! Arroyo & Ortiz, Int. J. Numer. Meth. Engng 65 (2006). Lengths are in units of the spacing, so β̂ = γ̂/h².

mod circle;
mod locality;
mod separable;
mod starts;

pub use circle::LmeCircle;
pub use locality::SMALLEST_TOLERANCE;
pub use separable::Lme;

use super::{Cells, Listed};
use crate::problems::{Number, Problems};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Local maximum entropy functions, N = exp(−γ̂ |D|²/h² + λ·D)/Z.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[schemars(rename = "Lme")]
#[serde(default, deny_unknown_fields)]
pub struct LmeParameters {
    /// The locality γ̂ of the functions (no unit), 0.1 to 1000. Near 0.8 the functions are smooth and wide, near 4 almost hats. On the
    /// circle, γ̂ must be less than −ln tolerance / (1 + (D − 1)/4) so that the circle reaches enough nodes: 11.05 in two dimensions at
    /// 1e-6. Default 3, as in the paper; 1.4 has about half the error for 1.4 times the work (study `tradeoff`).
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub gamma: f64,
    /// The tolerance that cuts off the functions (no unit), 1e-16 to 1e-2: a particle is connected to nodes nearer than
    /// h √(−ln tolerance / γ̂). Default 1e-6.
    #[schemars(range(min = 1e-16, max = 1e-2))]
    pub tolerance: f64,
    /// The region of the nodes that a particle is connected to.
    pub support: LmeSupport,
}

/// The region of the nodes that a particle is connected to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[schemars(rename = "Support")]
#[serde(rename_all = "snake_case")]
pub enum LmeSupport {
    /// A box. The functions are then products of one-dimensional functions.
    #[default]
    Separable,
    /// The circle (ball) of the paper.
    Circle,
}

impl Default for LmeParameters {
    fn default() -> Self {
        Self { gamma: 3.0, tolerance: 1e-6, support: LmeSupport::Separable }
    }
}

impl Listed for Lme {
    type Parameters = LmeParameters;
    type Other = LmeCircle;

    fn build<A: From<Self> + From<Self::Other>>(
        given: &LmeParameters,
        cells: Cells,
        problems: &mut Problems,
        path: &str,
    ) -> Option<A> {
        let LmeParameters { gamma, tolerance, support } = *given;
        let tolerance_ok = problems.between(&format!("{path}.tolerance"), tolerance, 1e-16, 1e-2);
        let ok = problems.between(&format!("{path}.gamma"), gamma, 0.1, 1000.0) && tolerance_ok;
        if support == LmeSupport::Separable {
            return ok.then(|| Self::new(gamma, tolerance).into());
        }
        let limit = LmeCircle::largest_gamma(tolerance, cells.dimension);
        let reached = ok && gamma >= limit;
        let allowed = format_args!(
            "must be less than {limit:.4} with the circle, at this tolerance and dimension; \"separable\" has no such limit"
        );
        problems.require(!reached, &format!("{path}.gamma"), Number(gamma), allowed);
        (ok && !reached).then(|| LmeCircle::new(gamma, tolerance).into())
    }

    /// Members on the box and on the circle. The widest functions, with γ̂ = 0.8, are on the box alone.
    fn examples<A: From<Self> + From<Self::Other>>() -> Vec<(&'static str, A)> {
        vec![
            ("lme 0.8", Self::new(0.8, 1e-6).into()),
            ("lme 1.8", Self::new(1.8, 1e-6).into()),
            ("lme 3", Self::new(3.0, 1e-6).into()),
            ("lme circle 1.8", LmeCircle::new(1.8, 1e-6).into()),
            ("lme circle 3", LmeCircle::new(3.0, 1e-6).into()),
        ]
    }
}
