//! Regions of space in a scene.

use crate::problems::{MOST, Number, Problems};
use crate::shape;
use crate::tensor::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A region of space.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// An axis-parallel box (an interval in 1D, a rectangle in 2D).
    Box(Corners),
    /// A ball (an interval in 1D, a disc in 2D).
    Ball(Ball),
    /// Everything behind a plane.
    HalfSpace(HalfSpace),
    /// What lies in any of these, at least one.
    Union(Vec<Shape>),
    /// What lies in one and not in another.
    Difference(Difference),
    /// What lies in all of these, at least one.
    Intersection(Vec<Shape>),
}

/// Two corners of a box.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Corners {
    /// The lower corner (length).
    pub min: Vec<f64>,
    /// The upper corner (length), above `min` in every component.
    pub max: Vec<f64>,
}

/// A ball.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ball {
    /// The centre (length).
    pub center: Vec<f64>,
    /// The radius (length), > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: f64,
}

/// Everything behind a plane. A body of this shape is clipped to the grid's box.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HalfSpace {
    /// A point of the plane (length).
    pub point: Vec<f64>,
    /// The normal that points out of the region, of any length but zero.
    pub normal: Vec<f64>,
}

/// A solid with a hole.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Difference {
    /// The solid.
    pub of: Box<Shape>,
    /// The hole.
    pub minus: Box<Shape>,
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
            Self::Box(corners) => shape::Shape::Box { min: vector(&corners.min)?, max: vector(&corners.max)? },
            Self::Ball(ball) => shape::Shape::Ball { center: vector(&ball.center)?, radius: ball.radius },
            Self::HalfSpace(half) => {
                shape::Shape::HalfSpace { point: vector(&half.point)?, normal: vector(&half.normal)? }
            }
            Self::Union(parts) => shape::Shape::Union(all(parts)?),
            Self::Difference(parts) => {
                shape::Shape::Difference { of: Box::new(parts.of.build()?), minus: Box::new(parts.minus.build()?) }
            }
            Self::Intersection(parts) => shape::Shape::Intersection(all(parts)?),
        })
    }

    /// Whether the shape is sound.
    pub(super) fn check(&self, problems: &mut Problems, path: &str, dimension: usize) -> bool {
        match self {
            Self::Box(Corners { min, max }) => {
                let path = format!("{path}.box");
                let mut ok = problems.vector(&format!("{path}.min"), min, dimension);
                ok &= problems.vector(&format!("{path}.max"), max, dimension);
                for (k, (&min, &max)) in min.iter().zip(max).enumerate().filter(|_| ok) {
                    let allowed = format!("must be greater than min[{k}] = {}", Number(min));
                    problems.require(max > min, &format!("{path}.max[{k}]"), Number(max), allowed);
                }
                ok && min.iter().zip(max).all(|(min, max)| max > min)
            }
            Self::Ball(Ball { center, radius }) => {
                let ok = problems.vector(&format!("{path}.ball.center"), center, dimension);
                problems.positive(&format!("{path}.ball.radius"), *radius) && ok
            }
            Self::HalfSpace(HalfSpace { point, normal }) => {
                let ok = problems.vector(&format!("{path}.half_space.point"), point, dimension);
                check_normal(problems, &format!("{path}.half_space.normal"), normal, dimension) && ok
            }
            Self::Union(parts) => check_parts(parts, problems, &format!("{path}.union"), dimension),
            Self::Intersection(parts) => check_parts(parts, problems, &format!("{path}.intersection"), dimension),
            Self::Difference(Difference { of, minus }) => {
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
