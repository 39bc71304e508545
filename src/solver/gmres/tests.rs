use super::super::testing::{Dense, distance, irregular};
use super::super::{Identity, LinearOperator};
use super::*;
use crate::pooled::{Pool, Pooled};
use crate::space::vector::{dot, norm};
use std::cell::Cell;

/// Solves with a memory pool of its own.
fn gmres(
    operator: &dyn LinearOperator,
    preconditioner: &dyn LinearOperator,
    rhs: &[f64],
    solution: &mut [f64],
    settings: &GmresSettings,
) -> Result<LinearReport, LinearError> {
    settings.solve(&System { vectors: &Pool::default(), operator, inverse: preconditioner }, rhs, solution)
}

const TIGHT: GmresSettings = GmresSettings { relative_tolerance: 1e-12, max_iterations: 500, restart: 100 };

/// ‖b − A x‖ / ‖b‖, computed independently of the solver.
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
    // The Hilbert matrix of order 10 has condition 1.6e13. The residual is small, but the solution need not be exact.
    let a = Dense::from_fn(10, |i, j| 1.0 / (1 + i + j) as f64);
    let b = a.times(&[1.0; 10]);
    let mut x = vec![0.0; 10];
    let report = gmres(&a, &Identity, &b, &mut x, &TIGHT).unwrap();
    assert!(report.converged() && check(&a, &b, &x) <= 1e-12, "{report:?}");
}

#[test]
fn krylov_vectors_that_nearly_depend_on_each_other_are_orthogonal() {
    // Hilbert's matrix makes vectors that lie nearly in the span of earlier vectors. Orthogonalised once, they have products of up to 0.03.
    // Twice is enough for round-off (Giraud, Langou, Rozložník, van den Eshof, Numer. Math. 101 (2005)).
    const N: usize = 12;
    let a = Dense::from_fn(N, |i, j| 1.0 / (1 + i + j) as f64);
    let mut basis: Vec<Pooled<f64>> = Vec::new();
    let mut w: Pooled<f64> = a.times(&[1.0; N]).into();
    for _ in 0..9 {
        let w_norm = norm(&w);
        let (_, left) = orthogonalise(&Pool::default(), &mut w, w_norm, &basis);
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
    // The exact inverse as preconditioner takes one iteration.
    assert_eq!(gmres(&a, &a.jacobi(), &irregular(60), &mut x, &TIGHT).unwrap().iterations, 1);
}

#[test]
fn restart_is_a_new_start_from_the_last_residual() {
    let a = nonsymmetric(40);
    let b = irregular(40);
    let settings = GmresSettings { relative_tolerance: 0.0, max_iterations: 6, restart: 3 };
    let mut twice = vec![0.0; 40];
    gmres(&a, &a.jacobi(), &b, &mut twice, &settings).unwrap();
    // The same by hand: three iterations, then three on the residual.
    let once = GmresSettings { max_iterations: 3, ..settings };
    let (mut x, mut dx) = (vec![0.0; 40], vec![0.0; 40]);
    gmres(&a, &a.jacobi(), &b, &mut x, &once).unwrap();
    let r: Vec<f64> = b.iter().zip(a.times(&x)).map(|(b, ax)| b - ax).collect();
    gmres(&a, &a.jacobi(), &r, &mut dx, &once).unwrap();
    Pool::default().axpy(1.0, &dx, &mut x);
    assert!(distance(&x, &twice) < 1e-15, "{}", distance(&x, &twice));
    // Any restart gives the same solution.
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
    // Two eigenvalues give two directions. A third would be round-off, so each cycle ends at the second.
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
    // A Hessenberg matrix without pattern: the remainder of ‖r‖ e₁ is orthogonal to its columns, and as large as the rotations predict.
    let (n, r_norm) = (6, 2.5);
    let entries = irregular(n * (n + 1));
    let h = |i: usize, j: usize| if i <= j + 1 { entries[i * n + j] } else { 0.0 };
    let mut triangle = Triangle { last: r_norm, ..Triangle::default() };
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
    // A = diag(1, 2, 0, 3): first b is consistent, then its third entry, 4, is out of the range of A.
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

/// The identity, except that one application has the wrong sign.
struct Lapse {
    at: usize,
    count: Cell<usize>,
}

impl LinearOperator for Lapse {
    fn apply(&self, r: &[f64], z: &mut [f64]) {
        self.count.set(self.count.get() + 1);
        let sign = if self.count.get() == self.at { -1.0 } else { 1.0 };
        z.iter_mut().zip(r).for_each(|(z, r)| *z = sign * r);
    }
}

#[test]
fn a_cycle_that_is_undone_leaves_its_residual_behind() {
    // A turn of four entries: no Krylov space of less than four vectors has a better solution than 0, so the first cycle, of two, is too short.
    let a = Dense::from_fn(4, |i, j| {
        if j == (i + 1) % 4 {
            1.0
        } else if i == j {
            0.4
        } else {
            0.0
        }
    });
    let b = [0.0, 0.0, 0.0, 1.0];
    let settings = GmresSettings { restart: 2, ..TIGHT };
    // The third application makes the correction of the first cycle.
    let (mut x, lapse) = ([0.0; 4], Lapse { at: 3, count: Cell::new(0) });
    let report = gmres(&a, &lapse, &b, &mut x, &settings).unwrap();
    // The second cycle, of four, starts from the right residual and solves the system.
    assert!(report.converged() && report.iterations == 6, "{report:?}");
    assert!(check(&a, &b, &x) < 1e-12);
}
