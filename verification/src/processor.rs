//! Time on a processor.

use std::time::{Duration, Instant};

/// The time that this thread has had a processor; where the system does not say, the time of the clock on the wall.
#[derive(Clone, Copy, Debug)]
pub struct Thread {
    wall: Instant,
    processor: Option<Duration>,
}

impl Thread {
    /// From now on.
    pub fn now() -> Self {
        Self { wall: Instant::now(), processor: processor_time() }
    }

    /// The time since then by the clock on the wall.
    pub fn wall(&self) -> Duration {
        self.wall.elapsed()
    }

    /// Seconds on a processor since then.
    pub fn elapsed(&self) -> f64 {
        let used = self.processor.zip(processor_time()).map(|(start, end)| end.saturating_sub(start));
        used.unwrap_or_else(|| self.wall.elapsed()).as_secs_f64()
    }
}

/// The first number of Linux's schedstat: nanoseconds on a processor.
fn processor_time() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(Duration::from_nanos(text.split_whitespace().next()?.parse().ok()?))
}
