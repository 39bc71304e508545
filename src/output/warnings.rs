//! What the one who waits should know before the end: each kind once, with time and value.

use super::history::{Cost, Energies};
use serde::{Deserialize, Serialize};

/// Energy created, as a part of the largest energy so far, above which there is a warning.
const CREATED: f64 = 0.01;

/// Energy lost, likewise: an impact of the paper's bodies, a few cells wide, takes a fifth.
const LOST: f64 = 0.3;

/// Steps over which the usual number of iterations is averaged.
const MEMORY: u64 = 50;

/// Steps before iterations are compared with their mean.
const USUAL_AFTER: u64 = 10;

/// Krylov iterations of a step climb when they are so many times the usual ones, and more than so many.
const CLIMB: (f64, f64) = (5.0, 100.0);

/// What a warning is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// With inertia, the balance of energy is positive.
    EnergyCreated,
    /// With inertia, the balance of energy is far below zero.
    EnergyLost,
    /// A step was taken with less than its nominal length, because a longer one failed.
    StepHalved,
    /// The local error of a step is above the tolerance, and it could not be halved.
    StepInaccurate,
    /// Newton's method takes more than half of the iterations it may.
    NewtonClimbs,
    /// The linear solver takes many more iterations than it used to.
    KrylovClimbs,
    /// Linear systems are left unsolved at the limit on iterations.
    KrylovLimited,
    /// Linear systems are left unsolved because their residual no longer falls.
    KrylovStagnated,
}

/// A warning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Warning {
    /// What it is about.
    pub kind: Kind,
    /// t_{n+1} of the step.
    pub time: f64,
    /// Its number.
    pub step: u64,
    /// What happened, with its value.
    pub message: String,
}

/// Watches a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Watch {
    /// The most energy so far, counted without sign.
    most_energy: f64,
    /// The usual number of Krylov iterations.
    usual_krylov: f64,
    /// Steps seen.
    seen: u64,
    warnings: Vec<Warning>,
}

/// A step, as far as it is watched.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Watched {
    pub time: f64,
    pub step: u64,
    pub energies: Energies,
    /// Whether there is inertia: load steps take work from loads that are there at once.
    pub moves: bool,
    pub cost: Cost,
    /// Attempts before it that failed for another reason than their error.
    pub failed: usize,
    /// Its local error, and the tolerance, if there is one.
    pub error: Option<(f64, f64)>,
    /// Newton iterations allowed.
    pub newton_limit: usize,
    /// Linear systems left unsolved at the limit, and because their residual no longer fell; failed attempts have some, too.
    pub limited: usize,
    pub stagnated: usize,
    /// Krylov iterations allowed for one.
    pub krylov_limit: usize,
}

impl Watch {
    /// All warnings so far.
    pub(crate) fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Looks at a step; what is new.
    pub(crate) fn see(&mut self, step: &Watched) -> &[Warning] {
        let known = self.warnings.len();
        let Watched { energies, cost, failed, error, newton_limit, .. } = *step;
        let Energies { kinetic, strain, external, balance, .. } = energies;
        let energy = kinetic.abs() + strain.abs() + external.abs();
        if energy.is_finite() {
            self.most_energy = self.most_energy.max(energy);
        }
        if step.moves && balance > CREATED * self.most_energy {
            let part = 100.0 * balance / self.most_energy;
            self.warn(step, Kind::EnergyCreated, || {
                format!("energy was created: the balance is {balance:+.3e}, {part:.1} % of the most energy so far")
            });
        }
        if step.moves && -balance > LOST * self.most_energy {
            let part = -100.0 * balance / self.most_energy;
            self.warn(step, Kind::EnergyLost, || {
                format!(
                    "energy was lost, beyond what damping and laws took: the balance is {balance:+.3e}, {part:.1} % of the most energy so far; \
                     shorten time.step or grid.spacing, or tighten time.adaptive.tolerance"
                )
            });
        }
        if failed > 0 {
            let dt = cost.dt;
            self.warn(step, Kind::StepHalved, || {
                format!("the step had to be halved {failed} times, to dt = {dt:.3e}; report.json says why")
            });
        }
        if let Some((error, tolerance)) = error.filter(|(error, tolerance)| error > tolerance) {
            self.warn(step, Kind::StepInaccurate, || {
                let dt = cost.dt;
                format!("a step of dt = {dt:.3e} errs by {error:.2e} grid spacings, {tolerance:.2e} are allowed, and time.max_halvings is reached")
            });
        }
        if 2 * cost.newton > newton_limit && newton_limit > 1 {
            self.warn(step, Kind::NewtonClimbs, || {
                format!(
                    "Newton's method took {} of {newton_limit} allowed iterations, where a few are usual: shorten time.step, or raise \
                     solver.newton.max_iterations",
                    cost.newton
                )
            });
        }
        let (krylov, usual) = (cost.krylov as f64, self.usual_krylov);
        if self.seen >= USUAL_AFTER && krylov > CLIMB.0 * usual && krylov > CLIMB.1 {
            self.warn(step, Kind::KrylovClimbs, || {
                format!(
                    "the linear solver took {krylov} iterations in a step; {usual:.0} had been usual: cut cells are cured by \
                     ghost_stiffness, long steps and fine grids by solver.krylov.preconditioner = \"multigrid\""
                )
            });
        }
        let Watched { limited, stagnated, krylov_limit, .. } = *step;
        if limited > 0 {
            self.warn(step, Kind::KrylovLimited, || {
                format!(
                    "{limited} linear systems of a step were left unsolved after the {krylov_limit} iterations allowed: they are badly \
                     conditioned; raise solver.krylov.max_iterations, shorten time.step, or give cut cells a ghost_stiffness"
                )
            });
        }
        if stagnated > 0 {
            self.warn(step, Kind::KrylovStagnated, || {
                format!(
                    "{stagnated} linear systems of a step were left unsolved because their residual no longer fell: they are nearly \
                     singular, or GMRES restarts too early; hold bodies that can move freely, or raise solver.krylov.method.gmres.restart"
                )
            });
        }
        self.seen += 1;
        self.usual_krylov += (krylov - usual) / self.seen.min(MEMORY) as f64;
        &self.warnings[known..]
    }

    fn warn(&mut self, step: &Watched, kind: Kind, message: impl FnOnce() -> String) {
        if self.warnings.iter().all(|warning| warning.kind != kind) {
            let Watched { time, step, .. } = *step;
            self.warnings.push(Warning { kind, time, step, message: message() });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(number: u64) -> Watched {
        let energies =
            Energies { kinetic: 2.0, strain: 1.0, external: -1.0, dissipated: 0.0, total: 3.0, balance: -0.5 };
        let cost = Cost { dt: 0.1, newton: 3, krylov: 30, yielding: 0.0 };
        Watched {
            time: 0.1 * number as f64,
            step: number,
            energies,
            moves: true,
            cost,
            failed: 0,
            error: None,
            newton_limit: 30,
            limited: 0,
            stagnated: 0,
            krylov_limit: 2000,
        }
    }

    #[test]
    fn each_kind_is_told_once_with_time_and_value() {
        let mut watch = Watch::default();
        for number in 1..=20 {
            assert!(watch.see(&step(number)).is_empty(), "{number}");
        }
        let balance = |x: f64| Watched { energies: Energies { balance: x, ..step(0).energies }, ..step(21) };
        assert!(watch.see(&balance(0.039)).is_empty(), "1 % of 4 is not reached");
        let [warning] = watch.see(&balance(0.08)) else { panic!("one") };
        assert_eq!((warning.kind, warning.step, warning.time), (Kind::EnergyCreated, 21, 2.1));
        assert!(warning.message.contains("+8.000e-2, 2.0 %"), "{}", warning.message);
        assert!(watch.see(&balance(3.0)).is_empty(), "once");
        assert!(watch.see(&balance(-1.19)).is_empty(), "30 % of 4 are not reached");
        assert!(watch.see(&Watched { moves: false, ..balance(-1.3) }).is_empty(), "without inertia");
        assert!(watch.see(&balance(-1.3)).iter().any(|warning| warning.message.contains("-1.300e0, 32.5 %")));
        let halved = Watched { failed: 2, ..step(22) };
        assert!(watch.see(&halved).iter().any(|warning| warning.message.contains("halved 2 times, to dt = 1.000e-1")));
        let inaccurate = Watched { error: Some((2e-3, 1e-3)), ..step(22) };
        assert!(watch.see(&Watched { error: Some((1e-3, 1e-3)), ..step(22) }).is_empty());
        assert!(watch.see(&inaccurate).iter().any(|warning| warning.message.contains("errs by 2.00e-3 grid spacings")));
        let newton = Watched { cost: Cost { newton: 16, ..step(0).cost }, ..step(23) };
        let words = ["16 of 30", "shorten time.step"];
        assert!(watch.see(&newton).iter().any(|warning| words.iter().all(|word| warning.message.contains(word))));
        let krylov = |krylov| Watched { cost: Cost { krylov, ..step(0).cost }, ..step(24) };
        assert!(watch.see(&krylov(150)).is_empty(), "five times is not more than five times");
        // 30 steps of 30 before, and that of 150
        let words = ["180 iterations in a step; 34", "ghost_stiffness", "multigrid"];
        assert!(watch.see(&krylov(180)).iter().any(|warning| words.iter().all(|word| warning.message.contains(word))));
        let limited = Watched { limited: 2, ..step(25) };
        assert!(watch.see(&limited).iter().any(
            |warning| warning.message.starts_with("2 linear systems") && warning.message.contains("the 2000 iter")
        ));
        let stagnated = Watched { stagnated: 3, ..step(26) };
        assert!(watch.see(&stagnated).iter().any(|warning| warning.message.starts_with("3 linear systems")));
        assert!(watch.see(&stagnated).is_empty() && watch.see(&limited).is_empty(), "once");
        assert_eq!(watch.warnings().len(), 8);
        // what it knows survives a checkpoint
        let text = serde_json::to_string(&watch).unwrap();
        assert_eq!(serde_json::from_str::<Watch>(&text).unwrap(), watch);
    }

    #[test]
    fn numbers_that_are_none_leave_it_able_to_be_saved() {
        let mut watch = Watch::default();
        let nan = Energies {
            kinetic: f64::NAN,
            strain: f64::INFINITY,
            external: 0.0,
            dissipated: 0.0,
            total: f64::NAN,
            balance: f64::NAN,
        };
        watch.see(&Watched { energies: nan, ..step(1) });
        let text = serde_json::to_string(&watch).unwrap();
        assert_eq!(serde_json::from_str::<Watch>(&text).unwrap(), watch);
    }
}
