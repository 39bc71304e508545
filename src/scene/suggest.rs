//! The allowed word nearest to a misspelt one.

/// Maximum number of letters to change, insert or drop.
const NEAR: usize = 2;

/// Maximum length of a word; no key is longer.
const LONGEST: usize = 64;

/// The word of `allowed` nearest to `word`, if it is at most two letters away and shares at least one.
pub(super) fn nearest<'a>(word: &str, allowed: &[&'a str]) -> Option<&'a str> {
    let letters = word.chars().count();
    if letters > LONGEST {
        return None;
    }
    allowed
        .iter()
        .map(|candidate| (distance(word, candidate), *candidate))
        .filter(|(edits, candidate)| *edits <= NEAR && *edits < letters.min(candidate.len()))
        .min_by_key(|(edits, _)| *edits)
        .map(|(_, candidate)| candidate)
}

/// Levenshtein's distance, row by row. Words whose lengths differ by more than [`NEAR`] count as far apart.
fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    if a.len().abs_diff(b.len()) > NEAR {
        return NEAR + 1;
    }
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut diagonal = i;
        let mut left = i + 1;
        for (above, y) in row.iter_mut().skip(1).zip(&b) {
            let edits = (left + 1).min(*above + 1).min(diagonal + usize::from(x != y));
            diagonal = *above;
            *above = edits;
            left = edits;
        }
    }
    row.last().copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_are_counted() {
        for (a, b, edits) in [
            ("density", "density", 0),
            ("densty", "density", 1),
            ("poison", "poisson", 1),
            ("setp", "step", 2),
            ("gird", "grid", 2),
        ] {
            assert_eq!(distance(a, b), edits, "{a} {b}");
            assert_eq!(distance(b, a), edits, "{b} {a}");
        }
    }

    #[test]
    fn only_near_words_are_suggested() {
        assert_eq!(nearest("sape", &["name", "shape"]), Some("shape"));
        assert_eq!(nearest("mass", &["density", "velocity"]), None);
        assert_eq!(nearest("of", &["by"]), None);
    }
}
