//! The report of Newton's method.

use crate::solver::{LinearOutcome, LinearReport};

/// The merit function by which the line search accepted a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Merit {
    /// The residual norm fell.
    Residual,
    /// The residual norm did not fall, but the potential fell.
    Potential,
}

/// One Newton iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonIteration {
    /// ‖R‖ after the iteration.
    pub residual: f64,
    /// ‖R‖ after the iteration over ‖R‖ before it.
    pub ratio: f64,
    /// The accepted step length, 1 for the full step.
    pub step_length: f64,
    /// The merit function that accepted the step.
    pub merit: Merit,
    /// The wanted relative residual of the linear system.
    pub forcing: f64,
    /// The linear solve that gave the step. Its outcome is negative curvature where conjugate gradients ended early and their step is used.
    pub krylov: LinearReport,
}

/// Numbers of evaluations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NewtonCounts {
    /// Residuals, including those of the line search.
    pub residuals: usize,
    /// Residuals at shortened steps.
    pub line_search: usize,
    /// Magnitudes and sensitivities.
    pub magnitudes: usize,
    /// Linearisations.
    pub linearizations: usize,
    /// Products with a tangent.
    pub tangent_products: usize,
    /// Krylov iterations.
    pub krylov_iterations: usize,
    /// Linear systems left unsolved at the limit of Krylov iterations.
    pub krylov_limited: usize,
    /// Linear systems left unsolved because their residual no longer fell.
    pub krylov_stagnated: usize,
}

impl NewtonCounts {
    pub(super) fn add(&mut self, report: &LinearReport) {
        self.tangent_products += report.products;
        self.krylov_iterations += report.iterations;
        self.krylov_limited += usize::from(report.outcome == LinearOutcome::IterationLimit);
        self.krylov_stagnated += usize::from(report.outcome == LinearOutcome::Stagnated);
    }
}

/// The course of the iteration, complete or not.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NewtonHistory {
    /// ‖R‖ at the initial guess, once it is known.
    pub first_residual: Option<f64>,
    /// The last magnitude or sensitivity with which ‖R‖ was compared.
    pub magnitude: Option<f64>,
    /// The iterations, one entry for each accepted iterate.
    pub iterations: Vec<NewtonIteration>,
    /// The numbers of evaluations.
    pub counts: NewtonCounts,
}

impl NewtonHistory {
    /// ‖R‖ at the last accepted iterate.
    ///
    /// ```
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &["boundary.left=fixed".parse()?])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// let first = &mut simulation.particles.velocity[0];
    /// *first *= 2.0; // one particle ahead of the others: the body must deform
    /// let history = simulation.step()?.newton.history;
    /// // From Δφ = 0 the residual falls by eight orders at least.
    /// let (first, last) = history.first_residual.zip(history.residual()).ok_or("residuals")?;
    /// assert!(last <= 1e-8 * first);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn residual(&self) -> Option<f64> {
        self.iterations.last().map(|last| last.residual).or(self.first_residual)
    }
}

/// The reason why the last iterate counts as a solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Convergence {
    /// ‖R‖ meets the tolerance or the floor.
    Tolerance,
    /// ‖R‖ no longer falls, and is at most 16 times the floor.
    RoundOff,
}

/// The report of a solution.
#[derive(Clone, Debug, PartialEq)]
pub struct NewtonReport {
    /// The reason why the last iterate counts as a solution.
    pub convergence: Convergence,
    /// The course of the iteration.
    pub history: NewtonHistory,
}
