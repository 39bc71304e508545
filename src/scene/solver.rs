//! Settings of Newton's method and of the linear solver.

use crate::problems::Problems;
use crate::solver::Precision;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the equations of a step are solved.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Solver {
    /// The outer iteration.
    #[serde(default)]
    pub newton: Newton,
    /// The inner, linear iteration.
    #[serde(default)]
    pub krylov: Krylov,
}

/// Newton's method with a line search.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Newton {
    /// The residual norm at which a step has converged, relative to that of its first iterate, 1e-15 to 0.1; round-off, measured by
    /// the sum of the magnitudes of its contributions, is never asked to fall. Default 1e-9.
    #[serde(default = "Newton::default_tolerance")]
    #[schemars(range(min = 1e-15, max = 0.1))]
    pub tolerance: f64,
    /// Iterations after which a step has failed, 1 to 1000. Default 30.
    #[serde(default = "Newton::default_max_iterations")]
    #[schemars(range(min = 1, max = 1000))]
    pub max_iterations: u32,
}

impl Newton {
    fn default_tolerance() -> f64 {
        1e-9
    }

    fn default_max_iterations() -> u32 {
        30
    }
}

impl Default for Newton {
    fn default() -> Self {
        Self { tolerance: Self::default_tolerance(), max_iterations: Self::default_max_iterations() }
    }
}

/// The linear solver.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Krylov {
    /// The method.
    #[serde(default)]
    pub method: Method,
    /// How far each linear problem is solved.
    #[serde(default)]
    pub forcing: Forcing,
    /// The numbers of Krylov vectors, tangent products and preconditioner. Default "double".
    #[serde(default)]
    pub precision: Precision,
    /// Iterations of one linear solve, at most, 1 to 1000000. Default 2000.
    #[serde(default = "Krylov::default_max_iterations")]
    #[schemars(range(min = 1, max = 1_000_000))]
    pub max_iterations: u32,
}

impl Krylov {
    fn default_max_iterations() -> u32 {
        2000
    }
}

impl Default for Krylov {
    fn default() -> Self {
        let max_iterations = Self::default_max_iterations();
        let (method, forcing, precision) = Default::default();
        Self { method, forcing, precision, max_iterations }
    }
}

/// The Krylov method.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Restarted GMRES, for any tangent.
    Gmres(Gmres),
    /// Conjugate gradients, for symmetric tangents: not with pressures.
    ConjugateGradient,
}

/// Restarted GMRES.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gmres {
    /// Basis vectors kept before a restart, 1 to 1000. Default 30.
    #[serde(default = "Gmres::default_restart")]
    #[schemars(range(min = 1, max = 1000))]
    pub restart: u32,
}

impl Gmres {
    fn default_restart() -> u32 {
        30
    }
}

impl Default for Method {
    fn default() -> Self {
        Self::Gmres(Gmres { restart: Gmres::default_restart() })
    }
}

/// How far each linear problem is solved.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Forcing {
    /// To this relative residual, 1e-15 to 0.9.
    Fixed(#[schemars(range(min = 1e-15, max = 0.9))] f64),
    /// As far as Newton's progress deserves (Eisenstat and Walker).
    EisenstatWalker,
}

impl Default for Forcing {
    fn default() -> Self {
        Self::Fixed(1e-8)
    }
}

impl Solver {
    pub(super) fn check(&self, problems: &mut Problems, with_pressures: bool) {
        problems.between("solver.newton.tolerance", self.newton.tolerance, 1e-15, 0.1);
        problems.whole("solver.newton.max_iterations", self.newton.max_iterations, 1, 1000);
        problems.whole("solver.krylov.max_iterations", self.krylov.max_iterations, 1, 1_000_000);
        match &self.krylov.method {
            Method::Gmres(gmres) => problems.whole("solver.krylov.method.gmres.restart", gmres.restart, 1, 1000),
            Method::ConjugateGradient => {
                let allowed = "pressures make the tangent unsymmetric: use {\"gmres\": {}}";
                problems.require(!with_pressures, "solver.krylov.method", "\"conjugate_gradient\"", allowed);
            }
        }
        if let Forcing::Fixed(tolerance) = self.krylov.forcing {
            problems.between("solver.krylov.forcing.fixed", tolerance, 1e-15, 0.9);
        }
    }
}
