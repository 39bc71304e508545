//! What a check hands back: a titled table of cells, each a value, a bound and a verdict.

use crate::table::{Table, csv_field};
use serde::{Serialize, Serializer};
use std::fmt;
use std::io::{self, Write};

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
            Self::AtLeast(low) => low / value,
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

/// One measured value.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// What was measured: one label for each column of the report.
    pub labels: Vec<String>,
    /// The value.
    pub value: f64,
    /// What it must satisfy.
    pub bound: Bound,
}

impl Cell {
    /// Whether the value satisfies the bound.
    pub fn passed(&self) -> bool {
        self.bound.holds(self.value)
    }

    /// The labels in one line.
    pub fn name(&self) -> String {
        self.labels.join(", ")
    }
}

/// How a report prints. Cells that fail are always listed, each by itself.
#[derive(Clone, Debug)]
enum Layout {
    /// Every cell on a line.
    List,
    /// The worst cell of each place in a matrix: a row for each combination of labels, a column for each label of one kind.
    Matrix { rows: Vec<usize>, column: usize, attained: usize },
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

    /// Prints the worst cell of each place in a matrix, with the label in column `attained` that attains it: rows by the labels in
    /// `rows`, columns by those in `column` (numbers of columns). What is no column of this report is left out.
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
        self.cells.push(Cell { labels, value, bound });
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

    /// Whether every cell passes, and there is at least one.
    pub fn passed(&self) -> bool {
        !self.cells.is_empty() && self.failures().next().is_none()
    }

    /// The cell closest to its bound, or furthest beyond it.
    pub fn worst(&self) -> Option<&Cell> {
        worst(self.cells.iter())
    }

    /// One sentence: the verdict, how many cells, and the worst of them.
    pub fn verdict(&self) -> String {
        let failed = self.failures().count();
        let Some(cell) = self.worst() else { return format!("FAIL  {}: nothing was measured", self.title) };
        let (name, value, bound) = (cell.name(), short(cell.value), cell.bound);
        let count = self.cells.len();
        if failed == 0 {
            format!("PASS  {}: {count} cells; closest to its bound: {name}: {value} ({bound})", self.title)
        } else {
            format!("FAIL  {}: {failed} of {count} cells; worst: {name}: {value} ({bound})", self.title)
        }
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
            writeln!(out, "{:e},{},{}", cell.value, csv_field(&cell.bound.to_string()), verdict(cell))?;
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
            let numbers = [short(cell.value), cell.bound.to_string(), verdict(cell).into()];
            table.push(cell.labels.iter().cloned().chain(numbers));
        }
        table
    }

    fn matrix(&self, rows: &[usize], column: usize, attained: usize) -> Table {
        let across = in_order(self.cells.iter().map(|cell| cell.labels[column].clone()));
        let row_of = |cell: &Cell| rows.iter().map(|&k| cell.labels[k].clone()).collect::<Vec<_>>();
        let header = rows.iter().map(|&k| self.columns[k].as_str()).chain(across.iter().map(String::as_str));
        let mut table = Table::new(&self.title, header);
        for row in in_order(self.cells.iter().map(row_of)) {
            let places = across.iter().map(|label| {
                let here = self.cells.iter().filter(|cell| row_of(cell) == row && cell.labels[column] == *label);
                worst(here).map_or_else(
                    || "-".into(),
                    |cell| {
                        let mark = if cell.passed() { "" } else { " FAIL" };
                        format!("{} {} {}{mark}", short(cell.value), cell.bound, cell.labels[attained])
                    },
                )
            });
            table.push(row.clone().into_iter().chain(places));
        }
        table
    }
}

/// The cell closest to its bound, the first of equals.
fn worst<'a>(cells: impl Iterator<Item = &'a Cell>) -> Option<&'a Cell> {
    cells.fold(None, |worst: Option<&Cell>, cell| match worst {
        Some(worst) if worst.bound.used(worst.value) >= cell.bound.used(cell.value) => Some(worst),
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

fn verdict(cell: &Cell) -> &'static str {
    match (cell.passed(), cell.bound) {
        (false, _) => "FAIL",
        (true, Bound::Reported) => "-",
        (true, _) => "ok",
    }
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
