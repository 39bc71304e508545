//! How commands fail: exit codes, and what is written to standard output and standard error.

use std::error::Error;
use std::fmt::Display;
use std::io::{ErrorKind, Write as _};

/// Reason why a command fails. Exit codes: 2 for a scene or an option that cannot be used, 1 for a failed run, 130 after Ctrl-C.
pub(super) enum Failure {
    Scene(Box<dyn Error>),
    Run(Box<dyn Error>),
    Interrupted,
    /// A verdict with this exit code, already told.
    Told(u8),
}

/// Exit code after Ctrl-C: 128 plus the number of the signal.
pub(crate) const INTERRUPTED: u8 = 130;

impl Failure {
    /// The exit code.
    pub(crate) fn code(&self) -> u8 {
        match self {
            Self::Scene(_) => 2,
            Self::Run(_) => 1,
            Self::Interrupted => INTERRUPTED,
            Self::Told(code) => *code,
        }
    }

    pub(crate) fn scene(error: impl Into<Box<dyn Error>>) -> Self {
        Self::Scene(error.into())
    }

    pub(crate) fn run(error: impl Into<Box<dyn Error>>) -> Self {
        Self::Run(error.into())
    }

    /// The operating system refuses to do `what`, such as `write a.json`.
    pub(crate) fn system(what: impl Display) -> impl Fn(std::io::Error) -> Self {
        let what = what.to_string();
        move |source| Self::run(Refused { what: what.clone(), source })
    }
}

#[derive(Debug, thiserror::Error)]
#[error("cannot {what}")]
struct Refused {
    what: String,
    source: std::io::Error,
}

/// Writes to standard output. A pipe that its reader has closed, as `head` does, is not an error.
pub(super) fn print(text: impl Display) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Failure::system("write to standard output")(error)),
        _ => Ok(()),
    }
}

/// Writes a line to standard error. A failure to write is ignored, because it cannot be reported anywhere.
pub(super) fn tell(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}
