//! Regions of space in a scene.

use crate::problems::{MOST, Number, Problems};
use crate::shape;
use crate::tensor::Vector;
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
        /// The normal that points out of the region, of any length but zero.
        normal: Vec<f64>,
    },
    /// What lies in any of these, at least one.
    Union(Vec<Shape>),
    /// What lies in one and not in another: a solid with a hole.
    Difference {
        /// The solid.
        of: Box<Shape>,
        /// The hole.
        minus: Box<Shape>,
    },
    /// What lies in all of these, at least one.
    Intersection(Vec<Shape>),
}

impl Shape {
    /// The geometry; `None` unless every vector has `D` components.
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
        Some(match self {
            Self::Box { min, max } => shape::Shape::Box { min: vector(min)?, max: vector(max)? },
            Self::Ball { center, radius } => shape::Shape::Ball { center: vector(center)?, radius: *radius },
            Self::HalfSpace { point, normal } => {
                shape::Shape::HalfSpace { point: vector(point)?, normal: vector(normal)? }
            }
            Self::Union(parts) => shape::Shape::Union(all(parts)?),
            Self::Difference { of, minus } => {
                shape::Shape::Difference { of: Box::new(of.build()?), minus: Box::new(minus.build()?) }
            }
            Self::Intersection(parts) => shape::Shape::Intersection(all(parts)?),
        })
    }

    /// Whether the shape is sound.
    pub(super) fn check(&self, problems: &mut Problems, path: &str, dimension: usize) -> bool {
        match self {
            Self::Box { min, max } => {
                let path = format!("{path}.box");
                let mut ok = problems.vector(&format!("{path}.min"), min, dimension);
                ok &= problems.vector(&format!("{path}.max"), max, dimension);
                for (k, (&min, &max)) in min.iter().zip(max).enumerate().filter(|_| ok) {
                    let allowed = format!("must be greater than min[{k}] = {}", Number(min));
                    problems.require(max > min, &format!("{path}.max[{k}]"), Number(max), allowed);
                }
                ok && min.iter().zip(max).all(|(min, max)| max > min)
            }
            Self::Ball { center, radius } => {
                let ok = problems.vector(&format!("{path}.ball.center"), center, dimension);
                problems.positive(&format!("{path}.ball.radius"), *radius) && ok
            }
            Self::HalfSpace { point, normal } => {
                let ok = problems.vector(&format!("{path}.half_space.point"), point, dimension);
                check_normal(problems, &format!("{path}.half_space.normal"), normal, dimension) && ok
            }
            Self::Union(parts) => check_parts(parts, problems, &format!("{path}.union"), dimension),
            Self::Intersection(parts) => check_parts(parts, problems, &format!("{path}.intersection"), dimension),
            Self::Difference { of, minus } => {
                let ok = of.check(problems, &format!("{path}.difference.of"), dimension);
                minus.check(problems, &format!("{path}.difference.minus"), dimension) && ok
            }
        }
    }
}

fn check_parts(parts: &[Shape], problems: &mut Problems, path: &str, dimension: usize) -> bool {
    let mut ok = (1..=MOST).contains(&parts.len());
    problems.require(!parts.is_empty(), path, "an empty list", "must have at least one shape");
    for (i, part) in problems.few(path, parts).iter().enumerate() {
        ok &= part.check(problems, &format!("{path}[{i}]"), dimension);
    }
    ok
}

/// A direction: its largest component between 1e-100 and 1e100 in size, so that its length is a number.
pub(super) fn check_normal(problems: &mut Problems, path: &str, normal: &[f64], dimension: usize) -> bool {
    if !problems.vector(path, normal, dimension) {
        return false;
    }
    let largest = normal.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    let ok = largest >= 1e-100;
    problems.require(ok, path, "the zero vector", "must have a direction");
    ok
}

/// The components as a vector of `D`, if there are `D`.
pub(super) fn vector<const D: usize>(components: &[f64]) -> Option<Vector<f64, D>> {
    (components.len() == D).then(|| Vector::from_column_slice(components))
}
