//! The shape functions of a scene.

use super::check::{Number, Problems};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The family of shape functions that joins particles and nodes.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
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

/// Of the shape functions measured, those that nothing beats in error and work at once (study `tradeoff`).
impl Default for Approximation {
    fn default() -> Self {
        Self::Bspline(Bspline::default())
    }
}

/// B-splines.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bspline {
    /// The polynomial degree, 2 or 3. Default 3.
    #[serde(default = "Bspline::default_degree")]
    #[schemars(range(min = 2, max = 3))]
    pub degree: u32,
}

impl Default for Bspline {
    fn default() -> Self {
        Self { degree: Self::default_degree() }
    }
}

impl Bspline {
    fn default_degree() -> u32 {
        3
    }
}

/// Local maximum entropy functions, N = exp(−γ̂ |D|²/h² + λ·D)/Z.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lme {
    /// γ̂, how local the functions are (no unit), 0.1 to 1000; near 0.8 they are smooth and wide, near 4 almost hats. With the
    /// circle it must be less than −ln tolerance / (1 + (D − 1)/4), 11.05 in two dimensions at 1e-6, for the circle to reach
    /// enough nodes. Default 3, the paper's; 1.4 has about half the error for 1.4 times the work (study `tradeoff`).
    #[serde(default = "Lme::default_gamma")]
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub gamma: f64,
    /// Where the functions are cut (no unit), 1e-16 to 1e-2: nodes nearer than h √(−ln tolerance / γ̂) support a particle.
    /// Default 1e-6.
    #[serde(default = "Lme::default_tolerance")]
    #[schemars(range(min = 1e-16, max = 1e-2))]
    pub tolerance: f64,
    /// The region of the supporting nodes.
    #[serde(default)]
    pub support: Support,
}

/// The region of the nodes that support a particle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
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

    /// The γ̂ that must not be reached with the circle in `dimension` dimensions.
    ///
    /// The worst point is next to the middle of a cell face, √(1 + (D−1)/4) h away from the nodes opposite to it; they must
    /// be nearer than R_a = h √(−ln TOL₀/γ̂), or the point leaves the hull of its nodes.
    ///
    /// ```
    /// use bfree::approximation::LmeCircle;
    /// use bfree::scene::approximation::Lme;
    ///
    /// // What a scene may ask for is what the shape functions can do.
    /// let lme = Lme::default();
    /// for dimension in 1..=3 {
    ///     assert_eq!(lme.circle_limit(dimension), LmeCircle::largest_gamma(lme.tolerance, dimension));
    /// }
    /// ```
    pub fn circle_limit(&self, dimension: usize) -> f64 {
        -self.tolerance.ln() / (1.0 + 0.25 * (dimension as f64 - 1.0))
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
                problems.between("approximation.lme.gamma", lme.gamma, 0.1, 1000.0);
                let limit = lme.circle_limit(dimension);
                if lme.support == Support::Circle && tolerance_ok && (limit..=1000.0).contains(&lme.gamma) {
                    let allowed = format!(
                        "must be less than {limit:.4} with the circle, at this tolerance and dimension; \"separable\" has no such limit"
                    );
                    problems.refuse("approximation.lme.gamma", Number(lme.gamma), allowed);
                }
            }
        }
    }
}
