//! One measured value with its bound and verdict; and the counts of each kind of cell.

use serde::{Serialize, Serializer};
use std::fmt;

/// The requirement on a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// Not more than this.
    AtMost(f64),
    /// Not less than this.
    AtLeast(f64),
    /// Not less than the first, not more than the second.
    Between(f64, f64),
    /// Finite; the value is shown and not judged further.
    Reported,
}

impl Bound {
    /// Whether `value` meets the bound; NaN never does.
    pub fn holds(&self, value: f64) -> bool {
        match *self {
            Self::AtMost(high) => value <= high,
            Self::AtLeast(low) => value >= low,
            Self::Between(low, high) => value >= low && value <= high,
            Self::Reported => value.is_finite(),
        }
    }

    /// The used share of the bound: 1 at the bound, more beyond it, infinite for NaN.
    pub(super) fn used(&self, value: f64) -> f64 {
        let used = match *self {
            // Only zero meets a bound of zero.
            Self::AtMost(high) => {
                if value == 0.0 {
                    0.0
                } else {
                    value / high
                }
            }
            Self::AtLeast(low) if value > 0.0 => low / value,
            // Values that are not positive have no ratio.
            Self::AtLeast(low) => {
                if value >= low {
                    0.0
                } else {
                    f64::INFINITY
                }
            }
            Self::Between(low, high) => (2.0 * value - low - high).abs() / (high - low),
            Self::Reported => {
                if value.is_finite() {
                    0.0
                } else {
                    f64::INFINITY
                }
            }
        };
        if used.is_nan() { f64::INFINITY } else { used }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AtMost(high) => write!(f, "<= {}", short(*high)),
            Self::AtLeast(low) => write!(f, ">= {}", short(*low)),
            Self::Between(low, high) => write!(f, "{} .. {}", short(*low), short(*high)),
            Self::Reported => write!(f, "-"),
        }
    }
}

impl Serialize for Bound {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// A number in the fewest characters that show its size.
pub fn short(x: f64) -> String {
    if x == 0.0 {
        "0".into()
    } else if (0.01..1e4).contains(&x.abs()) {
        let text = format!("{x:.4}");
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        format!("{x:.1e}")
    }
}

/// The entry of a cell in the list of known failures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Listed {
    /// The value measured at the time of listing.
    pub value: f64,
    /// A value that misses the bound by this factor more is a new failure.
    pub factor: f64,
}

/// The verdict on a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Judged, and within its bound.
    Met,
    /// Not judged.
    Shown,
    /// Beyond its bound, and on the list of known failures with about this value.
    Known,
    /// Beyond its bound; or on the list of known failures and within its bound again, or much worse.
    Failed,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Met => "ok",
            Self::Shown => "-",
            Self::Known => "known failure",
            Self::Failed => "FAIL",
        })
    }
}

/// One measured value.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// The labels of the measured value, one for each column of the report.
    pub labels: Vec<String>,
    /// The value.
    pub value: f64,
    /// The requirement on the value.
    pub bound: Bound,
    /// Its entry in the list of known failures.
    pub listed: Option<Listed>,
}

impl Cell {
    /// The verdict.
    pub fn verdict(&self) -> Verdict {
        let holds = self.bound.holds(self.value);
        match self.listed {
            None if !holds => Verdict::Failed,
            None if self.bound == Bound::Reported => Verdict::Shown,
            None => Verdict::Met,
            Some(listed) => {
                let allowed = listed.factor * self.bound.used(listed.value);
                if !holds && self.bound.used(self.value) <= allowed { Verdict::Known } else { Verdict::Failed }
            }
        }
    }

    /// Whether it does not fail.
    pub fn passed(&self) -> bool {
        self.verdict() != Verdict::Failed
    }

    /// Value and bound, and the entry in the list of known failures.
    pub fn finding(&self) -> String {
        let found = format!("{} ({})", short(self.value), self.bound);
        match self.listed {
            None => found,
            Some(listed) => {
                let said = format!("{found}, known to fail with {}", short(listed.value));
                match self.verdict() {
                    Verdict::Failed if self.bound.holds(self.value) => {
                        format!("{said}, and passes: take it off the list")
                    }
                    Verdict::Failed => format!("{said}, and more than {} times worse", short(listed.factor)),
                    _ => said,
                }
            }
        }
    }

    /// The labels in one line.
    pub fn name(&self) -> String {
        self.labels.join(", ")
    }
}

/// The number of cells of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Cells with a bound, met or not; without known failures.
    pub judged: usize,
    /// Cells without a bound.
    pub shown: usize,
    /// Known failures.
    pub known: usize,
    /// Judged cells that fail.
    pub failed: usize,
}

impl Counts {
    pub(super) fn of<'a>(cells: impl Iterator<Item = &'a Cell>) -> Self {
        cells.fold(Self::default(), |mut counts, cell| {
            match cell.verdict() {
                Verdict::Met => counts.judged += 1,
                Verdict::Shown => counts.shown += 1,
                Verdict::Known => counts.known += 1,
                Verdict::Failed => (counts.judged, counts.failed) = (counts.judged + 1, counts.failed + 1),
            }
            counts
        })
    }
}

impl std::iter::Sum for Counts {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |a, b| Self {
            judged: a.judged + b.judged,
            shown: a.shown + b.shown,
            known: a.known + b.known,
            failed: a.failed + b.failed,
        })
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.failed > 0 {
            write!(f, "{} of ", self.failed)?;
        }
        write!(f, "{} judged", self.judged)?;
        if self.failed > 0 {
            write!(f, " failed")?;
        }
        if self.shown > 0 {
            write!(f, ", {} shown", self.shown)?;
        }
        match self.known {
            0 => Ok(()),
            1 => write!(f, ", 1 known failure"),
            known => write!(f, ", {known} known failures"),
        }
    }
}

/// The cell closest to its bound; the first one if several are equal.
pub(crate) fn worst<'a>(cells: impl Iterator<Item = &'a Cell>) -> Option<&'a Cell> {
    // A known failure that passes again is a failure, however far it is within its bound.
    let badness = |cell: &Cell| (cell.verdict() == Verdict::Failed, cell.bound.used(cell.value));
    cells.fold(None, |worst: Option<&Cell>, cell| match worst {
        Some(worst) if badness(worst) >= badness(cell) => Some(worst),
        _ => Some(cell),
    })
}
