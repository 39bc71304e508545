//! How a step is taken.

use crate::mechanics::kept::Renewal;
use crate::mechanics::schemes::{Newmark, Scheme};
use crate::mechanics::smoothing::Smoothing;
use crate::mechanics::transfer::{Projection, WallUpdate};
use crate::solver::{NewtonSettings, Preconditioning, Stop};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::num::NonZeroU64;
use std::sync::Arc;

/// Where Newton's iteration of a step starts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InitialGuess {
    /// Δφ = 0, as in the paper's tables.
    #[default]
    Zero,
    /// Δφ = Δt v.
    Velocity,
    /// The Δφ of the last step on a grid that is kept; Δφ = 0 on a new one.
    LastStep,
}

/// How a step is taken.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The time scheme. If it has no inertia, neither lumping nor walls in the update, smoothing or any velocity means anything, and none of
    /// them is looked at.
    pub scheme: Arc<dyn Scheme>,
    /// ε of M̃ = (1−ε) M + ε lumped(M), in [0, 1].
    pub lumping: f64,
    /// How nodes get velocity and acceleration from the particles.
    pub projection: Projection,
    /// Whether nodes with little of a body follow well-supported ones ([`aggregation`](crate::aggregation)). Without inertia nothing else
    /// holds such nodes.
    pub aggregation: bool,
    /// When the grid is made anew.
    pub renewal: Renewal,
    /// Where Newton starts.
    pub initial_guess: InitialGuess,
    /// What resting walls do to particle velocities.
    pub wall_update: WallUpdate,
    /// What is taken from the particles beside the increments of eqs. 50 and 51; nothing in the paper.
    pub smoothing: Option<Smoothing>,
    /// Newton and Krylov.
    pub newton: NewtonSettings,
    /// What preconditions its linear systems, made anew each step.
    pub preconditioner: Preconditioning,
    /// The most a step may err, see [`Update::local_error`](crate::mechanics::transfer::Update::local_error), in units of the grid spacing: a longer one is taken back and halved, as
    /// often as the clock allows, and it grows back only when its error is small. `None` for steps as given, and without inertia.
    pub error_tolerance: Option<f64>,
    /// Compare the tangent with dual numbers at the end of every so many steps.
    pub check_tangent: Option<NonZeroU64>,
    /// Who may want a step to end before it is done.
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
            renewal: Renewal::default(),
            initial_guess: InitialGuess::default(),
            wall_update: WallUpdate::default(),
            smoothing: None,
            newton: NewtonSettings::default(),
            preconditioner: Preconditioning::default(),
            error_tolerance: None,
            check_tangent: None,
            stop: None,
        }
    }
}
