//! The coefficients of Rayleigh damping.

use crate::problems::Problems;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Rayleigh damping a M + b K, with a in 1/time and b in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rayleigh {
    /// a ≥ 0, 1/time. This term damps slow motions, rigid motions too, by the share a/(2ω) of critical damping.
    #[serde(default)]
    #[schemars(range(min = 0))]
    pub mass: f64,
    /// b ≥ 0, time. This term damps fast deformations, by the share b ω/2 of critical damping. The stiffness is that of the material at the
    /// beginning of each step.
    #[serde(default)]
    #[schemars(range(min = 0))]
    pub stiffness: f64,
}

impl Rayleigh {
    /// Adds invalid values of a scene to `problems`.
    pub(crate) fn check(&self, problems: &mut Problems) {
        for (key, value) in [("damping.mass", self.mass), ("damping.stiffness", self.stiffness)] {
            problems.between(key, value, 0.0, f64::MAX);
        }
    }
}
