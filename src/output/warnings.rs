//! Warnings during a run: each kind once, with time and value.

mod energy;

use super::contact::{self, Contact};
use super::history::{Cost, Energies};
use super::losses::{Cause, Losses};
use super::path::{self, Event, Followed};
use crate::simulation::{Settings, SharedNodes};
use crate::solver::{NewtonSettings, Preconditioning};
use serde::{Deserialize, Serialize};

/// The depth of a body in an obstacle, in grid spacings, above which there is a warning.
const DEEP: f64 = 0.25;

/// Steps over which the usual number of iterations is averaged.
const MEMORY: u64 = 50;

/// Steps before iterations are compared with their mean. A loss or a gain of energy is reported if it lasts for as many steps.
const USUAL_AFTER: u64 = 10;

/// The multiple of their usual number beyond which Krylov iterations get a warning.
const KRYLOV_GROWTH: f64 = 5.0;

/// The number of Krylov iterations up to which there is no warning.
const FEW_KRYLOV_ITERATIONS: f64 = 100.0;

/// Subject of a warning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// With inertia, the balance of energy is positive.
    EnergyCreated,
    /// With inertia, the balance of energy is below zero.
    EnergyLost,
    /// With inertia, the balance of energy has left zero and come back.
    EnergySwung,
    /// A step was taken with less than its nominal length, because a longer one failed.
    StepHalved,
    /// The local error of a step is above the tolerance, and the step could not be halved.
    StepInaccurate,
    /// Newton's method takes more than half of its allowed iterations.
    NewtonClimbs,
    /// The linear solver takes many more iterations than it used to.
    KrylovClimbs,
    /// Linear systems are left unsolved at the limit on iterations.
    KrylovLimited,
    /// Linear systems are left unsolved because their residual no longer falls.
    KrylovStagnated,
    /// A body is deep in an obstacle.
    ObstacleDeep,
    /// A free obstacle has left the grid.
    ObstacleGone,
    /// Two bodies share nodes and are pulled apart.
    BodiesStick,
    /// The load on the equilibrium path has turned at a limit point.
    PathTurned,
    /// The equilibrium path has bent sharply from one step to the next.
    PathBent,
    /// The equilibrium path goes back along its earlier points.
    PathReturned,
}

/// A warning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Warning {
    /// Subject.
    pub kind: Kind,
    /// t_{n+1} of the step.
    pub time: f64,
    /// Number of the step.
    pub step: u64,
    /// The event and its value.
    pub message: String,
}

/// Collects the warnings of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Watch {
    losses: Losses,
    /// Consecutive steps after which the loss was too large.
    losing: u64,
    /// Consecutive steps after which the gain was too large.
    creating: u64,
    /// Bodies that shared nodes.
    pub(crate) contacts: Vec<Contact>,
    path: Followed,
    /// Whether the mass matrix is lumped in full.
    lumped: bool,
    /// The usual number of Krylov iterations.
    usual_krylov: f64,
    /// Steps seen.
    seen: u64,
    /// All warnings so far.
    pub(crate) warnings: Vec<Warning>,
}

/// The data of a step for the warnings.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Watched<'a> {
    pub time: f64,
    pub step: u64,
    pub settings: &'a Settings,
    pub energies: Energies,
    /// The event in the step that may lose energy.
    pub cause: Cause,
    pub cost: Cost,
    /// Earlier attempts at the step that failed for another reason than their local error.
    pub failed: usize,
    /// Local error of the step; `None` without a tolerance.
    pub error: Option<f64>,
    /// Linear systems left unsolved at the limit on iterations (`limited`), or because their residual no longer fell (`stagnated`). Failed
    /// attempts are included.
    pub limited: usize,
    pub stagnated: usize,
}

/// The settings that make linear systems easier to solve and are not set yet. A comma follows each of them.
fn solver_advice(settings: &Settings) -> String {
    let aggregation = if settings.aggregation { "" } else { "set aggregation = true for cut cells, " };
    let multigrid = match settings.preconditioner {
        Preconditioning::Multigrid => "",
        _ => "try solver.krylov.preconditioner = \"multigrid\", ",
    };
    format!("{aggregation}{multigrid}")
}

impl Watch {
    /// Examines a step.
    pub(crate) fn see(&mut self, step: &Watched) {
        self.see_energy(step);
        self.see_step(step);
        self.see_solver(step);
    }

    /// Warns of a step that was halved, or should have been.
    fn see_step(&mut self, step: &Watched) {
        let (dt, failed) = (step.cost.dt, step.failed);
        if failed > 0 {
            let text = format!("the step had to be halved {failed} times, to dt = {dt:.3e}; report.json says why");
            self.warn(step, Kind::StepHalved, text);
        }
        if let Some((error, tolerance)) = step.error.zip(step.settings.error_tolerance)
            && error > tolerance
        {
            let text = format!(
                "a step of dt = {dt:.3e} errs by {error:.2e} grid spacings, {tolerance:.2e} are allowed, and time.max_halvings is reached"
            );
            self.warn(step, Kind::StepInaccurate, text);
        }
    }

    /// Warns of many iterations of Newton's method, and of linear systems that are hard to solve.
    fn see_solver(&mut self, step: &Watched) {
        let Watched { cost, limited, stagnated, .. } = *step;
        let NewtonSettings { max_iterations, max_krylov_iterations, .. } = step.settings.newton;
        if 2 * cost.newton > max_iterations && max_iterations > 1 {
            let text = format!(
                "Newton's method took {} of {max_iterations} allowed iterations, where a few are usual: shorten time.step, or raise \
                 solver.newton.max_iterations",
                cost.newton
            );
            self.warn(step, Kind::NewtonClimbs, text);
        }
        let (krylov, usual) = (cost.krylov as f64, self.usual_krylov);
        if self.seen >= USUAL_AFTER && krylov > KRYLOV_GROWTH * usual && krylov > FEW_KRYLOV_ITERATIONS {
            let text = format!(
                "the linear solver took {krylov} iterations in a step; {usual:.0} had been usual: {}shorten time.step",
                solver_advice(step.settings)
            );
            self.warn(step, Kind::KrylovClimbs, text);
        }
        if limited > 0 {
            let text = format!(
                "{limited} linear systems of a step were left unsolved after the {max_krylov_iterations} iterations allowed: they are badly \
                 conditioned; {}shorten time.step, or raise solver.krylov.max_iterations",
                solver_advice(step.settings)
            );
            self.warn(step, Kind::KrylovLimited, text);
        }
        if stagnated > 0 {
            let text = format!(
                "{stagnated} linear systems of a step were left unsolved because their residual no longer fell: they are nearly \
                 singular, or GMRES restarts too early; hold bodies that can move freely, or raise solver.krylov.method.gmres.restart"
            );
            self.warn(step, Kind::KrylovStagnated, text);
        }
        self.seen += 1;
        self.usual_krylov += (krylov - usual) / self.seen.min(MEMORY) as f64;
    }

    /// Warns of a body that is deep in an obstacle or in another body. `place` says where, `key` is that of the stiffness, and `depth` is in grid
    /// spacings.
    pub(crate) fn see_depth(&mut self, step: &Watched, place: &str, key: &str, depth: f64) {
        if depth > DEEP {
            let text = format!(
                "a body is {depth:.2} grid spacings deep {place}, and the contact is too soft for its shape: raise {key}, or lower \
                 grid.spacing"
            );
            self.warn(step, Kind::ObstacleDeep, text);
        }
    }

    /// Warns of a free obstacle outside the grid.
    pub(crate) fn see_gone(&mut self, step: &Watched, name: &str) {
        let text = format!(
            "the free obstacle {name:?} has left the grid, where nothing can touch it. Faces of the grid do not hold obstacles: let it land on a \
             body, or enlarge the grid"
        );
        self.warn(step, Kind::ObstacleGone, text);
    }

    /// Examines the bodies that share nodes after a step. Warns of each pair of bodies that sticks together from now on.
    pub(crate) fn see_contact(&mut self, step: &Watched, shared_nodes: &[SharedNodes], names: &[&str]) {
        let Watched { time, cost, step, .. } = *step;
        let said = contact::see(&mut self.contacts, time, cost.dt, step == 1, shared_nodes, names);
        let warning = |message| Warning { kind: Kind::BodiesStick, time, step, message };
        self.warnings.extend(said.into_iter().map(warning));
    }

    /// Warns of events in a step along the equilibrium path, to `point`. `cosine` is the cosine of the angle between the displacements of
    /// this step and the previous step.
    pub(crate) fn see_path(&mut self, step: &Watched, point: path::Point, cosine: Option<f64>) {
        for event in self.path.add(point, cosine) {
            let (kind, text) = match event {
                Event::Turned(load) => (
                    Kind::PathTurned,
                    format!(
                        "the load turns at {load:.6e}, a limit point: the stiffness along the path changes its sign there, and under a load \
                         that is kept, bodies are unstable until it turns again"
                    ),
                ),
                Event::Bent(angle) => (
                    Kind::PathBent,
                    format!(
                        "the path of equilibria bends by {angle:.0} degrees from one step to the next: it may have gone to another branch; \
                         shorten time.step and compare"
                    ),
                ),
                Event::Returned(load) => (
                    Kind::PathReturned,
                    format!(
                        "the path of equilibria goes back the way that it came, and is at the load {load:.6e} again: what follows is \
                         nothing new; shorten time.step, or give the body a small imperfection where it may buckle"
                    ),
                ),
            };
            self.warn(step, kind, text);
        }
    }

    /// Adds a warning, if it is the first of its kind.
    fn warn(&mut self, step: &Watched, kind: Kind, message: String) {
        if self.warnings.iter().all(|warning| warning.kind != kind) {
            let Watched { time, step, .. } = *step;
            self.warnings.push(Warning { kind, time, step, message });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::schemes::Statics;
    use std::sync::{Arc, LazyLock};

    pub(super) fn step(number: u64) -> Watched<'static> {
        static SETTINGS: LazyLock<Settings> = LazyLock::new(|| Settings {
            error_tolerance: Some(1e-3),
            newton: NewtonSettings { max_iterations: 30, max_krylov_iterations: 2000, ..NewtonSettings::default() },
            ..Settings::default()
        });
        let energies = Energies {
            kinetic: 2.0,
            strain: 2.0,
            external: -9.0,
            contact: 0.0,
            dissipated: 0.0,
            by_laws: 0.0,
            friction: 0.0,
            initial: 4.0,
            total: 4.0,
            balance: -0.07,
        };
        let cost = Cost { dt: 0.1, newton: 3, krylov: 30, yielding: 0.0 };
        Watched {
            time: 0.1 * number as f64,
            step: number,
            settings: &SETTINGS,
            energies,
            cause: Cause::Wall,
            cost,
            failed: 0,
            error: None,
            limited: 0,
            stagnated: 0,
        }
    }

    /// Examines a step and returns the new warnings.
    pub(super) fn told<'a>(watch: &'a mut Watch, step: &Watched) -> &'a [Warning] {
        let known = watch.warnings.len();
        watch.see(step);
        &watch.warnings[known..]
    }

    /// Ends the run and returns the new warning.
    pub(super) fn last(watch: &mut Watch, time: f64, number: u64) -> Option<Warning> {
        let known = watch.warnings.len();
        watch.end(time, number, true);
        watch.warnings.get(known).cloned()
    }

    #[test]
    fn gain_and_loss_of_energy_are_told_once_with_time_and_value() {
        let mut watch = Watch::default();
        for number in 1..=20 {
            assert!(told(&mut watch, &step(number)).is_empty(), "{number}");
        }
        let balance = |x: f64| Watched { energies: Energies { balance: x, ..step(0).energies }, ..step(21) };
        assert!(told(&mut watch, &balance(0.039)).is_empty(), "1 % of 4 is not reached");
        let [warning] = told(&mut watch, &balance(0.08)) else { panic!("one") };
        assert_eq!((warning.kind, warning.step, warning.time), (Kind::EnergyCreated, 21, 2.1));
        assert!(warning.message.contains("+8.000e-2, 2.0 %"), "{}", warning.message);
        assert!(told(&mut watch, &balance(3.0)).is_empty(), "once");
        assert!(told(&mut watch, &balance(-0.079)).is_empty(), "2 % of 4 are not reached: work does not count");
        let statics = Settings { scheme: Arc::new(Statics::default()), ..Settings::default() };
        assert!(told(&mut watch, &Watched { settings: &statics, ..balance(-0.1) }).is_empty(), "without inertia");
        let words = [
            "1.000e-1, 2.5 % of the largest total energy 4.000e0",
            "a body meets a wall (impact)",
            "shorten time.step",
        ];
        for step in 1..USUAL_AFTER {
            assert!(told(&mut watch, &balance(-0.1)).is_empty(), "{step} steps may be a start from rest");
        }
        assert!(
            told(&mut watch, &balance(-0.1))
                .iter()
                .any(|warning| words.iter().all(|word| warning.message.contains(word)))
        );
        assert_eq!(watch.warnings.len(), 2);
        // At the end the loss is reported with its final size.
        told(&mut watch, &balance(-0.2));
        let end = last(&mut watch, 3.0, 30).map(|warning| (warning.kind, warning.time, warning.message));
        let Some((Kind::EnergyLost, 3.0, message)) = end else { panic!("{end:?}") };
        assert!(message.contains("2.000e-1, 5.0 %") && message.ends_with("more than 2 % since t = 2.1"), "{message}");
        assert_eq!(last(&mut watch, 3.0, 30), None, "once");
        // the state of the watch survives a checkpoint
        let text = serde_json::to_string(&watch).unwrap();
        assert_eq!(serde_json::from_str::<Watch>(&text).unwrap(), watch);
    }

    #[test]
    fn costs_and_errors_are_told_once_with_their_values() {
        let mut watch = Watch::default();
        for number in 1..=35 {
            assert!(told(&mut watch, &step(number)).is_empty(), "{number}");
        }
        let halved = Watched { failed: 2, ..step(22) };
        assert!(
            told(&mut watch, &halved)
                .iter()
                .any(|warning| warning.message.contains("halved 2 times, to dt = 1.000e-1"))
        );
        let inaccurate = Watched { error: Some(2e-3), ..step(22) };
        assert!(told(&mut watch, &Watched { error: Some(1e-3), ..step(22) }).is_empty());
        assert!(
            told(&mut watch, &inaccurate)
                .iter()
                .any(|warning| warning.message.contains("errs by 2.00e-3 grid spacings"))
        );
        let newton = Watched { cost: Cost { newton: 16, ..step(0).cost }, ..step(23) };
        let words = ["16 of 30", "shorten time.step"];
        assert!(
            told(&mut watch, &newton).iter().any(|warning| words.iter().all(|word| warning.message.contains(word)))
        );
        let krylov = |krylov| Watched { cost: Cost { krylov, ..step(0).cost }, ..step(24) };
        assert!(told(&mut watch, &krylov(150)).is_empty(), "five times is not more than five times");
        // the mean: 39 steps of 30 iterations, and the step of 150
        let words = ["180 iterations in a step; 33", "aggregation", "multigrid"];
        assert!(
            told(&mut watch, &krylov(180))
                .iter()
                .any(|warning| words.iter().all(|word| warning.message.contains(word)))
        );
        let limited = Watched { limited: 2, ..step(25) };
        assert!(told(&mut watch, &limited).iter().any(
            |warning| warning.message.starts_with("2 linear systems") && warning.message.contains("the 2000 iter")
        ));
        let stagnated = Watched { stagnated: 3, ..step(26) };
        assert!(told(&mut watch, &stagnated).iter().any(|warning| warning.message.starts_with("3 linear systems")));
        assert!(told(&mut watch, &stagnated).is_empty() && told(&mut watch, &limited).is_empty(), "once");
        assert_eq!(watch.warnings.len(), 6);
    }

    #[test]
    fn numbers_that_are_none_leave_it_able_to_be_saved() {
        let mut watch = Watch::default();
        let [kinetic, strain, total, balance] = [f64::NAN, f64::INFINITY, f64::NAN, f64::NAN];
        let nan = Energies { kinetic, strain, total, balance, ..Energies::default() };
        told(&mut watch, &Watched { energies: nan, ..step(1) });
        let text = serde_json::to_string(&watch).unwrap();
        assert_eq!(serde_json::from_str::<Watch>(&text).unwrap(), watch);
    }
}
