//! Regions of space in a scene.

use super::image_file::ImageFile;
use super::shape_file::ShapeFile;
use super::surface_file::SurfaceFile;
use super::vector::{check_normal, vector};
use crate::problems::{LARGEST, MOST, Number, Problems};
use crate::shape::{self, EDGE, PolygonError, rotation};
use crate::tensor::{Tensor, Vector, identity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
}

impl Shape {
    /// The geometry; `None` unless every vector has `D` components and [`Scene::check`](super::Scene::check) finds nothing wrong.
    ///
    /// ```
    /// use bfree::scene::shape::Shape;
    /// use bfree::tensor::Vector;
    ///
    /// let ring = r#"{"difference": {"of": {"ball": {"center": [0, 0], "radius": 2}}, "minus": {"ball": {"center": [0, 0], "radius": 1}}}}"#;
    /// let ring: Shape = serde_json::from_str(ring)?;
    /// let solid = ring.build::<2>().ok_or("plane")?;
    /// assert_eq!(solid.signed_distance(&Vector::from([1.25, 0.0])), -0.25);
    /// // A disc is no ball.
    /// assert!(ring.build::<3>().is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn build<const D: usize>(&self) -> Option<shape::Shape<D>> {
        let all = |parts: &[Self]| parts.iter().map(Self::build).collect::<Option<Vec<_>>>();
        let part = |part: &Self| part.build().map(Box::new);
        Some(match self {
            Self::Box { min, max } => shape::Block { min: vector(min)?, max: vector(max)? }.into(),
            Self::Ball { center, radius } => shape::Ball { center: vector(center)?, radius: *radius }.into(),
            Self::HalfSpace { point, normal } => {
                shape::HalfSpace { point: vector(point)?, normal: vector(normal)? }.into()
            }
            Self::Polygon(vertices) => polygon::<D>(vertices)?.ok()?.into(),
            Self::Cylinder { from, to, radius } => cone(from, to, [*radius; 2])?.into(),
            Self::Cone { from, to, radii } => cone(from, to, *radii)?.into(),
            Self::Union(parts) => shape::Union(all(parts)?).into(),
            Self::Difference { of, minus } => shape::Difference { of: part(of)?, minus: part(minus)? }.into(),
            Self::Intersection(parts) => shape::Intersection(all(parts)?).into(),
            Self::Rotated { of, about, angle, axis } => {
                let axis = axis.as_ref().map(|axis| vector(axis).ok_or(())).transpose().ok()?;
                let rotation = rotation(*angle, axis.as_ref())?;
                similar(of.build()?, vector(about)?, rotation, 1.0)
            }
            Self::Scaled { of, about, factor } => similar(of.build()?, vector(about)?, identity(), *factor),
            Self::Surface(file) => file.surface.get()?.in_dimension()?.into(),
            Self::Image(file) => file.solid()?.into(),
        })
    }

    /// Checks the shape, and returns whether it is allowed.
    pub(super) fn check(&self, problems: &mut Problems, path: &str, dimension: usize) -> bool {
        match self {
            Self::Box { min, max } => check_box(min, max, problems, &format!("{path}.box"), dimension),
            Self::Ball { center, radius } => {
                let ok = problems.vector(&format!("{path}.ball.center"), center, dimension);
                problems.positive(&format!("{path}.ball.radius"), *radius) && ok
            }
            Self::HalfSpace { point, normal } => {
                let ok = problems.vector(&format!("{path}.half_space.point"), point, dimension);
                check_normal(problems, &format!("{path}.half_space.normal"), normal, dimension) && ok
            }
            Self::Polygon(vertices) => check_polygon(vertices, problems, &format!("{path}.polygon"), dimension),
            Self::Cylinder { from, to, radius } => {
                let path = format!("{path}.cylinder");
                let ok = problems.positive(&format!("{path}.radius"), *radius);
                check_axis(from, to, *radius, problems, &path, dimension) && ok
            }
            Self::Cone { from, to, radii } => {
                let path = format!("{path}.cone");
                let ok = check_radii(*radii, problems, &format!("{path}.radii"));
                check_axis(from, to, radii[0].max(radii[1]), problems, &path, dimension) && ok
            }
            Self::Union(parts) => check_parts(parts, problems, &format!("{path}.union"), dimension),
            Self::Difference { of, minus } => {
                let ok = of.check(problems, &format!("{path}.difference.of"), dimension);
                minus.check(problems, &format!("{path}.difference.minus"), dimension) && ok
            }
            Self::Intersection(parts) => check_parts(parts, problems, &format!("{path}.intersection"), dimension),
            Self::Rotated { of, about, angle, axis } => {
                let path = format!("{path}.rotated");
                let mut ok = of.check(problems, &format!("{path}.of"), dimension);
                ok &= problems.vector(&format!("{path}.about"), about, dimension);
                ok &= problems.number(&format!("{path}.angle"), *angle);
                ok && check_rotation_axis(axis.as_deref(), problems, &path, dimension)
            }
            Self::Scaled { of, about, factor } => {
                let path = format!("{path}.scaled");
                let mut ok = of.check(problems, &format!("{path}.of"), dimension);
                ok &= problems.vector(&format!("{path}.about"), about, dimension);
                problems.positive(&format!("{path}.factor"), *factor) && ok
            }
            Self::Surface(file) => check_surface(file, problems, &format!("{path}.surface"), dimension),
            Self::Image(file) => file.check(problems, &format!("{path}.image"), dimension),
        }
    }

    /// Whether pixels are part of the shape.
    pub(super) fn has_pixels(&self) -> bool {
        let mut any = false;
        let _ = self.each_file("", &mut |_, file| {
            any |= matches!(file, ShapeFile::Image(_));
            Ok::<(), ()>(())
        });
        any
    }

    /// Visits the files of the shape, each with its path in the scene.
    pub(super) fn each_file<E>(
        &self,
        path: &str,
        visit: &mut impl FnMut(&str, ShapeFile<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut all = |parts: &[Self], key: &str| {
            let mut parts = parts.iter().enumerate();
            parts.try_for_each(|(i, part)| part.each_file(&format!("{path}.{key}[{i}]"), visit))
        };
        match self {
            Self::Union(parts) => all(parts, "union"),
            Self::Intersection(parts) => all(parts, "intersection"),
            Self::Difference { of, minus } => {
                of.each_file(&format!("{path}.difference.of"), visit)?;
                minus.each_file(&format!("{path}.difference.minus"), visit)
            }
            Self::Rotated { of, .. } => of.each_file(&format!("{path}.rotated.of"), visit),
            Self::Scaled { of, .. } => of.each_file(&format!("{path}.scaled.of"), visit),
            Self::Surface(file) => visit(&format!("{path}.surface.file"), ShapeFile::Surface(file)),
            Self::Image(file) => visit(&format!("{path}.image.file"), ShapeFile::Image(file)),
            Self::Box { .. } | Self::Ball { .. } | Self::HalfSpace { .. } => Ok(()),
            Self::Polygon(_) | Self::Cylinder { .. } | Self::Cone { .. } => Ok(()),
        }
    }
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

fn refused(problems: &mut Problems, path: &str, value: &str, allowed: &str) -> bool {
    problems.refuse(path, value, allowed);
    false
}

/// The polygon, or the reason why it is not allowed; `None` unless every vertex has `D` components.
fn polygon<const D: usize>(vertices: &[Vec<f64>]) -> Option<Result<shape::Polygon<D>, PolygonError>> {
    let vertices = vertices.iter().map(|x| vector(x)).collect::<Option<Vec<_>>>()?;
    Some(shape::Polygon::new(vertices))
}

fn cone<const D: usize>(from: &[f64], to: &[f64], radii: [f64; 2]) -> Option<shape::Cone<D>> {
    shape::Cone::new([vector(from)?, vector(to)?], radii)
}

fn check_box(min: &[f64], max: &[f64], problems: &mut Problems, path: &str, dimension: usize) -> bool {
    let mut ok = problems.vector(&format!("{path}.min"), min, dimension);
    ok &= problems.vector(&format!("{path}.max"), max, dimension);
    if !ok {
        return false;
    }
    for (k, (&min, &max)) in min.iter().zip(max).enumerate() {
        let allowed = format!("must be greater than min[{k}] = {}", Number(min));
        problems.require(max > min, &format!("{path}.max[{k}]"), Number(max), allowed);
        ok &= max > min;
    }
    ok
}

/// Checks the radii of a cone. One of them may be 0.
fn check_radii(radii: [f64; 2], problems: &mut Problems, path: &str) -> bool {
    let mut ok = true;
    for (i, radius) in radii.into_iter().enumerate() {
        ok &= problems.between(&format!("{path}[{i}]"), radius, 0.0, LARGEST);
    }
    if ok && radii == [0.0, 0.0] {
        return refused(problems, path, "[0, 0]", "one of the two must be > 0");
    }
    ok
}

/// Checks the axis of a rotated shape: needed in 3D, and not allowed in 2D.
fn check_rotation_axis(axis: Option<&[f64]>, problems: &mut Problems, path: &str, dimension: usize) -> bool {
    let axis_path = format!("{path}.axis");
    match (axis, dimension) {
        (Some(axis), 3) => check_normal(problems, &axis_path, axis, dimension),
        (None, 2) => true,
        (None, 3) => refused(problems, path, "a rotation without an axis", "give its \"axis\", a direction"),
        (Some(_), 2) => refused(problems, &axis_path, "an axis", "in 2 dimensions it is the third: remove it"),
        _ => refused(problems, path, "a rotation", "a line has no directions to turn in"),
    }
}

fn check_surface(surface: &SurfaceFile, problems: &mut Problems, path: &str, dimension: usize) -> bool {
    if dimension != 3 {
        let allowed = format!("it needs a grid of 3 dimensions, and this one has {dimension}");
        return refused(problems, path, "a surface", &allowed);
    }
    if !surface.has_format() {
        let value = format!("{:?}", surface.file);
        return refused(problems, &format!("{path}.file"), &value, "must end in .stl or .ply");
    }
    true
}

fn check_polygon(vertices: &[Vec<f64>], problems: &mut Problems, path: &str, dimension: usize) -> bool {
    if dimension != 2 {
        let allowed = format!("it needs a grid of 2 dimensions, and this one has {dimension}");
        return refused(problems, path, "a polygon", &allowed);
    }
    let mut ok = vertices.len() <= MOST;
    for (i, vertex) in problems.few(path, vertices).iter().enumerate() {
        ok &= problems.vector(&format!("{path}[{i}]"), vertex, dimension);
    }
    match polygon::<2>(vertices).filter(|_| ok) {
        Some(Err(error)) => {
            let path = error.vertex().map_or(path.to_owned(), |vertex| format!("{path}[{vertex}]"));
            refused(problems, &path, &error.to_string(), PolygonError::ALLOWED)
        }
        Some(Ok(_)) => true,
        None => false,
    }
}

/// Checks the two ends of a cylinder or cone.
fn check_axis(from: &[f64], to: &[f64], radius: f64, problems: &mut Problems, path: &str, dimension: usize) -> bool {
    if dimension < 2 {
        return refused(problems, path, "a solid around an axis", "a line has none: use a box");
    }
    let mut ok = problems.vector(&format!("{path}.from"), from, dimension);
    ok &= problems.vector(&format!("{path}.to"), to, dimension);
    let length = from.iter().zip(to).map(|(a, b)| (b - a) * (b - a)).sum::<f64>().sqrt();
    if ok && length <= EDGE * radius {
        let allowed = "must differ from `from`: the two give the axis";
        return refused(problems, &format!("{path}.to"), &format!("{to:?}"), allowed);
    }
    ok
}

fn check_parts(parts: &[Shape], problems: &mut Problems, path: &str, dimension: usize) -> bool {
    let mut ok = (1..=MOST).contains(&parts.len());
    problems.require(!parts.is_empty(), path, "an empty list", "must have at least one shape");
    for (i, part) in problems.few(path, parts).iter().enumerate() {
        ok &= part.check(problems, &format!("{path}[{i}]"), dimension);
    }
    ok
}
