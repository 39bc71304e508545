//! `report.json`: settings, outcome and cost of a run, and the iterations and residuals of Newton's method in every step.

pub use super::counts::{Counts, Seconds};
use super::files::write_atomically;
use super::history::Energies;
use super::{OutputError, Summary};
use crate::causes;
use crate::simulation::{AdvanceError, FailedAttempt, StepReport};
use crate::solver::NewtonHistory;
use serde::{Serialize, Serializer};
use serde_json::{Map, Value, json};
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;

/// Outcome of a run.
#[derive(Clone, Copy, Debug)]
pub enum Outcome<'a> {
    /// The run reached its end.
    Finished,
    /// The run was asked to stop, and stopped after a whole step.
    Interrupted,
    /// A step failed.
    Failed(&'a AdvanceError),
}

impl Outcome<'_> {
    /// The outcome in one word, and in a sentence about a run that reached `time`.
    fn words(&self, time: f64) -> (&'static str, String) {
        match self {
            Self::Finished => ("finished", format!("reached t = {time}")),
            Self::Interrupted => (
                "interrupted",
                format!("stopped on request at t = {time}, after a whole step; all files are complete up to it"),
            ),
            Self::Failed(error) => ("failed", causes::on_one_line(*error)),
        }
    }
}

/// A float in JSON, which has no NaN and no infinity. NaN and infinities become the strings "NaN", "inf" and "-inf" instead of null.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Number(pub f64);

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0.is_finite() { serializer.serialize_f64(self.0) } else { serializer.collect_str(&self.0) }
    }
}

fn numbers(list: impl IntoIterator<Item = f64>) -> Vec<Number> {
    list.into_iter().map(Number).collect()
}

/// A step, or a failed attempt at a step, in the report.
#[derive(Debug, Serialize)]
struct Attempt<'a> {
    /// t_{n+1} of a step.
    #[serde(skip_serializing_if = "Option::is_none")]
    time: Option<Number>,
    dt: Number,
    /// Cause of the failure of a failed attempt.
    #[serde(skip_serializing_if = "Option::is_none")]
    why: Option<&'a str>,
    /// Iterations of the projection onto the nodes.
    projection_iterations: usize,
    /// ‖R‖ at the initial guess and after each iteration.
    newton_residuals: Vec<Number>,
    /// Krylov iterations of each Newton iteration.
    krylov_iterations: Vec<usize>,
    /// True relative residual of the linear system in each Newton iteration.
    krylov_residuals: Vec<Number>,
    /// All Krylov iterations, including linear systems that gave no Newton step.
    krylov_total: usize,
    /// Failed attempts at a step.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    failed_attempts: Vec<Attempt<'a>>,
}

impl<'a> Attempt<'a> {
    fn new(dt: f64, projection_iterations: usize, history: &NewtonHistory) -> Self {
        let iterations = &history.iterations;
        let residuals = history.first_residual.into_iter().chain(iterations.iter().map(|one| one.residual));
        Self {
            time: None,
            dt: Number(dt),
            why: None,
            projection_iterations,
            newton_residuals: numbers(residuals),
            krylov_iterations: iterations.iter().map(|one| one.krylov.iterations).collect(),
            krylov_residuals: numbers(iterations.iter().map(|one| one.krylov.relative_residual)),
            krylov_total: history.counts.krylov_iterations,
            failed_attempts: Vec::new(),
        }
    }

    fn failed(attempts: &'a [FailedAttempt]) -> Vec<Self> {
        let line = |one: &'a FailedAttempt| Self {
            why: Some(&one.why),
            ..Self::new(one.dt, one.projection_iterations, &one.newton)
        };
        attempts.iter().map(line).collect()
    }
}

/// The line in `newton.jsonl` of a step that ended at `time`: iterations and residuals of Newton's method.
pub(crate) fn newton_line<const D: usize>(time: f64, step: &StepReport<D>) -> serde_json::Result<String> {
    serde_json::to_string(&Attempt {
        time: Some(Number(time)),
        failed_attempts: Attempt::failed(&step.failed),
        ..Attempt::new(step.dt, step.projection_iterations, &step.newton.history)
    })
}

/// Writes `report.json`, all or nothing, with the entries `asked` of the caller. The lines of `newton.jsonl` at `log` become its steps.
pub(crate) fn write(
    path: &Path,
    log: &Path,
    asked: &Map<String, Value>,
    outcome: Outcome<'_>,
    summary: &Summary,
) -> Result<(), OutputError> {
    let lines = BufReader::new(File::open(log).map_err(OutputError::io("read", log))?).lines();
    write_atomically(path, |file| {
        let head = serde_json::to_string_pretty(&head(asked, outcome, summary))?;
        // The object is left open for one more key.
        write!(file, "{},\n  \"steps\": [", head.strip_suffix("\n}").unwrap_or(&head))?;
        for (k, line) in lines.enumerate() {
            write!(file, "{}\n    {}", if k == 0 { "" } else { "," }, line?)?;
        }
        file.write_all(b"\n  ]\n}\n")
    })
}

fn head(asked: &Map<String, Value>, outcome: Outcome<'_>, summary: &Summary) -> Value {
    let Energies { kinetic, strain, external, contact, dissipated, by_laws, friction, initial, total, balance } =
        summary.energies;
    let seconds = summary.seconds.named().chain([("total", summary.seconds.total)]);
    let seconds: Map<_, _> = seconds.map(|(name, x)| (name.to_owned(), json!(Number(x)))).collect();
    let (word, message) = outcome.words(summary.time);
    let mut head = json!({
        "program": concat!("bfree ", env!("CARGO_PKG_VERSION")), "outcome": word, "message": message,
        "time": Number(summary.time), "mass": Number(summary.mass),
        "energies": {
            "kinetic": Number(kinetic), "strain": Number(strain), "external": Number(external),
            "contact": Number(contact), "dissipated": Number(dissipated), "dissipated_by_laws": Number(by_laws),
            "dissipated_by_friction": Number(friction), "initial": Number(initial),
            "total": Number(total), "balance": Number(balance),
        },
        "counts": summary.counts, "seconds": seconds, "warnings": summary.warnings, "contact": summary.contact,
        "obstacles": summary.obstacles,
        "pairs": summary.pairs,
    });
    if let Outcome::Failed(error) = outcome {
        head["failed_attempts"] = json!(Attempt::failed(&error.failed));
    }
    asked.iter().for_each(|(key, value)| head[key] = value.clone());
    head
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lines_of_every_step_end_in_the_report_and_nothing_becomes_null() -> Result<(), Box<dyn std::error::Error>> {
        let directory = tempfile::tempdir()?;
        let energies = Energies { kinetic: f64::NAN, strain: 0.1, total: f64::INFINITY, ..Energies::default() };
        let settings = json!({"nested": {"deep": {}}});
        let asked = Map::from_iter([("settings".to_owned(), settings.clone())]);
        let summary = Summary { time: 0.1 + 0.2, energies, ..Summary::default() };
        for lines in [&[][..], &["[1.0,1e-9]"], &["[1.0,1e-9]", "[]", "[2.5]"]] {
            let log = directory.path().join("newton.jsonl");
            std::fs::write(&log, lines.iter().map(|line| format!("{line}\n")).collect::<String>())?;
            let path = directory.path().join("report.json");
            write(&path, &log, &asked, Outcome::Finished, &summary)?;
            let read: Value = serde_json::from_slice(&std::fs::read(&path)?)?;
            let residuals: Vec<Value> =
                lines.iter().map(|line| serde_json::from_str(line)).collect::<Result<_, _>>()?;
            assert_eq!(read["steps"], Value::from(residuals));
            assert_eq!((&read["settings"], &read["outcome"]), (&settings, &"finished".into()));
            assert_eq!((&read["energies"]["kinetic"], &read["energies"]["total"]), (&"NaN".into(), &"inf".into()));
            assert_eq!(read["time"], 0.1 + 0.2);
        }
        Ok(())
    }
}
