//! `bfree new`: a scene to start from.
//!
//! JSON has no comments. Instead, the scene names its JSON Schema, which is written beside the scene. Editors show the sentence of each key
//! from the schema. The command also prints these sentences.

use super::failure::{Failure, print};
use crate::scene::{self, keys};
use clap::Args;
use clap::builder::PossibleValuesParser;
use std::fmt::Write as _;
use std::fs::OpenOptions;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};

/// Names of problems, each with its scene.
macro_rules! problems {
    ($($name:ident)*) => {
        [$((stringify!($name), include_str!(concat!("../../scenes/", stringify!($name), ".json")))),*]
    };
}

/// Name and scene of every problem.
const PROBLEMS: [(&str, &str); 21] = problems! {
    rebound collision cantilever compaction riemann_jump ball_drop column_static elastica cook ring tube cook_plastic taylor slope
    collapse bounce rolling punch wedge rings billiard
};

/// File name of the schema beside the scene.
const SCHEMA: &str = "scene.schema.json";

/// Width of a line.
const LINE_WIDTH: usize = 110;

/// Width of the column of keys. The sentence of a longer key begins on the next line.
const KEY_WIDTH: usize = 34;

/// `bfree new`.
#[derive(Args)]
pub(super) struct New {
    /// The problem; without a problem, all problems are listed.
    #[arg(value_parser = PossibleValuesParser::new(PROBLEMS.map(|(name, _)| name)))]
    problem: Option<String>,
    /// The file to write [default: the problem's name and .json]. An existing file is not overwritten.
    file: Option<PathBuf>,
}

impl New {
    /// Writes the scene of the problem, or prints the list of problems.
    pub(crate) fn execute(&self) -> Result<(), Failure> {
        let Some((name, text)) = PROBLEMS.iter().find(|(name, _)| Some(*name) == self.problem.as_deref()) else {
            return print(list());
        };
        let path = self.file.clone().unwrap_or_else(|| PathBuf::from(format!("{name}.json")));
        let schema = path.parent().unwrap_or(Path::new("")).join(SCHEMA);
        create(&path, &text.replacen('{', &format!("{{\n  \"$schema\": \"{SCHEMA}\","), 1))?;
        match create(&schema, &serde_json::to_string_pretty(&scene::schema()).map_err(Failure::run)?) {
            // The schema of an earlier scene exists already.
            Err(Failure::Scene(_)) => {}
            result => result?,
        }
        let shown = path.display();
        let mut out = format!("wrote {shown}, and {} for completion in editors\n", schema.display());
        // Writing to a string cannot fail.
        let _ = writeln!(out, "\n{}", explained(text)?);
        let _ = write!(out, "bfree check {shown}\nbfree run {shown}");
        print(out)
    }
}

fn list() -> String {
    let mut out = "bfree new PROBLEM [FILE] writes the scene of one of these:\n".to_owned();
    for (name, text) in PROBLEMS {
        let title = scene::read(text, &[]).ok().and_then(|scene| scene.title).unwrap_or_default();
        let _ = write!(out, "\n  {name:<14} {title}");
    }
    out
}

/// Every key of the scene with its sentence, in columns.
fn explained(text: &str) -> Result<String, Failure> {
    let scene = serde_json::from_str(text).map_err(Failure::run)?;
    let mut out = String::new();
    for key in keys::documented(&scene) {
        let mut line = format!("{:<KEY_WIDTH$}", key.path);
        let length = line.chars().count();
        let mut column = if length > KEY_WIDTH { LINE_WIDTH } else { length };
        for word in key.about.split(' ') {
            let length = word.chars().count() + 1;
            if column + length > LINE_WIDTH {
                let _ = write!(line, "\n{:KEY_WIDTH$}", "");
                column = KEY_WIDTH;
            }
            let _ = write!(line, " {word}");
            column += length;
        }
        let _ = writeln!(out, "{line}");
    }
    Ok(out)
}

/// Writes a new file. An existing file is an error.
fn create(path: &Path, content: &str) -> Result<(), Failure> {
    let place = path.display();
    let created = OpenOptions::new().write(true).create_new(true).open(path);
    match created.and_then(|mut file| file.write_all(content.as_bytes())) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => Err(Failure::scene(format!(
            "{place} exists and stays as it is: name another file (bfree new PROBLEM FILE), or remove it"
        ))),
        written => written.map_err(Failure::system(format_args!("write {place}"))),
    }
}
