//! Krylov and Newton methods on vectors, which lie in the memory of the processor or of a device. Preconditioners also know forms on the cells of a grid; laws and particles they do not know.
//!
//! A nodal field of `D` components per node is one flat `&[f64]`, node after node. No constant in this folder has a unit. A problem whose
//! unknowns and residual are multiplied by powers of two takes the same iterations with the same bits.

mod conjugate_gradient;
mod forcing;
mod gmres;
mod newton;
mod nonnegative;
mod preconditioner;
mod stop;

pub use conjugate_gradient::ConjugateGradientSettings;
pub use forcing::Forcing;
pub use gmres::GmresSettings;
pub use newton::{
    Convergence, Krylov, LinearSolverFailure, Merit, NewtonCounts, NewtonError, NewtonFailure, NewtonHistory,
    NewtonIteration, NewtonReport, NewtonSettings, newton,
};
pub(crate) use nonnegative::NonnegativeLeastSquares;
pub use preconditioner::{BlockJacobi, Identity, LocalForm, Multigrid, Preconditioner, Preconditioning, PressureCells};
pub(crate) use preconditioner::{Saddle, multigrid_bytes, rigid_motions, saddle_bytes};
pub use stop::Stop;

use crate::gpu::{Gpu, GpuVector};
use crate::pooled::Pooled;
use crate::space::vector::Vectors;
use std::sync::Arc;

/// A square matrix that is known by its product with a vector.
///
/// ```
/// use bfree::solver::LinearOperator;
///
/// /// −u″ on a line of nodes, h = 1, with u = 0 beyond both ends.
/// struct Laplacian;
///
/// impl LinearOperator for Laplacian {
///     fn apply(&self, x: &[f64], y: &mut [f64]) {
///         let at = |i: Option<usize>| i.and_then(|i| x.get(i)).copied().unwrap_or(0.0);
///         for i in 0..x.len() {
///             y[i] = 2.0 * x[i] - at(i.checked_sub(1)) - at(Some(i + 1));
///         }
///     }
/// }
///
/// // sin(π i/n) is an eigenvector, with the eigenvalue 2 − 2 cos(π/n).
/// let step = std::f64::consts::PI / 8.0;
/// let x: Vec<f64> = (1..8).map(|i| (step * f64::from(i)).sin()).collect();
/// let mut y = vec![0.0; 7];
/// Laplacian.apply(&x, &mut y);
/// assert!(x.iter().zip(&y).all(|(x, y)| (y - (2.0 - 2.0 * step.cos()) * x).abs() < 1e-15));
/// ```
pub trait LinearOperator<V: ?Sized = [f64]> {
    /// `y = A x`; `x` and `y` have the order of the operator, and `y` is overwritten.
    fn apply(&self, x: &V, y: &mut V);
}

/// A function `(x, y)` that writes y = A x.
impl<V: ?Sized, F: Fn(&V, &mut V)> LinearOperator<V> for F {
    fn apply(&self, x: &V, y: &mut V) {
        self(x, y);
    }
}

/// A linear operator A with an approximate inverse M⁻¹, and the place of their vectors. Krylov methods solve with it.
#[derive(Clone, Copy)]
pub struct System<'a, S: Vectors> {
    /// The place of the vectors.
    pub vectors: &'a S,
    /// A
    pub operator: &'a dyn LinearOperator<S::Vector>,
    /// M⁻¹, the preconditioner.
    pub inverse: &'a dyn LinearOperator<S::Vector>,
}

/// The linearisation of a residual at one x: its product with a vector, and the data for preconditioners.
///
/// Example: [`Preconditioner`].
pub trait Linearization: LinearOperator {
    /// The square blocks on the diagonal, one after the other, each column by column. Prescribed degrees of freedom have the row and column
    /// of the identity. A common positive factor does not matter.
    fn diagonal_blocks(&self) -> Pooled<f64>;

    /// The system on a device, if it is solved there.
    fn on_device(&self) -> Option<Box<dyn OnDevice + '_>> {
        None
    }

    /// The operator as a form on the cells of a grid, from which multigrid makes coarser levels; `None` if it has no such form.
    fn local_form(&self) -> Option<LocalForm> {
        None
    }

    /// The system in motions and pressures, if it is one; `None` if all unknowns are motions.
    fn saddle_point(&self) -> Option<&dyn SaddlePoint> {
        None
    }
}

/// A linearisation in the memory of a device.
pub trait OnDevice: LinearOperator<GpuVector> {
    /// The device.
    fn gpu(&self) -> &Arc<Gpu>;
}

/// The parts of a system in motions u and pressures p of cells, [A Bᵀ; B −C], for preconditioners. A vector of the system has the entries of
/// the nodes, then those of the cells.
pub trait SaddlePoint {
    /// A + Bᵀ γ B
    fn augmented(&self) -> &dyn Linearization;

    /// `v = B u`, the changes of the cells' volumes.
    fn volume_changes(&self, u: &[f64], v: &mut [f64]);

    /// `f = Bᵀ p`
    fn forces(&self, p: &[f64], f: &mut [f64]);

    /// The cells.
    fn cells(&self) -> PressureCells;
}

/// A square system R(x) = 0 that is defined for admissible x only. The state is the argument, and nothing is stored between calls.
///
/// ```
/// use bfree::pooled::{Pool, Pooled};
/// use bfree::solver::{BlockJacobi, LinearOperator, Linearization, NewtonSettings, NonlinearProblem, newton};
///
/// /// A charge on a spring: Π = ½ x² − ln x for x > 0, so that R = x − 1/x and K = 1 + 1/x².
/// struct Charge;
///
/// #[derive(Debug, thiserror::Error)]
/// #[error("x = {0} is not positive")]
/// struct NotPositive(f64);
///
/// struct Stiffness(f64);
///
/// impl LinearOperator for Stiffness {
///     fn apply(&self, x: &[f64], y: &mut [f64]) {
///         y[0] = self.0 * x[0];
///     }
/// }
///
/// impl Linearization for Stiffness {
///     fn diagonal_blocks(&self) -> Pooled<f64> {
///         vec![self.0].into()
///     }
/// }
///
/// fn admissible(x: f64) -> Result<f64, NotPositive> {
///     if x > 0.0 { Ok(x) } else { Err(NotPositive(x)) }
/// }
///
/// impl NonlinearProblem for Charge {
///     type Inadmissible = NotPositive;
///
///     fn residual(&self, x: &[f64], r: &mut [f64]) -> Result<(), NotPositive> {
///         r[0] = x[0] - 1.0 / admissible(x[0])?;
///         Ok(())
///     }
///
///     fn magnitude(&self, x: &[f64]) -> Result<f64, NotPositive> {
///         Ok(x[0] + 1.0 / admissible(x[0])?)
///     }
///
///     fn potential(&self, x: &[f64]) -> Option<Result<(f64, f64), NotPositive>> {
///         Some(admissible(x[0]).map(|x| (0.5 * x * x - x.ln(), 0.5 * x * x + x.ln().abs())))
///     }
///
///     fn linearize(&self, x: &[f64]) -> Result<Box<dyn Linearization>, NotPositive> {
///         Ok(Box::new(Stiffness(1.0 + admissible(x[0])?.powi(-2))))
///     }
/// }
///
/// let problem = Charge;
/// // From far away Newton's full step would lead to x < 0; the line search does not.
/// let mut x = [0.01];
/// newton(&problem, &mut BlockJacobi::<1>::default(), &mut x, &NewtonSettings::default(), &Pool::default())?;
/// assert!((x[0] - 1.0).abs() < 1e-8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait NonlinearProblem {
    /// The reason why R has no value at x, such as det F ≤ 0 at a particle.
    type Inadmissible: std::error::Error + 'static;

    /// `r = R(x)`; `r` is overwritten, and unspecified on error.
    ///
    /// # Errors
    /// x is not admissible.
    fn residual(&self, x: &[f64], r: &mut [f64]) -> Result<(), Self::Inadmissible>;

    /// The scale of the round-off of R(x): the magnitudes of all contributions are summed at each entry, and the norm of the sums is taken.
    ///
    /// # Errors
    /// x is not admissible.
    fn magnitude(&self, x: &[f64]) -> Result<f64, Self::Inadmissible>;

    /// The round-off bound of R(x) in units of eps: the [`magnitude`](Self::magnitude), together with the change of R when x and the state
    /// at t_n are rounded. It is evaluated only where ‖R‖ no longer falls.
    ///
    /// # Errors
    /// x is not admissible.
    fn sensitivity(&self, x: &[f64]) -> Result<f64, Self::Inadmissible> {
        self.magnitude(x)
    }

    /// The potential Π whose gradient is R, and the sum of the magnitudes of its contributions; `None` if there is no potential, as with
    /// follower loads.
    fn potential(&self, x: &[f64]) -> Option<Result<(f64, f64), Self::Inadmissible>>;

    /// Whether every tangent is symmetric for certain.
    fn is_symmetric(&self) -> bool {
        false
    }

    /// Whether the iteration is to end without a solution. It is called before every iteration.
    fn is_stopped(&self) -> bool {
        false
    }

    /// The tangent at x.
    ///
    /// # Errors
    /// x is not admissible.
    fn linearize(&self, x: &[f64]) -> Result<Box<dyn Linearization + '_>, Self::Inadmissible>;
}

/// The outcome and the counts of a Krylov solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearReport {
    /// The outcome.
    pub outcome: LinearOutcome,
    /// Krylov iterations taken, over all restarts.
    pub iterations: usize,
    /// Products with the operator, including the products for true residuals.
    pub products: usize,
    /// The true ‖b − A x‖ / ‖b‖ of the returned solution, computed anew from it (0 if b = 0).
    pub relative_residual: f64,
}

impl LinearReport {
    /// Whether the tolerance was met.
    ///
    /// ```
    /// use bfree::pooled::Pool;
    /// use bfree::solver::{ConjugateGradientSettings, Identity, LinearOutcome, System};
    ///
    /// // A mirror, with the eigenvalues 1 and −1: not positive definite.
    /// let mirror = |x: &[f64], y: &mut [f64]| (y[0], y[1]) = (x[0], -x[1]);
    /// let system = System { vectors: &Pool::default(), operator: &mirror, inverse: &Identity };
    /// let settings = ConjugateGradientSettings { relative_tolerance: 1e-8, max_iterations: 10 };
    /// let report = settings.solve(&system, &[1.0, 2.0], &mut [0.0; 2])?;
    /// assert!(!report.converged());
    /// assert_eq!(report.outcome, LinearOutcome::NegativeCurvature);
    /// # Ok::<(), bfree::solver::LinearError>(())
    /// ```
    pub fn converged(&self) -> bool {
        self.outcome == LinearOutcome::Converged
    }
}

/// The reason why a Krylov method ended. The solution is the best iterate, except at negative curvature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearOutcome {
    /// The true residual meets the tolerance.
    Converged,
    /// The allowed iterations are used up.
    IterationLimit,
    /// The residual no longer falls: round-off, a singular operator, or a restart that is too short.
    Stagnated,
    /// Conjugate gradients only: the operator (pᵀAp < 0) or the preconditioner (rᵀM⁻¹r ≤ 0) is not positive definite. The solution is
    /// then an x along which ½ x·Ax − b·x falls. If the first direction has negative curvature already, x is along that direction.
    /// If no such x was found, the solution is zero.
    NegativeCurvature,
}

/// The reason why a Krylov method returns no solution. The contents of the solution vector are then unspecified.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LinearError {
    /// A setting outside its range.
    #[error(transparent)]
    Setting(#[from] InvalidSetting),
    /// Right-hand side and solution differ in length.
    #[error("the right-hand side has {rhs} entries and the solution {solution}; they must agree")]
    Length {
        /// Entries of the right-hand side.
        rhs: usize,
        /// Entries of the solution.
        solution: usize,
    },
    /// NaN or infinity.
    #[error("{what} is not finite at Krylov iteration {iteration}")]
    NotFinite {
        /// The quantity.
        what: &'static str,
        /// Krylov iterations completed before it was met.
        iteration: usize,
    },
}

/// A setting outside its range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{name} is {value:e}; it must be {allowed}")]
pub struct InvalidSetting {
    /// Name of the setting.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// The allowed values, in words.
    pub allowed: &'static str,
}

impl InvalidSetting {
    fn check(valid: bool, name: &'static str, value: f64, allowed: &'static str) -> Result<(), Self> {
        if valid { Ok(()) } else { Err(Self { name, value, allowed }) }
    }

    fn check_tolerance(name: &'static str, value: f64) -> Result<(), Self> {
        Self::check((0.0..1.0).contains(&value), name, value, "at least 0 and less than 1")
    }
}

/// Sets the solution to 0. Returns the report of no iterations, and ‖b‖.
///
/// # Errors
/// The tolerance is out of range, the lengths differ, or the right-hand side is not finite.
fn begin<S: Vectors>(
    vectors: &S,
    rhs: &S::Vector,
    solution: &mut S::Vector,
    relative_tolerance: f64,
) -> Result<(LinearReport, f64), LinearError> {
    InvalidSetting::check_tolerance("relative_tolerance", relative_tolerance)?;
    let length = LinearError::Length { rhs: vectors.len(rhs), solution: vectors.len(solution) };
    if vectors.len(rhs) != vectors.len(solution) {
        return Err(length);
    }
    let b_norm = finite(vectors.norm(rhs), "the norm of the right-hand side", 0)?;
    vectors.clear(solution);
    Ok((LinearReport { outcome: LinearOutcome::Converged, iterations: 0, products: 0, relative_residual: 0.0 }, b_norm))
}

/// The value, or an error if it is not finite.
fn finite(value: f64, what: &'static str, iteration: usize) -> Result<f64, LinearError> {
    if value.is_finite() { Ok(value) } else { Err(LinearError::NotFinite { what, iteration }) }
}

impl<S: Vectors> System<'_, S> {
    /// `r = b − A x`, and its norm. Counts the product.
    ///
    /// # Errors
    /// x or r is not finite.
    fn true_residual(
        &self,
        rhs: &S::Vector,
        x: &S::Vector,
        r: &mut S::Vector,
        report: &mut LinearReport,
    ) -> Result<f64, LinearError> {
        finite(self.vectors.norm(x), "the norm of the solution", report.iterations)?;
        self.operator.apply(x, r);
        report.products += 1;
        self.vectors.xpby(rhs, -1.0, r);
        finite(self.vectors.norm(r), "the norm of the residual", report.iterations)
    }
}

#[cfg(test)]
pub(crate) mod testing {
    //! Dense matrices for the tests of this folder.

    use super::{BlockJacobi, LinearOperator, Linearization};
    use crate::pooled::Pooled;

    /// A dense matrix by rows.
    pub struct Dense(pub Vec<Vec<f64>>);

    impl Dense {
        pub(crate) fn from_fn(n: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
            Self((0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect())
        }

        /// Its diagonal as preconditioner.
        pub(crate) fn jacobi(&self) -> BlockJacobi<1> {
            let mut inverse = BlockJacobi::default();
            inverse.take(self);
            inverse
        }

        pub(crate) fn times(&self, x: &[f64]) -> Vec<f64> {
            self.0.iter().map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum()).collect()
        }
    }

    impl LinearOperator for Dense {
        fn apply(&self, x: &[f64], y: &mut [f64]) {
            y.copy_from_slice(&self.times(x));
        }
    }

    impl Linearization for Dense {
        fn diagonal_blocks(&self) -> Pooled<f64> {
            (0..self.0.len()).map(|i| self.0[i][i]).collect::<Vec<_>>().into()
        }
    }

    /// ‖a − b‖∞
    pub(crate) fn distance(a: &[f64], b: &[f64]) -> f64 {
        assert_eq!(a.len(), b.len());
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    /// A fixed vector without pattern, entries in (−1, 1): the golden-ratio sequence.
    pub(crate) fn irregular(n: usize) -> Vec<f64> {
        (1..=n).map(|i| 2.0 * (i as f64 * 0.618_033_988_749_894_9).fract() - 1.0).collect()
    }
}
