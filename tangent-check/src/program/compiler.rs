//! Source files of a law, compiled and linked to a shared library.

use super::options::ending;
use std::fs::DirBuilder;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Abaqus' file that each UMAT includes.
const ABA_PARAM: &str = "      implicit real*8(a-h,o-z)\n      parameter (nprecd=2)\n";

/// The header of laws in C.
const HEADER: &str = include_str!("../../include/bfree_law.h");

/// gfortran as Abaqus calls its compiler: extensions of DEC, and lines of any length.
const FORTRAN: [&str; 7] = [
    "-std=legacy",
    "-fdec",
    "-fno-range-check",
    "-fallow-argument-mismatch",
    "-fallow-invalid-boz",
    "-ffixed-line-length-none",
    "-ffree-line-length-none",
];

/// So many lines of a compiler's messages are shown.
const SHOWN: usize = 20;

/// A compiled library. Its folder is deleted with it.
pub(super) struct Compiled {
    folder: PathBuf,
}

impl Drop for Compiled {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// A compiler: its program, and what to install without it.
struct Compiler {
    program: String,
    package: &'static str,
    variable: &'static str,
}

impl Compiler {
    /// The compiler for an ending; the linker for objects is that of Fortran.
    fn of(ending: &str) -> Self {
        let (variable, usual, package) = match ending {
            "c" => ("CC", "gcc", "gcc"),
            "cc" | "cpp" | "cxx" => ("CXX", "g++", "g++"),
            _ => ("FC", "gfortran", "gfortran"),
        };
        let named = std::env::var(variable).ok().filter(|name| !name.is_empty());
        Self { program: named.unwrap_or_else(|| usual.to_owned()), package, variable }
    }

    fn run(&self, arguments: &[String], what: &str) -> Result<(), String> {
        let Self { program, package, variable } = self;
        let output = Command::new(program).args(arguments).output().map_err(|error| {
            format!(
                "{what} needs a compiler, but {program} cannot be started: {error}. Install it (apt-get install {package}; on macOS brew \
                 install gcc), or name another in the variable {variable}."
            )
        })?;
        if output.status.success() {
            return Ok(());
        }
        let said = String::from_utf8_lossy(&output.stderr);
        let lines: Vec<&str> = said.lines().filter(|line| !line.trim().is_empty()).take(SHOWN).collect();
        Err(format!("{program} does not compile {what}:\n  {}", lines.join("\n  ")))
    }
}

impl Compiled {
    /// Compiles sources in their order, so that a module stands before its users.
    ///
    /// # Errors
    /// No compiler, or its messages.
    pub(super) fn new(sources: &[PathBuf]) -> Result<Self, String> {
        let compiled = Self { folder: new_folder()? };
        compiled.write("ABA_PARAM.INC", ABA_PARAM)?;
        compiled.write("aba_param.inc", ABA_PARAM)?;
        compiled.write("bfree_law.h", HEADER)?;
        let mut objects = Vec::new();
        for (number, source) in sources.iter().enumerate() {
            objects.push(compiled.object(source, number)?);
        }
        let endings: Vec<String> = sources.iter().map(|source| ending(source)).collect();
        let pure_c = endings.iter().all(|ending| ending == "c");
        let mut arguments = vec!["-shared".to_owned(), "-o".to_owned(), compiled.library().display().to_string()];
        arguments.extend(objects);
        arguments.push("-lm".to_owned());
        if endings.iter().any(|ending| ["cc", "cpp", "cxx"].contains(&ending.as_str())) {
            arguments.push("-lstdc++".to_owned());
        }
        if cfg!(target_os = "macos") {
            // Abaqus' utility routines are in the program that loads the library.
            arguments.extend(["-undefined", "dynamic_lookup"].map(str::to_owned));
        }
        Compiler::of(if pure_c { "c" } else { "f" }).run(&arguments, "the library")?;
        Ok(compiled)
    }

    /// The library.
    pub(super) fn library(&self) -> PathBuf {
        self.folder.join(if cfg!(target_os = "macos") { "liblaw.dylib" } else { "liblaw.so" })
    }

    fn write(&self, name: &str, text: &str) -> Result<(), String> {
        let file = self.folder.join(name);
        std::fs::write(&file, text).map_err(|error| format!("{} cannot be written: {error}.", file.display()))
    }

    /// The object file of a source.
    fn object(&self, source: &Path, number: usize) -> Result<String, String> {
        let bytes = std::fs::read(source).map_err(|error| format!("{}: {error}.", source.display()))?;
        let ending = ending(source);
        if ending == "o" {
            return Ok(source.display().to_string());
        }
        let text = String::from_utf8_lossy(&bytes).to_lowercase();
        let object = self.folder.join(format!("{number}.o")).display().to_string();
        let folder = source.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        let mut arguments: Vec<String> = ["-c", "-O2", "-fPIC", "-w", "-o", &object].map(str::to_owned).to_vec();
        arguments.extend([format!("-I{}", folder.display()), format!("-I{}", self.folder.display())]);
        if !["c", "cc", "cpp", "cxx"].contains(&ending.as_str()) {
            self.spell(&bytes)?;
            arguments.extend(FORTRAN.map(str::to_owned));
            arguments.push(format!("-J{}", self.folder.display()));
            let directive = |line: &str| line.starts_with(['!', 'c', '*']) && line.trim_end().ends_with("freeform");
            if text.lines().any(directive) {
                arguments.push("-ffree-form".to_owned());
            }
            if text.lines().any(|line| line.starts_with('#')) {
                arguments.push("-cpp".to_owned());
            }
        }
        let what = source.display().to_string();
        arguments.push(what.clone());
        let compiler = Compiler::of(&ending);
        let compiled = compiler.run(&arguments, &what);
        if compiled.is_err() && ["f", "for", "ftn", "f77"].contains(&ending.as_str()) {
            // Many files of this ending are in free form, and are compiled with an option. The messages of the usual form count.
            arguments.insert(0, "-ffree-form".to_owned());
            return compiler.run(&arguments, &what).or(compiled).map(|()| object);
        }
        compiled.map(|()| object)
    }

    /// Gives ABA_PARAM.INC in the spelling of a source, because file names know capitals.
    fn spell(&self, source: &[u8]) -> Result<(), String> {
        const NAME: &str = "aba_param.inc";
        for word in source.windows(NAME.len()).filter(|word| word.eq_ignore_ascii_case(NAME.as_bytes())) {
            self.write(&String::from_utf8_lossy(word), ABA_PARAM)?;
        }
        Ok(())
    }
}

/// A new folder that nobody else can write to.
fn new_folder() -> Result<PathBuf, String> {
    let place = std::env::temp_dir();
    let error = |error| format!("{} cannot take a new folder: {error}.", place.display());
    for number in 0..1000 {
        let folder = place.join(format!("tangent-check-{}-{number}", std::process::id()));
        match DirBuilder::new().mode(0o700).create(&folder) {
            Ok(()) => return Ok(folder),
            Err(said) if said.kind() != std::io::ErrorKind::AlreadyExists => return Err(error(said)),
            Err(_) => {}
        }
    }
    Err(error(std::io::ErrorKind::AlreadyExists.into()))
}
