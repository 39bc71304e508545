//! The program as its user meets it: exit codes, messages, signals, closed pipes.

use crate::support::Failure;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

fn program() -> Command {
    let mut program = Command::new(env!("CARGO_BIN_EXE_bfree"));
    program.stdin(Stdio::null());
    program
}

/// Runs the rebound with further arguments into `directory`.
fn rebound(directory: &Path, arguments: &[&str]) -> Result<Output, Failure> {
    Ok(program().arg("run").arg(scene("rebound.json")).arg("--out").arg(directory).args(arguments).output()?)
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
        // Both pipes are closed before the program starts, so that its first line meets a broken one.
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
    let run = program()
        .arg("run")
        .arg(scene("rebound.json"))
        .arg("--out")
        .arg(directory.path())
        // Longer than any machine needs to send the signal.
        .args(["--until", "1e6"])
        .stderr(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    let history = directory.path().join("history.csv");
    let rows = || std::fs::read_to_string(&history).map_or(0, |text| text.lines().count());
    let start = Instant::now();
    while rows() < 5 && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(5));
    }
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
    assert!(
        report["message"]
            .as_str()
            .is_some_and(|words| words.contains(&format!("t = {time},")) && words.contains("complete")),
        "{report}"
    );
    assert!(message.contains(&format!("interrupted at t = {time}")), "{message}");
    let steps = report["steps"].as_array().map_or(0, Vec::len);
    assert!(steps > 0 && time < 1e6, "{steps} steps");
    assert_eq!(text.lines().count(), steps + 2, "a header, the initial state and a row a step");
    Ok(())
}

/// A run with further arguments that ends by itself: its code, and what it told.
fn told(arguments: &[&str], directory: &Path) -> Result<(Option<i32>, String), Failure> {
    let output = rebound(directory, &[&["--steps", "2"], arguments].concat())?;
    Ok((output.status.code(), String::from_utf8(output.stderr)?))
}

#[cfg(unix)]
#[test]
fn what_is_there_is_not_lost() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let out = folder.path().join("run");
    let pictures = |directory: &Path| -> Result<usize, Failure> {
        let names =
            std::fs::read_dir(directory)?.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>, Failure>>()?;
        let drawn =
            |path: &&PathBuf| path.extension().is_some_and(|end| ["svg", "png", "html"].iter().any(|one| end == *one));
        Ok(names.iter().filter(drawn).count())
    };
    assert_eq!(told(&["--plot"], &out)?.0, Some(0));
    let drawn = pictures(&out)?;
    let history = std::fs::read(out.join("history.csv"))?;
    let (code, text) = told(&["--set", "time.step=0.01"], &out)?;
    assert!(code == Some(2) && text.contains("holds the results of a run") && text.contains("--discard"), "{text}");
    assert_eq!(std::fs::read(out.join("history.csv"))?, history);
    // What a link leads to is somebody else's.
    let foreign = folder.path().join("foreign");
    std::fs::write(&foreign, "mine")?;
    std::fs::remove_file(out.join("history.csv"))?;
    std::os::unix::fs::symlink(&foreign, out.join("history.csv"))?;
    assert_eq!(told(&["--discard"], &out)?.0, Some(0));
    assert_eq!(std::fs::read_to_string(&foreign)?, "mine");
    assert_eq!(std::fs::read(out.join("history.csv"))?, history);
    // No picture of what is gone stays beside it.
    assert_eq!((drawn, pictures(&out)?), (15, 0));
    // Nor is what a run did not write taken for its own.
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

#[cfg(unix)]
#[test]
fn two_runs_share_no_directory_and_a_batch_system_may_end_one() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let mut first = program();
    first.arg("run").arg(scene("rebound.json")).arg("--out").arg(directory.path()).args(["--until", "1e6", "--quiet"]);
    let mut first = first.spawn()?;
    let history = directory.path().join("history.csv");
    let start = Instant::now();
    while std::fs::read_to_string(&history).map_or(0, |text| text.lines().count()) < 5 {
        assert!(start.elapsed() < Duration::from_secs(60), "no step");
        std::thread::sleep(Duration::from_millis(5));
    }
    for argument in [&[][..], &["--discard"], &["--restart"]] {
        let (code, text) = told(argument, directory.path())?;
        assert!(code == Some(2) && text.contains("another program is just writing"), "{argument:?}: {text}");
    }
    assert!(Command::new("kill").args(["-TERM", &first.id().to_string()]).status()?.success());
    assert_eq!(first.wait()?.code(), Some(130));
    assert_eq!(report(directory.path())?["outcome"], "interrupted");
    Ok(())
}

#[cfg(target_os = "linux")]
#[test]
fn limits_of_the_shell_are_told_in_a_sentence() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let under = |limit: &str, name: &str, more: &str| -> Result<(Option<i32>, String), Failure> {
        let (bfree, scene, out) = (env!("CARGO_BIN_EXE_bfree"), scene(name), directory.path().join(name));
        let line = format!("{limit}; exec {bfree} run {} --threads 1 --out {} {more}", scene.display(), out.display());
        let output = Command::new("sh").args(["-c", &line]).stdin(Stdio::null()).output()?;
        Ok((output.status.code(), String::from_utf8(output.stderr)?))
    };
    let (code, text) = under("ulimit -f 4", "rebound.json", "--steps 100")?;
    assert!(code == Some(1) && text.contains("cannot write") && text.contains("File too large"), "{text}");
    let (code, text) = under("ulimit -v 400000", "block_static.json", "--set grid.spacing=0.02")?;
    assert!(code == Some(2) && text.contains("memory"), "{text}");
    // Nobody writes into it.
    let pipe = directory.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status()?.success());
    let output = program().arg("check").arg(&pipe).output()?;
    let text = String::from_utf8(output.stderr)?;
    assert!(output.status.code() == Some(2) && text.contains("named pipe"), "{text}");
    Ok(())
}

#[test]
fn keys_are_refused_that_are_not_written_as_keys_are() -> Result<(), Failure> {
    let check = |argument: &str| -> Result<(Option<i32>, String), Failure> {
        let output = program().arg("check").arg(scene("rebound.json")).args(["--set", argument]).output()?;
        Ok((output.status.code(), String::from_utf8(output.stderr)?))
    };
    for argument in [
        "bodies[0.density=2",
        "bodies0].density=2",
        "bodies[].density=2",
        "bodies[0]x.density=2",
        "time..step=1",
        ".time.step=1",
        "time.step.=1",
        "=1",
    ] {
        let (code, text) = check(argument)?;
        assert!(code == Some(2) && text.contains("must read KEY.PATH=JSON"), "{argument}: {text}");
    }
    for argument in
        ["bodies[0].density=2", "bodies.0.density=2", " time.step = 0.01", "bodies.0.particles_per_cell=2.0"]
    {
        assert_eq!(check(argument)?, (Some(0), String::new()), "{argument}");
    }
    for (poisson, young) in [("0.49999999999999994", "100"), ("0.3", "1e-308")] {
        let (code, text) =
            check(&format!(r#"bodies.0.material={{"neo_hookean":{{"young":{young},"poisson":{poisson}}}}}"#))?;
        assert!(code == Some(2) && text.contains("bodies[0].material.neo_hookean"), "{text}");
    }
    let (code, text) = check("bodies.0.particles_per_cell=2.5")?;
    assert!(code == Some(2) && text.contains("2.5"), "{text}");
    let (code, text) = check(r#"bodies.0.name="a\u0000b""#)?;
    assert!(code == Some(2) && text.contains("bodies[0].name"), "{text}");
    Ok(())
}

#[test]
fn options_are_judged_like_the_scene() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let out = directory.path().join("run");
    for (option, value, allowed) in [
        ("--until", "nan", "finite and > 0"),
        ("--until", "inf", "greater than 1e-100 and at most 1e100"),
        ("--until", "-5", "finite and > 0"),
        ("--until", "0", "finite and > 0"),
        ("--until", "0.01", "at least one step, 0.05"),
        ("--until", "1e300", "1e100"),
        ("--until", "1e12", "at most 1e9"),
        ("--until", "soon", "must be a number"),
        ("--steps", "-1", "from 0 to 1000000000"),
        ("--steps", "1e3", "from 0 to 1000000000"),
        ("--threads", "0", "from 1 to 1024"),
        ("--threads", "-1", "from 1 to 1024"),
        ("--threads", "100000", "from 1 to 1024"),
        ("--check-tangent", "0", "from 1 to 1000000000"),
    ] {
        let output = rebound(&out, &[option, value])?;
        let message = String::from_utf8(output.stderr)?;
        assert_eq!(output.status.code(), Some(2), "{option} {value}: {message}");
        for word in [option, allowed] {
            assert!(message.contains(word), "{option} {value}: no {word:?} in\n{message}");
        }
        assert!(!out.exists(), "{option} {value} wrote something");
    }
    Ok(())
}

#[test]
fn a_run_ends_at_its_end_between_steps_too() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    // 0.3 / 0.05 is 6 up to rounding; 0.22 / 0.05 is not whole.
    for (until, steps) in [("0.3", 6), ("0.22", 5)] {
        let output = rebound(directory.path(), &["--until", until, "--discard"])?;
        assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8(output.stderr)?);
        let report = report(directory.path())?;
        let time = report["time"].as_f64().ok_or("no time")?;
        assert!((time - until.parse::<f64>()?).abs() < 1e-15, "{time}");
        assert_eq!(report["counts"]["steps"].as_u64(), Some(steps));
    }
    // Steps that are counted are whole ones.
    rebound(directory.path(), &["--until", "0.22", "--steps", "4", "--discard"])?;
    assert_eq!(report(directory.path())?["time"].as_f64(), Some(0.2));
    let check = |set: &str| -> Result<String, Failure> {
        Ok(String::from_utf8(program().arg("check").arg(scene("rebound.json")).args(["--set", set]).output()?.stdout)?)
    };
    assert!(check("time.end=4")?.contains("80 of 0.05 to t = 4\n"));
    assert!(check("time.end=0.22")?.contains("4 of 0.05 and one of 0.020000 to t = 0.22\n"));
    Ok(())
}

#[test]
fn check_says_how_far_apart_bodies_feel_each_other() -> Result<(), Failure> {
    let check = |set: &str| -> Result<String, Failure> {
        let output = program().arg("check").arg(scene("collision.json")).args(["--set", set]).output()?;
        assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8(output.stderr)?);
        Ok(String::from_utf8(output.stdout)?)
    };
    assert!(check("approximation=\"linear\"")?.contains("0.1000 to 0.3500 apart (0.4 to 1.4 spacings)"));
    assert!(check("approximation={\"lme\": {\"gamma\": 2}}")?.contains("how far was not measured"));
    Ok(())
}

#[test]
fn load_steps_have_no_balance() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let out = directory.path().join("run");
    let status = program()
        .arg("run")
        .arg(scene("column_static.json"))
        .args(["--steps", "1", "--quiet", "--out"])
        .arg(&out)
        .status()?;
    assert!(status.success());
    let history = std::fs::read_to_string(out.join("history.csv"))?;
    let columns: Vec<&str> = history.lines().next().unwrap_or_default().split(',').collect();
    assert!(columns.contains(&"strain") && !columns.contains(&"balance"), "{columns:?}");
    assert_eq!(history.lines().last().map(|row| row.split(',').count()), Some(columns.len()));
    Ok(())
}

#[test]
fn the_report_says_what_was_asked_for() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let far = r#"output.probes=[{"name": "far", "field": "velocity", "at": {"point": [14, 4]}},
                               {"name": "near", "field": "velocity", "at": {"particle": [2.5, 2.5]}}]"#;
    let arguments =
        ["--set", far, "--until", "0.3", "--steps", "4", "--threads", "1", "--check-tangent", "3", "--quiet"];
    let output = rebound(directory.path(), &arguments)?;
    let message = String::from_utf8(output.stderr)?;
    assert!(output.status.success(), "{message}");
    assert!(
        message.starts_with("warning: probe \"far\": the nearest particle") && message.contains("spacing 2.500e-1;"),
        "{message}"
    );
    assert_eq!(message.lines().count(), 1, "{message}");
    let report = report(directory.path())?;
    let command = &report["command"];
    assert_eq!((&command["until"], &command["steps"], &command["threads"]), (&0.3.into(), &4.into(), &1.into()));
    assert_eq!((&command["check_tangent"], &command["set"][0]), (&3.into(), &far.into()));
    assert_eq!(report["settings"]["time"]["end"], 0.3);
    assert_eq!(report["steps"].as_array().map(Vec::len), Some(4));
    assert_eq!((&report["outcome"], &report["surfaces"]), (&"finished".into(), &Value::Array(Vec::new())));
    // 3 spacings beyond the disc of radius 1.5 around (2.5, 2.5), and half a diagonal of ¼ from its centre
    assert!(report["probes"][0]["distance"].as_f64().is_some_and(|distance| distance > 10.0), "{report}");
    assert_eq!(report["probes"][1]["distance"].as_f64(), Some(0.125 * 2.0_f64.sqrt()));
    assert_eq!(report["probes"][1]["warning"], Value::Null);
    let probes = std::fs::read_to_string(directory.path().join("probes.csv"))?;
    assert!(probes.lines().skip(1).all(|row| row.split(',').nth(1) == Some("NaN")), "{probes}");
    Ok(())
}

#[test]
fn a_failed_run_reports_every_attempt_and_its_work() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    // One iteration never suffices, and the step is halved twice.
    let few = ["--set", "solver.newton.max_iterations=1", "--set", "time.max_halvings=2", "--steps", "400", "--quiet"];
    let output = rebound(directory.path(), &[&few[..], &["--set", "solver.newton.tolerance=1e-14"]].concat())?;
    let message = String::from_utf8(output.stderr)?;
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert_eq!(message.matches("allowed iterations").count(), 1, "{message}");
    let report = report(directory.path())?;
    let sum = |key: &str| {
        let steps = report["steps"].as_array().into_iter().flatten();
        let attempts = report["failed_attempts"].as_array().into_iter().flatten();
        let within = steps.clone().flat_map(|step| step["failed_attempts"].as_array().into_iter().flatten());
        steps.chain(attempts).chain(within).map(|line| line[key].as_array().map_or(0, Vec::len)).sum::<usize>()
    };
    let attempts = report["failed_attempts"].as_array().ok_or("no attempts")?;
    assert_eq!(attempts.len(), 3, "{report}");
    for (k, attempt) in attempts.iter().enumerate() {
        assert_eq!(attempt["dt"].as_f64(), Some(0.05 * 0.5_f64.powi(k as i32)));
        assert!(attempt["why"].as_str().is_some_and(|why| why.contains("after the 1 allowed iterations")), "{attempt}");
    }
    assert_eq!(report["outcome"], "failed");
    assert_eq!(report["counts"]["newton_iterations"], sum("krylov_iterations"));
    assert!(report["counts"]["failed_attempts"].as_u64().is_some_and(|count| count >= 3));
    Ok(())
}

#[test]
fn every_refusal_names_the_file() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let deep = "[".repeat(100_000);
    let cases: [(&str, &[u8], &str); 6] = [
        ("empty.json", b" \n", "the text is empty; a scene is an object"),
        ("bytes.json", b"{\xff", "not UTF-8"),
        ("deep.json", deep.as_bytes(), "recursion limit"),
        ("twice.json", b"{\"grid\": 1, \"grid\": 2}", "`grid` is given twice"),
        ("words.json", b"hello", "expected value"),
        ("none.json", b"{}", "missing field `grid`"),
    ];
    for (name, content, allowed) in cases {
        let path = directory.path().join(name);
        std::fs::write(&path, content)?;
        for command in ["check", "run"] {
            let output = program().arg(command).arg(&path).output()?;
            let message = String::from_utf8(output.stderr)?;
            assert_eq!(output.status.code(), Some(2), "{name}: {message}");
            assert!(message.contains(name) && message.contains(allowed), "{name}: {message}");
            assert!(message.len() < 1000, "{name}: {message}");
        }
    }
    for absent in [directory.path().to_owned(), directory.path().join("nowhere.json")] {
        let output = program().arg("run").arg(&absent).output()?;
        let message = String::from_utf8(output.stderr)?;
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(&format!("cannot read {}", absent.display())), "{message}");
    }
    Ok(())
}

#[test]
fn a_new_scene_is_checked_runs_and_is_never_overwritten() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let new = |arguments: &[&str]| -> Result<(Option<i32>, String), Failure> {
        let output = program().arg("new").args(arguments).current_dir(&folder).output()?;
        Ok((output.status.code(), String::from_utf8(output.stdout)? + &String::from_utf8(output.stderr)?))
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
        let output = program().arg("check").arg(&file).output()?;
        assert!(output.status.success(), "{}", String::from_utf8(output.stderr)?);
        let out = folder.path().join(problem);
        let output = program().arg("run").arg(&file).args(["--steps", "3", "--quiet", "--out"]).arg(&out).output()?;
        assert_eq!((output.status.code(), String::from_utf8(output.stderr)?.as_str()), (Some(0), ""));
        assert_eq!(report(&out)?["counts"]["steps"], 3);
        let (code, text) = new(&[problem])?;
        assert!(
            code == Some(2) && text.contains(&format!("cannot write {problem}.json")) && text.contains("exists"),
            "{text}"
        );
        assert_eq!(std::fs::read_to_string(&file)?, scene);
    }
    let (code, text) = new(&["rebund"])?;
    assert!(code == Some(2) && text.contains("'rebound'"), "{text}");
    Ok(())
}

#[test]
fn a_program_that_watches_reads_json() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let far = r#"output.probes=[{"name": "far", "field": "velocity", "at": {"point": [14, 4]}}]"#;
    let arguments = ["--progress", "json", "--until", "24", "--set", "time.lumping=0.05", "--set", far];
    let output = rebound(directory.path(), &arguments)?;
    let text = String::from_utf8(output.stderr)?;
    assert!(output.status.success(), "{text}");
    let lines: Vec<Value> = text.lines().map(serde_json::from_str).collect::<Result<_, _>>()?;
    assert_eq!(lines[0]["event"], "warning");
    assert!(lines[0]["message"].as_str().is_some_and(|words| words.starts_with("probe \"far\"")), "{text}");
    let steps: Vec<&Value> = lines.iter().filter(|line| line["event"] == "step").collect();
    let last = steps.last().ok_or("no step")?;
    assert_eq!((&last["step"], &last["time"], &last["end"]), (&480.into(), &24.0.into(), &24.0.into()));
    let history = std::fs::read_to_string(directory.path().join("history.csv"))?;
    let row: Vec<&str> = history.lines().last().ok_or("no rows")?.split(',').collect();
    assert_eq!((last["balance"].as_f64(), last["krylov"].to_string()), (row[7].parse().ok(), row[11].to_owned()));
    assert!(last["seconds_left"].as_f64() == Some(0.0) && last["seconds"].as_f64() > Some(0.0), "{last}");
    assert!(steps.is_sorted_by_key(|step| step["step"].as_u64()));
    // what was warned of is in the report too
    let warned = lines.iter().filter(|line| line["event"] == "warning" && line["kind"].is_string()).count();
    assert_eq!(report(directory.path())?["warnings"].as_array().map(Vec::len), Some(warned));
    // and so is an error
    let wrong = rebound(directory.path(), &["--progress", "json", "--set", "time.step=-1"])?;
    let error: Value = serde_json::from_slice(&wrong.stderr)?;
    assert_eq!((&error["event"], &error["code"], wrong.status.code()), (&"error".into(), &2.into(), Some(2)));
    assert!(error["message"].as_str().is_some_and(|text| text.contains("rebound.json")), "{error}");
    assert!(
        error["because"].to_string().contains("time.step") || error["message"].to_string().contains("time.step"),
        "{error}"
    );
    let both = rebound(directory.path(), &["--progress", "json", "--quiet"])?;
    assert_eq!(both.status.code(), Some(2));
    Ok(())
}

#[test]
fn a_run_warns_once_of_halved_steps_and_many_iterations() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let scene = scene("rebound_fast.json");
    let arguments = ["--set", "time.step=0.2", "--set", "solver.newton.max_iterations=3", "--until", "6", "--quiet"];
    let output = program().arg("run").arg(scene).arg("--out").arg(directory.path()).args(arguments).output()?;
    let text = String::from_utf8(output.stderr)?;
    assert!(output.status.success(), "{text}");
    assert_eq!(text.matches("the step had to be halved").count(), 1, "{text}");
    assert!(text.contains("of 3 allowed iterations"), "{text}");
    let warnings = report(directory.path())?["warnings"].clone();
    for warning in warnings.as_array().ok_or("no warnings")? {
        let (time, step) = (warning["time"].as_f64().ok_or("no time")?, &warning["step"]);
        let line = format!("warning: t = {time}, step {step}: {}", warning["message"].as_str().unwrap_or_default());
        assert_eq!(text.matches(&line).count(), 1, "{line} in {text}");
    }
    Ok(())
}

#[test]
fn a_run_says_what_solves_its_systems_and_warns_of_those_left_unsolved() -> Result<(), Failure> {
    const METHOD: &str = "solver.krylov.method=\"automatic\"";
    let directory = tempfile::tempdir()?;
    let arguments = ["--steps", "2", "--set", "solver.krylov.max_iterations=2", "--set", METHOD];
    let mut run = program();
    let output =
        run.arg("run").arg(scene("compaction.json")).arg("--out").arg(directory.path()).args(arguments).output()?;
    let (text, told) = (String::from_utf8(output.stdout)?, String::from_utf8(output.stderr)?);
    assert!(output.status.success(), "{told}");
    assert!(text.contains("of conjugate gradients a step"), "{text}");
    assert_eq!(told.matches("left unsolved after the 2 iterations allowed").count(), 1, "{told}");
    let report = report(directory.path())?;
    assert_eq!(report["counts"]["krylov_limited"], report["counts"]["newton_iterations"]);
    let krylov = serde_json::json!({ "method": "conjugate gradients", "why": "the tangent is symmetric" });
    assert_eq!((&report["krylov"], &report["warnings"][0]["kind"]), (&krylov, &"krylov_limited".into()));
    let output = program().arg("check").arg(scene("compaction.json")).output()?;
    let text = String::from_utf8(output.stdout)?;
    assert!(text.contains("solver        GMRES(30): it was asked for"), "{text}");
    Ok(())
}

#[test]
fn a_cause_is_told_once() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let file = directory.path().join("file");
    std::fs::write(&file, "")?;
    let output = rebound(&file.join("run"), &[])?;
    let message = String::from_utf8(output.stderr)?;
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("cannot create") && message.contains("file/run"), "{message}");
    assert_eq!(message.matches("os error").count(), 1, "{message}");
    Ok(())
}
