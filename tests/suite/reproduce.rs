//! Results say what they were made of, run again to the same bits, and are packed into one file.

use crate::support::{Failure, Said, said};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;

fn program(arguments: &[&str], paths: &[&Path]) -> Result<Said, Failure> {
    let mut program = Command::new(env!("CARGO_BIN_EXE_bfree"));
    said(program.args(arguments).args(paths))
}

/// Runs the rebound from a file of its own, which names a table of velocities.
fn made(folder: &Path, arguments: &[&str]) -> Result<(), Failure> {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/rebound.json");
    fs::copy(scene, folder.join("mine.json"))?;
    fs::write(folder.join("push.csv"), "time,value\n0,0\n1,1\n")?;
    let gravity = r#"gravity={"acceleration": [0, -1], "curve": {"file": "push.csv"}}"#;
    let flags = ["run", "--quiet", "--set", gravity, "--set", "output.every=0.1", "--threads", "1", "--until", "0.53"];
    let out = folder.join("first");
    let (code, _, text) = program(&[&flags, arguments].concat(), &[&folder.join("mine.json"), "--out".as_ref(), &out])?;
    assert_eq!(code, Some(0), "{text}");
    Ok(())
}

#[test]
fn results_run_again_to_the_same_bits_and_a_changed_file_is_told() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let first = folder.path().join("first");
    made(folder.path(), &["--set", "output.checkpoint=0.2", "--plot"])?;
    let written: Value = serde_json::from_slice(&fs::read(first.join("provenance.json"))?)?;
    assert_eq!((&written["command"]["until"], &written["command"]["threads"]), (&0.53.into(), &1.into()));
    assert_eq!(written["scene"].as_str().map(str::to_owned), fs::read_to_string(folder.path().join("mine.json")).ok());
    assert_eq!(written["files"]["push.csv"]["bytes"], 19);
    // The scene of the results is run, whatever became of its file.
    fs::write(folder.path().join("mine.json"), "{}")?;
    let again = |from: &Path, to: &str| program(&["reproduce"], &[from, "--out".as_ref(), &folder.path().join(to)]);
    let (code, told, text) = again(&first.join("history.csv"), "second")?;
    assert_eq!((code, text.as_str()), (Some(0), ""), "{told}");
    let says = |told: &str, word: &str, name: &str| told.lines().any(|line| line == format!("{word:<14}{name}"));
    for name in ["history.csv", "newton.jsonl", "particles.pvd", "particles_000005.vtu"] {
        assert!(says(&told, "same", name), "{name}: {told}");
    }
    assert!(says(&told, "same", "report.json but for seconds and command") && told.contains("0 have not"), "{told}");
    assert!(told.contains("not compared  checkpoint_0.bfree: it holds seconds"), "{told}");
    // A file may be named without its folder.
    let mut here = Command::new(env!("CARGO_BIN_EXE_bfree"));
    let (code, told, text) = said(here.current_dir(&first).args(["reproduce", "history.csv", "--out", "../here"]))?;
    assert_eq!((code, text.as_str()), (Some(0), ""), "{told}");
    // A changed digit is found, and so is a missing file.
    let mut row = fs::read_to_string(first.join("history.csv"))?;
    let last = row.trim_end().len() - 1;
    row.replace_range(last..=last, "x");
    fs::write(first.join("history.csv"), row)?;
    fs::remove_file(first.join("particles_000003.vtu"))?;
    let (code, told, _) = again(&first, "third")?;
    assert!(code == Some(1) && told.contains("2 have not"), "{told}");
    assert!(says(&told, "DIFFERS", "particles_000003.vtu one of the runs has no such file"), "{told}");
    assert!(told.contains(&format!("DIFFERS       history.csv from byte {last} of")), "{told}");
    // So is a changed file that the scene names: its run differs.
    fs::write(folder.path().join("push.csv"), "time,value\n0,0\n1,2\n")?;
    let (code, told, text) = again(&folder.path().join("second"), "fourth")?;
    assert!(
        code == Some(1) && text.contains("the file push.csv in") && !says(&told, "same", "newton.jsonl"),
        "{told}{text}"
    );
    Ok(())
}

#[test]
fn results_that_cannot_be_run_again_are_refused() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let (first, other) = (folder.path().join("first"), folder.path().join("other"));
    made(folder.path(), &[])?;
    let again = || program(&["reproduce"], &[&first, "--out".as_ref(), &other]);
    let file = first.join("provenance.json");
    let good = fs::read_to_string(&file)?;
    fs::write(&file, good.replace("\"program\": \"bfree ", "\"program\": \"bfree 0."))?;
    let (code, _, text) = again()?;
    assert!(code == Some(0) && text.contains("warning: the run was made by bfree 0."), "{text}");
    let (code, _, text) = again()?;
    assert!(code == Some(2) && text.contains("holds files"), "{text}");
    for (text, word) in [
        (good.replacen("\"threads\": 1", "\"threads\": 0", 1), "must be from 1 to 1024"),
        (good.replacen("density", "densiti", 1), "differs from its checksum"),
        (good.replacen("\"until\"", "\"untill\"", 1), "unknown field `untill`"),
        (String::new(), "no provenance"),
    ] {
        fs::write(&file, text)?;
        let (code, _, told) = again()?;
        assert!(code == Some(2) && told.contains(word), "{word}: {told}");
    }
    fs::write(&file, &good)?;
    fs::remove_file(first.join("report.json"))?;
    let (code, _, told) = again()?;
    assert!(code == Some(2) && told.contains("did not end"), "{told}");
    // A file of this name that no run wrote is never replaced.
    let mine = folder.path().join("mine");
    fs::create_dir(&mine)?;
    fs::write(mine.join("provenance.json"), "mine")?;
    let (code, _, told) = program(&["run", "--quiet"], &[&folder.path().join("mine.json"), "--out".as_ref(), &mine])?;
    assert!(code == Some(2) && told.contains("which no run wrote"), "{told}");
    Ok(())
}

#[test]
fn a_run_that_fails_in_its_first_step_fails_again() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let (scene, out) = (Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/rebound.json"), folder.path().join("out"));
    let flags = ["run", "--quiet", "--set", "bodies.0.velocity=[5000,0]"];
    let (code, _, text) = program(&flags, &[&scene, "--out".as_ref(), &out])?;
    assert!(code == Some(1) && out.join("report.json").is_file(), "{text}");
    let (code, told, text) = program(&["reproduce"], &[&out, "--out".as_ref(), &folder.path().join("again")])?;
    assert!(code == Some(0) && text.contains("the run failed") && told.contains("0 have not"), "{told}{text}");
    Ok(())
}

#[test]
fn snapshots_are_packed_into_one_file_with_the_same_bytes_each_time() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let first = folder.path().join("first");
    made(folder.path(), &[])?;
    // `.ci/read_back.py` reads the arrays back by the HDF5 library and by VTK.
    let pack = || -> Result<Vec<u8>, Failure> {
        let (code, told, text) = program(&["pack"], &[&first])?;
        assert!(code == Some(0) && told.contains("particles.vtkhdf  7 snapshots"), "{told}{text}");
        Ok(fs::read(first.join("particles.vtkhdf"))?)
    };
    let (one, two) = (pack()?, pack()?);
    assert!(one == two && one.starts_with(b"\x89HDF\r\n\x1a\n"));
    assert_eq!(one.get(44..52), Some(&(one.len() as u64).to_le_bytes()[..]), "the end of the file");
    // A snapshot that is missing is told.
    let (here, away) = (first.join("particles_000003.vtu"), folder.path().join("away.vtu"));
    fs::rename(&here, &away)?;
    let (code, told, _) = program(&["pack"], &[&first])?;
    assert!(code == Some(0) && told.contains("6 snapshots; 1 of the run are not there any more"), "{told}");
    fs::rename(&away, &here)?;
    assert!(pack()? == one);
    // A damaged snapshot leaves the packed file as it was.
    fs::write(first.join("particles_000002.vtu"), "")?;
    let (code, _, text) = program(&["pack"], &[&first])?;
    assert!(code == Some(1) && text.contains("particles_000002.vtu is not a snapshot"), "{text}");
    assert_eq!(fs::read(first.join("particles.vtkhdf"))?, one);
    // A new run removes it.
    made(folder.path(), &["--discard"])?;
    assert!(!first.join("particles.vtkhdf").exists());
    Ok(())
}

#[test]
fn several_bodies_are_packed_as_blocks_with_their_names() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let (scene, out) = (Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/collision.json"), folder.path().join("out"));
    // The default fields tell the bodies apart.
    let flags = ["run", "--quiet", "--set", "output.fields=null", "--steps", "1"];
    let (code, _, text) = program(&flags, &[&scene, "--out".as_ref(), &out])?;
    assert_eq!(code, Some(0), "{text}");
    let (code, told, text) = program(&["pack"], &[&out])?;
    assert!(code == Some(0) && told.contains("particles.vtkhdf"), "{told}{text}");
    let file = fs::read(out.join("particles.vtkhdf"))?;
    let holds = |text: &str| file.windows(text.len()).any(|window| window == text.as_bytes());
    assert!(["MultiBlockDataSet", "soft", "stiff"].into_iter().all(holds));
    Ok(())
}
