//! The JSON scene: types, reader and checks.
//!
//! Each key is declared once, as a field. The doc comment of the field serves the manual and the [`schema`]. Units are the user's own
//! consistent set. [`read`] returns a scene that has passed all checks that need no particles. Otherwise [`read`] returns the place where
//! the text is wrong, or all values that are not allowed.

pub mod accuracy;
pub mod keys;
pub mod mesh_file;
pub mod particle_file;
pub mod surface_file;

pub(crate) mod output;
pub(crate) mod time;

mod body;
mod boundary;
mod build;
mod build_error;
mod contact;
mod contacts;
mod curve;
mod defaults;
mod file;
mod filling;
mod free;
mod grid;
mod image_file;
mod json;
mod load;
mod loading;
mod msh;
mod obstacle;
mod overrides;
mod place;
mod read;
mod shape;
mod solver;
mod transfer;
mod vector;
mod warnings;

pub use crate::problems::{Place, Problem, Problems};
pub use build_error::BuildError;
pub use file::FileError;
pub use filling::BodyUse;
pub use overrides::{Override, OverrideError};
pub(crate) use read::text;
pub use read::{MAX_BYTES, SceneError, read, read_file};

use crate::approximation;
use crate::material::{self, Law, Material};
use crate::mechanics::loads::Rayleigh;
use crate::mechanics::reference::GridReset;
use crate::mechanics::schemes::Parameters;
use crate::mechanics::symmetry::Unsymmetric;
use crate::shape::Layout;
use crate::simulation::InitialGuess;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// Keys that have a meaning only with inertia.
const OF_INERTIA: [&str; 3] = ["transfer", "initial_velocity", "damping"];

/// Keys of `time` that have a meaning only with inertia.
const TIME_OF_INERTIA: [&str; 6] = ["beta", "gamma", "lumping", "projection", "wall_update", "adaptive"];

/// A simulation: bodies in a box, what acts on them, and how it is computed. All units are the user's own consistent set.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// The location of the schema, with which an editor completes and explains keys; `bfree new` writes the schema beside the scene. The
    /// key has no other effect.
    #[serde(rename = "$schema")]
    pub schema: Option<String>,
    /// One line about the scene.
    pub title: Option<String>,
    /// The box and its background grid.
    pub grid: grid::GridBox,
    /// The wanted accuracy of the results. The key sets, from a measured table, the keys that the scene does not give among `grid.spacing`,
    /// `time.step`, `approximation`, `time.lumping`, `bodies[].particles_per_cell` and `solver.newton.tolerance`. Without inertia, `time`
    /// and `approximation` stay unchanged. Default: nothing is set.
    pub accuracy: Option<accuracy::Accuracy>,
    /// The keys set by `accuracy`.
    #[serde(skip)]
    pub chosen: Vec<accuracy::Chosen>,
    /// The shape functions. Default: `{"bspline": {"degree": 3}}`.
    #[serde(default)]
    pub approximation: approximation::Parameters,
    /// Time stepping.
    pub time: time::Time,
    /// The transfer of velocity and acceleration from the nodes to the particles. Default: `"flip"`, as in the paper.
    pub transfer: Option<transfer::Transfer>,
    /// The bodies, at least one.
    #[schemars(length(min = 1))]
    pub bodies: Vec<body::Body>,
    /// Boundary conditions at the faces of the box. Default: all faces are free.
    #[serde(default)]
    pub boundary: boundary::Boundary,
    /// Prescribed motion of the nodes in regions. Later entries override earlier ones, and every entry overrides `boundary`.
    #[serde(default)]
    pub prescribed: Vec<boundary::Prescribed>,
    /// Whether nodes with little support from a body follow well-supported nodes (extended B-splines). Such nodes are not unknowns: they
    /// continue the polynomial of the nearest well-filled cell. Surface loads then act through functions that balance the internal force.
    /// Default: true without inertia, with a consistent mass (`time.lumping` 0), where the surface of a shape is loaded, with `obstacles` or
    /// `contact`, and in steps of constant length at Courant numbers above 10; else false.
    pub aggregation: Option<bool>,
    /// Deprecated, and read for one release: aggregation has replaced the ghost stiffness. If `aggregation` is not given, 0 means false,
    /// and a positive value means true.
    #[schemars(range(min = 0, max = 1))]
    pub ghost_stiffness: Option<f64>,
    /// The acceleration of gravity. Default: none.
    pub gravity: Option<load::Gravity>,
    /// Rayleigh damping, a M + b K. Default: none.
    pub damping: Option<Rayleigh>,
    /// Tractions (forces per reference area) on surfaces.
    #[serde(default)]
    pub tractions: Vec<load::Traction>,
    /// Pressures on surfaces.
    #[serde(default)]
    pub pressures: Vec<load::Pressure>,
    /// Rigid obstacles that bodies touch and leave freely.
    #[serde(default)]
    pub obstacles: Vec<obstacle::Obstacle>,
    /// Contact between bodies. Default: none, as in the paper: all bodies share one nodal field, and stick to each other where they share nodes.
    pub contact: Option<contact::Contact>,
    /// Initial velocities of nodes. Bodies and particle files must then give no velocities.
    pub initial_velocity: Option<InitialVelocity>,
    /// The solver of the equations of a step.
    #[serde(default)]
    pub solver: solver::Solver,
    /// The output of a run.
    #[serde(default)]
    pub output: output::Output,
}

/// Initial velocities of nodes, interpolated once to the particles. No body may then have a velocity of its own.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InitialVelocity {
    /// Regions, at least one, and the velocities of their nodes. Later regions override earlier ones, and all other nodes are at rest.
    #[schemars(length(min = 1))]
    pub nodes: Vec<NodeVelocity>,
}

/// The velocity of the nodes in a region.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NodeVelocity {
    /// The region.
    pub region: shape::Shape,
    /// The velocity.
    pub velocity: Vec<f64>,
}

/// The JSON schema of a scene.
///
/// ```
/// // Every key that a scene has, the schema describes.
/// let (schema, text) = (bfree::scene::schema().to_value(), std::fs::read_to_string("scenes/cantilever.json")?);
/// let scene: serde_json::Map<String, serde_json::Value> = serde_json::from_str(&text)?;
/// assert!(scene.len() > 5);
/// assert!(scene.keys().all(|key| schema["properties"][key]["description"].is_string()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn schema() -> schemars::Schema {
    let mut schema = complete_schema();
    // With `accuracy`, these keys may be absent.
    for (part, key) in [("GridBox", "spacing"), ("Time", "step")] {
        if let Some(Value::Array(required)) = schema.pointer_mut(&format!("/$defs/{part}/required")) {
            required.retain(|one| one != key);
        }
    }
    let given = json!({ "grid": { "required": ["spacing"] }, "time": { "required": ["step"] } });
    let chosen = json!({ "required": ["accuracy"], "properties": { "accuracy": { "not": { "type": "null" } } } });
    schema.insert("anyOf".to_owned(), json!([{ "properties": given }, chosen]));
    schema
}

/// The schema without the rule of [`schema`] for `accuracy`: `grid.spacing` and `time.step` are required.
fn complete_schema() -> schemars::Schema {
    schemars::schema_for!(Scene)
}

/// The default of a key.
fn default_number<const N: u32>() -> u32 {
    N
}

impl Scene {
    /// All values of the scene that are not allowed, in the order of its sections.
    ///
    /// ```
    /// // A scene that was read is right; one that is changed afterwards may be wrong in several places.
    /// let mut scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// assert!(scene.check().is_empty());
    /// scene.time.step = -0.1;
    /// scene.bodies[0].density = 0.0;
    /// let wrong: Vec<_> = scene.check().list.into_iter().map(|problem| problem.path).collect();
    /// assert_eq!(wrong, ["time.step", "bodies[0].density"]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn check(&self) -> Problems {
        let mut problems = Problems::default();
        self.grid.check(&mut problems);
        let dimension = self.grid.dimension();
        if !(1..=3).contains(&dimension) {
            // The other checks compare lengths with the dimension.
            return problems;
        }
        self.shape_functions(&mut problems);
        self.time.check(&mut problems);
        self.transfer.iter().for_each(|transfer| transfer.check(&mut problems));
        self.check_bodies(&mut problems);
        self.boundary.check(&mut problems, dimension);
        for (i, prescribed) in problems.few("prescribed", &self.prescribed).iter().enumerate() {
            prescribed.check(&mut problems, &format!("prescribed[{i}]"), dimension);
        }
        problems.between("ghost_stiffness", self.ghost_stiffness, 0.0, 1.0);
        self.check_loads(&mut problems, dimension);
        if let Some(initial) = &self.initial_velocity {
            self.check_initial_velocity(initial, &mut problems, dimension);
        }
        self.solver.check(&mut problems, self.unsymmetric().reason());
        self.output.check(&mut problems, &self.bodies, &self.grid);
        if !self.time.scheme().has_inertia() {
            self.refuse_inertia(&mut problems);
        }
        if self.time.scheme() == Parameters::ArcLength {
            self.refuse_off_path(&mut problems);
        }
        if self.time.scheme() == Parameters::EnergyMomentum {
            self.refuse_without_mean_stress(&mut problems);
        }
        problems
    }

    /// The laws of all bodies whose constants are allowed.
    fn laws(&self) -> impl Iterator<Item = Material> {
        self.bodies.iter().filter_map(body::Body::law)
    }

    /// The parts of the scene that make the tangent unsymmetric.
    fn unsymmetric(&self) -> Unsymmetric {
        Unsymmetric {
            path: self.time.scheme() == Parameters::ArcLength,
            mean_stress: self.time.scheme() == Parameters::EnergyMomentum,
            // A scene that asks for conjugate gradients gets the displacement form.
            mixed: false,
            pressure: !self.pressures.is_empty(),
            friction: self.has_friction(),
            free_obstacle: self.obstacles.iter().any(|obstacle| obstacle.free.is_some()),
            law: self.laws().any(|law| !law.is_symmetric()),
        }
    }

    /// Refuses keys that have a meaning only with inertia.
    fn refuse_inertia(&self, problems: &mut Problems) {
        let scheme = time::word(self.time.scheme());
        let allowed = format!("time.scheme is {scheme}, and without inertia it means nothing: remove one of the two");
        let given = serde_json::to_value(self).unwrap_or_default();
        let of_time = TIME_OF_INERTIA.map(|key| (format!("time.{key}"), &given["time"][key]));
        let others = OF_INERTIA.map(|key| (key.to_owned(), &given[key]));
        for (key, value) in of_time.into_iter().chain(others).filter(|(_, value)| !value.is_null()) {
            problems.refuse(&key, value, &allowed);
        }
        if self.time.initial_guess == Some(InitialGuess::Velocity) {
            problems.refuse("time.initial_guess", "\"velocity\"", &allowed);
        }
        for (i, velocity) in self.bodies.iter().enumerate().filter_map(|(i, body)| Some((i, body.velocity.as_ref()?))) {
            problems.refuse(&format!("bodies[{i}].velocity"), time::word(velocity), &allowed);
        }
        for (path, field) in self.output.asked().into_iter().filter(|(_, field)| field.needs_inertia()) {
            problems.refuse(&path, time::word(field), &allowed);
        }
    }

    /// Refuses features that the arc-length method cannot have: follower pressures, prescribed motion, and a grid reset in every step.
    fn refuse_off_path(&self, problems: &mut Problems) {
        let allowed = "time.scheme is \"arc_length\", for dead loads, walls at rest and a grid that is kept: remove one of the two";
        for i in 0..self.pressures.len() {
            problems.refuse(&format!("pressures[{i}]"), "a follower pressure", allowed);
        }
        for (name, face) in self.boundary.faces() {
            let moves = face.and_then(boundary::Face::given).is_some_and(boundary::GivenMotion::moves);
            problems.require(!moves, &format!("boundary.{name}"), "a motion", allowed);
        }
        for (i, prescribed) in self.prescribed.iter().enumerate() {
            let moves = prescribed.given().iter().any(|motion| motion.moves());
            problems.require(!moves, &format!("prescribed[{i}]"), "a motion", allowed);
        }
        for i in 0..self.obstacles.len() {
            problems.refuse(&format!("obstacles[{i}]"), "an obstacle", allowed);
        }
        problems.require(self.contact.is_none(), "contact", "contact between bodies", allowed);
        let kept = self.grid.given_reset() != Some(GridReset::EveryStep);
        problems.require(kept, "grid.reset", "\"every_step\"", allowed);
    }

    /// Refuses bodies whose stress has no mean over a step.
    fn refuse_without_mean_stress(&self, problems: &mut Problems) {
        for (i, body) in self.bodies.iter().enumerate() {
            let library = match body.material {
                material::Parameters::Umat(_) => "\"umat\"",
                material::Parameters::Mfront(_) => "\"mfront\"",
                material::Parameters::CLaw(_) => "\"c\"",
                _ => continue,
            };
            let allowed = "must not be a law from a library with time.scheme \"energy_momentum\", which asks for the stress at states \
                           without the rotation of the body";
            problems.refuse(&format!("bodies[{i}].material"), library, allowed);
        }
    }

    fn check_loads(&self, problems: &mut Problems, dimension: usize) {
        if let Some(gravity) = &self.gravity {
            gravity.check(problems, dimension);
        }
        if let Some(damping) = &self.damping {
            damping.check(problems);
        }
        problems.few("tractions", &self.tractions);
        problems.few("pressures", &self.pressures);
        for (path, load) in self.surface_loads() {
            load.check(problems, &path, &self.bodies, dimension);
        }
        self.check_contacts(problems, dimension);
    }

    fn check_initial_velocity(&self, initial: &InitialVelocity, problems: &mut Problems, dimension: usize) {
        let path = "initial_velocity.nodes";
        problems.require(!initial.nodes.is_empty(), path, "an empty list", "must have at least one region");
        for (i, velocity) in self.bodies.iter().enumerate().filter_map(|(i, body)| Some((i, body.velocity.as_ref()?))) {
            let allowed = "initial_velocity gives the velocity of all particles: remove one of the two";
            problems.refuse(&format!("bodies[{i}].velocity"), format_args!("{velocity:?}"), allowed);
        }
        for (i, node) in problems.few(path, &initial.nodes).iter().enumerate() {
            node.region.check(problems, &format!("{path}[{i}].region"), dimension);
            problems.vector(&format!("{path}[{i}].velocity"), &node.velocity, dimension);
        }
    }

    fn check_bodies(&self, problems: &mut Problems) {
        problems.require(!self.bodies.is_empty(), "bodies", "an empty list", "must have at least one body");
        let agree = self.approximation.one_half_width();
        let because = format!("{} has one half width for all particles", self.approximation.key());
        for (i, body) in problems.few("bodies", &self.bodies).iter().enumerate() {
            let path = format!("bodies[{i}]");
            body.check(problems, &path, &self.grid);
            let again = self.bodies.iter().take(i).any(|earlier| earlier.name == body.name);
            let allowed = "must differ from the names of the bodies before";
            problems.require(!again, &format!("{path}.name"), format_args!("{:?}", body.name), allowed);
            let (found, first) = (body.particles_per_cell, self.bodies[0].particles_per_cell);
            let allowed = format!("must be {first} as in the first body: {because}");
            problems.require(!agree || found == first, &format!("{path}.particles_per_cell"), found, allowed);
            let gauss = agree && body.layout == Some(Layout::Gauss);
            let allowed = format!("must be \"regular\": {because}");
            problems.require(!gauss, &format!("{path}.layout"), "\"gauss\"", allowed);
        }
    }
}
