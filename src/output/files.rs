//! Two ways to put a file on disk: all at once or not at all, and line by line as it grows.

use super::OutputError;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tempfile::NamedTempFile;

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
    flushed: Instant,
}

impl Stream {
    /// Creates or empties the file.
    pub(crate) fn create(path: PathBuf) -> Result<Self, OutputError> {
        let file = File::create(&path).map_err(OutputError::io("create", &path))?;
        Ok(Self { path, writer: BufWriter::new(file), flushed: Instant::now() })
    }

    /// Where it is.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Appends a line.
    pub(crate) fn line(&mut self, line: &str) -> Result<(), OutputError> {
        writeln!(self.writer, "{line}").map_err(OutputError::io("write", &self.path))?;
        if self.flushed.elapsed() >= FLUSH_INTERVAL { self.flush() } else { Ok(()) }
    }

    /// Hands everything to the system.
    pub(crate) fn flush(&mut self) -> Result<(), OutputError> {
        self.flushed = Instant::now();
        self.writer.flush().map_err(OutputError::io("write", &self.path))
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
        let mut stream = Stream::create(directory.path().join("a.csv"))?;
        stream.line("1")?;
        std::thread::sleep(FLUSH_INTERVAL);
        stream.line("2")?;
        assert_eq!(std::fs::read_to_string(stream.path())?, "1\n2\n");
        Ok(())
    }
}
