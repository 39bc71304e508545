//! Products with the tangent by differences of the residual, as in Jacobian-free Newton–Krylov methods.

use bfree::pooled::Pooled;
use bfree::solver::{LinearOperator, Linearization, NonlinearProblem};

/// A problem whose tangent is known only through its residual; the blocks of the exact tangent precondition it.
pub(super) struct Difference<'a, P> {
    pub problem: &'a P,
    /// Length of the step, in units of x.
    pub length: f64,
}

/// K u ≈ [R(x + δ u/‖u‖) − R(x)] ‖u‖/δ
struct DifferenceTangent<'a, P> {
    problem: &'a P,
    exact: Box<dyn Linearization + 'a>,
    length: f64,
    x: Vec<f64>,
    r: Vec<f64>,
}

impl<P: NonlinearProblem> LinearOperator for DifferenceTangent<'_, P> {
    fn apply(&self, u: &[f64], y: &mut [f64]) {
        let norm = u.iter().map(|x| x * x).sum::<f64>().sqrt();
        if norm == 0.0 {
            y.fill(0.0);
            return;
        }
        let factor = self.length / norm;
        let moved: Vec<f64> = self.x.iter().zip(u).map(|(x, u)| x + factor * u).collect();
        match self.problem.residual(&moved, y) {
            Ok(()) => y.iter_mut().zip(&self.r).for_each(|(y, r)| *y = (*y - r) / factor),
            // Outside the domain there is no difference; the Krylov method reports the error.
            Err(_) => y.fill(f64::NAN),
        }
    }
}

impl<P: NonlinearProblem> Linearization for DifferenceTangent<'_, P> {
    fn diagonal_blocks(&self) -> Pooled<f64> {
        self.exact.diagonal_blocks()
    }
}

impl<P: NonlinearProblem> NonlinearProblem for Difference<'_, P> {
    type Inadmissible = P::Inadmissible;

    fn residual(&self, x: &[f64], r: &mut [f64]) -> Result<(), Self::Inadmissible> {
        self.problem.residual(x, r)
    }

    fn magnitude(&self, x: &[f64]) -> Result<f64, Self::Inadmissible> {
        self.problem.magnitude(x)
    }

    fn potential(&self, x: &[f64]) -> Option<Result<(f64, f64), Self::Inadmissible>> {
        self.problem.potential(x)
    }

    fn linearize(&self, x: &[f64]) -> Result<Box<dyn Linearization + '_>, Self::Inadmissible> {
        let mut r = vec![0.0; x.len()];
        self.problem.residual(x, &mut r)?;
        let (problem, length, exact) = (self.problem, self.length, self.problem.linearize(x)?);
        Ok(Box::new(DifferenceTangent { problem, exact, length, x: x.to_vec(), r }))
    }
}
