//! Positions of keys and values in the text of a scene.

use crate::problems::Place;

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

    /// The place of a line and byte column as counted by serde_json, both from 1 (column 0: before the line).
    pub(super) fn at_line(text: &str, line: usize, column: usize) -> Self {
        let start: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
        Self::at(text, start + column.saturating_sub(1))
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
    let mut scanner = Scanner { bytes: text.as_bytes(), at: 0 };
    let mut found = None;
    for (i, step) in steps.iter().enumerate() {
        match scanner.enter(step) {
            Some(place) => found = Some((place, i + 1)),
            None => break,
        }
    }
    found
}

/// A scanner over text that is known to be valid JSON.
struct Scanner<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Scanner<'_> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn skip_space(&mut self) {
        while self.peek().is_some_and(|byte| b" \t\r\n:,".contains(&byte)) {
            self.at += 1;
        }
    }

    /// Skips a string and returns its bytes, quotes excluded, escapes unresolved.
    fn string(&mut self) -> &[u8] {
        let start = self.at + 1;
        self.at = start;
        while let Some(byte) = self.peek() {
            match byte {
                b'"' => break,
                b'\\' => self.at += 2,
                _ => self.at += 1,
            }
        }
        let end = self.at.min(self.bytes.len());
        self.at = end + 1;
        self.bytes.get(start..end).unwrap_or_default()
    }

    fn skip_value(&mut self) {
        let mut depth = 0_usize;
        loop {
            self.skip_space();
            match self.peek() {
                None => return,
                Some(b'"') => {
                    self.string();
                }
                Some(b'{' | b'[') => {
                    depth += 1;
                    self.at += 1;
                }
                Some(b'}' | b']') => {
                    depth = depth.saturating_sub(1);
                    self.at += 1;
                }
                Some(_) => {
                    while self.peek().is_some_and(|byte| !b" \t\r\n:,{}[]\"".contains(&byte)) {
                        self.at += 1;
                    }
                }
            }
            if depth == 0 {
                return;
            }
        }
    }

    /// Moves from the start of a value to the entry of that value named by `step`, and returns the offset of the name.
    fn enter(&mut self, step: &Step) -> Option<usize> {
        self.skip_space();
        let open = self.peek()?;
        let mut index = 0;
        self.at += 1;
        loop {
            self.skip_space();
            let place = self.at;
            match (self.peek()?, open, step) {
                (b'}' | b']', _, _) => return None,
                (b'"', b'{', step) => {
                    let key = self.string();
                    if matches!(step, Step::Key(wanted) if wanted.as_bytes() == key) {
                        return Some(place);
                    }
                }
                (_, b'[', Step::Index(wanted)) if *wanted == index => return Some(place),
                (_, b'[', Step::Index(_)) => index += 1,
                _ => return None,
            }
            self.skip_value();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "{\"a\": [1, {\"x\": \"}\\\"\", \"y\": 2}],\n\t\"b\": {\"c\": [[], [3.5e1, null]]}}";

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
