//! Time stepping.

use super::default_number;
use crate::clock::MAX_HALVINGS;
use crate::mechanics::schemes::{self, Newmark};
use crate::mechanics::transfer::{Projection, WallUpdate};
use crate::problems::{Number, Problems};
use crate::simulation::InitialGuess;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Maximum number of time steps of one run.
pub(crate) const MAX_STEPS: f64 = 1e9;

/// The time steps and Newmark's constants.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// The time step Δt (time), > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub step: f64,
    /// The end of the simulation (time), at least one step; the simulation starts at 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub end: f64,
    /// The time integration scheme: dynamics or statics. Without inertia there are load steps: each ends in static equilibrium under the
    /// loads at its end. Keys of velocities or the mass matrix are then refused. Default: `"newmark"`.
    pub scheme: Option<schemes::Parameters>,
    /// Deprecated, and read for one release: the key is now `scheme`. If `scheme` is given, this key has no effect.
    pub inertia: Option<schemes::Parameters>,
    /// Newmark's β (no unit), > 0, with 2β ≥ γ; for `"newmark"` only. Default 0.25, the trapezoidal rule.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub beta: Option<f64>,
    /// Newmark's γ (no unit), 0.5 ≤ γ ≤ 2β; values above 0.5 damp; for `"newmark"` only. Default 0.5.
    #[schemars(range(min = 0.5))]
    pub gamma: Option<f64>,
    /// ε of the mass matrix (1 − ε) M + ε lumped(M), 0 (consistent) to 1 (lumped). Default: 1; 0.1 with `obstacles`
    /// or `contact`; 0 with `"energy_momentum"`.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub lumping: Option<f64>,
    /// The starting point of Newton's method in a step. Default: `"last_step"` in load steps, `"zero"` with inertia.
    pub initial_guess: Option<InitialGuess>,
    /// The transfer of velocity and acceleration from the particles to the nodes. Default: `"mass"`.
    pub projection: Option<Projection>,
    /// The velocity change that prescribed nodes give to the particles. Default: `"literal"`.
    pub wall_update: Option<WallUpdate>,
    /// Adaptive steps, as long as a tolerance allows. `step` is the longest, and is halved at most `max_halvings` times. Default: all steps
    /// have the length `step`.
    pub adaptive: Option<Adaptive>,
    /// Maximum number of times that a failed step is halved, 0 to 20. Default 10.
    #[serde(default = "default_number::<10>")]
    #[schemars(range(min = 0, max = MAX_HALVINGS))]
    pub max_halvings: u32,
}

/// Adaptive steps, as long as a tolerance allows.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Adaptive {
    /// The largest allowed error of the displacement in one step, in grid spacings, > 0 and at most 1. The error is (β − 1/6) Δt² |Δa|
    /// (Zienkiewicz and Xie; Newmark's method), as the mass-weighted root mean square. A step with a larger error is repeated with half its
    /// length. After a step with at most a tenth of the allowed error, the next step is twice as long. Steps meet each whole multiple of
    /// `step`.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    pub tolerance: f64,
}

impl Time {
    /// The time integration scheme.
    pub(super) fn scheme(&self) -> schemes::Parameters {
        self.scheme.or(self.inertia).unwrap_or_default()
    }

    /// Newmark's β and γ.
    pub(super) fn newmark(&self) -> Newmark {
        let default = Newmark::default();
        Newmark { beta: self.beta.unwrap_or(default.beta), gamma: self.gamma.unwrap_or(default.gamma) }
    }

    /// The starting point of Newton's method.
    pub(super) fn initial_guess(&self) -> InitialGuess {
        let by_itself = if self.scheme().has_inertia() { InitialGuess::Zero } else { InitialGuess::LastStep };
        self.initial_guess.unwrap_or(by_itself)
    }

    /// Fills in the defaults of all keys that have a meaning for the scheme, except `lumping`, which depends on the scene.
    pub(super) fn complete(&mut self) {
        self.scheme = Some(self.scheme());
        self.initial_guess = Some(self.initial_guess());
        if self.scheme() == schemes::Parameters::Newmark {
            let Newmark { beta, gamma } = self.newmark();
            (self.beta, self.gamma) = (Some(beta), Some(gamma));
        }
        if self.scheme().has_inertia() {
            self.projection.get_or_insert_default();
            self.wall_update.get_or_insert_default();
        }
    }

    pub(super) fn check(&self, problems: &mut Problems) {
        let step_ok = problems.positive("time.step", self.step);
        if problems.positive("time.end", self.end) && step_ok {
            let (step, end) = (Number(self.step), Number(self.end));
            let allowed = format!("must be at least one step, {step}");
            problems.require(self.end >= self.step, "time.end", &end, allowed);
            let steps = self.end / self.step;
            let allowed = format!("reaching the end at {end} takes {steps:e} steps; at most {MAX_STEPS:e} are allowed");
            problems.require(steps <= MAX_STEPS, "time.step", format_args!("a step of {step}"), allowed);
        }
        self.scheme().check(problems, "time.scheme");
        for (key, given) in [("time.beta", self.beta), ("time.gamma", self.gamma)] {
            let own =
                matches!(self.scheme(), schemes::Parameters::GeneralizedAlpha(_) | schemes::Parameters::EnergyMomentum);
            if let Some(given) = given.filter(|_| own) {
                problems.refuse(key, Number(given), "belongs to time.scheme \"newmark\": remove one of the two");
            }
        }
        // 2β ≥ γ ≥ ½, up to round-off in values such as β = (γ + ½)²/4.
        let Newmark { beta, gamma } = self.newmark();
        let allowed = "must lie between 0.5 and 2 (stability: 2 beta >= gamma >= 0.5)";
        problems.require((0.5..=2.0).contains(&gamma), "time.gamma", Number(gamma), allowed);
        let lowest = 0.5 * gamma.clamp(0.5, 2.0);
        let beta_ok = beta >= lowest * (1.0 - 1e-12) && beta <= 2.0;
        let allowed = format!("must lie between gamma/2 = {lowest} and 2 (stability: 2 beta >= gamma >= 0.5)");
        problems.require(beta_ok, "time.beta", Number(beta), allowed);
        problems.between("time.lumping", self.lumping, 0.0, 1.0);
        if let Some(Adaptive { tolerance }) = self.adaptive {
            let small = !problems.positive("time.adaptive.tolerance", tolerance) || tolerance <= 1.0;
            problems.require(small, "time.adaptive.tolerance", Number(tolerance), "must be at most 1");
        }
        problems.whole("time.max_halvings", self.max_halvings, 0, MAX_HALVINGS);
    }
}

/// The value of a key as JSON, such as `"newmark"`.
pub(super) fn word(choice: impl Serialize) -> String {
    serde_json::to_string(&choice).unwrap_or_default()
}
