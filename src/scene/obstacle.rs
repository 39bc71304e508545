//! Rigid obstacles.

use super::boundary::{GivenMotion, Rotation, Table, check_motions};
use super::free::Free;
use super::shape::Shape;
use crate::mechanics::loads::ContactConstants;
use crate::problems::Problems;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A rigid obstacle. The surfaces of all bodies touch the obstacle without adhesion, with a one-sided penalty and Coulomb friction. The
/// obstacle rests, has the motion given by one of `displacement`, `velocity` and `rotation`, or moves freely with the key `free`. Force, moment, area, work and friction loss of every step are in
/// `obstacles.csv`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Obstacle {
    /// The unique name of the obstacle in output.
    pub name: String,
    /// The shape at t = 0. The shape may reach beyond the grid.
    pub shape: Shape,
    /// The coefficient of friction, 0 to 100. The tangent with friction is exact and unsymmetric. Default: 0.
    #[serde(default)]
    #[schemars(range(min = 0, max = 100))]
    pub friction: f64,
    /// The penalty stiffness, > 0: the pressure at a depth of one grid spacing, in units of Λ + 2G of the body, or of 4G where that is less.
    /// Default: 1; with inertia at most 2 h/(c Δt), so that a contact lasts several steps. c is the largest √(M/ρ) of all bodies, with that
    /// modulus M.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub stiffness: Option<f64>,
    /// A table of displacements since t = 0 (length); constant after the last row. A component that is null rests.
    pub displacement: Option<Table>,
    /// A table of velocities; constant after the last row. A component that is null rests.
    pub velocity: Option<Table>,
    /// A rotation about a fixed axis.
    pub rotation: Option<Rotation>,
    /// Mass, for an obstacle that contact and gravity move.
    pub free: Option<Free>,
}

/// A larger stiffness gets a warning. At 100, the force of an impact rings with four times its value (`docs/src/obstacles.md`).
const STIFFEST: f64 = 100.0;

/// Checks the constants of contact.
pub(super) fn check_law(problems: &mut Problems, path: &str, friction: f64, stiffness: Option<f64>, dimension: usize) {
    problems.between(&format!("{path}.friction"), friction, 0.0, 100.0);
    let allowed = "must be 0: in one dimension nothing slides";
    problems.require(dimension > 1 || friction == 0.0, &format!("{path}.friction"), friction, allowed);
    problems.positive(&format!("{path}.stiffness"), stiffness);
}

/// A warning about a stiffness that gains nothing.
pub(super) fn too_stiff(path: &str, stiffness: Option<f64>) -> Option<String> {
    stiffness.filter(|stiffness| *stiffness > STIFFEST).map(|stiffness| {
        format!(
            "{path}.stiffness = {stiffness:e} is above {STIFFEST}: the depth is negligible below that already, and Newton's method and the \
             force get worse; lower it"
        )
    })
}

impl Obstacle {
    /// The constants of the law, with the default of its stiffness.
    pub(super) fn constants(&self, stiffness: f64) -> ContactConstants {
        ContactConstants { stiffness: self.stiffness.unwrap_or(stiffness), friction: self.friction }
    }

    /// All given motions; a checked scene has at most one.
    pub(super) fn given(&self) -> Vec<GivenMotion<'_>> {
        GivenMotion::all(&self.displacement, &self.velocity, &self.rotation)
    }

    /// A warning about an obstacle that nothing can touch, or whose stiffness gains nothing.
    pub(super) fn warning(&self, path: &str, apart: bool) -> Option<String> {
        if apart {
            return Some(format!("{path} rests outside the grid, and bodies stay inside it: nothing can touch it"));
        }
        too_stiff(path, self.stiffness)
    }

    pub(super) fn check(&self, problems: &mut Problems, path: &str, dimension: usize) {
        let name = format!("{path}.name");
        problems.require(!self.name.is_empty(), &name, "an empty name", "must have at least one letter");
        let printed = !self.name.contains(|c: char| c.is_control() || c == ',' || c == '"');
        let allowed = "must be of letters that can be printed, without commas and quotes";
        problems.require(printed, &name, format_args!("{:?}", self.name), allowed);
        if let Some([min, max]) = self.shape.check_solid(problems, &format!("{path}.shape"), dimension) {
            let empty = min.iter().zip(&max).any(|(min, max)| max < min);
            let allowed = "must hold something: its parts do not meet";
            problems.require(!empty, &format!("{path}.shape"), "an empty shape", allowed);
            let bounded = min.iter().chain(&max).all(|x| x.is_finite());
            let allowed = "must be bounded: an obstacle that moves freely has a mass";
            problems.require(bounded || self.free.is_none(), &format!("{path}.shape"), "an unbounded shape", allowed);
        }
        check_law(problems, path, self.friction, self.stiffness, dimension);
        check_motions(&self.given(), self.free.as_ref(), problems, path, dimension);
    }
}
