//! The timer of a step: seconds and loops over the particles, by phase.

use std::time::Instant;

/// The phases of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Shape functions and active nodes.
    ShapeFunctions,
    /// Particle-to-grid transfer.
    Projection,
    /// Newton's method, with its residuals, tangents and Krylov iterations.
    Newton,
    /// Reactions, work, grid-to-particle transfer.
    Update,
}

impl Phase {
    /// All phases with the names used in reports.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::ShapeFunctions, "shape_functions"),
        (Self::Projection, "projection"),
        (Self::Newton, "newton"),
        (Self::Update, "update"),
    ];
}

/// Measures the phases of a step, one after the other.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    last: (Instant, u64),
    /// The number of phases that are over.
    over: usize,
    seconds: [f64; Phase::ALL.len()],
    passes: [u64; Phase::ALL.len()],
}

impl Stopwatch {
    /// Starts now.
    pub(crate) fn start() -> Self {
        Self { last: (Instant::now(), 0), over: 0, seconds: [0.0; Phase::ALL.len()], passes: [0; Phase::ALL.len()] }
    }

    /// Adds the seconds and the loops over the particles since the last lap to `phase`. `passes` is the total number of loops so far.
    pub fn lap(&mut self, phase: Phase, passes: u64) {
        let now = Instant::now();
        self.seconds[phase as usize] += (now - self.last.0).as_secs_f64();
        self.passes[phase as usize] += passes - self.last.1;
        self.last = (now, passes);
        self.over = phase as usize + 1;
    }

    /// Adds the time since the last lap to the phase that began then and failed.
    pub fn give_up(&mut self) {
        if let Some(&(phase, _)) = Phase::ALL.get(self.over) {
            self.lap(phase, self.last.1);
        }
    }

    /// Seconds in each of [`Phase::ALL`].
    pub fn seconds(&self) -> [f64; Phase::ALL.len()] {
        self.seconds
    }

    /// Loops over the particles in each of [`Phase::ALL`].
    pub fn passes(&self) -> [u64; Phase::ALL.len()] {
        self.passes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_time_is_lost_and_none_is_counted_twice() {
        let start = Instant::now();
        let mut watch = Stopwatch::start();
        let sum: f64 = (1..10_000).map(|i| f64::from(i).recip()).sum();
        watch.lap(Phase::Newton, 3);
        watch.lap(Phase::Update, 5);
        assert_eq!(watch.passes().iter().sum::<u64>(), 5);
        let seconds = watch.seconds();
        assert!(sum > 9.0 && seconds[Phase::Newton as usize] > 0.0 && seconds[Phase::Projection as usize] == 0.0);
        assert!(seconds.iter().sum::<f64>() <= start.elapsed().as_secs_f64());
    }

    #[test]
    fn a_step_that_fails_after_the_projection_has_failed_in_newtons_method() {
        let mut watch = Stopwatch::start();
        watch.lap(Phase::Projection, 2);
        watch.give_up();
        assert!(watch.seconds()[Phase::Newton as usize] > 0.0);
    }
}
