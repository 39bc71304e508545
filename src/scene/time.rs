//! Time stepping.

use super::check::{Number, Problems};
use crate::clock::MAX_HALVINGS;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Time steps of one run, at most.
pub const MAX_STEPS: f64 = 1e9;

/// The time steps and Newmark's constants.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// The time step Δt (time), > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub step: f64,
    /// The end of the simulation (time), at least one step; it starts at 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub end: f64,
    /// Newmark's β (no unit), > 0, with 2β ≥ γ. Default 0.25, the trapezoidal rule.
    #[serde(default = "Time::default_beta")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub beta: f64,
    /// Newmark's γ (no unit), 0.5 ≤ γ ≤ 2β; above 0.5 it damps. Default 0.5.
    #[serde(default = "Time::default_gamma")]
    #[schemars(range(min = 0.5))]
    pub gamma: f64,
    /// ε of the mass matrix (1 − ε) M + ε lumped(M), 0 (consistent) to 1 (lumped). Default 1.
    #[serde(default = "Time::default_lumping")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub lumping: f64,
    /// Where Newton's iteration of a step starts.
    #[serde(default)]
    pub initial_guess: InitialGuess,
    /// How particles see prescribed nodes in their update.
    #[serde(default)]
    pub wall_update: WallUpdate,
    /// How often a step that fails may be halved, 0 to 20. Default 10.
    #[serde(default = "Time::default_max_halvings")]
    #[schemars(range(min = 0, max = MAX_HALVINGS))]
    pub max_halvings: u32,
}

/// Where Newton's iteration of a step starts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InitialGuess {
    /// Δφ = 0, as in the paper's tables.
    #[default]
    Zero,
    /// Δφ = Δt v.
    Velocity,
}

/// How particles see prescribed nodes in their update.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WallUpdate {
    /// As the paper's Algorithm 1 reads: a resting wall changes neither velocity nor acceleration of the particles.
    #[default]
    Literal,
    /// The change is counted from what was projected, before the condition overwrote it.
    Consistent,
}

impl Time {
    fn default_beta() -> f64 {
        0.25
    }

    fn default_gamma() -> f64 {
        0.5
    }

    fn default_lumping() -> f64 {
        1.0
    }

    fn default_max_halvings() -> u32 {
        10
    }

    /// The same with the end that the command line asks for, by the option `option`.
    ///
    /// # Errors
    /// What the scene's own `end` may not be either.
    pub fn until(&self, end: f64, option: &str) -> Result<Self, Problems> {
        let time = Self { end, ..self.clone() };
        let mut problems = Problems::default();
        time.check(&mut problems);
        for problem in &mut problems.list {
            // Whatever is wrong now was right with the scene's own end.
            problem.path = option.to_owned();
            problem.value = Number(end).to_string();
        }
        if problems.is_empty() { Ok(time) } else { Err(problems) }
    }

    pub(super) fn check(&self, problems: &mut Problems) {
        let step_ok = problems.positive("time.step", self.step);
        if problems.positive("time.end", self.end) && step_ok {
            let (step, end) = (Number(self.step), Number(self.end));
            problems.require(
                self.end >= self.step,
                "time.end",
                &end,
                format_args!("must be at least one step, {step}"),
            );
            let steps = self.end / self.step;
            problems.require(
                steps <= MAX_STEPS,
                "time.step",
                &step,
                format_args!("reaching the end at {end} takes {steps:e} steps; at most {MAX_STEPS:e} are allowed"),
            );
        }
        // 2β ≥ γ ≥ ½, up to the rounding of β = (γ + ½)²/4 and the like
        let gamma_ok = self.gamma >= 0.5 && self.gamma <= 2.0;
        problems.require(
            gamma_ok,
            "time.gamma",
            Number(self.gamma),
            "must lie between 0.5 and 2 (stability: 2 beta >= gamma >= 0.5)",
        );
        let lowest = 0.5 * self.gamma.clamp(0.5, 2.0);
        problems.require(
            self.beta >= lowest * (1.0 - 1e-12) && self.beta <= 2.0,
            "time.beta",
            Number(self.beta),
            format_args!("must lie between gamma/2 = {lowest} and 2 (stability: 2 beta >= gamma >= 0.5)"),
        );
        problems.between("time.lumping", self.lumping, 0.0, 1.0);
        problems.whole("time.max_halvings", self.max_halvings, 0, MAX_HALVINGS);
    }
}
