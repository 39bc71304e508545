//! Right laws are never called wrong, however their tangents are written, and the check names what makes a tangent inexact.
//!
//! By default each law has one seed and a few ways to write its tangent. This command makes the whole table, with the calls a state. The crystal
//! takes an hour, each other law a few minutes:
//!
//! `SEEDS=200 cargo test --release -p tangent-check --test right -- --nocapture`; with `LAW=Norton` for one law.

mod laws;

use laws::planted::{Mistake, Planted};
use laws::right::{Fibres, Right, Softening, Written, laws};
use laws::shipped::Formula;
use tangent_check::convention::{Convention, Measure};
use tangent_check::finding::{Reason, Report, Verdict};
use tangent_check::roads::check_law;
use tangent_check::states::for_law;

const INEXACT: [Written; 10] = [
    Written::Forward(1e-4),
    Written::Single,
    Written::Loose(1e-6),
    Written::Forward(1e-5),
    Written::Forward(1e-6),
    Written::Loose(1e-8),
    Written::Forward(1e-7),
    Written::Loose(1e-10),
    Written::Forward(1e-8),
    Written::Loose(1e-12),
];

/// The number of seeds, if all laws and ways are asked for.
fn all() -> Option<u64> {
    std::env::var("SEEDS").ok().and_then(|seeds| seeds.parse().ok())
}

/// All laws, or those whose name has the words of the variable LAW.
fn chosen() -> Vec<Box<dyn Formula>> {
    let words = std::env::var("LAW").unwrap_or_default();
    laws().into_iter().filter(|law| law.name().contains(&words)).collect()
}

fn report(formula: &dyn Formula, written: Written, seed: u64) -> Report {
    let mut law = Right { formula, written };
    let paths = for_law(&mut law, seed).expect("the law answers");
    check_law(&mut law, &paths, seed)
}

/// Whether a reason is that of the way a tangent is written. Forward differences come with their h, if it is not round-off alone.
fn named(written: Written, reason: Option<&Reason>) -> bool {
    match (written, reason) {
        (_, Some(Reason::RoundOff)) => true,
        (Written::Forward(h), Some(Reason::ForwardDifference(found))) => h < 1e-7 || (found / h - 1.0).abs() < 0.3,
        (Written::Single, Some(Reason::SinglePrecision)) => true,
        (Written::Loose(_), Some(Reason::LocalIteration(_))) => true,
        _ => false,
    }
}

/// Checks a law over seeds: no state is wrong. Gives the numbers of inexact states, of those with the right cause, and of laws not checked.
fn count(formula: &dyn Formula, written: Written, seeds: u64) -> [usize; 3] {
    let mut counts = [0; 4];
    let (mut causes, mut unchecked, mut calls) = (0, 0, Vec::new());
    for seed in 1..=seeds {
        let report = report(formula, written, seed);
        unchecked += usize::from(report.verdict() == Verdict::NotChecked);
        for finding in &report.findings {
            counts[finding.verdict as usize] += 1;
            calls.push(finding.calls);
            causes += usize::from(finding.verdict == Verdict::Inexact && named(written, finding.reason.as_ref()));
            assert_ne!(finding.verdict, Verdict::Wrong, "{}, {written:?}, seed {seed}: {finding:?}", formula.name());
        }
    }
    calls.sort_unstable();
    let median = calls[calls.len() / 2];
    println!("{}, {written:?}: {counts:?}, {causes} causes, {unchecked} not checked, {median} calls", formula.name());
    [counts[Verdict::Inexact as usize], causes, unchecked]
}

#[test]
fn exact_tangents_are_consistent() {
    let seeds = all().unwrap_or(1);
    let mut missed = 0;
    for formula in chosen() {
        let [inexact, causes, unchecked] = count(formula.as_ref(), Written::Exactly, seeds);
        // Where nearly nothing is left of a stiffness, round-off remains. A drag of √rate has no derivative at its onset.
        assert!((inexact - causes) as u64 * 20 <= seeds, "{}", formula.name());
        missed += unchecked;
    }
    assert!(missed as u64 * 100 <= seeds * chosen().len() as u64, "{missed} reports cannot tell");
}

#[test]
fn inexact_tangents_are_told_with_their_cause() {
    let [mut inexact, mut causes] = [0; 2];
    for (index, formula) in chosen().iter().enumerate() {
        for (way, written) in INEXACT.into_iter().enumerate() {
            if all().is_some() || way % 4 == index % 4 {
                let counts = count(formula.as_ref(), written, all().unwrap_or(1));
                (inexact, causes) = (inexact + counts[0], causes + counts[1]);
            }
        }
    }
    println!("{causes} of {inexact} causes are named");
    assert!(causes as f64 >= 0.95 * inexact as f64);
}

/// At these seeds, quotients reach from slack fibres just beyond the onset of tension, so that they ask for many digits of h.
#[test]
fn forward_differences_beyond_a_kink_are_told() {
    for seed in [12, 66] {
        let report = report(&Fibres, Written::Forward(1e-4), seed);
        assert_eq!(report.verdict(), Verdict::Inexact);
        let mut inexact = report.findings.iter().filter(|finding| finding.verdict == Verdict::Inexact);
        let near = |reason: &Reason| matches!(reason, Reason::ForwardDifference(h) if (h / 1e-4 - 1.0).abs() < 0.05);
        assert!(inexact.all(|finding| finding.reason.as_ref().is_some_and(near)));
    }
}

/// Damage that begins at stretches from 1.01 to 5: the paths reach it, and the report tells how far.
#[test]
fn onsets_are_found_or_told() {
    for stretch in [1.01_f64, 1.1, 1.5, 2.0, 2.6, 4.0, 5.0] {
        for seed in 1..=all().unwrap_or(1) {
            // κ = √(E : E) of an incompressible stretch.
            let green = |stretch: f64| 0.5 * (stretch * stretch - 1.0);
            let onset = (green(stretch).powi(2) + 2.0 * green(1.0 / stretch.sqrt()).powi(2)).sqrt();
            let formula = Softening { name: "late", onset, ductility: onset };
            let report = report(&formula, Written::Exactly, seed);
            let moved = report.notes.iter().any(|note| note.contains("STATEV(2) from 0.000e0 to"));
            assert!(moved && report.verdict() <= Verdict::Inexact, "{stretch}: {:?}", report.notes);
            // A tangent that does not know of the damage is found wrong.
            if all().is_none() && ![1.01, 5.0].contains(&stretch) {
                continue;
            }
            let convention = Convention::abaqus(Measure::JaumannKirchhoff);
            let mut frozen = Planted::new(&formula, Mistake::Elastic, &convention);
            let paths = for_law(&mut frozen, seed).unwrap();
            let frozen = frozen.report(&paths, seed);
            assert_eq!(frozen.verdict(), Verdict::Wrong, "{stretch}, seed {seed}");
        }
    }
    let never = report(&Softening { name: "never", onset: 1e9, ductility: 1.0 }, Written::Exactly, 1);
    assert!(never.notes.iter().any(|note| note.contains("STATEV(1), STATEV(2) never changed")), "{:?}", never.notes);
}
