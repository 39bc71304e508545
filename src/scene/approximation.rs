//! The shape functions of a scene.

use super::check::{Number, Problems};
use schemars::JsonSchema;
use serde::Deserialize;

/// The family of shape functions that joins particles and nodes.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Approximation {
    /// Products of hat functions. Simple and rough: forces jump when a particle crosses a cell face.
    Linear,
    /// Products of one-dimensional uGIMP functions; the half width of a particle follows from the bodies'
    /// `particles_per_cell`, which must all agree.
    Gimp,
    /// Products of B-splines centred on the nodes.
    Bspline(Bspline),
    /// Local maximum entropy functions.
    Lme(Lme),
}

impl Default for Approximation {
    fn default() -> Self {
        Self::Lme(Lme::default())
    }
}

/// B-splines.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bspline {
    /// The polynomial degree, 2 or 3.
    #[serde(default = "Bspline::default_degree")]
    #[schemars(range(min = 2, max = 3))]
    pub degree: u32,
}

impl Bspline {
    fn default_degree() -> u32 {
        2
    }
}

/// Local maximum entropy functions, N = exp(−γ̂ |D|²/h² + λ·D)/Z.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lme {
    /// γ̂, how local the functions are (no unit), from 0.1; near 0.8 they are smooth and wide, near 4 almost hats. Support
    /// regions must reach far enough: γ̂ < −ln tolerance for the separable support (13.8 at 1e-6), and
    /// γ̂ < −ln tolerance / (1 + (D − 1)/4) for the circle (11.05 in two dimensions).
    #[serde(default = "Lme::default_gamma")]
    #[schemars(range(min = 0.1))]
    pub gamma: f64,
    /// Where the functions are cut (no unit), 1e-16 to 1e-2: nodes nearer than h √(−ln tolerance / γ̂) support a particle.
    #[serde(default = "Lme::default_tolerance")]
    #[schemars(range(min = 1e-16, max = 1e-2))]
    pub tolerance: f64,
    /// The region of the supporting nodes.
    #[serde(default)]
    pub support: Support,
}

/// The region of the nodes that support a particle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Support {
    /// A box: the functions are then products of one-dimensional ones.
    #[default]
    Separable,
    /// The circle (ball) of the paper.
    Circle,
}

impl Default for Lme {
    fn default() -> Self {
        Self { gamma: Self::default_gamma(), tolerance: Self::default_tolerance(), support: Support::default() }
    }
}

impl Lme {
    fn default_gamma() -> f64 {
        3.0
    }

    fn default_tolerance() -> f64 {
        1e-6
    }

    /// The γ̂ from which on some points of a cell lie outside of the hull of their supporting nodes, in `dimension`
    /// dimensions.
    ///
    /// The worst point is next to the middle of a cell face, √(1 + (D−1)/4) h away from the nodes opposite to it; with the
    /// box only its distance along the axis, h, counts. Their distance must stay below R_a = h √(−ln TOL₀/γ̂).
    pub fn largest_gamma(&self, dimension: usize) -> f64 {
        let reach = match self.support {
            Support::Separable => 1.0,
            Support::Circle => 1.0 + 0.25 * (dimension.max(1) - 1) as f64,
        };
        -self.tolerance.ln() / reach
    }
}

impl Approximation {
    pub(super) fn check(&self, problems: &mut Problems, dimension: usize) {
        match self {
            Self::Linear | Self::Gimp => {}
            Self::Bspline(spline) => problems.whole("approximation.bspline.degree", spline.degree, 2, 3),
            Self::Lme(lme) => {
                let tolerance_ok = (1e-16..=1e-2).contains(&lme.tolerance);
                problems.between("approximation.lme.tolerance", lme.tolerance, 1e-16, 1e-2);
                let largest = lme.largest_gamma(dimension);
                if tolerance_ok && !(lme.gamma >= 0.1 && lme.gamma < largest) {
                    let allowed = format!(
                        "must be at least 0.1 and less than {largest:.4} for this support, tolerance and dimension"
                    );
                    problems.refuse("approximation.lme.gamma", Number(lme.gamma), allowed);
                }
            }
        }
    }
}
