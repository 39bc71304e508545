//! Frequent mistakes, compared with a wrong tangent.
//!
//! A mistake is applied to the measured tangent, which is right. It explains the claimed tangent if both agree within
//! 60 errors of the measurement in every state, and the right tangent itself does not. Mistakes that explain the tangent equally well
//! form a class. If no mistake of the list explains it, a single additional term with one coefficient is fitted.

mod mistakes;
mod terms;

use crate::convention::{Configuration, Convention, Measure};
use crate::finding::Diagnosis;
use crate::matrix::Matrix;
use crate::tensor::{IDENTITY, determinant, norm, polar, product, sum, transposed};
use mistakes::Candidate;

/// A candidate agrees within this many errors of the measurement.
const AGREEMENT: f64 = 60.0;
/// A deviation that is to be explained exceeds this many errors somewhere; below it, every small change would explain it.
const VISIBLE: f64 = 600.0;
/// Measured tangents with greater errors than this, relative to their greatest entry, take no part.
const USABLE: f64 = 1e-6;
/// So many general states are needed to tell mistakes apart.
const GENERAL_STATES: usize = 3;

/// A tangent of the same law elsewhere, which may stand in place of the right one by mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Elsewhere {
    /// At the end of the step before.
    StepBefore,
    /// In the same state without plastic or viscous flow.
    Elastic,
    /// In the same state, with flow in a step of length zero.
    Continuum,
    /// At rest, without strain.
    AtRest,
}

/// A measured tangent.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The entries.
    pub tangent: Matrix,
    /// The estimated error of each.
    pub errors: Matrix,
}

/// A checked state.
#[derive(Clone, Debug)]
pub struct Observation {
    /// The name of the state.
    pub name: String,
    /// F₀, F₁ and the Cauchy stress.
    pub at: Configuration,
    /// The tangent as claimed.
    pub claimed: Matrix,
    /// The right tangent, by differences.
    pub measured: Measured,
    /// Right tangents of the same law elsewhere, where they were measured.
    pub elsewhere: Vec<(Elsewhere, Measured)>,
}

impl Measured {
    /// The greatest error; infinite if an entry or error is not finite or there is none.
    fn error(&self) -> f64 {
        let entries = &self.tangent.entries;
        let finite = entries.iter().chain(&self.errors.entries).all(|entry| entry.is_finite());
        if !finite || entries.is_empty() || self.errors.entries.len() != entries.len() {
            return f64::INFINITY;
        }
        // The measurement is no better than the rounding of its greatest entry.
        self.errors.greatest().max(f64::EPSILON * self.tangent.greatest())
    }
}

impl Observation {
    /// The tangent of this law elsewhere.
    fn elsewhere(&self, kind: Elsewhere) -> Option<&Measured> {
        self.elsewhere.iter().find(|(found, _)| *found == kind).map(|(_, measured)| measured)
    }

    /// Whether claimed and measured tangents fit the convention and are accurate enough to tell mistakes.
    fn usable(&self, convention: &Convention) -> bool {
        let size = |matrix: &Matrix| {
            let [rows, columns] = [convention.stress.count(), convention.strain.count()];
            (matrix.rows, matrix.columns, matrix.entries.len()) == (rows, columns, rows * columns)
        };
        size(&self.claimed)
            && size(&self.measured.tangent)
            && self.claimed.entries.iter().all(|entry| entry.is_finite())
            && self.measured.error() <= USABLE * self.measured.tangent.greatest()
            && self.measured.tangent.greatest() > 0.0
    }

    /// Whether F is rotated, J is not 1, and no axis of strain is aligned.
    fn general(&self, plane: bool) -> bool {
        let stretch = product(&self.at.gradient, &transposed(&self.at.gradient));
        let shears = [stretch[0][1], stretch[0][2], stretch[1][2]];
        let sheared = shears.iter().take(if plane { 1 } else { 3 }).all(|shear| shear.abs() > 1e-3);
        let turned = |(rotation, _)| norm(&sum(&rotation, -1.0, &IDENTITY)) > 1e-2;
        let volume = (determinant(&self.at.gradient) - 1.0).abs() > 1e-3;
        sheared && volume && polar(&self.at.gradient).is_some_and(turned)
    }
}

/// The greatest |A − B|; infinite if an entry is not finite.
fn distance(a: &Matrix, b: &Matrix) -> f64 {
    let distance = |(a, b): (&f64, &f64)| if (a - b).is_finite() { (a - b).abs() } else { f64::INFINITY };
    a.entries.iter().zip(&b.entries).map(distance).fold(0.0, f64::max)
}

/// The observations that take part in a diagnosis.
/// Increments have no part in mistakes of algebra: ∂σ/∂Δε stands beside the Jaumann rate of the Cauchy stress, as for small increments.
fn usable(convention: &Convention, observations: &[Observation]) -> Vec<Observation> {
    let used = observations.iter().filter(|observation| observation.usable(convention)).cloned();
    used.map(|mut observation| {
        observation.at.gradient_before = observation.at.gradient;
        observation
    })
    .collect()
}

/// The mistakes that explain wrong tangents, as one diagnosis; `None` if the tangents are right, or nothing of the list explains them.
pub fn diagnose(convention: &Convention, observations: &[Observation]) -> Option<Diagnosis> {
    let observations = usable(convention, observations);
    let visible = |observation: &&Observation| {
        distance(&observation.claimed, &observation.measured.tangent) > VISIBLE * observation.measured.error()
    };
    if observations.iter().filter(visible).count() == 0 {
        return None;
    }
    let general = general(convention, &observations);
    let candidates = mistakes::candidates(convention);
    let explaining: Vec<&Candidate> =
        candidates.iter().filter(|candidate| explains(candidate, convention, &observations)).collect();
    let mut diagnosis = match explaining.as_slice() {
        [] => terms::fit(convention, &observations)?,
        [one] => one.alone(),
        several => class(several, general),
    };
    if !general {
        diagnosis
            .states_that_tell
            .push("three general states: strained along no axis, rotated, with J ≠ 1".to_string());
    }
    Some(diagnosis)
}

/// Whether so many states are general that mistakes can be told apart.
fn general(convention: &Convention, observations: &[Observation]) -> bool {
    let plane = convention.plane();
    observations.iter().filter(|observation| observation.general(plane)).count() >= GENERAL_STATES
}

/// Whether the mistake reproduces the claimed tangent in every state in which it can be applied, a visibly wrong one among them.
fn explains(candidate: &Candidate, convention: &Convention, observations: &[Observation]) -> bool {
    let mut told = 0;
    for observation in observations {
        let Some(wrong) = candidate.applied(convention, observation) else {
            continue;
        };
        let error = wrong.error();
        if distance(&wrong.tangent, &observation.claimed) > AGREEMENT * error {
            return false;
        }
        if distance(&observation.measured.tangent, &observation.claimed) > VISIBLE * error {
            told += 1;
        }
    }
    told > 0
}

/// Several mistakes that explain the tangent equally well. `general` says whether the states are general already.
fn class(several: &[&Candidate], general: bool) -> Diagnosis {
    let candidates: Vec<String> = several.iter().map(|candidate| candidate.sentence.clone()).collect();
    let mut states_that_tell: Vec<String> = Vec::new();
    for candidate in several {
        let states = candidate.shows_in(general).to_string();
        if !states_that_tell.contains(&states) {
            states_that_tell.push(states);
        }
    }
    let short = |sentence: &String| sentence.trim_start_matches(mistakes::YOURS).trim_end_matches('.').to_string();
    let all: Vec<String> = candidates.iter().map(short).collect();
    let sentence =
        format!("{}one of {} that are equal in these states: {}.", mistakes::YOURS, all.len(), all.join("; or "));
    Diagnosis { sentence, candidates, states_that_tell, coefficient: None }
}

/// The mistakes of a kind that are named one by one.
const NAMED: usize = 3;

/// Mistakes that these states cannot show: with them, the tangent stays the right one. Each text names the mistakes that the same states or
/// laws would show. Empty if no state can be used.
pub fn invisible(convention: &Convention, observations: &[Observation]) -> Vec<String> {
    let observations = usable(convention, observations);
    let hidden = |candidate: &Candidate| {
        let mut applied = 0;
        for observation in &observations {
            let Some(wrong) = candidate.applied(convention, observation) else {
                continue;
            };
            applied += 1;
            if distance(&wrong.tangent, &observation.measured.tangent) > AGREEMENT * wrong.error() {
                return false;
            }
        }
        applied > 0
    };
    let general = general(convention, &observations);
    let mut kinds: Vec<(&str, Vec<String>)> = Vec::new();
    for candidate in mistakes::candidates(convention).into_iter().filter(hidden) {
        let shows_in = candidate.shows_in(general);
        match kinds.iter_mut().find(|(kind, _)| *kind == shows_in) {
            Some((_, names)) => names.push(candidate.name),
            None => kinds.push((shows_in, vec![candidate.name])),
        }
    }
    kinds.into_iter().map(|(kind, names)| format!("{}, which would need {kind}", list(&names))).collect()
}

/// The first names, and the number of the others.
fn list(names: &[String]) -> String {
    let first = names[..names.len().min(NAMED)].join(", ");
    match names.len().saturating_sub(NAMED) {
        0 => first,
        others => format!("{first} and {others} more of the kind"),
    }
}

/// Whether the measure is one of the rates or the small-strain tangent: symmetric stress by symmetric spatial strain.
fn spatial(measure: Measure) -> bool {
    !measure.by_gradient() && measure != Measure::SecondPiolaByGreen
}
