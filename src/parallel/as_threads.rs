//! Processes that are threads of one program, for tests.

use super::held;
use super::processes::{Exchange, Processes};
use std::sync::{Arc, Barrier, Mutex};

/// The parts of all processes.
#[derive(Debug)]
struct Board {
    parts: Vec<Mutex<Vec<u8>>>,
    barrier: Barrier,
}

/// A process that is a thread of this program.
#[derive(Debug)]
struct Thread {
    rank: usize,
    board: Arc<Board>,
}

impl Processes {
    /// This many processes, each for one thread of this program. A call ends when all of them have made it. None of the threads may belong to
    /// the pool.
    ///
    /// Example: [`Processes`].
    pub fn as_threads(count: usize) -> Vec<Self> {
        let parts = (0..count).map(|_| Mutex::default()).collect();
        let board = Arc::new(Board { parts, barrier: Barrier::new(count) });
        (0..count).map(|rank| Self::new(Thread { rank, board: board.clone() })).collect()
    }
}

impl Exchange for Thread {
    fn rank(&self) -> usize {
        self.rank
    }

    fn count(&self) -> usize {
        self.board.parts.len()
    }

    fn exchange(&self, lengths: &[usize], all: &mut [u8]) {
        let start = |rank: usize| lengths[..rank].iter().sum::<usize>();
        let own = start(self.rank)..start(self.rank + 1);
        held(&self.board.parts[self.rank]).splice(.., all[own].iter().copied());
        self.board.barrier.wait();
        for (rank, part) in self.board.parts.iter().enumerate().filter(|(rank, _)| *rank != self.rank) {
            all[start(rank)..start(rank + 1)].copy_from_slice(&held(part));
        }
        self.board.barrier.wait();
    }
}
