//! The output of a full run. README.md and the manual must have a place for it and list the known failures.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use verification::record::{Finding, LAST_RUN, LIMITS, Run, passage, replaced};
use verification::report::Listed;
use verification::studies::Outcome;
use verification::{Bound, Report, known};

/// The passage of a file under `root`.
fn written(root: &Path, (file, name): (&str, &str)) -> io::Result<String> {
    Ok(passage(&fs::read_to_string(root.join(file))?, name)?.to_owned())
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

#[test]
fn the_manual_lists_the_known_failures() -> io::Result<()> {
    let asked = known::markdown();
    if std::env::var_os("BFREE_WRITE_KNOWN").is_some() {
        let path = repository().join(LIMITS.0);
        fs::write(&path, replaced(&fs::read_to_string(&path)?, LIMITS.1, &asked)?)?;
    }
    let same = written(&repository(), LIMITS)? == asked;
    assert!(same, "renew {}: BFREE_WRITE_KNOWN=1 cargo test --release -p verification --test record", LIMITS.0);
    Ok(())
}

#[test]
fn readme_says_when_what_was_last_verified() -> io::Result<()> {
    let said = written(&repository(), LAST_RUN)?;
    for word in ["cargo verify full", "commit", "studies pass", "verification/FULL.md"] {
        assert!(said.contains(word), "{word}: {said}");
    }
    Ok(())
}

/// A folder with only the files into which a run writes.
fn folder(name: &str) -> io::Result<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    fs::create_dir_all(folder.join("verification"))?;
    fs::create_dir_all(folder.join("docs/src"))?;
    fs::write(folder.join("README.md"), README)?;
    fs::write(folder.join("docs/src/limits.md"), MANUAL)?;
    Ok(folder)
}

const README: &str = "before\n<!-- last-full-verification -->\nold\n<!-- /last-full-verification -->\nafter\n";
const MANUAL: &str = "before\n<!-- known-failures -->\n<!-- /known-failures -->\nafter\n";

fn findings() -> Vec<Finding> {
    let mut report = Report::new("of three cells", &["what"]);
    report.push(&["met"], 1.0, Bound::AtMost(2.0));
    report.push(&["shown"], 1.0, Bound::Reported);
    report.push(&["bad"], 3.0, Bound::AtMost(2.0));
    report.list_known(&["bad"], Listed { value: 3.0, factor: 2.0 });
    let outcome = Outcome { reports: vec![report], ..Outcome::default() };
    vec![Finding::of("one", &Ok(outcome), 1.0), Finding::of("two", &Err("no luck\nand more".into()), 2.0)]
}

#[test]
fn a_run_leaves_its_verdict_and_puts_its_tables_elsewhere() -> Result<(), Box<dyn std::error::Error>> {
    let root = folder("a_run")?;
    let target = root.join("target");
    let tables = Run::starting(&root)?.keep(&root, &target, &findings(), b"everything")?;
    assert_eq!(fs::read(tables)?, b"everything");
    let full = fs::read_to_string(root.join("verification/FULL.md"))?;
    for words in [
        "FAIL: 1 of 2 studies pass; 1 judged, 1 shown, 1 known failure.",
        "| one | PASS | 1 | 1 | 1 | met: 1 (<= 2) | 1 |",
        "| two | FAIL | 0 | 0 | 0 | could not be finished: no luck | 2 |",
        "- one: of three cells: bad: 3 (<= 2), known to fail with 3",
    ] {
        assert!(full.contains(words), "{words}\n{full}");
    }
    let said = written(&root, LAST_RUN)?;
    assert!(said.contains("FAIL: 1 of 2 studies pass; 1 judged, 1 shown, 1 known failure"), "{said}");
    assert_eq!(written(&root, LIMITS)?, known::markdown());
    for (file, name) in [LAST_RUN, LIMITS] {
        let text = fs::read_to_string(root.join(file))?;
        let around = (format!("before\n<!-- {name} -->\n"), format!("<!-- /{name} -->\nafter\n"));
        assert!(text.starts_with(&around.0) && text.ends_with(&around.1), "{text}");
    }
    Ok(())
}

#[test]
fn a_tree_with_changes_is_no_commit() -> Result<(), Box<dyn std::error::Error>> {
    let root = folder("no_commit")?;
    let git = |arguments: &[&str]| {
        let settings = ["-c", "user.name=nobody", "-c", "user.email=nobody@example.org", "-c", "commit.gpgsign=false"];
        Command::new("git").args(settings).args(arguments).current_dir(&root).output()
    };
    let said = || -> Result<String, io::Error> {
        Run::starting(&root)?.keep(&root, &root.join("target"), &findings(), b"")?;
        written(&root, LAST_RUN)
    };
    for arguments in [&["init", "-q"][..], &["add", "."], &["commit", "-q", "-m", "all"]] {
        assert!(git(arguments)?.status.success(), "git {arguments:?}");
    }
    let first = said()?;
    assert!(first.contains(", commit ") && !first.contains("no commit"), "{first}");
    let second = said()?;
    assert!(second.contains(", no commit: changes to "), "{second}");
    Ok(())
}

#[test]
fn documents_without_the_passages_are_refused_before_the_run() -> io::Result<()> {
    let root = folder("no_passages")?;
    for ((file, name), whole) in [(LAST_RUN, README), (LIMITS, MANUAL)] {
        let end = format!("<!-- /{name} -->");
        for text in [String::new(), whole.replace(&end, ""), format!("{whole}{end}\n")] {
            fs::write(root.join(file), &text)?;
            assert!(Run::starting(&root).is_err(), "{file}: {text}");
        }
        fs::write(root.join(file), whole)?;
        assert!(Run::starting(&root).is_ok(), "{file}");
    }
    Ok(())
}
