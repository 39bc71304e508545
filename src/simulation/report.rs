//! What a step did, or why it failed.

use super::Sharing;
use crate::causes;
use crate::mechanics::check::CheckError;
use crate::mechanics::residual::Inadmissible;
use crate::mechanics::rigid::Loose;
use crate::mechanics::sweep::SupportError;
use crate::phases::Stopwatch;
use crate::solver::{LinearError, NewtonError, NewtonFailure, NewtonHistory, NewtonReport};
use crate::tensor::Vector;

/// What a condition does to the bodies: the reaction at t_{n+1}, and spread over the step the impulse with which a wall takes along nodes
/// that do not move with it yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reaction<const D: usize> {
    /// Σ r_I
    pub force: Vector<f64, D>,
    /// The moment about its axis, if it rotates; else 0.
    pub torque: f64,
}

/// What a step did.
#[derive(Clone, Debug)]
pub struct StepReport<const D: usize> {
    /// Its length.
    pub dt: f64,
    /// Active nodes.
    pub active_nodes: usize,
    /// Newton's iterations and residuals.
    pub newton: NewtonReport,
    /// Iterations of the projection (42), 0 for a lumped mass.
    pub projection_iterations: usize,
    /// Of each of [`Loads::prescribed`](crate::mechanics::loads::Loads::prescribed).
    pub reactions: Vec<Reaction<D>>,
    /// Its local error in units of the grid spacing, where a tolerance asks for it; above the tolerance only if it could not be halved.
    pub error: Option<f64>,
    /// Whether the grid was new.
    pub renewed: bool,
    /// Whether a body feels a wall or a prescribed region that no body felt in the first step.
    pub feels_wall: bool,
    /// Bodies that share nodes.
    pub sharing: Vec<Sharing>,
    /// On a path of equilibria, the cosine of the angle between Δφ and that of the step before; `None` of the first step on a grid.
    pub straight: Option<f64>,
    /// Share of the volume of bodies with a plastic law that has flowed in it.
    pub yielding: f64,
    /// Seconds, and passes over the particles, by phase.
    pub seconds: Stopwatch,
    /// The attempts before it, each of which failed or was too long, and was repeated with half of its length.
    pub failed: Vec<FailedAttempt>,
}

/// An attempt at a step that failed.
#[derive(Clone, Debug)]
pub struct FailedAttempt {
    /// Its length.
    pub dt: f64,
    /// Whether all that was wrong is its error.
    pub inaccurate: bool,
    /// Why it failed, on one line.
    pub why: String,
    /// Iterations of the projection (42).
    pub projection_iterations: usize,
    /// What Newton's method did; empty if it was not reached.
    pub newton: NewtonHistory,
    /// Seconds, by phase.
    pub seconds: Stopwatch,
}

/// What an attempt has spent so far.
pub(super) struct Spent {
    pub watch: Stopwatch,
    pub projection_iterations: usize,
}

impl Spent {
    pub fn nothing() -> Self {
        Self { watch: Stopwatch::start(), projection_iterations: 0 }
    }
}

impl FailedAttempt {
    pub(super) fn new(dt: f64, mut spent: Spent, error: &StepError) -> Self {
        spent.watch.give_up();
        let newton = match error {
            StepError::Newton(source) | StepError::Unbalanced { source } | StepError::Loose { source, .. } => {
                (*source.history).clone()
            }
            StepError::Inaccurate { newton, .. } => (**newton).clone(),
            _ => NewtonHistory::default(),
        };
        let inaccurate = matches!(error, StepError::Inaccurate { .. });
        let Spent { watch: seconds, projection_iterations } = spent;
        Self { dt, inaccurate, why: causes::on_one_line(error), projection_iterations, newton, seconds }
    }
}

/// Why a step failed. The particles are untouched.
#[derive(Debug, thiserror::Error)]
pub enum StepError {
    /// Shape functions could not be evaluated.
    #[error("the shape functions cannot be evaluated")]
    Support(#[from] SupportError),
    /// Velocities so large that their projection overflows.
    #[error("the projection to the nodes failed")]
    Projection(#[from] LinearError),
    /// Newton found no equilibrium.
    #[error("no equilibrium was found")]
    Newton(#[from] NewtonError<Inadmissible>),
    /// Without inertia, Newton found no equilibrium.
    #[error(
        "no equilibrium was found; without inertia there may be none, where a load is larger than the bodies bear: prescribe the \
         motion there, follow the path (time.inertia = \"arc_length\"), or give the scene inertia"
    )]
    Unbalanced {
        /// What Newton's method says.
        source: NewtonError<Inadmissible>,
    },
    /// What was kept is not of these particles and functions.
    #[error(
        "the grid that was kept has {kept} nodes, and the particles have {nodes}: after a change by hand, put None into \
         Simulation::kept"
    )]
    OtherGrid {
        /// Nodes that have moved.
        kept: usize,
        /// Active nodes.
        nodes: usize,
    },
    /// A path of equilibria, along which loads no longer change.
    #[error(
        "the path ends at load = {load}: no load changes there; give the curves of the loads points on both sides of it"
    )]
    PathEnds {
        /// λ
        load: f64,
    },
    /// Without inertia, bodies are pushed where nothing holds them.
    #[error(
        "{loose}: without inertia there is no equilibrium; hold them with a boundary condition, or give the scene inertia"
    )]
    Loose {
        /// Which bodies, and where.
        loose: Loose,
        /// What Newton's method says.
        source: NewtonError<Inadmissible>,
    },
    /// The step is too long for the tolerance, and can be halved.
    #[error("the local error is {error:.2e} grid spacings; {tolerance:.2e} are allowed")]
    Inaccurate {
        /// The error.
        error: f64,
        /// The most allowed.
        tolerance: f64,
        /// What Newton's method did.
        newton: Box<NewtonHistory>,
    },
    /// The state at the start of the step is impossible.
    #[error(transparent)]
    Inadmissible(#[from] Inadmissible),
    /// The tangent is not the derivative of the residual.
    #[error("the check of the tangent failed")]
    Tangent(#[from] CheckError),
    /// A particle would leave the grid.
    #[error(
        "particle {particle} leaves the grid at {position:?}; enlarge the grid or hold the body with a boundary condition"
    )]
    LeftGrid {
        /// Id of the particle.
        particle: usize,
        /// Where it would be.
        position: Vec<f64>,
    },
}

impl StepError {
    /// Whether it was [stopped](crate::solver::Stop).
    pub fn is_stopped(&self) -> bool {
        matches!(self, Self::Newton(error) if matches!(error.cause, NewtonFailure::Stopped { .. }))
    }
}

/// The simulation cannot go on. The particles are as after the last good step.
#[derive(Debug, thiserror::Error)]
#[error("the step from t = {time} failed, the last time with dt = {dt:e} (attempts: {})", failed.len())]
pub struct AdvanceError {
    /// t_n
    pub time: f64,
    /// Δt of the last attempt.
    pub dt: f64,
    /// Why the last attempt failed.
    #[source]
    pub cause: Box<StepError>,
    /// All attempts, the last one included.
    pub failed: Vec<FailedAttempt>,
}
