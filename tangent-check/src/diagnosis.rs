//! Frequent mistakes, compared with a wrong tangent.
//!
//! A mistake is applied to the measured tangent, which is right. It explains the claimed tangent if both agree within
//! 60 errors of the measurement in every state, and the right tangent itself does not. Mistakes that explain the tangent equally well
//! form a class. If no mistake of the list explains it, a single additional term with one coefficient is fitted, and then it is asked
//! whether all deviations lie in one place.

mod list;
mod mistakes;
mod observation;
mod places;
mod terms;

pub use observation::{Elsewhere, Measured, Observation};

use crate::convention::Convention;
use crate::finding::Diagnosis;
use crate::matrix::Matrix;
use mistakes::Candidate;
use observation::{AGREEMENT, VISIBLE, distance};

/// So many general states are needed to tell mistakes apart.
const GENERAL_STATES: usize = 3;

/// The nearest mistake is told if it explains this part of the deviation.
const NEAREST: f64 = 0.9;

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
    let candidates = list::candidates(convention);
    let explaining: Vec<&Candidate> =
        candidates.iter().filter(|candidate| explains(candidate, convention, &observations)).collect();
    let mut diagnosis = match explaining.as_slice() {
        [] => terms::fit(convention, &observations).or_else(|| places::fit(convention, &observations))?,
        [one] => Diagnosis::alone(one.sentence.clone()),
        several => class(several, general),
    };
    if let Some(candidate) = explaining.first() {
        diagnosis.share = share(candidate, convention, &observations);
    }
    if !general {
        diagnosis
            .states_that_tell
            .push("three general states: strained along no axis, rotated, with J ≠ 1".to_string());
    }
    Some(diagnosis)
}

/// The part of all deviations that a mistake explains: 1 − Σ|rest|²/Σ|deviation|², weighted with the errors, over the states in which it can
/// be applied.
fn share(candidate: &Candidate, convention: &Convention, observations: &[Observation]) -> f64 {
    let [mut rest, mut whole] = [0.0, 0.0];
    for observation in observations {
        let right = &observation.measured.tangent;
        let Some(wrong) = candidate.applied(convention, observation) else { continue };
        let square = |matrix: &Matrix| {
            let parts = matrix.entries.iter().zip(&observation.claimed.entries);
            parts.map(|(a, b)| ((a - b) / observation.measured.error()).powi(2)).sum::<f64>()
        };
        rest += square(&wrong.tangent);
        whole += square(right);
    }
    if whole > 0.0 && rest.is_finite() { 1.0 - rest / whole } else { 0.0 }
}

/// The mistake of the list that comes nearest, if it explains most of the deviation but not all: there may be a second one.
pub fn nearest(convention: &Convention, observations: &[Observation]) -> Option<(String, f64)> {
    let observations = usable(convention, observations);
    let candidates = list::candidates(convention);
    let shares =
        candidates.iter().map(|candidate| (candidate.name.clone(), share(candidate, convention, &observations)));
    shares.filter(|(_, share)| *share >= NEAREST).max_by(|a, b| a.1.total_cmp(&b.1))
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
    Diagnosis { candidates, states_that_tell, ..Diagnosis::alone(sentence) }
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
    for candidate in list::candidates(convention).into_iter().filter(hidden) {
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
