//! The program in several processes that a launcher of MPI starts, where there is one: the same files, the same errors, and nothing that hangs.

use super::FINE;
use crate::support::{Failure, Said, said};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// The launchers of MPI on this machine, with the options that let root start more processes than there are cores.
fn launchers() -> Vec<Vec<&'static str>> {
    let known = [
        vec!["mpirun.openmpi", "--allow-run-as-root", "--oversubscribe"],
        vec!["mpirun.mpich"],
        vec!["mpirun", "--allow-run-as-root", "--oversubscribe"],
    ];
    let is_there = |name: &str| {
        let folders = std::env::var_os("PATH").unwrap_or_default();
        std::env::split_paths(&folders).any(|folder| folder.join(name).is_file())
    };
    let mut found: Vec<_> = known.into_iter().filter(|one| is_there(one[0])).collect();
    if found.len() > 1 {
        found.retain(|one| one[0] != "mpirun");
    }
    if found.is_empty() {
        println!("no launcher of MPI is installed: this test was skipped");
    }
    found
}

/// `bfree run` with these arguments in `count` processes.
fn launched(launcher: &[&str], count: usize, arguments: &[&str]) -> Command {
    let mut command = Command::new(launcher[0]);
    command.args(&launcher[1..]).args(["-n", &count.to_string(), env!("CARGO_BIN_EXE_bfree"), "run"]).args(arguments);
    command
}

/// The files of a run, without those that hold times or flags.
fn files(folder: &Path) -> Result<BTreeMap<PathBuf, Vec<u8>>, Failure> {
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let is_of_results = name.ends_with(".csv") || name.ends_with(".vtu") || name.ends_with(".pvd");
        if path.is_file() && is_of_results {
            files.insert(PathBuf::from(name), std::fs::read(&path)?);
        }
    }
    Ok(files)
}

#[test]
fn a_run_under_mpi_writes_the_same_files() -> Result<(), Failure> {
    // Every process has the state of all particles; only its own, and process 0 has none of them: the body is one block of cells.
    writes_the_same_files("ball_drop.json", &["--set", "output.checkpoint=2", "--set", "output.every=0.01"])?;
    let fields = "output.fields=[\"velocity\", \"stress\", \"displacement\"]";
    let probes = json!([
        {"name": "particle", "field": "stress", "at": {"particle": [2.5, 2.6]}},
        {"name": "carried", "field": "displacement", "at": {"body_point": [3.1, 2.2]}},
        {"name": "nearest", "field": "velocity", "at": {"point": [2.5, 2.5]}},
    ]);
    let probes = format!("output.probes={probes}");
    writes_the_same_files("rebound.json", &["--set", &probes, "--set", "output.every=0.1", "--set", fields])
}

/// Runs of one process and of several write the same files.
fn writes_the_same_files(scene: &str, arguments: &[&str]) -> Result<(), Failure> {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(scene);
    let scene = scene.to_str().unwrap();
    for launcher in launchers() {
        let folder = tempfile::tempdir()?;
        let out = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        let run = |count: usize, name: &str| {
            let out = out(name);
            said(&mut launched(&launcher, count, &[&[scene, "--out", &out, "--steps", "5"], arguments].concat()))
        };
        let (code, shown, told) = run(1, "one")?;
        assert_eq!(code, Some(0), "{told}");
        for count in [2, 3] {
            let (code, of_several, told) = run(count, &format!("of {count}"))?;
            assert_eq!(code, Some(0), "{launcher:?}: {told}");
            assert_eq!(of_several.matches("results").count(), shown.matches("results").count(), "{of_several}");
            assert!(files(Path::new(&out("one")))? == files(Path::new(&out(&format!("of {count}"))))?, "{launcher:?}");
        }
        // An error is told once, and all processes end.
        let (code, _, told): Said = run(3, "one")?;
        assert_eq!((code, told.matches("error: ").count()), (Some(2), 1), "{launcher:?}: {told}");
        let (code, _, told): Said = said(&mut launched(&launcher, 2, &["no_such_scene.json"]))?;
        assert_eq!((code, told.matches("error: ").count()), (Some(2), 1), "{launcher:?}: {told}");
    }
    Ok(())
}

/// The process numbers of the programs that write to a folder, without their launcher.
fn writing_to(out: &str) -> Vec<u32> {
    let entries = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let numbers = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    let is_one = |number: &u32| {
        let line = std::fs::read(format!("/proc/{number}/cmdline")).unwrap_or_default();
        let words: Vec<_> = line.split(|byte| *byte == 0).collect();
        words.first() == Some(&env!("CARGO_BIN_EXE_bfree").as_bytes()) && words.contains(&out.as_bytes())
    };
    numbers.filter(is_one).collect()
}

/// Waits for some steps of a run.
fn wait_for_steps(out: &str) {
    let written = || std::fs::read_to_string(Path::new(out).join("history.csv")).map_or(0, |text| text.lines().count());
    while written() < 4 {
        thread::sleep(Duration::from_millis(5));
    }
}

/// Sends a signal to the process `which` of a run after some of its steps.
fn signal(signal: &str, which: usize, out: &str) -> Result<(), Failure> {
    wait_for_steps(out);
    let mut numbers = writing_to(out);
    numbers.sort_unstable();
    let number = numbers.get(which).ok_or("the run has ended")?.to_string();
    assert!(Command::new("kill").args([signal, &number]).status()?.success());
    Ok(())
}

/// A killed process ends the run, and so does one that is asked to stop. Both runs continue on another number of processes with the same bits.
#[test]
fn a_process_that_ends_ends_all() -> Result<(), Failure> {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/rebound.json");
    let arguments =
        [scene.to_str().unwrap(), "--steps", "60", "--quiet", "--set", "output.checkpoint=0.1", "--set", FINE];
    for launcher in launchers() {
        let folder = tempfile::tempdir()?;
        let out = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        let whole = out("whole");
        let (code, _, told) = said(&mut launched(&launcher, 1, &[&arguments[..], &["--out", &whole]].concat()))?;
        assert_eq!(code, Some(0), "{told}");
        for (name, which) in [("-KILL", 0), ("-KILL", 2), ("-TERM", 1)] {
            let out = out(&format!("{name}{which}"));
            let run = [&arguments[..], &["--out", &out]].concat();
            let mut child = launched(&launcher, 3, &run).stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
            signal(name, which, &out)?;
            let code = child.wait()?.code();
            assert!(code != Some(0), "{launcher:?} {name} {which}: {code:?}");
            // The launcher may end a moment before the processes that it kills.
            let end = Instant::now() + Duration::from_secs(10);
            while !writing_to(&out).is_empty() && Instant::now() < end {
                thread::sleep(Duration::from_millis(20));
            }
            assert_eq!(writing_to(&out), Vec::<u32>::new(), "{launcher:?} {name} {which}");
            let (code, _, told) = said(&mut launched(&launcher, 2, &[&run[..], &["--restart"]].concat()))?;
            assert_eq!(code, Some(0), "{launcher:?} {name} {which}: {told}");
            assert!(files(Path::new(&whole))? == files(Path::new(&out))?, "{launcher:?} {name} {which}");
        }
    }
    Ok(())
}

/// A snapshot, or a checkpoint, that cannot be written ends all processes, and its error is told once.
#[test]
fn a_file_that_cannot_be_written_ends_all_processes() -> Result<(), Failure> {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/rebound.json");
    let arguments = [scene.to_str().unwrap(), "--steps", "60", "--quiet", "--set", FINE, "--set", "output.probes=[]"];
    for launcher in launchers() {
        for (setting, file) in
            [("output.every=0.5", "particles_000005.vtu"), ("output.checkpoint=1", "checkpoint_1.bfree")]
        {
            let folder = tempfile::tempdir()?;
            let out = folder.path().join("out").to_str().unwrap().to_owned();
            let mut command = launched(&launcher, 3, &[&arguments[..], &["--set", setting, "--out", &out]].concat());
            let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn()?;
            wait_for_steps(&out);
            // No file takes the place of a folder that is not empty.
            std::fs::create_dir_all(Path::new(&out).join(file).join("x"))?;
            let ended = child.wait_with_output()?;
            let told = String::from_utf8_lossy(&ended.stderr);
            assert_eq!((ended.status.code(), told.matches("error: ").count()), (Some(1), 1), "{launcher:?}: {told}");
            assert!(told.contains(&format!("{file}: Is a directory")), "{launcher:?}: {told}");
        }
    }
    Ok(())
}

/// Without its library, a launcher would start several runs of the same scene.
#[test]
fn the_library_of_another_launcher_is_refused() -> Result<(), Failure> {
    let libraries = ["libmpi.so.40", "libmpich.so.12"];
    for (launcher, library) in launchers().into_iter().zip(libraries.into_iter().rev()) {
        if launchers().len() == 2 {
            let mut command = launched(&launcher, 2, &["scenes/rebound.json"]);
            let (code, _, told) = said(command.current_dir(env!("CARGO_MANIFEST_DIR")).env("BFREE_MPI", library))?;
            assert_eq!(code, Some(2), "{launcher:?}: {told}");
            assert!(told.contains("has started 2 processes, but its library counts 1"), "{launcher:?}: {told}");
        }
    }
    Ok(())
}

#[test]
fn a_launcher_without_its_library_is_told() -> Result<(), Failure> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bfree"));
    command.args(["run", "scenes/rebound.json"]).env("OMPI_COMM_WORLD_SIZE", "2").env("BFREE_MPI", "/no/libmpi.so");
    let (code, _, told) = said(&mut command)?;
    assert_eq!(code, Some(2));
    assert!(told.contains("/no/libmpi.so") && told.contains("BFREE_MPI"), "{told}");
    Ok(())
}
