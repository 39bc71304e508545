//! What a full run writes, and that README.md has a place for it and lists the known failures.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use verification::record::{Finding, LAST_RUN, LIMITS, Run, passage};
use verification::report::Listed;
use verification::studies::Outcome;
use verification::{Bound, Report, known};

fn readme() -> io::Result<String> {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../README.md"))
}

#[test]
fn readme_lists_the_known_failures() -> io::Result<()> {
    let (text, asked) = (readme()?, known::markdown());
    assert!(passage(&text, LIMITS)? == asked, "between the lines `{LIMITS}` README.md must say\n\n{asked}");
    Ok(())
}

#[test]
fn readme_says_when_what_was_last_verified() -> io::Result<()> {
    let text = readme()?;
    let said = passage(&text, LAST_RUN)?;
    for word in ["cargo verify full", "commit", "studies pass", "verification/FULL.md"] {
        assert!(said.contains(word), "{word}: {said}");
    }
    Ok(())
}

/// An empty folder.
fn folder(name: &str) -> io::Result<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    fs::create_dir_all(folder.join("verification"))?;
    Ok(folder)
}

const README: &str = "before\n<!-- last-full-verification -->\nold\n<!-- /last-full-verification -->\nbetween\n\
                      <!-- known-failures -->\n<!-- /known-failures -->\nafter\n";

fn findings() -> Vec<Finding> {
    let mut report = Report::new("of three cells", &["what"]);
    report.push(&["met"], 1.0, Bound::AtMost(2.0));
    report.push(&["shown"], 1.0, Bound::Reported);
    report.push(&["bad"], 3.0, Bound::AtMost(2.0));
    report.list_known(&["bad"], Listed { value: 3.0, factor: 2.0, timed: false });
    let outcome = Outcome { reports: vec![report], ..Outcome::default() };
    vec![Finding::of("one", &Ok(outcome), 1.0), Finding::of("two", &Err("no luck\nand more".into()), 2.0)]
}

#[test]
fn a_run_leaves_its_verdict_and_puts_its_tables_elsewhere() -> Result<(), Box<dyn std::error::Error>> {
    let root = folder("a_run")?;
    fs::write(root.join("README.md"), README)?;
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
    let text = fs::read_to_string(root.join("README.md"))?;
    assert!(
        passage(&text, LAST_RUN)?.contains("FAIL: 1 of 2 studies pass; 1 judged, 1 shown, 1 known failure"),
        "{text}"
    );
    assert_eq!(passage(&text, LIMITS)?, known::markdown());
    assert!(
        text.starts_with("before\n<!-- last")
            && text.contains(" -->\nbetween\n<!-- ")
            && text.ends_with(" -->\nafter\n"),
        "{text}"
    );
    Ok(())
}

#[test]
fn a_tree_with_changes_is_no_commit() -> Result<(), Box<dyn std::error::Error>> {
    let root = folder("no_commit")?;
    fs::write(root.join("README.md"), README)?;
    let git = |arguments: &[&str]| {
        let settings = ["-c", "user.name=nobody", "-c", "user.email=nobody@example.org", "-c", "commit.gpgsign=false"];
        Command::new("git").args(settings).args(arguments).current_dir(&root).output()
    };
    let said = || -> Result<String, io::Error> {
        Run::starting(&root)?.keep(&root, &root.join("target"), &findings(), b"")?;
        Ok(passage(&fs::read_to_string(root.join("README.md"))?, LAST_RUN)?.to_owned())
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
fn a_readme_without_the_passages_is_refused_before_the_run() -> io::Result<()> {
    let root = folder("no_passages")?;
    let last_run = "<!-- last-full-verification -->\nold\n<!-- /last-full-verification -->\n";
    for text in [
        String::new(),
        README.replace(last_run, ""),
        README.replace("<!-- /known", "<!-- known"),
        format!("{README}{last_run}"),
    ] {
        fs::write(root.join("README.md"), &text)?;
        assert!(Run::starting(&root).is_err(), "{text}");
    }
    Ok(())
}
