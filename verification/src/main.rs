//! Runs studies, prints their results, and writes JSON and pictures. The exit code is the verdict.

use clap::{Parser, ValueEnum};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::{Instant, SystemTime};
use verification::device;
use verification::known::may_list;
use verification::record::{self, Finding, Run};
use verification::report::{chain, stop_at_failures};
use verification::studies::{Effort, MEASURE_TIME, ON_DEVICE, Outcome, PAPER, STUDIES, Study, StudyError};

/// Verification of bfree.
#[derive(Parser)]
#[command(version, after_help = studies_list())]
struct Arguments {
    /// Studies by name. `all` is the short set that CI runs. `full` is every study with long sweeps, except those of the paper: verdicts
    /// are kept in verification/FULL.md, README.md and docs/src/limits.md, tables in target/verification. `results` are the studies of the
    /// paper with their tables and pictures, kept in verification/RESULTS.md and verification/results. `tradeoff` with full effort rewrites
    /// verification/TRADEOFF.md
    #[arg(value_name = "STUDY", default_value = "all")]
    studies: Vec<String>,
    /// The amount of work of each study; the study `full` implies full effort
    #[arg(long, value_enum, default_value_t = EffortArgument::Short)]
    effort: EffortArgument,
    /// Stop at the first cell that fails; `mutants`, whose cells must fail, continues
    #[arg(long)]
    first: bool,
    /// Multiply by tangents and solve linear systems on the GPU of this machine; the studies tangent and newton can. Functions that have no
    /// form there stay on the processor
    #[arg(long)]
    gpu: bool,
    /// Write every cell, table and remark as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write pictures, as SVG and PNG, into this directory
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum EffortArgument {
    Short,
    Full,
}

fn studies_list() -> String {
    let mut text = String::from("Studies:");
    for study in STUDIES {
        text += &format!("\n  {:<14} {}", study.name, study.about);
    }
    text
}

/// The requested studies, each once, with their effort. The error is the word that names no study.
fn selected(arguments: &Arguments) -> Result<Vec<(&'static Study, Effort)>, String> {
    let effort = match arguments.effort {
        EffortArgument::Short => Effort::Short,
        EffortArgument::Full => Effort::Full,
    };
    let mut chosen: Vec<(&Study, Effort)> = Vec::new();
    for word in &arguments.studies {
        let of_the_paper = |study: &&Study| PAPER.contains(&study.name);
        let named: Vec<(&Study, Effort)> = match word.as_str() {
            "all" => STUDIES.iter().map(|study| (study, effort)).collect(),
            // `results` runs the long sweeps of the paper's studies, so `full` does not.
            "full" => {
                let effort_of = |study: &Study| if PAPER.contains(&study.name) { Effort::Short } else { Effort::Full };
                STUDIES.iter().map(|study| (study, effort_of(study))).collect()
            }
            "results" => STUDIES.iter().filter(of_the_paper).map(|study| (study, Effort::Full)).collect(),
            name => vec![(STUDIES.iter().find(|study| study.name == name).ok_or_else(|| word.clone())?, effort)],
        };
        for study in named {
            match chosen.iter_mut().find(|(one, _)| one.name == study.0.name) {
                Some((_, effort)) => *effort = study.1.max(*effort),
                None => chosen.push(study),
            }
        }
    }
    Ok(chosen)
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let studies = match selected(&arguments) {
        Ok(selected) => selected,
        Err(word) => {
            eprintln!("error: there is no study `{word}`\n\n{}\n\nor `all`, `full` or `results`", studies_list());
            return ExitCode::from(2);
        }
    };
    if let Err(refusal) = open_device(&studies, &arguments) {
        eprintln!("error: {refusal}");
        return ExitCode::from(2);
    }
    match run(&studies, &arguments) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        // The reader has closed the pipe: `… | head`.
        Err(Failure { source, .. }) if source.kind() == io::ErrorKind::BrokenPipe => ExitCode::from(1),
        Err(error) => {
            eprintln!("error: {}", chain(&error));
            ExitCode::from(1)
        }
    }
}

/// Opens the GPU, if the studies are to use one.
fn open_device(studies: &[(&'static Study, Effort)], arguments: &Arguments) -> Result<(), String> {
    if !arguments.gpu {
        return Ok(());
    }
    match studies.iter().find(|(study, _)| !ON_DEVICE.contains(&study.name)) {
        Some((study, _)) => {
            Err(format!("--gpu: {} does not run there; these studies do: {}", study.name, ON_DEVICE.join(", ")))
        }
        None => device::open().map_err(|error| error.to_string()),
    }
}

/// Results could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {place}")]
struct Failure {
    place: String,
    source: io::Error,
}

fn writing(place: impl Into<String>) -> impl FnOnce(io::Error) -> Failure {
    move |source| Failure { place: place.into(), source }
}

fn run(studies: &[(&'static Study, Effort)], arguments: &Arguments) -> Result<bool, Failure> {
    let mut out = io::stdout().lock();
    // This check precedes hours of work. It records the tree before the run writes to it.
    let of_run = if asked_for(arguments, "full") {
        Some(Run::starting(&root()).map_err(writing("README.md and docs/src/limits.md"))?)
    } else {
        None
    };
    let mut text = Vec::new();
    let mut findings: Vec<Finding> = Vec::new();
    let mut documents = Vec::new();
    let mut chapters = Vec::new();
    each_in_order(studies, arguments, |done| {
        out.write_all(&done.text).map_err(writing("to standard output"))?;
        text.extend(done.text);
        chapters.push(done.chapter);
        documents.push(done.document);
        findings.push(done.finding);
        Ok(())
    })?;
    let mut passed = findings.iter().all(|finding| finding.passed);
    if let Some(gpu) = device::used() {
        let said = gpu.check().map_or_else(|error| format!("FAIL  {error}"), |()| format!("on {}", gpu.name()));
        passed &= gpu.check().is_ok();
        writeln!(out, "\n{said}").map_err(writing("to standard output"))?;
    }
    let summary = format!("\n=== verdict ===\n{}", record::summary(&findings));
    text.extend_from_slice(summary.as_bytes());
    out.write_all(summary.as_bytes()).map_err(writing("to standard output"))?;
    if let Some(of_run) = of_run {
        let tables = of_run.keep(&root(), &target(), &findings, &text).map_err(writing("the record of the run"))?;
        writeln!(out, "all tables: {}", tables.display()).map_err(writing("to standard output"))?;
    }
    if asked_for(arguments, "results") {
        keep_paper(&chapters)?;
    }
    if let Some(path) = &arguments.json {
        let text = format!("{:#}\n", json!({ "passed": passed, "studies": documents }));
        fs::write(path, text).map_err(writing(path.display().to_string()))?;
    }
    Ok(passed)
}

/// The results of a study.
struct Done {
    /// The printed text.
    text: Vec<u8>,
    chapter: String,
    document: Value,
    finding: Finding,
}

/// Runs a study, and writes its pictures.
fn done((study, effort): (&Study, Effort), arguments: &Arguments) -> Result<Done, Failure> {
    let start = Instant::now();
    stop_at_failures((arguments.first && study.name != "mutants").then_some(may_list));
    let result = study.run(effort);
    let seconds = start.elapsed().as_secs_f64();
    let mut text = Vec::new();
    print(&mut text, study, &result, seconds).map_err(writing("the results"))?;
    if let (Ok(outcome), Some(directory)) = (&result, &arguments.out) {
        draw(directory, outcome)?;
    }
    if let (Ok(outcome), true) = (&result, asked_for(arguments, "results")) {
        draw(&kept_folder("results"), outcome)?;
    }
    if let (Ok(_), "tradeoff", Effort::Full) = (&result, study.name, effort) {
        keep_tradeoff(&chapter(study, &result, seconds, "tradeoff"))?;
    }
    let finding = Finding::of(study.name, &result, seconds);
    Ok(Done {
        text,
        chapter: chapter(study, &result, seconds, "results"),
        document: document(&finding, &result),
        finding,
    })
}

/// Runs studies side by side, one on each core, and calls `take` with the results in the order of the list. Most of the work in a study is on one
/// core. Studies that measure time run alone, and so does every study that may end the program.
fn each_in_order(
    studies: &[(&'static Study, Effort)],
    arguments: &Arguments,
    mut take: impl FnMut(Done) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let workers = if arguments.first { 1 } else { bfree::parallel::threads() };
    let alone = |study: &Study| workers == 1 || MEASURE_TIME.contains(&study.name);
    for together in studies.chunk_by(|(one, _), (other, _)| !alone(one) && !alone(other)) {
        let next = AtomicUsize::new(0);
        let (sender, results) = mpsc::channel();
        std::thread::scope(|scope| {
            for _ in 0..workers.min(together.len()) {
                let (sender, next) = (sender.clone(), &next);
                scope.spawn(move || {
                    while let Some(&study) = together.get(next.fetch_add(1, Ordering::Relaxed)) {
                        // Nobody listens after a failure.
                        _ = sender.send((study.0.name, done(study, arguments)));
                    }
                });
            }
            drop(sender);
            let mut waiting = HashMap::new();
            for (study, _) in together {
                while !waiting.contains_key(study.name) {
                    // Without a sender a worker has panicked. The scope then panics too.
                    let Ok((name, result)) = results.recv() else { return Ok(()) };
                    waiting.insert(name, result);
                }
                waiting.remove(study.name).map_or(Ok(()), |result| take(result?))?;
            }
            Ok(())
        })?;
    }
    Ok(())
}

/// The root of the repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The build folder of cargo: nothing in it belongs to the repository.
fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from)
}

fn asked_for(arguments: &Arguments, word: &str) -> bool {
    arguments.studies.iter().any(|one| one == word)
}

/// The folder of stored pictures.
fn kept_folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// Writes the measured trade of speed against accuracy into the repository.
fn keep_tradeoff(chapter: &str) -> Result<(), Failure> {
    let path = kept_folder("TRADEOFF.md");
    let date = humantime::format_rfc3339_seconds(SystemTime::now());
    let header = format!(
        "# Speed against accuracy, measured\n\nWritten by `cargo verify tradeoff --effort full`, {date}; nothing is edited by hand.\n"
    );
    fs::write(&path, header + chapter).map_err(writing(path.display().to_string()))
}

/// Writes the results of the paper's studies into the repository.
fn keep_paper(chapters: &[String]) -> Result<(), Failure> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("RESULTS.md");
    let date = humantime::format_rfc3339_seconds(SystemTime::now());
    let header = format!(
        "# The paper's results, and ours\n\nEvery table and figure of section 4. Written by `cargo verify results`, {date}; \
         nothing is edited by hand. What is called the paper's or an independent program's is theirs: data in the \
         sources of the studies and in `verification/reference`, not results of this run.\n"
    );
    fs::write(&path, header + &chapters.concat()).map_err(writing(path.display().to_string()))
}

/// A study as a chapter in Markdown, with references to its pictures in `folder`.
fn chapter(study: &Study, result: &Result<Outcome, StudyError>, seconds: f64, folder: &str) -> String {
    let mut text = format!("\n## {}: {}\n\n", study.name, study.about);
    match result {
        Ok(outcome) => {
            for remark in &outcome.remarks {
                text += &format!("{remark}\n\n");
            }
            for sheet in &outcome.sheets {
                text += &format!("![{}]({folder}/{}.svg)\n\n{}\n\n", sheet.name, sheet.name, sheet.caption);
            }
            for table in &outcome.tables {
                text += &format!("{}\n", table.markdown());
            }
            for report in &outcome.reports {
                text += &format!("{}\n", report.markdown());
            }
        }
        Err(error) => text += &format!("FAIL: the study could not be finished: {}\n\n", chain(error.as_ref())),
    }
    text + &format!("({seconds:.0} s)\n")
}

/// Writes the pictures.
fn draw(directory: &Path, outcome: &Outcome) -> Result<(), Failure> {
    fs::create_dir_all(directory).map_err(writing(directory.display().to_string()))?;
    for sheet in &outcome.sheets {
        let place = directory.join(sheet.name);
        let failed = |error| Failure { place: place.display().to_string(), source: error };
        let svg = sheet.svg().map_err(|error| failed(io::Error::other(error.to_string())))?;
        fs::write(place.with_extension("svg"), svg).map_err(failed)?;
    }
    Ok(())
}

fn print(out: &mut impl Write, study: &Study, result: &Result<Outcome, StudyError>, seconds: f64) -> io::Result<()> {
    writeln!(out, "\n=== {}: {} ===", study.name, study.about)?;
    match result {
        Ok(outcome) => {
            for table in &outcome.tables {
                write!(out, "{table}")?;
            }
            for report in &outcome.reports {
                write!(out, "{report}")?;
            }
            for remark in &outcome.remarks {
                writeln!(out, "{remark}")?;
            }
        }
        Err(error) => writeln!(out, "FAIL  the study could not be finished: {}", chain(error.as_ref()))?,
    }
    writeln!(out, "({seconds:.1} s)")
}

fn document(finding: &Finding, result: &Result<Outcome, StudyError>) -> Value {
    let Finding { study, passed, counts, seconds, .. } = finding;
    match result {
        Ok(outcome) => json!({
            "study": study, "passed": passed, "counts": counts, "seconds": seconds,
            "reports": outcome.reports, "tables": outcome.tables, "remarks": outcome.remarks,
        }),
        Err(error) => json!({ "study": study, "passed": false, "seconds": seconds, "error": chain(error.as_ref()) }),
    }
}
