//! Whether the tangent of a step is symmetric, and the reason if it is not. Scenes, simulations and equilibria ask here.

use crate::material::Law;
use crate::mechanics::loads::{Loads, Pressing};
use crate::particles::Body;

/// The parts of a step that make its tangent unsymmetric, each `true` if the step has the part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Unsymmetric {
    /// The load is an unknown on a path of equilibria.
    pub path: bool,
    /// The stress is the mean of a step.
    pub mean_stress: bool,
    /// The dilatations of averaged cells are unknowns.
    pub mixed: bool,
    /// Pressures follow a surface.
    pub pressure: bool,
    /// Contact has friction.
    pub friction: bool,
    /// An obstacle moves freely.
    pub free_obstacle: bool,
    /// The tangent of a law is unsymmetric.
    pub law: bool,
}

impl Unsymmetric {
    /// The parts that loads and laws decide.
    pub(crate) fn of<const D: usize, L: Law>(bodies: &[Body<L>], loads: &Loads<D>) -> Self {
        Self {
            pressure: loads.surface.iter().any(|load| matches!(load.pressing, Pressing::Pressure(_))),
            friction: loads.contacts.have_friction(),
            free_obstacle: loads.contacts.has_free_obstacle(),
            law: bodies.iter().any(|body| !body.law.is_symmetric()),
            ..Self::default()
        }
    }

    /// The reason; `None` if the tangent is symmetric.
    pub(crate) fn reason(self) -> Option<&'static str> {
        let reasons = [
            (self.path, "on a path of equilibria, the load is unknown too"),
            (self.mean_stress, "the mean stress of a step makes the tangent unsymmetric"),
            (self.mixed, "the dilatations of averaged cells are unknowns, too"),
            (self.pressure, "pressures that follow a surface make the tangent unsymmetric"),
            (self.friction, "friction makes the tangent unsymmetric"),
            (self.free_obstacle, "an obstacle that moves freely makes the tangent unsymmetric"),
            (self.law, "a law makes the tangent unsymmetric"),
        ];
        reasons.into_iter().find_map(|(holds, reason)| holds.then_some(reason))
    }
}
