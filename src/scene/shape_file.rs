//! Files from which shapes are read.

use super::image_file::{ImageFile, ImageFileError};
use super::surface_file::{SurfaceFile, SurfaceFileError};
use std::path::Path;

/// A file of a shape.
#[derive(Clone, Copy)]
pub(super) enum ShapeFile<'a> {
    Surface(&'a SurfaceFile),
    Image(&'a ImageFile),
}

/// A file that gives no solid.
#[derive(Debug, thiserror::Error)]
pub enum ShapeFileError {
    /// A surface of triangles.
    #[error(transparent)]
    Surface(#[from] SurfaceFileError),
    /// Pixels or voxels.
    #[error(transparent)]
    Image(#[from] ImageFileError),
}

impl ShapeFile<'_> {
    pub(super) fn file(&self) -> &Path {
        match self {
            Self::Surface(surface) => &surface.file,
            Self::Image(image) => &image.file,
        }
    }

    pub(super) fn read(&self, folder: &Path) -> Result<(), ShapeFileError> {
        match self {
            Self::Surface(surface) => Ok(surface.read(folder)?),
            Self::Image(image) => Ok(image.read(folder)?),
        }
    }
}
