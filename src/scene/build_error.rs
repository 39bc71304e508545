//! Why a checked scene still gives no simulation.

use super::Problems;
use super::particle_file::ParticleFileError;
use super::shape_file::ShapeFileError;
use crate::mechanics::loads::CurveError;
use crate::shape::FillError;
use crate::simulation::StepError;
use indicatif::BinaryBytes;

/// Why a checked scene still gives no simulation.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// The scene was not checked, or is of another dimension.
    #[error("{path}: does not fit {dimension} dimensions")]
    Dimension {
        /// The key.
        path: String,
        /// The dimension asked for.
        dimension: usize,
    },
    /// The scene was not checked: constants of a law or of shape functions.
    #[error("{0}")]
    Values(Problems),
    /// A curve or table.
    #[error("{path}: {source}")]
    Curve {
        /// The key.
        path: String,
        /// What is wrong.
        source: CurveError,
    },
    /// A shape without particles, or with too many.
    #[error("{path}: {source}")]
    Fill {
        /// The key.
        path: String,
        /// What is wrong.
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
        /// Of this body and those before.
        particles: usize,
        /// Bytes, at least.
        needed: u64,
        /// Bytes that can be had.
        memory: u64,
    },
    /// A particle file.
    #[error("{path}: {file}: {source}")]
    ParticleFile {
        /// The key.
        path: String,
        /// The file.
        file: String,
        /// What is wrong.
        source: Box<ParticleFileError>,
    },
    /// The file of a shape.
    #[error("{path}: {file} {source}")]
    ShapeFile {
        /// The key.
        path: String,
        /// The file.
        file: String,
        /// What is wrong.
        source: Box<ShapeFileError>,
    },
    /// A particle of a file that lies outside the grid.
    #[error("{path}: particle {particle} of the file, at {position:?}, lies outside the grid")]
    Outside {
        /// The key.
        path: String,
        /// Its number in the file, from 1.
        particle: usize,
        /// Where it lies.
        position: Vec<f64>,
    },
    /// A surface load that finds no surface.
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
        /// What is wrong.
        source: Box<StepError>,
    },
    /// A number too large or too small to compute with.
    #[error(
        "{path}: {what} is {value:e}; it must lie between {least:e} and {most:e}, or its products are not numbers: choose other \
         units, or other values"
    )]
    Scale {
        /// The key.
        path: String,
        /// The quantity.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The least allowed.
        least: f64,
        /// The most allowed.
        most: f64,
    },
    /// Velocities from a file that something else forbids.
    #[error("{path}: {file} gives velocities, and {why}")]
    Velocities {
        /// The key.
        path: String,
        /// The file.
        file: String,
        /// What forbids them, and what to remove.
        why: &'static str,
    },
    /// The initial velocity could not be interpolated.
    #[error("initial_velocity: {source}")]
    InitialVelocity {
        /// What is wrong.
        source: Box<StepError>,
    },
}
