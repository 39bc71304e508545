//! The verdicts over laws that are loose, noisy or wrong, and over inputs without sense.

mod laws;

use laws::right::{Right, VOCE, Written};
use laws::shipped::{Formula, NeoHookean};
use tangent_check::convention::Convention;
use tangent_check::difference::{Derivative, Estimate, Ladder};
use tangent_check::finding::{Finding, Reason, Verdict};
use tangent_check::judge::{
    Directions, Loading, Measured, Product, check_columns, check_columns_on, check_directions, judge, measure,
};
use tangent_check::law::{CallFailed, Law, Response, Step};
use tangent_check::matrix::Matrix;
use tangent_check::roads::{History, Perturbed, Road};
use tangent_check::states::Random;
use tangent_check::tensor::{IDENTITY, exponential, norm, scaled, sum};

/// The states of each test.
const STATES: u64 = 30;

/// The response to a perturbation h of column k.
type Columns<'a> = dyn FnMut(usize, f64) -> Result<Vec<f64>, CallFailed> + 'a;

/// A state of a law: the response, the consistent tangent, and the response with column k perturbed by h.
struct Case {
    value: Vec<f64>,
    claimed: Matrix,
    respond: Box<dyn Fn(usize, f64) -> Vec<f64>>,
}

/// The law in a step, perturbed on the road of its inputs.
fn case(formula: &'static dyn Formula, written: Written, step: Step) -> Case {
    let road = if formula.incremental() { Road::Strain } else { Road::Gradient };
    let claimed = Right { formula, written }.respond(&step).expect("a response").tangent;
    let respond = move |k: usize, h: f64| {
        Perturbed::new(&mut Right { formula, written }, &step, road).value(k, h).expect("a value")
    };
    Case { value: respond(0, 0.0), claimed, respond: Box::new(respond) }
}

/// A step of a J2 law, inside or outside of its elastic domain.
fn yielding(number: u64) -> Step {
    let mut random = Random::new(77 + 991 * number);
    let overload = random.between(0.5_f64.ln(), 30.0_f64.ln()).exp();
    let strain = scaled(overload * 250.0 / 160e3, &random.isochoric(false));
    let strain_increment = sum(&strain, random.between(-0.01, 0.01), &IDENTITY);
    let mut state = VOCE.state_at_rest();
    state[0] = random.between(0.0, 0.1);
    Step { strain_increment, state, stress: vec![0.0; 6], length: 1.0, ..Step::at_rest() }
}

/// A general step of a neo-Hookean solid.
fn stretched(number: u64) -> Step {
    let mut random = Random::new(5 + 31 * number);
    let gradient = exponential(&sum(&scaled(0.3, &random.isochoric(false)), 0.05, &IDENTITY));
    let law = Right { formula: &NeoHookean, written: Written::Exactly };
    History::at_rest(&law).step_to(&gradient, 1.0).expect("det F > 0")
}

/// The check of a J2 state whose local iteration stops at `tolerance`, with its loading, after one entry was multiplied by `factor`.
fn check_loose(number: u64, tolerance: f64, factor: f64) -> Finding {
    let (written, step) = (Written::Loose(tolerance), yielding(number));
    let mut case = case(&VOCE, written, step.clone());
    case.claimed[(1, 1)] *= factor;
    let mut law = Right { formula: &VOCE, written };
    let mut perturbed = Perturbed::new(&mut law, &step, Road::Strain);
    let size = norm(&step.strain_increment);
    let loading = Loading { size, respond: &mut |part| perturbed.part(part), stiffness: 0.0 };
    let mut f = |k: usize, h: f64| Ok((case.respond)(k, h));
    check_columns_on("J2", &case.claimed, &case.value, Ladder::default(), &mut f, Some(loading))
}

/// A neo-Hookean solid that computes in single precision, with its tangent in double precision.
struct Single(Right<'static>);

impl Law for Single {
    fn name(&self) -> String {
        "single precision".to_string()
    }
    fn convention(&self) -> Convention {
        self.0.convention()
    }
    fn state_at_rest(&self) -> Vec<f64> {
        Vec::new()
    }
    fn respond(&mut self, step: &Step) -> Result<Response, CallFailed> {
        let response = self.0.respond(step)?;
        let f = step.gradient.map(|row| row.map(|entry| entry as f32));
        let minor = |i: usize, j: usize| f[1][i] * f[2][j] - f[1][j] * f[2][i];
        let det = f[0][0] * minor(1, 2) - f[0][1] * minor(0, 2) + f[0][2] * minor(0, 1);
        let stress = |&(i, j): &(usize, usize)| {
            let b: f32 = (0..3).map(|k| f[i][k] * f[j][k]).sum();
            f64::from(if i == j { 1.3 / det * (b - 1.0) + 2.1 * det.ln() / det } else { 1.3 / det * b })
        };
        Ok(Response { stress: self.convention().stress.pairs.iter().map(stress).collect(), ..response })
    }
}

fn single(number: u64) -> Case {
    let step = stretched(number);
    let claimed = case(&NeoHookean, Written::Exactly, step.clone()).claimed;
    let respond = move |k: usize, h: f64| {
        let mut law = Single(Right { formula: &NeoHookean, written: Written::Exactly });
        Perturbed::new(&mut law, &step, Road::Gradient).value(k, h).expect("a value")
    };
    Case { value: respond(0, 0.0), claimed, respond: Box::new(respond) }
}

fn check(case: &Case) -> Finding {
    check_columns("a state", &case.claimed, &case.value, &mut |k, h| Ok((case.respond)(k, h)))
}

#[test]
fn a_loose_local_iteration_is_inexact() {
    for tolerance in [1e-6, 1e-8, 1e-10, 0.0] {
        let mut verdicts = [0; 4];
        let (mut worst, mut calls) = (0.0_f64, 0);
        for number in 0..STATES {
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
fn an_error_of_a_converged_law_is_wrong_or_inexact_by_its_size() {
    for number in 0..STATES {
        for (error, verdict) in [(1e-5, Verdict::Wrong), (1e-7, Verdict::Inexact), (1e-9, Verdict::Inexact)] {
            let finding = check_loose(number, 0.0, 1.0 + error);
            assert_eq!(finding.verdict, verdict, "{finding:?}");
            assert_eq!(finding.worst.map(|worst| (worst.row, worst.column)), Some((1, 1)));
        }
    }
}

#[test]
fn a_gross_error_of_a_loose_law_is_wrong() {
    for number in 0..STATES {
        assert_eq!(check_loose(number, 1e-6, 1.001).verdict, Verdict::Wrong);
    }
}

#[test]
fn single_precision_is_noise_and_no_error() {
    for number in 0..STATES {
        let mut case = single(number);
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
        judge("a state", &claimed, measured).verdict == Verdict::Consistent
    });
    missed.count()
}

#[test]
fn the_control_is_the_smallest_error_that_every_entry_shows() {
    let plastic = (0..20).map(|number| case(&VOCE, Written::Exactly, yielding(number)));
    for case in plastic.chain((0..10).map(|number| case(&NeoHookean, Written::Exactly, stretched(number)))) {
        let mut f = |k: usize, h: f64| Ok((case.respond)(k, h));
        let measured = measure(&case.claimed, &case.value, Ladder::default(), &mut f).expect("the law answers");
        let control = judge("a state", &case.claimed, &measured).control.expect("the tangent is consistent");
        assert_eq!(unseen(&case, &measured, control), 0, "{control:e}");
        assert!(control <= 1e-12 || unseen(&case, &measured, 0.1 * control) > 0, "{control:e}");
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
    let measured = Measured {
        value: vec![1.0; 2],
        noise: vec![0.0; 2],
        columns: vec![column],
        stiffness: 0.0,
        jump: None,
        calls: 0,
    };
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
    assert_eq!(check_modulus(0.0).reason, Some(Reason::Kink));
    assert_eq!(check_modulus(1.0 + 1e-9).verdict, Verdict::Inexact);
}

/// A law with a claimed tangent for the tests of inputs without sense.
fn example() -> Case {
    case(&NeoHookean, Written::Exactly, stretched(4))
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
    let tension_only = check_columns("zero", &zero, &[0.0; 6], &mut |_, _| Ok(vec![0.0; 6]));
    assert_eq!((tension_only.verdict, tension_only.reason), (Verdict::Consistent, Some(Reason::ZeroResponse)));
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
    for error in [1.0, 1e-2, 1e-4] {
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
