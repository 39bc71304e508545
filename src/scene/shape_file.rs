//! Files from which shapes are read.

use super::image_file::{ImageFile, ImageFileError};
use super::shape::Shape;
use super::surface_file::{SurfaceFile, SurfaceFileError};
use super::{BuildError, Problems, Scene};
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
    fn file(&self) -> &Path {
        match self {
            Self::Surface(surface) => &surface.file,
            Self::Image(image) => &image.file,
        }
    }

    fn read(&self, folder: &Path) -> Result<(), ShapeFileError> {
        match self {
            Self::Surface(surface) => Ok(surface.read(folder)?),
            Self::Image(image) => Ok(image.read(folder)?),
        }
    }
}

impl Scene {
    /// Reads the files of all shapes, then returns the problems of the scene with these shapes.
    pub(super) fn read_shapes(&self, folder: &Path) -> Result<Problems, BuildError> {
        let mut any = false;
        let mut read = |path: &str, shape: ShapeFile<'_>| {
            any = true;
            shape.read(folder).map_err(|source| BuildError::ShapeFile {
                path: path.to_owned(),
                file: folder.join(shape.file()).display().to_string(),
                source: Box::new(source),
            })
        };
        for (path, shape) in self.shapes() {
            shape.each_file(&path, &mut read)?;
        }
        Ok(if any { self.check() } else { Problems::default() })
    }

    /// All shapes, with their paths.
    fn shapes(&self) -> Vec<(String, &Shape)> {
        let bodies = self.bodies.iter().enumerate();
        let bodies = bodies.filter_map(|(i, body)| Some((format!("bodies[{i}].shape"), body.shape.as_ref()?)));
        let prescribed = self.prescribed.iter().enumerate();
        let prescribed = prescribed.map(|(i, one)| (format!("prescribed[{i}].region"), &one.region));
        let tractions = self.tractions.iter().map(|one| one.region.as_ref()).enumerate();
        let tractions = tractions.filter_map(|(i, region)| Some((format!("tractions[{i}].region"), region?)));
        let pressures = self.pressures.iter().map(|one| one.region.as_ref()).enumerate();
        let pressures = pressures.filter_map(|(i, region)| Some((format!("pressures[{i}].region"), region?)));
        let initial = self.initial_velocity.iter().flat_map(|initial| &initial.nodes).enumerate();
        let initial = initial.map(|(i, one)| (format!("initial_velocity.nodes[{i}].region"), &one.region));
        bodies.chain(prescribed).chain(tractions).chain(pressures).chain(initial).collect()
    }
}
