//! Progress of a run on standard error: a bar on a terminal, a line now and then elsewhere, or lines of JSON for a program.

use super::history::Cost;
use super::plot::rounded;
use super::report::Number;
use super::warnings::Warning;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::json;
use std::io::Write;
use std::time::{Duration, Instant};

/// Time between two lines of progress where standard error is not a terminal.
const LINE_INTERVAL: Duration = Duration::from_secs(10);

/// Time between two lines of JSON.
const JSON_INTERVAL: Duration = Duration::from_millis(100);

/// Resolution of the bar.
const BAR_LENGTH: f64 = 1e9;

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
    /// The bar, hidden unless a person sees a terminal. It also predicts the time left, from the pace of the recent past.
    bar: ProgressBar,
    /// The last line for a log or a program.
    last: Option<Instant>,
    /// A line for a program that came too soon after the last one.
    held: Option<String>,
    since: Instant,
    start: f64,
    end: f64,
}

/// Writes a line to standard error. A closed standard error does not stop the run.
fn line(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

impl Progress {
    /// Starts now, at simulated time `start`, towards `end`.
    pub(crate) fn new(start: f64, end: f64, audience: Audience) -> Self {
        let since = Instant::now();
        let bar = ProgressBar::new(BAR_LENGTH as u64);
        if audience != Audience::Person {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        // If indicatif refuses the constant template, its own style is shown.
        if let Ok(style) = ProgressStyle::with_template("{bar:30} {percent:>3}%  {elapsed_precise}  {msg}") {
            bar.set_style(style);
        }
        // A program is told of the first step, a log only after a while.
        let last = (audience == Audience::Person).then_some(since);
        Self { audience, bar, last, held: None, since, start, end }
    }

    /// Shows that `time` is reached, with the energy `balance` so far, gained (> 0) or lost; `None` without inertia.
    pub(crate) fn show(&mut self, time: f64, step: u64, cost: &Cost, balance: Option<f64>) {
        let (Cost { newton, krylov, .. }, end) = (*cost, self.end);
        self.bar.set_position((BAR_LENGTH * (time - self.start) / (end - self.start)) as u64);
        let left = (self.bar.per_sec() > 0.0).then(|| self.bar.eta());
        let text = || {
            let left = left.map_or_else(|| "unknown".to_owned(), |left| HumanDuration(left).to_string());
            let balance = balance.map_or_else(String::new, |balance| format!("balance {balance:+.1e}, "));
            format!("t = {time:.6} of {end:.6}, step {step}, Newton {newton}, Krylov {krylov}, {balance}{left} left")
        };
        let is_due = |interval| self.last.is_none_or(|last| last.elapsed() >= interval);
        match self.audience {
            Audience::Person if !self.bar.is_hidden() => self.bar.set_message(text()),
            Audience::Person if is_due(LINE_INTERVAL) => {
                line(&text());
                self.last = Some(Instant::now());
            }
            Audience::Program => {
                let text = json!({
                    "event": "step", "step": step, "time": Number(time), "end": Number(end), "newton": newton, "krylov": krylov,
                    "balance": balance.map(Number), "seconds": self.since.elapsed().as_secs_f64(), "seconds_left": left.as_ref().map(Duration::as_secs_f64),
                })
                .to_string();
                if is_due(JSON_INTERVAL) {
                    line(&text);
                    (self.last, self.held) = (Some(Instant::now()), None);
                } else {
                    self.held = Some(text);
                }
            }
            Audience::Person | Audience::Nobody => {}
        }
    }

    /// Writes a warning for every audience.
    pub(crate) fn warn(&self, warning: &Warning) {
        let Warning { kind, time, step, message } = warning;
        let text = match self.audience {
            Audience::Program => {
                let time = Number(*time);
                json!({"event": "warning", "kind": kind, "time": time, "step": step, "message": message}).to_string()
            }
            _ => format!("warning: t = {}, step {step}: {message}", rounded(*time)),
        };
        self.bar.suspend(|| line(&text));
    }

    /// Removes the bar, or shows the line that was held back.
    pub(crate) fn finish(self) {
        self.bar.finish_and_clear();
        self.held.iter().for_each(|text| line(text));
    }
}
