//! The action of `.github/actions/tangent-check`, run with a program in place of tangent-check that records its arguments.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const ACTION: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../.github/actions/tangent-check");

/// A program that writes its arguments to the file `arguments` and the summary that it was asked for, and ends with a code.
const PROGRAM: &str = r#"#!/usr/bin/env bash
printf '%s\n' "$@" >arguments
for argument in "$@"; do
    case $argument in markdown=*) [ -n "$TEXT" ] && echo "$TEXT" >"${argument#markdown=}" ;; esac
done
exit "$CODE"
"#;

/// Runs the check with inputs, in a directory with the reports of an earlier step.
fn check(directory: &str, inputs: &[(&str, &str)], text: &str, code: u8) -> (PathBuf, Output) {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join(directory);
    let _ = fs::remove_dir_all(&directory);
    fs::create_dir_all(directory.join("tangent-check")).expect("a directory");
    for report in ["summary.md", "junit.xml", "results.sarif"] {
        fs::write(directory.join("tangent-check").join(report), "an earlier step\n").expect("a file");
    }
    fs::create_dir_all(directory.join("tangent-check-program")).expect("a directory");
    let program = directory.join("tangent-check-program/tangent-check");
    fs::write(&program, PROGRAM).expect("a file");
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).expect("a program");
    let path = format!("{}/tangent-check-program:{}", directory.display(), std::env::var("PATH").unwrap_or_default());
    let defaults = [
        ("INTERFACE", "umat"),
        ("NAME", ""),
        ("PROPERTIES", ""),
        ("STATE", ""),
        ("TANGENT", ""),
        ("OPTIONS", ""),
        ("SOURCE", ""),
        ("ALLOW", ""),
        ("WHEEL", "none"),
        ("REPORTS", "tangent-check"),
        ("FILES", "libmine.so"),
    ];
    let output = Command::new("bash")
        .arg(Path::new(ACTION).join("check.sh"))
        .envs(defaults)
        .envs(inputs.iter().copied())
        .envs([
            ("PATH", path.as_str()),
            ("TEXT", text),
            ("CODE", &code.to_string()),
            ("GITHUB_OUTPUT", "output"),
            ("GITHUB_STEP_SUMMARY", "job.md"),
        ])
        .current_dir(&directory)
        .output()
        .expect("bash runs");
    (directory, output)
}

fn read(directory: &Path, file: &str) -> String {
    fs::read_to_string(directory.join(file)).unwrap_or_default()
}

#[test]
fn inputs_become_arguments_and_never_commands() {
    let inputs =
        [("PROPERTIES", "-1e3,0.3"), ("STATE", "12"), ("SOURCE", "my law $(touch bad).f90"), ("ALLOW", "inexact")];
    let (directory, output) = check("arguments", &inputs, "## A summary", 0);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let expected = "libmine.so --umat --allow inexact --properties=-1e3,0.3 --state=12 --source=my_law --report terminal --report github \
                    --report markdown=tangent-check/summary.md --report junit=tangent-check/junit.xml --report sarif=tangent-check/results.sarif";
    let expected = expected.replace(' ', "\n").replace("my_law", "my law $(touch bad).f90") + "\n";
    assert_eq!(read(&directory, "arguments"), expected);
    assert!(!directory.join("bad").exists());
    assert_eq!(read(&directory, "job.md"), "## A summary\n");
    assert_eq!(read(&directory, "output"), "exit-code=0\n");
    let (directory, _) =
        check("name", &[("INTERFACE", "mfront"), ("NAME", "Plasticity"), ("FILES", "a b.f\njob.inp\n")], "text", 0);
    assert!(read(&directory, "arguments").starts_with("a b.f\njob.inp\n--mfront\nPlasticity\n--report\n"));
    let inputs = [("TANGENT", "strain"), ("OPTIONS", "--plane-strain\n--external=A b=1\n")];
    let (directory, _) = check("options", &inputs, "text", 0);
    let expected = "libmine.so\n--umat\n--tangent=strain\n--plane-strain\n--external=A b=1\n--report\n";
    assert!(read(&directory, "arguments").starts_with(expected));
}

#[test]
fn failures_stay_failures() {
    for code in [1, 2, 101] {
        let (directory, output) = check("failures", &[], "text", code);
        assert_eq!(output.status.code(), Some(i32::from(code)));
        assert_eq!(read(&directory, "output"), format!("exit-code={code}\n"));
        assert_eq!(read(&directory, "job.md"), "text\n");
    }
    let (directory, output) = check("silent", &[], "", 0);
    assert_eq!(output.status.code(), Some(2), "no report is no success");
    assert!(String::from_utf8_lossy(&output.stdout).contains("::error title=tangent-check::"));
    let summary = read(&directory, "job.md");
    assert!(summary.contains("Not checked, exit code 2. tangent-check wrote no report."), "{summary}");
    assert_eq!(read(&directory, "output"), "exit-code=2\n");
    for report in ["summary.md", "junit.xml", "results.sarif"] {
        assert!(!directory.join("tangent-check").join(report).exists(), "{report} is of an earlier step");
    }
}

#[test]
fn inputs_that_are_not_allowed() {
    for inputs in [[("INTERFACE", "vumat")], [("INTERFACE", "c")], [("ALLOW", "yes")]] {
        let (directory, output) = check("inputs", &inputs, "text", 0);
        assert_eq!(output.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&output.stdout).starts_with("::error title=tangent-check::The in"));
        assert!(read(&directory, "job.md").contains("exit code 2. The in"));
        assert!(!directory.join("arguments").exists());
    }
}

/// The description of the action and the script agree about the variables.
#[test]
fn the_script_reads_what_the_action_gives() {
    let action = fs::read_to_string(Path::new(ACTION).join("action.yml")).expect("the action");
    let script = fs::read_to_string(Path::new(ACTION).join("check.sh")).expect("the script");
    let (inputs, rest) = action.split_once("\noutputs:").expect("outputs follow inputs");
    let declared: Vec<&str> = inputs.lines().filter_map(|line| line.strip_prefix("  ")?.strip_suffix(':')).collect();
    let declared: Vec<&str> = declared.into_iter().filter(|name| !name.starts_with(' ')).collect();
    let given: BTreeMap<&str, &str> =
        rest.lines().filter_map(|line| line.trim().strip_suffix(" }}")?.split_once(": ${{ inputs.")).collect();
    assert_eq!(declared.len(), 11, "{declared:?}");
    for (variable, input) in &given {
        assert!(declared.contains(input) && script.contains(&format!("${variable}")), "{variable}");
    }
    assert_eq!(given.len(), declared.len());
}
