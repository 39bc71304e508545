//! Local maximum-entropy functions (LME), N_I = exp(−β̂|D|² + λ·D)/Z with D = x − x_I (eqs. 22–28).
//!
//! Arroyo & Ortiz, Int. J. Numer. Meth. Engng 65 (2006). Lengths are in units of the spacing, so β̂ = γ̂/h².

mod circle;
mod separable;
mod starts;

pub use circle::LmeCircle;
pub use separable::Lme;

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

impl LmeParameters {
    /// Whether the parameters are allowed in `dimension` = 1, 2 or 3 dimensions; `problems` lists those that are not.
    pub(super) fn check(&self, dimension: usize, problems: &mut Problems, path: &str) -> bool {
        let Self { gamma, tolerance, support } = *self;
        let path_of_gamma = format!("{path}.gamma");
        let tolerance_ok = problems.between(&format!("{path}.tolerance"), tolerance, 1e-16, 1e-2);
        let ok = problems.between(&path_of_gamma, gamma, 0.1, 1000.0) && tolerance_ok;
        let limit = LmeCircle::largest_gamma(tolerance, dimension);
        if !ok || support == LmeSupport::Separable || gamma < limit {
            return ok;
        }
        let allowed = format_args!(
            "must be less than {limit:.4} with the circle, at this tolerance and dimension; \"separable\" has no such limit"
        );
        problems.refuse(&path_of_gamma, Number(gamma), allowed);
        false
    }
}
