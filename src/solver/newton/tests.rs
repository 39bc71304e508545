//! Facts about the iteration on small problems.

mod problems;

use super::*;
use crate::solver::BlockJacobi;
use crate::solver::testing::Dense;
use crate::solver::{Forcing, InvalidSetting, LinearOutcome, NonlinearProblem};
use problems::{Outside, Problem, hills, rosenbrock, scalar, springs};

/// Newton's method with the diagonal as preconditioner.
fn newton(
    problem: &impl NonlinearProblem<Inadmissible = Outside>,
    x: &mut [f64],
    settings: &NewtonSettings,
) -> Result<NewtonReport, NewtonError<Outside>> {
    super::newton(problem, &mut BlockJacobi::<1>::default(), x, settings, &Pool::default())
}

fn solved(problem: &impl NonlinearProblem<Inadmissible = Outside>, x: &mut [f64]) -> NewtonReport {
    newton(problem, x, &NewtonSettings::default()).unwrap()
}

fn failure(
    problem: &impl NonlinearProblem<Inadmissible = Outside>,
    x: &mut [f64],
    settings: &NewtonSettings,
) -> NewtonError<Outside> {
    newton(problem, x, settings).unwrap_err()
}

#[test]
fn rosenbrock_is_solved_and_counted() {
    let mut x = [-1.2, 1.0];
    let NewtonReport { history, .. } = solved(&rosenbrock(true), &mut x);
    assert!((x[0] - 1.0).abs() < 1e-8 && (x[1] - 1.0).abs() < 1e-8, "{x:?}");
    // The full second step multiplies the residual by 300 and lowers neither merit function, so the line search must have worked.
    assert!(history.iterations.iter().all(|i| i.merit == Merit::Potential || i.ratio < 1.0));
    let counts = history.counts;
    assert_eq!(counts.linearizations, history.iterations.len());
    assert_eq!(counts.residuals, 1 + history.iterations.len() + counts.line_search);
    assert_eq!(counts.krylov_iterations, history.iterations.iter().map(|i| i.krylov.iterations).sum::<usize>());
    assert_eq!(counts.magnitudes, 1);
}

#[test]
fn convergence_is_quadratic() {
    let mut u = vec![0.0; 12];
    let settings =
        NewtonSettings { relative_tolerance: 1e-13, forcing: Forcing::Fixed(1e-12), ..NewtonSettings::default() };
    let report = newton(&springs(3.0, 1.0, 1.2, 12), &mut u, &settings).unwrap();
    let residuals: Vec<f64> = report.history.iterations.iter().map(|i| i.residual).collect();
    // Order of the last three above round-off: log(r₃/r₂) / log(r₂/r₁) → 2.
    let above: Vec<f64> = residuals.into_iter().filter(|r| *r > 1e-12).collect();
    let [.., a, b, c] = above[..] else { panic!("{above:?}") };
    let order = (c / b).ln() / (b / a).ln();
    assert!(order > 1.8 && order < 2.5, "{order} {above:?}");
}

#[test]
fn inadmissible_steps_are_shortened() {
    // ln x = −1 from x = 10: the full step goes to x < 0.
    let problem = scalar(|x| if x > 0.0 { Ok(x.ln() + 1.0) } else { Err(Outside(x)) }, |x| 1.0 / x);
    let mut x = [10.0];
    let report = solved(&problem, &mut x);
    assert!((x[0] - (-1.0_f64).exp()).abs() < 1e-9);
    assert!(report.history.iterations[0].step_length < 1.0 && report.history.counts.line_search > 0);
    let mut x = [-1.0];
    let error = failure(&problem, &mut x, &NewtonSettings::default());
    assert!(matches!(error.cause, NewtonFailure::Inadmissible { iteration: 0, source: Outside(-1.0) }));
    assert_eq!((x[0], error.history.first_residual), (-1.0, None));
}

#[test]
fn scaling_by_powers_of_two_gives_the_same_bits() {
    let n = 15;
    for krylov in [Krylov::Gmres { restart: 6 }, Krylov::ConjugateGradient] {
        for forcing in [Forcing::Fixed(1e-8), Forcing::EisenstatWalker] {
            let settings = NewtonSettings { krylov, forcing, ..NewtonSettings::default() };
            let mut reference = vec![0.0; n];
            let report = newton(&springs(3.0, 0.7, 2.9, n), &mut reference, &settings).unwrap();
            for (length, force) in [(30, 30), (-30, 30), (30, -90), (-30, -91), (29, 120)] {
                let (length, force) = (2.0_f64.powi(length), 2.0_f64.powi(force));
                let mut u = vec![0.0; n];
                let problem = springs(3.0 * force / length, 0.7 * length, 2.9 * force, n);
                let scaled = newton(&problem, &mut u, &settings).unwrap();
                assert!(u.iter().zip(&reference).all(|(u, v)| u.to_bits() == (v * length).to_bits()));
                assert_eq!(scaled.history.counts, report.history.counts);
                for (a, b) in scaled.history.iterations.iter().zip(&report.history.iterations) {
                    assert_eq!(*a, NewtonIteration { residual: b.residual * force, ..*b });
                }
            }
        }
    }
}

#[test]
fn forcing_terms_reach_the_same_solution() {
    let problem = springs(1.0, 1.0, 1.1, 20);
    let solve = |forcing| {
        let mut u = vec![0.0; 20];
        let settings = NewtonSettings { relative_tolerance: 1e-11, forcing, ..NewtonSettings::default() };
        let report = newton(&problem, &mut u, &settings).unwrap();
        assert!(report.history.iterations.iter().all(|i| i.krylov.relative_residual <= i.forcing));
        let asked: Vec<f64> = report.history.iterations.iter().map(|i| i.forcing).collect();
        (u, report.history.counts.krylov_iterations, asked)
    };
    let (exact, tight, _) = solve(Forcing::Fixed(1e-10));
    let (u, loose, asked) = solve(Forcing::EisenstatWalker);
    assert!(u.iter().zip(&exact).all(|(u, v)| (u - v).abs() < 1e-8));
    // On a chain of n springs, conjugate gradients take n iterations to any tolerance.
    assert!(loose <= tight, "{loose} {tight}");
    assert!(asked[0] == 0.01 && asked[asked.len() - 1] < 1e-4, "{asked:?}");
}

#[test]
fn negative_curvature_falls_back_to_gmres_and_says_so() {
    // K = [1 + 3x², 2; 2, 1]: indefinite near 0, with a positive diagonal.
    let problem = Problem {
        residual: |x: &[f64]| Ok(vec![x[0] + 2.0 * x[1] + x[0].powi(3), 2.0 * x[0] + x[1]]),
        magnitude: |_: &[f64]| 1.0,
        potential: |_: &[f64]| None,
        tangent: |x: &[f64]| Dense(vec![vec![1.0 + 3.0 * x[0] * x[0], 2.0], vec![2.0, 1.0]]),
    };
    let mut x = [0.5, -0.5];
    let settings = NewtonSettings { krylov: Krylov::ConjugateGradient, ..NewtonSettings::default() };
    let report = newton(&problem, &mut x, &settings).unwrap();
    assert!(report.history.iterations[0].krylov.converged());
    // Products that belong to no reported solve are those of abandoned conjugate gradients.
    let abandoned = |history: &NewtonHistory| {
        history.counts.tangent_products - history.iterations.iter().map(|i| i.krylov.products).sum::<usize>()
    };
    assert!(abandoned(&report.history) > 0);
    // A definite tangent needs no fallback.
    let mut u = vec![0.0; 5];
    let report = newton(&springs(1.0, 1.0, 0.3, 5), &mut u, &settings).unwrap();
    assert_eq!(abandoned(&report.history), 0);
}

#[test]
fn negative_curvature_leads_downhill_where_there_is_a_potential() {
    let n = 6;
    let solve = |problem: &dyn NonlinearProblem<Inadmissible = Outside>, krylov| {
        // Close to the tops, where the full Newton step leads back to the tops.
        let mut x: Vec<f64> = (0..n).map(|i| 0.1 + 0.02 * i as f64).collect();
        let settings = NewtonSettings { krylov, ..NewtonSettings::default() };
        let preconditioner = &mut crate::solver::Identity;
        let history = super::newton(problem, preconditioner, &mut x, &settings, &Pool::default()).unwrap().history;
        (x, history)
    };
    let (x, history) = solve(&hills(n, true), Krylov::ConjugateGradient);
    assert!(x.iter().step_by(2).all(|x| (x - 1.0).abs() < 1e-6), "a valley of each: {x:?}");
    let truncated = |i: &&NewtonIteration| i.krylov.outcome == LinearOutcome::NegativeCurvature;
    assert!(history.iterations.iter().filter(truncated).count() > 0);
    // Without a potential, and by GMRES, the nearest solution of R = 0 is found: the top.
    for (problem, krylov) in
        [(hills(n, false), Krylov::ConjugateGradient), (hills(n, true), Krylov::Gmres { restart: 10 })]
    {
        let (x, _) = solve(&problem, krylov);
        assert!(x.iter().all(|x| x.abs() < 1e-6), "{x:?}");
    }
}

#[test]
fn systems_left_unsolved_are_counted() {
    // Three iterations for twelve springs in a row are too few.
    let settings =
        NewtonSettings { krylov: Krylov::ConjugateGradient, max_krylov_iterations: 3, ..NewtonSettings::default() };
    let counts = failure(&springs(3.0, 1.0, 1.2, 12), &mut [0.0; 12], &settings).history.counts;
    assert!(counts.krylov_limited > 0 && counts.krylov_stagnated == 0, "{counts:?}");
    // A zero tangent.
    let counts = failure(&scalar(|x| Ok(x - 1.0), |_| 0.0), &mut [0.0], &settings).history.counts;
    assert_eq!((counts.krylov_limited, counts.krylov_stagnated), (0, 1));
    assert_eq!(solved(&springs(3.0, 1.0, 1.2, 12), &mut [0.0; 12]).history.counts.krylov_limited, 0);
}

#[test]
fn potential_accepts_what_the_residual_norm_refuses() {
    // Along Rosenbrock's curved valley every useful step raises the residual, while Π falls.
    let solve = |potential| {
        let settings = NewtonSettings { max_iterations: 500, ..NewtonSettings::default() };
        newton(&rosenbrock(potential), &mut [-1.2, 1.0], &settings).map(|report| report.history)
    };
    let with = solve(true).unwrap();
    assert!(with.iterations.iter().any(|i| i.merit == Merit::Potential && i.ratio > 1.0));
    // The norm alone creeps along the valley, or gives up in it.
    assert!(solve(false).map_or(true, |history| history.iterations.len() > 2 * with.iterations.len()));
}

#[test]
fn not_finite_is_never_accepted() {
    let problem = scalar(|_| Ok(f64::NAN), |_| 1.0);
    let error = failure(&problem, &mut [1.0], &NewtonSettings::default());
    assert!(matches!(error.cause, NewtonFailure::NotFinite(_)) && error.history.iterations.is_empty());
    // R is NaN beyond x = 1, where the full step leads. The step is shortened like an inadmissible one.
    for bad in [f64::NAN, f64::INFINITY] {
        let problem = scalar(|x| Ok(if x > 1.0 { bad } else { x * x * x - 0.5 }), |x| 3.0 * x * x);
        let mut x = [0.2];
        assert!(solved(&problem, &mut x).history.iterations[0].step_length < 1.0);
        assert!((x[0] - 0.5_f64.cbrt()).abs() < 1e-8);
        // R is NaN everywhere but at the guess.
        let problem = scalar(|x| Ok(if x == 3.0 { 1.0 } else { bad }), |_| 1.0);
        let mut x = [3.0];
        let error = failure(&problem, &mut x, &NewtonSettings::default());
        assert!(
            matches!(error.cause, NewtonFailure::NotFinite(_)) && error.history.first_residual == Some(1.0),
            "{error:?}"
        );
        assert_eq!(x, [3.0]);
        // NaN in the tangent.
        let error = failure(&scalar(Ok, |_| bad), &mut x, &NewtonSettings::default());
        assert!(matches!(error.cause, NewtonFailure::LinearSolverFailed(LinearSolverFailure::Error(_))));
        // NaN in the magnitude, with which any residual would count as converged.
        let problem = Problem {
            residual: |x: &[f64]| Ok(x.to_vec()),
            magnitude: |_: &[f64]| bad,
            potential: |_: &[f64]| None,
            tangent: |_: &[f64]| Dense(vec![vec![1.0]]),
        };
        let error = failure(&problem, &mut [1.0], &NewtonSettings::default());
        assert!(matches!(error.cause, NewtonFailure::NotFinite(_)) && error.history.iterations.is_empty());
    }
}

#[test]
fn failures_are_told_apart() {
    let default = NewtonSettings::default();
    let settings = NewtonSettings { max_iterations: 3, ..default };
    let mut x = [-1.2, 1.0];
    let error = failure(&rosenbrock(true), &mut x, &settings);
    assert!(matches!(error.cause, NewtonFailure::MaxIterations { allowed: 3, .. }));
    // x is the last accepted iterate, so its residual is the last reported one.
    let mut r = [0.0; 2];
    rosenbrock(true).residual(&x, &mut r).unwrap();
    assert_eq!((Some(norm(&r)), error.history.iterations.len()), (error.history.residual(), 3));

    // A zero tangent.
    let error = failure(&scalar(|x| Ok(x - 1.0), |_| 0.0), &mut [0.0], &default);
    assert!(
        matches!(error.cause, NewtonFailure::LinearSolverFailed(_)) && error.history.iterations.is_empty(),
        "{error:?}"
    );
    // A tangent of the wrong sign: the residual rises at every step length.
    let mut x = [0.0];
    let error = failure(&scalar(|x| Ok(x - 1.0), |_| -1.0), &mut x, &default);
    assert!(matches!(error.cause, NewtonFailure::LineSearchFailed { trials: 26, inadmissible: 0, not_finite: 0, .. }));
    assert_eq!(x, [0.0]);
    // A tangent a thousand times too stiff: every step is accepted, but the residual hardly falls.
    let error = failure(&scalar(|x| Ok(x - 1.0), |_| 1000.0), &mut [0.0], &default);
    assert!(matches!(error.cause, NewtonFailure::Stagnated { .. }) && error.history.iterations.len() == 8, "{error:?}");
    // Π = −½x² falls without end. The tangent is not its second derivative.
    let downhill = Problem {
        residual: |x: &[f64]| Ok(vec![-x[0]]),
        magnitude: |x: &[f64]| x[0].abs(),
        potential: |x: &[f64]| Some((-0.5 * x[0] * x[0], 0.5 * x[0] * x[0])),
        tangent: |_: &[f64]| Dense(vec![vec![1.0]]),
    };
    let error = failure(&downhill, &mut [1.0], &default);
    let residual = error.history.residual().unwrap();
    assert!(matches!(error.cause, NewtonFailure::Diverged { .. }) && residual > 1e8, "{error:?}");
    let settings = NewtonSettings { forcing: Forcing::Fixed(0.0), ..default };
    let error = failure(&downhill, &mut [1.0], &settings);
    assert!(matches!(error.cause, NewtonFailure::Setting(InvalidSetting { name: "forcing", .. })));
}

#[test]
fn a_step_must_do_a_part_of_what_it_promises() {
    // A tangent too stiff: each step removes this part of the residual. A ten thousandth of the predicted decrease is enough.
    for (part, enough) in [(1e-3, true), (1e-5, false)] {
        let error = failure(&scalar(|x| Ok(x - 1.0), |_| 1.0 / part), &mut [0.0], &NewtonSettings::default());
        assert_eq!(matches!(error.cause, NewtonFailure::Stagnated { .. }), enough, "{error:?}");
        assert_eq!(matches!(error.cause, NewtonFailure::LineSearchFailed { trials: 26, .. }), !enough, "{error:?}");
    }
    // |R| never falls. Π falls by this part of the decrease that its slope R·d predicts.
    for (part, enough) in [(1e-3, true), (1e-5, false)] {
        let slope = Problem {
            residual: |_: &[f64]| Ok(vec![-1.0]),
            magnitude: |_: &[f64]| 1.0,
            potential: move |x: &[f64]| Some((-part * x[0], part * x[0].abs())),
            tangent: |_: &[f64]| Dense(vec![vec![1.0]]),
        };
        let error = failure(&slope, &mut [0.0], &NewtonSettings::default());
        let accepted = error.history.iterations.iter().filter(|i| i.merit == Merit::Potential).count();
        assert_eq!(accepted, if enough { 30 } else { 0 }, "{error:?}");
    }
}

#[test]
fn round_off_is_convergence_and_other_stagnation_is_not() {
    let settings = NewtonSettings { relative_tolerance: 0.0, ..NewtonSettings::default() };
    // R = x − 1, except that |R| never falls below `noise`.
    let noisy = |noise: f64| scalar(move |x| Ok(if (x - 1.0).abs() < noise { noise } else { x - 1.0 }), |_| 1.0);
    let eps = f64::EPSILON;
    let mut x = [0.0];
    // `noise` below the floor 4 eps · 1, below 16 floors, and above 16 floors.
    let report = newton(&noisy(3.0 * eps), &mut x, &settings).unwrap();
    assert_eq!(report.convergence, Convergence::Tolerance);
    let mut x = [0.0];
    let report = newton(&noisy(40.0 * eps), &mut x, &settings).unwrap();
    assert_eq!(report.convergence, Convergence::RoundOff);
    assert!(report.history.counts.line_search == 0, "no halving where nothing can be gained");
    let error = failure(&noisy(100.0 * eps), &mut [0.0], &settings);
    assert!(
        matches!(error.cause, NewtonFailure::LineSearchFailed { .. }) && error.history.iterations.len() == 1,
        "{error:?}"
    );
    assert_eq!(error.history.counts.magnitudes, 2);
}

#[test]
fn nothing_to_do() {
    let report = solved(&springs(1.0, 1.0, 0.0, 4), &mut [0.0; 4]);
    assert_eq!((report.convergence, report.history.iterations.len()), (Convergence::Tolerance, 0));
    // At rest up to round-off: 0.1 + 0.2 − 0.3 of magnitude 0.6.
    let report = solved(&scalar(|_| Ok(0.1 + 0.2 - 0.3), |_| 1.0), &mut [0.0]);
    assert_eq!(report.history.counts.linearizations, 0);
}
