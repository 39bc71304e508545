//! The output of a run.

use super::body::Body;
use super::grid::GridBox;
use super::load::check_body;
use crate::field::{Field, Kind};
use crate::material::internal_variable_names;
use crate::problems::Problems;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;

/// The output of a run.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Output {
    /// The time between two snapshots of all particles, > 0. Default: no snapshots.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: Option<f64>,
    /// The time between two checkpoints, > 0. `bfree run SCENE --restart` continues a killed run from its last checkpoint, with the same
    /// bits. Checkpoints are also written at the start, at the end and on Ctrl-C; the last two are kept. Default: no checkpoints.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub checkpoint: Option<f64>,
    /// The fields of a snapshot, each at most once; pictures show the first. Default: displacement, velocity (with inertia only), stress,
    /// jacobian. If a body may flow plastically, plastic_strain comes first. If there are several bodies, body comes last.
    pub fields: Option<Vec<Field>>,
    /// Histories of one field at one point, written in every step.
    #[serde(default)]
    pub probes: Vec<Probe>,
}

/// The history of one field at one point.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Probe {
    /// The unique name of the history, of letters, digits, `_` and `-`.
    #[schemars(regex(pattern = r"^[A-Za-z0-9_-]+$"))]
    pub name: String,
    /// The field.
    pub field: Field,
    /// The only component to write, such as `xy` of a stress or `y` of a displacement. Default: all components.
    pub component: Option<String>,
    /// The body whose particles are probed. Default: all bodies.
    pub body: Option<String>,
    /// The position.
    pub at: At,
}

/// The position of a probe.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum At {
    /// The particle nearest to this point at t = 0. The probe follows this particle.
    Particle(Vec<f64>),
    /// The material point that is here at t = 0, such as a corner. The probe follows this point: its motion is that of the nearest
    /// particle, continued by the particle's deformation gradient. Fields other than position and displacement are those of the particle.
    BodyPoint(Vec<f64>),
    /// This point, fixed in space. At each time, the value is that of the nearest particle, without interpolation; among equally near
    /// particles, that of the first. While no particle is within one grid spacing, the value is NaN.
    Point(Vec<f64>),
}

impl Output {
    /// The fields of snapshots and probes, with their keys.
    pub(super) fn asked(&self) -> Vec<(String, &Field)> {
        let fields = self.fields.iter().flatten().enumerate().map(|(i, field)| (format!("output.fields[{i}]"), field));
        let probes = self.probes.iter().enumerate();
        fields.chain(probes.map(|(i, probe)| (format!("output.probes[{i}].field"), &probe.field))).collect()
    }

    pub(super) fn check(&self, problems: &mut Problems, bodies: &[Body], grid: &GridBox) {
        problems.positive("output.every", self.every);
        problems.positive("output.checkpoint", self.checkpoint);
        let fields = self.fields.as_deref().unwrap_or_default();
        for (i, field) in problems.few("output.fields", fields).iter().enumerate() {
            let again = fields.iter().take(i).any(|earlier| earlier.name() == field.name());
            let found = format_args!("{}, given before,", field.name());
            problems.require(!again, &format!("output.fields[{i}]"), found, "must be listed once");
        }
        self.check_internal_variables(problems, bodies);
        let mut columns = HashSet::from(["time".to_owned()]);
        for (i, probe) in problems.few("output.probes", &self.probes).iter().enumerate() {
            probe.check(problems, &format!("output.probes[{i}]"), bodies, grid);
            let again = self.probes.iter().take(i).any(|earlier| earlier.name == probe.name);
            let path = format!("output.probes[{i}].name");
            let allowed = "must differ from the names of the probes before";
            problems.require(!again, &path, format_args!("{:?}", probe.name), allowed);
            for column in probe.columns(grid.dimension()) {
                let allowed = format!("probes.csv already has a column {column:?}: choose another name");
                let is_new = columns.insert(column);
                problems.require(again || is_new, &path, format_args!("{:?}", probe.name), allowed);
            }
        }
    }

    /// Refuses names that no law has. Without all laws, such as before a library is allowed, all names pass.
    fn check_internal_variables(&self, problems: &mut Problems, bodies: &[Body]) {
        let laws = bodies.iter().map(Body::law);
        let Some(laws) = laws.collect::<Option<Vec<_>>>() else { return };
        let known = internal_variable_names(laws.iter());
        let allowed = match known.as_slice() {
            [] => "must be an internal variable of a law, and no law here has one: remove it".to_owned(),
            known => format!("must be an internal variable of a law: {}", known.join(", ")),
        };
        for (path, field) in self.asked() {
            if let Field::Internal(name) = field {
                problems.require(known.contains(&name.as_str()), &path, format_args!("{name:?}"), &allowed);
            }
        }
    }
}

impl Probe {
    /// The index of the only component to write.
    pub(crate) fn component(&self) -> Option<usize> {
        let component = self.component.as_ref()?;
        self.field.kind().components().iter().position(|one| one == component)
    }

    fn columns(&self, dimension: usize) -> Vec<String> {
        if self.component.is_some() { vec![self.name.clone()] } else { self.field.columns(&self.name, dimension) }
    }

    fn check(&self, problems: &mut Problems, path: &str, bodies: &[Body], grid: &GridBox) {
        let letters = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        let named = !self.name.is_empty() && self.name.chars().all(letters);
        let allowed = "must consist of letters, digits, _ and -: it becomes part of a file name";
        problems.require(named, &format!("{path}.name"), format_args!("{:?}", self.name), allowed);
        if let Some(component) = &self.component {
            let (kind, dimension) = (self.field.kind(), grid.dimension());
            let all = kind.components();
            let all = if kind == Kind::Vector { all.get(..dimension).unwrap_or(all) } else { all };
            let allowed = match all {
                [""] => format!("{} has one component: remove the key", self.field.name()),
                _ => format!("must be a component of {}: {}", self.field.name(), all.join(", ")),
            };
            let known = !component.is_empty() && all.contains(&component.as_str());
            problems.require(known, &format!("{path}.component"), format_args!("{component:?}"), allowed);
        }
        if let Some(body) = &self.body {
            check_body(problems, &format!("{path}.body"), body, bodies);
        }
        let (key, x) = match &self.at {
            At::Particle(x) => ("particle", x),
            At::BodyPoint(x) => ("body_point", x),
            At::Point(x) => ("point", x),
        };
        let path = format!("{path}.at.{key}");
        if problems.vector(&path, x, grid.dimension()) && grid.cells().is_some() {
            problems.require(grid.holds(x), &path, format_args!("{x:?}"), "must lie in the grid");
        }
    }
}
