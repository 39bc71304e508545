//! Two ways to write a file: all at once or not at all, and line by line as the file grows.

use super::OutputError;
use crc32fast::Hasher;
use flate2::CrcReader;
use serde::{Deserialize, Serialize};
use std::fs::{File, OpenOptions};
use std::io::{BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tempfile::NamedTempFile;

/// Prefix of the names of temporary files, which a killed run leaves behind.
pub(crate) const TEMPORARY: &str = ".bfree-";

/// Name of the file with the scene, the program and the flags of a run.
pub(crate) const PROVENANCE: &str = "provenance.json";

/// Time between flushes. A dying process loses the lines since the last flush.
const FLUSH_INTERVAL: Duration = Duration::from_millis(50);

/// Writes a file under a temporary name, then renames it. Readers see the old file or the new file, even if the run is killed.
///
/// # Errors
/// The operating system refuses. The file is then unchanged.
pub(crate) fn write_atomically(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<NamedTempFile>) -> std::io::Result<()>,
) -> Result<(), OutputError> {
    let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMPORARY);
    // The umask decides who can read the file. By default the library lets only the owner read it.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let write = || -> std::io::Result<()> {
        let mut file = BufWriter::new(builder.tempfile_in(directory)?);
        content(&mut file)?;
        let file = file.into_inner()?;
        file.as_file().sync_all()?;
        file.persist(path)?;
        Ok(())
    };
    write().map_err(OutputError::io("write", path))
}

/// The content of a file; `None` if there is no such file.
pub(crate) fn read_if_there(path: &Path) -> Result<Option<Vec<u8>>, OutputError> {
    match std::fs::read(path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        content => content.map(Some).map_err(OutputError::io("read", path)),
    }
}

/// Length and checksum of a file, or of a growing file at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Written {
    bytes: u64,
    crc32: u32,
}

impl Written {
    /// Length and checksum of a content.
    pub(crate) fn of(content: impl Read) -> std::io::Result<Self> {
        let mut content = CrcReader::new(BufReader::new(content));
        let bytes = std::io::copy(&mut content, &mut std::io::sink())?;
        Ok(Self { bytes, crc32: content.crc().sum() })
    }

    /// Checks that the file at `path` begins with this content.
    pub(crate) fn check(&self, path: &Path) -> Result<(), OutputError> {
        let found = File::open(path).and_then(|file| Self::of(file.take(self.bytes)));
        let found = found.map_err(OutputError::io("continue", path))?;
        if found.bytes < self.bytes {
            return Err(OutputError::content(path, "ends before the place where it was to be continued"));
        }
        if found.crc32 != self.crc32 {
            return Err(OutputError::content(path, "is not what it was when the checkpoint was written"));
        }
        Ok(())
    }
}

/// A text file that grows line by line and is flushed every [`FLUSH_INTERVAL`], on [`Stream::flush`] and when dropped.
#[derive(Debug)]
pub(crate) struct Stream {
    pub(crate) path: PathBuf,
    writer: BufWriter<File>,
    /// Checksum of all bytes so far.
    sum: Hasher,
    length: u64,
    flushed: Instant,
}

impl Stream {
    /// Creates or empties the file. To continue a file, keeps its first `kept` bytes, which must be there.
    pub(crate) fn open(path: PathBuf, kept: Option<Written>) -> Result<Self, OutputError> {
        let Written { bytes: length, crc32 } = kept.unwrap_or_default();
        let sum = Hasher::new_with_initial_len(crc32, length);
        let open = || -> std::io::Result<File> {
            let mut file = OpenOptions::new().write(true).create(kept.is_none()).truncate(false).open(&path)?;
            file.set_len(length)?;
            file.seek(SeekFrom::Start(length))?;
            Ok(file)
        };
        let action = if kept.is_some() { "continue" } else { "create" };
        let file = open().map_err(OutputError::io(action, &path))?;
        Ok(Self { path, writer: BufWriter::new(file), sum, length, flushed: Instant::now() })
    }

    /// Appends a line.
    pub(crate) fn line(&mut self, line: &str) -> Result<(), OutputError> {
        writeln!(self.writer, "{line}").map_err(OutputError::io("write", &self.path))?;
        self.sum.update(line.as_bytes());
        self.sum.update(b"\n");
        self.length += line.len() as u64 + 1;
        if self.flushed.elapsed() >= FLUSH_INTERVAL { self.flush() } else { Ok(()) }
    }

    /// Hands buffered lines to the operating system.
    pub(crate) fn flush(&mut self) -> Result<(), OutputError> {
        self.flushed = Instant::now();
        self.writer.flush().map_err(OutputError::io("write", &self.path))
    }

    /// Syncs the file to disk. Returns its name, length and checksum.
    pub(crate) fn mark(&mut self) -> Result<(String, Written), OutputError> {
        self.flush()?;
        self.writer.get_ref().sync_data().map_err(OutputError::io("write", &self.path))?;
        let name = self.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok((name, Written { bytes: self.length, crc32: self.sum.clone().finalize() }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_write_that_fails_leaves_the_old_file_and_no_rubbish() -> Result<(), Box<dyn std::error::Error>> {
        let directory = tempfile::tempdir()?;
        let path = directory.path().join("a.pvd");
        write_atomically(&path, |file| file.write_all(b"old"))?;
        let full_disk = |file: &mut BufWriter<NamedTempFile>| {
            file.write_all(b"ne")?;
            Err(std::io::Error::other("no space left"))
        };
        assert!(matches!(write_atomically(&path, full_disk), Err(OutputError::Io { .. })));
        assert_eq!(std::fs::read(&path)?, b"old");
        write_atomically(&path, |file| file.write_all(b"new"))?;
        assert_eq!(std::fs::read(&path)?, b"new");
        assert_eq!(std::fs::read_dir(directory.path())?.count(), 1);
        Ok(())
    }

    #[test]
    fn lines_are_on_disk_soon_although_nobody_flushes() -> Result<(), Box<dyn std::error::Error>> {
        let directory = tempfile::tempdir()?;
        let mut stream = Stream::open(directory.path().join("a.csv"), None)?;
        stream.line("1")?;
        std::thread::sleep(FLUSH_INTERVAL);
        stream.line("2")?;
        assert_eq!(std::fs::read_to_string(&stream.path)?, "1\n2\n");
        Ok(())
    }
}
