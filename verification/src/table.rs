//! A table of text, aligned when printed.

use serde::Serialize;
use std::fmt;

/// A titled table; shorter rows end early.
#[derive(Clone, Debug, Serialize)]
pub struct Table {
    title: String,
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows.
    pub fn new<S: Into<String>>(title: impl Into<String>, header: impl IntoIterator<Item = S>) -> Self {
        Self { title: title.into(), header: header.into_iter().map(Into::into).collect(), rows: Vec::new() }
    }

    /// Adds a row.
    pub fn push<S: Into<String>>(&mut self, row: impl IntoIterator<Item = S>) {
        self.rows.push(row.into_iter().map(Into::into).collect());
    }

    /// The title.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// The table as Markdown, with the title in bold above it.
    pub fn markdown(&self) -> String {
        let escaped =
            |row: &[String]| row.iter().map(|field| field.replace('|', "\\|")).collect::<Vec<_>>().join(" | ");
        let rule = vec!["---"; self.header.len()].join(" | ");
        let rows: String = self.rows.iter().map(|row| format!("| {} |\n", escaped(row))).collect();
        format!("**{}**\n\n| {} |\n| {rule} |\n{rows}", self.title, escaped(&self.header))
    }
}

/// Whether the text is a number, which is aligned to the right.
fn is_number(text: &str) -> bool {
    text.parse::<f64>().is_ok()
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |k: usize| {
            let fields = std::iter::once(&self.header).chain(&self.rows).filter_map(|row| row.get(k));
            fields.map(|field| field.chars().count()).max().unwrap_or(0)
        };
        let columns = std::iter::once(&self.header).chain(&self.rows).map(Vec::len).max().unwrap_or(0);
        let widths: Vec<_> = (0..columns).map(width).collect();
        writeln!(f, "\n{}", self.title)?;
        let line = |f: &mut fmt::Formatter<'_>, row: &[String]| {
            let mut text = String::new();
            for (field, &width) in row.iter().zip(&widths) {
                let pad = " ".repeat(width - field.chars().count().min(width));
                let (left, right) = if is_number(field) { (pad.as_str(), "") } else { ("", pad.as_str()) };
                text += &format!("  {left}{field}{right}");
            }
            writeln!(f, "{}", text.trim_end())
        };
        line(f, &self.header)?;
        let rule: Vec<_> = widths.iter().map(|&width| "-".repeat(width)).collect();
        line(f, &rule)?;
        for row in &self.rows {
            line(f, row)?;
        }
        Ok(())
    }
}
