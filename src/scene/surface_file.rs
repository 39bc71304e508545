//! Surfaces of triangles from files of STL and PLY.

use super::file::{ShapeFileError, open};
use crate::shape::{Surface, SurfaceError};
use crate::tensor::Vector;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Maximum length of a file in bytes.
const MAX_BYTES: u64 = 1 << 30;

/// A surface from a file.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurfaceFile {
    /// Path of the file, which ends in `.stl` or `.ply`, relative to the scene's folder. The surface must be closed and must not cross
    /// itself. Vertices at the same position are merged.
    #[schemars(length(min = 1))]
    pub file: PathBuf,
    /// The surface, once the file has been read.
    #[serde(skip)]
    pub(super) surface: OnceLock<Surface<3>>,
}

/// Vertex positions, and the three vertex numbers of each triangle.
type Triangles = (Vec<[f64; 3]>, Vec<[usize; 3]>);

/// The supported formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Stl,
    Ply,
}

impl Format {
    fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "stl" => Some(Self::Stl),
            "ply" => Some(Self::Ply),
            _ => None,
        }
    }
}

impl SurfaceFile {
    /// Whether the name of the file has the ending of a supported format.
    pub(super) fn has_format(&self) -> bool {
        Format::of(&self.file).is_some()
    }

    /// Reads the file, unless it has been read.
    ///
    /// # Errors
    /// The errors of [`read_file`].
    pub(super) fn read(&self, folder: &Path) -> Result<(), ShapeFileError> {
        if self.surface.get().is_none() {
            let _ = self.surface.set(read_file(&folder.join(&self.file))?);
        }
        Ok(())
    }
}

/// The solid inside the surface in a file.
///
/// ```
/// use bfree::scene::surface_file::read_file;
/// use bfree::shape::Shape;
/// use bfree::tensor::Vector;
///
/// let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
///     element face 4\nproperty list uchar int vertex_indices\nend_header\n\
///     0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
/// let file = tempfile::Builder::new().suffix(".ply").tempfile()?;
/// std::fs::write(file.path(), text)?;
/// let corner = Shape::from(read_file(file.path())?);
/// assert!(corner.contains(&Vector::from([0.1, 0.1, 0.1])) && !corner.contains(&Vector::from([0.5, 0.5, 0.5])));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The file cannot be read, or its surface is open, faces both ways or crosses itself (with the position).
pub fn read_file(path: &Path) -> Result<Surface<3>, ShapeFileError> {
    let format = Format::of(path).ok_or_else(|| ShapeFileError("must end in .stl or .ply".to_owned()))?;
    let (mut file, length) = open(path)?;
    if length > MAX_BYTES {
        return Err(ShapeFileError(format!("has {length} bytes; at most {MAX_BYTES} are read")));
    }
    let (corners, triangles): Triangles = match format {
        Format::Stl => {
            let mesh = stl_io::read_stl(&mut file)?;
            let corners = mesh.vertices.iter().map(|x| x.0.map(f64::from)).collect();
            (corners, mesh.faces.iter().map(|face| face.vertices).collect())
        }
        Format::Ply => of_ply(&mut file)?,
    };
    joined(&corners, &triangles).map_err(|error| ShapeFileError(format!("holds {error}")))
}

/// The surface, with coincident vertices merged.
fn joined(corners: &[[f64; 3]], triangles: &[[usize; 3]]) -> Result<Surface<3>, SurfaceError> {
    if corners.len().max(triangles.len()) >= u32::MAX as usize {
        return Err(SurfaceError::TooMany(triangles.len()));
    }
    let (mut numbers, mut vertices, mut number_of) = (Vec::new(), Vec::new(), HashMap::new());
    for corner in corners {
        // Adding 0 turns −0 into 0.
        let key = corner.map(|x| (x + 0.0).to_bits());
        let number = *number_of.entry(key).or_insert_with(|| {
            vertices.push(Vector::from(*corner));
            vertices.len() as u32 - 1
        });
        numbers.push(number);
    }
    // A vertex that does not exist keeps its number, and `Surface::new` refuses it.
    let number = |corner: usize| numbers.get(corner).copied().unwrap_or(corner as u32);
    Surface::new(vertices, triangles.iter().map(|triangle| triangle.map(number)).collect())
}

/// An entry of a PLY file: a vertex or a face.
#[derive(Default)]
struct Entry {
    place: [Option<f64>; 3],
    corners: Option<Vec<u32>>,
}

impl PropertyAccess for Entry {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = ["x", "y", "z"].iter().position(|axis| *axis == name);
        if let Some(place) = axis.and_then(|axis| self.place.get_mut(axis)) {
            *place = match property {
                Property::Double(x) => Some(x),
                Property::Float(x) => Some(f64::from(x)),
                Property::Int(x) => Some(f64::from(x)),
                other => other.to_f32_lossy().map(f64::from),
            };
        } else if ["vertex_indices", "vertex_index"].contains(&name) {
            self.corners = property.to_u32_list();
        } else {
            return PropertyAccessResult::Ignored;
        }
        PropertyAccessResult::Set
    }
}

/// Vertices and triangles of a PLY file. A face with more than three vertices becomes a fan of triangles.
fn of_ply(file: &mut BufReader<File>) -> Result<Triangles, ShapeFileError> {
    let ply = Parser::<Entry>::new().read_ply(file).map_err(io::Error::other)?;
    let list = |name| ply.payload.get(name).map_or(&[][..], Vec::as_slice);
    let lacks = |what| move || ShapeFileError(format!("has no {what}"));
    let place = |entry: &Entry| match entry.place {
        [Some(x), Some(y), Some(z)] => Ok([x, y, z]),
        _ => Err(lacks("x, y and z of its vertices")()),
    };
    let corners = list("vertex").iter().map(place).collect::<Result<Vec<_>, _>>()?;
    let mut triangles = Vec::new();
    for (face, entry) in list("face").iter().enumerate() {
        let list = entry.corners.as_ref().ok_or_else(lacks("vertex_indices of its faces"))?;
        let [first, rest @ ..] = list.as_slice() else { return Err(too_few_corners(face, 0)) };
        if rest.len() < 2 {
            return Err(too_few_corners(face, list.len()));
        }
        triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]].map(|corner| corner as usize)));
    }
    Ok((corners, triangles))
}

fn too_few_corners(face: usize, corners: usize) -> ShapeFileError {
    ShapeFileError(format!("face {face} has {corners} corners (faces are counted from 0)"))
}
