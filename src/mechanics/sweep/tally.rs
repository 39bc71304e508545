//! What is counted of a step's sweeps.

use std::sync::atomic::{AtomicU64, Ordering};

/// The active nodes, and how often the sweeps have gone through all particles.
#[derive(Debug, Default)]
pub(super) struct Tally {
    pub nodes: usize,
    passes: AtomicU64,
}

impl Tally {
    pub fn of(nodes: usize) -> Self {
        Self { nodes, passes: AtomicU64::new(0) }
    }

    /// Another pass through the particles begins.
    pub fn pass(&self) {
        self.passes.fetch_add(1, Ordering::Relaxed);
    }

    pub fn passes(&self) -> u64 {
        self.passes.load(Ordering::Relaxed)
    }
}

impl Clone for Tally {
    fn clone(&self) -> Self {
        Self { nodes: self.nodes, passes: AtomicU64::new(self.passes()) }
    }
}
