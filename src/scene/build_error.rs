//! The error of building a simulation from a scene.

use super::Problems;
use crate::mechanics::loads::CurveError;
use std::error::Error;

/// Errors of building a simulation from a scene.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// Values that are not allowed: those of shapes read from files, or of a scene that was changed after it was read.
    #[error("{0}")]
    Values(Problems),
    /// A table in time that was changed after the scene was read.
    #[error(transparent)]
    Curve(#[from] CurveError),
    /// A failure that appears only with the particles, or in a file: the key, the cause, and what to do.
    #[error("{0}: {1}")]
    At(String, #[source] Box<dyn Error + Send + Sync>),
}

impl BuildError {
    pub(super) fn at(path: impl Into<String>, source: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::At(path.into(), source.into())
    }
}
