//! The cells that a fault must turn red, written down beforehand, against the cells that it does turn red.

use crate::report::{Bound, Report};

/// A forecast: cells of one quantity (first label) that must turn red. The second label (mostly the dimension) is in `within`; the third
/// label is not in `except`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Red {
    pub quantity: &'static str,
    pub within: &'static [&'static str],
    pub except: &'static [&'static str],
}

/// Every dimension.
pub(super) const ALL: &[&str] = &["1", "2", "3"];
/// The dimensions with shears and rotations; in 1D such a fault has no effect.
pub(super) const PLANE_AND_SPACE: &[&str] = &["2", "3"];

/// The forecast of every cell of a quantity within some dimensions.
pub(super) const fn red(quantity: &'static str, within: &'static [&'static str]) -> Red {
    Red { quantity, within, except: &[] }
}

impl Red {
    /// The forecast without the cases in which the fault is invisible or absent.
    pub(super) const fn except(self, except: &'static [&'static str]) -> Self {
        Self { except, ..self }
    }

    fn holds(&self, labels: &[String]) -> bool {
        let label = |k: usize| labels.get(k).map_or("", String::as_str);
        self.quantity == label(0) && self.within.contains(&label(1)) && !self.except.contains(&label(2))
    }
}

/// The report of the study: one cell per fault, with the number of cells whose colour is not the forecast one.
pub(super) fn report() -> Report {
    Report::new(
        "faults in laws and shape functions: cells whose colour is not the one foretold",
        &["fault", "killed by", "red cells", "of", "in"],
    )
}

/// Compares the result of a check with the forecast. An equivalent mutant has an empty forecast: every cell stays green.
pub(super) fn judge(report: &mut Report, fault: &str, check: &str, found: &Report, forecast: &[Red]) {
    let mut wrong = 0;
    let mut places: Vec<String> = Vec::new();
    for cell in found.cells() {
        let (foretold, is_red) = (forecast.iter().any(|red| red.holds(&cell.labels)), !cell.passed());
        if foretold != is_red {
            wrong += 1;
            let colour = if is_red { "red" } else { "green" };
            report.note(format!("{fault}: {} is {colour} ({:.1e}, {})", cell.name(), cell.value, cell.bound));
        }
        let place = cell.labels.first().cloned().unwrap_or_default();
        if is_red && !places.contains(&place) {
            places.push(place);
        }
    }
    // A forecast without a matching cell predicts nothing.
    for red in forecast.iter().filter(|red| !found.cells().iter().any(|cell| red.holds(&cell.labels))) {
        wrong += 1;
        report.note(format!("{fault}: no cell measures {} within {:?}", red.quantity, red.within));
    }
    let (count, all) = (found.failures().count().to_string(), found.cells().len().to_string());
    let places = if places.is_empty() { "equivalent: nothing".to_string() } else { places.join("; ") };
    report.push(&[fault, check, &count, &all, &places], f64::from(wrong), Bound::AtMost(0.0));
}
