//! Calls in a child process. A crash, an endless loop or a STOP ends the child; the next call starts another.
//!
//! The child is any program that calls [`serve`] if its first argument is [`ARGUMENT`]; a program can be its own child. Requests and answers
//! go through a socket, which the child finds as its standard input. A library may print: both of its outputs become the parent's standard
//! error, up to [`PRINTED`].

mod message;

use std::ffi::OsString;
use std::io::{self, ErrorKind, PipeReader, Read, Write};
use std::net::Shutdown;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Command, ExitCode, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::law::{CallFailed, Response, Step};

use super::{Caller, Description, Signature, check_input, failed, open};
use message::Sent;

/// The hidden first argument that makes a program a child.
pub const ARGUMENT: &str = "--call-material-law";

/// The default time limit of a call.
pub const LIMIT: Duration = Duration::from_secs(5);

/// A time limit beyond this is cut, so that no sum with it overflows: thirty years.
const LONGEST_LIMIT: Duration = Duration::from_secs(1_000_000_000);

/// So many bytes of the output of a law are shown.
pub const PRINTED: usize = 64 << 10;

/// A message beyond this length, in bytes, is not one.
const LONGEST: u32 = 1 << 26;

/// The first byte of an answer that is a response; other answers are a sentence.
const ANSWERED: u8 = 1;

/// A program that can be the child.
#[derive(Clone, Debug)]
pub struct Host {
    /// The program.
    pub program: PathBuf,
    /// Its arguments.
    pub arguments: Vec<OsString>,
}

impl Host {
    /// This program itself, with [`ARGUMENT`]. Its `main` must begin with [`serve_if_asked`].
    ///
    /// # Errors
    /// The system does not tell where the program is.
    pub fn this_program() -> io::Result<Self> {
        Ok(Self { program: std::env::current_exe()?, arguments: vec![ARGUMENT.into()] })
    }
}

/// A law in a child process.
pub struct Child {
    host: Host,
    description: Description,
    limit: Duration,
    signature: Signature,
    process: Option<Process>,
    /// The bytes that may still be shown of the output of the law.
    printable: Arc<AtomicUsize>,
}

impl Child {
    /// Starts the child and loads the library there. `limit` is the time that a call may take.
    ///
    /// # Errors
    /// See [`open`]. The program cannot be started, or the library ends it while it is loaded.
    pub fn start(host: Host, description: Description, limit: Duration) -> Result<Self, CallFailed> {
        let limit = limit.min(LONGEST_LIMIT);
        let printable = Arc::new(AtomicUsize::new(PRINTED));
        let (process, signature) = Process::start(&host, &description, limit, &printable)?;
        Ok(Self { host, description, limit, signature, process: Some(process), printable })
    }

    /// The answer of the child to a step, started again if the last call ended it.
    fn exchange(&mut self, step: &Step, response: &mut Response) -> Result<(), Ended> {
        let mut process = match self.process.take() {
            Some(process) => process,
            None => {
                let started = Process::start(&self.host, &self.description, self.limit, &self.printable);
                started.map_err(|failed| Ended::Said(failed.0))?.0
            }
        };
        process.exchange(step, self.limit)?;
        *response = process.answered().map_err(|said| said.map_or(Ended::Unreadable, Ended::Said))?;
        if !self.signature.fits(response) {
            return Err(Ended::Unreadable);
        }
        self.process = Some(process);
        Ok(())
    }
}

impl Caller for Child {
    fn signature(&self) -> &Signature {
        &self.signature
    }

    /// After a call that failed the child is started again, because the library may have spoiled its memory.
    fn call(&mut self, step: &Step, response: &mut Response) -> Result<(), CallFailed> {
        check_input(step, &self.signature)?;
        self.exchange(step, response).map_err(|ended| match ended {
            Ended::Said(sentence) => CallFailed(sentence),
            ended => failed(step, ended.sentence(self.limit)),
        })
    }
}

/// The end of a conversation with a child.
enum Ended {
    /// The child gave a sentence instead of a response.
    Said(String),
    /// The child did not answer in time.
    Late,
    /// The child ended, or the connection to it failed.
    Exit(ExitStatus),
    /// The answer cannot be understood, or the connection failed.
    Unreadable,
}

impl Ended {
    fn sentence(self, limit: Duration) -> String {
        match self {
            Self::Said(sentence) => sentence,
            Self::Late => format!("the library did not return within {limit:?} and was stopped."),
            Self::Exit(status) => match (status.signal(), status.code()) {
                (Some(signal), _) => format!("the library crashed: {}.", signal_name(signal)),
                (None, code) => format!(
                    "the library ended its program, with exit code {}. STOP in Fortran, XIT of Abaqus and exit() in C do that.",
                    code.unwrap_or(-1)
                ),
            },
            Self::Unreadable => "the answer of the child process cannot be read.".into(),
        }
    }
}

/// The signals that a library raises, with the same numbers on Linux and macOS except for bus errors.
fn signal_name(signal: i32) -> String {
    let meaning = match signal {
        4 => "SIGILL, an instruction that this processor does not know",
        6 => "SIGABRT, it aborted itself",
        7 if cfg!(target_os = "linux") => "SIGBUS, a wrong address",
        10 if cfg!(target_os = "macos") => "SIGBUS, a wrong address",
        8 => "SIGFPE, a floating-point or integer exception",
        9 => "SIGKILL, it was killed, perhaps for lack of memory",
        11 => "SIGSEGV, access to memory that is not its own",
        5 => "SIGTRAP, a trap",
        _ => return format!("signal {signal}"),
    };
    format!("signal {signal} ({meaning})")
}

/// A running child.
struct Process {
    child: std::process::Child,
    socket: UnixStream,
    request: Vec<u8>,
    answer: Vec<u8>,
    /// Shows the output of the law.
    printer: JoinHandle<()>,
}

impl Process {
    fn start(
        host: &Host,
        description: &Description,
        limit: Duration,
        printable: &Arc<AtomicUsize>,
    ) -> Result<(Self, Signature), CallFailed> {
        let library = description.library.display();
        let mut process = Self::spawn(host, printable)
            .map_err(|error| CallFailed(format!("The program {} cannot start: {error}.", host.program.display())))?;
        process.exchange(&(limit, description.clone()), limit).map_err(|ended| {
            CallFailed(format!("The library {library}, while it was loaded: {}", ended.sentence(limit)))
        })?;
        let unreadable = || format!("The program {} answers as no child of this version does.", host.program.display());
        let signature = process.answered().map_err(|said| CallFailed(said.unwrap_or_else(unreadable)))?;
        Ok((process, signature))
    }

    fn spawn(host: &Host, printable: &Arc<AtomicUsize>) -> io::Result<Self> {
        let (socket, other) = UnixStream::pair()?;
        let (prints, end) = io::pipe()?;
        let child = Command::new(&host.program)
            .args(&host.arguments)
            // Prints of gfortran's libraries appear even if the child is stopped.
            .env("GFORTRAN_UNBUFFERED_PRECONNECTED", "y")
            .stdin(Stdio::from(OwnedFd::from(other)))
            .stdout(end.try_clone()?)
            .stderr(end)
            .spawn()?;
        let printable = Arc::clone(printable);
        let printer = thread::spawn(move || show(prints, &printable));
        Ok(Self { child, socket, request: Vec::new(), answer: Vec::new(), printer })
    }

    /// The value that the child answered, or its sentence; without either, the answer cannot be read.
    fn answered<T: Sent>(&self) -> Result<T, Option<String>> {
        let mut answer = &self.answer[..];
        match u8::read(&mut answer) {
            Some(ANSWERED) => T::read(&mut answer).ok_or(None),
            Some(_) => Err(String::read(&mut answer)),
            None => Err(None),
        }
    }

    /// Sends a request and waits for the answer.
    fn exchange(&mut self, request: &impl Sent, limit: Duration) -> Result<(), Ended> {
        self.request.clear();
        request.write(&mut self.request);
        let deadline = Instant::now() + limit;
        let exchanged = send(&mut self.socket, &self.request)
            .and_then(|()| receive(&mut self.socket, &mut self.answer, Some(deadline)));
        match exchanged {
            Ok(()) => Ok(()),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                let _ = self.child.kill();
                Err(Ended::Late)
            }
            Err(error) if error.kind() == ErrorKind::InvalidData => Err(Ended::Unreadable),
            Err(_) => Err(self.status().map_or(Ended::Unreadable, Ended::Exit)),
        }
    }

    /// The exit status of a child that closed the connection or lost it; the child may take a moment to end.
    fn status(&mut self) -> Option<ExitStatus> {
        for _ in 0..2000 {
            match self.child.try_wait() {
                Ok(Some(status)) => return Some(status),
                Ok(None) => thread::sleep(Duration::from_micros(500)),
                Err(_) => return None,
            }
        }
        None
    }
}

impl Drop for Process {
    /// Lets the child end, which writes what its library has printed; kills it if it does not.
    fn drop(&mut self) {
        let _ = self.socket.shutdown(Shutdown::Both);
        if self.status().is_none() {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
        // The last lines appear now. A process that the law started may hold the pipe for ever.
        for _ in 0..200 {
            if self.printer.is_finished() {
                break;
            }
            thread::sleep(Duration::from_micros(500));
        }
    }
}

/// Shows the output of a law until it ends; it is read on beyond the limit, so that the law does not wait for a reader.
fn show(mut prints: PipeReader, printable: &AtomicUsize) {
    let mut bytes = [0; 4096];
    while let Ok(count @ 1..) = prints.read(&mut bytes) {
        let left =
            printable.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| Some(left.saturating_sub(count)));
        let left = left.unwrap_or(0);
        let mut error = io::stderr().lock();
        let _ = error.write_all(&bytes[..count.min(left)]);
        if (1..=count).contains(&left) {
            let _ = writeln!(error, "\n[The law printed {PRINTED} bytes; the rest of its output is left out.]");
        }
    }
}

fn send(socket: &mut UnixStream, bytes: &[u8]) -> io::Result<()> {
    let length = u32::try_from(bytes.len()).map_err(|_| ErrorKind::InvalidData)?;
    socket.write_all(&length.to_le_bytes())?;
    socket.write_all(bytes)
}

/// Reads a message. Fails with [`ErrorKind::WouldBlock`] at the deadline.
fn receive(socket: &mut UnixStream, message: &mut Vec<u8>, deadline: Option<Instant>) -> io::Result<()> {
    let mut length = [0; 4];
    fill(socket, &mut length, deadline)?;
    let length = u32::from_le_bytes(length);
    if length > LONGEST {
        return Err(ErrorKind::InvalidData.into());
    }
    message.resize(length as usize, 0);
    fill(socket, message, deadline)
}

fn fill(socket: &mut UnixStream, mut bytes: &mut [u8], deadline: Option<Instant>) -> io::Result<()> {
    while !bytes.is_empty() {
        if let Some(deadline) = deadline {
            let left = deadline.saturating_duration_since(Instant::now());
            socket.set_read_timeout(Some(left.max(Duration::from_micros(1))))?;
        }
        match socket.read(bytes) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(count) => bytes = &mut bytes[count..],
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Serves calls if the first argument is [`ARGUMENT`]. The exit code is then the program's.
pub fn serve_if_asked() -> Option<ExitCode> {
    let asked = std::env::args_os().nth(1).is_some_and(|argument| argument == ARGUMENT);
    asked.then(|| match serve() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{ARGUMENT}: {error}. This argument is for child processes alone.");
            ExitCode::FAILURE
        }
    })
}

/// Serves calls until the parent closes the connection.
///
/// # Errors
/// The standard input is not the connection to a parent.
pub fn serve() -> io::Result<()> {
    let mut socket = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    let mut request = Vec::new();
    receive(&mut socket, &mut request, None)?;
    let (limit, description) = <(Duration, Description)>::read(&mut &request[..]).ok_or(ErrorKind::InvalidData)?;
    let watch = Watch::start(limit);
    let opened = watch.during(|| open(&description));
    answer(&mut socket, opened.as_ref().map(|caller| caller.signature()))?;
    let Ok(mut caller) = opened else { return Ok(()) };
    let mut response = super::empty_response();
    while received(receive(&mut socket, &mut request, None))? {
        let step = Step::read(&mut &request[..]).ok_or(ErrorKind::InvalidData)?;
        let called = watch.during(|| caller.call(&step, &mut response));
        answer(&mut socket, called.as_ref().map(|()| &response))?;
    }
    Ok(())
}

/// Sends a value, or the sentence of a failure.
fn answer<T: Sent>(socket: &mut UnixStream, result: Result<&T, &CallFailed>) -> io::Result<()> {
    let mut bytes = Vec::new();
    match result {
        Ok(value) => {
            ANSWERED.write(&mut bytes);
            value.write(&mut bytes);
        }
        Err(CallFailed(sentence)) => {
            0_u8.write(&mut bytes);
            sentence.write(&mut bytes);
        }
    }
    send(socket, &bytes)
}

/// Whether a message came; false if the parent closed the connection.
fn received(result: io::Result<()>) -> io::Result<bool> {
    match result {
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        result => result.map(|()| true),
    }
}

/// Aborts the child if a call lasts far beyond the time limit: nobody else would, if the parent was killed.
struct Watch {
    /// Milliseconds after `origin` at which the call has lasted too long; 0 between calls.
    deadline: Arc<AtomicU64>,
    origin: Instant,
    limit: Duration,
}

impl Watch {
    fn start(limit: Duration) -> Self {
        let origin = Instant::now();
        let deadline = Arc::new(AtomicU64::new(0));
        let watched = Arc::clone(&deadline);
        thread::spawn(move || {
            loop {
                thread::sleep(Duration::from_millis(500));
                let deadline = watched.load(Ordering::Relaxed);
                if deadline != 0 && origin.elapsed().as_millis() > u128::from(deadline) {
                    std::process::abort();
                }
            }
        });
        Self { deadline, origin, limit: limit.saturating_add(Duration::from_secs(2)) }
    }

    fn during<T>(&self, call: impl FnOnce() -> T) -> T {
        let deadline = self.origin.elapsed().saturating_add(self.limit);
        self.deadline.store(deadline.as_millis().try_into().unwrap_or(u64::MAX), Ordering::Relaxed);
        let result = call();
        self.deadline.store(0, Ordering::Relaxed);
        result
    }
}
