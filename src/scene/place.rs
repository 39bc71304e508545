//! Positions of keys and values in the text of a scene.

use crate::problems::Place;
use serde_json::value::RawValue;
use std::collections::HashMap;

/// Characters of the line shown on each side of the caret.
const CONTEXT: usize = 60;

impl Place {
    /// The place at byte `offset` of `text`; an offset beyond the end gives the end.
    pub(super) fn at(text: &str, offset: usize) -> Self {
        let mut offset = offset.min(text.len());
        while !text.is_char_boundary(offset) {
            offset -= 1;
        }
        let (before, after) = text.split_at(offset);
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        let head = &before[line_start..];
        let tail = after.split(['\n', '\r']).next().unwrap_or_default();
        let shown: Vec<char> = head.chars().rev().take(CONTEXT).collect();
        let excerpt = shown.iter().rev().copied().chain(tail.chars().take(CONTEXT));
        Self::Text {
            line: before.matches('\n').count() + 1,
            column: head.chars().count() + 1,
            // A tab becomes one space, so that the caret stands below its column.
            excerpt: excerpt.map(|c| if c.is_control() { ' ' } else { c }).collect(),
            indent: shown.len(),
        }
    }
}

/// One step of the path to a value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// To the value of this key in an object.
    Key(String),
    /// To this entry of a list, counted from 0.
    Index(usize),
}

/// The steps of `bodies[0].density`, also written `bodies.0.density`.
pub(super) fn steps(path: &str) -> Vec<Step> {
    path.split(['.', '[', ']'])
        .filter(|word| !word.is_empty())
        .map(|word| word.parse().map_or_else(|_| Step::Key(word.to_owned()), Step::Index))
        .collect()
}

/// The path of the steps, written as `bodies[0].density`.
pub(super) fn path(steps: &[Step]) -> String {
    let mut path = String::new();
    for step in steps {
        match step {
            Step::Index(index) => path.push_str(&format!("[{index}]")),
            Step::Key(key) if path.is_empty() => path.push_str(key),
            Step::Key(key) => path.push_str(&format!(".{key}")),
        }
    }
    path
}

/// The byte offset in `text` (valid JSON) of the key or list entry named by `steps`, and the number of steps that lead there. If the key is
/// absent, both belong to its innermost parent that is present. `None` if even the first step is absent.
pub(super) fn locate(text: &str, steps: &[Step]) -> Option<(usize, usize)> {
    let mut here = text;
    let mut found = None;
    for (i, step) in steps.iter().enumerate() {
        let Some((name, value)) = entry(here, step) else { break };
        // Both borrow from the text.
        found = Some((name.as_ptr().addr() - text.as_ptr().addr(), i + 1));
        here = value;
    }
    found
}

/// The text from the name of an entry of an object or a list on, and its value. An entry of a list has its value for a name.
fn entry<'a>(json: &'a str, step: &Step) -> Option<(&'a str, &'a str)> {
    match step {
        Step::Index(index) => {
            let list: Vec<&RawValue> = serde_json::from_str(json).ok()?;
            list.get(*index).map(|value| (value.get(), value.get()))
        }
        Step::Key(key) => {
            let object: HashMap<String, &RawValue> = serde_json::from_str(json).ok()?;
            let value = object.get(key)?.get();
            // The value borrows from the text, and its name stands before it.
            let before = json.get(..value.as_ptr().addr() - json.as_ptr().addr())?;
            let before = before.trim_end().strip_suffix(':')?.trim_end();
            let name = before.strip_suffix(&format!("\"{key}\""))?.len();
            Some((json.get(name..)?, value))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "{\"a\": [1, {\"x\": \"}{\\\"\", \"y\": 2}],\n\t\"b\": {\"c\": [[], [3.5e1, null]]}}";

    #[test]
    fn a_key_is_found_behind_strings_and_nested_lists() {
        for (path, word) in [("a[1].y", "\"y\""), ("b.c[1][1]", "null"), ("b", "\"b\""), ("a.0", "1")] {
            let (at, _) = locate(TEXT, &steps(path)).unwrap();
            assert!(TEXT[at..].starts_with(word), "{path}: {}", &TEXT[at..]);
        }
        assert_eq!(locate(TEXT, &steps("d")), None);
    }

    #[test]
    fn an_absent_key_is_placed_at_its_parent() {
        assert_eq!(locate(TEXT, &steps("b.d.e")), locate(TEXT, &steps("b")));
        assert_eq!(locate(TEXT, &steps("a[7]")), locate(TEXT, &steps("a")));
    }

    #[test]
    fn the_caret_stands_under_the_column() {
        let (at, _) = locate(TEXT, &steps("b.c")).unwrap();
        let printed = Place::at(TEXT, at).to_string();
        let lines: Vec<&str> = printed.lines().collect();
        assert_eq!(lines[0], " --> line 2, column 8");
        assert_eq!(lines[1].find("\"c\""), lines[2].find('^'));
    }

    #[test]
    fn long_lines_and_other_alphabets_are_cut_at_characters() {
        let text = "ü".repeat(500);
        let Place::Text { column, excerpt, indent, .. } = Place::at(&text, 401) else { panic!("not in the text") };
        assert_eq!((column, indent, excerpt.chars().count()), (201, 60, 120));
    }
}
