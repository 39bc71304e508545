//! What a check hands back: a titled table of cells, each a value, a bound and a verdict.
//!
//! Shown is not passed: a cell without a bound is counted apart, and so is one that is known to fail.

use crate::table::{Table, csv_field};
use serde::{Serialize, Serializer};
use std::collections::HashMap;
use std::fmt;
use std::io::{self, Write};
use std::sync::{PoisonError, RwLock};

/// What a value must satisfy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// Not more than this.
    AtMost(f64),
    /// Not less than this.
    AtLeast(f64),
    /// Not less than the first, not more than the second.
    Between(f64, f64),
    /// Finite; shown, and otherwise not judged.
    Reported,
}

impl Bound {
    /// Whether `value` is within; NaN never is.
    pub fn holds(&self, value: f64) -> bool {
        match *self {
            Self::AtMost(high) => value <= high,
            Self::AtLeast(low) => value >= low,
            Self::Between(low, high) => value >= low && value <= high,
            Self::Reported => value.is_finite(),
        }
    }

    /// How much of the bound is used up: 1 at the bound, more beyond it, infinite for NaN.
    fn used(&self, value: f64) -> f64 {
        let used = match *self {
            // A bound of zero is met by zero alone.
            Self::AtMost(high) => {
                if value == 0.0 {
                    0.0
                } else {
                    value / high
                }
            }
            Self::AtLeast(low) if value > 0.0 => low / value,
            // Of what is not positive there is no ratio.
            Self::AtLeast(low) => {
                if value >= low {
                    0.0
                } else {
                    f64::INFINITY
                }
            }
            Self::Between(low, high) => (2.0 * value - low - high).abs() / (high - low),
            Self::Reported => {
                if value.is_finite() {
                    0.0
                } else {
                    f64::INFINITY
                }
            }
        };
        if used.is_nan() { f64::INFINITY } else { used }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AtMost(high) => write!(f, "<= {}", short(*high)),
            Self::AtLeast(low) => write!(f, ">= {}", short(*low)),
            Self::Between(low, high) => write!(f, "{} .. {}", short(*low), short(*high)),
            Self::Reported => write!(f, "-"),
        }
    }
}

impl Serialize for Bound {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// A number in as few characters as tell what matters.
pub fn short(x: f64) -> String {
    if x == 0.0 {
        "0".into()
    } else if (0.01..1e4).contains(&x.abs()) {
        let text = format!("{x:.4}");
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        format!("{x:.1e}")
    }
}

/// What the list of known failures says of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Listed {
    /// The value measured when it was listed.
    pub value: f64,
    /// A value that misses the bound so many times further is a new failure.
    pub factor: f64,
    /// Whether seconds decide: on a busy machine their scatter is wider, and the cell may pass.
    pub timed: bool,
}

/// What is to be said of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Judged, and within its bound.
    Met,
    /// Not judged.
    Shown,
    /// Beyond its bound, and on the list of known failures with about this value.
    Known,
    /// Beyond its bound; or on the list of known failures and within its bound again, or much worse.
    Failed,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Met => "ok",
            Self::Shown => "-",
            Self::Known => "known failure",
            Self::Failed => "FAIL",
        })
    }
}

/// One measured value.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// What was measured: one label for each column of the report.
    pub labels: Vec<String>,
    /// The value.
    pub value: f64,
    /// What it must satisfy.
    pub bound: Bound,
    /// Its entry in the list of known failures.
    pub listed: Option<Listed>,
}

impl Cell {
    /// The verdict.
    pub fn verdict(&self) -> Verdict {
        let holds = self.bound.holds(self.value);
        match self.listed {
            None if !holds => Verdict::Failed,
            None if self.bound == Bound::Reported => Verdict::Shown,
            None => Verdict::Met,
            Some(listed) => {
                let allowed = listed.factor * self.bound.used(listed.value);
                if holds && listed.timed {
                    return Verdict::Met;
                }
                if !holds && self.bound.used(self.value) <= allowed { Verdict::Known } else { Verdict::Failed }
            }
        }
    }

    /// Whether it does not fail.
    pub fn passed(&self) -> bool {
        self.verdict() != Verdict::Failed
    }

    /// Value and bound, and what the list of known failures says.
    pub fn finding(&self) -> String {
        let found = format!("{} ({})", short(self.value), self.bound);
        match self.listed {
            None => found,
            Some(listed) => {
                let said = format!("{found}, known to fail with {}", short(listed.value));
                match self.verdict() {
                    Verdict::Failed if self.bound.holds(self.value) => {
                        format!("{said}, and passes: take it off the list")
                    }
                    Verdict::Failed => format!("{said}, and more than {} times worse", short(listed.factor)),
                    _ => said,
                }
            }
        }
    }

    /// The labels in one line.
    pub fn name(&self) -> String {
        self.labels.join(", ")
    }
}

/// How many cells there are of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// With a bound, met or not; without known failures.
    pub judged: usize,
    /// Without a bound.
    pub shown: usize,
    /// Known failures.
    pub known: usize,
    /// Of those judged, the ones that fail.
    pub failed: usize,
}

impl Counts {
    fn of<'a>(cells: impl Iterator<Item = &'a Cell>) -> Self {
        cells.fold(Self::default(), |mut counts, cell| {
            match cell.verdict() {
                Verdict::Met => counts.judged += 1,
                Verdict::Shown => counts.shown += 1,
                Verdict::Known => counts.known += 1,
                Verdict::Failed => (counts.judged, counts.failed) = (counts.judged + 1, counts.failed + 1),
            }
            counts
        })
    }
}

impl std::iter::Sum for Counts {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |a, b| Self {
            judged: a.judged + b.judged,
            shown: a.shown + b.shown,
            known: a.known + b.known,
            failed: a.failed + b.failed,
        })
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.failed > 0 {
            write!(f, "{} of ", self.failed)?;
        }
        write!(f, "{} judged", self.judged)?;
        if self.failed > 0 {
            write!(f, " failed")?;
        }
        if self.shown > 0 {
            write!(f, ", {} shown", self.shown)?;
        }
        match self.known {
            0 => Ok(()),
            1 => write!(f, ", 1 known failure"),
            known => write!(f, ", {known} known failures"),
        }
    }
}

/// How a report prints. Cells that fail, known or not, are always listed, each by itself.
#[derive(Clone, Debug)]
enum Layout {
    /// Every cell on a line.
    List,
    /// The worst cell of each place in a matrix: a row for each combination of labels, a column for each label of one
    /// kind.
    Matrix { rows: Vec<usize>, column: usize, attained: usize },
}

/// Whether a cell with these labels may fail and not end the program.
type Spared = fn(&[String]) -> bool;

/// `None`: all are spared.
static SPARED: RwLock<Option<Spared>> = RwLock::new(None);

/// From now on the first cell that fails ends the program with exit code 1, unless its labels are `spared`; `None` takes that back.
pub fn stop_at_failures(spared: Option<Spared>) {
    *SPARED.write().unwrap_or_else(PoisonError::into_inner) = spared;
}

/// A titled table of cells.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    title: String,
    columns: Vec<String>,
    cells: Vec<Cell>,
    notes: Vec<String>,
    #[serde(skip)]
    layout: Layout,
}

impl Report {
    /// No cells yet; `columns` name the labels.
    pub fn new(title: impl Into<String>, columns: &[&str]) -> Self {
        Self {
            title: title.into(),
            columns: columns.iter().map(|&column| column.into()).collect(),
            cells: Vec::new(),
            notes: Vec::new(),
            layout: Layout::List,
        }
    }

    /// Prints the worst cell of each place in a matrix, with the label in column `attained` that attains it: rows by
    /// the labels in `rows`, columns by those in `column` (numbers of columns). What is no column of this report is
    /// left out.
    #[must_use]
    pub fn as_matrix(mut self, rows: &[usize], column: usize, attained: usize) -> Self {
        let known = |column: &usize| *column < self.columns.len();
        if known(&column) && known(&attained) {
            self.layout = Layout::Matrix { rows: rows.iter().copied().filter(known).collect(), column, attained };
        }
        self
    }

    /// Adds a cell; there should be one label for each column, and missing ones are empty.
    pub fn push(&mut self, labels: &[&str], value: f64, bound: Bound) {
        let labels = (0..self.columns.len()).map(|k| labels.get(k).map_or_else(String::new, |&l| l.into())).collect();
        let cell = Cell { labels, value, bound, listed: None };
        let spared = *SPARED.read().unwrap_or_else(PoisonError::into_inner);
        if !cell.passed() && spared.is_some_and(|spared| !spared(&cell.labels)) {
            eprintln!("FAIL  {}: {}: {}", self.title, cell.name(), cell.finding());
            std::process::exit(1);
        }
        self.cells.push(cell);
    }

    /// Marks the worst of the cells whose labels begin with `labels`, which may be several samples, as known to fail, and says how many
    /// are marked.
    pub fn list_known(&mut self, labels: &[&str], listed: Listed) -> usize {
        let named =
            |cell: &&mut Cell| cell.labels.iter().map(String::as_str).take(labels.len()).eq(labels.iter().copied());
        let used = |cell: &&mut Cell| cell.bound.used(cell.value);
        let worst = self.cells.iter_mut().filter(named).max_by(|a, b| used(a).total_cmp(&used(b)));
        worst.map(|cell| cell.listed = Some(listed)).into_iter().count()
    }

    /// Adds a cell that could not be measured, and why: it fails.
    pub fn push_error(&mut self, labels: &[&str], error: &dyn std::error::Error) {
        self.push(labels, f64::NAN, Bound::AtMost(0.0));
        self.note(format!("{}: {}", labels.join(", "), chain(error)));
    }

    /// Adds a sentence to print below the table.
    pub fn note(&mut self, text: impl Into<String>) {
        self.notes.push(text.into());
    }

    /// The title.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// All cells, in the order they were measured.
    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// The cells that fail.
    pub fn failures(&self) -> impl Iterator<Item = &Cell> {
        self.cells.iter().filter(|cell| !cell.passed())
    }

    /// The cells that are known to fail, and do.
    pub fn known_failures(&self) -> impl Iterator<Item = &Cell> {
        self.cells.iter().filter(|cell| cell.verdict() == Verdict::Known)
    }

    /// How many cells are judged, shown, known to fail.
    pub fn counts(&self) -> Counts {
        Counts::of(self.cells.iter())
    }

    /// Whether something is judged, and no cell fails.
    pub fn passed(&self) -> bool {
        let counts = self.counts();
        counts.judged > 0 && counts.failed == 0
    }

    /// Of the cells that are judged the one closest to its bound, or furthest beyond it.
    pub fn worst(&self) -> Option<&Cell> {
        worst(self.cells.iter().filter(|cell| matches!(cell.verdict(), Verdict::Met | Verdict::Failed)))
    }

    /// One sentence: the verdict, how many cells are judged and how many shown, and the worst of them.
    pub fn verdict(&self) -> String {
        let counts = self.counts();
        let Some(cell) = self.worst() else { return format!("FAIL  {}: nothing is judged; {counts}", self.title) };
        let (word, place) = if self.passed() { ("PASS", "closest to its bound") } else { ("FAIL", "worst") };
        format!("{word}  {}: {counts}; {place}: {}: {}", self.title, cell.name(), cell.finding())
    }

    /// Every cell as comma-separated values, with a header.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_csv(&self, out: &mut impl Write) -> io::Result<()> {
        for column in &self.columns {
            write!(out, "{},", csv_field(column))?;
        }
        writeln!(out, "value,bound,verdict")?;
        for cell in &self.cells {
            for label in &cell.labels {
                write!(out, "{},", csv_field(label))?;
            }
            writeln!(out, "{:e},{},{}", cell.value, csv_field(&cell.bound.to_string()), cell.verdict())?;
        }
        Ok(())
    }

    /// Every cell in a table as Markdown, the notes, and the verdict.
    pub fn markdown(&self) -> String {
        let notes: String = self.notes.iter().map(|note| format!("{note}\n\n")).collect();
        format!("{}\n{notes}{}\n", self.list(&self.title, self.cells.iter()).markdown(), self.verdict())
    }

    fn list<'a>(&'a self, title: &str, cells: impl Iterator<Item = &'a Cell>) -> Table {
        let header = self.columns.iter().map(String::as_str).chain(["value", "bound", "verdict"]);
        let mut table = Table::new(title, header);
        for cell in cells {
            let numbers = [short(cell.value), cell.bound.to_string(), cell.verdict().to_string()];
            table.push(cell.labels.iter().cloned().chain(numbers));
        }
        table
    }

    fn matrix(&self, rows: &[usize], column: usize, attained: usize) -> Table {
        let across = in_order(self.cells.iter().map(|cell| cell.labels[column].as_str()));
        let header = rows.iter().map(|&k| self.columns[k].as_str()).chain(across.iter().copied());
        let mut table = Table::new(&self.title, header);
        // Rows in the order of their first appearance: a sweep has hundreds of them, and hundreds of thousands of cells.
        let (mut row_of, mut all) = (HashMap::new(), Vec::new());
        for cell in &self.cells {
            let labels: Vec<&str> = rows.iter().map(|&k| cell.labels[k].as_str()).collect();
            let row = *row_of.entry(labels.clone()).or_insert(all.len());
            if row == all.len() {
                all.push((labels, HashMap::<&str, Vec<&Cell>>::new()));
            }
            all[row].1.entry(&cell.labels[column]).or_default().push(cell);
        }
        for (labels, places) in all {
            let places = across.iter().map(|label| {
                let here = places.get(label).into_iter().flatten().copied();
                worst(here).map_or_else(
                    || "-".into(),
                    |cell| {
                        let found = format!("{} {} {}", short(cell.value), cell.bound, cell.labels[attained]);
                        match cell.verdict() {
                            Verdict::Met | Verdict::Shown => found,
                            verdict => format!("{found} {verdict}"),
                        }
                    },
                )
            });
            table.push(labels.into_iter().map(str::to_owned).chain(places));
        }
        table
    }
}

/// The cell closest to its bound, the first of equals.
pub(crate) fn worst<'a>(cells: impl Iterator<Item = &'a Cell>) -> Option<&'a Cell> {
    // A known failure that passes again is a failure, however far within its bound.
    let badness = |cell: &Cell| (cell.verdict() == Verdict::Failed, cell.bound.used(cell.value));
    cells.fold(None, |worst: Option<&Cell>, cell| match worst {
        Some(worst) if badness(worst) >= badness(cell) => Some(worst),
        _ => Some(cell),
    })
}

/// Different items in the order of their first appearance.
fn in_order<T: PartialEq>(items: impl Iterator<Item = T>) -> Vec<T> {
    items.fold(Vec::new(), |mut seen, item| {
        if !seen.contains(&item) {
            seen.push(item);
        }
        seen
    })
}

/// An error with its causes.
pub fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text.push_str(": ");
        text.push_str(&cause.to_string());
        source = cause.source();
    }
    text
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.layout {
            Layout::List => write!(f, "{}", self.list(&self.title, self.cells.iter()))?,
            Layout::Matrix { rows, column, attained } => {
                write!(f, "{}", self.matrix(rows, *column, *attained))?;
                if self.failures().next().is_some() {
                    write!(f, "{}", self.list("cells that fail", self.failures()))?;
                }
                if self.known_failures().next().is_some() {
                    write!(f, "{}", self.list("known failures", self.known_failures()))?;
                }
            }
        }
        for note in &self.notes {
            writeln!(f, "  {note}")?;
        }
        writeln!(f, "{}", self.verdict())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_measured_and_not_a_number_both_fail() {
        let mut report = Report::new("empty", &["what"]);
        assert!(!report.passed());
        report.push(&["a"], 0.0, Bound::AtMost(0.0));
        assert!(report.passed());
        report.push(&["b"], f64::NAN, Bound::Reported);
        assert!(!report.passed());
        assert_eq!(report.worst().map(Cell::name), Some("b".into()));
        assert!(report.verdict().starts_with("FAIL"), "{}", report.verdict());
    }

    #[test]
    fn what_is_shown_is_not_passed() {
        let mut report = Report::new("shown", &["what"]);
        report.push(&["a"], 1.0, Bound::Reported);
        assert!(!report.passed());
        assert_eq!(report.verdict(), "FAIL  shown: nothing is judged; 0 judged, 1 shown");
        report.push(&["b"], 1.0, Bound::AtMost(2.0));
        assert!(report.passed());
        assert_eq!(report.verdict(), "PASS  shown: 1 judged, 1 shown; closest to its bound: b: 1 (<= 2)");
        report.push(&["c"], 3.0, Bound::AtMost(2.0));
        assert_eq!(report.verdict(), "FAIL  shown: 1 of 2 judged failed, 1 shown; worst: c: 3 (<= 2)");
    }

    /// A report of one cell that is met, and one of the value and bound given that is known to fail with 30, or 10
    /// times worse.
    fn known(value: f64, bound: Bound) -> Report {
        let mut report = Report::new("known", &["what", "where"]);
        report.push(&["a", "here"], 1.0, Bound::AtMost(2.0));
        report.push(&["b", "there"], value, bound);
        assert_eq!(report.list_known(&["b"], Listed { value: 30.0, factor: 10.0, timed: false }), 1);
        assert_eq!(report.list_known(&["c"], Listed { value: 30.0, factor: 10.0, timed: false }), 0);
        report
    }

    #[test]
    fn a_known_failure_is_counted_apart_until_it_passes_or_gets_worse() {
        let report = known(29.0, Bound::AtMost(2.0));
        assert!(report.passed());
        assert_eq!(report.counts(), Counts { judged: 1, shown: 0, known: 1, failed: 0 });
        assert!(report.to_string().contains("known failure"), "{report}");
        for (value, words) in [(1.0, "take it off the list"), (301.0, "10 times worse"), (f64::NAN, "10 times worse")] {
            let report = known(value, Bound::AtMost(2.0));
            assert!(!report.passed() && report.verdict().contains(words), "{report}");
        }
        // From below: 3 is ten times as far from 100 as 30.
        assert!(known(4.0, Bound::AtLeast(100.0)).passed());
        for worse in [2.0, 0.0, -1.0, 101.0] {
            assert!(!known(worse, Bound::AtLeast(100.0)).passed(), "{worse}");
        }
        // What is not judged cannot be known to fail.
        assert!(!known(29.0, Bound::Reported).passed());
    }

    #[test]
    fn a_matrix_shows_the_worst_of_each_place_and_lists_what_fails() {
        let mut report = Report::new("matrix", &["term", "regime", "shape"]).as_matrix(&[0], 1, 2);
        report.push(&["inertia", "small", "linear"], 1e-16, Bound::AtMost(1e-14));
        report.push(&["inertia", "small", "lme"], 3e-16, Bound::AtMost(1e-14));
        report.push(&["inertia", "large", "gimp"], 2e-3, Bound::AtMost(1e-14));
        let text = report.to_string();
        assert!(text.contains("3.0e-16 <= 1.0e-14 lme") && !text.contains("1.0e-16 <="), "{text}");
        assert!(text.contains("cells that fail") && text.contains("2.0e-3 <= 1.0e-14 gimp FAIL"), "{text}");
    }
}
