//! B-splines centred on the nodes, with and without a knot beside a wall.

mod not_a_knot;
mod uniform;

pub use not_a_knot::NotAKnotBspline;
pub use uniform::Bspline;

use super::{Cells, Listed};
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

impl Listed for Bspline {
    type Parameters = BsplineParameters;
    type Other = NotAKnotBspline;

    fn build<A: From<Self> + From<Self::Other>>(
        given: &BsplineParameters,
        cells: Cells,
        problems: &mut Problems,
        path: &str,
    ) -> Option<A> {
        problems.whole(&format!("{path}.degree"), given.degree, 2, 3);
        let spline = match given.degree {
            2 => Self::Quadratic,
            3 => Self::Cubic,
            _ => return None,
        };
        Some(if cells.integrated { NotAKnotBspline(spline).into() } else { spline.into() })
    }

    fn examples<A: From<Self> + From<Self::Other>>() -> Vec<(&'static str, A)> {
        let not_a_knot = |spline| A::from(NotAKnotBspline(spline));
        vec![
            ("quadratic", Self::Quadratic.into()),
            ("cubic", Self::Cubic.into()),
            ("not-a-knot quadratic", not_a_knot(Self::Quadratic)),
            ("not-a-knot cubic", not_a_knot(Self::Cubic)),
        ]
    }
}
