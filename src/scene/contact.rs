//! Contact between bodies, and checks of all contacts.

use super::Scene;
use super::obstacle::check_law;
use super::time::word;
use crate::mechanics::loads::ContactConstants;
use crate::mechanics::schemes::Parameters;
use crate::problems::Problems;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Contact between bodies. Bodies then move in separate nodal fields. Their surfaces meet without adhesion where they touch, with a one-sided
/// penalty and Coulomb friction. Force, moment, area, depth and friction loss of every pair in contact are in `contacts.csv`. A body does not
/// touch itself.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// The coefficient of friction, 0 to 100. The tangent with friction is exact and unsymmetric. Default: 0.
    #[serde(default)]
    #[schemars(range(min = 0, max = 100))]
    pub friction: f64,
    /// The penalty stiffness, > 0: the pressure at a depth of one grid spacing, in units of Λ + 2G of the softer body, or of 4G where that is
    /// less. Default: that of obstacles.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub stiffness: Option<f64>,
    /// Groups of names of bodies. Bodies of a group share one nodal field, and stick to each other where they share nodes. A body in no group
    /// is a group of its own.
    #[serde(default)]
    pub groups: Vec<Vec<String>>,
}

impl Contact {
    pub(super) fn check(&self, problems: &mut Problems, names: &[&str], dimension: usize) {
        check_law(problems, "contact", self.friction, self.stiffness, dimension);
        let mut seen = BTreeSet::new();
        for (i, group) in self.groups.iter().enumerate() {
            for (j, name) in group.iter().enumerate() {
                let path = format!("contact.groups[{i}][{j}]");
                let allowed = format!("must be the name of a body: {}", names.join(", "));
                problems.require(names.contains(&name.as_str()), &path, format_args!("{name:?}"), allowed);
                let allowed = "must be in one group only";
                problems.require(seen.insert(name), &path, format_args!("{name:?}"), allowed);
            }
        }
        let apart = self.fields(names).iter().any(|field| *field > 0);
        let allowed = "must leave two groups that can touch: add a body, split the group, or remove the key";
        problems.require(apart, "contact", "one group of bodies", allowed);
    }

    /// The constants of the law, with the default of its stiffness.
    pub(super) fn constants(&self, stiffness: f64) -> ContactConstants {
        ContactConstants { stiffness: self.stiffness.unwrap_or(stiffness), friction: self.friction }
    }

    /// The nodal field of each body, from 0 in the order of the bodies.
    pub(super) fn fields(&self, names: &[&str]) -> Vec<u32> {
        let group = |name: &str| self.groups.iter().position(|group| group.iter().any(|one| one == name));
        let mut fields: Vec<u32> = Vec::new();
        for (i, name) in names.iter().enumerate() {
            let earlier = (0..i).find(|&j| group(name).is_some() && group(names[j]) == group(name));
            let new = fields.iter().max().map_or(0, |last| last + 1);
            fields.push(earlier.map_or(new, |j| fields[j]));
        }
        fields
    }
}

impl Scene {
    /// Whether surfaces may touch an obstacle or another body.
    pub(super) fn has_contact(&self) -> bool {
        !self.obstacles.is_empty() || self.contact.is_some()
    }

    /// Whether friction acts at an obstacle or between bodies.
    pub(super) fn has_friction(&self) -> bool {
        let of_obstacles = self.obstacles.iter().map(|obstacle| obstacle.friction);
        of_obstacles.chain(self.contact.iter().map(|contact| contact.friction)).any(|friction| friction > 0.0)
    }

    /// The nodal field of each body.
    pub(super) fn nodal_fields(&self) -> Vec<u32> {
        let names = self.body_names();
        self.contact.as_ref().map_or_else(|| vec![0; names.len()], |contact| contact.fields(&names))
    }

    fn body_names(&self) -> Vec<&str> {
        self.bodies.iter().map(|body| body.name.as_str()).collect()
    }

    /// Refuses an obstacle that moves freely where its motion has no meaning.
    fn refuse_free(&self, problems: &mut Problems, path: &str) {
        let scheme = self.time.scheme();
        let word = word(scheme);
        let statics = format!("time.scheme is {word}, and without inertia nothing moves freely: remove one of the two");
        let mean = format!("time.scheme is {word}, which has no free obstacles: remove one of the two");
        if scheme == Parameters::EnergyMomentum {
            problems.refuse(path, "a free obstacle", mean);
        } else if !scheme.has_inertia() {
            problems.refuse(path, "a free obstacle", statics);
        }
        let varies = self.gravity.as_ref().is_some_and(|gravity| gravity.profile.is_some());
        let allowed = "gravity.profile varies gravity over particles, and an obstacle has none: remove one of the two";
        problems.require(!varies, path, "a free obstacle", allowed);
    }

    /// Checks obstacles, and contact between bodies.
    pub(super) fn check_contacts(&self, problems: &mut Problems, dimension: usize) {
        for (i, obstacle) in problems.few("obstacles", &self.obstacles).iter().enumerate() {
            let path = format!("obstacles[{i}]");
            obstacle.check(problems, &path, dimension);
            let again = self.obstacles.iter().take(i).any(|earlier| earlier.name == obstacle.name);
            let allowed = "must differ from the names of the obstacles before";
            problems.require(!again, &format!("{path}.name"), format_args!("{:?}", obstacle.name), allowed);
            if obstacle.free.is_some() {
                self.refuse_free(problems, &format!("{path}.free"));
            }
        }
        if let Some(contact) = &self.contact {
            contact.check(problems, &self.body_names(), dimension);
            let mean = "time.scheme is \"energy_momentum\", which would not keep the energy where two deformable bodies meet: take \"newmark\", or \
                        let the bodies meet obstacles only";
            let keeps_energy = self.time.scheme() == Parameters::EnergyMomentum;
            problems.require(!keeps_energy, "contact", "contact between bodies", mean);
        }
    }
}
