//! The text printed at the end of a run.

use super::contact::Contact;
use super::counts::{Counts, Seconds};
use super::history::Energies;
use super::touched::Touched;
use super::warnings::Warning;
use crate::solver::Krylov;
use std::fmt::{Display, Formatter, Result};

/// A run in a few lines.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Time reached.
    pub time: f64,
    /// Mass of all bodies.
    pub mass: f64,
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
    /// Obstacles that bodies touched.
    pub obstacles: Vec<Touched>,
    /// Pairs of bodies that touched.
    pub pairs: Vec<Touched>,
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
        let Energies { kinetic, strain, contact, total, external, dissipated, by_laws, friction, initial, balance } =
            energies;
        let size = balance.abs();
        let by_friction = if *friction != 0.0 { format!(", by friction {friction:.6e}") } else { String::new() };
        let terms = format!(
            "initial {initial:.6e} + external work {external:.6e} - dissipated {dissipated:.6e} (by laws {by_laws:.6e}{by_friction})"
        );
        if self.has_inertia {
            let error = if *balance > 0.0 { "+ created" } else { "- lost" };
            let in_contact = if *contact > 0.0 { format!(", contact {contact:.6e}") } else { String::new() };
            writeln!(f, "energy    kinetic {kinetic:.6e}, strain {strain:.6e}{in_contact}, total {total:.6e}")?;
            writeln!(f, "balance   total {total:.6e} = {terms} {error} {size:.3e}")?;
            let [change, scale] = [self.momentum_change, self.momentum_scale];
            writeln!(f, "momentum  changed by {change:.3e}; sum of m |v| is {scale:.3e}")?;
        } else {
            let sign = if *balance > 0.0 { "+" } else { "-" };
            let in_contact = if *contact > 0.0 { format!(" + contact {contact:.6e}") } else { String::new() };
            writeln!(
                f,
                "energy    strain {strain:.6e}{in_contact} = {terms} {sign} rest of the load steps {size:.3e}"
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
        for touched in &self.obstacles {
            writeln!(f, "obstacle  {touched}")?;
        }
        for touched in &self.pairs {
            writeln!(f, "contact   {touched}")?;
        }
        let seconds = seconds.named().map(|(name, x)| format!("{} {x:.2}", name.replace('_', " ")));
        write!(f, "seconds   {}", seconds.collect::<Vec<_>>().join(", "))
    }
}
