//! Text as JSON, with the place of an error.

use super::place::{Step, path};
use crate::problems::Place;
use serde::de::{self, Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};
use serde_path_to_error::Segment;
use std::fmt::{self, Display};

/// Maximum characters of a path, about twice the longest path of a real scene.
const PATH: usize = 160;

/// Text that is not JSON, or does not have the types of a scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct Malformed {
    /// The key, such as `bodies[0].density`; empty if the text is not JSON.
    pub path: String,
    /// Description of the error.
    pub message: String,
    /// Position of the error.
    pub place: Option<Place>,
    /// Further errors of this kind.
    pub others: Vec<Malformed>,
}

impl Display for Malformed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let separator = if self.path.is_empty() { "" } else { ": " };
        // Nobody reads a path through a hundred brackets, so a long path is cut.
        let path: String = self.path.chars().take(PATH).collect();
        let more = if path.len() < self.path.len() { "…" } else { "" };
        write!(f, "{path}{more}{separator}{}", self.message)?;
        self.place.iter().try_for_each(|place| write!(f, "\n{place}"))?;
        self.others.iter().try_for_each(|other| write!(f, "\n{other}"))
    }
}

/// Parses text as JSON; a duplicate key is an error.
pub(super) fn parse(text: &str) -> Result<Value, Malformed> {
    let mut json = serde_json::Deserializer::from_str(text);
    let located = |path: String, error: &serde_json::Error| {
        let place = Place::at_line(text, error.line(), error.column());
        let full = error.to_string();
        let bare = full.rfind(" at line ").and_then(|end| full.get(..end)).unwrap_or(&full);
        let hint = match &place {
            Place::Text { excerpt, indent, .. } => hint(&excerpt.chars().skip(*indent).collect::<String>()),
            Place::Override(_) => "",
        };
        Malformed { path, message: format!("{bare}{hint}"), place: Some(place), others: Vec::new() }
    };
    let value: Unique = serde_path_to_error::deserialize(&mut json)
        .map_err(|error| located(path(&segments(error.path())), error.inner()))?;
    json.end().map_err(|error| located(String::new(), &error))?;
    Ok(value.0)
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
