//! The allowed word nearest to a misspelt one.

use strsim::damerau_levenshtein;

/// Maximum number of letters to change, insert, drop or exchange with a neighbour.
const MAX_EDITS: usize = 2;

/// Maximum length of a word; no key is longer.
const MAX_LETTERS: usize = 64;

/// The word of `allowed` nearest to `word`, if it is at most two letters away and shares at least one.
pub(super) fn nearest<'a>(word: &str, allowed: &[&'a str]) -> Option<&'a str> {
    let letters = word.chars().count();
    if letters > MAX_LETTERS {
        return None;
    }
    allowed
        .iter()
        .map(|candidate| (damerau_levenshtein(word, candidate), *candidate))
        .filter(|(edits, candidate)| *edits <= MAX_EDITS && *edits < letters.min(candidate.len()))
        .min_by_key(|(edits, _)| *edits)
        .map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_near_words_are_suggested() {
        assert_eq!(nearest("sape", &["name", "shape"]), Some("shape"));
        assert_eq!(nearest("mass", &["density", "velocity"]), None);
        assert_eq!(nearest("of", &["by"]), None);
    }
}
