//! Obstacles that bodies touched during a run, and pairs of bodies that touched, for the report.

use super::plot::rounded;
use crate::simulation::ContactForces;
use serde::{Deserialize, Serialize};

/// An obstacle that bodies touched, or a pair of bodies that touched.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Touched {
    /// Name of the obstacle, or both names of the pair.
    pub name: String,
    /// The end of the first step with contact.
    pub since: f64,
    /// The end of the last step with contact so far.
    pub until: f64,
    /// The force on the obstacle, or on the second body, at the end of the last step, by component.
    pub force: Vec<f64>,
    /// The largest norm of the force.
    pub largest_force: f64,
    /// The time of the largest force.
    pub largest_at: f64,
    /// The largest depth of a point (length).
    pub largest_depth: f64,
    /// The work of the moving obstacle on the bodies; 0 for a pair.
    pub work: f64,
    /// The energy dissipated by friction.
    pub friction_loss: f64,
}

/// Whether the obstacle or the pair of this name was in contact at the end of the last step.
pub(crate) fn touched_last(touched: &[Touched], name: &str) -> bool {
    touched.iter().any(|one| one.name == name && one.force.iter().any(|force| *force != 0.0))
}

/// Adds a step that ended at `time`.
pub(crate) fn see<const D: usize>(
    touched: &mut Vec<Touched>,
    time: f64,
    names: impl Iterator<Item = String>,
    contacts: &[ContactForces<D>],
) {
    for (name, contact) in names.zip(contacts) {
        let known = touched.iter().position(|one| one.name == name);
        if known.is_none() && contact.area == 0.0 {
            continue;
        }
        let at = known.unwrap_or(touched.len());
        if known.is_none() {
            touched.push(Touched { name, since: time, until: time, largest_at: time, ..Touched::default() });
        }
        let one = &mut touched[at];
        if contact.area > 0.0 {
            one.until = time;
        }
        one.force = contact.force.iter().copied().collect();
        if contact.force.norm() > one.largest_force {
            (one.largest_force, one.largest_at) = (contact.force.norm(), time);
        }
        one.largest_depth = one.largest_depth.max(contact.depth);
        (one.work, one.friction_loss) = (contact.work, contact.friction_loss);
    }
}

impl std::fmt::Display for Touched {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { name, since, until, largest_force, largest_at, largest_depth, work, friction_loss, .. } = self;
        // Neither an obstacle at rest nor forces between bodies do work.
        let work = if *work == 0.0 { String::new() } else { format!(", work {work:.6e}") };
        let [since, until, largest_at] = [since, until, largest_at].map(|time| rounded(*time));
        write!(
            f,
            "{name:?} touched from t = {since} to {until}: largest force {largest_force:.6e} at t = {largest_at}, largest depth \
             {largest_depth:.3e}{work}, friction loss {friction_loss:.6e}"
        )
    }
}
