//! Files of shapes.

use std::fs::{self, File};
use std::io::{self, BufReader};
use std::path::Path;

/// A file that gives no solid, with the reason: `is no regular file`, for example.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct ShapeFileError(pub(super) String);

impl From<io::Error> for ShapeFileError {
    fn from(error: io::Error) -> Self {
        Self(format!("cannot be read: {error}"))
    }
}

/// Opens a file, and returns its length in bytes.
pub(super) fn open(path: &Path) -> Result<(BufReader<File>, u64), ShapeFileError> {
    let about = fs::metadata(path)?;
    // Reading a pipe may block for ever.
    if !about.is_file() {
        return Err(ShapeFileError("is no regular file".to_owned()));
    }
    Ok((BufReader::new(File::open(path)?), about.len()))
}
