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

    /// The forces in `contacts.csv`, whose rows are those of pairs in contact, in columns "first and second_x", …: a row for each time of
    /// this table, and zeros without contact.
    pub(super) fn of_pairs(&self, path: PathBuf) -> Result<Self, OutputError> {
        let times: Vec<f64> = self.pairs("time", "time")?.into_iter().map(|point| point.0).collect();
        let text = std::fs::read_to_string(&path).map_err(OutputError::io("read", &path))?;
        let mut lines = text.rsplit_once('\n').map_or("", |(whole, _)| whole).lines();
        let header = names(lines.next().unwrap_or_default());
        let axes: Vec<usize> = (0..header.len()).filter(|&k| ["x", "y", "z"].contains(&header[k].as_str())).collect();
        let (mut of_columns, mut columns) = (vec!["time".to_owned()], vec![times.clone()]);
        for (k, line) in lines.enumerate() {
            let cells = names(line);
            let number = |place: usize| {
                let what = || format!("has no number in cell {} of line {}", place + 1, k + 2);
                let number = cells.get(place).and_then(|cell| cell.parse::<f64>().ok());
                number.ok_or_else(|| OutputError::content(&path, what()))
            };
            let [_, first, second, ..] = cells.as_slice() else { continue };
            let time = number(0)?;
            let row = times.partition_point(|earlier| *earlier < time);
            for &axis in axes.iter().filter(|_| row < times.len()) {
                let name = format!("{first} and {second}_{}", header[axis]);
                let place = of_columns.iter().position(|one| *one == name).unwrap_or_else(|| {
                    of_columns.push(name);
                    columns.push(vec![0.0; times.len()]);
                    columns.len() - 1
                });
                columns[place][row] = number(axis)?;
            }
        }
        let cells = (0..times.len()).flat_map(|row| columns.iter().map(move |column| column[row])).collect();
        Ok(Self { path, names: of_columns, cells })
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
    fn forces_of_pairs_are_zero_without_contact() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("contacts.csv");
        let rows = "time,first,second,x,y,area\n1,\"a, b\",c,5,6,1\n2,c,d,7,8,1\n2,\"a, b\",c,9,10,1\n4,c,d,1,1,1\n";
        std::fs::write(&path, rows)?;
        let times = Columns { path: path.clone(), names: vec!["time".into()], cells: vec![0.0, 1.0, 2.0, 3.0] };
        let table = times.of_pairs(path.clone())?;
        assert_eq!(table.names, ["time", "a, b and c_x", "a, b and c_y", "c and d_x", "c and d_y"]);
        let of =
            |name: &str| Ok::<_, OutputError>(table.pairs("time", name)?.into_iter().map(|point| point.1).collect());
        let (first, second): (Vec<f64>, Vec<f64>) = (of("a, b and c_y")?, of("c and d_x")?);
        assert_eq!((first, second), (vec![0.0, 6.0, 10.0, 0.0], vec![0.0, 0.0, 7.0, 0.0]));
        std::fs::write(&path, "time,first,second,x\n1,a,b,high\n")?;
        let wrong = times.of_pairs(path).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(wrong.contains("no number in cell 4 of line 2"), "{wrong}");
        Ok(())
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
