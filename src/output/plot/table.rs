//! Columns of numbers from a table written by this crate.

use crate::output::OutputError;
use std::path::PathBuf;

/// A table in memory.
pub(super) struct Columns {
    path: PathBuf,
    /// The names of all columns.
    pub(super) names: Vec<String>,
    /// Cells, row by row.
    cells: Vec<f64>,
}

impl Columns {
    /// Reads a table. An incomplete last line, as a killed run may leave it, is dropped.
    pub(super) fn read(path: PathBuf) -> Result<Self, OutputError> {
        let text = std::fs::read_to_string(&path).map_err(OutputError::io("read", &path))?;
        // After the last line break there is nothing, or an incomplete line.
        let whole = text.rsplit_once('\n').map_or("", |(whole, _)| whole);
        let mut lines = whole.lines();
        let names = names(lines.next().unwrap_or_default());
        let mut cells = Vec::new();
        for (k, line) in lines.enumerate() {
            for cell in line.split(',') {
                let wrong =
                    |_| OutputError::content(&path, format!("has {cell:?} in line {}, which is not a number", k + 2));
                cells.push(cell.parse().map_err(wrong)?);
            }
            if cells.len() != (k + 1) * names.len() {
                let what = format!("has another number of cells in line {} than columns: {line:?}", k + 2);
                return Err(OutputError::content(&path, what));
            }
        }
        Ok(Self { path, names, cells })
    }

    /// Whether there is a column of this name.
    pub(super) fn has(&self, column: &str) -> bool {
        self.names.iter().any(|name| name == column)
    }

    /// The pairs (x, y) of two columns.
    pub(super) fn pairs(&self, x: &str, y: &str) -> Result<Vec<(f64, f64)>, OutputError> {
        let find = |column: &str| {
            let place = self.names.iter().position(|name| name == column);
            place.ok_or_else(|| OutputError::content(&self.path, format!("has no column {column:?}")))
        };
        let (x, y) = (find(x)?, find(y)?);
        Ok(self.cells.chunks(self.names.len()).map(|row| (row[x], row[y])).collect())
    }
}

/// The cells of a header. Some cells may stand in quotes (RFC 4180).
fn names(header: &str) -> Vec<String> {
    let mut names = vec![String::new()];
    let mut quoted = false;
    let mut letters = header.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            // Two quotes in a quoted name mean one quote.
            '"' if quoted && letters.next_if_eq(&'"').is_some() => {
                names.last_mut().into_iter().for_each(|name| name.push('"'))
            }
            '"' => quoted = !quoted,
            ',' if !quoted => names.push(String::new()),
            letter => names.last_mut().into_iter().for_each(|name| name.push(letter)),
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_with_commas_and_quotes_are_one_cell() {
        assert_eq!(names(r#"time,"left, ""low""_x",wall_x"#), ["time", r#"left, "low"_x"#, "wall_x"]);
    }

    #[test]
    fn a_row_that_breaks_off_is_dropped_and_a_damaged_one_refused() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("t.csv");
        std::fs::write(&path, "time,a\n0,1\n1,NaN\n2,")?;
        let table = Columns::read(path.clone())?;
        assert_eq!(table.pairs("time", "a")?.len(), 2);
        assert!(table.pairs("time", "b").is_err());
        std::fs::write(&path, "time,a\n0,1,2\n")?;
        assert!(Columns::read(path).is_err());
        Ok(())
    }
}
