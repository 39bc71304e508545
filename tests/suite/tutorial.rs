//! The tutorials, as a reader does them: the commands of all pages in one folder. The results must equal the numbers on the pages.

use crate::manual::{Page, in_repository};
use crate::support::{Failure, said};
use std::path::Path;
use std::process::Command;

/// The allowed difference between a number in the text and the result, relative to the known answer: numbers in the text are rounded.
const ROUNDED: f64 = 1e-3;

/// Runs every block of commands of a page in `folder`, with the program on the shell's path.
fn follow(page: &Page, folder: &Path) -> Result<(), Failure> {
    let program = Path::new(env!("CARGO_BIN_EXE_bfree")).parent().ok_or("no folder")?;
    let others = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths(std::iter::once(program.to_owned()).chain(std::env::split_paths(&others)))?;
    for (_, commands) in page.blocks.iter().filter(|(kind, _)| kind == "sh") {
        let mut bash = Command::new("bash");
        bash.args(["-euo", "pipefail", "-c", commands]).env("PATH", &path).current_dir(folder);
        let (code, _, text) = said(&mut bash)?;
        assert_eq!(code, Some(0), "{commands}: {text}");
    }
    Ok(())
}

fn number(text: &str) -> Result<f64, Failure> {
    Ok(text.replace('−', "-").parse().map_err(|error| format!("`{text}`: {error}"))?)
}

/// The value of a column of a table of results at a time.
fn value(table: &str, column: &str, time: f64) -> Option<f64> {
    let mut lines = table.lines();
    let header: Vec<&str> = lines.next()?.split(',').collect();
    let place = |name: &str| header.iter().position(|one| *one == name);
    let (at, of) = (place("time")?, place(column)?);
    let mut rows = lines.map(|line| line.split(',').map(str::parse::<f64>).collect::<Vec<_>>());
    let row = rows.find(|row| row[at].as_ref().is_ok_and(|t| (t - time).abs() < 1e-9 * time.abs()))?;
    row[of].as_ref().ok().copied()
}

/// Follows a page in `folder` and compares the results with the text and with the known answers. Returns the results.
fn tutorial<const ROWS: usize>(name: &str, folder: &Path) -> Result<[f64; ROWS], Failure> {
    let file = in_repository(&format!("docs/src/tutorial/{name}.md"));
    follow(&Page::read(&file)?, folder)?;
    let mut values = Vec::new();
    // A row of the table: | `FILE`: `COLUMN` | time | known | bfree | error |
    for line in std::fs::read_to_string(&file)?.lines().filter(|line| line.starts_with("| `out/")) {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let [place, time, known, found, error] = cells[..] else { return Err(line.into()) };
        let (file, column) = place.trim_matches('`').split_once("`: `").ok_or(line)?;
        let (time, known, found) = (number(time)?, number(known)?, number(found)?);
        let error = number(error.strip_suffix(" %").ok_or(line)?)? / 100.0;
        let table = std::fs::read_to_string(folder.join(file))?;
        let came_out = value(&table, column, time).ok_or_else(|| format!("{file}: no {column} at {time}"))?;
        let what = format!("{file}, {column} at t = {time}: {came_out}; {known} is known, the text says {found}");
        assert!((came_out - found).abs() <= ROUNDED * known.abs(), "{what}");
        assert!((came_out - known).abs() <= error * known.abs(), "{what}, within {error}");
        values.push(came_out);
    }
    values.try_into().map_err(|values: Vec<f64>| format!("{name} has a table of {} rows", values.len()).into())
}

#[test]
fn a_reader_does_the_pages_in_one_folder() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let folder = folder.path();
    let overview = std::fs::read_to_string(in_repository("docs/src/tutorial.md"))?;
    let pages: Vec<&str> = overview.split("](tutorial/").skip(1).filter_map(|rest| rest.split(".md").next()).collect();
    assert_eq!(pages, ["beam", "membrane", "ring", "rebound", "plasticity", "obstacles", "contact", "own_law"]);
    tutorial::<4>("beam", folder)?;
    let [_, fine, finer, locked, free] = tutorial("membrane", folder)?;
    // The error is of first order, so the values are extrapolated to h = 0, as in the text.
    let extrapolated = 2.0 * finer - fine;
    assert!((extrapolated / 14.505 - 1.0).abs() < 1e-3, "{extrapolated}");
    // The error that remains with a mean dilatation.
    assert!((12.135 - free) < 0.3 * (12.135 - locked), "{locked} {free}");
    tutorial::<4>("ring", folder)?;
    tutorial::<4>("rebound", folder)?;
    let [_, _, coarse, fine, ..] = tutorial::<7>("plasticity", folder)?;
    // The error is of first order, as in the text.
    let extrapolated = 2.0 * fine - coarse;
    assert!((extrapolated / 7.01 - 1.0).abs() < 0.005, "{extrapolated}");
    Ok(())
}

/// These pages take half of the time, so they are a test of their own.
#[test]
fn a_reader_does_the_pages_on_contact_in_one_folder() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    tutorial::<17>("obstacles", folder.path())?;
    tutorial::<3>("contact", folder.path())?;
    Ok(())
}

/// Directories that the commands of a text write into: that of `--out`, otherwise that of the scene.
fn written(text: &str) -> Vec<String> {
    let runs = text.lines().filter_map(|line| line.split_once("bfree run ")).map(|(_, arguments)| arguments);
    let directory = |arguments: &str| match arguments.split_once("--out ") {
        Some((_, rest)) => rest.split(['`', ' ']).next().unwrap_or_default().to_owned(),
        None => format!("out/{}", arguments.split(".json").next().unwrap_or_default()),
    };
    runs.filter(|arguments| !arguments.contains("--discard")).map(directory).collect()
}

/// The test also covers commands that the suite does not run.
#[test]
fn no_two_commands_of_the_tutorial_write_into_one_directory() -> Result<(), Failure> {
    let mut seen: Vec<String> = Vec::new();
    for entry in std::fs::read_dir(in_repository("docs/src/tutorial"))? {
        let written = written(&std::fs::read_to_string(entry?.path())?);
        for directory in written {
            assert!(!seen.contains(&directory), "{directory} is written twice");
            seen.push(directory);
        }
    }
    assert!(seen.len() > 10, "{seen:?}");
    Ok(())
}

/// The example is a member of the workspace, so that `cargo test --workspace` runs its tests.
#[test]
fn the_code_of_the_own_law_is_that_of_the_example() -> Result<(), Failure> {
    let page = Page::read(&in_repository("docs/src/tutorial/own_law.md"))?;
    let example = std::fs::read_to_string(in_repository("examples/own_law/src/lib.rs"))?;
    let code: Vec<&String> = page.blocks.iter().filter(|(kind, _)| kind == "rust").map(|(_, code)| code).collect();
    assert_eq!(code.len(), 3);
    for code in code {
        assert!(example.contains(code.as_str()), "not in the example:\n{code}");
    }
    Ok(())
}

/// The scene of the README, written to the file named in its command.
#[test]
fn the_readme_s_scene_runs() -> Result<(), Failure> {
    let (page, folder) = (Page::read(&in_repository("README.md"))?, tempfile::tempdir()?);
    let (_, scene) = page.blocks.iter().find(|(kind, _)| kind == "json").ok_or("no scene")?;
    std::fs::write(folder.path().join("rings.json"), scene)?;
    let mut run = Command::new(env!("CARGO_BIN_EXE_bfree"));
    let (code, _, text) = said(run.args(["run", "rings.json", "--until", "0.4", "--quiet"]).current_dir(&folder))?;
    assert_eq!(code, Some(0), "{text}");
    // A header, and at least one row: the rings have met.
    assert!(std::fs::read_to_string(folder.path().join("out/rings/contacts.csv"))?.lines().count() > 1);
    Ok(())
}
