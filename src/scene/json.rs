//! Text as JSON, with the place of an error.

use super::place::{Step, path};
use crate::problems::{Place, Problem};
use serde::de::{self, Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};
use serde_path_to_error::Segment;
use std::fmt;

/// Parses text as JSON; a duplicate key is an error.
pub(super) fn parse(text: &str) -> Result<Value, Problem> {
    let mut json = serde_json::Deserializer::from_str(text);
    let located = |path: String, error: &serde_json::Error| {
        let offset = offset(text, error.line(), error.column());
        let full = error.to_string();
        let bare = full.rsplit_once(" at line ").map_or(full.as_str(), |(bare, _)| bare);
        let message = format!("{bare}{}", hint(text.get(offset..).unwrap_or_default()));
        Problem { path, message, place: Some(Place::at(text, offset)) }
    };
    let value: Unique = serde_path_to_error::deserialize(&mut json)
        .map_err(|error| located(path(&segments(error.path())), error.inner()))?;
    json.end().map_err(|error| located(String::new(), &error))?;
    Ok(value.0)
}

/// The offset of a line and byte column as counted by serde_json, both from 1 (column 0: before the line).
fn offset(text: &str, line: usize, column: usize) -> usize {
    let start: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
    start + column.saturating_sub(1)
}

/// A hint at a common mistake in JSON, by the text at the error.
fn hint(rest: &str) -> &'static str {
    let starts = |words: &[&str]| words.iter().any(|word| rest.starts_with(word));
    if starts(&["NaN", "nan", "Inf", "inf"]) {
        "; JSON has no NaN and no infinity"
    } else if starts(&["//", "/*", "#"]) {
        "; JSON has no comments"
    } else if starts(&["'"]) {
        "; strings stand in double quotes"
    } else {
        ""
    }
}

/// The steps of a path of `serde_path_to_error`.
pub(super) fn segments(path: &serde_path_to_error::Path) -> Vec<Step> {
    path.iter()
        .filter_map(|segment| match segment {
            Segment::Seq { index } => Some(Step::Index(*index)),
            Segment::Map { key } | Segment::Enum { variant: key } => Some(Step::Key(key.clone())),
            Segment::Unknown => None,
        })
        .collect()
}

/// JSON without duplicate keys.
struct Unique(Value);

impl<'de> Deserialize<'de> for Unique {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(UniqueVisitor).map(Self)
    }
}

struct UniqueVisitor;

/// Scalars stay unchanged.
macro_rules! scalars {
    ($($visit:ident: $scalar:ty),*) => {$(
        fn $visit<E>(self, x: $scalar) -> Result<Value, E> {
            Ok(x.into())
        }
    )*};
}

impl<'de> Visitor<'de> for UniqueVisitor {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    scalars! { visit_bool: bool, visit_u64: u64, visit_i64: i64, visit_f64: f64, visit_str: &str }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut list = Vec::new();
        while let Some(Unique(entry)) = entries.next_element()? {
            list.push(entry);
        }
        Ok(Value::Array(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut object = Map::new();
        while let Some(key) = entries.next_key::<String>()? {
            if object.contains_key(&key) {
                return Err(de::Error::custom(format_args!("the key `{key}` is given twice in one object")));
            }
            let Unique(value) = entries.next_value()?;
            object.insert(key, value);
        }
        Ok(Value::Object(object))
    }
}
