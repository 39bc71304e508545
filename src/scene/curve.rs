//! Factors as functions of time, or of a coordinate.

use crate::problems::{Number, Problems};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A factor in time: rows `[t, factor]`, linear in between and constant outside.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(transparent)]
pub struct Curve(pub Vec<[f64; 2]>);

impl Curve {
    pub(super) fn check(&self, problems: &mut Problems, path: &str) {
        check_times(problems, path, self.0.iter().map(|row| row[0]));
        for (i, row) in self.0.iter().enumerate() {
            problems.number(&format!("{path}[{i}][1]"), row[1]);
        }
    }
}

/// Checks the times of a table or curve: at least one, finite and increasing.
pub(super) fn check_times(problems: &mut Problems, path: &str, times: impl Iterator<Item = f64>) {
    let mut last: Option<f64> = None;
    for (i, t) in times.enumerate() {
        let path = format!("{path}[{i}][0]");
        problems.number(&path, t);
        if let Some(last) = last.filter(|last| t <= *last) {
            let allowed = format!("must be greater than in the row before, {}", Number(last));
            problems.refuse(&path, Number(t), allowed);
        }
        last = Some(t);
    }
    problems.require(last.is_some(), path, "an empty list", "must have at least one row");
}
