//! All numbers of a report, for programs. `json.schema.json` describes the format.
//!
//! One line, with keys in alphabetical order. JSON has no number for NaN and ±∞: such a value is null, and `not_finite` of the same object gives its
//! path and its name.

use super::options::Options;
use super::words;
use crate::finding::{Diagnosis, Entry, Finding, Reason, Report};
use crate::json::{Map, Value, json};
use crate::matrix::Matrix;

/// The version of the format. It rises with every change that a reader can notice.
const VERSION: u32 = 2;

pub(super) fn write(report: &Report, options: &Options) -> String {
    let value = json!({
        "columns": report.columns,
        "conclusion": words::conclusion(report, options),
        "convention": report.convention,
        "diagnoses": report.diagnoses.iter().map(diagnosis).collect::<Vec<_>>(),
        "allow_inexact": options.allow_inexact,
        "exit_code": report.exit_code(options),
        "findings": report.findings.iter().map(finding).collect::<Vec<_>>(),
        "format": "tangent-check",
        "notes": report.notes,
        "rows": report.rows,
        "seed": report.seed,
        "subject": report.subject,
        "verdict": words::verdict(report.verdict()),
        "version": VERSION,
    });
    format!("{value}\n")
}

/// Numbers of one object, and those of them that are not finite, by their path.
#[derive(Default)]
struct Numbers {
    not_finite: Map,
}

impl Numbers {
    fn number(&mut self, path: &str, value: f64) -> Value {
        if !value.is_finite() {
            self.not_finite.insert(path.to_owned(), json!(value.to_string()));
        }
        json!(value)
    }

    fn matrix(&mut self, path: &str, matrix: &Matrix) -> Value {
        let rows = matrix.entries.chunks(matrix.columns.max(1)).enumerate();
        let row = |(i, row): (usize, &[f64])| {
            let entry = |(j, value): (usize, &f64)| self.number(&format!("{path}/{i}/{j}"), *value);
            row.iter().enumerate().map(entry).collect::<Value>()
        };
        rows.map(row).collect()
    }

    fn worst(&mut self, entry: &Entry) -> Value {
        json!({
            "claimed": self.number("worst/claimed", entry.claimed),
            "column": entry.column,
            "error": self.number("worst/error", entry.error),
            "measured": self.number("worst/measured", entry.measured),
            "row": entry.row,
        })
    }

    fn reason(&mut self, reason: &Reason) -> Value {
        let (kind, size) = match reason {
            Reason::ForwardDifference(h) => ("forward difference", Some(*h)),
            Reason::SinglePrecision => ("single precision", None),
            Reason::LocalIteration(size) => ("local iteration", Some(*size)),
            Reason::RoundOff => ("round-off", None),
            Reason::NotFound => ("not found", None),
            Reason::Kink => ("kink", None),
            Reason::NothingExercised => ("nothing exercised", None),
            Reason::ZeroResponse => ("zero response", None),
            Reason::TooNoisy(size) => ("too noisy", Some(*size)),
            Reason::ControlMissed(size) => ("control missed", Some(*size)),
            Reason::CallFailed(_) => ("call failed", None),
        };
        let size = size.map(|size| self.number("reason/size", size));
        json!({ "kind": kind, "sentence": words::cause(Some(reason)), "size": size })
    }
}

fn finding(finding: &Finding) -> Value {
    let mut numbers = Numbers::default();
    let mut value = json!({
        "calls": finding.calls,
        "claimed": numbers.matrix("claimed", &finding.claimed),
        "control": finding.control.map(|control| numbers.number("control", control)),
        "deviation": numbers.number("deviation", finding.deviation),
        "error": numbers.number("error", finding.error),
        "errors": numbers.matrix("errors", &finding.errors),
        "measured": numbers.matrix("measured", &finding.measured),
        "name": finding.name,
        "noise": numbers.number("noise", finding.noise),
        "reason": finding.reason.as_ref().map(|reason| numbers.reason(reason)),
        "verdict": words::verdict(finding.verdict),
        "worst": finding.worst.as_ref().map(|entry| numbers.worst(entry)),
    });
    value.insert("not_finite", json!(numbers.not_finite));
    value
}

fn diagnosis(diagnosis: &Diagnosis) -> Value {
    let mut numbers = Numbers::default();
    let coefficient = diagnosis.coefficient.map(|coefficient| numbers.number("coefficient", coefficient));
    let share = numbers.number("share", diagnosis.share);
    json!({
        "candidates": diagnosis.candidates,
        "coefficient": coefficient,
        "not_finite": numbers.not_finite,
        "sentence": diagnosis.sentence,
        "share": share,
        "states_that_tell": diagnosis.states_that_tell,
    })
}
