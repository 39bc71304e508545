//! What Newton's method did.

use crate::solver::LinearReport;

/// What made the line search accept a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Merit {
    /// The residual norm fell.
    Residual,
    /// It did not, but the potential fell.
    Potential,
}

/// One Newton iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonIteration {
    /// ‖R‖ after the iteration.
    pub residual: f64,
    /// The same over ‖R‖ before.
    pub ratio: f64,
    /// The accepted step length, 1 for the full step.
    pub step_length: f64,
    /// What accepted it.
    pub merit: Merit,
    /// The wanted relative residual of the linear system.
    pub forcing: f64,
    /// The linear solve that gave the step; negative curvature where the step is what conjugate gradients had until then.
    pub krylov: LinearReport,
    /// The conjugate gradients given up before it because of negative curvature, if any.
    pub negative_curvature: Option<LinearReport>,
}

/// What was evaluated, how often.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NewtonCounts {
    /// Residuals, those of the line search included.
    pub residuals: usize,
    /// Residuals at shortened steps.
    pub line_search: usize,
    /// Potentials.
    pub potentials: usize,
    /// Magnitudes.
    pub magnitudes: usize,
    /// Tangents formed.
    pub linearizations: usize,
    /// Products with a tangent.
    pub tangent_products: usize,
    /// Krylov iterations.
    pub krylov_iterations: usize,
    /// Linear systems left unsolved at the limit on Krylov iterations.
    pub krylov_limited: usize,
    /// Linear systems left unsolved because their residual no longer fell.
    pub krylov_stagnated: usize,
}

/// The course of the iteration, complete or not.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NewtonHistory {
    /// ‖R‖ at the initial guess, once it is known.
    pub first_residual: Option<f64>,
    /// The magnitude ‖R‖ is compared with, as last evaluated.
    pub magnitude: Option<f64>,
    /// The iterations, one entry for each accepted iterate.
    pub iterations: Vec<NewtonIteration>,
    /// What was evaluated.
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
    /// // From Δφ = 0 by eight orders at least.
    /// let (first, last) = history.first_residual.zip(history.residual()).ok_or("residuals")?;
    /// assert!(last <= 1e-8 * first);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn residual(&self) -> Option<f64> {
        self.iterations.last().map(|last| last.residual).or(self.first_residual)
    }
}

/// Why the last iterate counts as a solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Convergence {
    /// ‖R‖ meets the tolerance or the floor.
    Tolerance,
    /// ‖R‖ no longer falls, and is below 16 times the floor.
    RoundOff,
}

/// A solution found.
#[derive(Clone, Debug, PartialEq)]
pub struct NewtonReport {
    /// Why it counts as one.
    pub convergence: Convergence,
    /// How it was reached.
    pub history: NewtonHistory,
}
