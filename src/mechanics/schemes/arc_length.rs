//! Load steps along the equilibrium path, by arc length.

use super::{Alphas, Scheme, Statics};
use std::fmt::{Display, Formatter};

/// Every step ends in static equilibrium, one arc length further on the path. Loads may rise to a limit point, fall, and rise again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArcLength;

impl Display for ArcLength {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str("load steps by the length of the path")
    }
}

impl Scheme for ArcLength {
    fn end(&self, dt: f64) -> Alphas {
        Statics.end(dt)
    }

    fn error_constant(&self) -> f64 {
        0.0
    }

    fn has_inertia(&self) -> bool {
        false
    }

    fn follows_path(&self) -> bool {
        true
    }
}
