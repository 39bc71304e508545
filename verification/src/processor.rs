//! Processor time.

use std::time::{Duration, Instant};

/// The processor time of this thread; if the system does not report it, the wall-clock time.
#[derive(Clone, Copy, Debug)]
pub struct Thread {
    wall: Instant,
    processor: Option<Duration>,
}

impl Thread {
    /// A measurement that starts now.
    pub fn now() -> Self {
        Self { wall: Instant::now(), processor: processor_time() }
    }

    /// The wall-clock time since the start.
    pub fn wall(&self) -> Duration {
        self.wall.elapsed()
    }

    /// Processor seconds since the start.
    pub fn elapsed(&self) -> f64 {
        let used = self.processor.zip(processor_time()).map(|(start, end)| end.saturating_sub(start));
        used.unwrap_or_else(|| self.wall.elapsed()).as_secs_f64()
    }
}

/// Nanoseconds of processor time: the first number of Linux's schedstat.
fn processor_time() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(Duration::from_nanos(text.split_whitespace().next()?.parse().ok()?))
}
