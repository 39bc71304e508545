//! Regions of space in a scene.

use super::BuildError;
use super::image_file::ImageFile;
use super::mesh_file::MeshFile;
use super::surface_file::SurfaceFile;
use super::vector::{self, check_axis, corners, direction};
use crate::grid::Grid;
use crate::problems::{LARGEST, MOST, Problems};
use crate::shape::{self, EDGE, PolygonError, rotation};
use crate::tensor::{Tensor, Vector, identity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A region of space.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// An axis-parallel box (an interval in 1D, a rectangle in 2D), by two corners.
    Box {
        /// The lower corner (length).
        min: Vec<f64>,
        /// The upper corner (length), above `min` in every component.
        max: Vec<f64>,
    },
    /// A ball (an interval in 1D, a disc in 2D).
    Ball {
        /// The centre (length).
        center: Vec<f64>,
        /// The radius (length), > 0.
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius: f64,
    },
    /// Everything behind a plane. A body of this shape is clipped to the grid's box.
    HalfSpace {
        /// A point of the plane (length).
        point: Vec<f64>,
        /// The outward normal of the region, of any length but zero.
        normal: Vec<f64>,
    },
    /// A polygon (2D only), by its vertices (length), at least 3, in either order. The polygon need not be convex, and is closed from the
    /// last vertex to the first. Edges meet only at the vertex that they share.
    Polygon(#[schemars(length(min = 3))] Vec<Vec<f64>>),
    /// A cylinder of any direction (in 2D an oblique rectangle).
    Cylinder {
        /// The centre of one end (length).
        from: Vec<f64>,
        /// The centre of the other end (length).
        to: Vec<f64>,
        /// The radius (length), > 0.
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius: f64,
    },
    /// A cone of any direction, with its tip or truncated (in 2D an oblique triangle or trapezium).
    Cone {
        /// The centre of one end (length).
        from: Vec<f64>,
        /// The centre of the other end (length).
        to: Vec<f64>,
        /// The radii (length) at `from` and at `to`, ≥ 0; one of them may be 0.
        radii: [f64; 2],
    },
    /// The union of these shapes, at least one.
    Union(Vec<Shape>),
    /// The part of one shape outside another: a solid with a hole.
    Difference {
        /// The solid.
        of: Box<Shape>,
        /// The hole.
        minus: Box<Shape>,
    },
    /// The intersection of these shapes, at least one.
    Intersection(Vec<Shape>),
    /// A shape rotated about a point (2D and 3D).
    Rotated {
        /// The original shape.
        of: Box<Shape>,
        /// The fixed point (length).
        about: Vec<f64>,
        /// The angle (degrees): counter-clockwise in 2D, by the right-hand rule about `axis` in 3D.
        angle: f64,
        /// The direction of the axis, of any length but zero (3D only).
        axis: Option<Vec<f64>>,
    },
    /// A shape scaled about a point.
    Scaled {
        /// The original shape.
        of: Box<Shape>,
        /// The fixed point (length).
        about: Vec<f64>,
        /// The factor (no unit), > 0, the same in all directions.
        #[schemars(extend("exclusiveMinimum" = 0))]
        factor: f64,
    },
    /// The inside of a closed surface of triangles, from a file (3D only). `scaled` converts a file in other units to the units of the
    /// scene.
    Surface(SurfaceFile),
    /// The pixels of a picture (2D) or the voxels of a scan (3D) whose value lies in a range; each is a box, and is cut exactly. The
    /// surface of the pixels is a staircase. Pressures on the staircase have the right resultant; tractions act on an area that is larger
    /// than that of the smooth surface.
    Image(ImageFile),
    /// A physical group of a mesh of Gmsh (2D and 3D). A physical volume (in 2D: surface) is a solid: the elements of the group. A physical
    /// surface (in 2D: curve) has no inside; it is the region of a load, which acts exactly on it, and of nodes held on a plane of the grid.
    Mesh(MeshFile),
}

impl Shape {
    /// The geometry; `None` unless every vector has `D` components and [`Scene::check`](super::Scene::check) finds nothing wrong.
    pub fn build<const D: usize>(&self) -> Option<shape::Shape<D>> {
        self.checked(&mut Problems::default(), "")
    }

    /// The geometry; an error for the key `path` if it has another dimension than `D`.
    pub(super) fn built<const D: usize>(&self, path: &str) -> Result<shape::Shape<D>, BuildError> {
        self.build().ok_or_else(|| BuildError::at(path, format!("does not fit {D} dimensions")))
    }

    /// The region of nodes, which lies in one plane of the grid if it has no inside: elsewhere, only nodes that lie in it by chance would be in it.
    pub(super) fn of_nodes<const D: usize>(&self, path: &str, grid: &Grid<D>) -> Result<shape::Shape<D>, BuildError> {
        let region = self.built(path)?;
        let (min, max) = region.bounding_box();
        let in_plane = |k: usize| {
            let [from, to] = [min, max].map(|x| (x[k] - grid.origin[k]) / grid.spacing);
            (from - from.round()).abs() <= EDGE && to - from <= EDGE
        };
        if self.has_sheet() && !(0..D).any(in_plane) {
            let what = "is a surface that does not lie in one plane of the grid, and so holds hardly any node: shift the mesh or the grid, give \
                        each plane an entry of its own, or take a physical group with an inside";
            return Err(BuildError::at(path, what));
        }
        Ok(region)
    }

    /// The result of [`Self::check`] for a solid, which has an inside.
    pub(super) fn check_solid(&self, problems: &mut Problems, path: &str, dimension: usize) -> Option<[Vec<f64>; 2]> {
        let allowed = format!("must have an inside: a physical group of {dimension} dimensions");
        problems.require(!self.has_sheet(), path, "a surface without an inside", allowed);
        self.check(problems, path, dimension)
    }

    /// The corners of the bounding box; `None` if the shape is not allowed, with the reasons in `problems`, and while its file has not been
    /// read.
    pub(super) fn check(&self, problems: &mut Problems, path: &str, dimension: usize) -> Option<[Vec<f64>; 2]> {
        in_dimensions!(dimension, D => self.checked::<D>(problems, path).map(bounds))
    }

    /// The geometry; `None` if it is not allowed, with the reasons in `problems`, and while its file has not been read.
    pub(super) fn checked<const D: usize>(&self, problems: &mut Problems, path: &str) -> Option<shape::Shape<D>> {
        let at = |key: &str| format!("{path}.{key}");
        Some(match self {
            Self::Box { min, max } => {
                let [min, max] = corners(problems, &at("box"), min, max)?;
                shape::Block { min, max }.into()
            }
            Self::Ball { center, radius } => {
                let center = vector::checked(problems, &at("ball.center"), center);
                let allowed = problems.positive(&at("ball.radius"), *radius);
                shape::Ball { center: center.filter(|_| allowed)?, radius: *radius }.into()
            }
            Self::HalfSpace { point, normal } => {
                let point = vector::checked(problems, &at("half_space.point"), point);
                let normal = direction(problems, &at("half_space.normal"), normal);
                shape::HalfSpace { point: point?, normal: normal? }.into()
            }
            Self::Polygon(vertices) => polygon(vertices, problems, &at("polygon"))?.into(),
            Self::Cylinder { from, to, radius } => {
                let allowed = problems.positive(&at("cylinder.radius"), *radius);
                cone(from, to, [*radius; 2], problems, &at("cylinder")).filter(|_| allowed)?.into()
            }
            Self::Cone { from, to, radii } => {
                let allowed = check_radii(*radii, problems, &at("cone.radii"));
                cone(from, to, *radii, problems, &at("cone")).filter(|_| allowed)?.into()
            }
            Self::Union(parts) => {
                let allowed = has_few(parts, problems, &at("union"));
                shape::Shape::union(self.checked_parts(problems, path).filter(|_| allowed)?)
            }
            Self::Intersection(parts) => {
                let allowed = has_few(parts, problems, &at("intersection"));
                shape::Shape::intersection(self.checked_parts(problems, path).filter(|_| allowed)?)
            }
            Self::Difference { .. } => {
                let [of, minus] = self.checked_parts(problems, path)?.try_into().ok()?;
                shape::Difference { of: Box::new(of), minus: Box::new(minus) }.into()
            }
            Self::Rotated { about, angle, axis, .. } => {
                let of = self.checked_parts(problems, path);
                let about = vector::checked(problems, &at("rotated.about"), about);
                let allowed = problems.number(&at("rotated.angle"), *angle)
                    & check_axis(problems, &at("rotated"), axis.as_deref(), D);
                let axis = axis.as_ref().filter(|_| allowed).map(|axis| vector::vector(axis));
                similar(of.filter(|_| allowed)?.pop()?, about?, rotation(*angle, axis.as_ref())?, 1.0)
            }
            Self::Scaled { about, factor, .. } => {
                let of = self.checked_parts(problems, path);
                let about = vector::checked(problems, &at("scaled.about"), about);
                let allowed = problems.positive(&at("scaled.factor"), *factor);
                similar(of?.pop()?, about.filter(|_| allowed)?, identity(), *factor)
            }
            Self::Surface(file) => surface(file, problems, &at("surface"))?.into(),
            Self::Image(file) => file.build(problems, &at("image"))?.into(),
            Self::Mesh(file) => file.build(problems, &at("mesh"))?,
        })
    }

    /// All parts, checked each.
    fn checked_parts<const D: usize>(&self, problems: &mut Problems, path: &str) -> Option<Vec<shape::Shape<D>>> {
        let checked = |(key, part): (String, &Self)| part.checked(problems, &format!("{path}.{key}"));
        let parts: Vec<_> = self.parts().into_iter().map(checked).collect();
        parts.into_iter().collect()
    }

    /// The shapes that this shape is made of, with their keys.
    fn parts(&self) -> Vec<(String, &Self)> {
        match self {
            Self::Union(parts) => numbered("union", parts),
            Self::Intersection(parts) => numbered("intersection", parts),
            Self::Difference { of, minus } => vec![("difference.of".into(), of), ("difference.minus".into(), minus)],
            Self::Rotated { of, .. } => vec![("rotated.of".into(), of)],
            Self::Scaled { of, .. } => vec![("scaled.of".into(), of)],
            _ => Vec::new(),
        }
    }

    /// Whether pixels are part of the shape.
    pub(super) fn has_pixels(&self) -> bool {
        matches!(self, Self::Image(_)) || self.parts().iter().any(|(_, part)| part.has_pixels())
    }

    /// Whether a surface without an inside is known to be part of the shape.
    fn has_sheet(&self) -> bool {
        matches!(self, Self::Mesh(mesh) if mesh.is_sheet()) || self.parts().iter().any(|(_, part)| part.has_sheet())
    }

    /// Reads the files of the shape from `folder`, for a scene of this dimension.
    pub(super) fn read_files(&self, path: &str, folder: &Path, dimension: usize) -> Result<(), BuildError> {
        let (key, file, read) = match self {
            Self::Surface(surface) => ("surface", &surface.file, surface.read(folder)),
            Self::Image(image) => ("image", &image.file, image.read(folder)),
            Self::Mesh(mesh) => ("mesh", &mesh.file, mesh.read(folder, dimension)),
            _ => {
                let mut parts = self.parts().into_iter();
                return parts.try_for_each(|(key, part)| part.read_files(&format!("{path}.{key}"), folder, dimension));
            }
        };
        let place = folder.join(file);
        read.map_err(|why| BuildError::at(format!("{path}.{key}.file"), format!("{} {why}", place.display())))
    }
}

fn bounds<const D: usize>(shape: shape::Shape<D>) -> [Vec<f64>; 2] {
    let (min, max) = shape.bounding_box();
    [min.as_slice().to_vec(), max.as_slice().to_vec()]
}

fn numbered<'a>(key: &str, parts: &'a [Shape]) -> Vec<(String, &'a Shape)> {
    parts.iter().take(MOST).enumerate().map(|(i, part)| (format!("{key}[{i}]"), part)).collect()
}

/// A solid, rotated and scaled. A surface of triangles stays a surface with moved vertices, which can still be cut for whole rows of boxes.
fn similar<const D: usize>(
    of: shape::Shape<D>,
    about: Vector<f64, D>,
    rotation: Tensor<f64, D>,
    factor: f64,
) -> shape::Shape<D> {
    match of {
        shape::Shape::Surface(surface) => surface.moved(&about, &rotation, factor).into(),
        of => shape::Similar { of: Box::new(of), about, rotation, factor }.into(),
    }
}

/// The polygon; `None` if it is not allowed, with the reasons in `problems`.
fn polygon<const D: usize>(vertices: &[Vec<f64>], problems: &mut Problems, path: &str) -> Option<shape::Polygon<D>> {
    if D != 2 {
        problems.refuse(path, "a polygon", format!("it needs a grid of 2 dimensions, and this one has {D}"));
        return None;
    }
    let checked = |(i, x): (usize, &Vec<f64>)| vector::checked(problems, &format!("{path}[{i}]"), x);
    let corners: Vec<_> = vertices.iter().take(MOST).enumerate().map(checked).collect();
    if problems.few(path, vertices).len() < vertices.len() {
        return None;
    }
    let refuse = |error: &PolygonError| {
        let path = error.vertex().map_or(path.to_owned(), |vertex| format!("{path}[{vertex}]"));
        problems.refuse(&path, error, PolygonError::ALLOWED);
    };
    shape::Polygon::new(corners.into_iter().collect::<Option<_>>()?).inspect_err(refuse).ok()
}

/// The cone around the axis between two ends; `None` if it is not allowed, with the reasons in `problems`.
fn cone<const D: usize>(
    from: &[f64],
    to: &[f64],
    radii: [f64; 2],
    problems: &mut Problems,
    path: &str,
) -> Option<shape::Cone<D>> {
    if D < 2 {
        problems.refuse(path, "a solid around an axis", "a line has none: use a box");
        return None;
    }
    let from = vector::checked::<D>(problems, &format!("{path}.from"), from);
    let to = vector::checked::<D>(problems, &format!("{path}.to"), to);
    let (from, to) = (from?, to?);
    if (to - from).norm() <= EDGE * radii[0].max(radii[1]) {
        let allowed = "must differ from `from`: the two give the axis";
        problems.refuse(&format!("{path}.to"), format!("{:?}", to.as_slice()), allowed);
    }
    shape::Cone::new([from, to], radii)
}

/// Checks the radii of a cone. One of them may be 0.
fn check_radii(radii: [f64; 2], problems: &mut Problems, path: &str) -> bool {
    let ok = [0, 1].map(|i| problems.between(&format!("{path}[{i}]"), radii[i], 0.0, LARGEST)) == [true; 2];
    problems.require(!ok || radii != [0.0, 0.0], path, "[0, 0]", "one of the two must be > 0");
    ok && radii != [0.0, 0.0]
}

/// The surface; `None` if it is not allowed, with the reason in `problems`, and while its file has not been read.
fn surface<const D: usize>(file: &SurfaceFile, problems: &mut Problems, path: &str) -> Option<shape::Surface<D>> {
    if D != 3 {
        problems.refuse(path, "a surface", format_args!("it needs a grid of 3 dimensions, and this one has {D}"));
        return None;
    }
    let path = format!("{path}.file");
    problems.require(file.has_format(), &path, format_args!("{:?}", file.file), "must end in .stl or .ply");
    file.surface.get()?.in_dimension()
}

/// Whether a union or an intersection has an allowed number of shapes.
fn has_few(parts: &[Shape], problems: &mut Problems, path: &str) -> bool {
    problems.require(!parts.is_empty(), path, "an empty list", "must have at least one shape");
    !problems.few(path, parts).is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_is_a_plane_shape() -> Result<(), Box<dyn std::error::Error>> {
        let [whole, hole] = [2, 1].map(|radius| format!(r#"{{"ball": {{"center": [0, 0], "radius": {radius}}}}}"#));
        let ring: Shape = serde_json::from_str(&format!(r#"{{"difference": {{"of": {whole}, "minus": {hole}}}}}"#))?;
        let solid = ring.build::<2>().ok_or("plane")?;
        assert_eq!(solid.signed_distance(&Vector::from([1.25, 0.0])), -0.25);
        assert!(ring.build::<3>().is_none());
        Ok(())
    }
}
