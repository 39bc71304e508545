//! The text printed at the end of a run.

use super::history::Energies;
use super::report::{Counts, Seconds};
use crate::solver::Krylov;
use std::fmt::{Display, Formatter, Result};

/// A run in a few lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Time reached.
    pub time: f64,
    /// Whether there is inertia: without it, kinetic energy and momentum are nothing, and work less energy is what loads lost that were there
    /// at once.
    pub moves: bool,
    /// Energies at the end.
    pub energies: Energies,
    /// |p − p₀|, the change of momentum.
    pub momentum_change: f64,
    /// Σ m |v| at the end, to compare it with.
    pub momentum_scale: f64,
    /// What solved the linear systems.
    pub krylov: Krylov,
    /// What was done.
    pub counts: Counts,
    /// How long it took.
    pub seconds: Seconds,
}

impl Display for Summary {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let Self { time, energies, krylov, counts, seconds, .. } = self;
        let mean = |sum: u64| sum as f64 / counts.steps.max(1) as f64;
        writeln!(
            f,
            "{} steps to t = {time} in {:.1} s: {} particles, up to {} active nodes, {} failed attempts",
            counts.steps, seconds.total, counts.particles, counts.max_active_nodes, counts.failed_attempts
        )?;
        if self.moves {
            writeln!(
                f,
                "energy    kinetic {:.6e}, strain {:.6e}, total {:.6e}, external work {:.6e}, balance {:.3e}",
                energies.kinetic, energies.strain, energies.total, energies.external, energies.balance
            )?;
            writeln!(
                f,
                "momentum  changed by {:.3e}; sum of m |v| is {:.3e}",
                self.momentum_change, self.momentum_scale
            )?;
        } else {
            writeln!(f, "energy    strain {:.6e}, external work {:.6e}", energies.strain, energies.external)?;
        }
        writeln!(
            f,
            "Newton    {:.2} iterations a step, at most {}; {:.1} of {krylov} a step",
            mean(counts.newton_iterations - counts.failed_newton_iterations),
            counts.max_newton_iterations,
            mean(counts.krylov_iterations - counts.failed_krylov_iterations)
        )?;
        write!(f, "seconds  ")?;
        for (k, (name, x)) in seconds.named().enumerate() {
            write!(f, "{} {} {x:.2}", if k == 0 { "" } else { "," }, name.replace('_', " "))?;
        }
        Ok(())
    }
}
