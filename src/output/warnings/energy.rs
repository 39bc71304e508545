//! Warnings of energy that is lost or created.

use super::{Cause, Kind, USUAL_AFTER, Warning, Watch, Watched};

/// Created energy, as a fraction of the largest total energy so far, above which there is a warning.
const CREATED: f64 = 0.01;

/// Lost energy, as a fraction of the largest total energy so far, above which there is a warning.
const LOST: f64 = 0.02;

/// Energy that is lost or created and comes back, as a fraction of the largest total energy, above which there is a warning at the end.
const SWUNG: f64 = 0.05;

impl Watch {
    /// Warns of created or lost energy.
    pub(super) fn see_energy(&mut self, step: &Watched) {
        self.losses.add(&step.energies, step.cause);
        self.lumped = step.settings.lumping >= 1.0;
        // In load steps, loads act at once and lose work.
        let has_inertia = step.settings.scheme.has_inertia();
        let (created, balance) = (-self.losses.part(), step.energies.balance);
        self.creating = if has_inertia && created > CREATED { self.creating + 1 } else { 0 };
        // In the first steps of contact from rest there is next to no energy.
        let at_obstacle = matches!(step.cause, Cause::Obstacle);
        if self.creating >= if at_obstacle { USUAL_AFTER } else { 1 } {
            let part = 100.0 * created;
            let text = format!(
                "energy was created: the balance is {balance:+.3e}, {part:.1} % of the largest total energy so far"
            );
            self.warn(step, Kind::EnergyCreated, text);
        }
        // In the first steps from rest there is next to no energy.
        self.losing = if has_inertia && -created > LOST { self.losing + 1 } else { 0 };
        if self.losing >= USUAL_AFTER {
            self.warn(step, Kind::EnergyLost, self.losses.says(self.lumped));
        }
    }

    /// Ends the run after step `number`, which ended at `time`. A loss of energy is reported again with its final size. Of the last steps,
    /// and of losses and gains that came back, this is the first report.
    pub(crate) fn end(&mut self, time: f64, step: u64, has_inertia: bool) {
        let kind = Kind::EnergyLost;
        let of = |kind| self.warnings.iter().filter(move |warning| warning.kind == kind).map(|warning| warning.time);
        let mut told = of(kind);
        let Some(first) = told.next() else {
            if has_inertia && self.seen > USUAL_AFTER && of(Kind::EnergyCreated).next().is_none() {
                self.end_untold(time, step);
            }
            return;
        };
        if self.losing > 0 && told.next_back().unwrap_or(first) != time {
            let said = self.losses.says(self.lumped);
            let message = format!("{said}; more than {} % since t = {first}", 100.0 * LOST);
            self.warnings.push(Warning { kind, time, step, message });
        }
    }

    /// Warns of a loss in the last steps, or of a balance that swung, in a run without a warning of its energy.
    fn end_untold(&mut self, time: f64, step: u64) {
        let [low, high] = self.losses.range().map(|part| 100.0 * part);
        let warning = if self.losing > 0 {
            Some((Kind::EnergyLost, self.losses.says(self.lumped)))
        } else if high - low > 100.0 * SWUNG {
            let text = format!(
                "energy was lost or created, and came back: the balance lay between {low:+.1} % and {high:+.1} % of the largest total \
                 energy; history.csv shows when; compare a run with half the step"
            );
            Some((Kind::EnergySwung, text))
        } else {
            None
        };
        self.warnings.extend(warning.map(|(kind, message)| Warning { kind, time, step, message }));
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{last, step, told};
    use super::*;
    use crate::output::history::Energies;

    #[test]
    fn a_loss_is_told_with_where_it_was_lost_and_not_in_the_first_steps() {
        let lost = |x: f64, cause| Watched { energies: Energies { balance: -x, ..step(0).energies }, cause, ..step(1) };
        let mut watch = Watch::default();
        assert!(told(&mut watch, &lost(0.3, Cause::Bodies)).is_empty());
        for _ in 2..USUAL_AFTER {
            assert!(told(&mut watch, &lost(0.4, Cause::NewGrid)).is_empty());
            assert_eq!(last(&mut watch, 0.2, 2), None, "a start from rest has next to no energy");
        }
        let [warning] = told(&mut watch, &lost(0.4, Cause::NewGrid)) else { panic!("one") };
        let Warning { kind: Kind::EnergyLost, message, .. } = warning else { panic!("{warning:?}") };
        assert!(
            message.contains("75 % of it in steps in which bodies share nodes")
                && message.contains("25 % of it in other"),
            "{message}"
        );
        let mut watch = Watch::default();
        told(&mut watch, &lost(0.07, Cause::Step));
        assert_eq!(last(&mut watch, 0.1, 1), None, "less than 2 %");
    }

    #[test]
    fn energy_that_goes_and_comes_back_is_told_at_the_end() {
        let ended = |balances: &[f64], has_inertia| {
            let mut watch = Watch::default();
            for (k, &balance) in balances.iter().enumerate() {
                let at = step(k as u64 + 1);
                told(
                    &mut watch,
                    &Watched { energies: Energies { balance, ..at.energies }, cause: Cause::Obstacle, ..at },
                );
            }
            let told = watch.warnings.len();
            watch.end(2.0, balances.len() as u64, has_inertia);
            watch.warnings[told..].iter().map(|one| (one.kind, one.message.clone())).collect::<Vec<_>>()
        };
        // The energy is 4: 23 % are lost and come back.
        let swung = [&[0.0; 12][..], &[-0.92; 5], &[0.28], &[0.0; 3]].concat();
        let [(Kind::EnergySwung, text)] = &ended(&swung, true)[..] else { panic!("one") };
        assert!(text.contains("between -23.0 % and +7.0 %"), "{text}");
        assert!(ended(&swung, false).is_empty() && ended(&[0.0; 20], true).is_empty());
        // A loss in the last steps, and one that stays below 2 %.
        let late = |balance| [&[0.0; 12][..], &[balance; 3]].concat();
        assert!(matches!(&ended(&late(-0.1), true)[..], [(Kind::EnergyLost, _)]));
        assert!(ended(&late(-0.07), true).is_empty());
    }
}
