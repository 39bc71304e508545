//! The cause of inexact tangents of a law, from all of its states.

use super::{Perturbed, Road, Visit};
use crate::difference::Ladder;
use crate::finding::{Finding, Reason, Verdict};
use crate::judge::{LOOSE, Suspect};
use crate::law::Law;
use crate::matrix::Matrix;
use crate::tensor::scaled;

/// A cause that shows in this part of the inexact states is that of the law.
const PART: f64 = 0.3;

/// Steps h of forward differences that differ by less than this factor are the same.
const SAME: f64 = 1.3;

/// The tangent of a law is a forward difference if this part of its inexact states shows one, and this part of those the same h.
const SHOWN: f64 = 0.1;
const AGREE: f64 = 0.8;

/// From so many inexact states it is taken whether they are forward differences.
const SAMPLE: usize = 24;

/// In so many states it is tried whether the claimed tangent is erratic.
const TRIED: usize = 8;

/// A tangent whose round-off is this part of its deviation is erratic: a quotient of small differences.
const ERRATIC: f64 = 0.1;

/// The findings of one road, and the law in the steps that they are about.
pub(super) struct Causes<'a> {
    pub law: &'a mut dyn Law,
    pub road: Road,
    pub visits: &'a [Visit],
}

impl Causes<'_> {
    /// Names the cause in all inexact states. A state that seems wrong is inexact, if it is the forward difference that others show, or
    /// deviates little in a law that is loose in others.
    pub fn name(&mut self, findings: &mut [Finding]) {
        let inexact: Vec<usize> = (0..findings.len()).filter(|index| unnamed(&findings[*index])).collect();
        if inexact.is_empty() {
            return;
        }
        let sample = inexact.iter().step_by(inexact.len().div_ceil(SAMPLE));
        let size = sample.len();
        let steps: Vec<f64> = sample.filter_map(|index| self.step(*index, &mut findings[*index])).collect();
        let middle = median(steps.clone()).unwrap_or(0.0);
        let same = steps.iter().filter(|h| (1.0 / SAME..SAME).contains(&(*h / middle))).count();
        let enough = same as f64 >= SHOWN * size as f64 && same >= size.min(3);
        let mut forward = (enough && same as f64 >= AGREE * steps.len() as f64).then_some(middle);
        if inexact.iter().any(|index| findings[*index].verdict == Verdict::Wrong) {
            forward = forward.map(|h| self.sharpened(findings, h));
        }
        let cause = match forward {
            Some(h) => Reason::ForwardDifference(h),
            None => self.other(findings, &inexact),
        };
        for index in inexact {
            let seems_wrong = findings[index].verdict == Verdict::Wrong;
            let loose = matches!(cause, Reason::LocalIteration(_)) && findings[index].deviation <= LOOSE;
            let shown = !seems_wrong || loose || forward.is_some_and(|h| self.is_step(index, &findings[index], h));
            let finding = &mut findings[index];
            if shown && finding.verdict != Verdict::NotChecked {
                (finding.verdict, finding.reason) = (Verdict::Inexact, Some(cause.clone()));
            }
        }
    }

    /// The h of a forward difference that this state shows.
    fn step(&mut self, index: usize, finding: &mut Finding) -> Option<f64> {
        if let Some(Reason::ForwardDifference(h)) = finding.reason {
            return Some(h);
        }
        let h = self.suspect(index, finding, |suspect| suspect.step(Ladder::default())).flatten();
        h.inspect(|h| (finding.verdict, finding.reason) = (Verdict::Inexact, Some(Reason::ForwardDifference(*h))))
    }

    /// The h of the states that show one, to all digits: a quotient that reaches just beyond a kink asks for more than the smooth states need.
    fn sharpened(&mut self, findings: &[Finding], h: f64) -> f64 {
        let shows = |index: &usize| matches!(findings[*index].reason, Some(Reason::ForwardDifference(_)));
        let shown = (0..findings.len()).filter(shows).take(TRIED);
        let sharpened =
            shown.filter_map(|index| self.suspect(index, &findings[index], |suspect| suspect.sharpened(h)).flatten());
        median(sharpened.collect()).unwrap_or(h)
    }

    fn is_step(&mut self, index: usize, finding: &Finding, h: f64) -> bool {
        self.suspect(index, finding, |suspect| suspect.is_step(h)) == Some(true)
    }

    /// Asks whether a tangent is a forward difference along (I + h B) F₁, or along the strain.
    fn suspect<T>(&mut self, index: usize, finding: &Finding, ask: impl Fn(&mut Suspect) -> T) -> Option<T> {
        let mut perturbed = Perturbed::new(self.law, &self.visits[index].step, self.road);
        perturbed.linear = true;
        let value = perturbed.value(0, 0.0).ok()?;
        Some(ask(&mut Suspect { finding, value: &value, respond: &mut |k, h| perturbed.value(k, h) }))
    }

    /// The cause of tangents that do not bend as a forward difference does.
    fn other(&mut self, findings: &[Finding], inexact: &[usize]) -> Reason {
        let count = |cause: fn(&Reason) -> bool| {
            inexact.iter().filter(|index| findings[**index].reason.as_ref().is_some_and(cause)).count() as f64
        };
        let tried = inexact.iter().step_by(inexact.len().div_ceil(TRIED)).copied();
        let erratic = median(tried.filter_map(|index| self.erratic(index, &findings[index])).collect());
        if let Some(h) = erratic.filter(|h| *h > 0.0) {
            return Reason::ForwardDifference(h);
        }
        let sizes = inexact.iter().filter_map(|index| match findings[*index].reason {
            Some(Reason::LocalIteration(size)) => Some(size),
            _ => None,
        });
        let part = PART * inexact.len() as f64;
        let single = count(|reason| *reason == Reason::SinglePrecision);
        if count(|reason| matches!(reason, Reason::LocalIteration(_))) >= part {
            Reason::LocalIteration(sizes.fold(0.0, f64::max))
        } else if single >= part {
            Reason::SinglePrecision
        } else {
            Reason::NotFound
        }
    }

    /// The h of a forward difference whose round-off ε |σ|/h is the noise of the claimed tangent; 0 if the tangent is smooth.
    fn erratic(&mut self, index: usize, finding: &Finding) -> Option<f64> {
        let step = &self.visits[index].step;
        let mut moved = step.clone();
        moved.strain_increment = scaled(1.0 + 1e-14, &moved.strain_increment);
        moved.gradient = scaled(1.0 + 1e-15, &moved.gradient);
        let [first, second] = [self.law.respond(step).ok()?, self.law.respond(&moved).ok()?];
        let difference =
            |a: &Matrix, b: &Matrix| a.entries.iter().zip(&b.entries).fold(0.0_f64, |d, (a, b)| d.max((a - b).abs()));
        let noise = difference(&first.tangent, &second.tangent);
        let size = first.stress.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
        let shown = noise > ERRATIC * difference(&finding.claimed, &finding.measured);
        Some(if shown { f64::EPSILON * size / noise } else { 0.0 })
    }
}

/// Whether a cause is asked for.
fn unnamed(finding: &Finding) -> bool {
    let judged = matches!(finding.verdict, Verdict::Wrong | Verdict::Inexact);
    judged && finding.reason != Some(Reason::RoundOff)
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
