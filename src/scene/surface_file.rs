//! Surfaces of triangles from files of STL and PLY.

use super::file::{FileError, ending, open_mesh};
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

impl SurfaceFile {
    /// Whether the name of the file has the ending of a supported format.
    pub(super) fn has_format(&self) -> bool {
        ["stl", "ply"].contains(&ending(&self.file).as_str())
    }

    /// Reads the file, unless it has been read.
    ///
    /// # Errors
    /// The errors of [`read_file`].
    pub(super) fn read(&self, folder: &Path) -> Result<(), FileError> {
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
/// let distance = |x: f64| corner.signed_distance(&Vector::from([x; 3]));
/// assert!(distance(0.1) < 0.0 && distance(0.5) > 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The file cannot be read, or its surface is open, faces both ways or crosses itself (with the position).
pub fn read_file(path: &Path) -> Result<Surface<3>, FileError> {
    let mut file = open_mesh(path)?;
    let (corners, triangles): Triangles = match ending(path).as_str() {
        "stl" => {
            let mesh = stl_io::read_stl(&mut file)?;
            let corners = mesh.vertices.iter().map(|x| x.0.map(f64::from)).collect();
            (corners, mesh.faces.iter().map(|face| face.vertices).collect())
        }
        "ply" => of_ply(&mut file)?,
        _ => return Err(FileError("must end in .stl or .ply".to_owned())),
    };
    joined(&corners, &triangles).map_err(|error| FileError(format!("holds {error}")))
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
fn of_ply(file: &mut BufReader<File>) -> Result<Triangles, FileError> {
    let ply = Parser::<Entry>::new().read_ply(file).map_err(io::Error::other)?;
    let list = |name| ply.payload.get(name).map_or(&[][..], Vec::as_slice);
    let lacks = |what| move || FileError(format!("has no {what}"));
    let place = |entry: &Entry| match entry.place {
        [Some(x), Some(y), Some(z)] => Ok([x, y, z]),
        _ => Err(lacks("x, y and z of its vertices")()),
    };
    let corners = list("vertex").iter().map(place).collect::<Result<Vec<_>, _>>()?;
    let mut triangles = Vec::new();
    for (face, entry) in list("face").iter().enumerate() {
        let list = entry.corners.as_ref().ok_or_else(lacks("vertex_indices of its faces"))?;
        if list.len() < 3 {
            return Err(FileError(format!("face {face} has {} corners (faces are counted from 0)", list.len())));
        }
        let fan = list[1..].windows(2).map(|pair| [list[0], pair[0], pair[1]]);
        triangles.extend(fan.map(|triangle| triangle.map(|corner| corner as usize)));
    }
    Ok((corners, triangles))
}
