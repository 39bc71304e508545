//! Refusals of the program: each message names the place, the value found and the values allowed.

use super::{check, program, rebound, run, scene};
use crate::support::{Failure, said};

#[cfg(target_os = "linux")]
#[test]
fn limits_of_the_shell_are_told_in_a_sentence() -> Result<(), Failure> {
    use std::process::{Command, Stdio};

    let directory = tempfile::tempdir()?;
    let under = |limit: &str, name: &str, more: &str| -> Result<(Option<i32>, String), Failure> {
        let (bfree, scene, out) = (env!("CARGO_BIN_EXE_bfree"), scene(name), directory.path().join(name));
        let line = format!("{limit}; exec {bfree} run {} --threads 1 --out {} {more}", scene.display(), out.display());
        let (code, _, text) = said(Command::new("sh").args(["-c", &line]).stdin(Stdio::null()))?;
        Ok((code, text))
    };
    let (code, text) = under("ulimit -f 4", "rebound.json", "--steps 100")?;
    assert!(code == Some(1) && text.contains("cannot write") && text.contains("File too large"), "{text}");
    let (code, text) = under("ulimit -v 400000", "block_static.json", "--set grid.spacing=0.02")?;
    assert!(code == Some(2) && text.contains("memory"), "{text}");
    // No process writes into the pipe.
    let pipe = directory.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status()?.success());
    let (code, _, text) = check(&pipe, &[])?;
    assert!(code == Some(2) && text.contains("named pipe"), "{text}");
    Ok(())
}

#[test]
fn keys_are_refused_that_are_not_written_as_keys_are() -> Result<(), Failure> {
    let check = |argument: &str| -> Result<(Option<i32>, String), Failure> {
        let (code, _, text) = check(&scene("rebound.json"), &[argument])?;
        Ok((code, text))
    };
    let bodies = ["bodies[0.density=2", "bodies0].density=2", "bodies[].density=2", "bodies[0]x.density=2"];
    for argument in bodies.into_iter().chain(["time..step=1", ".time.step=1", "time.step.=1", "=1"]) {
        let (code, text) = check(argument)?;
        assert!(code == Some(2) && text.contains("must read KEY.PATH=JSON"), "{argument}: {text}");
    }
    let equal = ["bodies[0].density=2", "bodies.0.density=2", " time.step = 0.01", "bodies.0.particles_per_cell=2.0"];
    for argument in equal {
        assert_eq!(check(argument)?, (Some(0), String::new()), "{argument}");
    }
    for (poisson, young) in [("0.49999999999999994", "100"), ("0.3", "1e-308")] {
        let argument = format!(r#"bodies.0.material={{"neo_hookean":{{"young":{young},"poisson":{poisson}}}}}"#);
        let (code, text) = check(&argument)?;
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
        let (code, _, message) = rebound(&out, &[option, value])?;
        assert_eq!(code, Some(2), "{option} {value}: {message}");
        assert!(message.contains(option) && message.contains(allowed), "{option} {value}, {allowed}: {message}");
        assert!(!out.exists(), "{option} {value} wrote something");
    }
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
            let (code, _, message) = said(program().arg(command).arg(&path))?;
            assert_eq!(code, Some(2), "{name}: {message}");
            assert!(message.contains(name) && message.contains(allowed), "{name}: {message}");
            assert!(message.len() < 1000, "{name}: {message}");
        }
    }
    for absent in [directory.path().to_owned(), directory.path().join("nowhere.json")] {
        let (code, _, message) = run(&absent, directory.path(), &[])?;
        assert_eq!(code, Some(2), "{message}");
        assert!(message.contains(&format!("cannot read {}", absent.display())), "{message}");
    }
    Ok(())
}

#[test]
fn a_cause_is_told_once() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let file = directory.path().join("file");
    std::fs::write(&file, "")?;
    let (code, _, message) = rebound(&file.join("run"), &[])?;
    assert_eq!(code, Some(1), "{message}");
    assert!(message.contains("cannot create") && message.contains("file/run"), "{message}");
    assert_eq!(message.matches("os error").count(), 1, "{message}");
    Ok(())
}
