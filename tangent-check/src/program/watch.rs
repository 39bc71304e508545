//! Progress and the time limit of a check.

use crate::convention::Convention;
use crate::law::{CallFailed, Law, Response, Step};
use std::time::{Duration, Instant};

/// A state takes about so many calls.
const CALLS_A_STATE: usize = 150;

/// The time between two lines of progress. A fast law has none.
const PAUSE: Duration = Duration::from_secs(10);

/// A law that tells progress, and that fails after a time limit.
pub(super) struct Watched<L> {
    law: L,
    name: String,
    start: Instant,
    limit: Duration,
    told: Instant,
    calls: usize,
    expected: usize,
}

impl<L: Law> Watched<L> {
    pub(super) fn new(law: L, name: String, limit: Duration) -> Self {
        let now = Instant::now();
        Self { law, name, start: now, limit, told: now, calls: 0, expected: 0 }
    }

    /// Says how many states will be checked.
    pub(super) fn expect(&mut self, states: usize) {
        self.expected = states * CALLS_A_STATE;
    }

    fn count(&mut self) -> Result<(), CallFailed> {
        self.calls += 1;
        let passed = self.start.elapsed();
        if passed > self.limit {
            return Err(CallFailed(format!(
                "The check lasts longer than {:?}; the law was not called again. Allow more with --total-limit, or give fewer states \
                 with --states.",
                self.limit
            )));
        }
        if self.told.elapsed() > PAUSE {
            self.told = Instant::now();
            let (calls, expected) = (self.calls, self.expected.max(self.calls));
            eprintln!("tangent-check: {calls} of about {expected} calls after {} s", passed.as_secs());
        }
        Ok(())
    }
}

impl<L: Law> Law for Watched<L> {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn convention(&self) -> Convention {
        self.law.convention()
    }

    fn state_at_rest(&self) -> Vec<f64> {
        self.law.state_at_rest()
    }

    fn respond(&mut self, step: &Step) -> Result<Response, CallFailed> {
        self.count()?;
        self.law.respond(step)
    }
}
