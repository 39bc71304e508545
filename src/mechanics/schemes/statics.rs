//! Load steps without inertia, in time or along the equilibrium path.

use super::{Alphas, Scheme};

/// Every step ends in static equilibrium under the loads at its end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statics {
    /// Whether a step ends one arc length further on the path. Loads may then rise to a limit point, fall, and rise again.
    pub by_arc_length: bool,
}

impl Scheme for Statics {
    fn name(&self) -> String {
        let (path, each) = ("load steps by the length of the path", "load steps, each to its equilibrium");
        if self.by_arc_length { path.into() } else { each.into() }
    }

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

    fn follows_path(&self) -> bool {
        self.by_arc_length
    }
}
