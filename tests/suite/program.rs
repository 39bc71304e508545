//! The command-line program: exit codes, signals, closed pipes, directories that are in use.

mod refusals;
mod reports;

use crate::support::{Failure, Said, said};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

fn program() -> Command {
    let mut program = Command::new(env!("CARGO_BIN_EXE_bfree"));
    program.stdin(Stdio::null());
    program
}

/// Runs a scene with further arguments into `directory`.
fn run(scene: &Path, directory: &Path, arguments: &[&str]) -> Result<Said, Failure> {
    said(program().arg("run").arg(scene).arg("--out").arg(directory).args(arguments))
}

fn rebound(directory: &Path, arguments: &[&str]) -> Result<Said, Failure> {
    run(&scene("rebound.json"), directory, arguments)
}

/// Checks a scene with overrides.
fn check(scene: &Path, sets: &[&str]) -> Result<Said, Failure> {
    said(program().arg("check").arg(scene).args(sets.iter().flat_map(|set| ["--set", *set])))
}

fn paths(directory: &Path) -> Result<Vec<PathBuf>, Failure> {
    std::fs::read_dir(directory)?.map(|entry| Ok(entry?.path())).collect()
}

fn report(directory: &Path) -> Result<Value, Failure> {
    Ok(serde_json::from_slice(&std::fs::read(directory.join("report.json"))?)?)
}

#[test]
fn a_reader_who_has_seen_enough_is_no_failure() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let out = directory.path().join("run");
    rebound(&out, &["--steps", "2", "--quiet"])?;
    let (run, rebound) = (out.display().to_string(), scene("rebound.json").display().to_string());
    let again: &[&str] = &["run", &rebound, "--steps", "1", "--discard", "--out", &run];
    let commands: [&[&str]; 4] = [&["check", &rebound], &["schema"], &["plot", &run], again];
    for arguments in commands {
        // Both pipes are closed before the program starts, so its first line meets a closed pipe.
        let (_, out) = std::io::pipe()?;
        let (_, err) = std::io::pipe()?;
        let status = program().args(arguments).stdout(out).stderr(err).status()?;
        assert!(status.success(), "{arguments:?}: {status}");
    }
    Ok(())
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_standard_output_is_a_failure_with_its_cause() -> Result<(), Failure> {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full")?;
    let output = program().arg("schema").stdout(full).stderr(Stdio::piped()).spawn()?.wait_with_output()?;
    let message = String::from_utf8(output.stderr)?;
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("standard output") && message.contains("No space left"), "{message}");
    Ok(())
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_the_run_after_a_step_with_everything_written() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let run = long_run(directory.path())?;
    let history = directory.path().join("history.csv");
    assert!(Command::new("kill").args(["-INT", &run.id().to_string()]).status()?.success());
    let output = run.wait_with_output()?;
    let message = String::from_utf8(output.stderr)?;
    assert_eq!(output.status.code(), Some(130), "{message}");

    let report = report(directory.path())?;
    let text = std::fs::read_to_string(&history)?;
    let last = text.lines().last().unwrap_or_default();
    let time: f64 = last.split(',').nth(1).unwrap_or_default().parse()?;
    assert_eq!(report["outcome"], "interrupted");
    assert_eq!(report["time"].as_f64(), Some(time));
    let words = report["message"].as_str().unwrap_or_default();
    assert!(words.contains(&format!("t = {time},")) && words.contains("complete"), "{report}");
    assert!(message.contains(&format!("interrupted at t = {time}")), "{message}");
    let steps = report["steps"].as_array().map_or(0, Vec::len);
    assert!(steps > 0 && time < 1e6, "{steps} steps");
    assert_eq!(text.lines().count(), steps + 2, "a header, the initial state and a row a step");
    Ok(())
}

/// Runs two steps with further arguments. Returns the exit code and the text on standard error.
fn told(arguments: &[&str], directory: &Path) -> Result<(Option<i32>, String), Failure> {
    let (code, _, text) = rebound(directory, &[&["--steps", "2"], arguments].concat())?;
    Ok((code, text))
}

#[cfg(unix)]
#[test]
fn what_is_there_is_not_lost() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let out = folder.path().join("run");
    let pictures = |directory: &Path| -> Result<usize, Failure> {
        let drawn = |path: &PathBuf| ["svg", "png", "html"].iter().any(|end| path.extension() == Some(end.as_ref()));
        Ok(paths(directory)?.into_iter().filter(drawn).count())
    };
    assert_eq!(told(&["--plot"], &out)?.0, Some(0));
    let drawn = pictures(&out)?;
    let history = std::fs::read(out.join("history.csv"))?;
    let (code, text) = told(&["--set", "time.step=0.01"], &out)?;
    assert!(code == Some(2) && text.contains("results of a run that finished, 2 steps until t = 0.1"), "{text}");
    assert!(text.contains("--discard"), "{text}");
    assert_eq!(std::fs::read(out.join("history.csv"))?, history);
    // The target of a link is not a file of the run.
    let foreign = folder.path().join("foreign");
    std::fs::write(&foreign, "mine")?;
    std::fs::remove_file(out.join("history.csv"))?;
    std::os::unix::fs::symlink(&foreign, out.join("history.csv"))?;
    assert_eq!(told(&["--discard"], &out)?.0, Some(0));
    assert_eq!(std::fs::read_to_string(&foreign)?, "mine");
    assert_eq!(std::fs::read(out.join("history.csv"))?, history);
    // No picture of the deleted results remains.
    assert_eq!((drawn, pictures(&out)?), (13, 0));
    // Files that no run wrote are not treated as results of a run.
    let own = folder.path().join("own");
    std::fs::create_dir(&own)?;
    for name in ["energies.png", "particles_000007.vtu", "history.csv"] {
        std::fs::write(own.join(name), "mine")?;
        for option in [&[][..], &["--discard"]] {
            let (code, text) = told(option, &own)?;
            assert!(code == Some(2) && text.contains("which no run wrote"), "{text}");
        }
        assert_eq!(std::fs::read_to_string(own.join(name))?, "mine");
    }
    let (code, text) = told(&[], &foreign)?;
    assert!(code == Some(1) && text.contains("not a directory"), "{text}");
    assert_eq!(std::fs::read_to_string(&foreign)?, "mine");
    Ok(())
}

/// A run longer than any machine needs to send a signal, without a checkpoint, in `directory`. At least five of its steps are written.
#[cfg(unix)]
fn long_run(directory: &Path) -> Result<std::process::Child, Failure> {
    let mut run = program();
    run.arg("run").arg(scene("rebound.json")).arg("--out").arg(directory).args(["--until", "1e6", "--quiet"]);
    let run = run.stderr(Stdio::piped()).spawn()?;
    let (history, start) = (directory.join("history.csv"), Instant::now());
    while std::fs::read_to_string(&history).map_or(0, |text| text.lines().count()) < 7 {
        assert!(start.elapsed() < Duration::from_secs(60), "no step");
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(run)
}

#[cfg(unix)]
#[test]
fn steps_of_a_killed_run_without_a_checkpoint_are_lost_on_request_only() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let out = folder.path().join("run");
    let files = |directory: &Path| -> Result<Vec<(PathBuf, Vec<u8>)>, Failure> {
        paths(directory)?.into_iter().map(|path| Ok((path.clone(), std::fs::read(path)?))).collect()
    };
    let mut run = long_run(&out)?;
    run.kill()?;
    run.wait()?;
    let before = files(&out)?;
    let history = std::fs::read_to_string(out.join("history.csv"))?;
    let (whole, _) = history.rsplit_once('\n').ok_or("no row")?;
    let row: Vec<&str> = whole.lines().next_back().ok_or("no row")?.split(',').collect();
    let (code, text) = told(&[], &out)?;
    assert!(code == Some(2) && text.contains(&format!("{} steps until t = {}", row[0], row[1])), "{text}");
    // The message names both ways out, and the second command works as printed.
    let free = folder.path().join("run-2");
    assert!(text.contains("--discard") && text.contains(&format!("--out {}", free.display())), "{text}");
    assert!(files(&out)? == before, "a refusal changes nothing");
    assert_eq!(told(&[], &free)?.0, Some(0));
    assert!(told(&[], &out)?.1.contains("run-3"));
    assert_eq!(told(&["--discard"], &out)?.0, Some(0));
    // A run that failed leaves the steps before the failure as results. A run that failed in its first step has none.
    for (key, lost) in [("boundary={}", true), ("solver.newton.max_iterations=1", false)] {
        let failed = folder.path().join(key);
        let fails = ["--quiet", "--set", key, "--set", "time.max_halvings=1"];
        assert_eq!(rebound(&failed, &fails)?.0, Some(1), "{key}");
        assert_eq!(report(&failed)?["counts"]["steps"].as_u64() > Some(0), lost, "{key}");
        let (code, text) = told(&[], &failed)?;
        assert_eq!(code == Some(2) && text.contains("of a run that failed"), lost, "{key}: {text}");
    }
    Ok(())
}

#[test]
fn a_scene_file_without_a_name_does_not_write_where_the_program_runs() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    for name in ["...json", "....json", "..json", ".json"] {
        std::fs::copy(scene("rebound.json"), folder.path().join(name))?;
        let run = |arguments: &[&str]| {
            said(program().args(["run", name, "--steps", "1", "--quiet"]).args(arguments).current_dir(&folder))
        };
        let (code, _, text) = run(&[])?;
        assert!(code == Some(2) && text.contains(name) && text.contains("--out DIR"), "{text}");
        let out = name.replace('.', "_");
        assert_eq!(run(&["--out", &out])?.0, Some(0));
        std::fs::remove_dir_all(folder.path().join(out))?;
        std::fs::remove_file(folder.path().join(name))?;
    }
    assert_eq!(std::fs::read_dir(&folder)?.count(), 0);
    Ok(())
}

#[cfg(unix)]
#[test]
fn two_runs_share_no_directory_and_a_batch_system_may_end_one() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let mut first = long_run(directory.path())?;
    for argument in [&[][..], &["--discard"], &["--restart"]] {
        let (code, text) = told(argument, directory.path())?;
        assert!(code == Some(2) && text.contains("another program is just writing"), "{argument:?}: {text}");
    }
    assert!(Command::new("kill").args(["-TERM", &first.id().to_string()]).status()?.success());
    assert_eq!(first.wait()?.code(), Some(130));
    assert_eq!(report(directory.path())?["outcome"], "interrupted");
    Ok(())
}

#[test]
fn a_run_ends_at_its_end_between_steps_too() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    // 0.3 / 0.05 is 6 up to rounding; 0.22 / 0.05 is not whole.
    for (until, steps) in [("0.3", 6), ("0.22", 5)] {
        let (code, _, text) = rebound(directory.path(), &["--until", until, "--discard"])?;
        assert!(code == Some(0) && text.is_empty(), "{text}");
        let report = report(directory.path())?;
        let time = report["time"].as_f64().ok_or("no time")?;
        assert!((time - until.parse::<f64>()?).abs() < 1e-15, "{time}");
        assert_eq!(report["counts"]["steps"].as_u64(), Some(steps));
    }
    // `--steps` counts whole steps.
    rebound(directory.path(), &["--until", "0.22", "--steps", "4", "--discard"])?;
    assert_eq!(report(directory.path())?["time"].as_f64(), Some(0.2));
    let steps = |set: &str| check(&scene("rebound.json"), &[set]);
    assert!(steps("time.end=4")?.1.contains("80 of 0.05 to t = 4\n"));
    assert!(steps("time.end=0.22")?.1.contains("4 of 0.05 and one of 0.020000 to t = 0.22\n"));
    Ok(())
}

#[test]
fn a_new_scene_is_checked_runs_and_is_never_overwritten() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let new = |arguments: &[&str]| -> Result<(Option<i32>, String), Failure> {
        let (code, out, err) = said(program().arg("new").args(arguments).current_dir(&folder))?;
        Ok((code, out + &err))
    };
    let (code, list) = new(&[])?;
    assert_eq!(code, Some(0));
    let problems: Vec<&str> = list.lines().skip(2).filter_map(|line| line.split_whitespace().next()).collect();
    assert!(problems.len() >= 6 && list.contains("Rebound of an elastic cylinder"), "{list}");
    for problem in problems {
        let (code, text) = new(&[problem])?;
        assert_eq!(code, Some(0), "{text}");
        assert!(text.contains("bodies[].density") && text.contains("Mass per reference volume, > 0."), "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 110), "{text}");
        let file = folder.path().join(format!("{problem}.json"));
        let scene = std::fs::read_to_string(&file)?;
        let schema = folder.path().join("scene.schema.json");
        assert_eq!(serde_json::from_str::<Value>(&scene)?["$schema"], "scene.schema.json");
        assert!(serde_json::from_slice::<Value>(&std::fs::read(&schema)?)?["$defs"].is_object());
        let (code, _, text) = check(&file, &[])?;
        assert_eq!(code, Some(0), "{text}");
        let out = folder.path().join(problem);
        let (code, _, text) = run(&file, &out, &["--steps", "3", "--quiet"])?;
        assert_eq!((code, text.as_str()), (Some(0), ""));
        assert_eq!(report(&out)?["counts"]["steps"], 3);
        let (code, text) = new(&[problem])?;
        assert_eq!(code, Some(2), "{text}");
        assert!(text.contains(&format!("error: {problem}.json exists and stays as it is")), "{text}");
        assert!(text.contains("bfree new PROBLEM FILE") && !text.contains("os error"), "{text}");
        assert_eq!(std::fs::read_to_string(&file)?, scene);
    }
    let (code, text) = new(&["rebund"])?;
    assert!(code == Some(2) && text.contains("'rebound'"), "{text}");
    Ok(())
}
