//! From nodes to particles.

use super::check::Problems;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How velocity and acceleration go from the nodes to the particles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Transfer {
    /// Increments only, as in the paper: undamped, and blind to what particles carry and nodes do not see.
    #[default]
    Flip,
    /// The particles take the velocity of their nodes in every step: the shorter the steps, the more is smoothed away.
    Pic(Pic),
    /// The particles follow their nodes at a rate: what is smoothed away in a given time does not depend on the time step.
    Blend(Blend),
}

/// PIC, or FMPM of an order above 1.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pic {
    /// Terms of the series for the consistent projection, 1 to 20: 1 is PIC; the more, the less is smoothed away. Default 1.
    #[serde(default = "default_order")]
    #[schemars(range(min = 1, max = 20))]
    pub order: u32,
}

/// FLIP drawn towards PIC or FMPM.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Blend {
    /// Terms of the series for the consistent projection, 1 to 20: 1 draws towards PIC. Default 1.
    #[serde(default = "default_order")]
    #[schemars(range(min = 1, max = 20))]
    pub order: u32,
    /// The rate (1/time), > 0. For shocks and jumps 1.2 (c/h) (h/L)^(1/4) is recommended, with c the speed of sound, h the spacing
    /// and L the distance the front travels; see `scenes/riemann_jump.json`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub rate: f64,
}

fn default_order() -> u32 {
    1
}

impl Transfer {
    pub(super) fn check(&self, problems: &mut Problems) {
        match self {
            Self::Flip => {}
            Self::Pic(pic) => problems.whole("transfer.pic.order", pic.order, 1, 20),
            Self::Blend(blend) => {
                problems.whole("transfer.blend.order", blend.order, 1, 20);
                problems.positive("transfer.blend.rate", blend.rate);
            }
        }
    }
}
