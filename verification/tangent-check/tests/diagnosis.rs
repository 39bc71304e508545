//! Planted mistakes and their names.

mod laws;

use laws::central::{Known, check};
use laws::planted::{Mistake, Planted};
use laws::shipped::*;
use tangent_check::convention::{Convention, Measure};
use tangent_check::finding::{Report, Verdict};
use tangent_check::roads::check_law;
use tangent_check::states::{Path, for_law};

const SEED: u64 = 7;

/// A mistake, and words that a right diagnosis contains.
type Row = (Mistake, &'static str);

fn order(order: [usize; 6], rows: bool, columns: bool) -> Mistake {
    Mistake::Order { order, rows, columns }
}

/// Mistakes of the list, for tangents of Abaqus' six components.
fn listed() -> Vec<Row> {
    let dyad = |coefficient, stress_left, stress_right| Mistake::Dyad { coefficient, stress_left, stress_right };
    vec![
        (Mistake::Transposed, "transposed"),
        (Mistake::Symmetrised, "symmetrised"),
        (order([0, 1, 2, 4, 3, 5], true, true), "shear components 12 and 13 exchanged."),
        (order([0, 1, 2, 5, 4, 3], true, true), "shear components 12 and 23 exchanged."),
        (order([0, 1, 2, 3, 5, 4], true, true), "shear components 13 and 23 exchanged."),
        (order([0, 1, 2, 4, 5, 3], true, true), "shear components in the order 13, 23, 12."),
        (order([0, 1, 2, 5, 3, 4], true, true), "shear components in the order 23, 12, 13."),
        (order([0, 1, 2, 3, 5, 4], true, false), "13 and 23 exchanged, in the rows only"),
        (order([0, 1, 2, 5, 4, 3], false, true), "12 and 23 exchanged, in the columns only"),
        (order([0, 3, 4, 1, 5, 2], true, true), "ordered 11, 12, 13, 22, 23, 33."),
        (order([1, 0, 2, 3, 4, 5], true, false), "normal components 11 and 22 exchanged, in the rows only"),
        (Mistake::Factors { rows: 1.0, columns: 2.0 }, "the shear columns multiplied by 2"),
        (Mistake::Factors { rows: 1.0, columns: 0.5 }, "the shear columns multiplied by ½"),
        (Mistake::Factors { rows: 2.0, columns: 1.0 }, "the shear rows multiplied by 2"),
        (Mistake::Factors { rows: 0.5, columns: 1.0 }, "the shear rows multiplied by ½"),
        (Mistake::Factors { rows: 2_f64.sqrt(), columns: 2_f64.sqrt() }, "rows and columns multiplied by √2"),
        (Mistake::Block(2.0), "shear by shear multiplied by 2"),
        (Mistake::Rate(Measure::Truesdell), "Truesdell rate"),
        (Mistake::Rate(Measure::JaumannCauchy), "Jaumann rate of the Cauchy stress"),
        (Mistake::Rate(Measure::GreenNaghdi), "Green–Naghdi"),
        (Mistake::JacobianPower(1), "additional factor J"),
        (Mistake::JacobianPower(-1), "factor 1/J"),
        (Mistake::StepBefore, "step before"),
        (Mistake::Elastic, "elastic one in place of the algorithmic"),
        (Mistake::Sign, "opposite sign"),
        (Mistake::Times(1.1), "times 1.100000"),
        (dyad(-0.4, false, false), "less the term 0.400000 times I ⊗ I"),
        (dyad(1.0, true, false), "and the term 1.000000 times σ ⊗ I"),
        (dyad(-1.0, false, true), "less the term 1.000000 times I ⊗ σ"),
    ]
}

const OUTSIDE: [Mistake; 5] =
    [Mistake::OneEntry, Mistake::RowLost, Mistake::DiagonalOnly, Mistake::StateFactor, Mistake::FingerTerm];

fn formulas() -> [Box<dyn Formula>; 7] {
    [
        Box::new(NeoHookean),
        Box::new(SaintVenantKirchhoff { fibre: 0.0 }),
        Box::new(Ogden),
        Box::new(J2Finite),
        Box::new(J2Incremental),
        Box::new(DruckerPrager),
        Box::new(Maxwell),
    ]
}

fn planted<'a>(formula: &'a dyn Formula, mistake: Mistake, convention: &Convention) -> Planted<'a> {
    Planted { formula, convention: convention.clone(), mistake, asked: Vec::new() }
}

fn paths(formula: &dyn Formula, convention: &Convention) -> Vec<Path> {
    for_law(&mut planted(formula, Mistake::None, convention), SEED).unwrap()
}

fn run(law: &mut Planted, paths: &[Path], known: &mut Known) -> Report {
    law.asked = paths.iter().flat_map(|path| path.gradients.clone()).collect();
    check_law(law, paths, SEED, &mut |name, claimed, value, f| check(known, name, claimed, value, f))
}

#[derive(Debug, PartialEq)]
enum Outcome {
    Named,
    Class(usize),
    Unnamed,
    Invisible,
    Misnamed(String),
}

fn outcome(report: &Report, words: &str) -> Outcome {
    let wrong = report.findings.iter().any(|finding| finding.verdict == Verdict::Wrong);
    match report.diagnoses.first() {
        None if !wrong => Outcome::Invisible,
        None => Outcome::Unnamed,
        Some(diagnosis) if diagnosis.candidates.iter().any(|sentence| sentence.contains(words)) => {
            if diagnosis.candidates.len() == 1 { Outcome::Named } else { Outcome::Class(diagnosis.candidates.len()) }
        }
        Some(diagnosis) => Outcome::Misnamed(diagnosis.sentence.clone()),
    }
}

/// Plants all mistakes in one law and prints a line for each.
fn table(formula: &dyn Formula, convention: &Convention, rows: &[Row]) -> [usize; 4] {
    let paths = paths(formula, convention);
    let mut known = Known::new();
    let right = run(&mut planted(formula, Mistake::None, convention), &paths, &mut known);
    let checked = right.findings.iter().filter(|finding| finding.verdict == Verdict::Consistent).count();
    let wrong: Vec<_> = right.findings.iter().filter(|f| f.verdict == Verdict::Wrong).map(|f| &f.name).collect();
    assert!(wrong.is_empty(), "{}: the right tangent is called wrong: {wrong:?}", formula.name());
    println!("{}: {} of {} states consistent", formula.name(), checked, right.findings.len());
    for note in &right.notes {
        println!("    note: {note}");
    }
    let mut counts = [0; 4];
    for (mistake, words) in rows {
        let report = run(&mut planted(formula, *mistake, convention), &paths, &mut known);
        let outcome = outcome(&report, words);
        println!("    {words:60} {outcome:?}");
        let place = match outcome {
            Outcome::Named | Outcome::Class(_) => 0,
            Outcome::Unnamed => 1,
            Outcome::Invisible => 2,
            Outcome::Misnamed(_) => 3,
        };
        counts[place] += 1;
    }
    counts
}

#[test]
fn planted_mistakes_are_named() {
    let mut total = [0; 4];
    for formula in formulas() {
        let counts = table(formula.as_ref(), &Convention::abaqus(Measure::JaumannKirchhoff), &listed());
        total = std::array::from_fn(|k| total[k] + counts[k]);
    }
    let [named, unnamed, invisible, misnamed] = total;
    println!("named {named}, unnamed {unnamed}, invisible {invisible}, misnamed {misnamed}");
    assert_eq!(misnamed, 0);
    assert!(named as f64 >= 0.8 * (named + unnamed) as f64);
}

#[test]
fn mistakes_in_other_measures_are_named() {
    use Mistake::{Block, Factors, Indices, JacobianPower, NoGeometric, Rate, Transposed};
    let piola: &[Row] = &[
        (Indices { rows: true, columns: false }, "ij and ji exchanged, in the rows only"),
        (Indices { rows: false, columns: true }, "ij and ji exchanged, in the columns only"),
        (Indices { rows: true, columns: true }, "ij and ji exchanged."),
        (NoGeometric, "geometric part with the stress missing"),
        (JacobianPower(1), "additional factor J"),
        (JacobianPower(-1), "factor 1/J"),
    ];
    let strain: &[Row] = &[
        (Rate(Measure::Truesdell), "Truesdell rate"),
        (Factors { rows: 1.0, columns: 0.5 }, "the shear columns multiplied by ½"),
        (Transposed, "transposed"),
        (Mistake::Elastic, "elastic one in place"),
    ];
    let material: &[Row] = &[
        (JacobianPower(-1), "factor 1/J"),
        (Rate(Measure::Truesdell), "the spatial one, the Truesdell rate"),
        (Block(0.5), "shear by shear multiplied by ½"),
    ];
    let gradient: &[Row] = &[
        (Indices { rows: false, columns: true }, "ij and ji exchanged, in the columns only"),
        (Rate(Measure::KirchhoffByGradient), "∂τ/∂F"),
    ];
    let plane: &[Row] = &[
        (Factors { rows: 1.0, columns: 2.0 }, "the shear columns multiplied by 2"),
        (Rate(Measure::Truesdell), "Truesdell rate"),
        (JacobianPower(1), "additional factor J"),
        (Mistake::StepBefore, "step before"),
    ];
    let mut misnamed = 0;
    let mut count = |formula: &dyn Formula, convention: Convention, rows: &[Row]| {
        let [named, _, _, wrongly] = table(formula, &convention, rows);
        assert_eq!(named, rows.len(), "{}", convention.words());
        misnamed += wrongly;
    };
    count(&NeoHookean, Convention::piola_in_rows(), piola);
    count(&Ogden, Convention::mfront(Measure::PiolaByGradient), piola);
    count(&SaintVenantKirchhoff { fibre: 0.0 }, Convention::abaqus(Measure::SecondPiolaByGreen), material);
    count(&Ogden, Convention::mfront(Measure::CauchyByGradient), gradient);
    count(&J2Incremental, Convention::abaqus(Measure::CauchyByStrain), &strain[..2]);
    count(&J2Incremental, Convention::abaqus(Measure::CauchyByStrain), &strain[3..]);
    count(&DruckerPrager, Convention::abaqus(Measure::JaumannCauchy), &strain[2..3]);
    count(&NeoHookean, Convention::abaqus_plane(Measure::JaumannKirchhoff), plane);
    assert_eq!(misnamed, 0);
}

#[test]
fn mistakes_outside_the_list_stay_unnamed() {
    for formula in formulas() {
        let formula = formula.as_ref();
        let convention = Convention::abaqus(Measure::JaumannKirchhoff);
        let paths = paths(formula, &convention);
        let mut known = Known::new();
        for mistake in OUTSIDE {
            let report = run(&mut planted(formula, mistake, &convention), &paths, &mut known);
            assert_eq!(report.verdict(), Verdict::Wrong, "{} {mistake:?}", formula.name());
            assert!(report.diagnoses.is_empty(), "{} {mistake:?}: {:?}", formula.name(), report.diagnoses);
        }
    }
}
