//! Faults in the shipped files: one build has them all, and an environment variable switches on one. A check must then fail.
//!
//! Untch, Offutt, Harrold, "Mutation analysis using mutant schemata", 1993: one build for all mutants.

use super::sources::Places;
use super::table::{Check, FAULTS, ShippedFault};
use crate::report::{Bound, Report};
use crate::studies::Outcome;
use rayon::prelude::*;
use serde_json::Value;
use std::collections::{HashMap, HashSet};
use std::io::{self, BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread::spawn;
use std::time::{Duration, Instant};

/// The feature of the library that builds the faults in.
const FEATURE: &str = "bfree/mutants";

/// The environment variable with the name of the fault.
const VARIABLE: &str = "BFREE_MUTANT";

/// A check that takes longer hangs because of the fault.
const PATIENCE: Duration = Duration::from_secs(300);

/// The end of the line that a program prints when a test fails. Nobody needs the rest of its tests.
const FAILED: &str = "... FAILED";

/// The reasons why the faults could not be tried.
#[derive(Debug, thiserror::Error)]
pub(super) enum ShippedFaultError {
    #[error("cannot run `{command}`")]
    Start { command: String, source: io::Error },
    #[error("`{command}` failed ({status}):\n{output}")]
    Failed { command: String, status: ExitStatus, output: String },
    #[error("cargo built no program `{name}`")]
    NotBuilt { name: &'static str },
    #[error("{name} fails without a fault")]
    Unsound { name: &'static str },
}

/// The root of the workspace.
pub(super) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Tries every fault.
pub(super) fn run(places: &Places, outcome: &mut Outcome) -> Result<(), ShippedFaultError> {
    let start = Instant::now();
    let programs = build()?;
    outcome.remarks.push(format!("{} faults in one build of {:.0} s.", FAULTS.len(), start.elapsed().as_secs_f64()));
    let checks: HashSet<Check> = FAULTS.iter().flat_map(|fault| [fault.killed_by, fault.spared_by]).collect();
    // Checks run in parallel: most checks keep one core busy, and none is timed.
    checks.par_iter().try_for_each(|&check| match attempt(&programs, check, None)? {
        Verdict::Passes => Ok(()),
        _ => Err(ShippedFaultError::Unsound { name: check.name() }),
    })?;
    let judged: Result<Vec<_>, _> = FAULTS.par_iter().map(|fault| judge(&programs, fault)).collect();
    let mut report = Report::new(
        "faults in the shipped files: checks whose verdict is not the one foretold",
        &["fault", "place", "killed by", "still green", "seconds"],
    );
    for (fault, Judged { wrong, seconds }) in FAULTS.iter().zip(judged?) {
        let place = places.get(fault.name).map_or("", String::as_str);
        let labels = [fault.name, place, fault.killed_by.name(), fault.spared_by.name(), &format!("{seconds:.1}")];
        report.push(&labels, wrong.len() as f64, Bound::AtMost(0.0));
        wrong.into_iter().for_each(|note| report.note(note));
    }
    outcome.reports.push(report);
    Ok(())
}

/// The result of a fault.
struct Judged {
    /// The verdicts that differ from the expected ones.
    wrong: Vec<String>,
    seconds: f64,
}

fn judge(programs: &Programs, fault: &ShippedFault) -> Result<Judged, ShippedFaultError> {
    let (start, mut wrong) = (Instant::now(), Vec::new());
    if attempt(programs, fault.killed_by, Some(fault.name))? == Verdict::Passes {
        wrong.push(format!("{}: {} does not fail", fault.name, fault.killed_by.name()));
    }
    match attempt(programs, fault.spared_by, Some(fault.name))? {
        Verdict::Passes => {}
        Verdict::Fails => wrong.push(format!("{}: {} fails, too", fault.name, fault.spared_by.name())),
        Verdict::Hangs => wrong.push(format!("{}: {} does not end", fault.name, fault.spared_by.name())),
    }
    Ok(Judged { wrong, seconds: start.elapsed().as_secs_f64() })
}

/// The programs of the build with faults, by name.
type Programs = HashMap<String, PathBuf>;

/// The program that runs studies.
const STUDIES: &str = "verification";

/// The test program of the library.
const SUITE: &str = "suite";

/// The program of the library's unit tests.
const UNITS: &str = "bfree";

/// Builds the programs in a folder of their own, so that the normal build stays as it is.
fn build() -> Result<Programs, ShippedFaultError> {
    let target =
        std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from).join("mutants");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let built = |what: &[&str]| {
        let mut command = Command::new(&cargo);
        command.args(what).args(["-p", "bfree", "--release", "--locked", "--features", FEATURE]);
        output(command.args(["--message-format", "json"]).arg("--target-dir").arg(&target).current_dir(root()))
    };
    let programs = built(&["build", "-p", STUDIES, "--bin", STUDIES, "--test", SUITE])?;
    let messages = [programs, built(&["test", "--no-run", "--lib"])?];
    let artifacts = messages.iter().flat_map(|text| text.lines());
    let artifacts = artifacts.filter_map(|line| serde_json::from_str::<Value>(line).ok());
    Ok(artifacts
        // The program of the library has the same name as its unit tests and is left out.
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

/// Runs a check, with a fault switched on if one is given.
fn attempt(programs: &Programs, check: Check, fault: Option<&str>) -> Result<Verdict, ShippedFaultError> {
    let (name, arguments): (&'static str, &[&str]) = match check {
        Check::Study(study) => (STUDIES, &[study, "--first"]),
        Check::Test(tests) => (SUITE, &[tests]),
        Check::Unit(tests) => (UNITS, &[tests]),
    };
    let program = programs.get(name).ok_or(ShippedFaultError::NotBuilt { name })?;
    let mut command = Command::new(program);
    command.args(arguments).current_dir(root());
    command.stdin(Stdio::null()).stderr(Stdio::null());
    command.env_remove(VARIABLE).envs(fault.map(|fault| (VARIABLE, fault)));
    // Checks run side by side; the results do not depend on the number of threads, and tests of threads start their own.
    command.env("RAYON_NUM_THREADS", "1");
    // Inputs that a fault fails on are no regressions, and do not belong beside the sources.
    command.env("PROPTEST_DISABLE_FAILURE_PERSISTENCE", "true");
    verdict(&mut command)
        .map_err(|source| ShippedFaultError::Start { command: format!("{}", program.display()), source })
}

/// Runs a check until it ends, a test fails, or nobody waits any longer. Programs that the check has started end with it.
fn verdict(command: &mut Command) -> io::Result<Verdict> {
    let mut child = command.stdout(Stdio::piped()).process_group(0).spawn()?;
    let lines = child.stdout.take().map(|out| lines(BufReader::new(out)));
    let end = Instant::now() + PATIENCE;
    // Without a pipe there are no lines, and only the end of the program counts.
    while let Some(lines) = &lines {
        let early = match lines.recv_timeout(end.saturating_duration_since(Instant::now())) {
            Err(RecvTimeoutError::Disconnected) => break,
            Err(RecvTimeoutError::Timeout) => Verdict::Hangs,
            Ok(line) if line.ends_with(FAILED) => Verdict::Fails,
            Ok(_) => continue,
        };
        Command::new("kill").args(["-KILL", "--", &format!("-{}", child.id())]).status()?;
        child.wait()?;
        return Ok(early);
    }
    Ok(if child.wait()?.success() { Verdict::Passes } else { Verdict::Fails })
}

/// The lines of a program, as it prints them.
fn lines(out: impl BufRead + Send + 'static) -> Receiver<String> {
    let (sender, lines) = mpsc::channel();
    spawn(move || out.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The verdict on a shell script, and the seconds it takes.
    fn of(script: &str) -> io::Result<(Verdict, u64)> {
        let start = Instant::now();
        Ok((verdict(Command::new("sh").args(["-c", script]))?, start.elapsed().as_secs()))
    }

    #[test]
    fn the_first_test_that_fails_is_the_verdict() -> io::Result<()> {
        assert_eq!(of("echo 'test a ... ok'")?.0, Verdict::Passes);
        assert_eq!(of("echo 'test a ... ok'; exit 101")?.0, Verdict::Fails);
        // Neither the rest of the tests nor a program that they have started is waited for.
        let (verdict, seconds) = of("sleep 60 & echo 'test a ... FAILED'; sleep 60")?;
        assert_eq!(verdict, Verdict::Fails);
        assert!(seconds < 30, "{seconds} s");
        Ok(())
    }
}
