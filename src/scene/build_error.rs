//! Errors of building a simulation from a checked scene.

use super::Problems;
use super::particle_file::ParticleFileError;
use super::shape_file::ShapeFileError;
use crate::mechanics::loads::CurveError;
use crate::shape::FillError;
use crate::simulation::StepError;
use crate::tensor::Vector;
use indicatif::BinaryBytes;

/// Errors of building a simulation from a checked scene.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// The scene was not checked, or has another dimension.
    #[error("{path}: does not fit {dimension} dimensions")]
    Dimension {
        /// The key.
        path: String,
        /// The dimension asked for.
        dimension: usize,
    },
    /// Values that are not allowed: those of shapes read from files, or of a scene that was not checked.
    #[error("{0}")]
    Values(Problems),
    /// A curve or table is not allowed.
    #[error("{path}: {source}")]
    Curve {
        /// The key.
        path: String,
        /// The cause.
        source: CurveError,
    },
    /// A shape contains no particles, or too many.
    #[error("{path}: {source}")]
    Fill {
        /// The key.
        path: String,
        /// The cause.
        source: FillError,
    },
    /// More particles than there is memory for.
    #[error(
        "{path}: {particles} particles so far need at least {} of memory, and {} can be had: use a coarser grid, fewer particles \
         per cell or a smaller body", BinaryBytes(*needed), BinaryBytes(*memory)
    )]
    Memory {
        /// The key.
        path: String,
        /// Particles of this body and of those before.
        particles: usize,
        /// Required memory in bytes, at least.
        needed: u64,
        /// Available memory in bytes.
        memory: u64,
    },
    /// A particle file cannot be used.
    #[error("{path}: {file}: {source}")]
    ParticleFile {
        /// The key.
        path: String,
        /// The file.
        file: String,
        /// The cause.
        source: Box<ParticleFileError>,
    },
    /// The file of a shape cannot be used.
    #[error("{path}: {file} {source}")]
    ShapeFile {
        /// The key.
        path: String,
        /// The file.
        file: String,
        /// The cause.
        source: Box<ShapeFileError>,
    },
    /// A particle of a file lies outside the grid.
    #[error("{path}: particle {particle} of the file, at {position:?}, lies outside the grid")]
    Outside {
        /// The key.
        path: String,
        /// Number of the particle in the file, from 1.
        particle: usize,
        /// Position of the particle.
        position: Vec<f64>,
    },
    /// A surface load acts on no part of the surface.
    #[error("{path}: nothing of the surface of body {body:?} is loaded; enlarge the region or remove the load")]
    NoSurface {
        /// The key.
        path: String,
        /// The body.
        body: String,
    },
    /// The loads at t = 0 could not be evaluated.
    #[error("the acceleration at t = 0 cannot be computed: {source}")]
    InitialAcceleration {
        /// The cause.
        source: Box<StepError>,
    },
    /// A quantity is too large or too small to compute with.
    #[error(
        "{path}: {what} is {value:e}; it must lie between {least:e} and {most:e}, or its products are not numbers: choose other \
         units, or other values"
    )]
    Scale {
        /// The key.
        path: String,
        /// The quantity.
        what: &'static str,
        /// The value.
        value: f64,
        /// The smallest allowed value.
        least: f64,
        /// The largest allowed value.
        most: f64,
    },
    /// A particle file gives velocities that another key forbids.
    #[error("{path}: {file} gives velocities, and {why}")]
    Velocities {
        /// The key.
        path: String,
        /// The file.
        file: String,
        /// The cause, and what to remove.
        why: &'static str,
    },
    /// The initial velocity could not be interpolated.
    #[error("initial_velocity: {source}")]
    InitialVelocity {
        /// The cause.
        source: Box<StepError>,
    },
}

impl BuildError {
    /// The error for a value at `path` that does not have the dimension `D`.
    pub(super) fn dimension<const D: usize>(path: &str) -> Self {
        Self::Dimension { path: path.into(), dimension: D }
    }
}

/// A vector of the scene; an error unless it has `D` components.
pub(super) fn vector<const D: usize>(path: &str, components: &[f64]) -> Result<Vector<f64, D>, BuildError> {
    super::vector::vector(components).ok_or_else(|| BuildError::dimension::<D>(path))
}
