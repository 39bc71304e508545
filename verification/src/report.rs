//! The result of a check: a titled table of cells, each with a value, a bound and a verdict.
//!
//! Shown is not passed: cells without a bound are counted separately, and so are known failures.

mod cell;

pub(crate) use cell::worst;
pub use cell::{Bound, Cell, Counts, Listed, Verdict, short};

use crate::table::Table;
use serde::Serialize;
use std::collections::HashMap;
use std::fmt;
use std::sync::{PoisonError, RwLock};

/// The printed form of a report. Failing cells, known or not, are always listed one by one.
#[derive(Clone, Debug)]
enum Layout {
    /// One line per cell.
    List,
    /// A matrix with the worst cell of each position: a row for each combination of labels, a column for each label of one kind.
    Matrix { rows: Vec<usize>, column: usize, attained: usize },
}

/// Whether a cell with these labels may fail without ending the program.
type Spared = fn(&[String]) -> bool;

/// `None`: every cell may fail.
static SPARED: RwLock<Option<Spared>> = RwLock::new(None);

/// From now on the first failing cell ends the program with exit code 1, unless its labels are `spared`. `None` restores the default.
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
    /// An empty report; `columns` name the labels.
    pub fn new(title: impl Into<String>, columns: &[&str]) -> Self {
        Self {
            title: title.into(),
            columns: columns.iter().map(|&column| column.into()).collect(),
            cells: Vec::new(),
            notes: Vec::new(),
            layout: Layout::List,
        }
    }

    /// Prints a matrix of the worst cells, each with the label in column `attained` that belongs to it. Rows are the labels in `rows`,
    /// columns the labels in `column` (numbers of columns). Numbers without a column in this report are ignored.
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

    /// Marks as a known failure the worst of the cells whose labels begin with `labels`; there may be several samples. Returns the number
    /// of marked cells.
    pub fn list_known(&mut self, labels: &[&str], listed: Listed) -> usize {
        let named =
            |cell: &&mut Cell| cell.labels.iter().map(String::as_str).take(labels.len()).eq(labels.iter().copied());
        let used = |cell: &&mut Cell| cell.bound.used(cell.value);
        let worst = self.cells.iter_mut().filter(named).max_by(|a, b| used(a).total_cmp(&used(b)));
        worst.map(|cell| cell.listed = Some(listed)).into_iter().count()
    }

    /// Adds a failing cell for a value that could not be measured, with the error.
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

    /// The known failures that still fail.
    pub fn known_failures(&self) -> impl Iterator<Item = &Cell> {
        self.cells.iter().filter(|cell| cell.verdict() == Verdict::Known)
    }

    /// The numbers of judged, shown and known failing cells.
    pub fn counts(&self) -> Counts {
        Counts::of(self.cells.iter())
    }

    /// Whether at least one cell is judged and no cell fails.
    pub fn passed(&self) -> bool {
        let counts = self.counts();
        counts.judged > 0 && counts.failed == 0
    }

    /// The judged cell that is closest to its bound, or furthest beyond it.
    pub fn worst(&self) -> Option<&Cell> {
        worst(self.cells.iter().filter(|cell| matches!(cell.verdict(), Verdict::Met | Verdict::Failed)))
    }

    /// One sentence: the verdict, the numbers of judged and shown cells, and the worst cell.
    pub fn verdict(&self) -> String {
        let counts = self.counts();
        let Some(cell) = self.worst() else { return format!("FAIL  {}: nothing is judged; {counts}", self.title) };
        let (word, place) = if self.passed() { ("PASS", "closest to its bound") } else { ("FAIL", "worst") };
        format!("{word}  {}: {counts}; {place}: {}: {}", self.title, cell.name(), cell.finding())
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
        // Rows keep the order of their first appearance. A sweep has hundreds of rows and hundreds of thousands of cells, so a map finds
        // the row.
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

/// Distinct items in the order of their first appearance.
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

    /// A report of one passing cell, and of one cell with this value and bound. The second is a known failure with the value 30 and the
    /// factor 10.
    fn known(value: f64, bound: Bound) -> Report {
        let mut report = Report::new("known", &["what", "where"]);
        report.push(&["a", "here"], 1.0, Bound::AtMost(2.0));
        report.push(&["b", "there"], value, bound);
        assert_eq!(report.list_known(&["b"], Listed { value: 30.0, factor: 10.0 }), 1);
        assert_eq!(report.list_known(&["c"], Listed { value: 30.0, factor: 10.0 }), 0);
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
        // For a lower bound: 3 is ten times as far from 100 as 30.
        assert!(known(4.0, Bound::AtLeast(100.0)).passed());
        for worse in [2.0, 0.0, -1.0, 101.0] {
            assert!(!known(worse, Bound::AtLeast(100.0)).passed(), "{worse}");
        }
        // A cell that is not judged cannot be a known failure.
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
