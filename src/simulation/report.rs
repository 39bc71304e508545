//! Reports and errors of a step.

use super::SharedNodes;
use crate::causes;
use crate::mechanics::check::CheckError;
use crate::mechanics::loads::Reaction;
use crate::mechanics::residual::Inadmissible;
use crate::mechanics::rigid::Loose;
use crate::mechanics::sweep::ShapeFunctionError;
use crate::phases::Stopwatch;
use crate::solver::{LinearError, NewtonError, NewtonFailure, NewtonHistory, NewtonReport};
use crate::tensor::Vector;

/// The report of a step.
#[derive(Clone, Debug)]
pub struct StepReport<const D: usize> {
    /// Length Δt of the step.
    pub dt: f64,
    /// Number of active nodes.
    pub active_nodes: usize,
    /// Newton's iterations and residuals.
    pub newton: NewtonReport,
    /// Iterations of the projection (42), 0 for a lumped mass.
    pub projection_iterations: usize,
    /// Reactions, one for each of [`Loads::prescribed`](crate::mechanics::loads::Loads::prescribed).
    pub reactions: Vec<Reaction<D>>,
    /// Contact with obstacles, one for each of [`Contacts::obstacles`](crate::mechanics::loads::Contacts::obstacles).
    pub obstacles: Vec<ContactForces<D>>,
    /// Contact between bodies, one for each of [`BodyContact::pairs`](crate::mechanics::loads::BodyContact::pairs).
    pub pairs: Vec<ContactForces<D>>,
    /// Local error in grid spacings, if a tolerance is set. The error exceeds the tolerance only if the step could not be halved.
    pub error: Option<f64>,
    /// Whether the grid was reset before the step.
    pub reset: bool,
    /// Whether a contact, a prescribed condition outside [`History::constrained`](super::History::constrained), has active nodes in this step.
    pub feels_wall: bool,
    /// Bodies that share nodes.
    pub shared_nodes: Vec<SharedNodes>,
    /// On an equilibrium path, the cosine of the angle between this Δφ and the last one; `None` in the first step after a grid reset.
    pub cosine: Option<f64>,
    /// Share of the volume of plastic bodies that flowed plastically in this step.
    pub yielding: f64,
    /// Seconds, and passes over the particles, by phase.
    pub seconds: Stopwatch,
    /// Failed attempts at this step. Each failed or had too large an error, and was repeated with half its length.
    pub failed: Vec<FailedAttempt>,
}

impl<const D: usize> StepReport<D> {
    /// Whether a body touches an obstacle or another body.
    pub fn touches(&self) -> bool {
        self.obstacles.iter().chain(&self.pairs).any(|contact| contact.area > 0.0)
    }
}

/// The contact of all bodies with one obstacle, or of a pair of bodies, at the end of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactForces<const D: usize> {
    /// The force on the obstacle, or on the second body of the pair, at t_{n+1}.
    pub force: Vector<f64, D>,
    /// The moment of the force. In 2D the moment is the last component. For an obstacle, it is about the middle of its bounding box, which
    /// moves with the obstacle; an unbounded obstacle has its moment about the origin of its frame. For a pair, it is about the origin.
    pub moment: [f64; 3],
    /// The reference area of contact.
    pub area: f64,
    /// The largest depth of a point in the obstacle or in the other body (length).
    pub depth: f64,
    /// The work of the moving obstacle on the bodies since the start; 0 for a pair.
    pub work: f64,
    /// The energy dissipated by friction since the start.
    pub friction_loss: f64,
}

impl<const D: usize> ContactForces<D> {
    /// No contact yet.
    pub(crate) const NONE: Self = Self {
        force: Vector::from_array_storage(nalgebra::ArrayStorage([[0.0; D]])),
        moment: [0.0; 3],
        area: 0.0,
        depth: 0.0,
        work: 0.0,
        friction_loss: 0.0,
    };
}

/// A failed attempt at a step.
#[derive(Clone, Debug)]
pub struct FailedAttempt {
    /// Length Δt of the attempt.
    pub dt: f64,
    /// Whether the local error is the only cause.
    pub inaccurate: bool,
    /// Cause of the failure, on one line.
    pub why: String,
    /// Iterations of the projection (42).
    pub projection_iterations: usize,
    /// History of Newton's method; empty if the attempt failed before.
    pub newton: NewtonHistory,
    /// Seconds, by phase.
    pub seconds: Stopwatch,
}

/// Time and iterations of an attempt so far.
pub(super) struct Spent {
    pub watch: Stopwatch,
    pub projection_iterations: usize,
}

impl Spent {
    pub(crate) fn nothing() -> Self {
        Self { watch: Stopwatch::start(), projection_iterations: 0 }
    }
}

impl FailedAttempt {
    pub(super) fn new(dt: f64, mut spent: Spent, error: &StepError) -> Self {
        spent.watch.give_up();
        let newton = match error {
            StepError::Newton(source)
            | StepError::LawFailed { source, .. }
            | StepError::Unbalanced { source, .. }
            | StepError::Loose { source, .. } => (*source.history).clone(),
            StepError::Inaccurate { newton, .. } => (**newton).clone(),
            _ => NewtonHistory::default(),
        };
        let inaccurate = matches!(error, StepError::Inaccurate { .. });
        let Spent { watch: seconds, projection_iterations } = spent;
        Self { dt, inaccurate, why: causes::on_one_line(error), projection_iterations, newton, seconds }
    }
}

/// A particle that no surface covers any more.
#[derive(Clone, Debug, PartialEq)]
pub struct BareParticle {
    /// Id of the particle.
    pub particle: u32,
    /// The outward normal of the new surface.
    pub outward: Vec<f64>,
}

/// Errors of a step. The particles are unchanged.
#[derive(Debug, thiserror::Error)]
pub enum StepError {
    /// Shape functions could not be evaluated.
    #[error("the shape functions cannot be evaluated")]
    ShapeFunctions(#[from] ShapeFunctionError),
    /// Velocities are so large that their projection overflows.
    #[error("the projection to the nodes failed")]
    Projection(#[from] LinearError),
    /// Newton's method found no equilibrium.
    #[error("no equilibrium was found")]
    Newton(#[from] NewtonError<Inadmissible>),
    /// Newton's method found no equilibrium, without inertia or with a law from a library.
    #[error("no equilibrium was found; {advice}")]
    Unbalanced {
        /// The likely cause and its cure, in a sentence.
        advice: String,
        /// The error of Newton's method.
        source: NewtonError<Inadmissible>,
    },
    /// A law gave no stress, and Newton's method found no equilibrium.
    #[error("a law gave no stress: {sentence}")]
    LawFailed {
        /// The law and its state.
        sentence: String,
        /// The error of Newton's method.
        source: NewtonError<Inadmissible>,
    },
    /// The stored reference configuration does not belong to these particles and shape functions.
    #[error(
        "the grid of the last step has {stored} active nodes, and the particles now have {nodes}: after a change by hand, call \
         Simulation::forget"
    )]
    OtherGrid {
        /// Number of nodes with a stored motion.
        stored: usize,
        /// Number of active nodes.
        nodes: usize,
    },
    /// The equilibrium path ends, because the loads no longer change.
    #[error(
        "the path ends at load = {load}: no load changes there; give the curves of the loads points on both sides of it"
    )]
    PathEnds {
        /// The load parameter λ at the end.
        load: f64,
    },
    /// Without inertia, loads push bodies that nothing holds.
    #[error(
        "{loose}: without inertia there is no equilibrium; hold them with a boundary condition, or give the scene inertia"
    )]
    Loose {
        /// The bodies, and the direction in which nothing holds them.
        loose: Loose,
        /// The error of Newton's method.
        source: NewtonError<Inadmissible>,
    },
    /// The local error exceeds the tolerance, and the step can be halved.
    #[error("the local error is {error:.2e} grid spacings; {tolerance:.2e} are allowed")]
    Inaccurate {
        /// The error.
        error: f64,
        /// The largest allowed error.
        tolerance: f64,
        /// History of Newton's method.
        newton: Box<NewtonHistory>,
    },
    /// A particle has det F ≤ 0 at the start of the step or at its end.
    #[error(transparent)]
    Inadmissible(#[from] Inadmissible),
    /// The tangent is not the derivative of the residual.
    #[error("the check of the tangent failed")]
    Tangent(#[from] CheckError),
    /// A point of a body enters an obstacle too deeply in one step.
    #[error(
        "the point of a body at {position:?} enters the obstacle {obstacle:?} by {depth:.2} grid spacings in one step, or goes through: take \
         shorter steps, a stiffer contact (obstacles[].stiffness), or a thicker obstacle; parts of a union must overlap"
    )]
    EntersObstacle {
        /// Name of the obstacle.
        obstacle: String,
        /// Position of the point at the start of the step.
        position: Vec<f64>,
        /// Depth at the end of the step, in grid spacings.
        depth: f64,
    },
    /// Newton's method finds no balance of forces on a free obstacle, or the obstacle turns too far.
    #[error(
        "the forces on the free obstacle {obstacle:?} are not in balance, or it turns by more than half a turn in one step: take shorter \
         steps, or a softer contact (obstacles[].stiffness)"
    )]
    FreeObstacle {
        /// Name of the obstacle.
        obstacle: String,
    },
    /// A free obstacle meets another obstacle.
    #[error(
        "the obstacle {:?} meets the obstacle {:?} at {position:?}, one of them moves freely, and obstacles do not push each other: make one of \
         the two a body",
        names[0], names[1]
    )]
    ObstaclesMeet {
        /// Names of the obstacles.
        names: [String; 2],
        /// The place.
        position: Vec<f64>,
    },
    /// Two bodies move so fast that contact may be missed.
    #[error(
        "bodies {:?} and {:?} are near each other, and points of them move by more than {fastest} grid spacings relative to each other in \
         one step, so that contact may be missed: take shorter steps",
        bodies[0], bodies[1]
    )]
    PassesBody {
        /// Names of the bodies.
        bodies: [String; 2],
        /// The largest motion in which no contact is missed, in grid spacings.
        fastest: f64,
    },
    /// A point of a body enters another body too deeply.
    #[error(
        "the point of body {:?} at {position:?} comes {depth:.2} grid spacings deep into body {:?} in one step: take shorter steps, or a \
         stiffer contact (contact.stiffness)",
        bodies[0], bodies[1]
    )]
    EntersBody {
        /// Names of the body of the point, and of the body that it enters.
        bodies: [String; 2],
        /// Position of the point at the start of the step.
        position: Vec<f64>,
        /// Depth at the end of the step, in grid spacings.
        depth: f64,
    },
    /// Particles lie deeper in an obstacle or in another body than the surface of their own body.
    #[error(
        "particle {} lies deeper in an obstacle or in another body than the surface of its own body, and so do {} others: the surface has \
         opened there. Simulation::advance makes these particles points of the surface, and repeats the step",
        bare[0].particle, bare.len() - 1
    )]
    SurfaceOpens {
        /// The particles; at least one.
        bare: Vec<BareParticle>,
    },
    /// A particle would leave the grid.
    #[error(
        "particle {particle} leaves the grid at {position:?}; enlarge the grid or hold the body with a boundary condition"
    )]
    LeftGrid {
        /// Id of the particle.
        particle: usize,
        /// Position that the particle would reach.
        position: Vec<f64>,
    },
    /// The energy or an internal variable of a particle is no number.
    #[error(
        "particle {particle} would have an energy, or an internal variable, that is not finite: take a shorter step (time.step)"
    )]
    Undefined {
        /// Id of the particle.
        particle: usize,
    },
}

impl StepError {
    /// Whether the step was [stopped](crate::solver::Stop).
    pub fn is_stopped(&self) -> bool {
        matches!(self, Self::Newton(error) if matches!(error.cause, NewtonFailure::Stopped))
    }

    /// Whether the device failed on which Newton's method runs.
    pub(crate) fn is_of_device(&self) -> bool {
        matches!(self, Self::Newton(error) if error.cause.is_of_device())
    }
}

/// The simulation cannot continue. The particles have the state after the last successful step.
#[derive(Debug, thiserror::Error)]
#[error("the step from t = {time} failed, the last time with dt = {dt:e} (attempts: {})", failed.len())]
pub struct AdvanceError {
    /// The time t_n at the start of the step.
    pub time: f64,
    /// Δt of the last attempt.
    pub dt: f64,
    /// Why the last attempt failed.
    #[source]
    pub cause: Box<StepError>,
    /// All attempts, the last one included.
    pub failed: Vec<FailedAttempt>,
}
