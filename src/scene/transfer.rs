//! From nodes to particles.

use crate::problems::Problems;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How velocity and acceleration go from the nodes to the particles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Transfer {
    /// Increments only, as in the paper. Nothing is damped, and velocities that particles have and nodes do not see stay.
    #[default]
    Flip,
    /// The particles take the velocity of their nodes in every step: the shorter the steps, the more is smoothed away.
    Pic(Pic),
    /// The particles follow their nodes at a rate: what is smoothed away in a given time does not depend on the time step.
    Blend(Blend),
    /// As a blend of order 2, and where the velocity has a kink or an extremum of order 1 as well: shocks and jumps stay narrow and
    /// do not ring.
    Limited(Limited),
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
    /// The rate (1/time), > 0. A front free of ringing needs about 1.2 (c/h) (h/L)^(1/4) of order 1, with c the speed of sound, h the
    /// spacing and L the distance the front travels.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub rate: f64,
}

/// FLIP drawn towards FMPM(2), and towards PIC where the velocity has a kink or an extremum.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Limited {
    /// The rate of the second order (1/time), > 0; up to five times as much of the first order is added at kinks. For shocks and
    /// jumps 0.8 c/h is recommended, with c the speed of sound and h the spacing; see `scenes/riemann_jump.json`.
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
            Self::Limited(limited) => {
                problems.positive("transfer.limited.rate", limited.rate);
            }
        }
    }
}
