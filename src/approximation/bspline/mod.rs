//! B-splines centred on the nodes, with and without a knot beside a wall.

mod not_a_knot;
mod uniform;

pub use not_a_knot::NotAKnotBspline;
pub use uniform::Bspline;

use crate::problems::Problems;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// B-splines centred on the nodes.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[schemars(rename = "Bspline")]
#[serde(default, deny_unknown_fields)]
pub struct BsplineParameters {
    /// The polynomial degree, 2 or 3. Default 3.
    #[schemars(range(min = 2, max = 3))]
    pub degree: u32,
}

impl Default for BsplineParameters {
    fn default() -> Self {
        Self { degree: 3 }
    }
}

impl BsplineParameters {
    /// The splines that are mirrored at walls. If the degree is wrong, the result is `None` and `problems` says so.
    pub(super) fn spline(&self, problems: &mut Problems, path: &str) -> Option<Bspline> {
        problems.whole(&format!("{path}.degree"), self.degree, 2, 3);
        match self.degree {
            2 => Some(Bspline::Quadratic),
            3 => Some(Bspline::Cubic),
            _ => None,
        }
    }
}
