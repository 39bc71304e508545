//! The benchmark book: the coarsest run of each problem gives the stored results, and its errors are those of the page.
//!
//! `.ci/book` writes results, answers and pages. `.ci/book --check` compares all files of the book with the stored results.

use crate::manual::in_repository;
use crate::support::{Failure, said};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The allowed difference of a result, relative to the largest known value. Rounding is amplified to 5e-10 at most: a density that differs by
/// 1e-13 does that. A tolerance of Newton's method of 1e-8 in place of 1e-9 changes results by up to 5e-7.
const SAME: f64 = 1e-6;

/// Errors on the page have two digits, so they are rounded by at most a twentieth of themselves.
const ROUNDED: f64 = 0.05;

/// A row of results: where, what bfree gives, and the known answer.
struct Row {
    x: f64,
    bfree: f64,
    answer: Option<f64>,
}

/// The rows of a quantity in bfree.csv, at one resolution.
fn stored(folder: &Path, resolution: f64, quantity: &str) -> Result<Vec<Row>, Failure> {
    let text = std::fs::read_to_string(folder.join("bfree.csv"))?;
    let mut rows = Vec::new();
    for line in text.lines().skip(1) {
        let [at, name, x, bfree, answer] = line.split(',').collect::<Vec<_>>()[..] else { return Err(line.into()) };
        if name == quantity && at.parse::<f64>()? == resolution {
            let answer = if answer.is_empty() { None } else { Some(answer.parse()?) };
            rows.push(Row { x: x.parse()?, bfree: bfree.parse()?, answer });
        }
    }
    Ok(rows)
}

/// A column of a run, as problem.json wants it: offset + scale · column.
fn column(table: &str, of: &Value, resolution: f64) -> Result<Vec<f64>, Failure> {
    let name = of["column"].as_str().ok_or("no column")?;
    let spacing = if of["over_h"] == true { resolution } else { 1.0 };
    let (offset, scale) = (of["offset"].as_f64().unwrap_or(0.0), of["scale"].as_f64().unwrap_or(1.0) / spacing);
    let mut lines = table.lines();
    let place = lines.next().and_then(|header| header.split(',').position(|one| one == name)).ok_or(name)?;
    let value = |line: &str| Ok(offset + scale * line.split(',').nth(place).ok_or(name)?.parse::<f64>()?);
    lines.map(value).collect()
}

/// The largest error, and the root of the mean square, relative to the largest known value.
fn errors(rows: &[Row], found: &[f64]) -> [f64; 2] {
    let known = rows.iter().zip(found).filter_map(|(row, found)| row.answer.map(|answer| (answer, found - answer)));
    let (answers, differences): (Vec<f64>, Vec<f64>) = known.unzip();
    let largest = |values: &[f64]| values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let squares: f64 = differences.iter().map(|difference| difference * difference).sum();
    let mean = (squares / differences.len() as f64).sqrt();
    [largest(&differences), mean].map(|error| error / largest(&answers))
}

/// The errors that the page states: | h | quantity | largest error | order | root mean square | order |
fn stated(page: &str, resolution: f64, quantity: &str) -> Result<[f64; 2], Failure> {
    for line in page.lines().filter(|line| line.starts_with("| ")) {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let [at, name, largest, _, mean, _] = cells[..] else { continue };
        if name == quantity && at.split(' ').next().is_some_and(|at| at.parse() == Ok(resolution)) {
            let error = |cell: &str| -> Result<f64, Failure> {
                Ok(cell.trim_start_matches("< ").trim_end_matches(" %").parse::<f64>()? / 100.0)
            };
            return Ok([error(largest)?, error(mean)?]);
        }
    }
    Err(format!("the page has no row of {quantity} at {resolution}").into())
}

/// Runs a problem at its first resolution, into `out`.
fn run(folder: &Path, run: &Value, out: &Path) -> Result<(), Failure> {
    let mut bfree = Command::new(env!("CARGO_BIN_EXE_bfree"));
    bfree.arg("run").arg(folder.join("scene.json")).arg("--quiet").arg("--out").arg(out);
    for key in run["set"].as_array().into_iter().flatten() {
        bfree.arg("--set").arg(key.as_str().ok_or("a key that is no text")?);
    }
    let (code, _, text) = said(&mut bfree)?;
    assert_eq!(code, Some(0), "{}: {text}", folder.display());
    Ok(())
}

/// Compares a quantity of a run with the stored rows and with the page.
fn compare(folder: &Path, curve: &Value, resolution: f64, out: &Path) -> Result<(), Failure> {
    let name = curve["name"].as_str().ok_or("a curve without a name")?;
    let unit = curve["unit"].as_str().filter(|unit| !unit.is_empty());
    let quantity = unit.map_or_else(|| name.to_owned(), |unit| format!("{name} [{unit}]"));
    let what = format!("{}: {quantity}", folder.display());
    let rows = stored(folder, resolution, &quantity)?;
    let table = std::fs::read_to_string(out.join(curve["file"].as_str().ok_or("no file")?))?;
    let (x, y) = (column(&table, &curve["x"], resolution)?, column(&table, &curve["y"], resolution)?);
    assert!(!rows.is_empty() && rows.len() == x.len(), "{what}: {} rows, {} are stored", x.len(), rows.len());
    let size = rows.iter().filter_map(|row| row.answer).fold(0.0_f64, |most, answer| most.max(answer.abs()));
    let end = rows.iter().fold(0.0_f64, |most, row| most.max(row.x.abs()));
    for ((row, x), y) in rows.iter().zip(&x).zip(&y) {
        assert!((x - row.x).abs() <= SAME * end, "{what}: {x} is stored as {}; renew it: .ci/book", row.x);
        assert!(
            (y - row.bfree).abs() <= SAME * size,
            "{what} at {x}: {y} is stored as {}; renew it: .ci/book",
            row.bfree
        );
    }
    let page = std::fs::read_to_string(folder.with_extension("md"))?;
    for (found, stated) in errors(&rows, &y).into_iter().zip(stated(&page, resolution, name)?) {
        assert!(
            (found - stated).abs() <= ROUNDED * stated + SAME,
            "{what}: the error is {found}, the page says {stated}"
        );
    }
    Ok(())
}

fn problems() -> Result<Vec<PathBuf>, Failure> {
    let entries = std::fs::read_dir(in_repository("docs/src/benchmarks"))?;
    let mut folders = entries.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>, Failure>>()?;
    folders.retain(|path| path.is_dir());
    folders.sort();
    Ok(folders)
}

#[test]
fn the_coarsest_run_of_each_benchmark_is_that_of_the_book() -> Result<(), Failure> {
    let (problems, scratch) = (problems()?, tempfile::tempdir()?);
    assert!(problems.len() >= 10, "{problems:?}");
    for folder in problems {
        let problem: Value = serde_json::from_str(&std::fs::read_to_string(folder.join("problem.json"))?)?;
        let (coarsest, out) = (&problem["runs"][0], scratch.path().join(folder.file_name().ok_or("no name")?));
        run(&folder, coarsest, &out)?;
        let resolution = coarsest["value"].as_f64().ok_or("a run without a value")?;
        for curve in problem["curves"].as_array().ok_or("no curves")? {
            compare(&folder, curve, resolution, &out)?;
        }
    }
    Ok(())
}
