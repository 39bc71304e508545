//! Tables of comma-separated values with a header line, that grow row by row.

use super::OutputError;
use super::files::{Stream, Written};
use std::collections::HashSet;
use std::fmt::Write;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// A table on disk.
#[derive(Debug)]
pub(crate) struct Table(pub(crate) Stream);

impl Table {
    /// Creates the file and writes the header, or continues a file after its first `kept` bytes.
    ///
    /// # Errors
    /// The operating system refuses, two columns have the same name, or the file to be continued has other columns.
    pub(crate) fn open(path: PathBuf, columns: &[String], kept: Option<Written>) -> Result<Self, OutputError> {
        let mut seen = HashSet::new();
        if let Some(column) = columns.iter().find(|&column| !seen.insert(column)) {
            return Err(OutputError::DuplicateColumn { path, column: column.clone() });
        }
        let header = columns.iter().map(|name| quoted(name)).collect::<Vec<_>>().join(",");
        if kept.is_some() && first_line(&path).map_err(OutputError::io("continue", &path))? != header {
            return Err(OutputError::OtherColumns { path });
        }
        let mut stream = Stream::open(path, kept)?;
        if kept.is_none() {
            stream.line(&header)?;
            stream.flush()?;
        }
        Ok(Self(stream))
    }

    /// Appends a row.
    pub(crate) fn row(&mut self, row: &Row) -> Result<(), OutputError> {
        self.0.line(&row.0)
    }
}

fn first_line(path: &Path) -> std::io::Result<String> {
    let mut line = String::new();
    BufReader::new(File::open(path)?).read_line(&mut line)?;
    Ok(line.trim_end().to_owned())
}

/// A name as a cell. A name that would break the row stands in quotes (RFC 4180).
fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) { format!("\"{}\"", name.replace('"', "\"\"")) } else { name.to_owned() }
}

/// A row of numbers.
#[derive(Debug, Default)]
pub(crate) struct Row(String);

impl Row {
    /// Appends a cell. A float gets the fewest digits that read back as the same bits. NaN and infinities are written as `NaN` and `inf`.
    pub(crate) fn push(&mut self, cell: impl std::fmt::Debug) {
        if !self.0.is_empty() {
            self.0.push(',');
        }
        // Writing to a string cannot fail.
        let _ = write!(self.0, "{cell:?}");
    }

    /// Appends several cells.
    pub(crate) fn extend(&mut self, cells: impl IntoIterator<Item = f64>) {
        cells.into_iter().for_each(|cell| self.push(cell));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn floats_read_back_as_the_same_bits(bits in any::<u64>()) {
            let x = f64::from_bits(bits);
            let mut row = Row::default();
            row.push(x);
            let back: f64 = row.0.parse()?;
            prop_assert!(back.to_bits() == bits || (x.is_nan() && back.is_nan()));
        }
    }

    #[test]
    fn names_cannot_break_a_table() -> Result<(), Box<dyn std::error::Error>> {
        let directory = tempfile::tempdir()?;
        let path = directory.path().join("t.csv");
        let mut table = Table::open(path.clone(), &["left, \"low\"_x".to_owned(), "time".to_owned()], None)?;
        table.0.flush()?;
        assert_eq!(std::fs::read_to_string(&path)?, "\"left, \"\"low\"\"_x\",time\n");
        let twice = Table::open(path, &["a".to_owned(), "a".to_owned()], None);
        assert!(matches!(twice, Err(OutputError::DuplicateColumn { column, .. }) if column == "a"));
        Ok(())
    }
}
