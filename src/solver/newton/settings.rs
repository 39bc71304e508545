//! Settings of Newton's method.

use crate::solver::{Forcing, InvalidSetting};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt::{Display, Formatter};

/// Restart of GMRES where the scene does not choose one.
pub(super) const DEFAULT_RESTART: u32 = 50;

/// The Krylov method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[schemars(rename = "Method")]
pub enum Krylov {
    /// Conjugate gradients where the tangent is symmetric, GMRES(50) where it is not. Pressures and some laws make it unsymmetric.
    #[default]
    Automatic,
    /// Restarted GMRES, for any tangent.
    Gmres {
        /// Basis vectors stored before a restart, 1 to 1000. Default 50.
        #[serde(default = "Krylov::default_restart")]
        #[schemars(range(min = 1, max = 1000))]
        restart: u32,
    },
    /// Conjugate gradients, for symmetric tangents: not with pressures. If a tangent is not positive definite, the step found until then is
    /// taken if there is a potential and the step lowers it. Otherwise GMRES(50) solves that system instead.
    ConjugateGradient,
}

impl Krylov {
    fn default_restart() -> u32 {
        DEFAULT_RESTART
    }

    /// The method used for tangents that are `symmetric` or not.
    ///
    /// ```
    /// use bfree::solver::Krylov;
    ///
    /// let chosen = [true, false].map(|symmetric| Krylov::Automatic.chosen(symmetric).to_string());
    /// assert_eq!(chosen, ["conjugate gradients", "GMRES(50)"]);
    /// // A method that is asked for is used.
    /// assert_eq!(Krylov::Gmres { restart: 50 }.chosen(true), Krylov::Gmres { restart: 50 });
    /// ```
    pub fn chosen(self, symmetric: bool) -> Self {
        match self {
            Self::Automatic if symmetric => Self::ConjugateGradient,
            Self::Automatic => Self::Gmres { restart: DEFAULT_RESTART },
            asked => asked,
        }
    }
}

impl Display for Krylov {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Automatic => f.write_str("automatic"),
            Self::Gmres { restart } => write!(f, "GMRES({restart})"),
            Self::ConjugateGradient => f.write_str("conjugate gradients"),
        }
    }
}

/// Settings of [`newton()`](crate::solver::newton()).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonSettings {
    /// Wanted ‖R‖ over ‖R‖ at the initial guess, in [0, 1).
    pub relative_tolerance: f64,
    /// Newton iterations allowed.
    pub max_iterations: usize,
    /// The forcing term: the accuracy to which each linear system is solved.
    pub forcing: Forcing,
    /// The Krylov method.
    pub krylov: Krylov,
    /// Krylov iterations allowed for each linear system, at least 1.
    pub max_krylov_iterations: usize,
}

/// The settings of a scene without the keys for Newton's method.
impl Default for NewtonSettings {
    fn default() -> Self {
        Self {
            relative_tolerance: 1e-9,
            max_iterations: 30,
            forcing: Forcing::default(),
            krylov: Krylov::default(),
            max_krylov_iterations: 2000,
        }
    }
}

impl NewtonSettings {
    /// The least ‖R‖ wanted, in units of eps times the magnitude of the contributions to R. A sum of a few dozen contributions is exact to
    /// about this many eps.
    pub(crate) const FLOOR: f64 = 4.0;

    pub(super) fn check(&self) -> Result<(), InvalidSetting> {
        InvalidSetting::check_tolerance("relative_tolerance", self.relative_tolerance)?;
        self.forcing.check()?;
        let krylov = self.max_krylov_iterations;
        InvalidSetting::check(krylov >= 1, "max_krylov_iterations", krylov as f64, "at least 1")
    }
}
