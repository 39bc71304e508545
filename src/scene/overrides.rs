//! Values replaced from the command line: `KEY.PATH=JSON`.

use super::json::parse;
use super::place::{Step, path, steps};
use serde_json::Value;
use std::str::FromStr;

/// Maximum number of keys along a path, far more than a scene is deep.
const MAX_STEPS: usize = 32;

/// A value of the scene to replace or add, parsed from `KEY.PATH=JSON`.
///
/// ```
/// use bfree::scene::Override;
///
/// assert!("time.step=0.01".parse::<Override>().is_ok());
/// assert!("bodies.0.density=3".parse::<Override>().is_ok());
/// assert!("approximation=linear".parse::<Override>().is_ok()); // a bare word is a string
/// assert!("time.step".parse::<Override>().is_err());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    argument: String,
    pub(super) steps: Vec<Step>,
    value: Value,
}

/// An override that cannot be applied, with the reason.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct OverrideError(String);

impl FromStr for Override {
    type Err = OverrideError;

    fn from_str(argument: &str) -> Result<Self, OverrideError> {
        let form = || {
            let form = "must read KEY.PATH=JSON, such as time.step=0.01 or bodies.0.density=3";
            OverrideError(format!("the override {argument:?} is not allowed; {form}"))
        };
        let (key, text) = argument.split_once('=').ok_or_else(form)?;
        let steps = Some(key.trim()).filter(|key| is_path(key)).map(steps);
        let steps = steps.filter(|steps| steps.len() <= MAX_STEPS).ok_or_else(form)?;
        let value = match parse(text) {
            Ok(value) => value,
            Err(_) if is_word(text.trim()) => Value::String(text.trim().to_owned()),
            Err(malformed) => {
                let message = malformed.message;
                return Err(OverrideError(format!("the value of the override {argument:?} is not JSON: {message}")));
            }
        };
        Ok(Self { argument: argument.to_owned(), steps, value })
    }
}

impl Override {
    /// The argument of the command line.
    pub(super) fn argument(&self) -> &str {
        &self.argument
    }

    /// Replaces or adds the value in a scene. Absent objects along the path are created.
    pub(super) fn apply(&self, scene: &mut Value) -> Result<(), OverrideError> {
        let mut here = scene;
        for (i, step) in self.steps.iter().enumerate() {
            here = next(here, step).map_err(|message| {
                let at = if i == 0 { "the scene".to_owned() } else { path(&self.steps[..i]) };
                OverrideError(format!("the override {:?} leads nowhere: {at} {message}", self.argument))
            })?;
        }
        *here = self.value.clone();
        Ok(())
    }
}

/// The value to which a step leads; an absent one is created. Or the reason why there is none.
pub(super) fn next<'a>(value: &'a mut Value, step: &Step) -> Result<&'a mut Value, String> {
    if value.is_null() && matches!(step, Step::Key(_)) {
        *value = Value::Object(serde_json::Map::new());
    }
    match (value, step) {
        (Value::Object(object), Step::Key(key)) => Ok(object.entry(key.as_str()).or_insert(Value::Null)),
        (Value::Array(list), Step::Index(index)) => {
            let entries = list.len();
            let next = list.get_mut(*index);
            next.ok_or_else(|| format!("has {entries} entries, counted from 0; {index} is not one of them"))
        }
        (Value::Array(list), Step::Key(key)) => {
            Err(format!("is a list of {} entries; it takes a number, not {key:?}", list.len()))
        }
        (Value::Object(_), Step::Index(index)) => Err(format!("is an object; it takes a key, not the number {index}")),
        (Value::Null, _) => Err("is null, which has no keys".to_owned()),
        (Value::Bool(_), _) => Err("is true or false, which has no keys".to_owned()),
        (Value::Number(_), _) => Err("is a number, which has no keys".to_owned()),
        (Value::String(_), _) => Err("is a string, which has no keys".to_owned()),
    }
}

/// Whether each part between dots has a key, and each pair of brackets a number.
fn is_path(text: &str) -> bool {
    text.split('.').all(|word| {
        let (key, indices) = word.split_at(word.find('[').unwrap_or(word.len()));
        let numbers = indices.strip_prefix('[').map(|rest| rest.strip_suffix(']').unwrap_or("").split("]["));
        let closed = numbers.is_none_or(|mut all| all.all(|number| number.parse::<usize>().is_ok()));
        !key.is_empty() && !key.contains(']') && closed
    })
}

/// Whether text without quotes counts as a string.
fn is_word(text: &str) -> bool {
    let mut letters = text.chars();
    letters.next().is_some_and(|c| c.is_ascii_alphabetic() || c == '_')
        && letters.all(|c| c.is_ascii_alphanumeric() || "_-./ ".contains(c))
}
