//! Frequent mistakes, found on 26 and 27 November 2026 in public UMATs, and planted one by one in a small law of our own.
//!
//! Our law: monoclinic damage, σ = (1 − d) 𝔻 : ε. While m, the greatest tr ε so far, grows beyond m₀, d = 1 − e^(−(m − m₀)/m₁) and
//!
//! ∂σ/∂ε = (1 − d) 𝔻 − (1 − d)/m₁ (𝔻 : ε) ⊗ I,
//!
//! which is not symmetric and has no zero. State: m.

use crate::algebra::{symmetric_tensor, vector};
use crate::check::{assert_diagnosed, report};
use tangent_check::convention::{Components, Convention, Measure, Tensor};
use tangent_check::finding::Verdict;
use tangent_check::law::{CallFailed, Law, Response, Step};
use tangent_check::matrix::Matrix;
use tangent_check::tensor::{polar, product3, sum, trace, transposed};

/// 𝔻, with three shear moduli and normal–shear coupling.
const STIFFNESS: [[f64; 6]; 6] = [
    [90.0, 30.0, 20.0, 5.0, 3.0, 2.0],
    [30.0, 70.0, 25.0, 4.0, 6.0, 1.0],
    [20.0, 25.0, 50.0, 2.0, 1.0, 7.0],
    [5.0, 4.0, 2.0, 10.0, 1.5, 0.5],
    [3.0, 6.0, 1.0, 1.5, 20.0, 2.5],
    [2.0, 1.0, 7.0, 0.5, 2.5, 40.0],
];
/// m₁.
const DUCTILITY: f64 = 0.4;

/// A wrong tangent from the step, the right one, that without damage's growth, and the stress.
type Mistake = fn(&Step, &Matrix, &Matrix, &[f64]) -> Matrix;

struct Monoclinic {
    /// m₀.
    onset: f64,
    mistake: Option<Mistake>,
    /// The tangent has the factor 1 − d of the call before, as a COMMON block keeps it.
    remembers: bool,
    common: Option<f64>,
}

fn law(onset: f64, mistake: Option<Mistake>) -> Monoclinic {
    Monoclinic { onset, mistake, remembers: false, common: None }
}

/// A matrix with these entries.
fn of(entry: impl Fn(usize, usize) -> f64) -> Matrix {
    Matrix::from_entries(6, 6, entry)
}

/// The right tangent with the entries of a place multiplied.
fn scaled(right: &Matrix, factor: f64, place: fn(usize, usize) -> bool) -> Matrix {
    of(|i, j| right[(i, j)] * if place(i, j) { factor } else { 1.0 })
}

/// The stiffness of axes that are turned by Q.
fn turned(q: &Tensor, right: &Matrix) -> Matrix {
    let engineering = Components::abaqus(2.0);
    let column = |k: usize| {
        let unit = engineering
            .symmetric_tensor(&of(|i, _| f64::from(u8::from(i == k))).times(&[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
        let stress = right.times(&engineering.vector(&product3(&transposed(q), &unit, q)));
        vector(&product3(q, &symmetric_tensor(&stress), &transposed(q)))
    };
    Matrix::from_columns(6, &(0..6).map(column).collect::<Vec<_>>())
}

/// R of F = V R.
fn rotation(step: &Step) -> Tensor {
    polar(&step.gradient).expect("det F > 0").0
}

impl Law for Monoclinic {
    fn name(&self) -> String {
        "Monoclinic damage".to_string()
    }

    fn convention(&self) -> Convention {
        Convention::abaqus(Measure::CauchyByStrain)
    }

    fn state_at_rest(&self) -> Vec<f64> {
        vec![self.onset]
    }

    fn respond(&mut self, step: &Step) -> Result<Response, CallFailed> {
        let strain = sum(&step.strain, 1.0, &step.strain_increment);
        let (before, volume) = (step.state[0], trace(&strain));
        let left = (-(before.max(volume) - self.onset) / DUCTILITY).exp();
        let elastic = of(|i, j| STIFFNESS[i][j]);
        let whole = elastic.times(&Components::abaqus(2.0).vector(&strain));
        let used = self.common.replace(left).unwrap_or(left);
        let stress: Vec<f64> = whole.iter().map(|entry| left * entry).collect();
        let frozen = of(|i, j| left * elastic[(i, j)]);
        let grows = volume > before;
        let right = of(|i, j| frozen[(i, j)] - if grows && j < 3 { stress[i] / DUCTILITY } else { 0.0 });
        let tangent = match self.mistake {
            None if self.remembers => of(|i, j| used * STIFFNESS[i][j]),
            None => right,
            Some(mistake) => mistake(step, &right, &frozen, &stress),
        };
        Ok(Response { stress, tangent, state: vec![before.max(volume)] })
    }
}

/// Half the entries in the order 13, 12, 23.
fn half_exchanged(right: &Matrix) -> Matrix {
    of(|i, j| right[(i, [0, 1, 2, 4, 3, 5][j])])
}

/// Each mistake with its name.
const MISTAKES: [(Mistake, &str); 19] = [
    (|_, right, _, _| scaled(right, 1.1, |i, j| (i, j) == (0, 1)), "the entry 11 by 22 alone is multiplied by 1.1"),
    (|_, right, _, _| scaled(right, -1.0, |i, j| (i, j) == (0, 3)), "the entry 11 by 12 alone is of the opposite sign"),
    (|_, right, _, _| scaled(right, 0.0, |i, _| i == 2), "the row of 33 alone is zero"),
    (|_, right, _, _| scaled(right, 2.0, |_, j| j == 4), "the column of 13 alone is multiplied by 2"),
    (|_, right, _, _| scaled(right, -1.0, |i, j| i < 3 && j >= 3), "normal by shear are of the opposite sign"),
    (|_, right, _, _| scaled(right, 0.0, |i, j| (i < 3) != (j < 3)), "normal by shear and shear by normal are zero"),
    (|_, right, _, _| of(|i, j| right[(i.min(j), i.max(j))]), "below the diagonal copied from those above"),
    (|_, right, _, _| of(|i, j| 0.5 * (right[(i, j)] + right[(j, i)])), "it was symmetrised"),
    (
        |_, right, _, _| of(|i, j| if i < 3 && j < 3 { right[(j, i)] } else { right[(i, j)] }),
        "its block of normal by normal transposed",
    ),
    (|_, right, _, _| of(|i, j| right[(i, j)].trunc()), "cut to whole numbers"),
    (
        |_, right, _, stress| of(|i, j| right[(i, j)] + if j < 3 { stress[i] } else { 0.0 }),
        "the Jaumann rate of the Kirchhoff",
    ),
    (|_, _, frozen, _| frozen.clone(), "the elastic one in place of the algorithmic one"),
    (|step, _, _, _| of(|i, j| STIFFNESS[i][j] * (-step.state[0] / DUCTILITY).exp()), "that at the start of the step"),
    (|_, right, _, _| scaled(right, 2.0, |_, j| j >= 3), "the shear columns multiplied by 2"),
    (|_, right, _, _| half_exchanged(right), "the shear components 12 and 13 exchanged, in the columns only"),
    (|step, right, _, _| turned(&rotation(step), right), "turned by the rotation of F once more"),
    (|step, right, _, _| turned(&step.rotation, right), "turned by the rotation increment (DROT) once more"),
    (|step, right, _, _| turned(&transposed(&step.rotation), right), "turned back by the rotation increment (DROT)"),
    (
        |_, right, _, _| of(|i, j| right[([0, 1, 2, 5, 4, 3][i], [0, 1, 2, 5, 4, 3][j])]),
        "the shear components 12 and 23 exchanged.",
    ),
];

#[test]
fn before_each_mistake_is_named() {
    for (mistake, words) in MISTAKES {
        let report = report(&mut law(0.0, Some(mistake)));
        assert_eq!(report.verdict(), Verdict::Wrong, "{words}");
        assert_diagnosed(&report, words);
        assert!(report.diagnoses[0].share > 0.999, "{words}: {}", report.diagnoses[0].share);
    }
}

#[test]
fn before_a_law_remembers_the_call_before() {
    let report = report(&mut Monoclinic { remembers: true, ..law(0.0, None) });
    assert_eq!(report.verdict(), Verdict::Wrong);
    assert!(
        report.diagnoses.is_empty() && report.notes.iter().any(|note| note.contains("remembers")),
        "{:?}",
        report.notes
    );
}

/// The paths end at tr ε = 0.69. The search for onsets finds damage that begins at 0.9.
#[test]
fn before_late_damage_is_found_wrong() {
    let report = report(&mut law(0.9, Some(|_, _, frozen, _| frozen.clone())));
    assert_eq!(report.verdict(), Verdict::Wrong);
    let wrong = report.findings.iter().filter(|finding| finding.verdict == Verdict::Wrong);
    assert!(wrong.clone().all(|finding| finding.name.contains("late at")));
    assert!(report.notes.iter().any(|note| note.contains("STATEV(1) from 9.000e-1")), "{:?}", report.notes);
}

#[test]
fn after_the_law_is_consistent() {
    for onset in [0.0, 0.9] {
        report(&mut law(onset, None)).assert_consistent();
    }
}
