//! Tables of comma-separated values with a header line, that grow row by row.

use super::OutputError;
use super::files::{Stream, Written};
use std::collections::HashSet;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;

/// A row: every cell with the name of its column.
pub(crate) type Row = Vec<(String, String)>;

/// A number as a cell. A float gets the fewest digits that read back as the same bits. NaN and infinities are written as `NaN` and `inf`.
pub(crate) fn cell(number: impl std::fmt::Debug) -> String {
    format!("{number:?}")
}

/// A name as a cell, in quotes where it has commas, quotes or line breaks (RFC 4180).
pub(crate) fn text(name: &str) -> String {
    let quoted = name.contains([',', '"', '\n', '\r']);
    if quoted { format!("\"{}\"", name.replace('"', "\"\"")) } else { name.to_owned() }
}

/// A table on disk.
#[derive(Debug)]
pub(crate) struct Table(pub(crate) Stream);

impl Table {
    /// Creates the file with the columns of `row` as its header, or continues a file after its first `kept` bytes.
    ///
    /// # Errors
    /// The operating system refuses, two columns have the same name, or the file to be continued has other columns.
    pub(crate) fn open(path: PathBuf, row: &Row, kept: Option<Written>) -> Result<Self, OutputError> {
        let mut seen = HashSet::new();
        if let Some((column, _)) = row.iter().find(|(column, _)| !seen.insert(column)) {
            return Err(OutputError::DuplicateColumn { path, column: column.clone() });
        }
        let header = row.iter().map(|(name, _)| text(name)).collect::<Vec<_>>().join(",");
        if kept.is_some() {
            let mut line = String::new();
            let file = File::open(&path).and_then(|file| BufReader::new(file).read_line(&mut line));
            file.map_err(OutputError::io("continue", &path))?;
            if line.trim_end() != header {
                return Err(OutputError::content(&path, "has other columns than this run, so it cannot be continued"));
            }
        }
        let mut stream = Stream::open(path, kept)?;
        if kept.is_none() {
            stream.line(&header)?;
            stream.flush()?;
        }
        Ok(Self(stream))
    }

    /// Appends a row.
    pub(crate) fn write(&mut self, row: &Row) -> Result<(), OutputError> {
        self.0.line(&row.iter().map(|(_, cell)| cell.as_str()).collect::<Vec<_>>().join(","))
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
            let back: f64 = cell(x).parse()?;
            prop_assert!(back.to_bits() == bits || (x.is_nan() && back.is_nan()));
        }
    }

    #[test]
    fn names_cannot_break_a_table() -> Result<(), Box<dyn std::error::Error>> {
        let directory = tempfile::tempdir()?;
        let path = directory.path().join("t.csv");
        let row = |names: [&str; 2]| names.map(|name| (name.to_owned(), cell(0.0))).to_vec();
        let mut table = Table::open(path.clone(), &row(["left, \"low\"_x", "time"]), None)?;
        table.0.flush()?;
        assert_eq!(std::fs::read_to_string(&path)?, "\"left, \"\"low\"\"_x\",time\n");
        let twice = Table::open(path, &row(["a", "a"]), None);
        assert!(matches!(twice, Err(OutputError::DuplicateColumn { column, .. }) if column == "a"));
        Ok(())
    }
}
