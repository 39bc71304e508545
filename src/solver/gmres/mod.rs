//! Restarted GMRES, preconditioned from the right (Saad, Iterative Methods for Sparse Linear Systems, 2nd ed., alg. 9.5).

#[cfg(test)]
mod tests;

use super::{InvalidSetting, LinearError, LinearOutcome, LinearReport, System, begin};
use crate::space::vector::Vectors;

/// A vector is orthogonalised a second time if the first time leaves less than this part of it: 1/√2 (Daniel, Gragg, Kaufman,
/// Stewart 1976).
const REORTHOGONALISE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// The Krylov space is exhausted if orthogonalisation leaves less than this part of a vector.
const EXHAUSTED: f64 = 8.0 * f64::EPSILON;

/// A whole cycle that leaves more than this part of the residual is stagnation. A thousand such cycles gain a factor e.
const STAGNATION: f64 = 0.999;

/// A cycle was too short if the best solution in its Krylov space leaves more than this part of the residual. The next is twice as long.
const TOO_SHORT: f64 = 0.9;

/// Settings of restarted GMRES.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GmresSettings {
    /// Wanted ‖b − A x‖ / ‖b‖, in [0, 1).
    pub relative_tolerance: f64,
    /// Iterations allowed, over all restarts.
    pub max_iterations: usize,
    /// Iterations between restarts, at least 1. One vector is stored for each iteration, and one more. After a cycle that gains next to
    /// nothing, cycles are twice as long.
    pub restart: usize,
}

impl GmresSettings {
    /// Solves A x = b from x = 0 by GMRES(m) on A M⁻¹. Its residual is the true residual.
    ///
    /// 1. r = b − A x, v₁ = r/‖r‖.
    /// 2. w = A M⁻¹ vⱼ is made orthogonal to v₁ … vⱼ by modified Gram–Schmidt, twice if much cancels. This gives column j of H, and vⱼ₊₁.
    /// 3. Givens rotations keep H triangular and give the residual norm without x.
    /// 4. After m iterations, or at the tolerance, or when the space is exhausted: x ← x + M⁻¹ V y with H y = ‖r‖ e₁.
    /// 5. The residual is computed anew from x. If it does not meet the tolerance, the method goes back to 1.
    /// 6. If the best solution in the space of a whole cycle is hardly better than x, m is doubled. Null modes and clustered small eigenvalues
    ///    need longer cycles, and a failed solve costs more than a few vectors.
    /// 7. Otherwise a cycle that hardly lowers the true residual has met round-off or an exhausted space. It ends the iteration as
    ///    [`LinearOutcome::Stagnated`]. A cycle that raises the true residual is undone.
    ///
    /// `solution` is overwritten, and its former contents do not matter. b = 0 gives x = 0 without iterating.
    ///
    /// ```
    /// use bfree::pooled::Pool;
    /// use bfree::solver::{GmresSettings, Identity, System};
    ///
    /// // A quarter turn and a stretch: not symmetric, so conjugate gradients would not do.
    /// let turn = |x: &[f64], y: &mut [f64]| (y[0], y[1]) = (-2.0 * x[1], 2.0 * x[0]);
    /// let system = System { vectors: &Pool::default(), operator: &turn, inverse: &Identity };
    /// let mut x = [0.0; 2];
    /// let settings = GmresSettings { relative_tolerance: 1e-8, max_iterations: 10, restart: 30 };
    /// let report = settings.solve(&system, &[-6.0, 8.0], &mut x)?;
    /// // Without rounding, a matrix of order n takes n iterations.
    /// assert!(report.converged() && report.iterations == 2);
    /// assert!((x[0] - 4.0).abs() < 1e-15 && (x[1] - 3.0).abs() < 1e-15, "{x:?}");
    /// # Ok::<(), bfree::solver::LinearError>(())
    /// ```
    ///
    /// # Errors
    /// A setting is out of range, the lengths differ, or a number is NaN or infinite.
    pub fn solve<S: Vectors>(
        &self,
        system: &System<'_, S>,
        rhs: &S::Vector,
        solution: &mut S::Vector,
    ) -> Result<LinearReport, LinearError> {
        InvalidSetting::check(self.restart >= 1, "restart", self.restart as f64, "at least 1")?;
        let vectors = system.vectors;
        let (mut report, b_norm) = begin(vectors, rhs, solution, self.relative_tolerance)?;
        if b_norm == 0.0 {
            return Ok(report);
        }
        let target = self.relative_tolerance * b_norm;
        // More than n directions are never independent.
        let n = vectors.len(rhs);
        let mut restart = self.restart.min(n);
        let mut r = vectors.copied(rhs);
        let mut r_norm = b_norm;
        let (mut trial, mut correction) = (vectors.zeros(n), vectors.zeros(n));
        loop {
            report.relative_residual = r_norm / b_norm;
            if report.iterations >= self.max_iterations {
                report.outcome = LinearOutcome::IterationLimit;
                return Ok(report);
            }
            let length = restart.min(self.max_iterations - report.iterations);
            let (taken, promised) = cycle(system, target, (&r, r_norm), length, &mut correction).map_err(|at| {
                LinearError::NotFinite { what: "the norm of a Krylov vector", iteration: report.iterations + at }
            })?;
            report.iterations += taken;
            report.products += taken;
            vectors.copy(solution, &mut trial);
            mutant!("solver: a restart of GMRES forgets the solution so far": { vectors.clear(&mut trial); });
            vectors.axpy(1.0, &correction, &mut trial);
            let trial_norm = system.true_residual(rhs, &trial, &mut r, &mut report)?;
            let (before, fell) = (r_norm, trial_norm / r_norm);
            if fell < 1.0 {
                vectors.copy(&trial, solution);
                r_norm = trial_norm;
                report.relative_residual = r_norm / b_norm;
            } else {
                system.true_residual(rhs, solution, &mut r, &mut report)?;
            }
            if r_norm <= target {
                return Ok(report);
            }
            let too_short = taken == length && promised > TOO_SHORT * before && length < n;
            if too_short {
                restart = (2 * restart).min(n);
            } else if fell > STAGNATION {
                report.outcome = LinearOutcome::Stagnated;
                return Ok(report);
            }
        }
    }
}

/// One cycle of at most `length` iterations on the residual `r` of norm `r_norm`. It ends when the norm is `target`. Writes the correction of x.
/// Returns the number of iterations and the residual norm that the rotations predict.
///
/// # Errors
/// The iteration at which a Krylov vector is not finite.
fn cycle<S: Vectors>(
    &System { vectors, operator, inverse }: &System<'_, S>,
    target: f64,
    (r, r_norm): (&S::Vector, f64),
    length: usize,
    correction: &mut S::Vector,
) -> Result<(usize, f64), usize> {
    let fresh = || vectors.zeros(vectors.len(r));
    let mut v = fresh();
    vectors.scaled(1.0 / r_norm, r, &mut v);
    // The basis grows by one vector an iteration, so a cycle that ends early allocates no more than it needs.
    let mut basis: Vec<S::Owned> = Vec::new();
    let mut triangle = Triangle { last: r_norm, ..Triangle::default() };
    for iteration in 0..length {
        let mut w = fresh();
        // `correction` holds M⁻¹ v meanwhile.
        inverse.apply(&v, correction);
        operator.apply(correction, &mut w);
        basis.push(v);
        let w_norm = vectors.norm(&w);
        if !w_norm.is_finite() {
            return Err(iteration);
        }
        let (column, left) = orthogonalise(vectors, &mut w, w_norm, &basis);
        let exhausted = left <= EXHAUSTED * w_norm;
        triangle.push(column, if exhausted { 0.0 } else { left });
        if exhausted || triangle.residual() <= target {
            break;
        }
        v = fresh();
        vectors.scaled(1.0 / left, &w, &mut v);
    }
    let mut sum = fresh();
    for (y, v) in triangle.solve().iter().zip(&basis) {
        vectors.axpy(*y, v, &mut sum);
    }
    inverse.apply(&sum, correction);
    Ok((basis.len(), triangle.residual()))
}

/// Removes from `w` its components along the orthonormal `basis`. Returns these components and the norm of the remainder.
fn orthogonalise<S: Vectors>(vectors: &S, w: &mut S::Vector, w_norm: f64, basis: &[S::Owned]) -> (Vec<f64>, f64) {
    let mut column = vec![0.0; basis.len()];
    let mut before = w_norm;
    for _ in 0..2 {
        // hᵢ = w·vᵢ,  w ← w − hᵢ vᵢ
        for (h, v) in column.iter_mut().zip(basis) {
            let part = vectors.dot(w, v);
            *h += part;
            vectors.axpy(-part, v, w);
        }
        let left = vectors.norm(w);
        if left > REORTHOGONALISE * before {
            return (column, left);
        }
        before = left;
    }
    (column, before)
}

/// The Hessenberg matrix of a cycle. Givens rotations make it triangular, column by column.
#[derive(Default)]
struct Triangle {
    /// Column j has j + 1 entries, the diagonal last.
    columns: Vec<Vec<f64>>,
    /// (cos, sin) of each rotation.
    rotations: Vec<(f64, f64)>,
    /// The rotated right-hand side ‖r‖ e₁, one entry a column.
    g: Vec<f64>,
    /// The entry of the rotated right-hand side below the triangle: the residual norm up to sign.
    last: f64,
}

impl Triangle {
    /// Adds the column h₁ⱼ … hⱼⱼ with `below` = hⱼ₊₁,ⱼ.
    fn push(&mut self, mut column: Vec<f64>, below: f64) {
        let mut diagonal = column.first().copied().unwrap_or(0.0);
        for (i, (c, s)) in self.rotations.iter().enumerate() {
            let next = column[i + 1];
            column[i] = c * diagonal + s * next;
            mutant!("solver: a Givens rotation has a wrong sign": { column[i] = c * diagonal - s * next; });
            diagonal = c * next - s * diagonal;
        }
        let length = (diagonal * diagonal + below * below).sqrt();
        // A zero column (A M⁻¹ v is in the span of the images before it) leaves the residual as it is.
        let (c, s) = if length > 0.0 { (diagonal / length, below / length) } else { (0.0, 1.0) };
        if let Some(entry) = column.last_mut() {
            *entry = length;
        }
        self.columns.push(column);
        self.rotations.push((c, s));
        self.g.push(c * self.last);
        self.last *= -s;
    }

    /// Norm of the least-squares residual.
    fn residual(&self) -> f64 {
        self.last.abs()
    }

    /// The y that minimises ‖ ‖r‖ e₁ − H y ‖, by back substitution; shorter than the triangle if its last columns are zero.
    fn solve(&self) -> Vec<f64> {
        let diagonal = |j: usize| self.columns[j][j];
        let largest = (0..self.columns.len()).map(diagonal).fold(0.0, f64::max);
        // Only an exhausted space of a singular operator ends in a pivot that is zero to round-off.
        let mut n = self.columns.len();
        while n > 0 && diagonal(n - 1) <= EXHAUSTED * largest {
            n -= 1;
        }
        let mut y = self.g[..n].to_vec();
        for j in (0..n).rev() {
            y[j] /= diagonal(j);
            for i in 0..j {
                y[i] -= self.columns[j][i] * y[j];
            }
        }
        y
    }
}
