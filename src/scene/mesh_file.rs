//! Physical groups of meshes of Gmsh as shapes.

use super::file::{FileError, ending, open_mesh};
use super::msh::{Block, Mesh};
use crate::problems::Problems;
use crate::shape::{Polygon, PolygonError, Shape, Sheet, Surface};
use crate::simulation::as_type;
use crate::tensor::{Tensor, Vector, determinant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The most edges around a group in 2D: all pairs of edges are compared.
const MAX_EDGES: usize = 20_000;

/// The largest slope of a mesh in 2D.
const FLAT: f64 = 1e-9;

/// A physical group of a mesh of Gmsh.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshFile {
    /// Path of the file, which ends in `.msh`, relative to the scene's folder: format MSH 4.1, text or binary, elements of first order. In 2D, x
    /// and y are read.
    #[schemars(length(min = 1))]
    pub file: PathBuf,
    /// The name of a physical group, or the tag of a group without a name.
    pub group: String,
    /// The shape in 2D or 3D, once the file has been read.
    #[serde(skip)]
    plane: OnceLock<Shape<2>>,
    #[serde(skip)]
    space: OnceLock<Shape<3>>,
}

impl MeshFile {
    /// The shape; `None` if it is not allowed, with the reasons in `problems`, and before the file has been read.
    pub(super) fn build<const D: usize>(&self, problems: &mut Problems, path: &str) -> Option<Shape<D>> {
        if D < 2 {
            problems.refuse(path, "a mesh", "needs a grid of 2 or 3 dimensions");
            return None;
        }
        let named = ending(&self.file) == "msh";
        problems.require(named, &format!("{path}.file"), format_args!("{:?}", self.file), "must end in .msh");
        if D == 2 { as_type(self.plane.get()?.clone()) } else { as_type(self.space.get()?.clone()) }
    }

    /// Whether the group has been read and has no inside.
    pub(super) fn is_sheet(&self) -> bool {
        matches!(self.plane.get(), Some(Shape::Sheet(_))) || matches!(self.space.get(), Some(Shape::Sheet(_)))
    }

    /// Reads the file for a scene of 2 or 3 dimensions, unless it has been read.
    ///
    /// # Errors
    /// The errors of [`read_group`].
    pub(super) fn read(&self, folder: &Path, dimension: usize) -> Result<(), FileError> {
        let path = folder.join(&self.file);
        if dimension == 2 && self.plane.get().is_none() {
            let _ = self.plane.set(read_group(&path, &self.group)?);
        } else if dimension == 3 && self.space.get().is_none() {
            let _ = self.space.set(read_group(&path, &self.group)?);
        }
        Ok(())
    }
}

/// The shape of a physical group of a mesh of Gmsh, for D = 2 or 3. A group of D dimensions is a solid: a [`Surface`], or in 2D a [`Polygon`].
/// A group of one dimension less is a [`Sheet`].
///
/// ```
/// use bfree::scene::mesh_file::read_group;
/// use bfree::shape::Shape;
/// use bfree::tensor::Vector;
///
/// // A triangle, and one of its sides.
/// let text = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n1 7 \"side\"\n2 5 \"part\"\n$EndPhysicalNames\n\
///     $Entities\n0 1 1 0\n1 0 0 0 1 0 0 1 7 0\n1 0 0 0 1 1 0 1 5 0\n$EndEntities\n\
///     $Nodes\n1 3 1 3\n2 1 0 3\n1\n2\n3\n0 0 0\n1 0 0\n0 1 0\n$EndNodes\n\
///     $Elements\n2 2 1 2\n1 1 1 1\n1 1 2\n2 1 2 1\n2 1 2 3\n$EndElements\n";
/// let file = tempfile::Builder::new().suffix(".msh").tempfile()?;
/// std::fs::write(file.path(), text)?;
/// let part: Shape<2> = read_group(file.path(), "part")?;
/// assert!(part.signed_distance(&Vector::from([0.3, 0.3])) < 0.0 && part.signed_distance(&Vector::from([0.6, 0.6])) > 0.0);
/// let side: Shape<2> = read_group(file.path(), "side")?;
/// assert_eq!(side.signed_distance(&Vector::from([0.5, 0.25])), 0.25);
/// let error = read_group::<2>(file.path(), "top").unwrap_err().to_string();
/// assert_eq!(error, "has 0 physical groups \"top\"; must be the name of one surface or curve: [\"side\", \"part\"]");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The file cannot be read or is wrong (with the line, or the byte if it is binary), has no such group, or the group bounds no solid (with the
/// position).
pub fn read_group<const D: usize>(path: &Path, group: &str) -> Result<Shape<D>, FileError> {
    if !(2..=3).contains(&D) {
        return Err(FileError(format!("is a mesh, which has no groups for {D} dimensions")));
    }
    let mut bytes = Vec::new();
    open_mesh(path)?.read_to_end(&mut bytes)?;
    let mesh = Mesh::read(&bytes)?;
    let (dimension, blocks) = mesh.group(group, D as i32)?;
    let solid = dimension == D as i32;
    let place = |tag: u64| mesh.nodes.get(&tag).copied().unwrap_or_default();
    let simplices = simplices_of::<D>(&blocks, solid, place);
    // Vertices have numbers in the order of their tags.
    let mut tags = simplices.concat();
    tags.sort_unstable();
    tags.dedup();
    let number = |tag: u64| tags.partition_point(|&other| other < tag) as u32;
    let simplices: Vec<[u32; D]> = simplices.iter().map(|simplex| simplex.map(number)).collect();
    let wrong = |why: String| FileError(format!("holds the group {group:?} with {why}"));
    let start = tags.first().map_or([0.0; 3], |&tag| place(tag));
    let is_off = |x: &[f64; 3]| (x[2] - start[2]).abs() > FLAT * (x[0] - start[0]).hypot(x[1] - start[1]);
    if let Some(x) = tags.iter().map(|&tag| place(tag)).find(|x| D == 2 && is_off(x)) {
        return Err(wrong(format!("nodes at {start:?} and {x:?}; in 2 dimensions all must have one z")));
    }
    let vertices: Vec<Vector<f64, D>> = tags.iter().map(|&tag| Vector::from_fn(|k, _| place(tag)[k])).collect();
    let shape = if !solid {
        Sheet::new(&vertices, &simplices).map(Shape::from).ok_or_else(|| "no element of different nodes".to_owned())
    } else if D == 2 {
        polygon(&vertices, &simplices)
    } else {
        let triangles = simplices.iter().map(|corners| std::array::from_fn(|k| corners[k])).collect();
        Surface::new(vertices, triangles).map(Shape::from).map_err(|error| error.to_string())
    };
    shape.map_err(wrong)
}

/// The simplices of D − 1 dimensions around a solid, or of all elements of a group without an inside.
fn simplices_of<const D: usize>(blocks: &[&Block], solid: bool, place: impl Fn(u64) -> [f64; 3]) -> Vec<[u64; D]> {
    let mut simplices: Vec<[u64; D]> = Vec::new();
    for block in blocks {
        for nodes in block.nodes.chunks_exact(block.size) {
            let first = simplices.len();
            faces_of(block.kind, D).iter().for_each(|face| add_simplices(face.map(|i| nodes[i]), &mut simplices));
            // Elements may be turned inside out. D! V = Σ det (x₁ − o, …)
            let origin = place(nodes[0]);
            let edges = |simplex: &[u64; D]| Tensor::<f64, D>::from_fn(|i, k| place(simplex[k])[i] - origin[i]);
            let volume: f64 = simplices[first..].iter().map(|simplex| determinant(&edges(simplex))).sum();
            if solid && volume < 0.0 {
                simplices[first..].iter_mut().for_each(|simplex| simplex.swap(0, 1));
            }
        }
    }
    if solid { boundary(simplices) } else { simplices }
}

/// The faces of D − 1 dimensions of an element of this type, counter-clockwise as seen from outside, the last node repeated if there are fewer than
/// four. An element of D − 1 dimensions has itself.
fn faces_of(kind: i32, dimension: usize) -> &'static [[usize; 4]] {
    match (dimension, kind) {
        (2, 1) => &[[0, 1, 1, 1]],
        (2, 2) => &[[0, 1, 1, 1], [1, 2, 2, 2], [2, 0, 0, 0]],
        (2, 3) => &[[0, 1, 1, 1], [1, 2, 2, 2], [2, 3, 3, 3], [3, 0, 0, 0]],
        (3, 2) => &[[0, 1, 2, 2]],
        (3, 3) => &[[0, 1, 2, 3]],
        (3, 4) => &[[0, 2, 1, 1], [0, 1, 3, 3], [0, 3, 2, 2], [1, 2, 3, 3]],
        (3, 5) => &[[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]],
        (3, 6) => &[[0, 2, 1, 1], [3, 4, 5, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]],
        (3, 7) => &[[0, 3, 2, 1], [0, 1, 4, 4], [1, 2, 4, 4], [2, 3, 4, 4], [3, 0, 4, 4]],
        _ => &[],
    }
}

/// Adds the segment, the triangle or the two triangles of a face. A quadrilateral is cut from its lowest tag, so that it has the same triangles
/// seen from both sides.
fn add_simplices<const D: usize>(mut face: [u64; 4], simplices: &mut Vec<[u64; D]>) {
    let lowest = (0..4).min_by_key(|&i| face[i]).filter(|_| D == 3);
    face.rotate_left(lowest.unwrap_or(0));
    let halves = [[0, 1, 2], [0, 2, 3]].map(|corners| std::array::from_fn(|k| face[corners[k]]));
    let has_extent = |simplex: &[u64; D]| (0..D).all(|k| simplex[k] != simplex[(k + 1) % D]);
    simplices.extend(halves.into_iter().take(D - 1).filter(has_extent));
}

/// The simplices that belong to one element only.
fn boundary<const D: usize>(simplices: Vec<[u64; D]>) -> Vec<[u64; D]> {
    let mut alone = BTreeMap::new();
    for simplex in simplices {
        let mut tags = simplex;
        tags.sort_unstable();
        if alone.remove(&tags).is_none() {
            alone.insert(tags, simplex);
        }
    }
    alone.into_values().collect()
}

/// The polygon inside edges, each with the inside at the left.
fn polygon<const D: usize>(vertices: &[Vector<f64, D>], edges: &[[u32; D]]) -> Result<Shape<D>, String> {
    if edges.len() > MAX_EDGES {
        return Err(format!("{} edges around it; at most {MAX_EDGES} are allowed", edges.len()));
    }
    let at = |i: u32| vertices.get(i as usize).copied().unwrap_or_else(Vector::zeros);
    let place = |i: u32| format!("at {:?}", at(i).as_slice());
    let mut next = BTreeMap::new();
    for edge in edges {
        if next.insert(edge[0], edge[1]).is_some() {
            return Err(format!("an outline that meets itself {}", place(edge[0])));
        }
    }
    let mut outlines = Vec::new();
    while let Some((first, mut end)) = next.pop_first() {
        let mut outline = vec![at(first)];
        while end != first {
            outline.push(at(end));
            end = next.remove(&end).ok_or_else(|| format!("an outline that does not go on {}", place(end)))?;
        }
        outlines.push(outline);
    }
    let place =
        |vertex: usize| outlines.concat().get(vertex).map_or(String::new(), |x| format!(", at {:?}", x.as_slice()));
    let wrong = |error: PolygonError| format!("{error}{}", error.vertex().map_or(String::new(), place));
    Ok(Polygon::of_outlines(&outlines).map_err(wrong)?.into())
}
