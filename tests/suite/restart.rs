//! A killed run continues with the same bits, and a faulty checkpoint is reported.

use crate::support::{Failure, Random};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// The rebound with walls, smoothing and probes, up to the first impact and back; a checkpoint every 20 steps.
const SMOOTHED: [&str; 8] = [
    "--set",
    r#"transfer={"blend": {"rate": 0.05}}"#,
    "--set",
    "output.checkpoint=1",
    "--set",
    "bodies.0.velocity=[2, 0.1]",
    "--until",
    "12",
];

fn program(scene: &str, directory: &Path, arguments: &[&str]) -> Command {
    let mut program = Command::new(env!("CARGO_BIN_EXE_bfree"));
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(scene);
    program.arg("run").arg(scene).arg("--out").arg(directory).args(arguments);
    program.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    program
}

fn run(scene: &str, directory: &Path, arguments: &[&[&str]]) -> Result<Output, Failure> {
    Ok(program(scene, directory, &arguments.concat()).output()?)
}

fn message(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// All files of a run except its checkpoints. The report lacks the entries that may differ: seconds, and the place and extent of the first
/// run.
fn files(directory: &Path) -> Result<BTreeMap<String, Vec<u8>>, Failure> {
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(directory)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if name.starts_with("checkpoint") {
            continue;
        }
        let mut content = std::fs::read(&path)?;
        if name == "report.json" {
            let mut report: Value = serde_json::from_slice(&content)?;
            let removed = report.as_object_mut().ok_or("no report")?.remove("seconds");
            assert!(removed.is_some_and(|seconds| seconds["total"].as_f64() > Some(0.0)));
            for key in ["out", "steps"] {
                report["command"][key] = Value::Null;
            }
            content = report.to_string().into_bytes();
        }
        files.insert(name, content);
    }
    Ok(files)
}

fn assert_same(undisturbed: &Path, restarted: &Path) -> Result<(), Failure> {
    let (expected, found) = (files(undisturbed)?, files(restarted)?);
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&expected), names(&found));
    for (name, content) in &expected {
        assert!(found.get(name) == Some(content), "{name} differs in {}", restarted.display());
    }
    Ok(())
}

fn checkpoints(directory: &Path) -> Vec<std::path::PathBuf> {
    (0..2).map(|k| directory.join(format!("checkpoint_{k}.bfree"))).filter(|path| path.exists()).collect()
}

#[test]
fn a_shortened_last_step_is_taken_back_by_a_restart() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let (whole, parts) = (folder.path().join("whole"), folder.path().join("parts"));
    let common = ["--quiet", "--set", "output.every=0.1", "--set", "output.checkpoint=1"];
    assert!(run("rebound.json", &whole, &[&common, &["--until", "0.73"]])?.status.success());
    assert!(run("rebound.json", &parts, &[&common, &["--until", "0.32"]])?.status.success());
    let history = std::fs::read_to_string(parts.join("history.csv"))?;
    assert!(history.lines().last().is_some_and(|row| row.starts_with("7,0.32,0.0")), "{history}");
    assert!(run("rebound.json", &parts, &[&common, &["--until", "0.73", "--restart"]])?.status.success());
    assert_same(&whole, &parts)?;
    // A restart cannot end before the time already reached.
    let earlier = run("rebound.json", &parts, &[&common, &["--until", "0.3", "--restart"]])?;
    let text = String::from_utf8_lossy(&earlier.stderr);
    assert!(!earlier.status.success() && text.contains("beyond the end, t = 0.3"), "{text}");
    Ok(())
}

/// (scene, keys that are set, further arguments)
const IN_PARTS: [(&str, &[&str], &[&str]); 8] = [
    // Walls and smoothing.
    ("rebound.json", &[SMOOTHED[1], SMOOTHED[3], SMOOTHED[5]], &["--until", "12"]),
    // A prescribed motion with work and a load.
    ("compaction.json", &["output.checkpoint=0.1"], &["--until", "0.5", "--threads", "2"]),
    // Halved steps among whole ones.
    (
        "rebound_fast.json",
        &["time.step=0.2", "solver.newton.max_iterations=3", "output.checkpoint=0.5"],
        &["--until", "6"],
    ),
    // Along an equilibrium path, whose loads fall.
    (
        "elastica.json",
        &[
            r#"time={"step":0.02,"end":0.3,"scheme":"arc_length"}"#,
            "grid.spacing=0.5",
            "output.every=0.1",
            "output.checkpoint=0.1",
        ],
        &[],
    ),
    // Inertia with one reference configuration, reset when the body meets a wall.
    ("rebound.json", &[r#"grid.reset="never""#, "output.checkpoint=1"], &["--until", "12"]),
    // Load steps without a grid reset.
    ("column_static.json", &["output.checkpoint=0.2", "time.step=0.04"], &[]),
    // Steps of adaptive length.
    (
        "rebound_fast.json",
        &["time.step=0.4", r#"time.adaptive={"tolerance":1e-3}"#, "output.checkpoint=0.5"],
        &["--until", "10"],
    ),
    // Load steps with occasional grid resets, which carry over the out-of-balance force.
    (
        "elastica.json",
        &[r#"grid.reset={"strain":0.05}"#, "grid.spacing=0.5", "time.step=0.02", "output.checkpoint=0.1"],
        &[],
    ),
];

#[test]
fn a_run_in_three_parts_has_the_bits_of_one() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    for (k, (scene, sets, more)) in IN_PARTS.into_iter().enumerate() {
        let set = sets.iter().flat_map(|set| ["--set", *set]);
        let arguments: Vec<&str> = set.chain(more.iter().copied()).collect();
        let (whole, parts) = (folder.path().join(format!("whole{k}")), folder.path().join(format!("parts{k}")));
        assert!(run(scene, &whole, &[&arguments])?.status.success());
        for part in [&["--steps", "7"][..], &["--steps", "23", "--restart"], &["--restart"]] {
            let output = run(scene, &parts, &[&arguments, part])?;
            assert!(output.status.success(), "{}", message(&output));
            assert!(part.len() == 2 || message(&output).contains("continues at t = "), "{}", message(&output));
        }
        assert_same(&whole, &parts)?;
        let steps = std::fs::read_to_string(whole.join("newton.jsonl"))?;
        assert!(![2, 6].contains(&k) || steps.contains("failed_attempts"), "scene {k} is meant to halve steps");
    }
    Ok(())
}

/// Runs killed at any moment, also during a restart. `BFREE_KILLS=50` kills more often.
#[test]
fn a_run_killed_at_any_moment_ends_in_the_same_bits() -> Result<(), Failure> {
    let kills = std::env::var("BFREE_KILLS").map_or(Ok(5), |kills| kills.parse::<usize>())?;
    let folder = tempfile::tempdir()?;
    let whole = folder.path().join("whole");
    let start = Instant::now();
    assert!(run("rebound.json", &whole, &[&SMOOTHED])?.status.success());
    let duration = start.elapsed().as_micros() as u64;
    let mut random = Random(6);
    let (mut done, mut middle) = (0, 0);
    while done < kills {
        let killed = folder.path().join(format!("killed{done}"));
        loop {
            let restart: &[&str] = if checkpoints(&killed).is_empty() { &[] } else { &["--restart"] };
            let mut child = program("rebound.json", &killed, &[&SMOOTHED, restart].concat()).spawn()?;
            std::thread::sleep(Duration::from_micros(random.below(duration)));
            child.kill()?;
            let finished = child.wait()?.success();
            done += usize::from(!finished);
            middle += usize::from(!finished && !checkpoints(&killed).is_empty());
            if finished || random.below(2) == 0 || done == kills {
                break;
            }
        }
        let restart: &[&str] = if checkpoints(&killed).is_empty() { &[] } else { &["--restart"] };
        let output = run("rebound.json", &killed, &[&SMOOTHED, restart])?;
        assert!(output.status.success(), "{}", message(&output));
        assert!(!message(&output).contains("cannot be used"), "{}", message(&output));
        assert_same(&whole, &killed)?;
        std::fs::remove_dir_all(&killed)?;
    }
    println!("{done} kills, {middle} of them with a checkpoint to continue from");
    assert!(middle > 0, "no kill found a checkpoint");
    Ok(())
}

/// A run of 60 of 240 steps, with its checkpoints: the newer one at step 60, the other at step 40.
fn cut(directory: &Path) -> Result<(), Failure> {
    let output = run("rebound.json", directory, &[&SMOOTHED, &["--steps", "59"]])?;
    assert!(output.status.success(), "{}", message(&output));
    assert_eq!(checkpoints(directory).len(), 2);
    Ok(())
}

fn copy(from: &Path, to: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(to)?;
    for entry in std::fs::read_dir(from)? {
        let entry = entry?;
        std::fs::copy(entry.path(), to.join(entry.file_name()))?;
    }
    Ok(())
}

#[test]
fn the_last_good_checkpoint_is_used_and_said_so() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let (whole, first) = (folder.path().join("whole"), folder.path().join("first"));
    assert!(run("rebound.json", &whole, &[&SMOOTHED])?.status.success());
    cut(&first)?;
    // Steps 0, 20, 40 and 59, in turns: the last is in the second file.
    let newest = "checkpoint_1.bfree";
    let good = std::fs::read(first.join(newest))?;
    let flipped = |at: usize| {
        let mut bytes = good.clone();
        bytes[at] ^= 4;
        bytes
    };
    let damages = [
        (good[..good.len() - 1].to_vec(), "bytes and should have"),
        (good[..good.len() / 2].to_vec(), "bytes and should have"),
        (good[..30].to_vec(), "bytes and should have"),
        (Vec::new(), "no checkpoint of bfree"),
        (b"PK\x03\x04 something else".to_vec(), "no checkpoint of bfree"),
        (flipped(9), "format is version"),
        (flipped(100), "header is damaged"),
        (flipped(good.len() - 5), "array path is damaged"),
        (flipped(good.len() - 41), "array dissipated is damaged"),
        (flipped(good.len() - 2000), "array displacement_gradient is damaged"),
    ];
    for (k, (bytes, words)) in damages.iter().enumerate() {
        let damaged = folder.path().join(format!("damaged{k}"));
        copy(&first, &damaged)?;
        std::fs::write(damaged.join(newest), bytes)?;
        let output = run("rebound.json", &damaged, &[&SMOOTHED, &["--restart"]])?;
        let text = message(&output);
        assert!(output.status.success(), "{text}");
        assert!(text.contains("warning: a checkpoint cannot be used") && text.contains(newest), "{text}");
        assert!(text.contains(words) && text.contains("step 40, from"), "{words}: {text}");
        assert_same(&whole, &damaged)?;
    }
    // The table has lost rows that the newer checkpoint needs, but none that the older one needs.
    let shorter = folder.path().join("shorter");
    copy(&first, &shorter)?;
    let history = std::fs::read_to_string(shorter.join("history.csv"))?;
    let lines: Vec<&str> = history.split_inclusive('\n').collect();
    std::fs::write(shorter.join("history.csv"), lines[..50].concat())?;
    let output = run("rebound.json", &shorter, &[&SMOOTHED, &["--restart"]])?;
    let text = message(&output);
    assert!(text.contains("history.csv ends before") && text.contains("step 40, from"), "{text}");
    assert_same(&whole, &shorter)
}

#[test]
fn a_missing_snapshot_is_named_and_the_run_goes_on() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let (whole, first) = (folder.path().join("whole"), folder.path().join("first"));
    assert!(run("rebound.json", &whole, &[&SMOOTHED])?.status.success());
    cut(&first)?;
    std::fs::remove_file(first.join("particles_000001.vtu"))?;
    let output = run("rebound.json", &first, &[&SMOOTHED, &["--restart"]])?;
    let text = message(&output);
    assert!(output.status.success() && text.contains("step 59, from"), "{text}");
    assert!(
        text.contains("snapshots of the run are not there any more") && text.contains("particles_000001.vtu"),
        "{text}"
    );
    // All other files equal those of an undisturbed run; pictures omit the snapshot.
    std::fs::remove_file(whole.join("particles_000001.vtu"))?;
    assert_same(&whole, &first)?;
    let mut plot = Command::new(env!("CARGO_BIN_EXE_bfree"));
    let output = plot.arg("plot").arg(&first).output()?;
    assert!(output.status.success(), "{}", message(&output));
    Ok(())
}

#[test]
fn what_cannot_be_continued_is_refused_with_its_reason() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let directory = folder.path().join("run");
    let refused = |arguments: &[&[&str]], words: &[&str]| -> Result<(), Failure> {
        let before = files(&directory).ok();
        let output = run("rebound.json", &directory, arguments)?;
        let text = message(&output);
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(words.iter().all(|word| text.contains(word)), "{words:?}: {text}");
        assert_eq!(files(&directory).ok(), before, "a refusal changes nothing");
        Ok(())
    };
    refused(&[&SMOOTHED, &["--restart"]], &["has no checkpoint", "output.checkpoint"])?;
    cut(&directory)?;
    let set = |change: &'static str| [&SMOOTHED[..], &["--restart", "--set", change]].concat();
    refused(&[&set("time.step=0.1")], &["of another scene", "time.step was 0.05 and is 0.1"])?;
    refused(&[&set("bodies.0.density=5")], &["bodies[0].density was 4.0 and is 5.0"])?;
    refused(&[&set("gravity.acceleration=[0, 1]")], &["gravity was null and is {"])?;
    refused(&[&set("output.probes=[]")], &["output.probes[0] was {"])?;
    // One digit of a row is changed.
    let history = directory.join("history.csv");
    let rows = std::fs::read_to_string(&history)?;
    std::fs::write(&history, rows.replacen("0.05,", "0.06,", 1))?;
    refused(&[&SMOOTHED, &["--restart"]], &["history.csv is not what it was"])?;
    std::fs::write(&history, &rows)?;
    for name in ["checkpoint_0.bfree", "checkpoint_1.bfree"] {
        std::fs::write(directory.join(name), "rubbish")?;
    }
    refused(&[&SMOOTHED, &["--restart"]], &["no checkpoint in", "checkpoint_0.bfree: it is no", "checkpoint_1.bfree"])?;
    // A new run in the same directory removes the old checkpoints, so that no restart continues from them.
    assert!(run("rebound.json", &directory, &[&["--steps", "1", "--quiet", "--discard"]])?.status.success());
    assert_eq!(checkpoints(&directory).len(), 0);
    Ok(())
}

#[test]
fn a_changed_particle_file_is_noticed() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let (scene, out) = (folder.path().join("scene.json"), folder.path().join("out"));
    let text = r#"{"grid": {"size": [4, 4], "spacing": 1}, "time": {"step": 0.1, "end": 1},
        "bodies": [{"name": "a", "particles": {"file": "p.csv"}, "density": 1, "material": {"neo_hookean": {"bulk": 1, "shear": 1}}}],
        "output": {"checkpoint": 0.2}}"#;
    std::fs::write(&scene, text)?;
    let run = |volume: f64, arguments: &[&str]| -> Result<Output, Failure> {
        std::fs::write(folder.path().join("p.csv"), format!("x,y,volume\n2,2,{volume}\n2.5,2,0.1\n"))?;
        let mut program = Command::new(env!("CARGO_BIN_EXE_bfree"));
        Ok(program.arg("run").arg(&scene).arg("--out").arg(&out).args(arguments).output()?)
    };
    let output = run(0.1, &["--steps", "3"])?;
    assert!(output.status.success(), "{}", message(&output));
    let output = run(0.2, &["--restart"])?;
    assert!(message(&output).contains("other particles: volume differs"), "{}", message(&output));
    let output = run(0.1, &["--restart"])?;
    assert!(output.status.success(), "{}", message(&output));
    Ok(())
}

/// The shell's limit on the size of files stands for a full disk: writing fails in the middle of a file.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_the_checkpoint_before() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let (whole, full) = (folder.path().join("whole"), folder.path().join("full"));
    // Snapshots would be the first to meet the limit.
    let scene = [&SMOOTHED[..], &["--set", "output.every=100"]].concat();
    assert!(run("rebound.json", &whole, &[&scene])?.status.success());
    assert!(run("rebound.json", &full, &[&scene, &["--steps", "30"]])?.status.success());
    let length = std::fs::metadata(full.join("checkpoint_0.bfree"))?.len();
    let limited = program("rebound.json", &full, &[&scene[..], &["--restart"]].concat());
    let mut shell = Command::new("sh");
    // The limit is in blocks of 512 bytes; the tables are much shorter than a checkpoint at that time.
    let script = format!("trap '' XFSZ; ulimit -f {}; exec \"$0\" \"$@\"", length / 512 - 2);
    shell.args(["-c", &script]).arg(limited.get_program()).args(limited.get_args());
    let output = shell.output()?;
    let text = message(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("no checkpoint could be written at t = 2") && text.contains("too large"), "{text}");
    assert!(text.contains("is whole: --restart continues from it"), "{text}");
    let output = run("rebound.json", &full, &[&scene, &["--restart"]])?;
    assert!(output.status.success() && message(&output).contains("step 30, from"), "{}", message(&output));
    assert_same(&whole, &full)
}

#[test]
fn a_run_that_could_be_continued_is_lost_on_request_only() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let directory = folder.path().join("killed");
    assert!(run("rebound.json", &directory, &[&SMOOTHED, &["--steps", "50"]])?.status.success());
    // The run has ended, and `--discard` may delete it too. Without the report, it counts as a killed run.
    assert!(run("rebound.json", &directory, &[&SMOOTHED, &["--steps", "60", "--discard"]])?.status.success());
    std::fs::remove_file(directory.join("report.json"))?;
    let kept: Vec<Vec<u8>> = checkpoints(&directory).iter().map(std::fs::read).collect::<Result<_, _>>()?;
    let output = run("rebound.json", &directory, &[&SMOOTHED, &["--steps", "10"]])?;
    let text = message(&output);
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("after step 60") && text.contains("--restart") && text.contains("--discard"), "{text}");
    let now: Vec<Vec<u8>> = checkpoints(&directory).iter().map(std::fs::read).collect::<Result<_, _>>()?;
    assert!(now == kept && !kept.is_empty(), "nothing was touched");
    assert!(run("rebound.json", &directory, &[&SMOOTHED, &["--steps", "10", "--discard"]])?.status.success());
    let steps = std::fs::read_to_string(directory.join("history.csv"))?.lines().count();
    assert_eq!(steps, 12, "a header, the start and ten steps");
    Ok(())
}
