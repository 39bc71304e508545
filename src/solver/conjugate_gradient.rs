//! Preconditioned conjugate gradients (Saad, Iterative Methods for Sparse Linear Systems, 2nd ed., alg. 9.1).

use super::{LinearError, LinearOutcome, LinearReport, System, begin, finite};
use crate::space::vector::{Along, Vectors};

/// A curvature below this multiple of eps times the largest curvature so far is round-off in size and sign.
const UNRESOLVED: f64 = 16.0;

/// The iteration ends after n plus this many iterations without a better residual. Exact arithmetic ends at n.
const PATIENCE: usize = 50;

/// Settings of the method of conjugate gradients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConjugateGradientSettings {
    /// Wanted ‖b − A x‖ / ‖b‖, in [0, 1).
    pub relative_tolerance: f64,
    /// Iterations allowed.
    pub max_iterations: usize,
}

impl ConjugateGradientSettings {
    /// Solves A x = b from x = 0 for symmetric positive A and M.
    ///
    /// 1. r = b − A x, z = M⁻¹ r, p = z.
    /// 2. α = r·z / p·Ap; x ← x + α p, r ← r − α Ap.
    /// 3. z = M⁻¹ r; p ← z + β p with β the ratio of the new r·z to the old.
    /// 4. The curvature is p·Ap / p·Mp, a Rayleigh quotient of M⁻¹A. It is compared with the largest curvature so far. A clearly negative
    ///    one ends the iteration as [`LinearOutcome::NegativeCurvature`], a zero up to round-off as [`LinearOutcome::Stagnated`].
    /// 5. When the recurrence meets the tolerance, the residual is computed anew. If the true residual does not meet the tolerance, the
    ///    method goes back to 1 as long as this halves the true residual.
    ///
    /// The solution is the iterate with the least residual. At negative curvature it is the last iterate. Before the first iterate it is
    /// M⁻¹b divided by the magnitude of its curvature. Along both, ½ x·Ax − b·x falls (Nash, SIAM J. Numer. Anal. 21, 1984; Nocedal and
    /// Wright, Numerical Optimization, 2nd ed., alg. 7.1). `solution` is overwritten, and b = 0 gives x = 0 without iterating.
    /// If A is singular and b lies in its range, x is the solution of least norm x·Mx (least length for M = I). The iteration never leaves
    /// M⁻¹ range(A).
    ///
    /// ```
    /// use bfree::pooled::Pool;
    /// use bfree::solver::{ConjugateGradientSettings, Identity, System};
    ///
    /// // Two masses on one spring, k = 1: singular, because both may move together.
    /// let spring = |x: &[f64], y: &mut [f64]| (y[0], y[1]) = (x[0] - x[1], x[1] - x[0]);
    /// let system = System { vectors: &Pool::default(), operator: &spring, inverse: &Identity };
    /// // Forces in balance pull the masses apart. Of all solutions x₁ − x₀ = 3, the shortest is found.
    /// let mut x = [0.0; 2];
    /// let settings = ConjugateGradientSettings { relative_tolerance: 1e-8, max_iterations: 10 };
    /// let report = settings.solve(&system, &[-3.0, 3.0], &mut x)?;
    /// assert!(report.converged());
    /// assert_eq!(x, [-1.5, 1.5]);
    /// # Ok::<(), bfree::solver::LinearError>(())
    /// ```
    ///
    /// # Errors
    /// A setting is out of range, the lengths differ, or a number is NaN or infinite. `solution` then means nothing.
    pub fn solve<S: Vectors>(
        &self,
        system: &System<'_, S>,
        rhs: &S::Vector,
        solution: &mut S::Vector,
    ) -> Result<LinearReport, LinearError> {
        let (mut report, b_norm) = begin(system.vectors, rhs, solution, self.relative_tolerance)?;
        if b_norm == 0.0 {
            return Ok(report);
        }
        let target = self.relative_tolerance * b_norm;
        let mut r = system.vectors.copied(rhs);
        let mut r_norm = b_norm;
        loop {
            let ended = self.descend(system, target, &mut r, solution, &mut report)?;
            let reached = system.true_residual(rhs, solution, &mut r, &mut report)?;
            report.relative_residual = reached / b_norm;
            report.outcome = match ended {
                _ if reached <= target => LinearOutcome::Converged,
                // The residual of the recurrence has drifted, but the true residual still improves.
                LinearOutcome::Converged if reached < 0.5 * r_norm => {
                    r_norm = reached;
                    continue;
                }
                LinearOutcome::Converged => LinearOutcome::Stagnated,
                _ => ended,
            };
            return Ok(report);
        }
    }

    /// Steps 1 to 4 from the residual `r`, down to the norm `target`, counted in `report`. Leaves the best iterate in `solution`.
    fn descend<S: Vectors>(
        &self,
        &System { vectors, operator, inverse }: &System<'_, S>,
        target: f64,
        r: &mut S::Vector,
        solution: &mut S::Vector,
        report: &mut LinearReport,
    ) -> Result<LinearOutcome, LinearError> {
        let mut iterates = Iterates::new(vectors, solution);
        let n = vectors.len(r);
        let (mut z, mut q) = (vectors.zeros(n), vectors.zeros(n));
        inverse.apply(r, &mut z);
        let mut p = vectors.copied(&z);
        let mut rz = vectors.dot(r, &z);
        // p·Mp, by recurrence: Mp = r + β Mp_old and z·Mp_old = r·p_old = 0.
        let mut p_m_p = rz;
        let mut largest: f64 = 0.0;
        let (mut best, mut best_at) = (vectors.norm(r), report.iterations);
        loop {
            let at = report.iterations;
            if let Some(outcome) = ends(finite(rz, "r·z", at)?, at >= self.max_iterations, at - best_at > n + PATIENCE)
            {
                vectors.copy(iterates.best(), solution);
                return Ok(outcome);
            }
            operator.apply(&p, &mut q);
            report.products += 1;
            let p_a_p = finite(vectors.dot(&p, &q), "p·Ap", at)?;
            let curvature = p_a_p / p_m_p;
            mutant!("solver: negative curvature counts as positive": curvature = curvature.abs());
            if let Some(outcome) = unusable(curvature, &mut largest) {
                let end = match outcome {
                    // The step length for a curvature of the opposite sign.
                    LinearOutcome::NegativeCurvature => iterates.last_or_step(-rz / p_a_p, &p),
                    _ => iterates.best(),
                };
                vectors.copy(end, solution);
                return Ok(outcome);
            }
            let square = iterates.advance(rz / p_a_p, &p, &q, r);
            report.iterations += 1;
            let r_norm = finite(vectors.norm_with(square, r), "the norm of the residual", at)?;
            if r_norm < best {
                (best, best_at) = (r_norm, report.iterations);
                iterates.is_best = true;
                if r_norm <= target {
                    vectors.copy(&iterates.x, solution);
                    return Ok(LinearOutcome::Converged);
                }
            }
            inverse.apply(r, &mut z);
            let rz_new = vectors.dot(r, &z);
            let β = rz_new / rz;
            mutant!("solver: the inverse of β in conjugate gradients": β = 1.0 / β);
            vectors.xpby(&z, β, &mut p);
            rz = rz_new;
            p_m_p = rz + β * β * p_m_p;
        }
    }
}

/// The present iterate and the best one.
struct Iterates<'a, S: Vectors> {
    vectors: &'a S,
    x: S::Owned,
    best: S::Owned,
    /// The next iterate is written here, so that the best one stays without a copy.
    next: S::Owned,
    /// Whether x is the best iterate.
    is_best: bool,
}

impl<'a, S: Vectors> Iterates<'a, S> {
    fn new(vectors: &'a S, start: &S::Vector) -> Self {
        let [x, best, next] = [(); 3].map(|()| vectors.copied(start));
        Self { vectors, x, best, next, is_best: true }
    }

    fn best(&self) -> &S::Vector {
        if self.is_best { &self.x } else { &self.best }
    }

    /// x ← x + α p, r ← r − α q with q = A p. Returns r·r.
    fn advance(&mut self, α: f64, p: &S::Vector, q: &S::Vector, r: &mut S::Vector) -> f64 {
        let square = self.vectors.advance(α, Along { p, q, x: &self.x }, &mut self.next, r);
        if self.is_best {
            std::mem::swap(&mut self.x, &mut self.best);
        }
        std::mem::swap(&mut self.x, &mut self.next);
        self.is_best = false;
        square
    }

    /// The last iterate. If it is zero, a step along p of the given length.
    fn last_or_step(&mut self, length: f64, p: &S::Vector) -> &S::Vector {
        if self.vectors.norm(&self.x) == 0.0 {
            self.vectors.axpy(length, p, &mut self.x);
        }
        &self.x
    }
}

/// The outcome before a product, if the recurrence ends there.
fn ends(rz: f64, used_up: bool, no_progress: bool) -> Option<LinearOutcome> {
    match (used_up, no_progress) {
        (true, _) => Some(LinearOutcome::IterationLimit),
        (_, true) => Some(LinearOutcome::Stagnated),
        _ => (rz <= 0.0).then_some(LinearOutcome::NegativeCurvature),
    }
}

/// The outcome at a curvature p·Ap / p·Mp that gives no step: negative, or zero to round-off. Updates the largest curvature so far.
fn unusable(curvature: f64, largest: &mut f64) -> Option<LinearOutcome> {
    *largest = largest.max(curvature);
    let unresolved = UNRESOLVED * f64::EPSILON * *largest;
    if curvature < -unresolved {
        Some(LinearOutcome::NegativeCurvature)
    } else {
        (curvature <= unresolved).then_some(LinearOutcome::Stagnated)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Dense, distance, irregular};
    use super::super::{Identity, LinearOperator};
    use super::*;
    use crate::pooled::Pool;
    use crate::space::vector::{dot, norm};

    /// Solves with a memory pool of its own.
    fn conjugate_gradient(
        operator: &dyn LinearOperator,
        preconditioner: &dyn LinearOperator,
        rhs: &[f64],
        solution: &mut [f64],
        settings: &ConjugateGradientSettings,
    ) -> Result<LinearReport, LinearError> {
        settings.solve(&System { vectors: &Pool::default(), operator, inverse: preconditioner }, rhs, solution)
    }

    const TIGHT: ConjugateGradientSettings =
        ConjugateGradientSettings { relative_tolerance: 1e-12, max_iterations: 1000 };

    /// The second difference with a varying diagonal added: symmetric, positive definite.
    fn chain(n: usize) -> Dense {
        Dense::from_fn(n, |i, j| match i.abs_diff(j) {
            0 => 2.0 + (i % 5) as f64,
            1 => -1.0,
            _ => 0.0,
        })
    }

    #[test]
    fn ends_within_n_iterations() {
        for n in [1, 2, 8, 30] {
            let a = chain(n);
            let exact = irregular(n);
            let b = a.times(&exact);
            let mut x = vec![f64::NAN; n];
            let report = conjugate_gradient(&a, &Identity, &b, &mut x, &TIGHT).unwrap();
            assert!(report.converged() && report.iterations <= n, "{report:?}");
            assert!(distance(&x, &exact) < 1e-11);
            let report = conjugate_gradient(&a, &a.jacobi(), &b, &mut x, &TIGHT).unwrap();
            assert!(report.converged() && distance(&x, &exact) < 1e-11, "{report:?}");
        }
    }

    #[test]
    fn reports_the_true_residual() {
        // Condition 1e10: the recurrence drifts, but the reported residual must not.
        let n = 60;
        let a = Dense::from_fn(n, |i, j| if i == j { 10.0_f64.powf(i as f64 / 5.9) } else { 0.0 });
        let b = irregular(n);
        for relative_tolerance in [1e-3, 1e-8, 1e-14, 0.0] {
            let mut x = vec![0.0; n];
            let settings = ConjugateGradientSettings { relative_tolerance, max_iterations: 5000 };
            let report = conjugate_gradient(&a, &Identity, &b, &mut x, &settings).unwrap();
            let r: Vec<f64> = b.iter().zip(a.times(&x)).map(|(b, ax)| b - ax).collect();
            let again = norm(&r) / norm(&b);
            assert!((report.relative_residual - again).abs() <= 1e-15, "{again} {report:?}");
            assert_eq!(report.converged(), again <= relative_tolerance, "{again} {report:?}");
        }
    }

    #[test]
    fn negative_curvature_is_told() {
        let n = 20;
        let exact = irregular(n);
        for a in [
            Dense::from_fn(n, |i, j| if i == j { i as f64 - 2.5 } else { 0.0 }),
            Dense::from_fn(n, |i, j| if i == j { -1.0 } else { 0.0 }),
        ] {
            let b = a.times(&exact);
            let mut x = vec![0.0; n];
            let report = conjugate_gradient(&a, &Identity, &b, &mut x, &TIGHT).unwrap();
            assert_eq!(report.outcome, LinearOutcome::NegativeCurvature);
            // Along the returned x, ½ x·Ax − b·x falls from the start.
            let (along, curvature) = (dot(&b, &x), dot(&x, &a.times(&x)));
            assert!(along > 0.0 && 0.5 * curvature < along, "{along} {curvature}");
        }
        // Before the first iterate: M⁻¹b divided by the magnitude of its curvature.
        let a = Dense::from_fn(n, |i, j| if i == j { -4.0 } else { 0.0 });
        let mut x = vec![0.0; n];
        let report = conjugate_gradient(&a, &Identity, &exact, &mut x, &TIGHT).unwrap();
        assert_eq!((report.outcome, report.iterations), (LinearOutcome::NegativeCurvature, 0));
        assert!(x.iter().zip(&exact).all(|(x, b)| *x == b / 4.0), "{x:?}");
        // An indefinite preconditioner under a definite operator.
        let m = Dense::from_fn(n, |i, j| if i == j { [1.0, -3.0][i % 2] } else { 0.0 });
        let mut x = vec![0.0; n];
        let report = conjugate_gradient(&chain(n), &m.jacobi(), &exact, &mut x, &TIGHT).unwrap();
        assert_eq!(report.outcome, LinearOutcome::NegativeCurvature);
    }

    /// The second difference of a ring (or of a chain with free ends): constants are its null space.
    fn free(n: usize, ring: bool) -> Dense {
        Dense::from_fn(n, |i, j| {
            let neighbours = |i: usize, j: usize| i.abs_diff(j) == 1 || (ring && i.abs_diff(j) == n - 1);
            if i == j { (0..n).filter(|&k| neighbours(i, k)).count() as f64 } else { -f64::from(neighbours(i, j)) }
        })
    }

    #[test]
    fn singular_consistent_system_gives_the_least_norm() {
        for (n, ring) in [(30, true), (31, false), (200, true)] {
            let a = free(n, ring);
            // Solutions differ by constants. The solution with mean zero is the shortest.
            let mut exact = irregular(n);
            let mean = exact.iter().sum::<f64>() / n as f64;
            exact.iter_mut().for_each(|x| *x -= mean);
            let b = a.times(&exact);
            let mut x = vec![1.0; n];
            let report = conjugate_gradient(&a, &Identity, &b, &mut x, &TIGHT).unwrap();
            assert!(report.converged() && distance(&x, &exact) < 1e-8, "{report:?} {}", distance(&x, &exact));
            // With M ≠ I the norm is that of M: Σ mᵢ xᵢ = 0.
            let report = conjugate_gradient(&a, &a.jacobi(), &b, &mut x, &TIGHT).unwrap();
            let weighted: f64 = (0..n).map(|i| a.0[i][i] * x[i]).sum();
            assert!(report.converged() && weighted.abs() < 1e-9 * n as f64, "{weighted}");
            // With a tolerance below round-off the iteration still ends, and its residual is no worse.
            let settings = ConjugateGradientSettings { relative_tolerance: 0.0, max_iterations: 100_000 };
            let report = conjugate_gradient(&a, &Identity, &b, &mut x, &settings).unwrap();
            assert!(report.relative_residual < 1e-12 && report.iterations < 20 * n, "{report:?}");
            assert_ne!(report.outcome, LinearOutcome::IterationLimit);
        }
    }

    #[test]
    fn singular_inconsistent_system_ends() {
        let a = free(30, true);
        let mut x = vec![0.0; 30];
        let report = conjugate_gradient(&a, &Identity, &irregular(30), &mut x, &TIGHT).unwrap();
        assert!(matches!(report.outcome, LinearOutcome::Stagnated | LinearOutcome::NegativeCurvature), "{report:?}");
        assert!(report.relative_residual < 1.0 && report.iterations < 200);
        // b lies in the null space.
        let report = conjugate_gradient(&a, &Identity, &[1.0; 30], &mut x, &TIGHT).unwrap();
        assert_eq!((report.outcome, report.relative_residual), (LinearOutcome::Stagnated, 1.0));
        assert_eq!(x, [0.0; 30]);
    }

    #[test]
    fn zero_and_not_finite() {
        let a = chain(3);
        let mut x = vec![1.0; 3];
        let report = conjugate_gradient(&a, &Identity, &[0.0; 3], &mut x, &TIGHT).unwrap();
        assert_eq!((report.iterations, x.as_slice()), (0, [0.0; 3].as_slice()));
        let not_finite = |result| matches!(result, Err(LinearError::NotFinite { .. }));
        assert!(not_finite(conjugate_gradient(&a, &Identity, &[1.0, f64::NAN, 1.0], &mut x, &TIGHT)));
        let bad = Dense::from_fn(3, |i, j| if (i, j) == (1, 2) { f64::NAN } else { a.0[i][j] });
        assert!(not_finite(conjugate_gradient(&bad, &Identity, &[1.0; 3], &mut x, &TIGHT)));
        let zero_mass = Dense::from_fn(3, |i, j| if i == j { [1.0, 1.0, f64::INFINITY][i] } else { 0.0 });
        assert!(not_finite(conjugate_gradient(&a, &zero_mass, &[1.0; 3], &mut x, &TIGHT)));
    }
}
