//! The faults as the sources name them: `mutant!("name": …)`.

use super::table::FAULTS;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// The beginning of a fault in the sources, up to its name.
const BEGINNING: &str = "mutant!(\"";

/// The sources and the table name different faults.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum Mismatch {
    #[error("the fault `{name}` is in the table, but in no file of src")]
    NotInSources { name: String },
    #[error("the fault `{name}` of {place} is not in the table")]
    NotInTable { name: String, place: String },
    #[error("two faults have the name `{name}`: {first} and {second}")]
    Twice { name: String, first: String, second: String },
}

/// The sources could not be read, or they do not match the table.
#[derive(Debug, thiserror::Error)]
pub(super) enum SourceError {
    #[error("cannot read {path}")]
    Read { path: PathBuf, source: io::Error },
    #[error(transparent)]
    Mismatch(#[from] Mismatch),
}

/// The place of each fault, `file:line`, by its name.
pub(super) type Places = BTreeMap<String, String>;

/// The places of all faults below `src` of the workspace `root`, which are those of the table.
pub(super) fn places(root: &Path) -> Result<Places, SourceError> {
    let mut texts = Vec::new();
    read(root, Path::new("src"), &mut texts)?;
    Ok(matched(texts.iter().flat_map(|(file, text)| named(file, text)), FAULTS.iter().map(|fault| fault.name))?)
}

/// Appends the sources below `folder` with their paths relative to `root`.
fn read(root: &Path, folder: &Path, texts: &mut Vec<(String, String)>) -> Result<(), SourceError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| SourceError::Read { path, source }
    };
    for entry in fs::read_dir(root.join(folder)).map_err(failed(folder))? {
        let entry = entry.map_err(failed(folder))?;
        let path = folder.join(entry.file_name());
        if entry.path().is_dir() {
            read(root, &path, texts)?;
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            let text = fs::read_to_string(entry.path()).map_err(failed(&path))?;
            texts.push((path.display().to_string(), text));
        }
    }
    Ok(())
}

/// The names of the faults in a file, with their places. Comments are left out.
fn named(file: &str, text: &str) -> Vec<(String, String)> {
    let of_line = |(number, line): (usize, &str)| {
        let line = line.trim_start().strip_prefix(BEGINNING)?;
        let (name, _) = line.split_once('"')?;
        Some((name.to_owned(), format!("{file}:{}", number + 1)))
    };
    text.lines().enumerate().filter_map(of_line).collect()
}

/// The faults by their names, if the names are those of the table and occur once.
fn matched<'a>(
    found: impl IntoIterator<Item = (String, String)>,
    table: impl Iterator<Item = &'a str>,
) -> Result<Places, Mismatch> {
    let mut places = Places::new();
    for (name, second) in found {
        if let Some(first) = places.insert(name.clone(), second.clone()) {
            return Err(Mismatch::Twice { name, first, second });
        }
    }
    let mut left = places.clone();
    for name in table {
        if left.remove(name).is_none() {
            return Err(match places.get(name) {
                Some(place) => {
                    Mismatch::Twice { name: name.into(), first: place.clone(), second: "again in the table".into() }
                }
                None => Mismatch::NotInSources { name: name.into() },
            });
        }
    }
    match left.pop_first() {
        Some((name, place)) => Err(Mismatch::NotInTable { name, place }),
        None => Ok(places),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_the_faults_of_the_sources() -> Result<(), SourceError> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        assert_eq!(places(&root)?.len(), FAULTS.len());
        Ok(())
    }

    #[test]
    fn a_name_that_is_missing_or_not_alone_is_an_error() {
        let source = "//! mutant!(\"comment\": { })\nlet a = 1;\n    mutant!(\"one\": a = 2);\n    mutant!(\"two\": { return; });";
        let found = named("a.rs", source);
        let place = |name: &str, line: usize| (name.to_owned(), format!("a.rs:{line}"));
        assert_eq!(found, [place("one", 3), place("two", 4)]);
        let judged = |table: &'static [&str]| matched(found.clone(), table.iter().copied()).err();
        assert_eq!(judged(&["two", "one"]), None);
        assert_eq!(judged(&["one"]), Some(Mismatch::NotInTable { name: "two".into(), place: "a.rs:4".into() }));
        assert_eq!(judged(&["one", "two", "three"]), Some(Mismatch::NotInSources { name: "three".into() }));
        assert!(matches!(judged(&["one", "two", "one"]), Some(Mismatch::Twice { .. })));
        let twice = [place("one", 3), place("one", 9)];
        assert!(matches!(matched(twice, ["one"].into_iter()), Err(Mismatch::Twice { .. })));
    }
}
