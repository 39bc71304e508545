//! Progress of a run on standard error: a bar on a terminal, a line now and then elsewhere, or lines of JSON for a program.

use super::history::Cost;
use super::report::Number;
use super::warnings::Warning;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;
use std::collections::VecDeque;
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// Seconds over which the pace is measured.
const WINDOW: f64 = 30.0;

/// Time between two lines of progress where standard error is not a terminal.
const LINE_INTERVAL: Duration = Duration::from_secs(10);

/// Time between two lines of JSON.
const JSON_INTERVAL: Duration = Duration::from_millis(100);

/// Resolution of the bar.
const BAR_LENGTH: f64 = 1000.0;

/// Predicts the time left from the simulated time per wall-clock second of the recent past. Impacts and halved steps slow a run down. An
/// average since the start would hide the slower pace.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pace {
    /// (wall-clock seconds, simulated time), oldest first.
    marks: VecDeque<(f64, f64)>,
}

impl Pace {
    /// Records that simulated `time` is reached at wall-clock second `wall`.
    pub fn mark(&mut self, wall: f64, time: f64) {
        self.marks.push_back((wall, time));
        // The marks must cover the window: a mark is removed when the next mark is old enough to be the first.
        while self.marks.get(1).is_some_and(|&(second, _)| second <= wall - WINDOW) {
            self.marks.pop_front();
        }
    }

    /// Wall-clock seconds until `end`; `None` before any progress is measured.
    pub fn left(&self, end: f64) -> Option<f64> {
        let (&(wall_0, time_0), &(wall_1, time_1)) = (self.marks.front()?, self.marks.back()?);
        let left = (end - time_1) * ((wall_1 - wall_0) / (time_1 - time_0));
        left.is_finite().then_some(left.max(0.0))
    }
}

/// The reader of the progress.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Audience {
    /// Nobody. Warnings are still written.
    Nobody,
    /// A person at a terminal, or a person who reads a log.
    #[default]
    Person,
    /// A program. Each line is a JSON object with the key `event`: `step` (at most ten a second, and the last step) or `warning`.
    Program,
}

/// Shows the progress of a run.
#[derive(Debug)]
pub(crate) struct Progress {
    audience: Audience,
    /// The bar, for a person at a terminal.
    bar: Option<ProgressBar>,
    /// The last line for a log or a program, and a line for a program that came too soon after it.
    last: Option<Instant>,
    held: Option<String>,
    pace: Pace,
    since: Instant,
    start: f64,
    end: f64,
}

/// Writes a line to standard error. A closed standard error does not stop the run.
fn line(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// The progress bar of a person at a terminal.
fn bar() -> ProgressBar {
    let bar = ProgressBar::new(BAR_LENGTH as u64);
    // If indicatif refuses the constant template, its own style is shown.
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {percent:>3}%  {elapsed_precise}  {msg}") {
        bar.set_style(style);
    }
    bar
}

impl Progress {
    /// Starts now, at simulated time `start`, towards `end`.
    pub fn new(start: f64, end: f64, audience: Audience) -> Self {
        let since = Instant::now();
        let bar = (audience == Audience::Person && std::io::stderr().is_terminal()).then(bar);
        // A program is told of the first step, a log only after a while.
        let last = (audience == Audience::Person).then_some(since);
        let mut pace = Pace::default();
        pace.mark(0.0, start);
        Self { audience, bar, last, held: None, pace, since, start, end }
    }

    /// Shows that `time` is reached, with the energy `balance` so far, gained (> 0) or lost; `None` without inertia.
    pub fn show(&mut self, time: f64, step: u64, cost: &Cost, balance: Option<f64>) {
        let Cost { newton, krylov, .. } = *cost;
        let (elapsed, end) = (self.since.elapsed().as_secs_f64(), self.end);
        self.pace.mark(elapsed, time);
        let left = self.pace.left(end);
        let text = || {
            let left = left.map_or_else(|| "unknown".to_owned(), readable);
            let balance = balance.map_or_else(String::new, |balance| format!("balance {balance:+.1e}, "));
            format!("t = {time:.6} of {end:.6}, step {step}, Newton {newton}, Krylov {krylov}, {balance}{left} left")
        };
        let is_due = |interval| self.last.is_none_or(|last| last.elapsed() >= interval);
        match (self.audience, &self.bar) {
            (Audience::Person, Some(bar)) => {
                bar.set_position((BAR_LENGTH * (time - self.start) / (end - self.start)) as u64);
                bar.set_message(text());
            }
            (Audience::Person, None) if is_due(LINE_INTERVAL) => {
                line(&text());
                self.last = Some(Instant::now());
            }
            (Audience::Program, _) => {
                let text = json!({
                    "event": "step", "step": step, "time": Number(time), "end": Number(end), "newton": newton, "krylov": krylov,
                    "balance": balance.map(Number), "seconds": elapsed, "seconds_left": left,
                })
                .to_string();
                if is_due(JSON_INTERVAL) {
                    line(&text);
                    (self.last, self.held) = (Some(Instant::now()), None);
                } else {
                    self.held = Some(text);
                }
            }
            _ => {}
        }
    }

    /// Writes a warning for every audience.
    pub(crate) fn warn(&self, warning: &Warning) {
        let Warning { kind, time, step, message } = warning;
        let text = format!("warning: t = {time}, step {step}: {message}");
        match (self.audience, &self.bar) {
            (Audience::Program, _) => {
                let time = Number(*time);
                let text = json!({"event": "warning", "kind": kind, "time": time, "step": step, "message": message});
                line(&text.to_string());
            }
            (_, Some(bar)) => bar.suspend(|| line(&text)),
            _ => line(&text),
        }
    }

    /// Removes the bar, or shows the line that was held back.
    pub fn finish(self) {
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
        if let Some(text) = self.held {
            line(&text);
        }
    }
}

/// Seconds in a readable unit.
fn readable(seconds: f64) -> String {
    match seconds {
        s if s < 100.0 => format!("{s:.0} s"),
        s if s < 6000.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.1} days", s / 86_400.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_estimate_follows_the_recent_pace() {
        let mut pace = Pace::default();
        assert_eq!(pace.left(10.0), None);
        pace.mark(0.0, 0.0);
        assert_eq!(pace.left(10.0), None);
        // one unit a second for 5 s, then a tenth of that for longer than the window
        pace.mark(5.0, 5.0);
        assert_eq!(pace.left(10.0), Some(5.0));
        for second in 1..=40 {
            pace.mark(5.0 + f64::from(second), 5.0 + 0.1 * f64::from(second));
        }
        assert!(pace.left(10.0).is_some_and(|left| (left - 10.0).abs() < 1e-9), "{:?}", pace.left(10.0));
        assert!(pace.marks.len() <= 32);
    }
}
