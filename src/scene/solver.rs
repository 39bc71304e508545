//! Settings of Newton's method and of the linear solver.

use crate::problems::Problems;
use crate::solver::{Forcing, Krylov as Method, NewtonSettings, Preconditioning};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The solver of the equations of a step.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Solver {
    /// Newton's method, the outer iteration.
    pub newton: Newton,
    /// The linear solver, the inner iteration.
    pub krylov: Krylov,
}

/// Newton's method with a line search.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Newton {
    /// The residual norm at which a step has converged, relative to the norm of its first iterate, 1e-15 to 0.1. A residual at the level of
    /// round-off has converged, too. Default 1e-9.
    #[schemars(range(min = 1e-15, max = 0.1))]
    pub tolerance: f64,
    /// Number of iterations after which a step fails, 1 to 1000. Default 30.
    #[schemars(range(min = 1, max = 1000))]
    pub max_iterations: u32,
}

impl Default for Newton {
    fn default() -> Self {
        let NewtonSettings { relative_tolerance, max_iterations, .. } = NewtonSettings::default();
        Self { tolerance: relative_tolerance, max_iterations: max_iterations as u32 }
    }
}

/// The linear solver.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Krylov {
    /// The Krylov method. Default "automatic".
    pub method: Method,
    /// The preconditioner. Default "automatic".
    pub preconditioner: Preconditioning,
    /// The tolerance of each linear solve. Default: `"eisenstat_walker"` in load steps, `{"fixed": 1e-8}` with inertia.
    pub forcing: Option<Forcing>,
    /// Deprecated, and read for one release: it has no effect. All numbers are in double precision.
    pub precision: Option<Precision>,
    /// Maximum number of iterations of one linear solve, 1 to 1000000. Default 2000.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub max_iterations: u32,
}

/// The values of the deprecated key `precision`. Neither has an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// Double precision.
    Double,
    /// Linear systems in single precision, in earlier releases.
    Mixed,
}

impl Default for Krylov {
    fn default() -> Self {
        let NewtonSettings { krylov, max_krylov_iterations, .. } = NewtonSettings::default();
        let (preconditioner, max_iterations) = (Preconditioning::default(), max_krylov_iterations as u32);
        Self { method: krylov, preconditioner, forcing: None, precision: None, max_iterations }
    }
}

impl Solver {
    /// `unsymmetric` is the reason why the tangent is unsymmetric, if it is.
    pub(super) fn check(&self, problems: &mut Problems, unsymmetric: Option<&str>) {
        problems.between("solver.newton.tolerance", self.newton.tolerance, 1e-15, 0.1);
        problems.whole("solver.newton.max_iterations", self.newton.max_iterations, 1, 1000);
        problems.whole("solver.krylov.max_iterations", self.krylov.max_iterations, 1, 1_000_000);
        match self.krylov.method {
            Method::Gmres { restart } => problems.whole("solver.krylov.method.gmres.restart", restart, 1, 1000),
            Method::Automatic => {}
            Method::ConjugateGradient => {
                let why = unsymmetric.unwrap_or_default();
                let allowed = format_args!("{why}: use {{\"gmres\": {{}}}}");
                problems.require(unsymmetric.is_none(), "solver.krylov.method", "\"conjugate_gradient\"", allowed);
            }
        }
        if let Some(Forcing::Fixed(tolerance)) = self.krylov.forcing {
            problems.between("solver.krylov.forcing.fixed", tolerance, 1e-15, 0.9);
        }
    }
}
