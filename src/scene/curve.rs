//! Factors as functions of time, or of a coordinate.

use super::file::{FileError, open};
use crate::mechanics::loads::{self, CurveError, Sine};
use crate::problems::{Number, Problems};
use crc32fast::hash;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Largest number of bytes in the file of a curve.
const MAX_BYTES: u64 = 1 << 28;

/// A factor in time: rows `[t, factor]`, linear in between and constant outside, a sine, or the rows of a file.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Curve {
    /// Rows `[t, factor]`, linear in between and constant outside.
    Rows(Vec<[f64; 2]>),
    /// A curve of another kind.
    Of(OtherCurve),
}

/// A curve that is not given by rows.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OtherCurve {
    /// mean + amplitude · sin(2π frequency t + phase)
    Sine(Sine),
    /// A text file beside the scene with rows `t, factor`: two columns, separated by a comma or white space. A first line that is not of
    /// numbers is a header.
    File(CurveFile),
}

/// The file of a curve, relative to the scene's folder.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(from = "PathBuf", into = "PathBuf")]
#[schemars(with = "PathBuf")]
pub struct CurveFile {
    file: PathBuf,
    /// The rows, once the file has been read.
    rows: OnceLock<Vec<[f64; 2]>>,
}

impl From<PathBuf> for CurveFile {
    fn from(file: PathBuf) -> Self {
        Self { file, ..Self::default() }
    }
}

impl From<CurveFile> for PathBuf {
    fn from(of: CurveFile) -> Self {
        of.file
    }
}

impl CurveFile {
    /// Reads the file, unless it has been read.
    fn read(&self, folder: &Path) -> Result<(), FileError> {
        if self.rows.get().is_some() {
            return Ok(());
        }
        let (file, length) = open(&folder.join(&self.file))?;
        if length > MAX_BYTES {
            return Err(FileError(format!("has {length} bytes, and at most {MAX_BYTES} are allowed")));
        }
        let mut text = String::new();
        file.take(MAX_BYTES).read_to_string(&mut text)?;
        let rows = rows(&text)?;
        // Another thread may have read the same rows meanwhile.
        let _ = self.rows.set(rows);
        Ok(())
    }
}

/// The rows of a text with two columns.
fn rows(text: &str) -> Result<Vec<[f64; 2]>, FileError> {
    let mut rows = Vec::new();
    for (k, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let cells: Vec<&str> = line.split([',', ';', ' ', '\t']).filter(|cell| !cell.is_empty()).collect();
        let numbers: Option<Vec<f64>> = cells.iter().map(|cell| cell.parse().ok()).collect();
        match numbers.as_deref() {
            Some([]) => {}
            Some(&[t, x]) => rows.push([t, x]),
            None if k == 0 => {}
            _ => return Err(FileError(format!("line {}: {line:.40?} is not allowed; must be two numbers", k + 1))),
        }
    }
    Ok(rows)
}

impl Curve {
    pub(super) fn check(&self, problems: &mut Problems, path: &str) {
        match self {
            Self::Rows(rows) => check_rows(problems, path, rows),
            Self::Of(OtherCurve::Sine(sine)) => {
                let path = format!("{path}.sine");
                problems.positive(&format!("{path}.frequency"), sine.frequency);
                for (key, number) in [("amplitude", sine.amplitude), ("phase", sine.phase), ("mean", sine.mean)] {
                    problems.number(&format!("{path}.{key}"), number);
                }
            }
            Self::Of(OtherCurve::File(file)) => {
                if let Some(rows) = file.rows.get() {
                    check_rows(problems, &format!("{path}.file"), rows);
                }
            }
        }
    }

    /// Refuses a curve that is not 0 at t = 0. A file that has not been read passes.
    pub(super) fn check_start(&self, problems: &mut Problems, path: &str, what: &str) {
        let start = self.curve().map_or(0.0, |curve| curve.value(0.0));
        problems.require(start == 0.0, path, Number(start), format_args!("must be 0 at t = 0: {what} from the start"));
    }

    /// Whether the curve is not 0 throughout.
    pub(super) fn moves(&self) -> bool {
        match self {
            Self::Rows(rows) => rows.iter().any(|row| row[1] != 0.0),
            Self::Of(_) => true,
        }
    }

    fn file(&self) -> Option<&CurveFile> {
        if let Self::Of(OtherCurve::File(file)) = self { Some(file) } else { None }
    }

    /// Reads the file of the curve, if it has one.
    pub(super) fn read(&self, folder: &Path) -> Result<(), FileError> {
        self.file().map_or(Ok(()), |file| file.read(folder))
    }

    /// The checksum of a file that has been read.
    pub(super) fn checksum(&self) -> Option<u32> {
        Some(hash(bytemuck::cast_slice(self.file()?.rows.get()?)))
    }

    /// The curve.
    ///
    /// # Errors
    /// Rows that are no curve; none, if a file has not been read.
    pub(super) fn curve(&self) -> Result<loads::Curve, CurveError> {
        match self {
            Self::Rows(rows) => loads::Curve::new(rows.clone()),
            Self::Of(OtherCurve::File(file)) => loads::Curve::new(file.rows.get().cloned().unwrap_or_default()),
            Self::Of(OtherCurve::Sine(sine)) => loads::Curve::sine(*sine),
        }
    }
}

fn check_rows(problems: &mut Problems, path: &str, rows: &[[f64; 2]]) {
    check_times(problems, path, rows.iter().map(|row| row[0]));
    for (i, row) in rows.iter().enumerate() {
        problems.number(&format!("{path}[{i}][1]"), row[1]);
    }
}

/// Checks the times of a table or curve: at least one, finite and increasing.
pub(super) fn check_times(problems: &mut Problems, path: &str, times: impl Iterator<Item = f64>) {
    let mut last: Option<f64> = None;
    for (i, t) in times.enumerate() {
        let path = format!("{path}[{i}][0]");
        problems.number(&path, t);
        if let Some(last) = last.filter(|last| t <= *last) {
            let allowed = format!("must be greater than in the row before, {}", Number(last));
            problems.refuse(&path, Number(t), allowed);
        }
        last = Some(t);
    }
    problems.require(last.is_some(), path, "an empty list", "must have at least one row");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_two_columns_and_perhaps_a_header() {
        let read = |text| rows(text).map_err(|error| error.to_string());
        let expected = Ok(vec![[0.0, 0.0], [0.5, -1e-3]]);
        assert_eq!(read("time,u\n0,0\n0.5,-1e-3\n"), expected);
        assert_eq!(read("0 0\n\n 0.5\t-1e-3"), expected);
        assert!(read("0,0\n1,2,3\n").is_err_and(|error| error.starts_with("line 2: \"1,2,3\"")));
        assert!(read("0,0\nhigh,2\n").is_err_and(|error| error.contains("must be two numbers")));
    }
}
