//! Columns of numbers from a table written by this crate.

use super::PlotError;
use std::path::PathBuf;

/// A table in memory.
pub(super) struct Columns {
    path: PathBuf,
    names: Vec<String>,
    /// Row after row.
    cells: Vec<f64>,
}

impl Columns {
    /// Reads a table whose header has no quotes. A last line that breaks off, as a killed run may leave it, is dropped.
    pub(super) fn read(path: PathBuf) -> Result<Self, PlotError> {
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(source) => return Err(PlotError::Read { path, source }),
        };
        // Behind the last line break stands nothing, or a line that breaks off.
        let whole = text.rsplit_once('\n').map_or("", |(whole, _)| whole);
        let mut lines = whole.lines();
        let names: Vec<String> = lines.next().unwrap_or_default().split(',').map(str::to_owned).collect();
        let mut cells = Vec::new();
        for (k, line) in lines.enumerate() {
            let damaged = |cell: &str| PlotError::Cell { path: path.clone(), line: k + 2, cell: cell.to_owned() };
            for cell in line.split(',') {
                cells.push(cell.parse().map_err(|_| damaged(cell))?);
            }
            if cells.len() != (k + 1) * names.len() {
                return Err(damaged(line));
            }
        }
        Ok(Self { path, names, cells })
    }

    /// Whether there is a column of this name.
    pub(super) fn has(&self, column: &str) -> bool {
        self.names.iter().any(|name| name == column)
    }

    /// The pairs (x, y) of two columns.
    pub(super) fn pairs(&self, x: &'static str, y: &'static str) -> Result<Vec<(f64, f64)>, PlotError> {
        let find = |column: &'static str| {
            let place = self.names.iter().position(|name| name == column);
            place.ok_or_else(|| PlotError::Column { path: self.path.clone(), column })
        };
        let (x, y) = (find(x)?, find(y)?);
        Ok(self.cells.chunks(self.names.len()).map(|row| (row[x], row[y])).collect())
    }
}
