//! Numerical settings of a step.

use crate::gpu::Gpu;
use crate::mechanics::reference::GridReset;
use crate::mechanics::schemes::{Newmark, Scheme};
use crate::mechanics::smoothing::Smoothing;
use crate::mechanics::transfer::{Projection, WallUpdate};
use crate::parallel::Processes;
use crate::solver::{NewtonSettings, Preconditioning, Stop};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::num::NonZeroU64;
use std::sync::Arc;

/// The starting point of Newton's method in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InitialGuess {
    /// Δφ = 0, as in the paper's tables.
    #[default]
    Zero,
    /// Δφ = Δt v.
    Velocity,
    /// The Δφ of the last step; Δφ = 0 after a grid reset.
    LastStep,
}

/// Numerical settings of a step.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The time integration scheme. Without inertia, `lumping`, `wall_update`, `smoothing` and all velocities are ignored.
    pub scheme: Arc<dyn Scheme>,
    /// ε of M̃ = (1−ε) M + ε lumped(M), in [0, 1].
    pub lumping: f64,
    /// The transfer of velocity and acceleration from the particles to the nodes.
    pub projection: Projection,
    /// Whether nodes with little support from a body follow well-supported nodes ([`aggregation`](crate::aggregation)). Without inertia
    /// nothing else holds such nodes.
    pub aggregation: bool,
    /// When the grid is reset.
    pub grid_reset: GridReset,
    /// The starting point of Newton's method.
    pub initial_guess: InitialGuess,
    /// The change that resting walls make to particle velocities.
    pub wall_update: WallUpdate,
    /// Smoothing of particle velocities and accelerations, beside the increments of eqs. 50 and 51; none in the paper.
    pub smoothing: Option<Smoothing>,
    /// Settings of Newton's method and of the Krylov method.
    pub newton: NewtonSettings,
    /// The preconditioner of the linear systems, built anew in each step.
    pub preconditioner: Preconditioning,
    /// The largest allowed local error of a step: c Δt² Δa over the grid spacing, with the scheme's constant c. A step with a larger error is
    /// repeated with half its length, as often as the clock allows. The step grows back only when its error is small. `None` for steps of
    /// given length, and without inertia.
    pub error_tolerance: Option<f64>,
    /// The tangent is compared with dual numbers at the end of every so many steps.
    pub check_tangent: Option<NonZeroU64>,
    /// The device on which Newton's method and the transfers run; `None` for the processor.
    pub gpu: Option<Arc<Gpu>>,
    /// The processes that share the passes over the particles.
    pub processes: Processes,
    /// A function that may stop a step early.
    pub stop: Option<Stop>,
}

impl Default for Settings {
    /// The trapezoidal rule with a lumped mass, Newton from Δφ = 0, walls as in the paper.
    fn default() -> Self {
        Self {
            scheme: Arc::new(Newmark::default()),
            lumping: 1.0,
            projection: Projection::default(),
            aggregation: false,
            grid_reset: GridReset::default(),
            initial_guess: InitialGuess::default(),
            wall_update: WallUpdate::default(),
            smoothing: None,
            newton: NewtonSettings::default(),
            preconditioner: Preconditioning::default(),
            error_tolerance: None,
            check_tangent: None,
            gpu: None,
            processes: Processes::default(),
            stop: None,
        }
    }
}
