//! The evidence of the measurements about one column of a claimed tangent.

use super::loose;
use super::measured::{Measured, NOISY, SMALL, column, greatest};
use crate::difference::{Derivative, ERRORS, Estimate};
use crate::finding::Entry;
use crate::matrix::Matrix;

/// The round-off of a claimed tangent over ‖C‖, in units of ε.
const ROUND_OFF: f64 = 4.0;

/// The round-off of what is left of a stiffness, over the stiffness at rest: that of 1 − D, times the steepness of D.
const LOST: f64 = 1e-9;

/// A side whose error is this many times that of the best estimate is blurred.
const BLURRED: f64 = 10.0;

/// The verdict over one column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColumnVerdict {
    Consistent,
    Inexact,
    Kink,
    Wrong,
}

/// The measurements of one column.
pub(super) struct Column {
    /// The derivatives that the column may match: the best, or those to both sides of a kink that are sharp.
    accepted: Vec<Estimate>,
    /// The derivatives to both sides. While a blurred side could be the claimed column, a kink cannot be excluded.
    sides: Vec<Estimate>,
    kink: bool,
    /// Whether the difference at the smallest perturbation contradicts the best.
    contradicted: bool,
}

/// The measured tangent in the form in which columns are judged.
pub(super) struct Evidence {
    /// The columns.
    pub columns: Vec<Column>,
    /// ‖C‖, the greatest entry of the measured tangent.
    pub scale: f64,
    /// The deviation that is inexact: a small part of ‖C‖, the round-off of lost stiffness, or what a loose local iteration explains.
    inexact: f64,
    /// The scale of the law: ‖C‖, or its stiffness at rest if that is greater.
    pub law: f64,
}

impl Evidence {
    /// The evidence of differences.
    pub fn of(measured: &Measured) -> Self {
        let mut columns: Vec<Column> = measured.columns.iter().map(Column::of).collect();
        let values = measured.columns.iter().flat_map(|column| column.best().value);
        let scale = values.filter(|value| value.is_finite()).fold(0.0_f64, |greatest, value| greatest.max(value.abs()));
        let law = scale.max(measured.stiffness);
        for Column { accepted, sides, kink, .. } in &mut columns {
            for error in accepted.iter_mut().chain(&mut *sides).flat_map(|estimate| &mut estimate.error) {
                *error += ROUND_OFF * f64::EPSILON * law;
            }
            if *kink {
                accepted.retain(|side| side.greatest_error() <= NOISY * law);
            }
        }
        let jump = measured.jump.map_or(0.0, |jump| jump.slope().min(loose::LOOSE * scale));
        let round_off = LOST * law;
        Self { columns, scale, inexact: jump.max(SMALL * scale).max(round_off), law }
    }

    /// ‖C‖; of the claimed tangent, if the measured one is zero.
    pub fn scale_for(&self, claimed: &Matrix) -> f64 {
        if self.scale > 0.0 { self.scale } else { claimed.greatest() }
    }

    /// The verdict over column `k`, if the law claims `claimed`.
    pub fn verdict(&self, k: usize, claimed: &[f64]) -> ColumnVerdict {
        let Column { accepted, sides, kink, contradicted } = &self.columns[k];
        let any = |allowed| accepted.iter().any(|side| self.matches(side, claimed, allowed));
        if any(0.0) {
            return ColumnVerdict::Consistent;
        }
        if any(self.inexact) {
            return ColumnVerdict::Inexact;
        }
        let possible = sides.iter().any(|side| self.blurred(side, accepted) && self.matches(side, claimed, 0.0));
        if *kink || *contradicted || possible { ColumnVerdict::Kink } else { ColumnVerdict::Wrong }
    }

    /// Whether a side is far less sharp than what a column must match.
    fn blurred(&self, side: &Estimate, accepted: &[Estimate]) -> bool {
        accepted.iter().all(|best| side.greatest_error() > BLURRED * best.greatest_error())
    }

    /// Whether no entry deviates by more than its error allows, or than `allowed`.
    fn matches(&self, side: &Estimate, claimed: &[f64], allowed: f64) -> bool {
        let mut entries = claimed.iter().zip(side.value.iter().zip(&side.error));
        // An entry that could not be measured has an infinite error, and deviates by NaN, which is not greater.
        !entries.any(|(c, (d, e))| (c - d).abs() > (ERRORS * e).max(allowed))
    }

    /// The estimate of column `k` from which the claimed column deviates least, in errors.
    pub fn nearest(&self, k: usize, claimed: &[f64]) -> Estimate {
        let excess = |side: &Estimate| {
            let entries = claimed.iter().zip(side.value.iter().zip(&side.error));
            entries.fold(0.0_f64, |greatest, (c, (d, e))| greatest.max((c - d).abs() / e))
        };
        let Column { accepted, sides, .. } = &self.columns[k];
        let candidates = if accepted.is_empty() { sides } else { accepted };
        let nearest = candidates.iter().min_by(|a, b| excess(a).total_cmp(&excess(b)));
        nearest.cloned().unwrap_or_else(|| Estimate::none(claimed.len()))
    }

    /// Whether an entry deviates by more than its error allows.
    pub fn deviates(&self, entry: &Entry) -> bool {
        entry.deviation() > ERRORS * entry.error
    }

    /// Whether the claimed and the measured tangent are zero within the errors, or below a small part of the scale of the law.
    pub fn is_zero(&self, claimed: &Matrix) -> bool {
        let nothing = if self.law > self.scale { SMALL * self.law } else { 0.0 };
        (0..claimed.columns).all(|k| {
            let nearest = self.nearest(k, &column(claimed, k));
            (0..claimed.rows).all(|i| {
                let small = |value: f64| value.abs() <= (ERRORS * nearest.error[i]).max(nothing);
                small(nearest.value[i]) && small(claimed[(i, k)])
            })
        })
    }

    /// The greatest deviation in column `k`.
    pub fn deviation(&self, k: usize, claimed: &Matrix) -> f64 {
        let column = column(claimed, k);
        let nearest = self.nearest(k, &column);
        greatest(&column.iter().zip(&nearest.value).map(|(c, d)| c - d).collect::<Vec<f64>>())
    }
}

impl Column {
    fn of(derivative: &Derivative) -> Self {
        let measured = |side: &&Estimate| side.value.iter().any(|value| value.is_finite());
        let sides: Vec<Estimate> =
            [&derivative.forward, &derivative.backward].into_iter().filter(measured).cloned().collect();
        let kink = derivative.has_kink();
        let accepted = if kink { sides.clone() } else { vec![derivative.best()] };
        Self { accepted, sides, kink, contradicted: derivative.contradicted }
    }
}
