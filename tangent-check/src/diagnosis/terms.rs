//! Terms with one coefficient: what is missing in a tangent, or too much.

use super::observation::{AGREEMENT, Observation, VISIBLE, distance};
use crate::convention::{Components, Configuration, Convention, Measure, Tensor, convert};
use crate::finding::Diagnosis;
use crate::listed::listed;
use crate::matrix::Matrix;
use crate::tensor::{IDENTITY, ZERO, determinant};

listed! {
    /// A term that a tangent may lack.
    #[derive(Clone, Copy, PartialEq)]
    Term, name "The term in words.":
    Whole "the right tangent",
    Volume "I ⊗ I",
    StressVolume "σ ⊗ I",
    VolumeStress "I ⊗ σ",
    /// For other measures than rates, dF S or what corresponds to it.
    Geometric "H (H:D = D σ + σ D, the geometric part)",
    Identity "the symmetric identity",
    Deviator "the deviatoric identity",
    /// For ∂S/∂E.
    MaterialVolume "I ⊗ I in material axes",
    /// For ∂S/∂E.
    MaterialIdentity "the symmetric identity in material axes",
}

/// The powers of J with which a term may come.
const POWERS: [(i32, &str); 3] = [(0, ""), (-1, "/J"), (1, " J")];

impl Term {
    /// The term in the components of the convention.
    fn tangent(self, convention: &Convention, observation: &Observation) -> Option<Matrix> {
        let at = &observation.at;
        let without_stress = Configuration { stress: ZERO, ..at.clone() };
        let truesdell = Convention::abaqus(Measure::Truesdell);
        let spatial = |matrix: Matrix| convert(&matrix, &truesdell, convention, &without_stress).ok();
        let material = convention.measure == Measure::SecondPiolaByGreen;
        match self {
            Term::Whole => Some(observation.measured.tangent.clone()),
            Term::Volume => spatial(dyad(&truesdell, &IDENTITY, &IDENTITY)),
            Term::StressVolume => spatial(dyad(&truesdell, &at.stress, &IDENTITY)),
            Term::VolumeStress => spatial(dyad(&truesdell, &IDENTITY, &at.stress)),
            Term::Identity => spatial(identity(&truesdell)),
            Term::Deviator => {
                let volume = dyad(&truesdell, &IDENTITY, &IDENTITY);
                let identity = identity(&truesdell);
                spatial(identity.mapped(|i, j| identity[(i, j)] - volume[(i, j)] / 3.0))
            }
            Term::Geometric => {
                let rate = if convention.measure.spatial() { Measure::JaumannKirchhoff } else { convention.measure };
                let to = Convention { measure: rate, ..convention.clone() };
                convert(&Matrix::zeros(6, 6), &truesdell, &to, at).ok()
            }
            Term::MaterialVolume => material.then(|| dyad(convention, &IDENTITY, &IDENTITY)),
            Term::MaterialIdentity => material.then(|| identity(convention)),
        }
    }
}

/// a ⊗ b.
fn dyad(convention: &Convention, a: &Tensor, b: &Tensor) -> Matrix {
    let rows = convention.stress.vector(a);
    let columns = derivative(&convention.strain, b);
    Matrix::from_entries(rows.len(), columns.len(), |row, column| rows[row] * columns[column])
}

/// ∂(b : ε)/∂ε_k for each component of the strain.
fn derivative(strain: &Components, b: &Tensor) -> Vec<f64> {
    let entry = |k: usize| {
        let (i, j) = strain.pairs[k];
        if i == j { b[i][i] } else { (b[i][j] + b[j][i]) / strain.shear }
    };
    (0..strain.count()).map(entry).collect()
}

/// The identity of symmetric tensors.
fn identity(convention: &Convention) -> Matrix {
    let column = |k: usize| convention.stress.vector(&crate::convention::unit_strain(convention, k));
    let columns: Vec<Vec<f64>> = (0..convention.strain.count()).map(column).collect();
    Matrix::from_columns(convention.stress.count(), &columns)
}

/// The term and its coefficient that explain all deviations; `None` if no single term does.
pub(super) fn fit(convention: &Convention, observations: &[Observation]) -> Option<Diagnosis> {
    let mut sentences = Vec::new();
    let mut first = None;
    for term in Term::ALL {
        for (power, suffix) in POWERS {
            if let Some(coefficient) = coefficient(term, power, convention, observations) {
                sentences.push(sentence(term, suffix, coefficient));
                first = first.or(Some(coefficient));
            }
        }
    }
    let coefficient = Some(first?);
    if let [one] = sentences.as_slice() {
        return Some(Diagnosis { coefficient, ..Diagnosis::alone(one.clone()) });
    }
    let sentence = format!("Several terms explain your tangent equally well: {}", sentences.join(" Or: "));
    let states_that_tell = vec!["large strain and stress, J ≠ 1".to_string()];
    Some(Diagnosis { candidates: sentences, states_that_tell, coefficient, ..Diagnosis::alone(sentence) })
}

fn sentence(term: Term, suffix: &str, coefficient: f64) -> String {
    match term {
        Term::Whole if suffix.is_empty() => {
            format!("Your tangent is the right one times {:.6}.", 1.0 + coefficient)
        }
        _ => {
            let sign = if coefficient < 0.0 { "less" } else { "and" };
            let (size, name) = (coefficient.abs(), term.name());
            format!("Your tangent is the right one {sign} the term {size:.6}{suffix} times {name}.")
        }
    }
}

/// The coefficient α for which claimed = right + α Jⁿ T in every state, by least squares weighted with the errors.
/// A fit to fewer than two states that show a deviation would prove nothing.
fn coefficient(term: Term, power: i32, convention: &Convention, observations: &[Observation]) -> Option<f64> {
    let mut parts = Vec::new();
    let [mut numerator, mut denominator] = [0.0, 0.0];
    for observation in observations {
        let factor = determinant(&observation.at.gradient).powi(power);
        let tangent = term.tangent(convention, observation)?;
        let tangent = tangent.mapped(|row, column| factor * tangent[(row, column)]);
        let error = observation.measured.error();
        for (k, entry) in tangent.entries.iter().enumerate() {
            let deviation = observation.claimed.entries[k] - observation.measured.tangent.entries[k];
            numerator += deviation * entry / (error * error);
            denominator += entry * entry / (error * error);
        }
        parts.push((tangent, error));
    }
    let coefficient = numerator / denominator;
    if !coefficient.is_finite() {
        return None;
    }
    let mut told = 0;
    for ((part, error), observation) in parts.iter().zip(observations) {
        let right = &observation.measured.tangent;
        let wrong = part.mapped(|row, column| right[(row, column)] + coefficient * part[(row, column)]);
        if distance(&wrong, &observation.claimed) > AGREEMENT * error {
            return None;
        }
        told += usize::from(distance(right, &observation.claimed) > VISIBLE * error);
    }
    (told >= 2).then_some(coefficient)
}
