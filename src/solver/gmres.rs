//! Restarted GMRES, preconditioned from the right (Saad, Iterative Methods for Sparse Linear Systems, 2nd ed., alg. 9.5).

use super::vector::{Entry, axpy, dot, norm, scaled};
use super::{InvalidSetting, LinearError, LinearOperator, LinearOutcome, LinearReport, begin, finite, true_residual};
use crate::pooled::{Pool, Pooled};

/// A second orthogonalisation is made when the first one leaves less than this part of the vector: 1/√2 (Daniel, Gragg,
/// Kaufman, Stewart 1976).
const REORTHOGONALISE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// A new direction below this part of the vector it was made from, in units of round-off: the Krylov space is exhausted.
const EXHAUSTED: f64 = 8.0;

/// A whole cycle that leaves more than this part of the residual is stagnation: a thousand such cycles gain a factor e.
const STAGNATION: f64 = 0.999;

/// A cycle whose Krylov space holds no better than this part of the residual was too short: the next is twice as long.
const TOO_SHORT: f64 = 0.9;

/// Settings of [`gmres`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GmresSettings {
    /// Wanted ‖b − A x‖ / ‖b‖, in [0, 1).
    pub relative_tolerance: f64,
    /// Iterations allowed, over all restarts.
    pub max_iterations: usize,
    /// Iterations between restarts, at least 1. One vector is kept for each, and one more. Where a cycle gains next to
    /// nothing, the following ones are twice as long.
    pub restart: usize,
}

impl Default for GmresSettings {
    fn default() -> Self {
        Self { relative_tolerance: 1e-8, max_iterations: 1000, restart: 30 }
    }
}

/// Solves A x = b from x = 0 by GMRES(m) on A M⁻¹, whose residual is the true one.
///
/// 1. r = b − A x, v₁ = r/‖r‖.
/// 2. w = A M⁻¹ vⱼ, made orthogonal to v₁ … vⱼ (modified Gram–Schmidt, again if much cancels): column j of H, vⱼ₊₁.
/// 3. Givens rotations keep H triangular and give the residual norm without x.
/// 4. After m iterations, or at the tolerance, or when the space is exhausted: x ← x + M⁻¹ V y with H y = ‖r‖ e₁.
/// 5. The residual is computed anew from x. If it does not meet the tolerance, back to 1.
/// 6. Where the best of a cycle's whole space is hardly better than x, m is doubled: null modes and clustered small
///    eigenvalues need a longer memory, and a failed solve costs more than a few vectors.
/// 7. Otherwise a cycle that hardly lowers the true residual is round-off, or an exhausted space, and ends the iteration as
///    [`LinearOutcome::Stagnated`]; one that raises it is undone.
///
/// `solution` is overwritten; its former contents do not matter. b = 0 gives x = 0 without iterating.
///
/// ```
/// use bfree::pooled::Pool;
/// use bfree::solver::{GmresSettings, Identity, LinearOperator, gmres};
///
/// /// A quarter turn and a stretch: not symmetric, so conjugate gradients would not do.
/// struct Turn;
///
/// impl LinearOperator for Turn {
///     fn apply(&self, x: &[f64], y: &mut [f64]) {
///         (y[0], y[1]) = (-2.0 * x[1], 2.0 * x[0]);
///     }
/// }
///
/// let mut x = [0.0; 2];
/// let report = gmres(&Turn, &Identity, &[-6.0, 8.0], &mut x, &GmresSettings::default(), &Pool::default())?;
/// // Without rounding, a matrix of order n takes n iterations.
/// assert!(report.converged() && report.iterations == 2);
/// assert!((x[0] - 4.0).abs() < 1e-15 && (x[1] - 3.0).abs() < 1e-15, "{x:?}");
/// # Ok::<(), bfree::solver::LinearError>(())
/// ```
///
/// # Errors
/// A setting out of range, lengths that differ, NaN or infinity.
pub fn gmres<S: Entry>(
    operator: &dyn LinearOperator<S>,
    preconditioner: &dyn LinearOperator<S>,
    rhs: &[S],
    solution: &mut [S],
    settings: &GmresSettings,
    workspace: &Pool,
) -> Result<LinearReport, LinearError> {
    InvalidSetting::check_tolerance("relative_tolerance", settings.relative_tolerance)?;
    InvalidSetting::check_restart(settings.restart)?;
    let (mut report, b_norm) = begin(rhs, solution)?;
    if b_norm == 0.0 {
        return Ok(report);
    }
    let target = settings.relative_tolerance * b_norm;
    // More than n directions are never independent.
    let mut restart = settings.restart.min(rhs.len());
    let mut r = workspace.collect(rhs.iter().copied());
    let mut r_norm = b_norm;
    let mut trial = workspace.filled(rhs.len(), S::zero());
    let mut correction = workspace.filled(rhs.len(), S::zero());
    loop {
        report.relative_residual = r_norm / b_norm;
        if report.iterations >= settings.max_iterations {
            report.outcome = LinearOutcome::IterationLimit;
            return Ok(report);
        }
        let length = restart.min(settings.max_iterations - report.iterations);
        let (taken, promised) = cycle(operator, preconditioner, &r, r_norm, target, length, &mut correction)
            .map_err(|error| error.after(report.iterations))?;
        report.iterations += taken;
        report.products += taken + 1;
        trial.copy_from_slice(solution);
        axpy(1.0, &correction, &mut trial);
        finite(norm(&trial), "the norm of the solution", report.iterations)?;
        let trial_norm =
            finite(true_residual(operator, rhs, &trial, &mut r), "the norm of the residual", report.iterations)?;
        let (before, fell) = (r_norm, trial_norm / r_norm);
        if fell < 1.0 {
            solution.copy_from_slice(&trial);
            r_norm = trial_norm;
            report.relative_residual = r_norm / b_norm;
        }
        if r_norm <= target {
            return Ok(report);
        }
        let too_short = taken == length && promised > TOO_SHORT * before && length < rhs.len();
        if too_short {
            restart = (2 * restart).min(rhs.len());
        } else if fell > STAGNATION {
            report.outcome = LinearOutcome::Stagnated;
            return Ok(report);
        }
    }
}

/// One cycle of at most `length` iterations on the residual `r` of norm `r_norm`, until its norm is `target`. Writes the
/// correction of x and returns the iterations taken and the norm the residual should have then.
fn cycle<S: Entry>(
    operator: &dyn LinearOperator<S>,
    preconditioner: &dyn LinearOperator<S>,
    r: &Pooled<S>,
    r_norm: f64,
    target: f64,
    length: usize,
    correction: &mut [S],
) -> Result<(usize, f64), LinearError> {
    let fresh = || r.pool().filled(r.len(), S::zero());
    let mut v = fresh();
    scaled(1.0 / r_norm, r, &mut v);
    // Grows by one vector an iteration: what is not needed is not allocated.
    let mut basis: Vec<Pooled<S>> = Vec::new();
    let exhausted_below = EXHAUSTED * S::EPSILON;
    let mut triangle = Triangle {
        columns: Vec::new(),
        rotations: Vec::new(),
        g: Vec::new(),
        last: r_norm,
        negligible: exhausted_below,
    };
    for iteration in 0..length {
        let mut w = fresh();
        // `correction` holds M⁻¹ v meanwhile.
        preconditioner.apply(&v, correction);
        operator.apply(correction, &mut w);
        basis.push(v);
        let w_norm = finite(norm(&w), "the norm of a Krylov vector", iteration)?;
        let (column, left) = orthogonalise(&mut w, w_norm, &basis);
        let exhausted = left <= exhausted_below * w_norm;
        triangle.push(column, if exhausted { 0.0 } else { left });
        if exhausted || triangle.residual() <= target {
            break;
        }
        v = fresh();
        scaled(1.0 / left, &w, &mut v);
    }
    let mut sum = fresh();
    for (y, v) in triangle.solve().iter().zip(&basis) {
        axpy(*y, v, &mut sum);
    }
    preconditioner.apply(&sum, correction);
    Ok((basis.len(), triangle.residual()))
}

/// Takes out of `w` its parts along the orthonormal `basis`. Returns these parts and the norm of what is left.
fn orthogonalise<S: Entry>(w: &mut [S], w_norm: f64, basis: &[Pooled<S>]) -> (Vec<f64>, f64) {
    let mut column = vec![0.0; basis.len()];
    let mut before = w_norm;
    for _ in 0..2 {
        // hᵢ = w·vᵢ,  w ← w − hᵢ vᵢ
        for (h, v) in column.iter_mut().zip(basis) {
            let part = dot(w, v);
            *h += part;
            axpy(-part, v, w);
        }
        let left = norm(w);
        if left > REORTHOGONALISE * before {
            return (column, left);
        }
        before = left;
    }
    (column, before)
}

/// The Hessenberg matrix of a cycle, turned into a triangle by Givens rotations as its columns come.
struct Triangle {
    /// Column j has j + 1 entries, the diagonal last.
    columns: Vec<Vec<f64>>,
    /// (cos, sin) of each rotation.
    rotations: Vec<(f64, f64)>,
    /// The rotated right-hand side ‖r‖ e₁, one entry a column.
    g: Vec<f64>,
    /// Its entry below the triangle, the residual up to sign.
    last: f64,
    /// A pivot below this part of the largest one is round-off.
    negligible: f64,
}

impl Triangle {
    /// Adds h₁ⱼ … hⱼⱼ and hⱼ₊₁,ⱼ.
    fn push(&mut self, mut column: Vec<f64>, below: f64) {
        let mut diagonal = column.first().copied().unwrap_or(0.0);
        for (i, (c, s)) in self.rotations.iter().enumerate() {
            let next = column[i + 1];
            column[i] = c * diagonal + s * next;
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
        // Only an exhausted space of a singular operator ends in a zero pivot.
        let mut n = self.columns.len();
        while n > 0 && diagonal(n - 1) <= self.negligible * largest {
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

#[cfg(test)]
mod tests {
    use super::super::testing::{Dense, distance, irregular};
    use super::super::{Identity, LinearOutcome};
    use super::*;

    /// In memory of its own.
    fn gmres(
        operator: &dyn LinearOperator,
        preconditioner: &dyn LinearOperator,
        rhs: &[f64],
        solution: &mut [f64],
        settings: &GmresSettings,
    ) -> Result<LinearReport, LinearError> {
        super::gmres(operator, preconditioner, rhs, solution, settings, &Pool::default())
    }

    const TIGHT: GmresSettings = GmresSettings { relative_tolerance: 1e-12, max_iterations: 500, restart: 100 };

    /// ‖b − A x‖ / ‖b‖, by another road than the solver's.
    fn check(a: &Dense, b: &[f64], x: &[f64]) -> f64 {
        let r: Vec<f64> = b.iter().zip(a.times(x)).map(|(b, ax)| b - ax).collect();
        norm(&r) / norm(b)
    }

    fn nonsymmetric(n: usize) -> Dense {
        Dense::from_fn(n, |i, j| match j as i64 - i as i64 {
            0 => 4.0 + (i as f64).sin(),
            1 => -2.5,
            -1 => 0.5,
            _ => 0.1 / (1.0 + (i + 2 * j) as f64),
        })
    }

    #[test]
    fn solves_nonsymmetric_and_indefinite_systems() {
        let n = 40;
        let indefinite =
            Dense::from_fn(n, |i, j| if i == j { i as f64 - 19.3 } else { 0.2 / (1.0 + i.abs_diff(j) as f64) });
        for a in [nonsymmetric(n), indefinite] {
            let exact = irregular(n);
            let b = a.times(&exact);
            for (preconditioned, report, x) in [false, true].map(|preconditioned| {
                let mut x = vec![f64::NAN; n];
                let report = if preconditioned {
                    gmres(&a, &a.jacobi(), &b, &mut x, &TIGHT)
                } else {
                    gmres(&a, &Identity, &b, &mut x, &TIGHT)
                };
                (preconditioned, report.unwrap(), x)
            }) {
                assert!(report.converged() && report.iterations <= n, "{preconditioned} {report:?}");
                assert!(distance(&x, &exact) < 1e-9, "{preconditioned} {}", distance(&x, &exact));
                let again = check(&a, &b, &x);
                assert!(again <= 1e-12 && (again - report.relative_residual).abs() < 1e-15, "{again} {report:?}");
            }
        }
    }

    #[test]
    fn ill_conditioned_system_meets_the_true_residual() {
        // The Hilbert matrix of order 10 has condition 1.6e13: the residual is small, the solution need not be exact.
        let a = Dense::from_fn(10, |i, j| 1.0 / (1 + i + j) as f64);
        let b = a.times(&[1.0; 10]);
        let mut x = vec![0.0; 10];
        let report = gmres(&a, &Identity, &b, &mut x, &TIGHT).unwrap();
        assert!(report.converged() && check(&a, &b, &x) <= 1e-12, "{report:?}");
    }

    #[test]
    fn krylov_vectors_that_nearly_depend_on_each_other_are_orthogonal() {
        // Hilbert's matrix makes vectors that lie nearly in the span of those before. Made orthogonal once, they have products of up to
        // 0.03; twice is enough for round-off (Giraud, Langou, Rozložník, van den Eshof, Numer. Math. 101 (2005)).
        const N: usize = 12;
        let a = Dense::from_fn(N, |i, j| 1.0 / (1 + i + j) as f64);
        let mut basis: Vec<Pooled<f64>> = Vec::new();
        let mut w: Pooled<f64> = a.times(&[1.0; N]).into();
        for _ in 0..9 {
            let w_norm = norm(&w);
            let (_, left) = orthogonalise(&mut w, w_norm, &basis);
            assert!(left > EXHAUSTED * f64::EPSILON * w_norm, "the space is exhausted after {} vectors", basis.len());
            let v: Pooled<f64> = w.iter().map(|x| x / left).collect::<Vec<_>>().into();
            for before in &basis {
                let product = dot(before, &v);
                assert!(product.abs() <= N as f64 * f64::EPSILON, "{product:e} after {} vectors", basis.len());
            }
            w = a.times(&v).into();
            basis.push(v);
        }
    }

    #[test]
    fn number_of_distinct_eigenvalues_is_the_number_of_iterations() {
        let a = Dense::from_fn(60, |i, j| if i == j { [1.0, -2.0, 5.0][i % 3] } else { 0.0 });
        let mut x = vec![0.0; 60];
        let report = gmres(&a, &Identity, &irregular(60), &mut x, &TIGHT).unwrap();
        assert_eq!((report.outcome, report.iterations), (LinearOutcome::Converged, 3));
        // The exact inverse as preconditioner: one.
        assert_eq!(gmres(&a, &a.jacobi(), &irregular(60), &mut x, &TIGHT).unwrap().iterations, 1);
    }

    #[test]
    fn restart_is_a_new_start_from_the_last_residual() {
        let a = nonsymmetric(40);
        let b = irregular(40);
        let settings = GmresSettings { relative_tolerance: 0.0, max_iterations: 6, restart: 3 };
        let mut twice = vec![0.0; 40];
        gmres(&a, &a.jacobi(), &b, &mut twice, &settings).unwrap();
        // By hand: three iterations, then three on the residual.
        let once = GmresSettings { max_iterations: 3, ..settings };
        let (mut x, mut dx) = (vec![0.0; 40], vec![0.0; 40]);
        gmres(&a, &a.jacobi(), &b, &mut x, &once).unwrap();
        let r: Vec<f64> = b.iter().zip(a.times(&x)).map(|(b, ax)| b - ax).collect();
        gmres(&a, &a.jacobi(), &r, &mut dx, &once).unwrap();
        axpy(1.0, &dx, &mut x);
        assert!(distance(&x, &twice) < 1e-15, "{}", distance(&x, &twice));
        // And with any restart the same solution.
        let mut full = vec![0.0; 40];
        assert!(gmres(&a, &a.jacobi(), &b, &mut full, &TIGHT).unwrap().converged());
        for restart in [2, 5, 11] {
            let report = gmres(&a, &a.jacobi(), &b, &mut x, &GmresSettings { restart, ..TIGHT }).unwrap();
            assert!(report.converged() && distance(&x, &full) < 1e-11, "{restart} {report:?}");
        }
    }

    #[test]
    fn cycles_that_gain_nothing_are_followed_by_longer_ones() {
        // The cyclic shift: GMRES(m) makes no progress at all for m < n, and is exact at n.
        let n = 12;
        let shift = Dense::from_fn(n, |i, j| if (i + 1) % n == j { 1.0 } else { 0.0 });
        let mut b = vec![0.0; n];
        b[0] = 1.0;
        let mut x = vec![0.0; n];
        for (restart, iterations) in [(n, n), (n - 1, n - 1 + n), (2, 2 + 4 + 8 + n)] {
            let report = gmres(&shift, &Identity, &b, &mut x, &GmresSettings { restart, ..TIGHT }).unwrap();
            assert_eq!((report.outcome, report.iterations), (LinearOutcome::Converged, iterations));
        }
        let settings = GmresSettings { restart: 2, max_iterations: 20, ..TIGHT };
        let report = gmres(&shift, &Identity, &b, &mut x, &settings).unwrap();
        assert_eq!((report.outcome, report.iterations), (LinearOutcome::IterationLimit, 20));
    }

    #[test]
    fn an_exhausted_space_ends_its_cycle() {
        // Two eigenvalues, two directions, and behind them nothing but round-off: each cycle ends at the second.
        let a = Dense::from_fn(20, |i, j| if i == j { [1.0, 3.0][i % 2] } else { 0.0 });
        let mut x = vec![0.0; 20];
        let settings = GmresSettings { relative_tolerance: 0.0, ..TIGHT };
        let report = gmres(&a, &Identity, &irregular(20), &mut x, &settings).unwrap();
        assert!(report.relative_residual < 1e-15, "{report:?}");
        let cycles = report.products - report.iterations;
        assert!(report.iterations <= 2 * cycles, "{report:?}");
    }

    #[test]
    fn rotations_solve_the_least_squares_problem() {
        // A Hessenberg matrix without pattern: what is left of ‖r‖ e₁ is orthogonal to its columns, and as large as the rotations say.
        let (n, r_norm) = (6, 2.5);
        let entries = irregular(n * (n + 1));
        let h = |i: usize, j: usize| if i <= j + 1 { entries[i * n + j] } else { 0.0 };
        let mut triangle =
            Triangle { columns: vec![], rotations: vec![], g: vec![], last: r_norm, negligible: f64::EPSILON };
        for j in 0..n {
            triangle.push((0..=j).map(|i| h(i, j)).collect(), h(j + 1, j));
        }
        let y = triangle.solve();
        let times_y = |i: usize| (0..n).map(|j| h(i, j) * y[j]).sum::<f64>();
        let left: Vec<f64> = (0..=n).map(|i| if i == 0 { r_norm - times_y(i) } else { -times_y(i) }).collect();
        assert!((norm(&left) - triangle.residual()).abs() < 1e-14);
        for j in 0..n {
            let along: f64 = (0..=n).map(|i| h(i, j) * left[i]).sum();
            assert!(along.abs() < 1e-13, "{j} {along}");
        }
    }

    #[test]
    fn round_off_is_reported_not_looped_on() {
        let n = 12;
        let mut x = vec![0.0; n];
        let settings = GmresSettings { relative_tolerance: 0.0, ..TIGHT };
        let report = gmres(&nonsymmetric(n), &Identity, &irregular(n), &mut x, &settings).unwrap();
        assert!(report.relative_residual < 1e-14 && report.iterations < 100, "{report:?}");
    }

    #[test]
    fn singular_systems_give_the_least_residual() {
        // A = diag(1, 2, 0, 3): consistent, then with a part 4 of b out of range.
        let a = Dense::from_fn(4, |i, j| if i == j { [1.0, 2.0, 0.0, 3.0][i] } else { 0.0 });
        let mut x = vec![0.0; 4];
        let report = gmres(&a, &Identity, &[1.0, 1.0, 0.0, 1.0], &mut x, &TIGHT).unwrap();
        assert!(report.converged() && distance(&x, &[1.0, 0.5, 0.0, 1.0 / 3.0]) < 1e-14);
        let b = [3.0, 3.0, 4.0, 3.0];
        let report = gmres(&a, &Identity, &b, &mut x, &TIGHT).unwrap();
        assert_eq!(report.outcome, LinearOutcome::Stagnated);
        assert!((report.relative_residual - 4.0 / norm(&b)).abs() < 1e-14, "{report:?}");
        // Hard breakdown: A e₁ = 0.
        let nilpotent = Dense::from_fn(2, |i, j| if (i, j) == (0, 1) { 1.0 } else { 0.0 });
        let report = gmres(&nilpotent, &Identity, &[0.0, 1.0], &mut x[..2], &TIGHT).unwrap();
        assert_eq!((report.outcome, report.relative_residual), (LinearOutcome::Stagnated, 1.0));
        let zero = Dense::from_fn(2, |_, _| 0.0);
        let report = gmres(&zero, &Identity, &[0.0, 1.0], &mut x[..2], &TIGHT).unwrap();
        assert_eq!((report.outcome, x[0], x[1]), (LinearOutcome::Stagnated, 0.0, 0.0));
    }

    #[test]
    fn zero_right_hand_side_needs_no_iteration() {
        let mut x = vec![1.0; 5];
        let report = gmres(&nonsymmetric(5), &Identity, &[0.0; 5], &mut x, &TIGHT).unwrap();
        assert_eq!((report.iterations, report.products, report.converged()), (0, 0, true));
        assert_eq!(x, [0.0; 5]);
        assert!(gmres(&nonsymmetric(0), &Identity, &[], &mut [], &TIGHT).unwrap().converged());
    }

    #[test]
    fn not_finite_is_an_error_wherever_it_comes_from() {
        let mut x = vec![0.0; 3];
        let good = nonsymmetric(3);
        let not_finite = |result| matches!(result, Err(LinearError::NotFinite { .. }));
        assert!(not_finite(gmres(&good, &Identity, &[1.0, f64::NAN, 0.0], &mut x, &TIGHT)));
        assert!(not_finite(gmres(&good, &Identity, &[1.0, f64::INFINITY, 0.0], &mut x, &TIGHT)));
        for bad in [f64::NAN, f64::INFINITY] {
            let a = Dense::from_fn(3, |i, j| if (i, j) == (2, 2) { bad } else { good.0[i][j] });
            assert!(not_finite(gmres(&a, &Identity, &[1.0, 1.0, 1.0], &mut x, &TIGHT)));
        }
        // A preconditioner that divides by zero, under an operator that ignores the entry.
        struct Ignores(Dense);
        impl LinearOperator for Ignores {
            fn apply(&self, x: &[f64], y: &mut [f64]) {
                self.0.apply(&[x[0], x[1], 0.0], y);
            }
        }
        let zero_mass = Dense::from_fn(3, |i, j| if i == j { [1.0, 1.0, f64::INFINITY][i] } else { 0.0 });
        assert!(not_finite(gmres(&Ignores(good), &zero_mass, &[1.0, 1.0, 1.0], &mut x, &TIGHT)));
    }

    #[test]
    fn wrong_settings_and_lengths_are_named() {
        let a = nonsymmetric(3);
        let solve = |settings: GmresSettings, n: usize| {
            gmres(&a, &Identity, &[1.0; 3], &mut vec![0.0; n], &settings).unwrap_err().to_string()
        };
        assert!(solve(GmresSettings { restart: 0, ..TIGHT }, 3).contains("restart is 0e0; it must be at least 1"));
        assert!(solve(GmresSettings { relative_tolerance: f64::NAN, ..TIGHT }, 3).contains("relative_tolerance"));
        assert!(solve(TIGHT, 4).contains("3 entries and the solution 4"));
    }
}
