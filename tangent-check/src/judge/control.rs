//! The negative control: the checker spoils a tangent itself and shows that it sees it.

use super::evidence::{ColumnVerdict, Evidence};
use super::{Matrix, column};

/// Entries above this part of ‖C‖ are spoiled.
const LARGE: f64 = 0.01;

/// The spoiled entries are wrong by 10⁻³ to 10⁻¹² of themselves.
const EXPONENTS: std::ops::RangeInclusive<i32> = 3..=12;

/// The smallest relative error that shows in every entry above 1 % of ‖C‖, spoiled alone.
///
/// An entry is spoiled up and down. In an inexact column it is spoiled away from the measured entry, because the opposite would heal it.
/// An error shows if a consistent column is consistent no more, or an inexact one is wrong. No call of the law is needed.
///
/// # Errors
/// An error of 1e-3 does not show. Its size is returned.
pub(super) fn smallest_seen(evidence: &Evidence, claimed: &Matrix, verdicts: &[ColumnVerdict]) -> Result<f64, f64> {
    let mut spoiled: Vec<Spoiled> = vec![];
    for k in 0..claimed.columns {
        let claimed = column(claimed, k);
        let nearest = evidence.nearest(k, &claimed);
        for i in (0..claimed.len()).filter(|i| claimed[*i].abs() > LARGE * evidence.scale) {
            for sign in [1.0, -1.0] {
                let away = (claimed[i] - nearest.value[i]) * claimed[i] * sign >= 0.0;
                if away || verdicts[k] != ColumnVerdict::Inexact {
                    spoiled.push(Spoiled { column: k, row: i, sign, claimed: claimed.clone(), verdict: verdicts[k] });
                }
            }
        }
    }
    let mut smallest = None;
    for exponent in EXPONENTS {
        let size = 10.0_f64.powi(-exponent);
        if spoiled.is_empty() || !spoiled.iter().all(|entry| entry.shows(size, evidence)) {
            break;
        }
        smallest = Some(size);
    }
    smallest.ok_or(1e-3)
}

/// An entry that is spoiled.
struct Spoiled {
    column: usize,
    row: usize,
    sign: f64,
    claimed: Vec<f64>,
    verdict: ColumnVerdict,
}

impl Spoiled {
    /// Whether the entry, spoiled by `size`, changes the verdict over its column.
    fn shows(&self, size: f64, evidence: &Evidence) -> bool {
        let mut column = self.claimed.clone();
        column[self.row] *= 1.0 + self.sign * size;
        let verdict = evidence.verdict(self.column, &column);
        verdict != ColumnVerdict::Consistent && (verdict != ColumnVerdict::Inexact || self.verdict != verdict)
    }
}
