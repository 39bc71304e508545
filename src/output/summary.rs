//! The text printed at the end of a run.

use super::contact::Contact;
use super::history::Energies;
use super::report::{Counts, Seconds};
use super::warnings::Warning;
use crate::solver::Krylov;
use std::fmt::{Display, Formatter, Result};

/// A run in a few lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Time reached.
    pub time: f64,
    /// Whether there is inertia. Without inertia, kinetic energy and momentum are zero. Loads then act at once and lose the excess of work
    /// over energy.
    pub has_inertia: bool,
    /// Energies at the end.
    pub energies: Energies,
    /// |p − p₀|, the change of momentum.
    pub momentum_change: f64,
    /// Σ m |v| at the end, the scale of `momentum_change`.
    pub momentum_scale: f64,
    /// The solver of the linear systems.
    pub krylov: Krylov,
    /// Bodies that shared nodes.
    pub contact: Vec<Contact>,
    /// The warnings that were given.
    pub warnings: Vec<Warning>,
    /// Counts over all steps.
    pub counts: Counts,
    /// Seconds of the run by phase.
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
        if self.has_inertia {
            let Energies { kinetic, strain, total, external, dissipated, by_laws, initial, balance } = energies;
            writeln!(f, "energy    kinetic {kinetic:.6e}, strain {strain:.6e}, total {total:.6e}")?;
            let (error, size) = if *balance > 0.0 { ("+ created", *balance) } else { ("- lost", -balance) };
            writeln!(
                f,
                "balance   total {total:.6e} = initial {initial:.6e} + external work {external:.6e} - dissipated {dissipated:.6e} (by laws \
                 {by_laws:.6e}) {error} {size:.3e}"
            )?;
            writeln!(
                f,
                "momentum  changed by {:.3e}; sum of m |v| is {:.3e}",
                self.momentum_change, self.momentum_scale
            )?;
        } else {
            let Energies { strain, external, dissipated, by_laws, initial, balance, .. } = energies;
            let (error, size) = if *balance > 0.0 { ("+", *balance) } else { ("-", -balance) };
            writeln!(
                f,
                "energy    strain {strain:.6e} = initial {initial:.6e} + external work {external:.6e} - dissipated {dissipated:.6e} (by laws \
                 {by_laws:.6e}) {error} rest of the load steps {size:.3e}"
            )?;
        }
        writeln!(
            f,
            "Newton    {:.2} iterations a step, at most {}; {:.1} of {krylov} a step",
            mean(counts.newton_iterations - counts.failed_newton_iterations),
            counts.max_newton_iterations,
            mean(counts.krylov_iterations - counts.failed_krylov_iterations)
        )?;
        for contact in &self.contact {
            writeln!(f, "contact   {contact}")?;
        }
        for Warning { time, step, message, .. } in &self.warnings {
            writeln!(f, "warned    t = {time}, step {step}: {message}")?;
        }
        write!(f, "seconds  ")?;
        for (k, (name, x)) in seconds.named().enumerate() {
            write!(f, "{} {} {x:.2}", if k == 0 { "" } else { "," }, name.replace('_', " "))?;
        }
        Ok(())
    }
}
