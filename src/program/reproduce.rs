//! `bfree reproduce` runs the scene of earlier results again, and compares the files.

use super::failure::{Failure, print, tell};
use super::provenance::{Maker, Provenance, of_file};
use super::run::Run;
use crate::output::{self, Role};
use crate::{causes, checkpoint};
use clap::Args;
use serde_json::{Map, Value};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// `bfree reproduce`.
#[derive(Args)]
pub(super) struct Reproduce {
    /// The directory of the results of a run, or a file in it.
    results: PathBuf,
    /// Directory of the new results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Let the scene load this shared library, which the run was allowed to load, too.
    #[arg(long = "allow-library", value_name = "PATH")]
    libraries: Vec<PathBuf>,
}

impl Reproduce {
    /// Runs the scene again, and says of every file whether it has the same bits. Another file is an error.
    pub(crate) fn execute(&self) -> Result<(), Failure> {
        let directory = match self.results.parent() {
            // A file that is named without its folder has the folder "".
            Some(parent) if self.results.is_file() => &Path::new(".").join(parent),
            _ => &self.results,
        };
        let then = Provenance::read(directory)?;
        let ended = output::outcome(directory).filter(|outcome| outcome != "interrupted");
        if ended.is_none() {
            let what = "holds a run that did not end: continue it by --restart first, where it has a checkpoint";
            return Err(Failure::scene(format!("{} {what}", directory.display())));
        }
        // Nothing that lies there already can then be taken for a result of the new run.
        if self.out.exists() && !names(&self.out)?.is_empty() {
            let what = "holds files: give a new or an empty directory by --out";
            return Err(Failure::scene(format!("{} {what}", self.out.display())));
        }
        then.tell_changes();
        match Run::again(&then, &self.out, &self.libraries).execute() {
            // A run that failed is compared, too, if it has a report.
            Err(Failure::Run(error)) if output::outcome(&self.out).is_some() => {
                tell(format_args!("the run failed: {}", causes::on_one_line(&*error)))
            }
            result => result?,
        }
        let names = names(directory)?.into_iter().chain(names(&self.out)?).collect::<BTreeSet<_>>();
        let (mut same, mut other) = (0, 0);
        for name in names {
            let verdict = Verdict::of(directory, &self.out, &name);
            same += usize::from(matches!(verdict, Verdict::Same(_)));
            other += usize::from(matches!(verdict, Verdict::Other(_)));
            match verdict {
                Verdict::Same(but) => print(format_args!("same          {name}{but}"))?,
                Verdict::Other(place) => print(format_args!("DIFFERS       {name}{place}"))?,
                Verdict::NotCompared(why) => print(format_args!("not compared  {name}{why}"))?,
            }
        }
        print(format_args!("{same} files have the same bits, {other} have not"))?;
        if other == 0 { Ok(()) } else { Err(Failure::Told(1)) }
    }
}

impl Provenance {
    /// Warns of another program, another machine and changed files.
    fn tell_changes(&self) {
        let (then, now) = (&self.made_by, Maker::here());
        if *then != now {
            let build = if then.build == now.build { "" } else { ", in another build" };
            tell(format_args!(
                "warning: the run was made by {} on {}, this is {} on {}{build}: the bits may differ",
                then.program, then.machine, now.program, now.machine
            ));
        }
        if let Some(program) = &self.continued_from {
            tell(format_args!("warning: the run was begun by {program}: the bits may differ"));
        }
        for (name, written) in &self.files {
            if of_file(&Path::new(&self.folder).join(name)).ok() != Some(*written) {
                tell(format_args!("warning: the file {name} in {} has changed since the run", self.folder));
            }
        }
    }
}

/// The result of comparing a file, and what to say of it.
enum Verdict {
    Same(&'static str),
    Other(String),
    NotCompared(&'static str),
}

impl Verdict {
    fn of(then: &Path, now: &Path, name: &str) -> Self {
        match output::role(name) {
            None if checkpoint::is_checkpoint(name) => Self::NotCompared(": it holds seconds"),
            None => Self::NotCompared(": no file of a run"),
            Some(Role::Provenance) => Self::NotCompared(": it names the directories"),
            Some(Role::Drawn) => Self::NotCompared(": bfree plot and bfree pack make it of the other files"),
            Some(Role::Result) => {
                let read = |directory: &Path| fs::read(directory.join(name));
                match (read(then), read(now)) {
                    (Ok(then), Ok(now)) if name == "report.json" => Self::of_reports(&then, &now),
                    (Ok(then), Ok(now)) => Self::of_bytes(&then, &now),
                    _ => Self::Other(" one of the runs has no such file".to_owned()),
                }
            }
        }
    }

    fn of_bytes(then: &[u8], now: &[u8]) -> Self {
        let common = then.iter().zip(now).take_while(|(then, now)| then == now).count();
        if then == now { Self::Same("") } else { Self::Other(format!(" from byte {common} of {} on", then.len())) }
    }

    fn of_reports(then: &[u8], now: &[u8]) -> Self {
        let [then, now] = [then, now].map(|text| {
            let mut report: Map<String, Value> = serde_json::from_slice(text).unwrap_or_default();
            report.retain(|key, _| !["seconds", "command"].contains(&key.as_str()));
            report
        });
        let other: Vec<_> =
            then.iter().filter(|(key, value)| now.get(*key) != Some(*value)).map(|(key, _)| key.as_str()).collect();
        if then == now && !then.is_empty() {
            Self::Same(" but for seconds and command")
        } else {
            Self::Other(format!(" in {}", other.join(", ")))
        }
    }
}

/// The names of the files in a directory.
fn names(directory: &Path) -> Result<Vec<String>, Failure> {
    let refused = Failure::system(format!("read {}", directory.display()));
    let entries = fs::read_dir(directory).map_err(refused)?.flatten();
    Ok(entries.filter(|entry| entry.path().is_file()).map(|entry| entry.file_name().to_string_lossy().into()).collect())
}
