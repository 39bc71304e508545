//! Two ways to put a file on disk: all at once or not at all, and line by line as it grows.

use super::OutputError;
use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tempfile::NamedTempFile;

/// How the names of files that are being written begin; a killed run leaves them behind.
pub(crate) const TEMPORARY: &str = ".bfree-";

/// What a dying process may lose of a growing file.
const FLUSH_INTERVAL: Duration = Duration::from_millis(50);

/// Writes a file under a temporary name, then renames it: a reader, or a killed run, sees the old file or the new one.
///
/// # Errors
/// The system refuses; the file is then as before.
pub(crate) fn write_atomically(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<NamedTempFile>) -> std::io::Result<()>,
) -> Result<(), OutputError> {
    let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMPORARY);
    // Readable by others as far as the umask allows, like any other file; the library's default is the owner only.
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

/// A text file that grows line by line and is flushed every [`FLUSH_INTERVAL`], on [`Stream::flush`] and when dropped.
#[derive(Debug)]
pub(crate) struct Stream {
    path: PathBuf,
    writer: BufWriter<File>,
    /// Bytes so far.
    length: u64,
    flushed: Instant,
}

impl Stream {
    /// Creates or empties the file; or, to continue it, keeps its first `kept` bytes, which must be there.
    pub(crate) fn open(path: PathBuf, kept: Option<u64>) -> Result<Self, OutputError> {
        let length = kept.unwrap_or(0);
        let open = || -> std::io::Result<File> {
            let mut file = OpenOptions::new().write(true).create(kept.is_none()).truncate(false).open(&path)?;
            file.set_len(length)?;
            file.seek(SeekFrom::Start(length))?;
            Ok(file)
        };
        let action = if kept.is_some() { "continue" } else { "create" };
        let file = open().map_err(OutputError::io(action, &path))?;
        Ok(Self { path, writer: BufWriter::new(file), length, flushed: Instant::now() })
    }

    /// Where it is.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Appends a line.
    pub(crate) fn line(&mut self, line: &str) -> Result<(), OutputError> {
        writeln!(self.writer, "{line}").map_err(OutputError::io("write", &self.path))?;
        self.length += line.len() as u64 + 1;
        if self.flushed.elapsed() >= FLUSH_INTERVAL { self.flush() } else { Ok(()) }
    }

    /// Hands everything to the system.
    pub(crate) fn flush(&mut self) -> Result<(), OutputError> {
        self.flushed = Instant::now();
        self.writer.flush().map_err(OutputError::io("write", &self.path))
    }

    /// Puts everything on the disk; the name of the file, and its bytes.
    pub(crate) fn mark(&mut self) -> Result<(String, u64), OutputError> {
        self.flush()?;
        self.writer.get_ref().sync_data().map_err(OutputError::io("write", &self.path))?;
        let name = self.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok((name, self.length))
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
        assert_eq!(std::fs::read_to_string(stream.path())?, "1\n2\n");
        Ok(())
    }
}
