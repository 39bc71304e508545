//! Errors while results are written.

use crate::field::Field;
use crate::material::NonPositiveJacobian;
use std::path::{Path, PathBuf};

/// Results could not be written.
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
    /// The report could not be put into JSON.
    #[error("cannot write {} as JSON: {source}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: serde_json::Error,
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
    /// A table to be continued has other columns.
    #[error("{} has other columns than this run, so it cannot be continued", path.display())]
    OtherColumns {
        /// The table.
        path: PathBuf,
    },
    /// A file to be continued has become shorter.
    #[error("{} ends before the place where it was to be continued", path.display())]
    Shorter {
        /// The file.
        path: PathBuf,
    },
    /// A file to be continued has other content.
    #[error("{} is not what it was when the checkpoint was written", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// The reference belongs to another set of particles.
    #[error("the reference state has {reference} particles, the simulation {particles}")]
    Reference {
        /// Particles of the reference.
        reference: usize,
        /// Particles of the simulation.
        particles: usize,
    },
}

impl OutputError {
    /// Converts an error of the operating system, for `map_err`.
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Io { action, path: path.to_owned(), source }
    }
}
