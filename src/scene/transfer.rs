//! Transfer from nodes to particles.

use super::default_number;
use crate::problems::Problems;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The transfer of velocity and acceleration from the nodes to the particles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Transfer {
    /// Particles receive increments only, as in the paper. Nothing is damped, and velocities of the particles that the nodes do not
    /// represent persist.
    #[default]
    Flip,
    /// PIC, or FMPM of an order above 1: particles take the velocity of their nodes in every step. Shorter steps smooth more.
    Pic {
        /// Number of terms of the series for the consistent projection, 1 to 20. One term is PIC, and more terms smooth less. Default 1.
        #[serde(default = "default_number::<1>")]
        #[schemars(range(min = 1, max = 20))]
        order: u32,
    },
    /// FLIP drawn towards PIC or FMPM: particles follow their nodes at a given rate. The smoothing in a given time does not depend on the
    /// time step.
    Blend {
        /// Number of terms of the series for the consistent projection, 1 to 20. One term draws towards PIC. Default 1.
        #[serde(default = "default_number::<1>")]
        #[schemars(range(min = 1, max = 20))]
        order: u32,
        /// The rate (1/time), > 0. With order 1, a front free of ringing needs about 1.2 (c/h) (h/L)^(1/4). Here c is the speed of sound, h
        /// the spacing and L the distance the front travels.
        #[schemars(extend("exclusiveMinimum" = 0))]
        rate: f64,
    },
    /// A blend of order 2, and additionally of order 1 where the velocity has a kink or an extremum. Shocks and jumps stay narrow and do
    /// not ring.
    Limited {
        /// The rate of the blend of order 2 (1/time), > 0. At kinks, up to five times as much of order 1 is added. For shocks and jumps 0.8
        /// c/h is recommended, with c the speed of sound and h the spacing; see `scenes/riemann_jump.json`.
        #[schemars(extend("exclusiveMinimum" = 0))]
        rate: f64,
    },
}

impl Transfer {
    pub(super) fn check(&self, problems: &mut Problems) {
        match self {
            Self::Flip => {}
            Self::Pic { order } => problems.whole("transfer.pic.order", *order, 1, 20),
            Self::Blend { order, rate } => {
                problems.whole("transfer.blend.order", *order, 1, 20);
                problems.positive("transfer.blend.rate", *rate);
            }
            Self::Limited { rate } => drop(problems.positive("transfer.limited.rate", *rate)),
        }
    }
}
