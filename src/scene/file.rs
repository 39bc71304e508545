//! Files that a scene names.

use std::fs::{self, File};
use std::io::{self, BufReader};
use std::path::Path;

/// Maximum length of a mesh in bytes.
const MAX_BYTES: u64 = 1 << 30;

/// A file that cannot be used, with the reason: `is no regular file`, for example. Lines and columns are counted from 1.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct FileError(pub(super) String);

impl From<io::Error> for FileError {
    fn from(error: io::Error) -> Self {
        Self(format!("cannot be read: {error}"))
    }
}

/// Opens a file, and returns its length in bytes.
pub(super) fn open(path: &Path) -> Result<(BufReader<File>, u64), FileError> {
    let about = fs::metadata(path)?;
    // Reading a pipe may block for ever.
    if !about.is_file() {
        return Err(FileError("is no regular file".to_owned()));
    }
    Ok((BufReader::new(File::open(path)?), about.len()))
}

/// Opens the file of a mesh, which must not be too long.
pub(super) fn open_mesh(path: &Path) -> Result<BufReader<File>, FileError> {
    let (file, length) = open(path)?;
    if length > MAX_BYTES {
        return Err(FileError(format!("has {length} bytes; at most {MAX_BYTES} are read")));
    }
    Ok(file)
}

/// The ending of a file name, in lower case and without the dot.
pub(super) fn ending(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}
