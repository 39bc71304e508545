//! The key `accuracy`: its rows must have the accuracy that they state, and each row must cost more than the one before.

use super::measured::{Measured, Point};
use super::problem::Problem;
use super::setting::{Origin, Setting};
use crate::report::{Bound, Report};
use crate::studies::Effort;
use bfree::scene::accuracy::{Accuracy, Level, levels};

/// The largest ratio of an error to the error aimed for.
const MET: f64 = 1.1;

/// The most cells of a row in three dimensions: more take minutes at full effort, or seconds at short effort.
fn most_cells_3d(effort: Effort) -> f64 {
    if effort == Effort::Full { 12.0 } else { 8.0 }
}

/// The settings of the words and the rows of the table; at full effort also of errors between the rows.
pub(super) fn settings(problem: &dyn Problem, effort: Effort) -> Vec<Setting> {
    asked(effort)
        .into_iter()
        .filter_map(|accuracy| Some((accuracy, accuracy.level()?)))
        .filter(|(_, level)| problem.dimension() < 3 || level.cells <= most_cells_3d(effort))
        .map(|(accuracy, level)| {
            let mut keys = vec![format!("accuracy={accuracy}")];
            keys.extend(problem.spacing_of(level.cells).map(|spacing| format!("grid.spacing={spacing}")));
            Setting { origin: Origin::Accuracy(accuracy.to_string()), keys, level: None, courant: None }
        })
        .collect()
}

/// The requested accuracies, by falling error.
fn asked(effort: Effort) -> Vec<Accuracy> {
    let named = |level: &Level| match level.name {
        Some("draft") => Accuracy::Draft,
        Some("standard") => Accuracy::Standard,
        Some("reference") => Accuracy::Reference,
        _ => Accuracy::Error(level.error),
    };
    let rows = levels();
    match effort {
        Effort::Short => rows.iter().filter(|level| level.name.is_some()).map(named).collect(),
        Effort::Full => {
            let between = rows
                .windows(2)
                .filter(|pair| pair[0].error.is_finite())
                .map(|pair| Accuracy::Error((pair[0].error * pair[1].error).sqrt()));
            let mut all: Vec<_> = rows.iter().map(named).chain(between).collect();
            let error = |one: &Accuracy| one.level().map_or(0.0, |level| level.error);
            all.sort_by(|a, b| error(b).total_cmp(&error(a)));
            all
        }
    }
}

/// The report: the order of the words, and at full effort the errors aimed for, on problems without jumps.
pub(super) fn report(all: &[Measured], effort: Effort) -> Report {
    let mut report = Report::new("the key `accuracy`", &["what", "accuracy", "problem"]);
    for measured in all {
        let of = |accuracy: Accuracy| -> Option<&Point> {
            let origin = Origin::Accuracy(accuracy.to_string());
            measured.points.iter().find(|point| point.setting.origin == origin)
        };
        let mut before: Option<&Point> = None;
        for accuracy in [Accuracy::Draft, Accuracy::Standard, Accuracy::Reference] {
            let Some(point) = of(accuracy) else { continue };
            let name = accuracy.to_string();
            if let Some(before) = before {
                report.push(
                    &["error over that of the word before", &name, measured.problem],
                    point.error / before.error,
                    Bound::AtMost(1.0),
                );
                report.push(
                    &["work over that of the word before", &name, measured.problem],
                    point.cost.work / before.cost.work,
                    Bound::AtLeast(1.0),
                );
            }
            before = Some(point);
        }
        if effort == Effort::Full {
            for accuracy in asked(effort) {
                let (Some(point), Some(level)) = (of(accuracy), accuracy.level()) else { continue };
                let bound =
                    if measured.smooth && level.error.is_finite() { Bound::AtMost(MET) } else { Bound::Reported };
                report.push(
                    &["error over the one aimed for", &accuracy.to_string(), measured.problem],
                    point.error / level.error,
                    bound,
                );
            }
        }
    }
    report
}
