//! A killed run continues with the same bits, and a faulty checkpoint is reported.

mod arrays;
mod state;

use crate::support::{Failure, Random, Said, said};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// The rebound with walls, smoothing and probes, up to the first impact and back; a checkpoint every 20 steps.
const SMOOTHED: [&str; 8] = ["--set", BLEND, "--set", "output.checkpoint=1", "--set", FAST, "--until", "12"];
const BLEND: &str = r#"transfer={"blend": {"rate": 0.05}}"#;
const FAST: &str = "bodies.0.velocity=[2, 0.1]";

fn program(scene: &str, directory: &Path, arguments: &[&str]) -> Command {
    let mut program = Command::new(env!("CARGO_BIN_EXE_bfree"));
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(scene);
    program.arg("run").arg(scene).arg("--out").arg(directory).args(arguments);
    program.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    program
}

fn run(scene: &str, directory: &Path, arguments: &[&[&str]]) -> Result<Said, Failure> {
    said(&mut program(scene, directory, &arguments.concat()))
}

/// A run that succeeds. Returns its standard error.
fn done(scene: &str, directory: &Path, arguments: &[&[&str]]) -> Result<String, Failure> {
    let (code, _, text) = run(scene, directory, arguments)?;
    assert_eq!(code, Some(0), "{text}");
    Ok(text)
}

/// All files of a run but its checkpoints and its provenance. The report lacks what may differ: seconds, and the place and extent of the first run.
fn files(directory: &Path) -> Result<BTreeMap<String, Vec<u8>>, Failure> {
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(directory)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if name.starts_with("checkpoint") || name == "provenance.json" {
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
    done("rebound.json", &whole, &[&common, &["--until", "0.73"]])?;
    done("rebound.json", &parts, &[&common, &["--until", "0.32"]])?;
    let history = std::fs::read_to_string(parts.join("history.csv"))?;
    assert!(history.lines().last().is_some_and(|row| row.starts_with("7,0.32,0.0")), "{history}");
    done("rebound.json", &parts, &[&common, &["--until", "0.73", "--restart"]])?;
    assert_same(&whole, &parts)?;
    // A restart cannot end before the time already reached.
    let (code, _, text) = run("rebound.json", &parts, &[&common, &["--until", "0.3", "--restart"]])?;
    assert!(code != Some(0) && text.contains("beyond the end, t = 0.3"), "{text}");
    Ok(())
}

const HALF: &str = "output.checkpoint=0.5";
const TENTH: &str = "output.checkpoint=0.1";
const ALONG_A_PATH: &str = r#"time={"step":0.02,"end":0.3,"scheme":"arc_length"}"#;

/// (scene, keys that are set, further arguments)
const IN_PARTS: [(&str, &[&str], &[&str]); 9] = [
    // Walls and smoothing.
    ("rebound.json", &[BLEND, "output.checkpoint=1", FAST], &["--until", "12"]),
    // A prescribed motion with work and a load.
    ("compaction.json", &[TENTH], &["--until", "0.5", "--threads", "2"]),
    // Halved steps among whole ones.
    ("rebound_fast.json", &["time.step=0.2", "solver.newton.max_iterations=3", HALF], &["--until", "6"]),
    // Along an equilibrium path, whose loads fall.
    ("elastica.json", &[ALONG_A_PATH, "grid.spacing=0.5", "output.every=0.1", TENTH], &[]),
    // Inertia with one reference configuration, reset when the body meets a wall.
    ("rebound.json", &[r#"grid.reset="never""#, "output.checkpoint=1"], &["--until", "12"]),
    // Load steps without a grid reset.
    ("column_static.json", &["output.checkpoint=0.2", "time.step=0.04"], &[]),
    // Friction on an obstacle, on a grid that is kept for some steps.
    ("rolling.json", &[r#"grid.reset={"strain":0.3}"#, TENTH], &["--until", "0.4"]),
    // Steps of adaptive length.
    ("rebound_fast.json", &["time.step=0.4", r#"time.adaptive={"tolerance":1e-3}"#, HALF], &["--until", "10"]),
    // Load steps with occasional grid resets, which carry over the out-of-balance force.
    ("elastica.json", &[r#"grid.reset={"strain":0.05}"#, "grid.spacing=0.5", "time.step=0.02", TENTH], &[]),
];

#[test]
fn a_run_in_three_parts_has_the_bits_of_one() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    for (k, (scene, sets, more)) in IN_PARTS.into_iter().enumerate() {
        let set = sets.iter().flat_map(|set| ["--set", *set]);
        let arguments: Vec<&str> = set.chain(more.iter().copied()).collect();
        let (whole, parts) = (folder.path().join(format!("whole{k}")), folder.path().join(format!("parts{k}")));
        done(scene, &whole, &[&arguments])?;
        for part in [&["--steps", "7"][..], &["--steps", "23", "--restart"], &["--restart"]] {
            let text = done(scene, &parts, &[&arguments, part])?;
            assert!(part.len() == 2 || text.contains("continues at t = "), "{text}");
        }
        assert_same(&whole, &parts)?;
        let steps = std::fs::read_to_string(whole.join("newton.jsonl"))?;
        assert!(![2, 7].contains(&k) || steps.contains("failed_attempts"), "scene {k} is meant to halve steps");
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
    done("rebound.json", &whole, &[&SMOOTHED])?;
    let duration = start.elapsed().as_micros() as u64;
    let mut random = Random(6);
    let (mut killed, mut middle) = (0, 0);
    while killed < kills {
        let parts = folder.path().join(format!("killed{killed}"));
        let restart = || if checkpoints(&parts).is_empty() { &[][..] } else { &["--restart"] };
        loop {
            let mut child = program("rebound.json", &parts, &[&SMOOTHED, restart()].concat()).spawn()?;
            std::thread::sleep(Duration::from_micros(random.below(duration)));
            child.kill()?;
            let finished = child.wait()?.success();
            killed += usize::from(!finished);
            middle += usize::from(!finished && !checkpoints(&parts).is_empty());
            if finished || random.below(2) == 0 || killed == kills {
                break;
            }
        }
        let text = done("rebound.json", &parts, &[&SMOOTHED, restart()])?;
        assert!(!text.contains("cannot be used"), "{text}");
        assert_same(&whole, &parts)?;
        std::fs::remove_dir_all(&parts)?;
    }
    println!("{killed} kills, {middle} of them with a checkpoint to continue from");
    assert!(middle > 0, "no kill found a checkpoint");
    Ok(())
}

/// A run of 60 of 240 steps, with its checkpoints: the newer one at step 60, the other at step 40.
fn cut(directory: &Path) -> Result<(), Failure> {
    done("rebound.json", directory, &[&SMOOTHED, &["--steps", "59"]])?;
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
    done("rebound.json", &whole, &[&SMOOTHED])?;
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
        let text = done("rebound.json", &damaged, &[&SMOOTHED, &["--restart"]])?;
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
    let text = done("rebound.json", &shorter, &[&SMOOTHED, &["--restart"]])?;
    assert!(text.contains("history.csv ends before") && text.contains("step 40, from"), "{text}");
    assert_same(&whole, &shorter)
}

#[test]
fn a_missing_snapshot_is_named_and_the_run_goes_on() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let (whole, first) = (folder.path().join("whole"), folder.path().join("first"));
    done("rebound.json", &whole, &[&SMOOTHED])?;
    cut(&first)?;
    std::fs::remove_file(first.join("particles_000001.vtu"))?;
    let text = done("rebound.json", &first, &[&SMOOTHED, &["--restart"]])?;
    let words = ["step 59, from", "snapshots of the run are not there any more", "particles_000001.vtu"];
    assert!(words.iter().all(|word| text.contains(word)), "{text}");
    // All other files equal those of an undisturbed run; pictures omit the snapshot.
    std::fs::remove_file(whole.join("particles_000001.vtu"))?;
    assert_same(&whole, &first)?;
    let (code, _, text) = said(Command::new(env!("CARGO_BIN_EXE_bfree")).arg("plot").arg(&first))?;
    assert_eq!(code, Some(0), "{text}");
    Ok(())
}

#[test]
fn what_cannot_be_continued_is_refused_with_its_reason() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let directory = folder.path().join("run");
    let refused = |arguments: &[&[&str]], words: &[&str]| -> Result<(), Failure> {
        let before = files(&directory).ok();
        let (code, _, text) = run("rebound.json", &directory, arguments)?;
        assert_eq!(code, Some(2), "{text}");
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
    done("rebound.json", &directory, &[&["--steps", "1", "--quiet", "--discard"]])?;
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
    let run = |volume: f64, arguments: &[&str]| -> Result<(Option<i32>, String), Failure> {
        std::fs::write(folder.path().join("p.csv"), format!("x,y,volume\n2,2,{volume}\n2.5,2,0.1\n"))?;
        let mut program = Command::new(env!("CARGO_BIN_EXE_bfree"));
        let (code, _, text) = said(program.arg("run").arg(&scene).arg("--out").arg(&out).args(arguments))?;
        Ok((code, text))
    };
    assert_eq!(run(0.1, &["--steps", "3"])?.0, Some(0));
    let (_, text) = run(0.2, &["--restart"])?;
    assert!(text.contains("started otherwise: volume differs"), "{text}");
    let (code, text) = run(0.1, &["--restart"])?;
    assert_eq!(code, Some(0), "{text}");
    Ok(())
}

#[test]
fn a_changed_curve_file_is_noticed() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let (scene, out) = (folder.path().join("scene.json"), folder.path().join("out"));
    let text = r#"{"grid": {"size": [2, 2], "spacing": 0.5}, "time": {"step": 0.1, "end": 1}, "output": {"checkpoint": 0.2},
        "bodies": [{"name": "a", "shape": {"box": {"min": [0, 0], "max": [2, 1]}}, "density": 1, "material": {"neo_hookean": {"bulk": 1, "shear": 1}}}],
        "boundary": {"bottom": {"velocity": {"direction": [0.01, 0], "curve": {"file": "ground.csv"}}}}}"#;
    std::fs::write(&scene, text)?;
    let run = |end: f64, arguments: &[&str]| -> Result<(Option<i32>, String), Failure> {
        std::fs::write(folder.path().join("ground.csv"), format!("0 0\n1 {end}\n"))?;
        let mut program = Command::new(env!("CARGO_BIN_EXE_bfree"));
        let (code, _, text) = said(program.arg("run").arg(&scene).arg("--out").arg(&out).args(arguments))?;
        Ok((code, text))
    };
    assert_eq!(run(1.0, &["--steps", "3"])?.0, Some(0));
    let (_, text) = run(2.0, &["--restart"])?;
    assert!(text.contains("started otherwise: boundary.bottom.velocity.curve.file differs"), "{text}");
    let (code, text) = run(1.0, &["--restart"])?;
    assert_eq!(code, Some(0), "{text}");
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
    done("rebound.json", &whole, &[&scene])?;
    done("rebound.json", &full, &[&scene, &["--steps", "30"]])?;
    let length = std::fs::metadata(full.join("checkpoint_0.bfree"))?.len();
    let limited = program("rebound.json", &full, &[&scene[..], &["--restart"]].concat());
    let mut shell = Command::new("sh");
    // The limit is in blocks of 512 bytes; the tables are much shorter than a checkpoint at that time.
    let script = format!("trap '' XFSZ; ulimit -f {}; exec \"$0\" \"$@\"", length / 512 - 2);
    shell.args(["-c", &script]).arg(limited.get_program()).args(limited.get_args());
    let (code, _, text) = said(&mut shell)?;
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("no checkpoint could be written at t = 2") && text.contains("too large"), "{text}");
    assert!(text.contains("is whole: --restart continues from it"), "{text}");
    let text = done("rebound.json", &full, &[&scene, &["--restart"]])?;
    assert!(text.contains("step 30, from"), "{text}");
    assert_same(&whole, &full)
}

#[test]
fn a_run_that_could_be_continued_is_lost_on_request_only() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let directory = folder.path().join("killed");
    done("rebound.json", &directory, &[&SMOOTHED, &["--steps", "50"]])?;
    // The run has ended, and `--discard` may delete it too. Without the report, it counts as a killed run.
    done("rebound.json", &directory, &[&SMOOTHED, &["--steps", "60", "--discard"]])?;
    std::fs::remove_file(directory.join("report.json"))?;
    let kept: Vec<Vec<u8>> = checkpoints(&directory).iter().map(std::fs::read).collect::<Result<_, _>>()?;
    let (code, _, text) = run("rebound.json", &directory, &[&SMOOTHED, &["--steps", "10"]])?;
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("after step 60") && text.contains("--restart") && text.contains("--discard"), "{text}");
    let now: Vec<Vec<u8>> = checkpoints(&directory).iter().map(std::fs::read).collect::<Result<_, _>>()?;
    assert!(now == kept && !kept.is_empty(), "nothing was touched");
    done("rebound.json", &directory, &[&SMOOTHED, &["--steps", "10", "--discard"]])?;
    let steps = std::fs::read_to_string(directory.join("history.csv"))?.lines().count();
    assert_eq!(steps, 12, "a header, the start and ten steps");
    Ok(())
}
