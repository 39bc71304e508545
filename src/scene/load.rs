//! Gravity, tractions and pressures.

use super::body::Body;
use super::curve::Curve;
use super::keys::nearest;
use super::shape::Shape;
use super::vector::check_normal;
use crate::problems::Problems;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Gravity: one acceleration for all bodies.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gravity {
    /// The acceleration (length / time²).
    pub acceleration: Vec<f64>,
    /// A factor in time. Default: 1.
    pub curve: Option<Curve>,
    /// A factor in space. Default: 1.
    pub profile: Option<Profile>,
}

/// A factor that varies along a straight line, evaluated at the particle's position at the beginning of a step.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// The direction of the line, of any length but zero: s = along · x / |along|.
    pub along: Vec<f64>,
    /// Rows `[s, factor]` (length, no unit), linear in between and constant outside.
    pub factor: Curve,
}

/// A force per reference area of constant direction. The force acts at points of the body's surface, one for each side of a particle's box
/// there. These points move with the body. Planes of symmetry (faces of the box that hold the normal component) are not part of the
/// surface.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Traction {
    /// The name of the body.
    pub body: String,
    /// The part of the surface that is loaded: the part inside this region. To load one face alone, give a `half_space` that begins on that
    /// face. A region that reaches below the face also loads the adjacent sides. (If `surface` is given, the particles in the region are
    /// loaded.) Default: the whole surface.
    pub region: Option<Shape>,
    /// The force per reference area (stress).
    pub traction: Vec<f64>,
    /// A factor in time. Default: 1.
    pub curve: Option<Curve>,
    /// Normal and area of particles that carry the load themselves. Needed for bodies read from a file; otherwise both follow from the
    /// shape.
    pub surface: Option<Surface>,
}

/// A pressure that follows the surface. The pressure acts at points of the body's surface, one for each side of a particle's box there.
/// These points move with the body. Planes of symmetry (faces of the box that hold the normal component) are not part of the surface.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pressure {
    /// The name of the body.
    pub body: String,
    /// The part of the surface that is loaded: the part inside this region. To load one face alone, give a `half_space` that begins on that
    /// face. A region that reaches below the face also loads the adjacent sides. (If `surface` is given, the particles in the region are
    /// loaded.) Default: the whole surface.
    pub region: Option<Shape>,
    /// The pressure on the deformed surface (stress); positive pushes inwards.
    pub pressure: f64,
    /// A factor in time. Default: 1.
    pub curve: Option<Curve>,
    /// Normal and area of particles that carry the load themselves. Needed for bodies read from a file; otherwise both follow from the
    /// shape.
    pub surface: Option<Surface>,
}

/// The piece of surface that each loaded particle represents.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Surface {
    /// The outward normal in the reference configuration, of any length but zero.
    pub normal: Vec<f64>,
    /// The reference area per particle (a length in 2D, 1 in 1D), > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub area: f64,
}

impl Gravity {
    pub(super) fn check(&self, problems: &mut Problems, dimension: usize) {
        problems.vector("gravity.acceleration", &self.acceleration, dimension);
        if let Some(curve) = &self.curve {
            curve.check(problems, "gravity.curve");
        }
        if let Some(profile) = &self.profile {
            check_normal(problems, "gravity.profile.along", &profile.along, dimension);
            profile.factor.check(problems, "gravity.profile.factor");
        }
    }
}

impl Traction {
    pub(super) fn loaded(&self) -> Loaded<'_> {
        let Self { body, region, traction, curve, surface } = self;
        Loaded { body, region, stress: Stress::Traction(traction), curve, surface }
    }
}

impl Pressure {
    pub(super) fn loaded(&self) -> Loaded<'_> {
        let Self { body, region, pressure, curve, surface } = self;
        Loaded { body, region, stress: Stress::Pressure(*pressure), curve, surface }
    }
}

/// A load on a surface: a traction or a pressure.
pub(super) struct Loaded<'a> {
    pub body: &'a str,
    pub region: &'a Option<Shape>,
    pub stress: Stress<'a>,
    pub curve: &'a Option<Curve>,
    pub surface: &'a Option<Surface>,
}

pub(super) enum Stress<'a> {
    Traction(&'a [f64]),
    Pressure(f64),
}

impl Loaded<'_> {
    pub(super) fn check(&self, problems: &mut Problems, path: &str, bodies: &[Body], dimension: usize) {
        match self.stress {
            Stress::Traction(traction) => problems.vector(&format!("{path}.traction"), traction, dimension),
            Stress::Pressure(pressure) => problems.number(&format!("{path}.pressure"), pressure),
        };
        check_body(problems, &format!("{path}.body"), self.body, bodies);
        if let Some(region) = self.region {
            region.check(problems, &format!("{path}.region"), dimension);
        }
        if let Some(curve) = self.curve {
            curve.check(problems, &format!("{path}.curve"));
        }
        match self.surface {
            Some(surface) => {
                check_normal(problems, &format!("{path}.surface.normal"), &surface.normal, dimension);
                problems.positive(&format!("{path}.surface.area"), surface.area);
            }
            None => {
                let from_file = bodies.iter().any(|body| body.name == self.body && body.particles.is_some());
                let allowed = "is needed for a body read from a file: {\"normal\": […], \"area\": …} of each particle";
                problems.require(!from_file, &format!("{path}.surface"), "nothing", allowed);
            }
        }
    }
}

/// Refuses a name that is not the name of a body.
pub(super) fn check_body(problems: &mut Problems, path: &str, name: &str, bodies: &[Body]) {
    let names: Vec<&str> = bodies.iter().map(|body| body.name.as_str()).collect();
    if names.contains(&name) {
        return;
    }
    let meant = nearest(name, &names).map_or(String::new(), |name| format!("did you mean {name:?}? It "));
    let known = names.get(..10).unwrap_or(&names);
    let more = if names.len() > known.len() { ", …" } else { "" };
    problems.refuse(path, format_args!("{name:?}"), format_args!("{meant}must be the name of a body: {known:?}{more}"));
}
