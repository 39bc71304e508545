//! Boundary conditions at the faces of the box, and prescribed motion inside the box.

use super::curve::{Curve, check_times};
use super::free::Free;
use super::shape::Shape;
use super::vector::check_axis;
use crate::problems::{Number, Problems};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The boundary condition of each face of the box. Faces that the dimension lacks must not be named.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Boundary {
    /// The face at the lower end of x. Default: free.
    pub left: Option<Face>,
    /// The face at the upper end of x. Default: free.
    pub right: Option<Face>,
    /// The face at the lower end of y. Default: free.
    pub bottom: Option<Face>,
    /// The face at the upper end of y. Default: free.
    pub top: Option<Face>,
    /// The face at the lower end of z. Default: free.
    pub back: Option<Face>,
    /// The face at the upper end of z. Default: free.
    pub front: Option<Face>,
}

/// The boundary condition of the nodes of a face.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Face {
    /// All components are free.
    Free,
    /// The normal component is held, and the nodes slide along the face.
    Sliding,
    /// All components are held.
    Fixed,
    /// One entry per component: `true` is held, `false` is free.
    Held(Vec<bool>),
    /// Displacements since t = 0 (length) from a table; constant after the last row.
    Displacement(Table),
    /// Velocities from a table; constant after the last row.
    Velocity(Table),
    /// Rotation about an axis.
    Rotation(Rotation),
}

/// A motion as rows `[t, [x, y, …]]`, linear in between, from t = 0 on, or along a direction by a curve. A component that is null in every
/// row, or in the direction, is free.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Table {
    /// Rows `[t, [x, y, …]]`, linear in between, from t = 0 on.
    Rows(Vec<Row>),
    /// A direction times a curve, such as a sine, or the ground motion of a file.
    Along(Along),
}

/// A direction times a curve.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Along {
    /// The direction, of any length. A component that is null is free.
    pub direction: Vec<Option<f64>>,
    /// The factor in time.
    pub curve: Curve,
}

/// One row of a table: a time, and the prescribed components at that time.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
pub struct Row(pub f64, pub Vec<Option<f64>>);

/// Motion of the nodes inside a region, given by exactly one of `displacement`, `velocity` and `rotation`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Prescribed {
    /// The region. The motion applies to the nodes that lie in the region at t = 0.
    pub region: Shape,
    /// A table of displacements since t = 0 (length); constant after the last row.
    pub displacement: Option<Table>,
    /// A table of velocities; constant after the last row.
    pub velocity: Option<Table>,
    /// A rotation. The region stays in place, and the nodes in it rotate. Where the grid is reset (`grid.reset`), the region should be
    /// rotationally symmetric about the axis.
    pub rotation: Option<Rotation>,
}

/// A rotation about a fixed axis (2D and 3D). The torque is in `reactions.csv`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    /// A point of the axis.
    pub center: Vec<f64>,
    /// The direction of the axis, of any length but zero (3D only; in 2D the axis is z).
    pub axis: Option<Vec<f64>>,
    /// The angle (radians) as rows `[t, angle]`, counterclockwise where the axis points at the reader. The angle is linear in between and
    /// constant outside, and starts from 0 at t = 0.
    pub angle: Curve,
}

/// A motion that a scene gives.
#[derive(Clone, Copy)]
pub(super) enum GivenMotion<'a> {
    Displacement(&'a Table),
    Velocity(&'a Table),
    Rotation(&'a Rotation),
}

impl<'a> GivenMotion<'a> {
    /// The motions that are given by the keys `displacement`, `velocity` and `rotation`.
    pub(super) fn all(
        displacement: &'a Option<Table>,
        velocity: &'a Option<Table>,
        rotation: &'a Option<Rotation>,
    ) -> Vec<Self> {
        let tables = displacement.iter().map(Self::Displacement).chain(velocity.iter().map(Self::Velocity));
        tables.chain(rotation.iter().map(Self::Rotation)).collect()
    }

    fn key(self) -> &'static str {
        match self {
            Self::Displacement(_) => "displacement",
            Self::Velocity(_) => "velocity",
            Self::Rotation(_) => "rotation",
        }
    }

    /// Whether the motion is not at rest throughout.
    pub(super) fn moves(self) -> bool {
        match self {
            Self::Displacement(table) | Self::Velocity(table) => table.moves(),
            Self::Rotation(rotation) => rotation.angle.moves(),
        }
    }

    /// The curve of the motion, with its path.
    pub(super) fn curve(self, path: &str) -> Option<(String, &'a Curve)> {
        let path = format!("{path}.{}", self.key());
        match self {
            Self::Displacement(Table::Along(along)) | Self::Velocity(Table::Along(along)) => {
                Some((format!("{path}.curve"), &along.curve))
            }
            Self::Displacement(Table::Rows(_)) | Self::Velocity(Table::Rows(_)) => None,
            Self::Rotation(rotation) => Some((format!("{path}.angle"), &rotation.angle)),
        }
    }

    fn check(self, problems: &mut Problems, path: &str, dimension: usize) {
        let path = format!("{path}.{}", self.key());
        match self {
            Self::Displacement(table) => {
                table.check(problems, &path, dimension);
                table.check_start(problems, &path);
            }
            Self::Velocity(table) => table.check(problems, &path, dimension),
            Self::Rotation(rotation) => rotation.check(problems, &path, dimension),
        }
    }
}

/// Checks motions and a free obstacle, of which at most one may be given.
pub(super) fn check_motions(
    given: &[GivenMotion<'_>],
    free: Option<&Free>,
    problems: &mut Problems,
    path: &str,
    dimension: usize,
) {
    given.iter().for_each(|motion| motion.check(problems, path, dimension));
    if let Some(free) = free {
        free.check(problems, &format!("{path}.free"), dimension);
    }
    let keys: Vec<_> = given.iter().map(|motion| motion.key()).chain(free.map(|_| "free")).collect();
    problems.require(keys.len() < 2, path, keys.join(" and "), "give one of them");
}

impl Face {
    /// The motion, if the nodes have one.
    pub(super) fn given(&self) -> Option<GivenMotion<'_>> {
        match self {
            Self::Displacement(table) => Some(GivenMotion::Displacement(table)),
            Self::Velocity(table) => Some(GivenMotion::Velocity(table)),
            Self::Rotation(rotation) => Some(GivenMotion::Rotation(rotation)),
            Self::Free | Self::Sliding | Self::Fixed | Self::Held(_) => None,
        }
    }

    fn check(&self, problems: &mut Problems, path: &str, dimension: usize) {
        if let Self::Held(held) = self {
            problems.length(&format!("{path}.held"), held.len(), dimension);
        }
        if let Some(motion) = self.given() {
            motion.check(problems, path, dimension);
        }
    }
}

impl Boundary {
    /// The condition at the lower (`false`) or upper (`true`) face of an axis.
    pub(super) fn face(&self, axis: usize, upper: bool) -> &Face {
        self.faces()[2 * axis + usize::from(upper)].1.unwrap_or(&Face::Free)
    }

    /// All faces by name, lower and upper, axis after axis.
    pub(super) fn faces(&self) -> [(&'static str, Option<&Face>); 6] {
        let Self { left, right, bottom, top, back, front } = self;
        let named =
            [("left", left), ("right", right), ("bottom", bottom), ("top", top), ("back", back), ("front", front)];
        named.map(|(name, face)| (name, face.as_ref()))
    }

    pub(super) fn check(&self, problems: &mut Problems, dimension: usize) {
        for (i, (name, face)) in self.faces().into_iter().enumerate() {
            let Some(face) = face else { continue };
            let path = format!("boundary.{name}");
            if i < 2 * dimension {
                face.check(problems, &path, dimension);
            } else {
                problems.refuse(&path, "a condition", format!("a grid of {dimension} dimension(s) has no such face"));
            }
        }
    }
}

impl Prescribed {
    pub(super) fn check(&self, problems: &mut Problems, path: &str, dimension: usize) {
        self.region.check(problems, &format!("{path}.region"), dimension);
        let given = self.given();
        check_motions(&given, None, problems, path, dimension);
        let allowed = "give its displacement, its velocity or its rotation";
        problems.require(!given.is_empty(), path, "a region alone", allowed);
    }

    /// All given motions; a checked scene has exactly one.
    pub(super) fn given(&self) -> Vec<GivenMotion<'_>> {
        GivenMotion::all(&self.displacement, &self.velocity, &self.rotation)
    }
}

impl Rotation {
    fn check(&self, problems: &mut Problems, path: &str, dimension: usize) {
        problems.vector(&format!("{path}.center"), &self.center, dimension);
        check_axis(problems, path, self.axis.as_deref(), dimension);
        let path = format!("{path}.angle");
        self.angle.check(problems, &path);
        if let Curve::Rows(rows) = &self.angle {
            if let Some([t, angle]) = rows.first().filter(|first| **first != [0.0, 0.0]) {
                let allowed = "must be [0, 0]: angles are counted from the start";
                problems.refuse(&format!("{path}[0]"), format!("[{}, {}]", Number(*t), Number(*angle)), allowed);
            }
        } else {
            self.angle.check_start(problems, &path, "angles are counted");
        }
    }
}

impl Table {
    /// Whether the motion is not at rest throughout.
    fn moves(&self) -> bool {
        match self {
            Self::Rows(rows) => rows.iter().flat_map(|row| row.1.iter().flatten()).any(|x| *x != 0.0),
            Self::Along(Along { direction, curve }) => direction.iter().flatten().any(|x| *x != 0.0) && curve.moves(),
        }
    }

    fn check(&self, problems: &mut Problems, path: &str, dimension: usize) {
        match self {
            Self::Rows(rows) => check_rows(rows, problems, path, dimension),
            Self::Along(along) => along.check(problems, path, dimension),
        }
    }

    /// Refuses displacements that do not start from zero.
    fn check_start(&self, problems: &mut Problems, path: &str) {
        let rows = match self {
            Self::Rows(rows) => rows,
            Self::Along(along) => {
                return along.curve.check_start(problems, &format!("{path}.curve"), "displacements are counted");
            }
        };
        let first = rows.first().into_iter().flat_map(|row| row.1.iter().enumerate());
        for (k, start) in first.filter_map(|(k, start)| Some((k, (*start)?))) {
            let allowed = "must be 0: displacements are counted from the start";
            problems.require(start == 0.0, &format!("{path}[0][1][{k}]"), Number(start), allowed);
        }
    }
}

impl Along {
    fn check(&self, problems: &mut Problems, path: &str, dimension: usize) {
        self.curve.check(problems, &format!("{path}.curve"));
        let path = format!("{path}.direction");
        if !problems.length(&path, self.direction.len(), dimension) {
            return;
        }
        for (k, component) in self.direction.iter().enumerate() {
            problems.number(&format!("{path}[{k}]"), *component);
        }
        let some = self.direction.iter().any(Option::is_some);
        problems.require(some, &path, "a direction without numbers", "must prescribe at least one component");
    }
}

fn check_rows(rows: &[Row], problems: &mut Problems, path: &str, dimension: usize) {
    check_times(problems, path, rows.iter().map(|row| row.0));
    let Some(Row(start, first)) = rows.first() else { return };
    let allowed = "must be 0: the table starts with the simulation";
    problems.require(*start == 0.0, &format!("{path}[0][0]"), Number(*start), allowed);
    for (i, Row(_, row)) in rows.iter().enumerate() {
        if !problems.length(&format!("{path}[{i}][1]"), row.len(), dimension) {
            continue;
        }
        for (k, component) in row.iter().enumerate() {
            let path = format!("{path}[{i}][1][{k}]");
            problems.number(&path, *component);
            let as_first = first.get(k).is_none_or(|start| start.is_some() == component.is_some());
            let found = component.map_or("null".to_owned(), |x| Number(x).to_string());
            problems.require(as_first, &path, found, "a component must be null in every row or in none");
        }
    }
    let some = first.iter().any(Option::is_some);
    problems.require(some, &format!("{path}[0][1]"), "a row without numbers", "must prescribe at least one component");
}
