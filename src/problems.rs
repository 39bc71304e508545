//! All problems with the values of a scene at once, each with its place, the value found and the values allowed.

use std::fmt::{self, Display};

/// The most problems kept: a table of a million wrong rows needs no million messages.
pub(crate) const KEPT: usize = 50;

/// The most bodies, loads, parts of a shape or probes.
pub(crate) const MOST: usize = 1000;

/// The most characters shown of a value.
const SHOWN: usize = 80;

/// The most characters shown of a message, which may quote the text.
const MESSAGE: usize = 600;

/// The most characters shown of a path, about twice the longest path of a real scene.
const PATH: usize = 160;

/// The largest length, time or modulus allowed. Squares and products of allowed numbers then stay finite.
pub(crate) const LARGEST: f64 = 1e100;

/// One problem in a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// The key, such as `bodies[0].density`; empty if the text is not JSON.
    pub path: String,
    /// The sentence about the wrong value, such as `-1 is not allowed; must be finite and > 0`.
    pub message: String,
    /// The place of the value; unknown for keys that are absent.
    pub place: Option<Place>,
}

impl Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let separator = if self.path.is_empty() { "" } else { ": " };
        // Nobody reads a path through a hundred brackets.
        write!(f, "{}{separator}{}", cut(&self.path, PATH), cut(&self.message, MESSAGE))?;
        let Some(place) = &self.place else { return Ok(()) };
        write!(f, "\n{place}")
    }
}

/// The first characters of a text, with a mark where the text goes on.
fn cut(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// The place of a problem.
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// In the scene's text.
    Text {
        /// Line, from 1.
        line: usize,
        /// Column in characters, from 1.
        column: usize,
        /// The line itself, or the part of a long one around the column.
        excerpt: String,
        /// Characters of `excerpt` before the column.
        indent: usize,
    },
    /// In the argument `KEY=JSON` that replaced a value.
    Override(String),
}

impl Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text { line, column, excerpt, indent } => {
                let number = line.to_string();
                let margin = " ".repeat(number.len());
                writeln!(f, "{margin}--> line {line}, column {column}")?;
                writeln!(f, "{number} | {excerpt}")?;
                write!(f, "{margin} | {}^", " ".repeat(*indent))
            }
            Self::Override(argument) => write!(f, "--> in the override {argument}"),
        }
    }
}

/// All problems found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Problems {
    /// The first ones, in the order of the scene's sections.
    pub list: Vec<Problem>,
    /// Problems found beyond those in the list.
    pub more: usize,
}

impl Problems {
    /// Whether there are no problems.
    ///
    /// ```
    /// // γ and β of Newmark's method that would not be stable.
    /// let mut scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// (scene.time.gamma, scene.time.beta) = (Some(0.5), Some(0.2)); // 2β ≥ γ is asked for
    /// let problems = scene.check();
    /// assert!(!problems.is_empty() && problems.to_string().contains("time.beta"), "{problems}");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Adds a problem: `value` was found at `path`. `allowed` says what is allowed there.
    pub(crate) fn refuse(&mut self, path: &str, value: impl Display, allowed: impl Display) {
        if self.list.len() == KEPT {
            self.more += 1;
            return;
        }
        let message = format!("{} is not allowed; {allowed}", cut(&value.to_string(), SHOWN));
        self.list.push(Problem { path: path.to_owned(), message, place: None });
    }

    /// Adds a problem unless `ok`. Returns `ok`.
    pub(crate) fn require(&mut self, ok: bool, path: &str, value: impl Display, allowed: impl Display) -> bool {
        if !ok {
            self.refuse(path, value, allowed);
        }
        ok
    }

    /// Checks that a number has a sensible size. A number that is not given passes, here and below.
    pub(crate) fn number(&mut self, path: &str, x: impl Into<Option<f64>>) -> bool {
        let Some(x) = x.into() else { return true };
        self.require(sensible(x), path, Number(x), format_args!("must be finite and at most {LARGEST:e} in size"))
    }

    /// Checks that a number has a sensible size and is > 0.
    pub(crate) fn positive(&mut self, path: &str, x: impl Into<Option<f64>>) -> bool {
        let Some(x) = x.into() else { return true };
        let bounds = format!("must be greater than {:e} and at most {LARGEST:e}", 1.0 / LARGEST);
        let allowed = if x > 0.0 { &bounds } else { "must be finite and > 0" };
        self.require(sensible(x) && x > 1.0 / LARGEST, path, Number(x), allowed)
    }

    /// Checks that a number has a sensible size and is ≥ 0.
    pub(crate) fn not_negative(&mut self, path: &str, x: f64) -> bool {
        let is_number = self.number(path, x);
        self.require(x >= 0.0, path, Number(x), "must be ≥ 0") && is_number
    }

    /// Checks that a number lies between two numbers, both allowed.
    pub(crate) fn between(&mut self, path: &str, x: impl Into<Option<f64>>, min: f64, max: f64) -> bool {
        let Some(x) = x.into() else { return true };
        let ok = x >= min && x <= max;
        self.require(ok, path, Number(x), format_args!("must lie between {} and {}", Number(min), Number(max)))
    }

    /// Checks that a whole number lies between two numbers, both allowed.
    pub(crate) fn whole(&mut self, path: &str, n: u32, min: u32, max: u32) {
        self.require((min..=max).contains(&n), path, n, format_args!("must be a whole number from {min} to {max}"));
    }

    /// Checks that a list has 1 to `most` entries.
    pub(crate) fn one_to<T>(&mut self, most: usize, path: &str, list: &[T]) -> bool {
        let ok = (1..=most).contains(&list.len());
        self.require(ok, path, format_args!("a list of {}", list.len()), format_args!("must have 1 to {most} entries"))
    }

    /// Checks the length of a list. A list that is too long is returned empty, so that its entries are not checked.
    pub(crate) fn few<'a, T>(&mut self, path: &str, list: &'a [T]) -> &'a [T] {
        let ok = list.len() <= MOST;
        let allowed = format_args!("must have at most {MOST} entries");
        self.require(ok, path, format_args!("a list of {}", list.len()), allowed);
        if ok { list } else { &[] }
    }

    /// Checks that a vector has one number of sensible size per dimension.
    pub(crate) fn vector(&mut self, path: &str, x: &[f64], dimension: usize) -> bool {
        let mut ok = self.length(path, x.len(), dimension);
        for (k, &component) in x.iter().enumerate().take(3) {
            ok &= self.number(&format!("{path}[{k}]"), component);
        }
        ok
    }

    /// Checks that there is one entry per dimension.
    pub(crate) fn length(&mut self, path: &str, entries: usize, dimension: usize) -> bool {
        let allowed = format_args!("must have {dimension} components, as many as grid.size");
        self.require(entries == dimension, path, format_args!("a vector of length {entries}"), allowed)
    }
}

impl Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list: Vec<String> = self.list.iter().map(ToString::to_string).collect();
        f.write_str(&list.join("\n"))?;
        if self.more > 0 { write!(f, "\n… and {} more", self.more) } else { Ok(()) }
    }
}

/// Whether a number is finite and small enough to be squared.
pub(crate) fn sensible(x: f64) -> bool {
    x.abs() <= LARGEST
}

/// A number as a user would write it.
pub(crate) struct Number(pub f64);

impl Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        if size != 0.0 && !(1e-4..1e6).contains(&size) { write!(f, "{:e}", self.0) } else { write!(f, "{}", self.0) }
    }
}
