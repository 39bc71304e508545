//! Errors while results are written, read or drawn.

use crate::field::Field;
use crate::material::NonPositiveJacobian;
use std::path::{Path, PathBuf};

/// Results could not be written, read or drawn.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The operating system refused.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// The action that failed.
        action: &'static str,
        /// The file or directory.
        path: PathBuf,
        /// Reason given by the operating system.
        source: std::io::Error,
    },
    /// A file of a run has other content than a run writes.
    #[error("{} {what}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The wrong part, a sentence without its subject.
        what: String,
    },
    /// A particle has no stress.
    #[error("particle {particle} has no stress: {source}")]
    Inadmissible {
        /// Id of the particle.
        particle: usize,
        /// The determinant found.
        source: NonPositiveJacobian,
    },
    /// A particle that does not exist.
    #[error("there is no particle {particle}; there are {particles}, numbered from 0")]
    NoParticle {
        /// The id asked for.
        particle: usize,
        /// Number of particles.
        particles: usize,
    },
    /// A velocity or acceleration was asked for, but the bodies have no inertia.
    #[error("particles without inertia have no {}", .0.name())]
    Inertia(Field),
    /// An internal variable was asked for that no law has.
    #[error("no law has the internal variable {name:?}; the laws have {}", if known.is_empty() { "none" } else { known })]
    Internal {
        /// The name asked for.
        name: String,
        /// The names that the laws have.
        known: String,
    },
    /// A probe at a particle that does not exist.
    #[error("probe {name:?} is at particle {particle}; there are {particles}, numbered from 0")]
    ProbeParticle {
        /// Name of the probe.
        name: String,
        /// The id asked for.
        particle: usize,
        /// Number of particles.
        particles: usize,
    },
    /// A probe has a point that is not finite, or a body without particles.
    #[error(
        "probe {name:?} at {point:?} has no nearest particle; its coordinates must be finite, and its body must have particles"
    )]
    ProbePoint {
        /// Name of the probe.
        name: String,
        /// The point asked for.
        point: Vec<f64>,
    },
    /// The time between snapshots is out of range.
    #[error("the time between snapshots is {0:e}; it must be finite and > 0")]
    SnapshotEvery(f64),
    /// Two columns of one table would have the same name.
    #[error("two columns of {} would be called {column:?}; use different names", path.display())]
    DuplicateColumn {
        /// The table.
        path: PathBuf,
        /// The name.
        column: String,
    },
    /// The reference belongs to another set of particles.
    #[error("the reference state has {reference} particles, the simulation {particles}")]
    Reference {
        /// Particles of the reference.
        reference: usize,
        /// Particles of the simulation.
        particles: usize,
    },
    /// There are no snapshots for a movie.
    #[error("{} holds no snapshots: give the scene output.every", .0.display())]
    NoSnapshots(PathBuf),
    /// The snapshots do not hold the field asked for.
    #[error("the snapshots hold no field {field:?}; they hold {there}; the key output.fields says what a run writes")]
    NoField {
        /// The field.
        field: String,
        /// The fields of the snapshots.
        there: String,
    },
    /// The renderer refused.
    #[error("cannot draw {name}: {reason}")]
    Draw {
        /// The picture.
        name: &'static str,
        /// The reason given by the renderer.
        reason: String,
    },
}

impl OutputError {
    /// Converts an error of the operating system, for `map_err`.
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Io { action, path: path.to_owned(), source }
    }

    /// The error of a file with wrong content; `what` continues the sentence that begins with the path.
    pub(crate) fn content(path: &Path, what: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), what: what.into() }
    }
}
