//! Load steps without inertia.

use super::{Alphas, Scheme};
use std::fmt::{Display, Formatter};

/// Every step ends in static equilibrium under the loads at its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Statics;

impl Display for Statics {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str("load steps, each to its equilibrium")
    }
}

impl Scheme for Statics {
    /// There is no velocity and no acceleration.
    fn end(&self, dt: f64) -> Alphas {
        Alphas { dt, a1: 0.0, a2: 0.0, a3: 0.0, a4: 0.0, a6: 0.0, discrete_gradient: false }
    }

    fn error_constant(&self) -> f64 {
        0.0
    }

    fn has_inertia(&self) -> bool {
        false
    }
}
