//! Faults in the shipped files: a patched copy of the workspace is built once, and its own checks must detect each fault.

use super::patches::{CHECKS, Check, Fate, PATCHES, Patch};
use super::schemata::{MODULE, Misfit, VARIABLE, apply, module};
use crate::report::{Bound, Report};
use crate::studies::Outcome;
use rayon::prelude::*;
use serde_json::Value;
use std::collections::{HashMap, HashSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A check that takes longer hangs because of the fault.
const PATIENCE: Duration = Duration::from_secs(300);

/// The reasons why the faults could not be tried.
#[derive(Debug, thiserror::Error)]
pub(super) enum ShippedFaultError {
    #[error(transparent)]
    Misfit(#[from] Misfit),
    #[error("cannot read or copy {path}")]
    Copy { path: PathBuf, source: io::Error },
    #[error("cannot run `{command}`")]
    Start { command: String, source: io::Error },
    #[error("`{command}` failed ({status}):\n{output}")]
    Failed { command: String, status: ExitStatus, output: String },
    #[error("cargo built no program `{name}`")]
    NotBuilt { name: &'static str },
    #[error("without a fault, {name} fails in the copy")]
    Unsound { name: &'static str },
}

/// The root of the workspace.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Whether every patch still fits its file. The check reads and does not build, so the list stays valid between two full runs.
pub(super) fn fit() -> Result<(), ShippedFaultError> {
    let mut files: Vec<&str> = PATCHES.iter().map(|patch| patch.file).collect();
    files.dedup();
    for file in files {
        let path = root().join(file);
        let text = fs::read_to_string(&path).map_err(|source| ShippedFaultError::Copy { path, source })?;
        apply(file, &text, PATCHES)?;
    }
    Ok(())
}

/// Tries every patch.
pub(super) fn run(outcome: &mut Outcome) -> Result<(), ShippedFaultError> {
    let root = root();
    fit()?;
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from).join("mutants");
    let source = target.join("source");
    copy(&root, &source)?;
    let start = Instant::now();
    let programs = build(&source, &target)?;
    outcome.remarks.push(format!("{} faults in one build of {:.0} s.", PATCHES.len(), start.elapsed().as_secs_f64()));
    for &check in CHECKS {
        if attempt(&programs, &source, check, 0)? != Verdict::Passes {
            return Err(ShippedFaultError::Unsound { name: check.name() });
        }
    }
    let mut report = Report::new(
        "faults in the shipped files: checks whose verdict is not the one foretold",
        &["fault", "file", "killed by", "still green", "seconds"],
    );
    // The patches run in parallel: most checks keep one core busy, and none is timed.
    let judged = PATCHES.par_iter().enumerate().map(|(k, patch)| judge(&programs, &source, k + 1, patch));
    for (patch, judged) in PATCHES.iter().zip(judged.collect::<Result<Vec<_>, _>>()?) {
        judged.notes.into_iter().for_each(|note| report.note(note));
        let labels = [patch.name, patch.file, &judged.killers, &judged.spared, &judged.seconds];
        report.push(&labels, f64::from(judged.wrong), Bound::AtMost(0.0));
    }
    outcome.reports.push(report);
    Ok(())
}

/// The result of a fault.
struct Judged {
    killers: String,
    spared: String,
    seconds: String,
    /// Number of verdicts that differ from the expected ones.
    wrong: u32,
    notes: Vec<String>,
}

fn judge(programs: &Programs, source: &Path, number: usize, patch: &Patch) -> Result<Judged, ShippedFaultError> {
    let start = Instant::now();
    let mut notes = Vec::new();
    let (killers, spared) = match patch.fate {
        Fate::Killed(killers, spared) => (killers, spared),
        Fate::Equivalent(reason) => {
            notes.push(format!("equivalent: {}: {reason}", patch.name));
            (&[][..], CHECKS)
        }
    };
    let mut wrong = 0;
    let foretold = killers.iter().map(|check| (check, true)).chain(spared.iter().map(|check| (check, false)));
    for (&check, dies) in foretold {
        let verdict = attempt(programs, source, check, number)?;
        if (verdict != Verdict::Passes) != dies {
            wrong += 1;
            let what = if dies { "survives" } else { "is also killed by" };
            notes.push(format!("{} {what} {}", patch.name, check.name()));
        }
        if verdict == Verdict::Hangs {
            notes.push(format!("{}: {} was stopped after {} s", patch.name, check.name(), PATIENCE.as_secs()));
        }
    }
    let names = |checks: &[Check]| match checks {
        [] => "equivalent: nothing".to_string(),
        some => some.iter().map(|check| check.name()).collect::<Vec<_>>().join(" "),
    };
    let seconds = format!("{:.1}", start.elapsed().as_secs_f64());
    Ok(Judged { killers: names(killers), spared: names(spared), seconds, wrong, notes })
}

/// Copies every file that git tracks or would add, patched, to `source`. Unchanged files stay untouched, so they stay built; other files
/// are removed.
fn copy(root: &Path, source: &Path) -> Result<(), ShippedFaultError> {
    let list = output(Command::new("git").args(["ls-files", "--cached", "--others", "--exclude-standard", "-z"]).current_dir(root))?;
    let mut files: Vec<(&str, Vec<u8>)> = Vec::new();
    for file in list.split('\0').filter(|file| !file.is_empty()) {
        let path = root.join(file);
        match fs::read(&path) {
            Ok(bytes) => files.push((file, bytes)),
            // The file was removed, and the removal is not yet committed.
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(source) => return Err(ShippedFaultError::Copy { path, source }),
        }
    }
    for (file, bytes) in &mut files {
        if PATCHES.iter().any(|patch| patch.file == *file) {
            *bytes = apply(file, &String::from_utf8_lossy(bytes), PATCHES)?.into_bytes();
        }
        if *file == "src/lib.rs" {
            bytes.extend_from_slice(MODULE.1.as_bytes());
        }
    }
    files.push((MODULE.0, module().into_bytes()));
    let kept: HashSet<PathBuf> = files.iter().map(|(file, _)| source.join(file)).collect();
    remove_others(source, &kept).map_err(|error| ShippedFaultError::Copy { path: source.to_owned(), source: error })?;
    for (file, bytes) in files {
        let path = source.join(file);
        if fs::read(&path).is_ok_and(|old| old == bytes) {
            continue;
        }
        let written = path.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::write(&path, &bytes));
        written.map_err(|source| ShippedFaultError::Copy { path, source })?;
    }
    Ok(())
}

/// Removes files of an earlier copy that this copy lacks: a module may have become a folder.
fn remove_others(folder: &Path, kept: &HashSet<PathBuf>) -> io::Result<()> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        entries => entries?,
    };
    for entry in entries {
        let path = entry?.path();
        if path.is_dir() {
            remove_others(&path, kept)?;
        } else if !kept.contains(&path) {
            fs::remove_file(path)?;
        }
    }
    Ok(())
}

/// The programs of the copy by name.
type Programs = HashMap<String, PathBuf>;

/// The program that runs studies.
const STUDIES: &str = "verification";

/// The test program of the library.
const SUITE: &str = "suite";

/// The program of the library's unit tests.
const UNITS: &str = "bfree";

fn build(source: &Path, target: &Path) -> Result<Programs, ShippedFaultError> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let built = |what: &[&str]| {
        let mut command = Command::new(&cargo);
        command.args(what).args(["-p", "bfree", "--release", "--locked", "--message-format", "json"]);
        output(command.arg("--target-dir").arg(target).current_dir(source))
    };
    let programs = built(&["build", "-p", STUDIES, "--bin", STUDIES, "--test", SUITE])?;
    let messages = [programs, built(&["test", "--no-run", "--lib"])?];
    let artifacts = messages.iter().flat_map(|text| text.lines());
    let artifacts = artifacts.filter_map(|line| serde_json::from_str::<Value>(line).ok());
    Ok(artifacts
        // The program of the library has the same name and is excluded.
        .filter(|artifact| artifact["profile"]["test"] == true || artifact["target"]["name"] == STUDIES)
        .filter_map(|artifact| {
            let program = artifact["executable"].as_str()?;
            Some((artifact["target"]["name"].as_str()?.to_string(), PathBuf::from(program)))
        })
        .collect())
}

/// The standard output of a command, which must succeed.
fn output(command: &mut Command) -> Result<String, ShippedFaultError> {
    let text = format!("{command:?}");
    let output = command.output().map_err(|source| ShippedFaultError::Start { command: text.clone(), source })?;
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        // Cargo writes messages for people to the second stream.
        let output_text = String::from_utf8_lossy(&output.stderr).into_owned();
        Err(ShippedFaultError::Failed { command: text, status: output.status, output: output_text })
    }
}

/// The result of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Passes,
    Fails,
    Hangs,
}

/// Runs a check with fault `number` switched on.
fn attempt(programs: &Programs, source: &Path, check: Check, number: usize) -> Result<Verdict, ShippedFaultError> {
    let (name, arguments): (&'static str, &[&str]) = match check {
        Check::Study(study) => (STUDIES, &[study, "--first"]),
        Check::Test(module) => (SUITE, &[module, "--quiet"]),
        Check::Unit(module) => (UNITS, &[module, "--quiet"]),
    };
    let program = programs.get(name).ok_or(ShippedFaultError::NotBuilt { name })?;
    let mut command = Command::new(program);
    command.args(arguments).env(VARIABLE, number.to_string()).current_dir(source);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let failed = |source| ShippedFaultError::Start { command: format!("{}", program.display()), source };
    let mut child = command.spawn().map_err(failed)?;
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().map_err(failed)? {
            return Ok(if status.success() { Verdict::Passes } else { Verdict::Fails });
        }
        if start.elapsed() > PATIENCE {
            child.kill().and_then(|()| child.wait()).map_err(failed)?;
            return Ok(Verdict::Hangs);
        }
        sleep(Duration::from_millis(10));
    }
}
