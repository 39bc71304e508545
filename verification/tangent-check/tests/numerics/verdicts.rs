//! The verdicts over laws that are loose, noisy or wrong, and over inputs without sense.

use crate::cases::{self, Case, case};
use crate::laws::{Law, Voce};
use crate::tensor::{PAIRS, Random, combine, norm};
use crate::{check, states};
use tangent_check::difference::{Derivative, Estimate, Ladder};
use tangent_check::finding::{Finding, Reason, Verdict};
use tangent_check::judge::{
    Directions, Loading, Measured, Product, check_columns, check_columns_on, check_directions, judge, judge_exact,
    measure,
};
use tangent_check::law::CallFailed;
use tangent_check::matrix::Matrix;

/// The response to a perturbation h of column k.
type Columns<'a> = dyn FnMut(usize, f64) -> Result<Vec<f64>, CallFailed> + 'a;

/// The check of a J2 state whose local iteration stops at `tolerance`, with its loading, after one entry was multiplied by `factor`.
fn check_loose(number: usize, tolerance: f64, factor: f64) -> Finding {
    let (law, strain) = cases::voce(&mut Random(77 + 991 * number as u64), None, tolerance);
    let start = law.plastic_strain;
    let same = Voce { ..law };
    let mut case = cases::small_strain("J2", None, law, strain);
    case.claimed[(1, 1)] *= factor;
    let change = combine(1.0, &strain, -1.0, &start);
    let mut respond = |part: f64| {
        let stress = same.respond(&combine(1.0, &start, part, &change)).0;
        Ok(PAIRS.map(|(i, j)| stress[i][j]).to_vec())
    };
    let loading = Loading { size: norm(&change), respond: &mut respond };
    let mut f = |k: usize, h: f64| Ok((case.respond)(k, h));
    check_columns_on("J2", &case.claimed, &case.value, Ladder::default(), &mut f, Some(loading))
}

#[test]
fn a_loose_local_iteration_is_inexact() {
    for tolerance in [1e-6, 1e-8, 1e-10, 0.0] {
        let mut verdicts = [0; 4];
        let (mut worst, mut calls) = (0.0_f64, 0);
        for number in 0..states() {
            let finding = check_loose(number, tolerance, 1.0);
            verdicts[finding.verdict as usize] += 1;
            worst = worst.max(finding.deviation);
            calls = calls.max(finding.calls);
        }
        let [consistent, inexact, not_checked, wrong] = verdicts;
        println!(
            "tolerance {tolerance:5.0e}: consistent {consistent:3} inexact {inexact:3} not checked {not_checked} wrong {wrong}, deviation at most \
             {worst:.0e}, at most {calls} calls"
        );
        assert_eq!(not_checked + wrong, 0);
        assert_eq!(inexact > 0, tolerance > 0.0);
    }
}

#[test]
fn a_small_error_of_a_converged_law_is_wrong() {
    for number in 0..states() {
        for error in [1e-5, 1e-7, 1e-9] {
            let finding = check_loose(number, 0.0, 1.0 + error);
            assert!(
                finding.verdict == Verdict::Wrong || (error < 1e-8 && finding.reason == Some(Reason::Kink)),
                "{finding:?}"
            );
            if finding.verdict == Verdict::Wrong {
                assert_eq!(finding.worst.map(|worst| (worst.row, worst.column)), Some((1, 1)));
            }
        }
    }
}

#[test]
fn a_gross_error_of_a_loose_law_is_wrong() {
    for number in 0..states() {
        assert_eq!(check_loose(number, 1e-6, 1.001).verdict, Verdict::Wrong);
    }
}

#[test]
fn single_precision_is_noise_and_no_error() {
    for number in 0..states() {
        let mut case = cases::single(number);
        let finding = check(&case);
        let noisy = matches!(finding.reason, Some(Reason::TooNoisy(error)) if error > 1e-6);
        assert!(noisy && finding.noise > 1e-9, "{finding:?}");
        case.claimed[(0, 0)] *= 1.1;
        assert_eq!(check(&case).verdict, Verdict::Wrong);
    }
}

/// The number of entries above 1 % of ‖C‖ that, spoiled by ±`size` alone, are not seen.
fn unseen(case: &Case, measured: &Measured, size: f64) -> usize {
    let large = (0..case.claimed.entries.len())
        .filter(|m| case.claimed.entries[*m].abs() > 0.01 * case.claimed.greatest() * (1.0 + 1e-9));
    let spoiled = large.flat_map(|m| [(m, size), (m, -size)]);
    let missed = spoiled.filter(|(m, size)| {
        let mut claimed = case.claimed.clone();
        claimed.entries[*m] *= 1.0 + size;
        judge(case.law, &claimed, measured).verdict == Verdict::Consistent
    });
    missed.count()
}

#[test]
fn the_control_is_the_smallest_error_that_every_entry_shows() {
    for (law, number) in cases::LAWS.into_iter().flat_map(|law| (0..10).map(move |number| (law, number))) {
        let case = case(law, number);
        let mut f = |k: usize, h: f64| Ok((case.respond)(k, h));
        let measured = measure(&case.claimed, &case.value, Ladder::default(), &mut f).expect("the law answers");
        let control = judge(law, &case.claimed, &measured).control.expect("the tangent is consistent");
        assert_eq!(unseen(&case, &measured, control), 0, "{law}, state {number}: {control:e}");
        assert!(control <= 1e-12 || unseen(&case, &measured, 0.1 * control) > 0, "{law}, state {number}: {control:e}");
    }
}

#[test]
fn a_missed_control_is_not_checked() {
    // The second entry is 1.05 % of the first, and its deviation of half the allowed one hides the planted error.
    let estimate = Estimate { value: vec![1.0, 0.0105], error: vec![0.99e-6; 2] };
    let column = Derivative {
        central: estimate.clone(),
        forward: estimate.clone(),
        backward: estimate,
        contradicted: false,
        calls: 0,
    };
    let measured = Measured { value: vec![1.0; 2], noise: vec![0.0; 2], columns: vec![column], jump: None, calls: 0 };
    let claimed = Matrix { rows: 2, columns: 1, entries: vec![1.0, 0.0105 + 5e-6] };
    assert_eq!(judge("missed", &claimed, &measured).reason, Some(Reason::ControlMissed(1e-3)));
}

/// |x| with the claimed slope.
fn check_modulus(slope: f64) -> Finding {
    let claimed = Matrix { rows: 2, columns: 1, entries: vec![slope, 2.0] };
    check_columns("modulus", &claimed, &[0.0, 1.0], &mut |_, h| Ok(vec![h.abs(), 1.0 + 2.0 * h]))
}

#[test]
fn at_a_kink_both_sides_are_accepted_and_the_average_is_not() {
    assert_eq!(check_modulus(1.0).verdict, Verdict::Consistent);
    assert_eq!(check_modulus(-1.0).verdict, Verdict::Consistent);
    for slope in [0.0, 1.0 + 1e-9] {
        assert_eq!(check_modulus(slope).reason, Some(Reason::Kink));
    }
}

/// A law with a claimed tangent for the tests of inputs without sense.
fn example() -> Case {
    case("neo-Hookean, exp(h B) F", 4)
}

#[test]
fn refused_perturbations_are_skipped() {
    let case = example();
    let answer = |k: usize, h: f64, refused: bool| match refused {
        true => Err(CallFailed("refused".into())),
        false => Ok((case.respond)(k, h)),
    };
    let check = |f: &mut Columns<'_>| check_columns("refusing", &case.claimed, &case.value, f);
    assert_eq!(check(&mut |k, h| answer(k, h, h.abs() > 0.011)).verdict, Verdict::Consistent);
    assert_eq!(check(&mut |k, h| answer(k, h, h > 0.0)).verdict, Verdict::Consistent);
    assert_eq!(check(&mut |k, h| answer(k, h, h > 1e-3 && h < 8e-3)).verdict, Verdict::Consistent);
    let nan = |k: usize, h: f64| if h > 0.01 { Ok(vec![f64::NAN; 6]) } else { answer(k, h, false) };
    assert_eq!(check(&mut |k, h| nan(k, h)).verdict, Verdict::Consistent);
    let finding = check(&mut |k, h| answer(k, h, k == 2));
    assert_eq!(finding.reason, Some(Reason::CallFailed("Column 2: refused".into())));
}

#[test]
fn inputs_without_sense_are_not_checked() {
    let case = example();
    let reason = |claimed: &Matrix, value: &[f64], f: &mut Columns<'_>| {
        let finding = check_columns("no sense", claimed, value, f);
        assert_eq!(finding.verdict, Verdict::NotChecked);
        finding.reason
    };
    let mut law = |k: usize, h: f64| Ok((case.respond)(k, h));
    let failed = |reason| matches!(reason, Some(Reason::CallFailed(_)));
    let mut nan = case.claimed.clone();
    nan[(1, 2)] = f64::NAN;
    assert!(failed(reason(&nan, &case.value, &mut law)));
    assert!(failed(reason(&Matrix::zeros(6, 0), &case.value, &mut law)));
    assert!(failed(reason(&Matrix::zeros(0, 6), &[], &mut |_, _| Ok(vec![]))));
    assert!(failed(reason(&Matrix { rows: 6, columns: 6, entries: vec![1.0; 5] }, &case.value, &mut law)));
    assert!(failed(reason(&case.claimed, &case.value[..5], &mut law)));
    assert!(failed(reason(&case.claimed, &[f64::INFINITY; 6], &mut law)));
    assert!(failed(reason(&case.claimed, &case.value, &mut |_, _| Ok(vec![1.0; 5]))));
    assert!(failed(reason(&case.claimed, &case.value, &mut |_, _| Ok(vec![f64::NAN; 6]))));
    let zero = Matrix::zeros(6, 6);
    assert_eq!(reason(&zero, &[0.0; 6], &mut |_, _| Ok(vec![0.0; 6])), Some(Reason::ZeroResponse));
    assert_eq!(reason(&zero, &[3.0; 6], &mut |_, _| Ok(vec![3.0; 6])), Some(Reason::NothingExercised));
    for first in [0.0, -1.0, f64::NAN] {
        let ladder = Ladder { first, ..Ladder::default() };
        let finding = check_columns_on("no ladder", &case.claimed, &case.value, ladder, &mut law, None);
        assert!(failed(finding.reason));
    }
}

#[test]
fn a_tangent_of_nothing_and_a_missing_tangent_are_wrong() {
    let case = example();
    let constant = check_columns("constant", &case.claimed, &case.value, &mut |_, _| Ok(case.value.clone()));
    assert_eq!(constant.verdict, Verdict::Wrong);
    let missing = check_columns("missing", &Matrix::zeros(6, 6), &case.value, &mut |k, h| Ok((case.respond)(k, h)));
    assert_eq!((missing.verdict, missing.deviation), (Verdict::Wrong, 1.0));
}

#[test]
fn exact_derivatives_show_errors_of_1e_12() {
    let exact = example().claimed;
    let bound = 16.0 * f64::EPSILON;
    let finding = judge_exact("exact", &exact, &exact, bound);
    assert_eq!((finding.verdict, finding.control), (Verdict::Consistent, Some(1e-12)));
    let mut claimed = exact.clone();
    claimed[(0, 1)] *= 1.0 + 1e-12;
    let finding = judge_exact("exact", &claimed, &exact, bound);
    assert_eq!((finding.verdict, finding.worst.map(|worst| (worst.row, worst.column))), (Verdict::Wrong, Some((0, 1))));
    assert_eq!(judge_exact("exact", &claimed, &Matrix::zeros(2, 2), bound).verdict, Verdict::NotChecked);
    let rough = judge_exact("exact", &exact, &exact, 1e-4);
    assert!(matches!(rough.reason, Some(Reason::TooNoisy(_))));
}

/// A chain of springs r_i = (u_i − u_i−1)³ − (u_i+1 − u_i)³ + u_i with one entry of the tangent spoiled.
fn check_chain(spoiled: Option<(usize, usize, f64)>) -> Finding {
    const N: usize = 40;
    let u: Vec<f64> = (0..N).map(|i| (i as f64).sin()).collect();
    let at = |u: &[f64], i: usize| if (1..=N).contains(&i) { u[i - 1] } else { 0.0 };
    let residual = |u: &[f64]| -> Vec<f64> {
        (1..=N).map(|i| (at(u, i) - at(u, i - 1)).powi(3) - (at(u, i + 1) - at(u, i)).powi(3) + at(u, i)).collect()
    };
    let mut product = |w: &[f64]| {
        let stretch = |i: usize| 3.0 * (at(&u, i) - at(&u, i - 1)).powi(2) * (at(w, i) - at(w, i - 1));
        let mut jw: Vec<f64> = (1..=N).map(|i| stretch(i) - stretch(i + 1) + at(w, i)).collect();
        if let Some((row, column, error)) = spoiled {
            jw[row] += error * w[column];
        }
        Ok(jw)
    };
    let mut f = |w: &[f64], h: f64| Ok(residual(&u.iter().zip(w).map(|(u, w)| u + h * w).collect::<Vec<f64>>()));
    check_directions("chain", N, &residual(&u), &mut product, &mut f, Directions::default())
}

#[test]
fn directions_find_the_wrong_entry() {
    let finding = check_chain(None);
    assert_eq!(finding.verdict, Verdict::Consistent);
    assert!(finding.control.is_some_and(|control| control <= 1e-9), "{:?}", finding.control);
    for error in [1.0, 1e-4, 1e-8] {
        let finding = check_chain(Some((12, 31, error)));
        assert_eq!(finding.verdict, Verdict::Wrong);
        let worst = finding.worst.expect("a wrong tangent has a worst entry");
        assert_eq!((worst.row, worst.column), (12, 31));
        assert!((worst.claimed - worst.measured - error).abs() < 1e-3 * error);
    }
}

#[test]
fn products_without_sense_are_not_checked() {
    let mut f = |w: &[f64], h: f64| Ok(w.iter().map(|w| h * w).collect());
    let mut check =
        |product: &mut Product<'_>| check_directions("no sense", 3, &[0.0; 3], product, &mut f, Directions::default());
    assert_eq!(check(&mut |w| Ok(w.to_vec())).verdict, Verdict::Consistent);
    let mut nothing = |_: &[f64]| Ok(vec![]);
    let none = Directions { count: 0, ..Directions::default() };
    for finding in [
        check_directions("no unknowns", 0, &[], &mut nothing, &mut |_, _| Ok(vec![]), Directions::default()),
        check_directions("no directions", 3, &[0.0; 3], &mut nothing, &mut |_, _| Ok(vec![0.0; 3]), none),
        check(&mut |w| Ok(w[1..].to_vec())),
        check(&mut |_| Ok(vec![f64::NAN; 3])),
        check(&mut |_| Err(CallFailed("refused".into()))),
    ] {
        assert!(matches!(finding.reason, Some(Reason::CallFailed(_))));
    }
}
