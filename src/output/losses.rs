//! Energy that a run loses beyond the dissipation by damping and laws, summed by the event of each step.

use super::history::Energies;
use serde::{Deserialize, Serialize};

/// The event of a step that may lose energy. Of several events, the first in this list counts.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Cause {
    /// A body touches an obstacle or another body.
    Obstacle,
    /// A body feels a wall that it has come to.
    Wall,
    /// Bodies share nodes.
    Bodies,
    /// The grid has been reset.
    NewGrid,
    /// None of these events.
    Step,
}

impl Cause {
    /// All causes, with the steps of each in words.
    const ALL: [(Self, &'static str); 5] = [
        (Self::Obstacle, "steps in which a body touches an obstacle or another body"),
        (Self::Wall, "steps in which a body meets a wall (impact)"),
        (Self::Bodies, "steps in which bodies share nodes (impact, or sticking)"),
        (Self::NewGrid, "other steps with a new grid"),
        (Self::Step, "steps without contact on a grid that is kept"),
    ];

    /// The cause of losses in a step.
    pub(crate) fn of(touches: bool, feels_wall: bool, shares: bool, renewed: bool) -> Self {
        match (touches, feels_wall, shares, renewed) {
            (true, ..) => Self::Obstacle,
            (_, true, ..) => Self::Wall,
            (.., true, _) => Self::Bodies,
            (.., true) => Self::NewGrid,
            _ => Self::Step,
        }
    }

    /// A setting that keeps more energy in these steps.
    fn cure(self, lumped: bool) -> &'static str {
        match (self, lumped) {
            (Self::Wall | Self::Bodies, true) => {
                "shorten time.step, with which the loss falls; a smaller time.lumping keeps more energy only where bodies meet at less than \
                 about a tenth of their speed of sound"
            }
            (Self::Wall | Self::Bodies, false) => {
                "shorten time.step, with which the loss falls; time.lumping = 1 keeps more energy where bodies meet at more than about a \
                 tenth of their speed of sound"
            }
            (Self::Obstacle, false) => {
                "a contact that is a third as stiff keeps more energy (the key stiffness of obstacles and contact), and so does a finer grid"
            }
            (Self::Obstacle, true) => {
                "time.lumping = 0.1 with \"grid\": {\"reset\": {\"strain\": 0.3}} keeps most energy; then lower the stiffness of the contact"
            }
            (Self::NewGrid, _) => {
                "keep the grid where bodies are free: \"grid\": {\"reset\": {\"strain\": 0.1}}, or \"never\""
            }
            (Self::Step, _) => "shorten time.step, or give time.adaptive a tolerance",
        }
    }
}

/// The energy lost so far, by its cause.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Losses {
    /// The balance of energy after the last step.
    balance: f64,
    /// The fall of the balance, by [`Cause`].
    by_cause: [f64; Cause::ALL.len()],
    /// The largest sum of kinetic, strain and dissipated energy so far.
    largest: f64,
    /// The lowest and the highest balance so far.
    #[serde(default)]
    range: [f64; 2],
}

impl Losses {
    /// Adds a step.
    pub(crate) fn add(&mut self, energies: &Energies, cause: Cause) {
        let Energies { kinetic, strain, dissipated, balance, .. } = *energies;
        let energy = kinetic.abs() + strain.abs() + dissipated.abs();
        if energy.is_finite() && balance.is_finite() {
            self.largest = self.largest.max(energy);
            self.by_cause[cause as usize] += self.balance - balance;
            self.balance = balance;
            self.range = [self.range[0].min(balance), self.range[1].max(balance)];
        }
    }

    /// The lowest and the highest balance so far, as fractions of the largest energy.
    pub(crate) fn range(&self) -> [f64; 2] {
        self.range.map(|balance| if self.largest > 0.0 { balance / self.largest } else { 0.0 })
    }

    /// The loss as a fraction of the largest energy so far.
    pub(crate) fn part(&self) -> f64 {
        if self.largest > 0.0 { -self.balance / self.largest } else { 0.0 }
    }

    /// A message with the loss, its causes and a cure. `lumped`: whether the mass matrix is lumped in full.
    pub(crate) fn says(&self, lumped: bool) -> String {
        let lost: f64 = self.by_cause.iter().filter(|&&lost| lost > 0.0).sum();
        let mut causes: Vec<_> =
            Cause::ALL.into_iter().zip(self.by_cause).filter(|(_, by)| *by > 0.05 * lost).collect();
        causes.sort_by(|a, b| b.1.total_cmp(&a.1));
        let shares: Vec<_> =
            causes.iter().map(|((_, steps), by)| format!("{:.0} % of it in {steps}", 100.0 * by / lost)).collect();
        let cure = causes.first().map_or("", |((cause, _), _)| cause.cure(lumped));
        format!(
            "energy was lost, beyond what damping and laws took: {:.3e}, {:.1} % of the largest total energy {:.3e}; {}: {cure}",
            -self.balance,
            100.0 * self.part(),
            self.largest,
            shares.join(", ")
        )
    }
}
