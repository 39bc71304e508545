//! The ranges of the internal variables in the states of a check.

use super::Visit;
use crate::tensor::{eigenvalues, product, transposed};

/// So many variables are listed one by one.
const LISTED: usize = 12;

/// Sentences about the range of every internal variable, and about those that never changed: their part of the law was not checked.
pub(super) fn notes(rest: &[f64], visits: &[Visit]) -> Vec<String> {
    if rest.is_empty() || visits.is_empty() {
        return Vec::new();
    }
    let range = |k: usize| {
        let values = visits.iter().filter_map(|visit| visit.response.state.get(k).copied());
        values.fold([rest[k]; 2], |[low, high], value| [low.min(value), high.max(value)])
    };
    let ranges: Vec<[f64; 2]> = (0..rest.len()).map(range).collect();
    let (moved, still): (Vec<usize>, Vec<usize>) = (0..rest.len()).partition(|k| ranges[*k][0] != ranges[*k][1]);
    let mut notes = Vec::new();
    if !moved.is_empty() {
        let one = |k: &usize| format!("STATEV({}) from {:.3e} to {:.3e}", k + 1, ranges[*k][0], ranges[*k][1]);
        notes.push(format!("Ranges of the internal variables: {}.", listed(&moved, one)));
    }
    if !still.is_empty() {
        let one = |k: &usize| format!("STATEV({})", k + 1);
        notes.push(format!(
            "{} never changed, in states up to a stretch of {:.2}. The check cannot show a mistake in what {} on.",
            listed(&still, one),
            greatest_stretch(visits),
            if still.len() == 1 { "it acts" } else { "they act" },
        ));
    }
    notes
}

fn listed(all: &[usize], one: impl Fn(&usize) -> String) -> String {
    let first = all.iter().take(LISTED).map(one).collect::<Vec<_>>().join(", ");
    match all.len().saturating_sub(LISTED) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}

/// The greatest principal stretch: √ of the greatest eigenvalue of F Fᵀ.
fn greatest_stretch(visits: &[Visit]) -> f64 {
    let square = |visit: &Visit| {
        let f = &visit.step.gradient;
        eigenvalues(&product(f, &transposed(f))).0.into_iter().fold(0.0, f64::max)
    };
    visits.iter().map(square).fold(0.0, f64::max).sqrt()
}
