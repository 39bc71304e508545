//! Planted mistakes and their names.
//!
//! By default each mistake is planted in one law, and each law has several. This command plants each mistake in each law, and prints
//! the table; it takes a minute:
//!
//! `ALL_LAWS=1 cargo test --release -p tangent-check --test diagnosis -- --nocapture`

mod laws;

use laws::planted::{Mistake, Place, Planted};
use laws::right::VOCE;
use laws::shipped::*;
use tangent_check::convention::{Components, Configuration, Convention, Measure, Tensor};
use tangent_check::diagnosis::{Measured, Observation, diagnose};
use tangent_check::finding::{Report, Verdict};
use tangent_check::law::{CallFailed, Law, Response, Step};
use tangent_check::matrix::Matrix;
use tangent_check::report::Options;
use tangent_check::roads::{History, check_law};
use tangent_check::states::{Path, for_law, paths, yielding_paths};
use tangent_check::tensor;

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
        (Mistake::Continuum, "continuum tangent in place of the algorithmic"),
        (Mistake::AtRest, "elastic one at rest"),
        (Mistake::Rate(Measure::SecondPiolaByGreen), "the material one, ∂S/∂E"),
        (Mistake::Sign, "opposite sign"),
        (Mistake::Times(1.1), "times 1.100000"),
        (dyad(-0.4, false, false), "less the term 0.400000 times I ⊗ I"),
        (dyad(1.0, true, false), "and the term 1.000000 times σ ⊗ I"),
        (dyad(-1.0, false, true), "less the term 1.000000 times I ⊗ σ"),
        (Mistake::Scaled(Place::Entry, 1.03), "the entry 11 by 22 alone is multiplied by 1.030000"),
        (Mistake::Scaled(Place::Entry, -1.0), "the entry 11 by 22 alone is of the opposite sign"),
        (Mistake::Scaled(Place::Row, 0.0), "the row of 33 alone is zero"),
        (Mistake::Scaled(Place::Column, 0.5), "the column of 12 alone is multiplied by 0.500000"),
        (Mistake::Scaled(Place::NormalShear, 0.0), "the entries of normal by shear are zero"),
        (Mistake::Scaled(Place::ShearNormal, -1.0), "the entries of shear by normal are of the opposite sign"),
        (Mistake::Copied, "below the diagonal copied from those above"),
        (Mistake::BlockTransposed { shear: false }, "normal by normal transposed"),
        (Mistake::WholeNumbers, "cut to whole numbers"),
        (Mistake::Turned { increment: false, back: true }, "turned back by the rotation of F"),
        (Mistake::Turned { increment: false, back: false }, "turned by the rotation of F once more"),
        (Mistake::Turned { increment: true, back: true }, "turned back by the rotation increment (DROT)"),
        (Mistake::Turned { increment: true, back: false }, "turned by the rotation increment (DROT) once more"),
        (
            Mistake::RateTerm(Measure::GreenNaghdi, Measure::Truesdell),
            "the term too much that leads from the Green–Naghdi",
        ),
        (Mistake::StartOfStep, "that at the start of the step"),
    ]
}

const OUTSIDE: [Mistake; 3] = [Mistake::DiagonalOnly, Mistake::StateFactor, Mistake::FingerTerm];

fn formulas() -> [Box<dyn Formula>; 7] {
    [
        Box::new(NeoHookean),
        Box::new(SaintVenantKirchhoff { fibre: 0.0 }),
        Box::new(Ogden),
        Box::new(J2Finite),
        Box::new(VOCE),
        Box::new(DruckerPrager),
        Box::new(Maxwell),
    ]
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

/// Plants mistakes in one law and prints a line for each: how many are named, unnamed, invisible, and misnamed.
fn table(formula: &dyn Formula, convention: &Convention, rows: &[Row]) -> [usize; 4] {
    let mut right = Planted::new(formula, Mistake::None, convention);
    let paths = for_law(&mut right, SEED).unwrap();
    let right = right.report(&paths, SEED);
    let checked = right.findings.iter().filter(|finding| finding.verdict == Verdict::Consistent).count();
    let wrong: Vec<_> = right.findings.iter().filter(|f| f.verdict == Verdict::Wrong).map(|f| &f.name).collect();
    assert!(wrong.is_empty(), "{}: the right tangent is called wrong: {wrong:?}", formula.name());
    println!("{}: {} of {} states consistent", formula.name(), checked, right.findings.len());
    for note in &right.notes {
        println!("    note: {note}");
    }
    let mut counts = [0; 4];
    for (mistake, words) in rows {
        // In no time, a law that flows with its rate is elastic: it has no continuum tangent.
        if *mistake == Mistake::Continuum && formula.name().contains("crystal") {
            continue;
        }
        let report = Planted::new(formula, *mistake, convention).report(&paths, SEED);
        if OUTSIDE.contains(mistake) {
            assert_eq!(report.verdict(), Verdict::Wrong, "{} {mistake:?}", formula.name());
            assert!(report.diagnoses.is_empty(), "{} {mistake:?}: {:?}", formula.name(), report.diagnoses);
            continue;
        }
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

/// The mistakes of the list and those outside of it, with the law that shows each in the short table.
fn mistakes() -> Vec<(Row, usize)> {
    let outside = OUTSIDE.map(|mistake| (mistake, ""));
    let shown_by = |(index, row): (usize, Row)| match row.0 {
        // Flow without association: the only tangent that is not symmetric.
        Mistake::Transposed | Mistake::Symmetrised | Mistake::Copied | Mistake::BlockTransposed { .. } => (row, 5),
        Mistake::Elastic | Mistake::Continuum | Mistake::StartOfStep => (row, 3),
        _ => (row, index % 7),
    };
    listed().into_iter().chain(outside).enumerate().map(shown_by).collect()
}

/// Whether each mistake is planted in each law.
fn all() -> bool {
    std::env::var_os("ALL_LAWS").is_some()
}

/// Plants the chosen mistakes in each law.
fn tables(chosen: impl Fn(usize, usize) -> bool) -> [usize; 4] {
    let mut total = [0; 4];
    let others = laws::right::laws().into_iter().filter(|formula| {
        all() && !["J2, finite strain", "J2, Voce", "Drucker–Prager", "Maxwell"].contains(&formula.name())
    });
    for (law, formula) in formulas().into_iter().chain(others).enumerate() {
        let rows: Vec<Row> = mistakes().into_iter().filter(|(_, by)| chosen(law, *by)).map(|(row, _)| row).collect();
        let counts = table(formula.as_ref(), &Convention::abaqus(Measure::JaumannKirchhoff), &rows);
        total = std::array::from_fn(|k| total[k] + counts[k]);
    }
    let [named, unnamed, invisible, misnamed] = total;
    println!("named {named}, unnamed {unnamed}, invisible {invisible}, misnamed {misnamed}");
    total
}

/// Each mistake in the law that shows it; with `ALL_LAWS=1` in the environment each mistake in each law, in a minute.
#[test]
fn planted_mistakes_are_named() {
    let all = all();
    let [named, unnamed, _, misnamed] = tables(|law, by| all || law == by);
    assert_eq!(misnamed, 0);
    if all {
        assert!(named as f64 >= 0.8 * (named + unnamed) as f64);
    } else {
        assert_eq!(named, listed().len());
    }
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
    count(&VOCE, Convention::abaqus(Measure::CauchyByStrain), &strain[..2]);
    count(&VOCE, Convention::abaqus(Measure::CauchyByStrain), &strain[3..]);
    count(&DruckerPrager, Convention::abaqus(Measure::JaumannCauchy), &strain[2..3]);
    count(&NeoHookean, Convention::abaqus_plane(Measure::JaumannKirchhoff), plane);
    assert_eq!(misnamed, 0);
}

/// A law given by a function of the step: stress and tangent.
struct Given<F: FnMut(&Step) -> (Vec<f64>, Matrix)>(F, Measure);

impl<F: FnMut(&Step) -> (Vec<f64>, Matrix)> Law for Given<F> {
    fn name(&self) -> String {
        "given".to_string()
    }
    fn convention(&self) -> Convention {
        Convention::abaqus(self.1)
    }
    fn state_at_rest(&self) -> Vec<f64> {
        Vec::new()
    }
    fn respond(&mut self, step: &Step) -> Result<Response, CallFailed> {
        let (stress, tangent) = (self.0)(step);
        Ok(Response { stress, tangent, state: Vec::new() })
    }
}

fn isotropic(lambda: f64, shear: f64) -> Matrix {
    let mut tangent = Matrix::zeros(6, 6);
    for i in 0..3 {
        (0..3).for_each(|j| tangent[(i, j)] = lambda);
        tangent[(i, i)] += 2.0 * shear;
        tangent[(3 + i, 3 + i)] = shear;
    }
    tangent
}

fn stress(tangent: &Matrix, strain: &Tensor) -> Vec<f64> {
    tangent.times(&Components::abaqus(2.0).vector(strain))
}

#[test]
fn a_law_of_strain_and_gradient_is_checked_on_both_roads() {
    // The stress grows with J as well, and the tangent knows Δε only: right on one road.
    let elastic = isotropic(1.5, 1.0);
    let respond = |step: &Step| {
        let tangent = isotropic(1.5, 1.0);
        let mut given = stress(&elastic, &step.strain_increment);
        given[0] += 0.1 * tensor::determinant(&step.gradient);
        (given, tangent)
    };
    let mut law = Given(respond, Measure::CauchyByStrain);
    let report = check_law(&mut law, &paths(SEED, false)[2..4], SEED);
    assert_eq!(report.verdict(), Verdict::Consistent, "{:?}", report.notes);
    assert!(report.notes[0].contains("DSTRAN") && report.notes[0].contains("DFGRD1"), "{}", report.notes[0]);
    let roads = "8 of 8 states are wrong through F, 0 of 8 states are wrong through the strain increment";
    assert!(report.notes[1].contains("not objective"), "{}", report.notes[1]);
    assert!(report.notes[2].contains(roads), "{}", report.notes[2]);
}

#[test]
fn the_small_strain_tangent_lacks_a_term_at_finite_strain() {
    let respond = |step: &Step| (stress(&isotropic(1.5, 1.0), &step.strain_increment), isotropic(1.5, 1.0));
    let right = check_law(&mut Given(respond, Measure::CauchyByStrain), &paths(SEED, false), SEED);
    assert_eq!(right.verdict(), Verdict::Consistent);
    let wrong = check_law(&mut Given(respond, Measure::JaumannKirchhoff), &paths(SEED, false), SEED);
    assert_eq!(wrong.verdict(), Verdict::Wrong);
    let sentences = &wrong.diagnoses[0].candidates;
    assert!(sentences.iter().any(|sentence| sentence.contains("the term σ ⊗ I is missing")), "{sentences:?}");
}

#[test]
fn a_law_that_gives_nonsense_is_not_checked() {
    let good = isotropic(1.0, 1.0);
    let answers: [(Vec<f64>, Matrix); 5] = [
        (vec![f64::NAN; 6], good.clone()),
        (vec![0.0; 4], good.clone()),
        (vec![0.0; 6], Matrix::zeros(4, 4)),
        (vec![0.0; 6], Matrix { rows: 6, columns: 6, entries: Vec::new() }),
        (vec![], Matrix { entries: vec![f64::INFINITY; 36], ..good }),
    ];
    for answer in answers {
        let report =
            check_law(&mut Given(|_: &Step| answer.clone(), Measure::JaumannKirchhoff), &paths(SEED, false), SEED);
        assert_eq!(report.exit_code(&Options::default()), 2, "{answer:?}");
        assert_eq!(report.findings.len(), 12);
    }
    let bad = [
        Path::new("collapsed", vec![tensor::ZERO], 1.0),
        Path::new("not a number", vec![[[f64::NAN; 3]; 3]], 1.0),
        Path { lengths: Vec::new(), ..Path::new("without times", vec![tensor::IDENTITY], 1.0) },
    ];
    let respond = |step: &Step| (stress(&isotropic(1.5, 1.0), &step.strain_increment), isotropic(1.5, 1.0));
    assert_eq!(check_law(&mut Given(respond, Measure::JaumannKirchhoff), &bad, SEED).exit_code(&Options::default()), 2);
    assert_eq!(check_law(&mut Given(respond, Measure::JaumannKirchhoff), &[], SEED).exit_code(&Options::default()), 2);
}

#[test]
fn states_are_deterministic_and_reach_far() {
    assert_eq!(paths(SEED, false), paths(SEED, false));
    assert_ne!(paths(SEED, false), paths(SEED + 1, false));
    for plane in [false, true] {
        let all: Vec<Tensor> = (0..20).flat_map(|seed| paths(seed, plane)).flat_map(|path| path.gradients).collect();
        let volumes: Vec<f64> = all.iter().map(tensor::determinant).collect();
        let [least, greatest] =
            [volumes.iter().copied().fold(9.0, f64::min), volumes.iter().copied().fold(0.0, f64::max)];
        assert!((0.499..0.51).contains(&least) && (1.8..2.001).contains(&greatest), "J from {least} to {greatest}");
        let out = |f: &Tensor| [f[0][2], f[1][2], f[2][0], f[2][1], f[2][2] - 1.0].iter().all(|x| *x == 0.0);
        assert_eq!(all.iter().all(out), plane);
    }
}

#[test]
fn yielding_is_found() {
    let convention = Convention::abaqus(Measure::JaumannKirchhoff);
    let mut law = Planted::new(&J2Finite, Mistake::None, &convention);
    let yielding = yielding_paths(&mut law, SEED).unwrap();
    assert_eq!(yielding.len(), 15);
    for path in &yielding {
        let mut history = History::at_rest(&law);
        for (gradient, length) in path.gradients.iter().zip(&path.lengths) {
            let step = history.step_to(gradient, *length).unwrap();
            history = History::after(&step, &law.respond(&step).unwrap());
        }
        // At yielding, round-off decides.
        let at = path.name.contains("(at yielding)");
        assert!(at || (history.state[6] > 0.0) != path.name.contains("just below"), "{}", path.name);
    }
    assert!(yielding_paths(&mut Planted::new(&NeoHookean, Mistake::None, &convention), SEED).unwrap().is_empty());
}

#[test]
fn a_mistake_below_the_errors_is_not_named() {
    // Too small a deviation fits everything: nothing is said.
    let right = isotropic(1.5, 1.0);
    let mut claimed = right.clone();
    claimed[(0, 0)] += 1e-10;
    let errors = Matrix { entries: vec![1e-11; 36], ..right.clone() };
    let at = Configuration { gradient_before: tensor::IDENTITY, gradient: tensor::IDENTITY, stress: tensor::ZERO };
    let measured = Measured { tangent: right, errors };
    let observation =
        Observation { name: String::new(), at, rotation: tensor::IDENTITY, claimed, measured, elsewhere: Vec::new() };
    assert_eq!(diagnose(&Convention::abaqus(Measure::JaumannKirchhoff), &[observation]), None);
    assert_eq!(diagnose(&Convention::abaqus(Measure::JaumannKirchhoff), &[]), None);
}
